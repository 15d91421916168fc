//! Whether the files of a key are those that were written.
//!
//! An artifact is sealed by the hash in its record, the record by its own. Hashing is for when bytes are consumed or printed; a run
//! that does nothing looks only at what the file system tells of the files ([`Seen`]), as it was when they were last known to be whole.

use super::folder::Store;
use super::names::{ENDING, RECORD_ENDING, key_of, list};
use super::run::RunFolder;
use crate::plan::{ByKey, Key};
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::seal::{BrokenSeal, hash_file, read_document, sealed};
use plyflow_model::job::{JOB_VERSION, Record};
use rustix::fs::{AtFlags, FileType, Mode, OFlags, Stat};
use rustix::io::Errno;
use std::collections::HashMap;
use std::io;
use std::time::Duration;

/// What the file system tells of the two files of a key, in short.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seen {
    /// Size of the artifact (bytes).
    pub bytes: u64,
    /// Size, inode and times of both files, hashed: as long as it is the same, nothing has written to them.
    pub stamp: u64,
}

/// Why the store has not what it should have of a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Flaw {
    /// There is no artifact.
    Gone,
    /// An earlier version has written it, without a seal: nobody can tell whether it is as it was written.
    Unsealed,
    /// It is not what was written, in words: `the artifact FILE is damaged: why`.
    Damaged(String),
}

impl Flaw {
    fn damaged(what: &str, path: &Utf8Path, why: impl std::fmt::Display) -> Self {
        Self::Damaged(format!("the {what} {path} is damaged: {why}"))
    }

    /// In words.
    pub fn text(&self) -> &str {
        match self {
            Self::Gone => "its artifact is not in the store any more",
            Self::Unsealed => {
                "its artifact was written by an earlier version, which kept no hash of it: it cannot be told whether it is whole"
            }
            Self::Damaged(text) => text,
        }
    }
}

/// The instance that a record should be of.
#[derive(Debug, Clone, Copy)]
pub struct Expected<'a> {
    /// Step.
    pub step: &'a str,
    /// Fan-out index path.
    pub item: &'a [u64],
    /// Artifact kind.
    pub kind: &'a str,
}

fn plain(what: &str, path: &Utf8Path) -> Result<Stat, Flaw> {
    judge(rustix::fs::stat(path.as_std_path()), what, path)
}

fn judge(found: rustix::io::Result<Stat>, what: &str, path: &Utf8Path) -> Result<Stat, Flaw> {
    match found {
        Ok(found) if FileType::from_raw_mode(found.st_mode).is_file() => Ok(found),
        Ok(_) => Err(Flaw::damaged(what, path, "it is no plain file")),
        Err(Errno::NOENT) => Err(Flaw::Gone),
        Err(e) => Err(Flaw::damaged(what, path, io::Error::from(e))),
    }
}

/// Bytes that stay the same as long as nobody writes to a file, exchanges it, or changes what is told of it.
fn marks(s: &Stat) -> [i64; 6] {
    let whole = |n: u64| n.cast_signed();
    [
        s.st_size,
        whole(s.st_ino),
        s.st_mtime,
        whole(s.st_mtime_nsec),
        s.st_ctime,
        whole(s.st_ctime_nsec),
    ]
}

/// What is seen of an artifact and its record.
fn seen(artifact: &Stat, record: &Stat) -> Seen {
    let mut bytes = [0; 96];
    let all = marks(artifact).into_iter().chain(marks(record));
    for (place, mark) in bytes.chunks_exact_mut(8).zip(all) {
        place.copy_from_slice(&mark.to_le_bytes());
    }
    let hash = blake3::hash(&bytes);
    Seen {
        bytes: artifact.st_size.cast_unsigned(),
        stamp: u64::from_le_bytes(std::array::from_fn(|i| hash.as_bytes()[i])),
    }
}

