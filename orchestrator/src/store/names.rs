//! Names of files in a store, and what is done with files by their names.

use crate::plan::Key;
use camino::{Utf8Path, Utf8PathBuf};
use std::{fs, io};

/// Ending of an artifact's name: programs that show meshes choose their reader by it.
pub const ENDING: &str = ".vtkhdf";

/// Ending of a record's name.
pub const RECORD_ENDING: &str = ".record.json";

/// Ending of artifacts of earlier versions, which kept no hash of them.
pub const EARLIER_ENDING: &str = ".h5";

/// A name that is safe as a file name and still tells names apart.
pub fn safe_name(name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.[],".contains(c);
    if !name.is_empty() && !name.starts_with('.') && name.chars().all(plain) && name.len() < 120 {
        return name.to_owned();
    }
    let kept: String = name
        .chars()
        .map(|c| if plain(c) { c } else { '_' })
        .take(60)
        .collect();
    let hash = blake3::hash(name.as_bytes()).to_hex();
    format!("{}-{}", kept.trim_start_matches('.'), &hash[..8])
}

/// The key of which a file is, by its name and ending.
pub fn key_of(file: &Utf8Path, ending: &str) -> Option<Key> {
    Key::from_hex(file.file_name()?.strip_suffix(ending)?)
}

/// This path, or the first of `PATH.2`, `PATH.3` .. at which nothing lies: whatever lies there stays.
pub fn free_name(path: &Utf8Path) -> Utf8PathBuf {
    let numbered = (2..).map(|n| Utf8PathBuf::from(format!("{path}.{n}")));
    let mut all = std::iter::once(path.to_owned()).chain(numbered);
    all.find(|p| fs::symlink_metadata(p).is_err())
        .unwrap_or_else(|| path.to_owned())
}

/// What lies in a folder, sorted; nothing where there is none.
///
/// # Errors
/// When it cannot be read.
pub fn list(folder: &Utf8Path) -> io::Result<Vec<Utf8PathBuf>> {
    let mut found = Vec::new();
    match folder.read_dir_utf8() {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(found),
        Err(e) => return Err(e),
        Ok(entries) => {
            for entry in entries {
                found.push(entry?.into_path());
            }
        }
    }
    found.sort();
    Ok(found)
}

/// Renames a file, or copies it where the target lies on another disk: whole or not at all.
///
/// # Errors
/// When the disk refuses.
pub fn place(from: &Utf8Path, to: &Utf8Path) -> io::Result<()> {
    match fs::rename(from, to) {
        Err(e) if e.kind() == io::ErrorKind::CrossesDevices => {
            let beside = plyflow_artifact::whole::begun(to.as_std_path());
            let copied = fs::copy(from, &beside)
                .and_then(|_| fs::File::open(&beside)?.sync_all())
                .and_then(|()| fs::rename(&beside, to));
            if copied.is_err() {
                let _ = fs::remove_file(&beside);
            }
            copied?;
            fs::remove_file(from)
        }
        other => other,
    }
}
