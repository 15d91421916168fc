//! Where the files of one workflow's runs lie.

use super::names::{list, safe_name};
use crate::plan::Key;
use camino::Utf8PathBuf;
use std::{fs, io};

/// Files of one run.
#[derive(Debug, Clone)]
pub struct RunFolder {
    /// `runs/<workflow>`.
    pub root: Utf8PathBuf,
}

impl RunFolder {
    /// Its lock.
    pub fn lock(&self) -> Utf8PathBuf {
        self.root.join("lock")
    }

    /// Its journal.
    pub fn journal(&self) -> Utf8PathBuf {
        self.root.join("journal")
    }

    /// Temporary files.
    pub fn tmp(&self) -> Utf8PathBuf {
        self.root.join("tmp")
    }

    /// Log of an instance by its label.
    pub fn log(&self, label: &str) -> Utf8PathBuf {
        self.root
            .join("logs")
            .join(format!("{}.log", safe_name(label)))
    }

    /// Checkpoints of an instance, by its label and key.
    pub fn checkpoints(&self, label: &str, key: &Key) -> Utf8PathBuf {
        let of = self.root.join("checkpoints").join(safe_name(label));
        of.join(key.hex())
    }

    /// Where it stands that checkpoints are of a run that was to begin anew (`--force`).
    pub fn forced(&self, label: &str, key: &Key) -> Utf8PathBuf {
        let of = self.root.join("checkpoints").join(safe_name(label));
        of.join(format!("{}.forced", key.hex()))
    }

    /// Finished artifacts that could not be put into the store.
    pub fn unplaced(&self) -> Utf8PathBuf {
        self.root.join("unplaced")
    }

    /// Checkpoints that no command will go on from: of every instance all but those last written to.
    ///
    /// # Errors
    /// When a folder cannot be read.
    pub fn old_checkpoints(&self) -> io::Result<Vec<Utf8PathBuf>> {
        let mut old = Vec::new();
        for instance in list(&self.root.join("checkpoints"))? {
            let mut of = list(&instance)?;
            of.retain(|p| p.is_dir());
            let written = |p: &Utf8PathBuf| fs::metadata(p).and_then(|m| m.modified()).ok();
            of.sort_by_cached_key(|p| (written(p), p.clone()));
            of.pop();
            old.extend(of);
        }
        Ok(old)
    }

    /// Checkpoints of all instances and keys.
    ///
    /// # Errors
    /// When a folder cannot be read.
    pub fn all_checkpoints(&self) -> io::Result<Vec<Utf8PathBuf>> {
        let mut all = Vec::new();
        for instance in list(&self.root.join("checkpoints"))? {
            if instance.is_dir() {
                all.extend(list(&instance)?.into_iter().filter(|p| p.is_dir()));
            }
        }
        Ok(all)
    }

    /// Makes the folder and clears what a killed run left in `tmp`. Call only under the lock.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn prepare(&self) -> io::Result<()> {
        let tmp = self.tmp();
        let removed = match fs::symlink_metadata(&tmp) {
            Ok(found) if !found.is_dir() => fs::remove_file(&tmp),
            _ => fs::remove_dir_all(&tmp),
        };
        match removed {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
            _ => {}
        }
        fs::create_dir_all(self.tmp())
    }
}
