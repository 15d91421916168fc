//! Where a workflow's artifacts and journals lie.
//!
//! ```text
//! .plyflow/
//!   lock                           shared by runs, exclusive for `clean`
//!   artifacts/ab/ab12...ef.vtkhdf  an artifact under its content key: whole or absent
//!   artifacts/ab/ab12...ef.record.json   what it cost and found, and the hash of the artifact; there before the artifact is
//!   damaged/                       what was not as it was written, kept for those who want to look
//!   plugins.json                   what is known of plugin libraries; only saves time
//!   resolved/<file>                the workflow of a file as last resolved; only saves time
//!   runs/<workflow>/lock           held while a run is on; the kernel frees it whatever happens
//!   runs/<workflow>/journal        one append-only file
//!   runs/<workflow>/logs/          logs of workers that had something to say
//!   runs/<workflow>/tmp/           artifacts being written
//!   runs/<workflow>/checkpoints/<instance>/<key>/   what lets a killed step go on
//!   runs/<workflow>/checkpoints/<instance>/<key>.forced   these are of a run that was to begin anew
//!   runs/<workflow>/unplaced/      finished artifacts that could not be put into `artifacts`, and their records
//! ```

mod aside;
mod check;
mod early;
mod journal;
mod lock;
pub mod resolved;
mod run;

pub use aside::damage_of_plugins;
pub use check::{Expected, Flaw, Seen, check_artifact, read_unplaced, record_beside};
pub use early::{Ahead, Early};
pub use journal::{Detail, Journal, Known, Scanned};
pub use lock::{Lock, LockError};
pub use run::RunFolder;

use crate::plan::Key;
use camino::{Utf8Path, Utf8PathBuf};
use std::cell::RefCell;
use std::{fs, io};

/// Ending of an artifact's name: programs that show meshes choose their reader by it.
pub const ENDING: &str = ".vtkhdf";

/// Ending of a record's name.
const RECORD_ENDING: &str = ".record.json";

/// Ending of artifacts of earlier versions, which kept no hash of them.
const EARLIER_ENDING: &str = ".h5";

/// A store.
#[derive(Debug)]
pub struct Store {
    root: Utf8PathBuf,
    shards: RefCell<[bool; 256]>,
}

