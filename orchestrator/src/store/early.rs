//! Reads what a run will need while its workflow is still being read: the journal of the last run, and what the file system tells of the
//! artifacts that it used. What has changed until the run holds its lock is read again.

use super::check::look_at_many;
use super::journal::Scanned;
use super::{Seen, Store};
use crate::plan::{ByKey, Key};
use camino::{Utf8Path, Utf8PathBuf};
use std::collections::HashMap;
use std::thread::JoinHandle;

/// What was read ahead.
pub type Ahead = (Scanned, HashMap<Key, Seen, ByKey>);

/// A thread that reads ahead for the run that a store had last: the same command again is what has to be quick.
#[derive(Debug)]
pub struct Early {
    journal: Utf8PathBuf,
    thread: JoinHandle<Option<Ahead>>,
}

impl Early {
    /// Begins to read, if there is something to read.
    pub fn begin(store: &Store) -> Option<Self> {
        let runs = store.runs().ok()?.into_iter();
        let used = |lock: Utf8PathBuf| std::fs::metadata(lock).and_then(|m| m.modified()).ok();
        let last = runs.max_by_key(|run| used(run.lock()))?;
        let journal = last.journal();
        let (path, artifacts) = (journal.clone(), store.root().join("artifacts"));
        let read = move || {
            let scanned = Scanned::read(&path)?;
            let seen = look_at_many(&artifacts, &scanned.journal().last_keys());
            let mut by_key = HashMap::with_capacity_and_hasher(seen.len(), ByKey);
            by_key.extend(seen);
            Some((scanned, by_key))
        };
        let thread = std::thread::Builder::new().spawn(read).ok()?;
        Some(Self { journal, thread })
    }

    /// What was read of the run with this journal; `None` when it was another's.
    pub fn finish(self, journal: &Utf8Path) -> Option<Ahead> {
        if self.journal == *journal {
            return self.thread.join().ok()?;
        }
        None
    }
}
