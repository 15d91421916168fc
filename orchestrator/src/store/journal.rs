//! The journal of a workflow's runs: one append-only file.
//!
//! After 8 bytes of magic, frames of `length: u32 LE`, `checksum: 8 bytes of BLAKE3`, `payload`
//! (postcard). Where a frame does not check and none that does follows it, the journal ends: a torn tail is cut off by the next writer.
//! Where one follows, the file is damaged: the frames between are lost, the next writer keeps the damaged file beside a new one.
//! Nothing depends on the journal being whole: an artifact that it does not know is found by its file.
//!
//! A little over 600 lines: writing, reading and repairing hold one format, and are read together.

use crate::plan::{ByKey, Ingredients, InputKey, Key};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_files::open::{self, FileError, MOST_NOTED};
use rustix::fs::{Timespec, Timestamps, UTIME_NOW};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::os::unix::fs::MetadataExt;
use std::time::{Duration, Instant};

const MAGIC: &[u8; 8] = b"PFJRNL02";
/// Of the version without [`Entry::Seen`], otherwise the same.
const EARLIER: &[u8; 8] = b"PFJRNL01";
/// Longest frame (bytes) that is looked for behind a damaged one.
const LOOKED_FOR: usize = 1 << 16;
const HEAD: usize = 12;
/// At most this long after a record it is on the disk, and at most this often the disk is asked.
const FLUSH: Duration = Duration::from_millis(200);

/// The time of the file system itself, as a new file gets it.
const NOW: Timestamps = Timestamps {
    last_access: Timespec {
        tv_sec: 0,
        tv_nsec: UTIME_NOW,
    },
    last_modification: Timespec {
        tv_sec: 0,
        tv_nsec: UTIME_NOW,
    },
};

/// A record. The common ones come first and are small; `Detail` is decoded only when someone asks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
enum Entry {
    /// An artifact is in the store.
    Made {
        key: Key,
        slot: u64,
        bytes: u64,
        labels: Option<Vec<String>>,
    },
    /// A slot uses this known artifact again.
    Use { key: Key, slot: u64 },
    /// The ingredients of a recipe, as JSON.
    Recipe { digest: Key, ingredients: String },
    /// How a key came about.
    Detail(Detail),
    /// A run begins to start steps.
    Started { pid: u32, seconds: u64 },
    /// It ended.
    Ended { executed: u64, failed: u64 },
    /// An instance failed for good.
    Failed { key: Key, slot: u64, reason: String },
    /// What the file system told of the files of a key when they were known to be whole.
    Seen { key: Key, stamp: u64 },
}

/// What went into the key of one instance.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Detail {
    /// The key.
    pub key: Key,
    /// Digest of its recipe.
    pub recipe: Key,
    /// Its inputs.
    pub inputs: Vec<InputKey>,
}

/// What the journal knows of an artifact.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Known {
    /// Size (bytes).
    pub bytes: u64,
    /// Labels of a collection's items.
    pub labels: Option<Vec<String>>,
    /// What the file system told of its files when they were last known to be whole.
    pub stamp: Option<u64>,
}

/// A journal, open for reading or for writing.
#[derive(Debug)]
pub struct Journal {
    path: Utf8PathBuf,
    file: Option<File>,
    bytes: Vec<u8>,
    known: HashMap<Key, Known, ByKey>,
    last: HashMap<u64, Key, ByKey>,
    failed: HashMap<u64, (Key, String)>,
    cold: Vec<Range<usize>>,
    /// Where the frames of recipes lie.
    recipes: HashMap<Key, Range<usize>, ByKey>,
    frames: usize,
    buffer: Vec<u8>,
    unsynced: Option<Instant>,
    /// Length (bytes) of the file up to which it is whole.
    whole: u64,
    damaged: bool,
}

/// The slot of an instance: where successive runs put successive keys.
pub fn slot(step: &str, item: &[u64]) -> u64 {
    let mut bytes = Vec::with_capacity(step.len() + 8 * item.len() + 1);
    bytes.extend_from_slice(step.as_bytes());
    bytes.push(0);
    for i in item {
        bytes.extend_from_slice(&i.to_le_bytes());
    }
    let hash = blake3::hash(&bytes);
    u64::from_le_bytes(std::array::from_fn(|i| hash.as_bytes()[i]))
}