/// A name that is safe as a file name and still tells names apart.
fn safe_name(name: &str) -> String {
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

impl Store {
    /// A store at `root`; nothing is made yet.
    pub fn new(root: Utf8PathBuf) -> Self {
        Self {
            root,
            shards: RefCell::new([false; 256]),
        }
    }

    /// Its folder.
    pub fn root(&self) -> &Utf8Path {
        &self.root
    }

    /// The folder of a workflow's runs.
    pub fn run(&self, workflow: &str) -> RunFolder {
        RunFolder {
            root: self.root.join("runs").join(safe_name(workflow)),
        }
    }

    /// Folders of all runs.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn runs(&self) -> io::Result<Vec<RunFolder>> {
        let mut found = Vec::new();
        for root in list(&self.root.join("runs"))? {
            let run = RunFolder { root };
            // The store may have been put into a folder of other things.
            if run.lock().is_file() || run.journal().is_file() {
                found.push(run);
            }
        }
        Ok(found)
    }

    /// Whether there is a store: every run leaves its lock.
    pub fn exists(&self) -> bool {
        self.lock().is_file()
    }

    /// Removes all that runs have put here, and nothing else.
    ///
    /// # Errors
    /// When something cannot be removed.
    pub fn clear(&self) -> io::Result<()> {
        let artifacts = self.root.join("artifacts");
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
        let resolved = self.root.join("resolved");
        for file in list(&resolved)? {
            let name = file.file_name().unwrap_or_default();
            if name.len() >= 16 && name.bytes().take(16).all(|b| b.is_ascii_hexdigit()) {
                fs::remove_file(&file)?;
            }
        }
        for folder in [artifacts, self.root.join("runs"), resolved] {
            let _ = fs::remove_dir(folder);
        }
        self.remove_set_aside()?;
        match fs::remove_file(self.plugins()) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
            _ => Ok(()),
        }
    }

    /// The lock that runs share and `clean` takes alone.
    pub fn lock(&self) -> Utf8PathBuf {
        self.root.join("lock")
    }

    /// Where the artifact of a key lies, if it does.
    pub fn artifact(&self, key: &Key) -> Utf8PathBuf {
        self.file(key, ENDING)
    }

    /// Where an earlier version has put the artifact of a key.
    pub fn earlier_artifact(&self, key: &Key) -> Utf8PathBuf {
        self.file(key, EARLIER_ENDING)
    }

    /// Whether there is an artifact of a key that an earlier version has written.
    pub fn has_earlier(&self, key: &Key) -> bool {
        self.earlier_artifact(key).is_file()
    }

    /// Where its record lies.
    pub fn record(&self, key: &Key) -> Utf8PathBuf {
        self.file(key, RECORD_ENDING)
    }

    fn file(&self, key: &Key, end: &str) -> Utf8PathBuf {
        let hex = key.hex();
        let root = self.root.as_str();
        Utf8PathBuf::from(format!("{root}/artifacts/{}/{hex}{end}", &hex[..2]))
    }

    /// Size of the artifact of a key, if it is there.
    pub fn size(&self, key: &Key) -> Option<u64> {
        let found = rustix::fs::stat(self.artifact(key).as_std_path()).ok()?;
        u64::try_from(found.st_size).ok()
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
            let folder = target.parent().unwrap_or(&self.root);
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

    /// Files of resolved workflows.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn kept_resolutions(&self) -> io::Result<Vec<Utf8PathBuf>> {
        let mut files = list(&self.root.join("resolved"))?;
        let own = |name: &str| name.len() == 16 && name.bytes().all(|b| b.is_ascii_hexdigit());
        files.retain(|f| f.file_name().is_some_and(own));
        Ok(files)
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

    /// Keys of all artifacts, sorted.
    ///
    /// # Errors
    /// When a folder cannot be read.
    pub fn keys(&self) -> io::Result<Vec<Key>> {
        self.keys_with(ENDING)
    }

    /// Keys of all artifacts that earlier versions have written, sorted.
    ///
    /// # Errors
    /// When a folder cannot be read.
    pub fn earlier_keys(&self) -> io::Result<Vec<Key>> {
        self.keys_with(EARLIER_ENDING)
    }

    /// Keys of all records, sorted.
    ///
    /// # Errors
    /// When a folder cannot be read.
    pub fn recorded_keys(&self) -> io::Result<Vec<Key>> {
        self.keys_with(RECORD_ENDING)
    }

    fn keys_with(&self, ending: &str) -> io::Result<Vec<Key>> {
        let mut keys = Vec::new();
        for shard in list(&self.root.join("artifacts"))? {
            // A file of somebody else's is no shard.
            if shard.is_dir() {
                keys.extend(list(&shard)?.iter().filter_map(|f| key_of(f, ending)));
            }
        }
        keys.sort_unstable();
        Ok(keys)
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

/// The key of which a file is, by its name and ending.
fn key_of(file: &Utf8Path, ending: &str) -> Option<Key> {
    Key::from_hex(file.file_name()?.strip_suffix(ending)?)
}

/// Renames a file, or copies it where the target lies on another disk: whole or not at all.
fn place(from: &Utf8Path, to: &Utf8Path) -> io::Result<()> {
    match fs::rename(from, to) {
        Err(e) if e.kind() == io::ErrorKind::CrossesDevices => {
            let beside = Utf8PathBuf::from(format!("{to}.{}", std::process::id()));
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

fn list(folder: &Utf8Path) -> io::Result<Vec<Utf8PathBuf>> {
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

#[cfg(test)]
#[path = "store_tests.rs"]
mod tests;
