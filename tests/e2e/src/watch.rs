//! Watches the artifacts of a store, so that also what was to be seen for a moment only is known afterwards, and looks for what runs have
//! left behind.

use rustix::fs::inotify::{self, CreateFlags, ReadFlags, WatchFlags};
use std::collections::{BTreeMap, BTreeSet};
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

/// What the kernel tells of the folders of artifacts.
#[derive(Debug)]
pub struct Watch {
    queue: OwnedFd,
    store: PathBuf,
    shards: BTreeMap<i32, PathBuf>,
    /// Artifacts that are visible.
    pub visible: BTreeSet<String>,
    /// Artifacts that were placed while their name was there.
    pub again: u64,
    /// Names that were visible before what they name was whole, or vanished, or were written to.
    pub partial: Vec<String>,
}

impl Watch {
    /// Watches a store from now on; makes its folders, so that none is made unseen.
    ///
    /// # Panics
    /// When the kernel refuses.
    #[must_use]
    pub fn begin(store: &Path) -> Self {
        let mut watch = Self {
            queue: inotify::init(CreateFlags::NONBLOCK | CreateFlags::CLOEXEC).expect("a queue"),
            store: store.to_owned(),
            shards: BTreeMap::new(),
            visible: BTreeSet::new(),
            again: 0,
            partial: Vec::new(),
        };
        let flags = WatchFlags::CREATE
            | WatchFlags::MODIFY
            | WatchFlags::MOVED_TO
            | WatchFlags::MOVED_FROM
            | WatchFlags::DELETE;
        for shard in 0..256 {
            let folder = store.join(format!("artifacts/{shard:02x}"));
            std::fs::create_dir_all(&folder).expect("a folder");
            let number = inotify::add_watch(&watch.queue, &folder, flags).expect("a watch");
            watch.shards.insert(number, folder);
        }
        watch.visible = super::artifacts(store).into_keys().collect();
        watch
    }

    /// Takes what has happened since the last call: every artifact that came is compared with what an undisturbed run has made.
    ///
    /// # Panics
    /// When the kernel has lost count.
    pub fn take(&mut self, expected: &BTreeMap<String, Vec<u8>>) {
        let mut buffer = [MaybeUninit::uninit(); 1 << 14];
        let mut reader = inotify::Reader::new(&self.queue, &mut buffer);
        loop {
            let event = match reader.next() {
                Ok(event) => event,
                Err(rustix::io::Errno::WOULDBLOCK) => return,
                Err(e) => panic!("the queue of events: {e}"),
            };
            let what = event.events();
            assert!(
                !what.contains(ReadFlags::QUEUE_OVERFLOW),
                "events were lost"
            );
            let (Some(folder), Some(name)) = (self.shards.get(&event.wd()), event.file_name())
            else {
                continue;
            };
            let name = name.to_str().expect("a UTF-8 name").to_owned();
            let is_artifact = name.ends_with(".vtkhdf");
            if !is_artifact && !name.ends_with(".record.json") {
                continue;
            }
            if !what.contains(ReadFlags::MOVED_TO) {
                self.partial.push(format!("{name}: {what:?}"));
            } else if is_artifact {
                if !self.visible.insert(name.clone()) {
                    self.again += 1;
                }
                let path = folder.join(&name);
                if let Some(why) = flaw(&path, expected.get(&name)) {
                    self.partial.push(format!("{name}: {why}"));
                }
            }
        }
    }

    /// Reads all that is visible; what differs from an undisturbed run's counts as partial.
    ///
    /// # Panics
    /// When a file cannot be read.
    pub fn read_all(&mut self, expected: &BTreeMap<String, Vec<u8>>) {
        for (name, bytes) in super::artifacts(&self.store) {
            if expected.get(&name) != Some(&bytes) {
                self.partial.push(format!("{name} differs"));
            }
        }
    }
}

/// Why a visible artifact is not whole: its bytes, or its record, which is there before it.
fn flaw(path: &Path, expected: Option<&Vec<u8>>) -> Option<&'static str> {
    let bytes = std::fs::read(path).ok();
    if bytes.is_none() || bytes.as_ref() != expected {
        return Some("it has other bytes");
    }
    let record = std::fs::read_to_string(path.with_extension("record.json"));
    let Ok(record) = record else {
        return Some("it has no record");
    };
    // The seal is the last of it.
    let is_whole = record.trim_end().ends_with('}') && record.contains("\"seal\"");
    (!is_whole).then_some("its record is not whole")
}

/// What runs have left in a folder with a workflow and its store that a finished run does not leave: temporary files, folders of them,
/// records without their artifact, files that were set aside or could not be placed, checkpoints.
#[must_use]
pub fn leftovers(folder: &Path, store: &Path) -> Vec<String> {
    let mut left = Vec::new();
    let mut folders = vec![store.to_owned()];
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(&at).into_iter().flatten().flatten() {
            let path = entry.path();
            let inside = path.strip_prefix(store).unwrap_or(&path);
            let inside = inside.to_string_lossy().into_owned();
            if path.is_dir() {
                if ["tmp", "damaged", "unplaced"]
                    .iter()
                    .any(|n| path.ends_with(n))
                {
                    left.push(format!("{inside}/"));
                }
                folders.push(path);
            } else if !is_kept(&inside, &path) {
                left.push(inside);
            }
        }
    }
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_temporary = name.starts_with('.') && entry.path() != store;
        if is_temporary || name.contains("partial") {
            left.push(name);
        }
    }
    left.sort();
    left
}

/// Whether a finished run leaves a file of this name (inside of the store).
fn is_kept(inside: &str, path: &Path) -> bool {
    let is_hex = |text: &str| text.bytes().all(|b| b.is_ascii_hexdigit());
    let words: Vec<&str> = inside.split('/').collect();
    match words[..] {
        ["lock" | "plugins.json"] => true,
        ["resolved", name] => name.len() == 16 && is_hex(name),
        ["artifacts", shard, name] => {
            let (key, ending) = name.split_once('.').unwrap_or((name, ""));
            let whole = key.len() == 64 && is_hex(key) && key.starts_with(shard);
            let beside = match ending {
                "vtkhdf" => "record.json",
                "record.json" => "vtkhdf",
                _ => return false,
            };
            whole && path.with_file_name(format!("{key}.{beside}")).is_file()
        }
        ["runs", _, "lock" | "journal"] => true,
        ["runs", _, "logs", name] => name.ends_with(".log"),
        _ => false,
    }
}

/// Processes that plyflow has started for steps and that live still, whoever started it, with this folder in their environment or words.
#[must_use]
pub fn workers_under(folder: &Path) -> usize {
    let word = folder.to_string_lossy().into_owned();
    let all = std::fs::read_dir("/proc").into_iter().flatten().flatten();
    let is_one = |path: PathBuf| {
        let read = |name: &str| std::fs::read(path.join(name)).unwrap_or_default();
        let line = String::from_utf8_lossy(&read("cmdline")).into_owned();
        let is_worker = line.contains("step-worker");
        is_worker && String::from_utf8_lossy(&read("environ")).contains(&word)
    };
    all.map(|e| e.path()).filter(|p| is_one(p.clone())).count()
}
