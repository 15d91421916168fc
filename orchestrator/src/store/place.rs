//! What comes into a store, and what goes from it.

use super::check;
use super::folder::Store;
use super::names::{ENDING, key_of, list, place};
use super::run::RunFolder;
use crate::plan::Key;
use camino::Utf8Path;
use plyflow_artifact::whole;
use std::{fs, io};

impl Store {
    /// Removes all that runs have put here, and nothing else.
    ///
    /// # Errors
    /// When something cannot be removed.
    pub fn clear(&self) -> io::Result<()> {
        let artifacts = self.root().join("artifacts");
        for shard in list(&artifacts)? {
            for file in list(&shard).unwrap_or_default() {
                let key = file.file_name().and_then(|n| n.split('.').next());
                if key.and_then(Key::from_hex).is_some() {
                    fs::remove_file(&file)?;
                }
            }
            // Stays where something else lies in it.
            let _ = fs::remove_dir(&shard);
        }
        for run in self.runs()? {
            fs::remove_dir_all(&run.root)?;
        }
        self.clear_killed();
        let resolved = self.root().join("resolved");
        for file in list(&resolved)? {
            let name = file.file_name().unwrap_or_default();
            if name.len() >= 16 && name.bytes().take(16).all(|b| b.is_ascii_hexdigit()) {
                fs::remove_file(&file)?;
            }
        }
        for folder in [artifacts, self.root().join("runs"), resolved] {
            let _ = fs::remove_dir(folder);
        }
        self.remove_set_aside()?;
        match fs::remove_file(self.plugins()) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
            _ => Ok(()),
        }
    }

    /// Removes what killed commands have only begun to write: what is known of plugin libraries, and resolved workflows.
    pub fn clear_killed(&self) {
        whole::clear_killed(self.root().as_std_path());
        whole::clear_killed(self.root().join("resolved").as_std_path());
    }

    /// Makes a finished artifact visible: the record first, so that a visible artifact has one. `lasting`: when this returns, both
    /// outlast a power cut, as far as the worker has put their bytes on the disk.
    ///
    /// # Errors
    /// When a file is missing or cannot be renamed, or the disk refuses.
    pub fn commit(
        &self,
        key: &Key,
        artifact: &Utf8Path,
        record: &Utf8Path,
        lasting: bool,
    ) -> io::Result<()> {
        let shard = usize::from(key.0[0]);
        if !self.shards.borrow()[shard] {
            let target = self.artifact(key);
            let folder = target.parent().unwrap_or(self.root());
            if fs::symlink_metadata(folder).is_ok_and(|m| m.is_file()) {
                self.set_aside(folder)?;
            }
            fs::create_dir_all(folder)?;
            self.shards.borrow_mut()[shard] = true;
        }
        let target = self.artifact(key);
        self.free(&target)?;
        self.free(&self.record(key))?;
        place(record, &self.record(key))?;
        place(artifact, &target)?;
        if lasting {
            // Names lie in folders, which the disk keeps apart from the files.
            for folder in target.ancestors().skip(1).take(2) {
                fs::File::open(folder)?.sync_all()?;
            }
            // The store itself may be new.
            if !self.is_kept.replace(true) {
                for folder in self.root().ancestors().take(2) {
                    fs::File::open(folder)?.sync_all()?;
                }
            }
        }
        Ok(())
    }

    /// Puts aside what could not be committed, so that [`Store::take_unplaced`] can.
    ///
    /// # Errors
    /// When it cannot be put aside either.
    pub fn keep_unplaced(
        &self,
        run: &RunFolder,
        key: &Key,
        artifact: &Utf8Path,
        record: &Utf8Path,
    ) -> io::Result<()> {
        let place = |end: &str| run.unplaced().join(format!("{}{end}", key.hex()));
        fs::create_dir_all(run.unplaced())?;
        match record.exists() {
            true => fs::rename(record, place(".record.json"))?,
            // The commit came so far.
            false => drop(fs::copy(self.record(key), place(".record.json"))?),
        }
        fs::rename(artifact, place(ENDING))
    }

    /// Commits what [`Store::keep_unplaced`] has put aside; what still cannot be stays, and what is damaged is set aside. Gives what is
    /// to be told.
    pub fn take_unplaced(&self, run: &RunFolder) -> Vec<String> {
        let mut told = Vec::new();
        for artifact in list(&run.unplaced()).unwrap_or_default() {
            if let Some(key) = key_of(&artifact, ENDING) {
                let record = artifact.with_extension("record.json");
                if let Err(flaw) = check::unplaced(&artifact, &key) {
                    let moved = [&artifact, &record].map(|p| self.set_aside(p).is_ok());
                    if moved.contains(&true) {
                        told.push(format!("{}; it is set aside", flaw.text()));
                    }
                } else if self.size(&key).is_some() {
                    let _ = (fs::remove_file(&record), fs::remove_file(&artifact));
                } else {
                    let kept = run.unplaced().join("record");
                    // A commit that fails between the two may take the record with it.
                    if fs::copy(&record, &kept).is_ok()
                        && self.commit(&key, &artifact, &kept, true).is_ok()
                    {
                        let _ = fs::remove_file(&record);
                    }
                    let _ = fs::remove_file(&kept);
                }
            }
        }
        let _ = fs::remove_dir(run.unplaced());
        told
    }

    /// Removes an artifact of an earlier version, and its record if no other artifact has taken it over.
    ///
    /// # Errors
    /// When a file cannot be removed.
    pub fn remove_earlier(&self, key: &Key) -> io::Result<()> {
        fs::remove_file(self.earlier_artifact(key))?;
        if self.size(key).is_none() {
            let _ = fs::remove_file(self.record(key));
        }
        Ok(())
    }

    /// Removes an artifact and its record; the artifact first, so that none is left without a record.
    ///
    /// # Errors
    /// When a file cannot be removed.
    pub fn remove(&self, key: &Key) -> io::Result<()> {
        fs::remove_file(self.artifact(key))?;
        match fs::remove_file(self.record(key)) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => Ok(()),
            other => other,
        }
    }
}

#[cfg(test)]
#[path = "store_tests.rs"]
pub(super) mod tests;
