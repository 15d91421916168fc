//! A study whose numbers are known, every kind of damage to its files, and what the commands say then.

use plyflow::plan::Key;
use plyflow::store::{Journal, Store};
use plyflow_faults::program;
use serde_json::Value;
use std::collections::BTreeMap;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A folder with a workflow in it, and its store.
pub struct Study {
    folder: tempfile::TempDir,
}

impl Study {
    pub fn new(workflow: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let text = format!("plyflow: 1\nname: study\n{workflow}");
        std::fs::write(folder.path().join("workflow.yaml"), text).expect("a workflow file");
        Self { folder }
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub fn command_on(&self, file: &str, words: &[&str]) -> Command {
        let mut command = Command::new(program());
        command.arg(words[0]).arg(file).args(&words[1..]);
        command.current_dir(self.folder.path()).stdin(Stdio::null());
        command.env("PLYFLOW_PLUGINS", plyflow_faults::folder());
        command
    }

    /// Runs a command to its end. One that takes minutes is taken for one that never ends.
    pub fn call(&self, words: &[&str]) -> Output {
        let mut command = self.command_on("workflow.yaml", words);
        let out = [self.path("stdout"), self.path("stderr")];
        let [to, err] = [0, 1].map(|k| std::fs::File::create(&out[k]).expect("a file"));
        let mut child = command
            .stdout(to)
            .stderr(err)
            .spawn()
            .expect("plyflow starts");
        let begun = Instant::now();
        let status = loop {
            if let Some(status) = child.try_wait().expect("a child") {
                break status;
            }
            if begun.elapsed() > Duration::from_secs(300) {
                child.kill().expect("a child");
                panic!("{words:?} hangs");
            }
            std::thread::sleep(Duration::from_millis(2));
        };
        let [stdout, stderr] = out.map(|p| std::fs::read(p).expect("a file"));
        Output {
            status,
            stdout,
            stderr,
        }
    }

    /// Every visible artifact: name and bytes.
    pub fn artifacts(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let mut all = files(&self.path(".plyflow/artifacts"));
        all.retain(|f| kind(f) == "vtkhdf");
        let read = |f: PathBuf| {
            let bytes = std::fs::read(&f).expect("an artifact");
            (f.file_name().expect("a name").into(), bytes)
        };
        all.into_iter().map(read).collect()
    }
}

/// Artifacts with attributes alone, collections, meshes with frames and arrays; a fan-out; and one that reads most of them.
pub const MIXED: &str = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  zones: {plugin: split, with: {items: 3}, from: {in: first}}
  mesh: {plugin: mesh, with: {points: 40, frames: 4}, for_each: {z: zones}, from: {in: zones}}
  read: {plugin: mesh-reader, for_each: {z: zones}, from: {formed: mesh}}
  all: {plugin: sum, from: {in: [read, mesh, first]}}
";

/// Numbers without a pattern, the same each time (xorshift64*).
pub struct Random(pub u64);

impl Random {
    pub fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        let mixed = self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33;
        usize::try_from(mixed).expect("31 bits") % n
    }

