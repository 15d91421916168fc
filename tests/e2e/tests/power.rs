//! A power cut at every moment of a run: what was done to files is written down, and of it every state is built that a disk may be in
//! afterwards, as far as it was not asked to keep more.
//!
//! The test takes a sample of the states; `make long` takes each.

use plyflow_e2e::crash::{Crash, LOSSES, Loss};
use plyflow_e2e::disk::{Disk, Operation, read_log};
use plyflow_e2e::random::Random;
use plyflow_e2e::watch::leftovers;
use plyflow_e2e::{Study, ended};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// A step that is so long that it outlasts a power cut, and those after it that are not.
const STEPS: &str = "
steps:
  long: {plugin: sleep, with: {seconds: 1.01}}
  zones: {plugin: split, with: {items: 2}, from: {in: long}}
  mesh: {plugin: mesh, with: {points: 64, frames: 4}, for_each: {z: zones}, from: {in: zones}}
  all: {plugin: sum, from: {in: [mesh, long]}}
";

/// What an undisturbed run did, and made.
struct Run {
    study: Study,
    operations: Vec<Operation>,
    artifacts: BTreeMap<String, Vec<u8>>,
    numbers: BTreeMap<String, u64>,
    /// The operation with which the long step has become lasting.
    lasting: usize,
    /// Its artifact.
    long: PathBuf,
}

fn numbers(study: &Study) -> (Option<i32>, BTreeMap<String, u64>) {
    let output = study.call(&["results", "--format", "json"]);
    let all: Value = serde_json::from_slice(&output.stdout).unwrap_or_default();
    let rows = all["results"].as_array().cloned().unwrap_or_default();
    let told = rows.iter().filter(|r| r["measured"] == false);
    let named = told.filter_map(|r| {
        let name = format!("{}{}.{}", r["step"], r["item"], r["result"]);
        Some((name, r["value"].as_f64()?.to_bits()))
    });
    (output.status.code(), named.collect())
}

fn record_run() -> Run {
    let study = Study::new(STEPS);
    let beside = tempfile::tempdir().expect("a folder");
    let disk = Disk::new(&study.path(""), &beside.path().join("orders"));
    let log = beside.path().join("log");
    let mut command = study.command(&["run", "--jobs", "2"]);
    disk.under(&mut command);
    let output = command
        .env("FAULTS_LOG", &log)
        .output()
        .expect("plyflow starts");
    assert!(output.status.success());
    let operations = read_log(&log);
    assert_eq!(operations.len() as u64, disk.operations());
    let store = study.path(".plyflow");
    let artifacts = study.artifacts();
    let is_long = |name: &&String| {
        let path = store
            .join("artifacts")
            .join(&name[..2])
            .join(name.replace("vtkhdf", "record.json"));
        std::fs::read_to_string(path)
            .expect("a record")
            .contains("\"step\": \"long\"")
    };
    let name = artifacts
        .keys()
        .find(is_long)
        .expect("the long step")
        .clone();
    let long = store.join("artifacts").join(&name[..2]).join(&name);
    let placed = operations
        .iter()
        .position(|o| matches!(o, Operation::Rename(_, to) if *to == long));
    let placed = placed.expect("it was placed");
    // When the run says that it has finished it: before anything else is placed, or noted in the journal.
    let next = operations[placed + 1..]
        .iter()
        .position(|o| !matches!(o, Operation::SyncFolder(_)));
    let lasting = placed + 1 + next.expect("there is more");
    let (_, numbers) = numbers(&study);
    Run {
        study,
        operations,
        artifacts,
        numbers,
        lasting,
        long,
    }
}

/// Puts a state in the place of all but the workflow.
fn build(study: &Study, state: &BTreeMap<PathBuf, Option<Vec<u8>>>) {
    for entry in std::fs::read_dir(study.path(""))
        .expect("a folder")
        .flatten()
    {
        let path = entry.path();
        if path.is_dir() {
            std::fs::remove_dir_all(path).expect("a folder");
        } else if !path.ends_with("workflow.yaml") {
            std::fs::remove_file(path).expect("a file");
        }
    }
    for (path, bytes) in state {
        match bytes {
            None => std::fs::create_dir_all(path).expect("a folder"),
            Some(bytes) => {
                std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
                std::fs::write(path, bytes).expect("a file");
            }
        }
    }
}

