//! The journal of a workflow's runs: one append-only file.
//!
//! After 8 bytes of magic, frames of `length: u32 LE`, `checksum: 8 bytes of BLAKE3`, `payload`
//! (postcard). A frame that does not check ends the journal: a torn tail is cut off by the next writer.
//! Nothing depends on the journal being whole: an artifact that it does not know is found by its file.

use crate::plan::{Ingredients, InputKey, Key, Recipe};
use camino::{Utf8Path, Utf8PathBuf};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::time::{Duration, Instant};

const MAGIC: &[u8; 8] = b"PFJRNL01";
const HEAD: usize = 12;
/// At most this long after a record it is on the disk, and at most this often the disk is asked.
const FLUSH: Duration = Duration::from_millis(200);

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
}

/// A journal, open for reading or for writing.
#[derive(Debug)]
pub struct Journal {
    path: Utf8PathBuf,
    file: Option<File>,
    bytes: Vec<u8>,
    known: HashMap<Key, Known>,
    last: HashMap<u64, Key>,
    failed: HashMap<u64, (Key, String)>,
    cold: Vec<Range<usize>>,
    recipes: HashMap<Key, String>,
    frames: usize,
    buffer: Vec<u8>,
    unsynced: Option<Instant>,
    /// Length (bytes) of the file up to which it is whole.
    whole: u64,
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

impl Journal {
    /// Reads a journal as far as it is whole; an absent one is empty. It cannot be written to.
    ///
    /// # Errors
    /// When the file cannot be read.
    pub fn read(path: &Utf8Path) -> io::Result<Self> {
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::NotFound => Vec::new(),
            Err(e) => return Err(e),
        };
        Ok(Self::scan(path, bytes).0)
    }

    /// Opens a journal for writing, cuts off a torn tail and sheds old records when they prevail. Call
    /// only under the run's lock.
    ///
    /// # Errors
    /// When the file cannot be read or written.
    pub fn open(path: &Utf8Path) -> io::Result<Self> {
        let mut options = File::options();
        let mut file = options
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        let length = bytes.len();
        let (mut journal, whole) = Self::scan(path, bytes);
        if whole < MAGIC.len() {
            file.set_len(0)?;
            file.rewind()?;
            file.write_all(MAGIC)?;
            journal.whole = MAGIC.len() as u64;
        } else {
            journal.whole = whole as u64;
            if whole < length {
                file.set_len(whole as u64)?;
            }
            file.seek(SeekFrom::Start(whole as u64))?;
        }
        journal.file = Some(file);
        if journal.frames > 1000 + 8 * (journal.last.len() + journal.failed.len()) {
            journal.compact()?;
        }
        Ok(journal)
    }

    fn scan(path: &Utf8Path, bytes: Vec<u8>) -> (Self, usize) {
        let mut journal = Self {
            path: path.to_owned(),
            file: None,
            bytes: Vec::new(),
            known: HashMap::new(),
            last: HashMap::new(),
            failed: HashMap::new(),
            cold: Vec::new(),
            recipes: HashMap::new(),
            frames: 0,
            buffer: Vec::new(),
            unsynced: None,
            whole: 0,
        };
        if !bytes.starts_with(MAGIC) {
            return (journal, 0);
        }
        let mut at = MAGIC.len();
        while let Some(head) = bytes.get(at..at + HEAD) {
            let length = u32::from_le_bytes([head[0], head[1], head[2], head[3]]) as usize;
            let start = at + HEAD;
            let Some(payload) = bytes.get(start..start + length) else {
                break;
            };
            if checksum(payload) != head[4..] || !journal.take(payload, start..start + length) {
                break;
            }
            at = start + length;
        }
        journal.bytes = bytes;
        (journal, at)
    }

    /// Notes one record; false when it cannot be decoded.
    fn take(&mut self, payload: &[u8], range: Range<usize>) -> bool {
        // Postcard writes the variant first: 3 is `Detail`, left for later.
        if payload.first() == Some(&3) {
            self.cold.push(range);
        } else {
            match postcard::from_bytes(payload) {
                Ok(Entry::Made {
                    key,
                    slot,
                    bytes,
                    labels,
                }) => {
                    self.known.insert(key, Known { bytes, labels });
                    self.uses(slot, key);
                }
                Ok(Entry::Use { key, slot }) => self.uses(slot, key),
                Ok(Entry::Failed { key, slot, reason }) => {
                    self.failed.insert(slot, (key, reason));
                }
                Ok(Entry::Recipe {
                    digest,
                    ingredients,
                }) => {
                    self.recipes.insert(digest, ingredients);
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

    /// The last keys of all instances, sorted.
    pub fn last_keys(&self) -> Vec<Key> {
        let mut keys: Vec<Key> = self.last.values().copied().collect();
        keys.sort_unstable();
        keys
    }

    /// How a key came about: its ingredients and inputs.
    pub fn detail(&self, key: &Key) -> Option<(Ingredients, Vec<InputKey>)> {
        let detail = self.cold.iter().rev().find_map(|range| {
            match postcard::from_bytes(&self.bytes[range.clone()]) {
                Ok(Entry::Detail(d)) if d.key == *key => Some(d),
                _ => None,
            }
        })?;
        let ingredients = serde_json::from_str(self.recipes.get(&detail.recipe)?).ok()?;
        Some((ingredients, detail.inputs))
    }

    /// Notes that an instance uses this artifact; writes nothing when that is already the last word.
    pub fn used(
        &mut self,
        (step, item): (&str, &[u64]),
        key: Key,
        recipe: &Recipe,
        artifact: Known,
        inputs: impl FnOnce() -> Vec<InputKey>,
    ) {
        let slot = slot(step, item);
        if self.known.get(&key) == Some(&artifact) {
            let failed = self.failed.get(&slot).is_some_and(|f| f.0 == key);
            if failed || self.last.get(&slot) != Some(&key) {
                self.push(&Entry::Use { key, slot });
            }
            return;
        }
        if !self.recipes.contains_key(&recipe.digest) {
            let ingredients = serde_json::to_string(&recipe.ingredients).unwrap_or_default();
            self.push(&Entry::Recipe {
                digest: recipe.digest,
                ingredients,
            });
        }
        self.push(&Entry::Detail(Detail {
            key,
            recipe: recipe.digest,
            inputs: inputs(),
        }));
        self.push(&Entry::Made {
            key,
            slot,
            bytes: artifact.bytes,
            labels: artifact.labels,
        });
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
    /// When the file cannot be written. What is new is kept, and the next call tries again.
    pub fn tick(&mut self) -> io::Result<()> {
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
        if let (Some(file), Some(_)) = (&self.file, self.unsynced.take()) {
            file.sync_data()?;
        }
        Ok(())
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
                self.recipes.get(&detail.recipe).cloned(),
            ) {
                fresh.push(&Entry::Recipe {
                    digest: detail.recipe,
                    ingredients,
                });
            }
            fresh.push(&Entry::Detail(detail));
            let Known { bytes, labels } = known.clone();
            fresh.push(&Entry::Made {
                key,
                slot,
                bytes,
                labels,
            });
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
