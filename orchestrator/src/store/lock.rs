//! Kernel locks: they end with the process that holds them, so nothing is ever left to unlock.

use camino::{Utf8Path, Utf8PathBuf};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use std::fs::{self, File};
use std::io::{self, Read, Seek, Write};

/// A lock, held until it is dropped.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

/// A lock that cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another process holds it.
    #[error("{what} is in use by process {pid} (lock {path}); wait for it to end or stop it")]
    Held {
        /// What is locked.
        what: String,
        /// Process number as written by the holder; `?` when it has not written it yet.
        pid: String,
        /// The lock file.
        path: Utf8PathBuf,
    },
    /// The file cannot be made or locked.
    #[error("cannot lock {path}: {source}")]
    Io {
        /// The lock file.
        path: Utf8PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl Lock {
    /// Takes the lock alone and writes this process's number into it.
    ///
    /// # Errors
    /// When another process holds it, or on trouble with the file.
    pub fn exclusive(path: &Utf8Path, what: &str) -> Result<Self, LockError> {
        Self::take(path, what, true)
    }

    /// Takes the lock together with others.
    ///
    /// # Errors
    /// As [`Lock::exclusive`].
    pub fn shared(path: &Utf8Path, what: &str) -> Result<Self, LockError> {
        Self::take(path, what, false)
    }

    fn take(path: &Utf8Path, what: &str, alone: bool) -> Result<Self, LockError> {
        let failed = |source| LockError::Io {
            path: path.to_owned(),
            source,
        };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(failed)?;
        }
        let mut options = File::options();
        let mut file = options
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(failed)?;
        let how = if alone {
            FlockOperation::NonBlockingLockExclusive
        } else {
            FlockOperation::NonBlockingLockShared
        };
        match flock(&file, how) {
            Ok(()) => {}
            Err(Errno::WOULDBLOCK) => {
                let mut pid = String::new();
                let _ = file.read_to_string(&mut pid);
                let pid = match pid.trim() {
                    "" => "?".into(),
                    pid => pid.to_owned(),
                };
                return Err(LockError::Held {
                    what: what.to_owned(),
                    pid,
                    path: path.to_owned(),
                });
            }
            Err(e) => return Err(failed(e.into())),
        }
        let write = |file: &mut File| {
            file.set_len(0)?;
            file.rewind()?;
            writeln!(file, "{}", std::process::id())
        };
        write(&mut file).map_err(failed)?;
        Ok(Self { _file: file })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_holder_is_told_who_holds_it_and_gets_it_after_the_drop() {
        let folder = tempfile::tempdir().unwrap();
        let path = Utf8PathBuf::from_path_buf(folder.path().join("x/lock")).unwrap();
        let first = Lock::exclusive(&path, "the run").unwrap();
        let error = Lock::exclusive(&path, "the run").unwrap_err().to_string();
        assert!(
            error.contains(&format!("process {}", std::process::id())),
            "{error}"
        );
        drop(first);
        let _a = Lock::shared(&path, "the store").unwrap();
        let _b = Lock::shared(&path, "the store").unwrap();
        assert!(Lock::exclusive(&path, "the store").is_err());
    }
}
