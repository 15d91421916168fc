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

pub use aside::damage_of_plugins;
pub use check::{Expected, Flaw, Seen, check_artifact, read_unplaced, record_beside};
pub use early::{Ahead, Early};
pub use journal::{Detail, Journal, Known, Scanned};
pub use lock::{Lock, LockError};

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
mod tests {
    use super::*;

    #[test]
    fn names_that_are_not_file_names_stay_apart() {
        assert_eq!(safe_name("local[A,0]"), "local[A,0]");
        assert_ne!(safe_name("a/b"), safe_name("a:b"));
        assert!(!safe_name("../../etc").contains('/'));
        assert!(!safe_name("..").starts_with('.'));
    }

    #[test]
    fn an_artifact_becomes_visible_with_its_record() {
        let folder = tempfile::tempdir().unwrap();
        let root = Utf8PathBuf::from_path_buf(folder.path().to_owned()).unwrap();
        let store = Store::new(root.clone());
        let key = Key([7; 32]);
        let (a, r) = (root.join("a"), root.join("r"));
        fs::write(&a, "artifact").unwrap();
        assert!(
            store.commit(&key, &a, &r, true).is_err(),
            "a missing record must stop the commit"
        );
        assert_eq!(store.size(&key), None);
        fs::write(&r, "{}").unwrap();
        store.commit(&key, &a, &r, true).unwrap();
        assert_eq!(store.size(&key), Some(8));
        assert_eq!(store.keys().unwrap(), [key]);
        store.remove(&key).unwrap();
        assert!(store.keys().unwrap().is_empty());
    }

    #[test]
    fn what_cannot_be_committed_is_kept_and_taken_by_the_next_run() {
        let folder = tempfile::tempdir().unwrap();
        let root = Utf8PathBuf::from_path_buf(folder.path().to_owned()).unwrap();
        let store = Store::new(root.clone());
        let run = store.run("study");
        let key = Key([7; 32]);
        let (a, r) = (root.join("a"), root.join("r"));
        write_pair(&key, &a, &r);
        // A file where the folder should be: nothing can be put there.
        fs::write(root.join("artifacts"), "").unwrap();
        assert!(store.commit(&key, &a, &r, true).is_err());
        store.keep_unplaced(&run, &key, &a, &r).unwrap();
        store.take_unplaced(&run);
        assert_eq!((store.size(&key), a.exists()), (None, false));
        fs::remove_file(root.join("artifacts")).unwrap();
        store.take_unplaced(&run);
        assert_eq!(store.size(&key), Some(8));
        assert!(store.check(&key, None).is_ok() && !run.unplaced().exists());
    }

    #[test]
    fn what_is_damaged_while_it_could_not_be_committed_never_gets_into_the_store() {
        let folder = tempfile::tempdir().unwrap();
        let root = Utf8PathBuf::from_path_buf(folder.path().to_owned()).unwrap();
        let store = Store::new(root.clone());
        let run = store.run("study");
        let key = Key([7; 32]);
        let (a, r) = (root.join("a"), root.join("r"));
        write_pair(&key, &a, &r);
        store.keep_unplaced(&run, &key, &a, &r).unwrap();
        let kept = run.unplaced().join(format!("{}{ENDING}", key.hex()));
        fs::write(&kept, "ARTIFACT").unwrap();
        let told = store.take_unplaced(&run);
        assert!(told[0].contains("damaged"), "{told:?}");
        assert_eq!(store.size(&key), None);
        assert_eq!(store.set_aside_before().unwrap().len(), 2);
    }

    /// An artifact and its record, as a worker leaves them.
    pub(super) fn write_pair(key: &Key, artifact: &Utf8Path, record: &Utf8Path) {
        fs::write(artifact, "artifact").unwrap();
        let whole = plyflow_model::job::Record {
            version: plyflow_model::job::JOB_VERSION,
            step: "s".into(),
            item: vec![],
            key: key.hex(),
            kind: "forming".into(),
            bytes: 8,
            hash: blake3::hash(b"artifact").to_hex().to_string(),
            cost: plyflow_model::job::Cost::default(),
            results: vec![],
            collection: None,
            warnings: vec![],
            host: "h".into(),
            started: 0.0,
        };
        let text = serde_json::to_string_pretty(&whole).unwrap();
        fs::write(record, plyflow_artifact::seal::seal(&text)).unwrap();
    }

    #[test]
    fn clearing_removes_what_runs_have_put_there_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let root = Utf8PathBuf::from_path_buf(folder.path().to_owned()).unwrap();
        let store = Store::new(root.clone());
        let key = Key([7; 32]);
        let write = |path: Utf8PathBuf| {
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "x").unwrap();
        };
        let own = [
            store.artifact(&key),
            store.record(&key),
            store.run("study").journal(),
            store.run("study").tmp().join("1.vtkhdf"),
            store.damaged().join("x"),
            root.join("resolved/0123456789abcdef"),
            root.join("plugins.json"),
        ];
        let others = [
            root.join("runs/exp1/result.csv"),
            root.join("artifacts/sub/model.bin"),
            root.join("resolved/issues.txt"),
            root.join("notes.txt"),
        ];
        own.iter().chain(&others).cloned().for_each(write);
        store.clear().unwrap();
        assert!(own.iter().all(|p| !p.exists()));
        assert!(others.iter().all(|p| p.exists()));
    }
}
