//! The folder of a store: where what lies in it.

use super::names::{EARLIER_ENDING, ENDING, RECORD_ENDING, key_of, list, safe_name};
use super::run::RunFolder;
use crate::plan::Key;
use camino::{Utf8Path, Utf8PathBuf};
use std::cell::{Cell, RefCell};
use std::io;

/// A store.
#[derive(Debug)]
pub struct Store {
    root: Utf8PathBuf,
    /// Folders of `artifacts` that are known to be there.
    pub(super) shards: RefCell<[bool; 256]>,
    /// Whether its own name, and those in it, have been put on the disk.
    pub(super) is_kept: Cell<bool>,
}

impl Store {
    /// A store at `root`; nothing is made yet.
    pub fn new(root: Utf8PathBuf) -> Self {
        Self {
            root,
            shards: RefCell::new([false; 256]),
            is_kept: Cell::new(false),
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
}
