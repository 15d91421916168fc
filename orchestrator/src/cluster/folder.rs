//! The folder that the head and its allocations share: what lies in it, and the few operations by which they meet.
//!
//! Asked of the file system is only this: a file that was written under another name in the same folder and renamed is there whole or not at
//! all, also for other machines; of several that rename the same name one succeeds; and what was written and closed is seen by others after
//! some time (`settle` of the profile). No lock is taken.

use super::needs::Shape;
use crate::engine::Outcome;
use camino::{Utf8Path, Utf8PathBuf};
use plyflow_artifact::seal::{hash_file, read_document, seal, sealed};
use plyflow_model::job::{Job, Progress, Record};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Write};

/// What earlier attempts at the same work came to.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Past {
    /// Allocations that ended while it ran, so that it went on from a checkpoint.
    pub continued: u32,
    /// Of these, the last ones in which it left no checkpoint.
    pub barren: u32,
    /// Attempts of which nothing was heard: the node failed, or somebody ended the allocation.
    pub lost: u32,
    /// Times it got more memory.
    pub grown: u32,
}

/// An attempt to run a job, as it is written for whoever takes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Order {
    /// Its name: part of the key, then what makes it the only one.
    pub attempt: String,
    /// In what allocation it may run.
    pub shape: Shape,
    /// In what allocation the first attempt could run: what the profile says.
    pub first: Shape,
    /// What to do.
    pub job: Job,
    /// Wall-clock limit of the step itself (s); 0: none.
    pub time_limit: f64,
    /// Where its log goes.
    pub log: Utf8PathBuf,
    /// What earlier attempts came to.
    pub past: Past,
}

/// How an attempt ended, as its allocation tells it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Which.
    pub attempt: String,
    /// The allocation.
    pub pilot: String,
    /// The machine.
    pub host: String,
    /// How long it ran (s).
    pub seconds: f64,
    /// The allocation was told to end, and told the step.
    pub told: bool,
    /// How it ended.
    pub outcome: Outcome,
}

/// A sign of life of an allocation.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Beat {
    /// Goes up.
    pub count: u64,
    /// The machine.
    pub host: String,
    /// Attempts that it runs, and how far they are.
    pub running: BTreeMap<String, Progress>,
    /// Attempts that have ended in it.
    pub ended: u64,
    /// Why it takes no more, once it does not.
    pub over: Option<String>,
}

/// Where an order stands.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Standing {
    /// It waits.
    Waits,
    /// An allocation has it.
    Taken(String),
}

/// The folder.
#[derive(Debug, Clone)]
pub struct Exchange {
    root: Utf8PathBuf,
}

const WAITING: &str = ".json";
const TAKEN: &str = ".taken";
const WITHDRAWN: &str = ".withdrawn";

/// Writes a file that is there whole or not at all, under its name, for whoever else looks. `lasting`: it also outlasts a power cut.
///
/// # Errors
/// When the disk refuses.
pub fn publish(path: &Utf8Path, bytes: &[u8], lasting: bool) -> io::Result<()> {
    let name = path.file_name().unwrap_or_default();
    // Of several machines: process numbers alone are not enough.
    let begun = path.with_file_name(format!(".{name}.{}-{}", host(), std::process::id()));
    let mut file = File::create(&begun)?;
    file.write_all(bytes)?;
    if lasting {
        file.sync_all()?;
    }
    drop(file);
    fs::rename(&begun, path)?;
    match path.parent() {
        Some(folder) if lasting => File::open(folder)?.sync_all(),
        _ => Ok(()),
    }
}

/// Reads a sealed document; `None`: it is not there, or not yet whole.
pub fn read_sealed<T: DeserializeOwned>(path: &Utf8Path) -> Option<T> {
    let bytes = read_document(path.as_std_path()).ok()?;
    serde_json::from_str(sealed(&bytes).ok()?).ok()
}

/// A document with its seal.
///
/// # Errors
/// When it cannot be written as JSON.
pub fn to_sealed<T: Serialize>(value: &T) -> io::Result<Vec<u8>> {
    Ok(seal(&serde_json::to_string_pretty(value)?).into_bytes())
}

/// Name of this machine.
pub fn host() -> String {
    let name = rustix::system::uname();
    let name = name.nodename().to_string_lossy();
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
    name.chars().filter(|c| plain(*c)).collect()
}

/// Names in a folder, sorted; none where there is none. What begins with a dot is being written.
pub fn names(folder: &Utf8Path) -> Vec<String> {
    let mut found: Vec<String> = (fs::read_dir(folder).into_iter().flatten().flatten())
        .filter_map(|e| e.file_name().into_string().ok())
        .filter(|n| !n.starts_with('.'))
        .collect();
    found.sort_unstable();
    found
}

impl Exchange {
    /// That of a run.
    pub fn new(run: &Utf8Path) -> Self {
        Self {
            root: run.join("cluster"),
        }
    }

    /// One in this folder.
    pub fn at(root: Utf8PathBuf) -> Self {
        Self { root }
    }

    /// Its folder.
    pub fn root(&self) -> &Utf8Path {
        &self.root
    }

