//! Kernel locks: they end with the process that holds them, so nothing is ever left to unlock.

use super::names::free_name;
use camino::{Utf8Path, Utf8PathBuf};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use std::fs::{self, File, Metadata};
use std::io::{self, Read, Seek, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};

/// A lock, held until it is dropped.
#[derive(Debug)]
pub struct Lock {
    _file: File,
}

/// A lock that cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another process holds it.
    #[error("{what} is in use by {by} (lock {path}); wait for it to end or stop it")]
    Held {
        /// What is locked.
        what: String,
        /// The processes that hold it, in words.
        by: String,
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
    /// Takes the lock alone and writes this process's number into it, for people who look.
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
        let is_none = match fs::metadata(path) {
            Ok(found) => !found.is_file(),
            // A link to itself, for one.
            Err(e) => fs::symlink_metadata(path).is_ok() && e.kind() != io::ErrorKind::NotFound,
        };
        if is_none {
            // Nobody holds what nobody could open.
            fs::rename(path, free_name(&path.with_extension("damaged"))).map_err(failed)?;
        }
        let mut options = File::options();
        options.read(true).write(true).create(true).truncate(false);
        let mut file = match options.open(path) {
            // One's own, which somebody has closed to oneself: it stays the same file, so whoever holds it goes on to hold it.
            Err(e) if e.kind() == io::ErrorKind::PermissionDenied && is_own(path) => {
                fs::set_permissions(path, fs::Permissions::from_mode(0o600)).map_err(failed)?;
                options.open(path)
            }
            other => other,
        }
        .map_err(failed)?;
        let how = if alone {
            FlockOperation::NonBlockingLockExclusive
        } else {
            FlockOperation::NonBlockingLockShared
        };
        match flock(&file, how) {
            Ok(()) => {}
            Err(Errno::WOULDBLOCK) => {
                return Err(LockError::Held {
                    what: what.to_owned(),
                    by: holders(&mut file),
                    path: path.to_owned(),
                });
            }
            Err(e) => return Err(failed(e.into())),
        }
        let write = |file: &mut File| {
            file.set_len(0)?;
            file.rewind()?;
            match alone {
                true => writeln!(file, "{}", std::process::id()),
                // Of those who share it none can speak for all.
                false => Ok(()),
            }
        };
        write(&mut file).map_err(failed)?;
        Ok(Self { _file: file })
    }
}

/// Whether a plain file belongs to the user of this process.
fn is_own(path: &Utf8Path) -> bool {
    let own = rustix::process::geteuid().as_raw();
    fs::symlink_metadata(path).is_ok_and(|m| m.is_file() && m.uid() == own)
}

/// The processes that hold a lock, in words: as the kernel tells; else the one that wrote its number when it took the lock alone.
fn holders(file: &mut File) -> String {
    let mut pids = file.metadata().map_or(Vec::new(), |m| told_by_kernel(&m));
    if pids.is_empty() {
        let mut written = String::new();
        let _ = file.take(32).read_to_string(&mut written);
        pids.extend(written.trim().parse::<u32>().ok());
    }
    match &pids[..] {
        [] => "another process".into(),
        [pid] => format!("process {pid}"),
        all => {
            let all: Vec<String> = all.iter().map(u32::to_string).collect();
            format!("processes {}", all.join(", "))
        }
    }
}

/// From lines of `/proc/locks`: `1: FLOCK  ADVISORY  WRITE 4242 fd:01:1234567 0 EOF`. Processes of other containers have no number here.
fn told_by_kernel(file: &Metadata) -> Vec<u32> {
    let device = file.dev();
    let place = format!(
        "{:02x}:{:02x}:{}",
        rustix::fs::major(device),
        rustix::fs::minor(device),
        file.ino()
    );
    let text = fs::read_to_string("/proc/locks").unwrap_or_default();
    let of_line = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        // Who waits for a lock has an arrow behind the number.
        match words[..] {
            [_, "FLOCK", _, _, pid, at, ..] if at == place => pid.parse::<u32>().ok(),
            _ => None,
        }
    };
    let mut pids: Vec<u32> = text
        .lines()
        .filter_map(of_line)
        .filter(|p| *p > 0)
        .collect();
    pids.sort_unstable();
    pids.dedup();
    pids
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_file_in_the_place_of_a_lock_blocks_nobody() {
        let folder = tempfile::tempdir().unwrap();
        let path = Utf8PathBuf::from_path_buf(folder.path().join("lock")).unwrap();
        fs::create_dir(&path).unwrap();
        drop(Lock::exclusive(&path, "the run").unwrap());
        assert!(path.is_file());
        fs::remove_file(&path).unwrap();
        let made = std::process::Command::new("mkfifo").arg(&path).status();
        assert!(made.unwrap().success());
        drop(Lock::exclusive(&path, "the run").unwrap());
        assert!(path.is_file());
        fs::remove_file(&path).unwrap();
        std::os::unix::fs::symlink(&path, &path).unwrap();
        drop(Lock::exclusive(&path, "the run").unwrap());
        assert!(path.is_file());
        fs::set_permissions(&path, fs::Permissions::from_mode(0o0)).unwrap();
        drop(Lock::exclusive(&path, "the run").unwrap());
    }

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
        let error = Lock::exclusive(&path, "the store").unwrap_err().to_string();
        let own = format!("process {} ", std::process::id());
        assert!(
            error.contains(&own) || error.contains("another process"),
            "{error}"
        );
    }
}