fn checksum(payload: &[u8]) -> [u8; 8] {
    let hash = blake3::hash(payload);
    std::array::from_fn(|i| hash.as_bytes()[i])
}

/// A journal that was read before its run held the lock.
#[derive(Debug)]
pub struct Scanned {
    journal: Journal,
    whole: usize,
    mark: Mark,
}

/// Size, inode and times of a file.
type Mark = [i64; 6];

fn mark(file: &File) -> io::Result<Mark> {
    let m = file.metadata()?;
    let whole = |n: u64| n.cast_signed();
    let sizes = [whole(m.size()), whole(m.ino())];
    let times = [m.mtime(), m.mtime_nsec(), m.ctime(), m.ctime_nsec()];
    Ok([sizes[0], sizes[1], times[0], times[1], times[2], times[3]])
}

impl Scanned {
    /// Reads a journal; `None` when there is none that can be read.
    pub fn read(path: &Utf8Path) -> Option<Self> {
        let mut file = open::open(path.as_std_path(), MOST_NOTED).ok()?;
        let mark = mark(&file).ok()?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).ok()?;
        let (journal, whole) = Journal::scan(path, bytes);
        Some(Self {
            journal,
            whole,
            mark,
        })
    }

    /// What was read.
    pub fn journal(&self) -> &Journal {
        &self.journal
    }
}

/// Where the payload of a frame at `at` would lie.
fn payload(bytes: &[u8], at: usize) -> Option<Range<usize>> {
    let head = bytes.get(at..at + HEAD)?;
    let length = u32::from_le_bytes([head[0], head[1], head[2], head[3]]) as usize;
    let start = at + HEAD;
    let end = start.checked_add(length)?;
    (end <= bytes.len()).then_some(start..end)
}

/// Where the payload of the frame at `at` lies, when it checks.
fn frame(bytes: &[u8], at: usize) -> Option<Range<usize>> {
    let payload = payload(bytes, at)?;
    (checksum(&bytes[payload.clone()]) == bytes[at + 4..at + HEAD]).then_some(payload)
}

/// Where the next frame begins that checks and can be decoded, from `at` on.
fn next_frame(bytes: &[u8], at: usize) -> Option<usize> {
    let is_one = |at: &usize| {
        let short = |p: &Range<usize>| (1..=LOOKED_FOR).contains(&p.len());
        let payload = payload(bytes, *at).filter(short)?;
        // Before it is hashed: in a file where many places look like a length, hashing behind each of them would not end.
        let (_, rest) = postcard::take_from_bytes::<Entry>(&bytes[payload]).ok()?;
        frame(bytes, *at).filter(|_| rest.is_empty())
    };
    (at..bytes.len().saturating_sub(HEAD)).find(|at| is_one(at).is_some())
}