/// What is seen of many keys (sorted): of those that look whole. Each folder is opened once, so the system follows no long paths.
pub(super) fn look_at_many(artifacts: &Utf8Path, keys: &[Key]) -> Vec<(Key, Seen)> {
    let mut all = Vec::with_capacity(keys.len());
    for shard in keys.chunk_by(|a, b| a.0[0] == b.0[0]) {
        let hex = shard[0].hex();
        let flags = OFlags::PATH | OFlags::DIRECTORY | OFlags::CLOEXEC;
        let folder = artifacts.join(&hex[..2]);
        let Ok(folder) = rustix::fs::open(folder.as_std_path(), flags, Mode::empty()) else {
            continue;
        };
        let mut name = String::with_capacity(96);
        for key in shard {
            let mut stat = |ending: &str| {
                name.clear();
                name.push_str(&blake3::Hash::from_bytes(key.0).to_hex());
                name.push_str(ending);
                let found = rustix::fs::statat(&folder, &name, AtFlags::empty()).ok()?;
                FileType::from_raw_mode(found.st_mode)
                    .is_file()
                    .then_some(found)
            };
            if let (Some(artifact), Some(record)) = (stat(ENDING), stat(RECORD_ENDING)) {
                all.push((*key, seen(&artifact, &record)));
            }
        }
    }
    all
}

impl Store {
    /// Looks at the files of a key, without reading them.
    ///
    /// # Errors
    /// When there is no artifact, or when one of the two is not even a file.
    pub fn look(&self, key: &Key) -> Result<Seen, Flaw> {
        let artifact = plain("artifact", &self.artifact(key))?;
        let path = self.record(key);
        let record = plain("record", &path).map_err(|flaw| match flaw {
            Flaw::Gone => Flaw::damaged("record", &path, "it has gone"),
            other => other,
        })?;
        Ok(seen(&artifact, &record))
    }

    /// Looks at the files of many keys (sorted) with two threads, while `meanwhile` is done: those of which both are files.
    pub fn look_ahead<T>(
        &self,
        keys: &[Key],
        meanwhile: impl FnOnce() -> T,
    ) -> (HashMap<Key, Seen, ByKey>, T) {
        // For a few it is not worth a thread.
        if keys.len() < 200 {
            return (HashMap::default(), meanwhile());
        }
        let artifacts = self.root().join("artifacts");
        let (first, second) = keys.split_at(keys.len() / 2);
        std::thread::scope(|scope| {
            let all = [first, second].map(|part| {
                let artifacts = &artifacts;
                scope.spawn(move || look_at_many(artifacts, part))
            });
            let done = meanwhile();
            let mut found = HashMap::with_capacity_and_hasher(keys.len(), ByKey);
            for part in all {
                found.extend(part.join().unwrap_or_default());
            }
            (found, done)
        })
    }

    /// The record of a key, when it is what was written.
    ///
    /// # Errors
    /// When it is not there, not sealed, or damaged.
    pub fn read_record(&self, key: &Key) -> Result<Record, Flaw> {
        read_record(&self.record(key), key)
    }

    /// Reads the artifact and the record of a key: both are what was written, and of the instance that is `expected` when this
    /// gives a record.
    ///
    /// # Errors
    /// When they are not.
    pub fn check(&self, key: &Key, expected: Option<Expected<'_>>) -> Result<Record, Flaw> {
        // Another run may be placing the two anew at this moment (`--force`), one after the other.
        for _ in 0..3 {
            let before = self.look(key).ok();
            let found = self.check_once(key, expected);
            if !matches!(found, Err(Flaw::Damaged(_))) {
                return found;
            }
            std::thread::sleep(Duration::from_millis(20));
            if self.look(key).ok() == before {
                return found;
            }
        }
        self.check_once(key, expected)
    }

    fn check_once(&self, key: &Key, expected: Option<Expected<'_>>) -> Result<Record, Flaw> {
        self.look(key)?;
        let record = self.read_record(key)?;
        let path = self.record(key);
        if let Some(e) = expected
            && (e.step, e.item, e.kind) != (&record.step, &record.item, &record.kind)
        {
            return Err(Flaw::damaged("record", &path, "it is of another step"));
        }
        check_artifact(&self.artifact(key), &record)?;
        Ok(record)
    }
}