    pub fn one_of<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Damage {
    /// One bit turned.
    Bit,
    /// The same, with nothing to be seen in what the file system tells: rot.
    Rot,
    Zeroed,
    Truncated,
    Longer,
    Emptied,
    /// Exchanged with another file of its kind.
    Swapped,
    Deleted,
    /// A folder in its place, with something in it.
    Folder,
    Unreadable,
    /// A link that leads to itself.
    Link,
    /// A pipe in its place: whoever reads it waits without end.
    Pipe,
    /// A link to a device: whoever reads it reads without end.
    Device,
}

pub const WHOLE_FILE: [Damage; 11] = [
    Damage::Zeroed,
    Damage::Truncated,
    Damage::Longer,
    Damage::Emptied,
    Damage::Swapped,
    Damage::Deleted,
    Damage::Folder,
    Damage::Unreadable,
    Damage::Link,
    Damage::Pipe,
    Damage::Device,
];

/// All files of a store but those that were set aside, sorted.
pub fn files(store: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![store.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() && !path.ends_with("damaged") {
                folders.push(path);
            } else if path.is_file() {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// What comes behind the name in a file's name: files of one kind have the same.
pub fn kind(path: &Path) -> String {
    let name = path
        .file_name()
        .and_then(|n| n.to_str())
        .unwrap_or_default();
    name.split_once('.').map_or(name, |(_, end)| end).to_owned()
}

/// Makes the journal take a file of an artifact for unchanged, as it would if a disk had let it rot.
pub fn hide(store: &Path, file: &Path) {
    let name = file.file_name().and_then(|n| n.to_str());
    let key = name.and_then(|n| Key::from_hex(n.split('.').next()?));
    let store = Store::new(store.to_owned().try_into().expect("a UTF-8 path"));
    if let Some(key) = key
        && let Ok(seen) = store.look(&key)
    {
        let mut journal = Journal::open(&store.run("study").journal()).expect("a journal");
        journal.saw(key, seen.stamp);
        journal.flush().expect("room for a note");
    }
}

pub fn harm(store: &Path, file: &Path, damage: Damage, random: &mut Random) {
    let bytes = std::fs::read(file).expect("a file that can be read");
    let bit = random.below(8 * bytes.len().max(1));
    let write = |bytes: &[u8]| std::fs::write(file, bytes).expect("a file that can be written");
    match damage {
        Damage::Bit | Damage::Rot => {
            let mut bytes = bytes;
            if let Some(byte) = bytes.get_mut(bit / 8) {
                *byte ^= 1 << (bit % 8);
            }
            write(&bytes);
            if damage == Damage::Rot {
                hide(store, file);
            }
        }
        Damage::Zeroed => write(&vec![0; bytes.len()]),
        Damage::Truncated => write(&bytes[..bit / 8]),
        Damage::Longer => write(&[&bytes[..], b"more"].concat()),
        Damage::Emptied => write(b""),
        Damage::Swapped => {
            let mut others = files(store);
            others.retain(|f| f != file && kind(f) == kind(file));
            if !others.is_empty() {
                let other = random.one_of(&others);
                let held = store.join("held");
                std::fs::rename(file, &held).expect("a rename");
                std::fs::rename(other, file).expect("a rename");
                std::fs::rename(held, other).expect("a rename");
            }
        }
        Damage::Deleted => std::fs::remove_file(file).expect("a file"),
        Damage::Folder => {
            std::fs::remove_file(file).expect("a file");
            std::fs::create_dir(file).expect("a folder");
            std::fs::write(file.join("x"), "x").expect("a file in it");
        }
        Damage::Unreadable => {
            std::fs::set_permissions(file, std::fs::Permissions::from_mode(0o0)).expect("a mode");
        }
        Damage::Link => {
            std::fs::remove_file(file).expect("a file");
            std::os::unix::fs::symlink(file, file).expect("a link");
        }
        Damage::Pipe => {
            std::fs::remove_file(file).expect("a file");
            let made = Command::new("mkfifo").arg(file).status();
            assert!(made.expect("mkfifo starts").success());
        }
        Damage::Device => {
            std::fs::remove_file(file).expect("a file");
            std::os::unix::fs::symlink("/dev/zero", file).expect("a link");
        }
    }
}

/// A study whose numbers are known, and the step that is made again to read the others.
pub struct Lab {
    pub study: Study,
    reader: &'static str,
    pub numbers: BTreeMap<String, u64>,
    pub artifacts: BTreeMap<PathBuf, Vec<u8>>,
}

impl Lab {
    pub fn new(study: Study, reader: &'static str) -> Self {
        let mut lab = Self {
            study,
            reader,
            numbers: BTreeMap::new(),
            artifacts: BTreeMap::new(),
        };
        let output = lab.study.call(&["run"]);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output));
        let output = lab.study.call(&["results", "--format", "json"]);
        lab.numbers = numbers(&output);
        assert!(lab.numbers.len() > 2);
        lab.artifacts = lab.study.artifacts();
        lab
    }

    pub fn store(&self) -> PathBuf {
        self.study.path(".plyflow")
    }

    /// Runs a command that may find what is damaged: it says so, or tells what is right.
    pub fn ask(&self, words: &[&str], about: &str) -> Output {
        let output = self.study.call(words);
        let said = text(&output);
        let about = format!("{about}; {words:?} said: {said}");
        assert!(!said.contains("panicked"), "{about}");
        match output.status.code() {
            Some(0) => {}
            Some(8) => assert!(said.contains("damaged"), "{about}"),
            other => panic!("code {other:?}; {about}"),
        }
        output
    }

    /// Damages one file, asks, runs, and looks whether all is as it was.
    pub fn trial(&self, number: usize, damage: Damage, random: &mut Random) {
        let file = random.one_of(&files(&self.store())).clone();
        let place = file
            .strip_prefix(self.store())
            .expect("a file of the store");
        let about = format!("trial {number}: {damage:?} of {}", place.display());
        harm(&self.store(), &file, damage, random);
        match random.below(4) {
            0 => {
                let asked = self.ask(&["results", "--format", "json"], &about);
                let told = numbers(&asked);
                for (name, value) in &told {
                    assert_eq!(self.numbers.get(name), Some(value), "{about}: {name}");
                }
                let all = told.len() == self.numbers.len();
                let said = text(&asked);
                let named = said.contains("damaged") || said.contains("not in the store");
                assert!(
                    all || named,
                    "{about}: a number is left out without a word: {said}"
                );
            }
            1 => drop(self.ask(&["report"], &about)),
            2 => drop(self.ask(&["plan"], &about)),
            _ => {}
        }
        // The same command repairs it, what it reads and what it does not.
        let run = ["run", "--no-report", "--force", self.reader];
        let output = self.ask(&run, &about);
        assert_eq!(output.status.code(), Some(0), "{about}: {}", text(&output));
        let output = self.ask(&["results", "--format", "json"], &about);
        if !output.status.success() {
            // Rot that nothing has read: now it is named and set aside, and the next run has it.
            assert_eq!(self.ask(&run, &about).status.code(), Some(0), "{about}");
        }
        let output = self.ask(&["results", "--format", "json"], &about);
        assert_eq!(output.status.code(), Some(0), "{about}: {}", text(&output));
        assert_eq!(numbers(&output), self.numbers, "{about}");
    }

    /// Reads all: what is damaged still (rot that nobody has read) is found now, and made again.
    pub fn settle(&self, about: &str) {
        if self.ask(&["verify"], about).status.code() == Some(8) {
            self.ask(&["run", "--no-report"], about);
        }
        let output = self.ask(&["verify"], about);
        assert_eq!(output.status.code(), Some(0), "{about}: {}", text(&output));
        assert!(self.study.artifacts() == self.artifacts, "{about}");
    }

    pub fn trials(&self, seed: u64, flips: usize, whole: usize) {
        let mut random = Random(seed);
        for number in 0..flips + whole {
            let damage = match number {
                n if n >= flips => WHOLE_FILE[n % WHOLE_FILE.len()],
                n if n % 3 == 0 => Damage::Rot,
                _ => Damage::Bit,
            };
            self.trial(number, damage, &mut random);
            if number % 20 == 19 {
                self.settle(&format!("after trial {number}"));
            }
        }
        self.settle("at the end");
        println!("{flips} bits and {whole} files: no wrong number, all repaired");
    }
}

pub fn text(output: &Output) -> String {
    let both = [&output.stdout[..], &output.stderr[..]].concat();
    String::from_utf8_lossy(&both).into_owned()
}

/// The numbers that do not depend on the machine, bit for bit.
pub fn numbers(output: &Output) -> BTreeMap<String, u64> {
    let all: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
    let rows = all["results"].as_array().cloned().unwrap_or_default();
    let rows = rows.iter().filter(|r| r["measured"] == false);
    rows.filter_map(|r| {
        let name = format!("{}{}.{}", r["step"], r["item"], r["result"]);
        Some((name, r["value"].as_f64()?.to_bits()))
    })
    .collect()
}

/// A small part of real plugins (that of `forming.rs` of the end-to-end tests), and what reads it.
pub fn real() -> Study {
    let study = Study::new(
        "
steps:
  coarse:
    plugin: forming-explicit
    with: {scene: scene.yaml, element: m4, element_size: 20 mm, frames: 20, tool_grid: 5 mm}
  defects: {plugin: defect-detection, from: {formed: coarse}, with: {distance_threshold: 20 mm}}
  zones: {plugin: zone-extraction, from: {defects: defects}}
",
    );
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let materials = repository
        .canonicalize()
        .expect("a folder")
        .join("workflows/materials");
    let scene = include_str!("../small-scene.yaml");
    let scene = scene.replace("MATERIALS", materials.to_str().expect("a UTF-8 path"));
    std::fs::write(study.path("scene.yaml"), scene).expect("a scene");
    study
}

/// Copies a folder.
pub fn copy(from: &Path, to: &Path) {
    let _ = std::fs::remove_dir_all(to);
    let status = std::process::Command::new("cp")
        .arg("-a")
        .args([from, to])
        .status();
    assert!(status.expect("cp starts").success());
}
