//! Opening what a user names: files of data alone, up to a size.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use unicode_normalization::{UnicodeNormalization, is_nfc};

/// Most bytes of a file of data: facets, points, tests.
pub const MOST_DATA: u64 = 2 << 30;

/// Most bytes of a journal or a cache that a program has written itself.
pub const MOST_NOTED: u64 = 8 << 30;

/// Most bytes of a file that people write: workflows, scenes, materials, expectations.
pub const MOST_WRITTEN: u64 = 16 << 20;

/// Why a file is not read. The texts do not name it.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// There is none.
    #[error("there is no such file")]
    Missing,
    /// A folder, a pipe, a device, a socket: reading it may never end.
    #[error("it is {0}, no file with data")]
    Special(&'static str),
    /// Larger than what is read.
    #[error("it has {} of data; at most {} are read", amount(*.size), amount(*.most))]
    Large {
        /// Bytes.
        size: u64,
        /// Bytes.
        most: u64,
    },
    /// What the system says.
    #[error("{0}")]
    System(#[from] std::io::Error),
}

impl From<FileError> for std::io::Error {
    fn from(e: FileError) -> Self {
        match e {
            FileError::System(e) => e,
            FileError::Missing => Self::new(std::io::ErrorKind::NotFound, e),
            FileError::Special(_) => Self::new(std::io::ErrorKind::InvalidInput, e),
            FileError::Large { .. } => Self::new(std::io::ErrorKind::FileTooLarge, e),
        }
    }
}

/// Bytes in words.
fn amount(bytes: u64) -> String {
    match bytes {
        0..1024 => format!("{bytes} bytes"),
        1024..0x10_0000 => format!("{:.1} KiB", bytes as f64 / 1024.0),
        _ => format!("{:.1} MiB", bytes as f64 / 1_048_576.0),
    }
}

/// Opens a file that holds data, of at most `most` bytes.
///
/// # Errors
/// See [`FileError`].
pub fn open(path: &Path, most: u64) -> Result<File, FileError> {
    let system = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::NotFound => FileError::Missing,
        _ => FileError::System(e),
    };
    // Before it is opened: opening a pipe waits for somebody to write.
    check(&std::fs::metadata(path).map_err(system)?, most)?;
    let file = File::open(path).map_err(system)?;
    check(&file.metadata()?, most)?;
    Ok(file)
}

fn check(found: &std::fs::Metadata, most: u64) -> Result<(), FileError> {
    if found.is_dir() {
        return Err(FileError::Special("a folder"));
    }
    if !found.is_file() {
        return Err(FileError::Special(special(found)));
    }
    match found.len() {
        size if size > most => Err(FileError::Large { size, most }),
        _ => Ok(()),
    }
}

#[cfg(unix)]
fn special(found: &std::fs::Metadata) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    let kind = found.file_type();
    if kind.is_fifo() {
        "a pipe"
    } else if kind.is_socket() {
        "a socket"
    } else {
        "a device"
    }
}

#[cfg(not(unix))]
fn special(_: &std::fs::Metadata) -> &'static str {
    "a device"
}

/// All bytes of a file of data, of at most `most` bytes.
///
/// # Errors
/// See [`FileError`].
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
    let file = open(path, most)?;
    let mut bytes = Vec::with_capacity(file.metadata()?.len() as usize);
    // It may grow meanwhile, or be one of those that tell no length.
    file.take(most + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 {
        size if size > most => Err(FileError::Large { size, most }),
        _ => Ok(bytes),
    }
}

/// The path of the file that `path` means: itself where there is something, else the one whose names are the same text in another
/// form of Unicode (`ö` as one character, or as `o` with a mark: disks of Macs and archives of theirs have the second). `None` where
/// there is none, or more than one.
pub fn in_other_form(path: &Path) -> Option<PathBuf> {
    if path.exists() {
        return Some(path.to_owned());
    }
    if path.as_os_str().is_ascii() {
        return None;
    }
    let mut found = PathBuf::new();
    for part in path.components() {
        let next = found.join(part);
        if next.exists() {
            found = next;
            continue;
        }
        let wanted = composed(part.as_os_str().to_str()?);
        let folder = match found.as_os_str().is_empty() {
            true => Path::new("."),
            false => &found,
        };
        let same = std::fs::read_dir(folder).ok()?.filter_map(|entry| {
            let name = entry.ok()?.file_name();
            (composed(name.to_str()?) == wanted).then_some(name)
        });
        let mut same: Vec<_> = same.take(2).collect();
        let (Some(one), true) = (same.pop(), same.is_empty()) else {
            return None;
        };
        found.push(one);
    }
    Some(found)
}

/// A text in its composed form.
pub fn composed(text: &str) -> String {
    if is_nfc(text) {
        text.to_owned()
    } else {
        text.nfc().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_file_of_data_is_refused_before_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        for (path, says) in [
            (pipe.as_path(), "it is a pipe"),
            (Path::new("/dev/zero"), "it is a device"),
            (folder.path(), "it is a folder"),
            (&folder.path().join("none"), "there is no such file"),
        ] {
            let error = read(path, 100).unwrap_err().to_string();
            assert!(error.starts_with(says), "{error}");
        }
    }

    #[test]
    fn a_file_is_read_up_to_its_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, [7; 100]).unwrap();
        assert_eq!(read(&path, 100).unwrap(), [7; 100]);
        let error = read(&path, 99).unwrap_err().to_string();
        assert_eq!(error, "it has 100 bytes of data; at most 99 bytes are read");
    }

    #[test]
    fn a_name_in_another_form_of_unicode_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let (one, marked) = ("gr\u{f6}\u{df}e", "gro\u{308}\u{df}e");
        std::fs::create_dir(folder.path().join(marked)).unwrap();
        let there = folder.path().join(marked).join(format!("{one}.stl"));
        std::fs::write(&there, "x").unwrap();
        let named = folder.path().join(one).join(format!("{marked}.stl"));
        assert_eq!(in_other_form(&named), Some(there.clone()));
        assert_eq!(in_other_form(&there), Some(there.clone()));
        assert_eq!(in_other_form(&named.with_extension("csv")), None);
        // Two that are alike: neither is meant for certain.
        let path = |name: &str| folder.path().join(name);
        for name in ["e\u{301}\u{323}", "e\u{323}\u{301}"] {
            std::fs::write(path(name), "x").unwrap();
        }
        assert_eq!(in_other_form(&path("\u{1eb9}\u{301}")), None);
    }
}