/// A record at `path`, when it is what was written of a key.
pub(super) fn read_record(path: &Utf8Path, key: &Key) -> Result<Record, Flaw> {
    read_record_of(path, Some(key))
}

fn read_record_of(path: &Utf8Path, key: Option<&Key>) -> Result<Record, Flaw> {
    let damaged = |why: String| Flaw::damaged("record", path, why);
    let bytes = match read_document(path.as_std_path()) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Err(Flaw::Gone),
        other => other.map_err(|e| damaged(e.to_string()))?,
    };
    let record = match sealed(&bytes) {
        Ok(text) => serde_json::from_str::<Record>(text).map_err(|e| damaged(e.to_string()))?,
        // What earlier versions have written has no seal.
        Err(BrokenSeal::None) => match serde_json::from_slice::<Record>(&bytes) {
            Ok(r) if r.version < JOB_VERSION && r.hash.is_empty() => return Err(Flaw::Unsealed),
            _ => return Err(damaged(BrokenSeal::None.to_string())),
        },
        Err(e) => return Err(damaged(e.to_string())),
    };
    if key.is_some_and(|key| record.key != key.hex()) {
        return Err(damaged("it is of another key".into()));
    }
    Ok(record)
}

/// The record that lies beside an artifact anywhere, when it is what was written; `None` when there is none, or when an earlier version has
/// written it.
///
/// # Errors
/// When it is damaged.
pub fn record_beside(artifact: &Utf8Path) -> Result<Option<Record>, Flaw> {
    let path = artifact.with_extension("record.json");
    // In a store the name is the key; whoever has copied a file may have named it otherwise.
    let key = artifact.file_stem().and_then(Key::from_hex);
    match read_record_of(&path, key.as_ref()) {
        Ok(record) => Ok(Some(record)),
        Err(Flaw::Gone | Flaw::Unsealed) => Ok(None),
        Err(flaw) => Err(flaw),
    }
}

/// Whether an artifact is the one that its record tells of.
///
/// # Errors
/// [`Flaw::Damaged`] when it is not, or cannot be read; [`Flaw::Gone`] when it is not there.
pub fn check_artifact(path: &Utf8Path, record: &Record) -> Result<(), Flaw> {
    match hash_file(path.as_std_path()) {
        Ok((hash, bytes)) if (&hash, bytes) == (&record.hash, record.bytes) => Ok(()),
        Ok((_, bytes)) if bytes != record.bytes => {
            let why = format!("it has {bytes} bytes, and {} were written", record.bytes);
            Err(Flaw::damaged("artifact", path, why))
        }
        Ok(_) => {
            let why =
                "its bytes are not those that were written (another BLAKE3 than in its record)";
            Err(Flaw::damaged("artifact", path, why))
        }
        Err(e) if e.kind() == io::ErrorKind::NotFound => Err(Flaw::Gone),
        Err(e) => Err(Flaw::damaged("artifact", path, e)),
    }
}

/// Whether an artifact that could not be put into the store is what was written.
pub(super) fn unplaced(artifact: &Utf8Path, key: &Key) -> Result<(), Flaw> {
    let record = read_record(&artifact.with_extension("record.json"), key)?;
    check_artifact(artifact, &record)
}

/// Artifacts of a run that could not be put into the store and are not what was written.
pub fn read_unplaced(run: &RunFolder) -> Vec<(Utf8PathBuf, Flaw)> {
    let files = list(&run.unplaced()).unwrap_or_default().into_iter();
    let flawed = |path: Utf8PathBuf| {
        let flaw = unplaced(&path, &key_of(&path, ENDING)?).err()?;
        Some((path, flaw))
    };
    files.filter_map(flawed).collect()
}

#[cfg(test)]
#[path = "check_tests.rs"]
mod tests;