    /// Makes what must be there.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn prepare(&self) -> io::Result<()> {
        for folder in ["queues", "results", "cancel", "made", "submissions"] {
            fs::create_dir_all(self.root.join(folder))?;
        }
        Ok(())
    }

    /// Whether a run ever used it.
    pub fn exists(&self) -> bool {
        self.root.is_dir()
    }

    /// Folder of an allocation, or of an array of them.
    pub fn submission(&self, name: &str) -> Utf8PathBuf {
        self.root.join("submissions").join(name)
    }

    /// Names of all submissions.
    pub fn submissions(&self) -> Vec<String> {
        names(&self.root.join("submissions"))
    }

    /// Where it stands that the run was cancelled.
    pub fn stop(&self) -> Utf8PathBuf {
        self.root.join("stop")
    }

    fn queue(&self, shape: &str) -> Utf8PathBuf {
        self.root.join("queues").join(shape)
    }

    /// Names of the shapes that orders were ever written for.
    pub fn shapes(&self) -> Vec<String> {
        names(&self.root.join("queues"))
    }

    fn result(&self, attempt: &str) -> Utf8PathBuf {
        self.root.join("results").join(format!("{attempt}.json"))
    }

    fn cancel_mark(&self, attempt: &str) -> Utf8PathBuf {
        self.root.join("cancel").join(attempt)
    }

    /// A file of what an attempt makes.
    pub fn made(&self, attempt: &str, end: &str) -> Utf8PathBuf {
        self.root.join("made").join(format!("{attempt}{end}"))
    }

    /// Puts an order into its queue.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn put(&self, order: &Order) -> io::Result<()> {
        let folder = self.queue(&order.shape.name());
        fs::create_dir_all(&folder)?;
        let path = folder.join(format!("{}{WAITING}", order.attempt));
        publish(&path, &to_sealed(order)?, false)
    }

    /// Orders of a queue and where they stand, in order of their names.
    pub fn standing(&self, shape: &str) -> Vec<(String, Standing)> {
        let one = |name: String| {
            if let Some(attempt) = name.strip_suffix(WAITING) {
                return Some((attempt.to_owned(), Standing::Waits));
            }
            let (attempt, pilot) = name.strip_suffix(TAKEN)?.split_once('.')?;
            Some((attempt.to_owned(), Standing::Taken(pilot.to_owned())))
        };
        names(&self.queue(shape))
            .into_iter()
            .filter_map(one)
            .collect()
    }

    /// Orders that wait in a queue.
    pub fn waiting(&self, shape: &str) -> Vec<String> {
        let all = self.standing(shape).into_iter();
        all.filter(|(_, s)| *s == Standing::Waits)
            .map(|(a, _)| a)
            .collect()
    }

    fn rename_order(&self, shape: &str, attempt: &str, to: &str) -> bool {
        let folder = self.queue(shape);
        let (from, to) = (
            folder.join(format!("{attempt}{WAITING}")),
            folder.join(format!("{attempt}{to}")),
        );
        match fs::rename(&from, &to) {
            Ok(()) => true,
            // A file server that was asked twice tells the second time that there is no such file, also to whom it has given it.
            Err(_) => to.exists(),
        }
    }

    /// Takes an order for an allocation; `None`: another has it, or it was taken back.
    pub fn take(&self, shape: &str, attempt: &str, pilot: &str) -> Option<Order> {
        let to = format!(".{pilot}{TAKEN}");
        if !self.rename_order(shape, attempt, &to) {
            return None;
        }
        read_sealed(&self.queue(shape).join(format!("{attempt}{to}")))
    }

    /// Takes an order back; false: an allocation has it.
    pub fn withdraw(&self, shape: &str, attempt: &str) -> bool {
        self.rename_order(shape, attempt, WITHDRAWN)
    }

    /// The order of an attempt, wherever it stands.
    pub fn order(&self, shape: &str, attempt: &str, standing: &Standing) -> Option<Order> {
        let end = match standing {
            Standing::Waits => WAITING.to_owned(),
            Standing::Taken(pilot) => format!(".{pilot}{TAKEN}"),
        };
        read_sealed(&self.queue(shape).join(format!("{attempt}{end}")))
    }

    /// Writes a verdict.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn tell(&self, verdict: &Verdict, lasting: bool) -> io::Result<()> {
        publish(
            &self.result(&verdict.attempt),
            &to_sealed(verdict)?,
            lasting,
        )
    }

    /// Attempts on which there is a verdict.
    pub fn told(&self) -> Vec<String> {
        let all = names(&self.root.join("results")).into_iter();
        all.filter_map(|n| n.strip_suffix(WAITING).map(str::to_owned))
            .collect()
    }

    /// The verdict on an attempt; `None`: there is none, or it cannot be seen whole yet.
    pub fn verdict(&self, attempt: &str) -> Option<Verdict> {
        read_sealed(&self.result(attempt))
    }

    /// Asks the allocation that has an attempt to stop it.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn ask_to_stop(&self, attempt: &str) -> io::Result<()> {
        publish(&self.cancel_mark(attempt), b"", false)
    }

    /// Attempts that are to stop.
    pub fn to_stop(&self) -> Vec<String> {
        names(&self.root.join("cancel"))
    }

    /// Whether what an attempt has made can be seen as it was written: size and hash. Another machine may have it hours before this one
    /// sees all of it.
    pub fn is_whole(&self, attempt: &str, record: &Record, ending: &str) -> bool {
        let path = self.made(attempt, ending);
        // To open asks the file server anew, where to look alone may not.
        hash_file(path.as_std_path()).is_ok_and(|(hash, size)| {
            size == record.bytes && (record.hash.is_empty() || hash == record.hash)
        })
    }

    /// Removes all of an attempt.
    pub fn forget(&self, shape: &str, attempt: &str) {
        let _ = fs::remove_file(self.result(attempt));
        let _ = fs::remove_file(self.cancel_mark(attempt));
        for (folder, begin) in [
            (self.queue(shape), attempt),
            (self.root.join("made"), attempt),
        ] {
            for end in [
                WAITING,
                WITHDRAWN,
                crate::store::ENDING,
                ".record.json",
                ".log",
            ] {
                let _ = fs::remove_file(folder.join(format!("{begin}{end}")));
            }
        }
        let _ = fs::remove_dir_all(self.made(attempt, ".scratch"));
    }

    /// Removes the order of an attempt that an allocation had.
    pub fn forget_taken(&self, shape: &str, attempt: &str, pilot: &str) {
        let name = format!("{attempt}.{pilot}{TAKEN}");
        let _ = fs::remove_file(self.queue(shape).join(name));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_model::job::{JOB_VERSION, LibraryRef};

    fn exchange(folder: &tempfile::TempDir) -> Exchange {
        let exchange = Exchange::at(Utf8PathBuf::from_path_buf(folder.path().join("c")).unwrap());
        exchange.prepare().unwrap();
        exchange
    }

    fn order(attempt: &str) -> Order {
        let library = LibraryRef {
            name: "p".into(),
            path: "/p.so".into(),
            hash: None,
        };
        let job = Job {
            version: JOB_VERSION,
            step: "a".into(),
            item: vec![3],
            key: "00".into(),
            plugin: library,
            components: Vec::new(),
            search_path: Vec::new(),
            parameters: serde_json::json!({"x": 1.5}),
            inputs: Vec::new(),
            output_kind: "test".into(),
            collection: false,
            threads: 1,
            memory_limit: 0,
            artifact: "/a".into(),
            record: "/r".into(),
            scratch: "/s".into(),
            checkpoints: None,
            provenance: serde_json::json!({}),
        };
        let shape = Shape {
            cores: 1,
            memory: 1,
            walltime: 60,
            gpus: 0,
            at_once: 1,
            without: Vec::new(),
        };
        Order {
            attempt: attempt.into(),
            first: shape.clone(),
            shape,
            job,
            time_limit: 0.0,
            log: "/l".into(),
            past: Past::default(),
        }
    }

    #[test]
    fn of_many_that_want_an_order_one_gets_it_and_it_is_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let exchange = exchange(&folder);
        let n = 200;
        let orders: Vec<Order> = (0..n).map(|i| order(&format!("a-{i}"))).collect();
        orders.iter().for_each(|o| exchange.put(o).unwrap());
        let shape = orders[0].shape.name();
        let takers = (0..4).map(|t| {
            let (exchange, shape) = (exchange.clone(), shape.clone());
            std::thread::spawn(move || {
                let names = (0..n).map(|i| format!("a-{i}"));
                if t == 3 {
                    // The head takes some back at the same time.
                    let mine: Vec<String> =
                        names.filter(|a| exchange.withdraw(&shape, a)).collect();
                    return mine;
                }
                let take = |a: String| exchange.take(&shape, &a, &format!("p_{t}"));
                names.filter_map(take).map(|o| o.attempt).collect()
            })
        });
        let takers: Vec<_> = takers.collect();
        let mut got: Vec<String> = takers.into_iter().flat_map(|t| t.join().unwrap()).collect();
        got.sort_unstable();
        let all = got.len();
        got.dedup();
        assert_eq!((all, got.len()), (n, n));
        assert!(exchange.waiting(&shape).is_empty());
        exchange.put(&order("b")).unwrap();
        assert_eq!(exchange.take(&shape, "b", "p_1"), Some(order("b")));
        assert_eq!(exchange.take(&shape, "b", "p_2"), None);
    }

    #[test]
    fn half_a_document_is_not_there_yet() {
        let folder = tempfile::tempdir().unwrap();
        let exchange = exchange(&folder);
        let path = exchange.root().join("x.json");
        let whole = to_sealed(&order("a")).unwrap();
        for end in [0, 1, whole.len() / 2, whole.len() - 1] {
            fs::write(&path, &whole[..end]).unwrap();
            assert_eq!(read_sealed::<Order>(&path), None, "{end}");
        }
        publish(&path, &whole, true).unwrap();
        assert_eq!(read_sealed(&path), Some(order("a")));
        assert_eq!(
            names(exchange.root()).len(),
            6,
            "nothing that was begun is left"
        );
    }
}