impl Run {
    /// After the power cut nothing wrong is told, and the same command makes the same again; what was lasting is there.
    fn survives(&self, cut: usize, loss: Loss, state: &BTreeMap<PathBuf, Option<Vec<u8>>>) {
        let about = format!(
            "cut before operation {cut} of {}, lost: {loss:?}",
            self.operations.len()
        );
        build(&self.study, state);
        let expected = &self.artifacts[self
            .long
            .file_name()
            .and_then(|n| n.to_str())
            .expect("a name")];
        if cut >= self.lasting {
            let there = std::fs::read(&self.long).ok();
            assert!(
                there.as_ref() == Some(expected),
                "{about}: what was lasting is lost"
            );
        }
        let (code, told) = numbers(&self.study);
        assert!(
            matches!(code, Some(0 | 2 | 8)),
            "{about}: results ended with {code:?}"
        );
        for (name, value) in &told {
            assert_eq!(self.numbers.get(name), Some(value), "{about}: {name}");
        }
        let output = self.study.call(&["run", "--log-format", "json"]);
        let end = ended(&output.stderr, output.status);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!((end.code, end.failed), (Some(0), 0), "{about}: {text}");
        if cut >= self.lasting {
            let again = text
                .lines()
                .any(|l| l.contains("\"started\"") && l.contains("\"long\""));
            assert!(!again, "{about}: what was lasting was made again: {text}");
        }
        assert!(
            self.study.artifacts() == self.artifacts,
            "{about}: other bytes"
        );
        let (code, told) = numbers(&self.study);
        assert_eq!((code, &told), (Some(0), &self.numbers), "{about}");
        self.leaves_nothing(&about);
    }

    /// What was damaged is set aside for whoever wants to see it; everything else is as after any run.
    fn leaves_nothing(&self, about: &str) {
        let store = self.study.path(".plyflow");
        let mut left = leftovers(&self.study.path(""), &store);
        left.retain(|name| !name.starts_with("damaged"));
        assert!(left.is_empty(), "{about}: left behind: {left:?}");
    }
}

/// Every state of the recorded run, each once; `stride`: only every so manieth.
fn cut_everywhere(stride: usize) {
    let run = record_run();
    let (mut seen, mut tried) = (BTreeSet::new(), 0);
    let mut crash = Crash::default();
    let mut number = 0;
    for cut in 0..=run.operations.len() {
        for loss in LOSSES {
            let mut random = Random::new(cut as u64, loss as u64);
            let state = crash.after(loss, &mut random);
            if !seen.insert(digest(&state)) {
                continue;
            }
            number += 1;
            if number % stride == 0 {
                run.survives(cut, loss, &state);
                tried += 1;
            }
        }
        if let Some(operation) = run.operations.get(cut) {
            crash.take(operation);
        }
    }
    println!(
        "{} operations, {number} states, {tried} tried: nothing wrong, nothing lasting lost",
        run.operations.len()
    );
    assert!(tried > 10);
}

fn digest(state: &BTreeMap<PathBuf, Option<Vec<u8>>>) -> u64 {
    use std::hash::{DefaultHasher, Hash, Hasher};
    let mut hasher = DefaultHasher::new();
    let inside = |p: &Path| p.to_string_lossy().into_owned();
    for (path, bytes) in state {
        (inside(path), bytes).hash(&mut hasher);
    }
    hasher.finish()
}

#[test]
fn a_power_cut_at_any_moment_loses_nothing_that_lasts_and_tells_nothing_wrong() {
    cut_everywhere(29);
}

#[test]
#[ignore = "minutes: make long"]
fn a_power_cut_at_every_moment_with_every_loss_loses_nothing_that_lasts_and_tells_nothing_wrong() {
    cut_everywhere(1);
}