impl Journal {
    /// Reads what is whole of a journal; an absent one is empty. It cannot be written to.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn read(path: &Utf8Path) -> io::Result<Self> {
        let bytes = match open::read(path.as_std_path(), MOST_NOTED) {
            Ok(bytes) => bytes,
            Err(FileError::Missing) => Vec::new(),
            Err(e) => return Err(e.into()),
        };
        Ok(Self::scan(path, bytes).0)
    }

    /// A journal in which nothing is noted and that cannot be written to.
    pub fn empty(path: &Utf8Path) -> Self {
        Self::scan(path, Vec::new()).0
    }

    /// Opens a journal for writing, cuts off a torn tail and sheds old records when they prevail. A damaged one is left as
    /// [`Journal::damaged_file`], and what can be read of it goes on in a new one. Call only under the run's lock.
    ///
    /// # Errors
    /// When the file cannot be read or written.
    pub fn open(path: &Utf8Path) -> io::Result<Self> {
        Self::open_with(path, None)
    }

    /// As [`Journal::open`]; what was read `ahead` is taken if the file has not changed since.
    ///
    /// # Errors
    /// As [`Journal::open`].
    pub fn open_with(path: &Utf8Path, ahead: Option<Scanned>) -> io::Result<Self> {
        // A pipe in its place would be waited for, a device read without end.
        let found = open::open(path.as_std_path(), MOST_NOTED);
        if let Err(e @ (FileError::Special(_) | FileError::Large { .. })) = found {
            return Err(e.into());
        }
        let mut options = File::options();
        let mut file = options
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)?;
        let ahead = ahead.filter(|a| a.journal.path == path && mark(&file).ok() == Some(a.mark));
        let (mut journal, whole) = match ahead {
            Some(ahead) => (ahead.journal, ahead.whole),
            None => {
                let mut bytes = Vec::new();
                file.read_to_end(&mut bytes)?;
                Self::scan(path, bytes)
            }
        };
        // Its date is never later than what this run makes, also where the clock was set back (`clean` goes by it).
        let _ = rustix::fs::futimens(&file, &NOW);
        let length = journal.bytes.len();
        if whole < MAGIC.len() && !journal.damaged {
            file.set_len(0)?;
            file.rewind()?;
            file.write_all(MAGIC)?;
            journal.whole = MAGIC.len() as u64;
        } else {
            journal.whole = whole as u64;
            if journal.bytes.starts_with(EARLIER) {
                file.rewind()?;
                file.write_all(MAGIC)?;
            }
            if whole < length && !journal.damaged {
                file.set_len(whole as u64)?;
            }
            file.seek(SeekFrom::Start(whole as u64))?;
        }
        journal.file = Some(file);
        if journal.damaged {
            std::fs::rename(path, Self::damaged_file(path))?;
            journal.compact()?;
            journal.damaged = true;
        } else if journal.frames > 1000 + 8 * (journal.last.len() + journal.failed.len()) {
            journal.compact()?;
        }
        Ok(journal)
    }

    /// Where [`Journal::open`] leaves a journal that it has found damaged.
    pub fn damaged_file(path: &Utf8Path) -> Utf8PathBuf {
        path.with_extension("damaged")
    }

    /// Whether the file was found damaged when it was opened: what is known is what could be read of it.
    pub fn is_damaged(&self) -> bool {
        self.damaged
    }

    fn scan(path: &Utf8Path, bytes: Vec<u8>) -> (Self, usize) {
        // A step takes some 400 bytes.
        let likely = bytes.len() / 400;
        let mut journal = Self {
            path: path.to_owned(),
            file: None,
            bytes: Vec::new(),
            known: HashMap::with_capacity_and_hasher(likely, ByKey),
            last: HashMap::with_capacity_and_hasher(likely, ByKey),
            failed: HashMap::new(),
            cold: Vec::with_capacity(likely),
            recipes: HashMap::with_capacity_and_hasher(likely, ByKey),
            frames: 0,
            buffer: Vec::new(),
            unsynced: None,
            whole: 0,
            damaged: false,
        };
        let known = bytes.starts_with(MAGIC) || bytes.starts_with(EARLIER);
        // One that is only begun is torn.
        journal.damaged = !known && bytes.len() >= MAGIC.len();
        let mut at = MAGIC.len();
        loop {
            while let Some(payload) = frame(&bytes, at)
                && journal.take(&bytes[payload.clone()], payload.clone())
            {
                at = payload.end;
            }
            let Some(next) = next_frame(&bytes, at + 1) else {
                break;
            };
            journal.damaged = true;
            at = next;
        }
        journal.bytes = bytes;
        (journal, if known { at } else { 0 })
    }

    /// Notes one record; false when it cannot be decoded.
    fn take(&mut self, payload: &[u8], range: Range<usize>) -> bool {
        // Postcard writes the variant first: 3 is `Detail`, left for later; 2 is `Recipe`, of which the digest comes next.
        let digest = || payload.get(1..)?.first_chunk::<32>().copied().map(Key);
        if payload.first() == Some(&3) {
            self.cold.push(range);
        } else if let (Some(2), Some(digest)) = (payload.first(), digest()) {
            self.recipes.insert(digest, range);
        } else {
            match postcard::from_bytes(payload) {
                Ok(Entry::Made {
                    key,
                    slot,
                    bytes,
                    labels,
                }) => {
                    let stamp = None;
                    self.known.insert(
                        key,
                        Known {
                            bytes,
                            labels,
                            stamp,
                        },
                    );
                    self.uses(slot, key);
                }
                Ok(Entry::Use { key, slot }) => self.uses(slot, key),
                Ok(Entry::Seen { key, stamp }) => {
                    if let Some(known) = self.known.get_mut(&key) {
                        known.stamp = Some(stamp);
                    }
                }
                Ok(Entry::Failed { key, slot, reason }) => {
                    self.failed.insert(slot, (key, reason));
                }
                Ok(_) => {}
                Err(_) => return false,
            }
        }
        self.frames += 1;
        true
    }

    fn uses(&mut self, slot: u64, key: Key) {
        self.last.insert(slot, key);
        if self.failed.get(&slot).is_some_and(|f| f.0 == key) {
            self.failed.remove(&slot);
        }
    }

    fn push(&mut self, entry: &Entry) {
        // Serialising into memory cannot fail: every type here has a known length.
        let Ok(payload) = postcard::to_stdvec(entry) else {
            return;
        };
        let start = self.bytes.len() + HEAD;
        let mut head = [0u8; HEAD];
        head[..4].copy_from_slice(&(payload.len() as u32).to_le_bytes());
        head[4..].copy_from_slice(&checksum(&payload));
        for part in [&head[..], &payload] {
            self.buffer.extend_from_slice(part);
            self.bytes.extend_from_slice(part);
        }
        self.take(&payload, start..start + payload.len());
    }

    /// What is known of an artifact.
    pub fn known(&self, key: &Key) -> Option<&Known> {
        self.known.get(key)
    }

    /// The key that an instance had last.
    pub fn last(&self, step: &str, item: &[u64]) -> Option<Key> {
        self.last.get(&slot(step, item)).copied()
    }

    /// The keys of all artifacts that are known to have been in the store.
    pub fn known_keys(&self) -> impl Iterator<Item = Key> {
        self.known.keys().copied()
    }

    /// The last keys of all instances, sorted.
    pub fn last_keys(&self) -> Vec<Key> {
        let mut keys: Vec<Key> = self.last.values().copied().collect();
        keys.sort_unstable();
        keys
    }

    /// The ingredients of a recipe, as JSON.
    fn recipe(&self, digest: &Key) -> Option<String> {
        let range = self.recipes.get(digest)?.clone();
        match postcard::from_bytes(&self.bytes[range]) {
            Ok(Entry::Recipe { ingredients, .. }) => Some(ingredients),
            _ => None,
        }
    }

    /// How a key came about: its ingredients and inputs.
    pub fn detail(&self, key: &Key) -> Option<(Ingredients, Vec<InputKey>)> {
        let detail = self.cold.iter().rev().find_map(|range| {
            match postcard::from_bytes(&self.bytes[range.clone()]) {
                Ok(Entry::Detail(d)) if d.key == *key => Some(d),
                _ => None,
            }
        })?;
        let ingredients = serde_json::from_str(&self.recipe(&detail.recipe)?).ok()?;
        Some((ingredients, detail.inputs))
    }

    /// Notes that an instance uses this artifact; writes nothing when that is already the last word. With the digest of its recipe comes
    /// how it is made, which is asked for when it is new.
    pub fn used(
        &mut self,
        (step, item): (&str, &[u64]),
        key: Key,
        (recipe, made_by): (Key, impl FnOnce() -> Ingredients),
        artifact: Known,
        inputs: impl FnOnce() -> Vec<InputKey>,
    ) {
        let slot = slot(step, item);
        let stamp = artifact.stamp;
        let before = self.known.get(&key);
        if before.is_some_and(|k| (k.bytes, &k.labels) == (artifact.bytes, &artifact.labels)) {
            let seen = before.and_then(|k| k.stamp) == stamp;
            let failed = self.failed.get(&slot).is_some_and(|f| f.0 == key);
            if failed || self.last.get(&slot) != Some(&key) {
                self.push(&Entry::Use { key, slot });
            }
            if !seen && let Some(stamp) = stamp {
                self.saw(key, stamp);
            }
            return;
        }
        if !self.recipes.contains_key(&recipe) {
            let ingredients = serde_json::to_string(&made_by()).unwrap_or_default();
            self.push(&Entry::Recipe {
                digest: recipe,
                ingredients,
            });
        }
        self.push(&Entry::Detail(Detail {
            key,
            recipe,
            inputs: inputs(),
        }));
        self.push(&Entry::Made {
            key,
            slot,
            bytes: artifact.bytes,
            labels: artifact.labels,
        });
        if let Some(stamp) = stamp {
            self.saw(key, stamp);
        }
    }

    /// Notes what the file system tells of the files of a key that are known to be whole.
    pub fn saw(&mut self, key: Key, stamp: u64) {
        self.push(&Entry::Seen { key, stamp });
    }

    /// Notes why an instance with this key failed.
    pub fn failed(&mut self, (step, item): (&str, &[u64]), key: Key, reason: &str) {
        self.push(&Entry::Failed {
            key,
            slot: slot(step, item),
            reason: reason.to_owned(),
        });
    }

    /// Why an instance failed when it ran with this key last; `None` when it did not, or has been done since.
    pub fn failure(&self, step: &str, item: &[u64], key: &Key) -> Option<&str> {
        let (failed, reason) = self.failed.get(&slot(step, item))?;
        (failed == key).then_some(reason)
    }

    /// Notes that steps begin to be started.
    pub fn started(&mut self) {
        let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        let seconds = now.map_or(0, |d| d.as_secs());
        self.push(&Entry::Started {
            pid: std::process::id(),
            seconds,
        });
    }

    /// Notes the end of a run that started steps.
    pub fn ended(&mut self, executed: u64, failed: u64) {
        self.push(&Entry::Ended { executed, failed });
    }

    /// Hands what is new to the kernel, and to the disk when the last time is long enough ago.
    ///
    /// # Errors
    /// When the file cannot be written, with its name. What is new is kept, and the next call tries again.
    pub fn tick(&mut self) -> io::Result<()> {
        self.hand_over().map_err(|e| self.named(&e))
    }

    /// An error with the file that it is of.
    fn named(&self, e: &io::Error) -> io::Error {
        io::Error::new(e.kind(), format!("the journal {}: {e}", self.path))
    }

    fn hand_over(&mut self) -> io::Result<()> {
        let Some(file) = &mut self.file else {
            return Ok(());
        };
        if !self.buffer.is_empty() {
            if let Err(e) = file.write_all(&self.buffer) {
                // A part of it may be there (a full disk): what follows a torn frame would not be read.
                file.set_len(self.whole)?;
                file.seek(SeekFrom::Start(self.whole))?;
                return Err(e);
            }
            self.whole += self.buffer.len() as u64;
            self.buffer.clear();
            self.unsynced.get_or_insert_with(Instant::now);
        }
        if self.unsynced.is_some_and(|since| since.elapsed() >= FLUSH) {
            file.sync_data()?;
            self.unsynced = None;
        }
        Ok(())
    }

    /// Puts everything on the disk.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        self.tick()?;
        match (&self.file, self.unsynced.take()) {
            (Some(file), Some(_)) => file.sync_data().map_err(|e| self.named(&e)),
            _ => Ok(()),
        }
    }

    /// Writes a new file that holds only what the last run of each instance used, and why it failed.
    fn compact(&mut self) -> io::Result<()> {
        let path = self.path.with_extension("new");
        let mut fresh = Self::scan(&self.path, MAGIC.to_vec()).0;
        let mut file = File::create(&path)?;
        file.write_all(MAGIC)?;
        fresh.whole = MAGIC.len() as u64;
        let mut details = HashMap::new();
        for range in &self.cold {
            if let Ok(Entry::Detail(d)) = postcard::from_bytes(&self.bytes[range.clone()]) {
                details.insert(d.key, d);
            }
        }
        let mut last: Vec<(u64, Key)> = self.last.iter().map(|(s, k)| (*s, *k)).collect();
        last.sort_unstable();
        for (slot, key) in last {
            let (Some(known), Some(detail)) = (self.known.get(&key), details.remove(&key)) else {
                continue;
            };
            if let (false, Some(ingredients)) = (
                fresh.recipes.contains_key(&detail.recipe),
                self.recipe(&detail.recipe),
            ) {
                fresh.push(&Entry::Recipe {
                    digest: detail.recipe,
                    ingredients,
                });
            }
            fresh.push(&Entry::Detail(detail));
            let known = known.clone();
            fresh.push(&Entry::Made {
                key,
                slot,
                bytes: known.bytes,
                labels: known.labels,
            });
            if let Some(stamp) = known.stamp {
                fresh.saw(key, stamp);
            }
        }
        let mut failed: Vec<_> = self.failed.iter().collect();
        failed.sort_unstable();
        for (slot, (key, reason)) in failed {
            let (key, slot, reason) = (*key, *slot, reason.clone());
            fresh.push(&Entry::Failed { key, slot, reason });
        }
        fresh.file = Some(file);
        fresh.tick()?;
        fresh.flush()?;
        std::fs::rename(&path, &self.path)?;
        *self = fresh;
        Ok(())
    }
}

#[cfg(test)]
#[path = "journal_tests.rs"]
mod tests;
