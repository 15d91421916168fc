//! What stands at the end of the library: JSON, its length (u64, little-endian), and [`MAGIC`].

use serde::Deserialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// The last bytes of a library that carries a step.
const MAGIC: &[u8; 16] = b"PLYFLOW-PYTHON-1";

/// Most bytes of a payload.
const MOST: u64 = 64 << 20;

/// A step in Python.
#[derive(Debug, Clone, Deserialize)]
pub struct Payload {
    /// The manifest, JSON.
    pub manifest: String,
    /// Name of the file with the step, one of `sources`.
    pub main: String,
    /// The file and the modules beside it that it imports: text by path from the file's folder.
    pub sources: BTreeMap<String, String>,
    /// Version of the interpreter, such as `cpython 3.11.7`.
    pub python: String,
    /// Versions of the packages that it imports, by name.
    pub packages: BTreeMap<String, String>,
    /// Top-level modules that are loaded when the file is imported.
    pub modules: Vec<String>,
}

/// Why a library carries no step.
#[derive(Debug, thiserror::Error)]
pub enum PayloadError {
    /// It does not end as one that does.
    #[error("it carries no step in Python")]
    None,
    /// Its end cannot be read.
    #[error(transparent)]
    Io(#[from] std::io::Error),
    /// What it carries is not what this version reads.
    #[error("the step that it carries cannot be read: {0}")]
    Json(#[from] serde_json::Error),
}

impl Payload {
    /// Reads the payload of a library.
    ///
    /// # Errors
    /// When there is none, or it cannot be read.
    pub fn of(library: &Path) -> Result<Self, PayloadError> {
        let mut file = File::open(library)?;
        let size = file.metadata()?.len();
        let trailer = 8 + MAGIC.len() as u64;
        if size < trailer {
            return Err(PayloadError::None);
        }
        file.seek(SeekFrom::Start(size - trailer))?;
        let (mut length, mut magic) = ([0u8; 8], [0u8; 16]);
        file.read_exact(&mut length)?;
        file.read_exact(&mut magic)?;
        let length = u64::from_le_bytes(length);
        if magic != *MAGIC || length > MOST.min(size - trailer) {
            return Err(PayloadError::None);
        }
        file.seek(SeekFrom::Start(size - trailer - length))?;
        let mut text = Vec::new();
        file.take(length).read_to_end(&mut text)?;
        Ok(serde_json::from_slice(&text)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn library(payload: &str, magic: &[u8]) -> tempfile::NamedTempFile {
        let file = tempfile::NamedTempFile::new().unwrap();
        let mut bytes = b"\x7fELF and so on".to_vec();
        bytes.extend(payload.as_bytes());
        bytes.extend((payload.len() as u64).to_le_bytes());
        bytes.extend(magic);
        std::fs::write(file.path(), bytes).unwrap();
        file
    }

    const STEP: &str = r#"{"manifest": "{}", "main": "a.py", "sources": {"a.py": "x = 1\n"}, "python": "cpython 3.11.7", "packages": {"numpy": "2.0"}, "modules": ["numpy"]}"#;

    #[test]
    fn a_payload_is_read_from_the_end_of_its_library() {
        let payload = Payload::of(library(STEP, MAGIC).path()).unwrap();
        assert_eq!(payload.sources["a.py"], "x = 1\n");
        assert_eq!(payload.packages["numpy"], "2.0");
    }

    #[test]
    fn a_library_without_or_with_a_torn_payload_carries_nothing() {
        let plain = library(STEP, b"PLYFLOW-PYTHON-9");
        assert!(matches!(Payload::of(plain.path()), Err(PayloadError::None)));
        let empty = tempfile::NamedTempFile::new().unwrap();
        assert!(matches!(Payload::of(empty.path()), Err(PayloadError::None)));
        let torn = library(&STEP[..40], MAGIC);
        assert!(matches!(
            Payload::of(torn.path()),
            Err(PayloadError::Json(_))
        ));
        let mut bytes = std::fs::read(library(STEP, MAGIC).path()).unwrap();
        let at = bytes.len() - 24;
        bytes[at..at + 8].copy_from_slice(&u64::MAX.to_le_bytes());
        std::fs::write(empty.path(), bytes).unwrap();
        assert!(matches!(Payload::of(empty.path()), Err(PayloadError::None)));
    }
}
