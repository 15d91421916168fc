//! Reads what a run will need while its workflow is still being read: the journal of the last run, and what the file system tells of the
//! artifacts that it used. What has changed until the run holds its lock is read again.

use super::check::{Seen, look_at_many};
use super::folder::Store;
use super::journal::Scanned;
use crate::plan::{ByKey, Key};
use camino::{Utf8Path, Utf8PathBuf};
use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;

/// So many keys are looked at in one piece.
const PIECE: usize = 256;

/// What was read ahead.
pub type Ahead = (Scanned, HashMap<Key, Seen, ByKey>);

/// What was seen of the files of some keys.
type Looked = Vec<(Key, Seen)>;

/// A thread that reads ahead for the run that a store had last: the same command again is what has to be quick.
#[derive(Debug)]
pub struct Early {
    journal: Utf8PathBuf,
    thread: JoinHandle<Option<(Scanned, Looked)>>,
    looking: Arc<OnceLock<Looking>>,
}

/// Files that are being looked at, piece by piece, by whoever has time.
#[derive(Debug)]
struct Looking {
    artifacts: Utf8PathBuf,
    /// Sorted.
    keys: Vec<Key>,
    next: AtomicUsize,
}

impl Looking {
    /// Looks at pieces until none is left.
    fn work(&self) -> Looked {
        let mut seen = Vec::new();
        let pieces: Vec<&[Key]> = self.keys.chunks(PIECE).collect();
        while let Some(piece) = pieces.get(self.next.fetch_add(1, Ordering::Relaxed)) {
            seen.extend(look_at_many(&self.artifacts, piece));
        }
        seen
    }
}

impl Early {
    /// Begins to read, if there is something to read.
    pub fn begin(store: &Store) -> Option<Self> {
        let runs = store.runs().ok()?.into_iter();
        let used = |lock: Utf8PathBuf| std::fs::metadata(lock).and_then(|m| m.modified()).ok();
        let last = runs.max_by_key(|run| used(run.lock()))?;
        let journal = last.journal();
        let (path, artifacts) = (journal.clone(), store.root().join("artifacts"));
        let looking: Arc<OnceLock<Looking>> = Arc::default();
        let shared = looking.clone();
        let read = move || {
            let scanned = Scanned::read(&path)?;
            let keys = scanned.journal().last_keys();
            let next = AtomicUsize::new(0);
            let seen = shared
                .get_or_init(|| Looking {
                    artifacts,
                    keys,
                    next,
                })
                .work();
            Some((scanned, seen))
        };
        let thread = std::thread::Builder::new().spawn(read).ok()?;
        Some(Self {
            journal,
            thread,
            looking,
        })
    }

    /// What was read of the run with this journal; `None` when it was another's.
    pub fn finish(self, journal: &Utf8Path) -> Option<Ahead> {
        if self.journal != *journal {
            return None;
        }
        // Nobody is to wait for what one can do.
        let mine = self.looking.get().map(Looking::work).unwrap_or_default();
        let (scanned, seen) = self.thread.join().ok()??;
        let mut by_key = HashMap::with_capacity_and_hasher(seen.len() + mine.len(), ByKey);
        by_key.extend(seen.into_iter().chain(mine));
        Some((scanned, by_key))
    }
}
