//! A disk that is full, not to be written to, or failing, and processes that are killed, at every single operation on a file.
//!
//! The tests take a sample of the operations; `PLYFLOW_OPERATIONS=all` (`make long`) takes each.

use plyflow_e2e::disk::{Lab, Operation, Victim, read_log};
use plyflow_e2e::watch::leftovers;
use plyflow_e2e::{ended, wait_for, well, workers_of};
use std::collections::BTreeMap;
use std::process::Output;

/// Every kind of artifact; a power cut, for which some are put on the disk, has tests of its own (`power`).
const STEPS: &str = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  zones: {plugin: split, with: {items: 1}, from: {in: first}}
  mesh: {plugin: mesh, with: {points: 64, frames: 3}, for_each: {z: zones}, from: {in: zones}}
  all: {plugin: sum, from: {in: [mesh, first]}}
";
const COUNT: u64 = 4;
/// One step after the other, so that operations have the same order each time.
const RUN: [&str; 3] = ["run", "--jobs", "1"];

/// What a run has said that it keeps as damaged, in the store: a journal that could not be read or written, for instance.
fn said_to_be_kept(text: &str) -> Vec<String> {
    let behind = text.split("it is kept as ").skip(1);
    let path = |rest: &str| {
        rest.split([',', '\n'])
            .next()
            .unwrap_or_default()
            .to_owned()
    };
    let inside = |path: String| Some(path.split_once("/.plyflow/")?.1.to_owned());
    behind.map(path).filter_map(inside).collect()
}

/// The next run on a sound disk has nothing to do again, and leaves the same as one that nothing ever disturbed, but for what was said to
/// be `kept`.
fn heals(lab: &Lab, expected: &BTreeMap<String, Vec<u8>>, kept: &[String], about: &str) {
    let visible = lab.study.artifacts();
    let store = lab.study.path(".plyflow");
    for (name, bytes) in &visible {
        assert!(
            expected.get(name) == Some(bytes),
            "{about}: {name} is not whole"
        );
    }
    // The first operation makes the store.
    if store.is_dir() {
        let told = lab.study.call(&["verify"]);
        let text = told_by(&told);
        assert_eq!(told.status.code(), Some(0), "{about}: verify: {text}");
    }
    // One that could not be placed is done too.
    let unplaced = std::fs::read_dir(store.join("runs/study/unplaced"));
    let unplaced = unplaced.into_iter().flatten().flatten();
    let waiting = unplaced.filter(|e| {
        let name = e.file_name().into_string().unwrap_or_default();
        name.ends_with(".vtkhdf") && !visible.contains_key(&name)
    });
    let finished = visible.len() as u64 + waiting.count() as u64;
    let output = lab.study.call(&["run", "--log-format", "json"]);
    let end = ended(&output.stderr, output.status);
    let wanted = well(COUNT - finished, finished);
    assert_eq!(end, wanted, "{about}: {}", told_by(&output));
    assert!(lab.study.artifacts() == *expected, "{about}: other bytes");
    let mut left = leftovers(&lab.study.path(""), &store);
    left.retain(|file| !kept.iter().any(|k| k.starts_with(file)));
    assert!(left.is_empty(), "{about}: left behind: {left:?}");
    let told = lab.study.call(&["verify"]);
    assert_eq!(told.status.code(), Some(0), "{about}: {}", told_by(&told));
}

fn told_by(output: &Output) -> String {
    String::from_utf8_lossy(&[&output.stdout[..], &output.stderr[..]].concat()).into_owned()
}

/// What an undisturbed run does to files, one step after the other, and what it makes.
struct Calm {
    /// Those of its operations that are tried.
    chosen: Vec<u64>,
    count: usize,
    artifacts: BTreeMap<String, Vec<u8>>,
}

fn undisturbed() -> Calm {
    let lab = Lab::new(STEPS);
    let beside = tempfile::tempdir().expect("a folder");
    let log = beside.path().join("log");
    let output = lab
        .command(&RUN)
        .env("FAULTS_LOG", &log)
        .output()
        .expect("plyflow starts");
    assert_eq!(output.status.code(), Some(0), "{}", told_by(&output));
    let all = read_log(&log);
    assert_eq!(all.len() as u64, lab.disk.operations());
    let of_artifact = |wanted: u64| {
        let made = |o: &Operation| matches!(o, Operation::Create(path, inode) if *inode == wanted && path.extension().is_some_and(|e| e == "vtkhdf"));
        all.iter().any(made)
    };
    // HDF5 writes in many small pieces, of which one is like another.
    let mut pieces = 0;
    let is_chosen = |(_, operation): &(usize, &Operation)| match operation {
        Operation::Write(inode, ..) if of_artifact(*inode) => {
            pieces += 1;
            pieces % 10 == 1
        }
        _ => true,
    };
    let chosen = all.iter().enumerate().filter(is_chosen);
    Calm {
        chosen: chosen.map(|(at, _)| at as u64).collect(),
        count: all.len(),
        artifacts: lab.study.artifacts(),
    }
}

impl Calm {
    /// Of the operations every one, or about `sample`, spread out.
    fn sample(&self, sample: usize, offset: usize) -> impl Iterator<Item = u64> {
        let all = std::env::var_os("PLYFLOW_OPERATIONS").is_some_and(|v| v == "all");
        let stride = if all {
            1
        } else {
            (self.chosen.len() / sample).max(1)
        };
        self.chosen
            .iter()
            .copied()
            .skip(offset % stride)
            .step_by(stride)
    }
}

/// The fault in the words of the system, and what is to be done about it.
fn says(errno: i32) -> [&'static str; 2] {
    match errno {
        libc::ENOSPC => ["No space left on device", "make room"],
        libc::EDQUOT => ["quota", "make room"],
        libc::EROFS => ["Read-only file system", "--store"],
        libc::EIO => ["Input/output error", "look after the disk"],
        other => panic!("errno {other}"),
    }
}

/// Runs with a disk that fails from each operation on (for good, or with this one alone).
fn fail(errno: i32, once: bool, sample: usize) {
    let calm = undisturbed();
    let tried: Vec<u64> = calm.sample(sample, errno.unsigned_abs() as usize).collect();
    println!(
        "errno {errno}, once: {once}: {} of {} operations",
        tried.len(),
        calm.count
    );
    for from in tried {
        let lab = Lab::new(STEPS);
        let about = format!(
            "errno {errno} from operation {from} of {}, once: {once}",
            calm.count
        );
        lab.disk
            .fail(from, once.then_some(from + 1), errno, from % 2 == 0);
        let output = lab.call(&RUN);
        let text = told_by(&output);
        let code = output.status.code();
        assert!(!text.contains("panicked"), "{about}: {text}");
        assert!(!text.contains("malformed"), "{about}: {text}");
        match code {
            // What only saves time, or only tells, could not be written.
            Some(0) => {}
            Some(1 | 4) => {
                for word in says(errno) {
                    assert!(text.contains(word), "{about}: no '{word}' in: {text}");
                }
            }
            other => panic!("{about}: code {other:?}: {text}"),
        }
        lab.disk.reset();
        heals(&lab, &calm.artifacts, &said_to_be_kept(&text), &about);
    }
}

#[test]
fn a_full_disk_is_named_and_nothing_finished_is_lost_wherever_it_strikes() {
    fail(libc::ENOSPC, false, 9);
    fail(libc::EDQUOT, false, 3);
}

#[test]
fn a_disk_that_becomes_read_only_is_named_and_nothing_finished_is_lost_wherever_it_strikes() {
    fail(libc::EROFS, false, 9);
}

#[test]
fn a_disk_that_fails_is_named_and_nothing_finished_is_lost_wherever_it_strikes() {
    fail(libc::EIO, false, 5);
    fail(libc::EIO, true, 9);
}

#[test]
fn a_kill_at_any_operation_on_a_file_loses_nothing_shows_nothing_partial_and_leaves_nothing() {
    let calm = undisturbed();
    for victim in [Victim::Head, Victim::Doer, Victim::Both] {
        for at in calm.sample(10, victim as usize) {
            let lab = Lab::new(STEPS);
            let about = format!("{victim:?} killed at operation {at} of {}", calm.count);
            lab.disk.kill(at, victim, at % 2 == 1);
            let mut command = lab.command(&RUN);
            let log = std::fs::File::create(lab.study.path("run.log")).expect("a log");
            command.stdout(log.try_clone().expect("a log")).stderr(log);
            let mut head = command.spawn().expect("plyflow starts");
            let code = head.wait().expect("a child").code();
            // A worker may be killed after it has done its work, or when it only describes a plugin.
            assert!(
                matches!(code, None | Some(0 | 4)),
                "{about}: {}",
                lab.study.log()
            );
            wait_for("the workers' end", || workers_of(head.id()) == 0);
            lab.disk.reset();
            heals(&lab, &calm.artifacts, &[], &about);
        }
    }
}

#[test]
fn a_finished_store_on_a_read_only_disk_can_be_looked_at() {
    let lab = Lab::new(STEPS);
    assert_eq!(lab.call(&RUN).status.code(), Some(0));
    let before = lab.study.results();
    lab.disk.fail(0, None, libc::EROFS, false);
    for words in [
        &["plan"][..],
        &["results"],
        &["verify", "--dry-run"],
        &["explain", "all"],
        &["results", "--format", "json"],
    ] {
        let output = lab.call(words);
        let text = told_by(&output);
        assert_eq!(output.status.code(), Some(0), "{words:?}: {text}");
    }
    let after = lab.call(&["results", "--format", "json"]).stdout;
    assert_eq!(
        serde_json::from_slice::<serde_json::Value>(&after).expect("JSON"),
        before
    );
    for words in [&["run"][..], &["verify"], &["clean"], &["report"]] {
        let output = lab.call(words);
        let text = told_by(&output);
        assert_eq!(output.status.code(), Some(1), "{words:?}: {text}");
        for word in says(libc::EROFS) {
            assert!(text.contains(word), "{words:?}: {text}");
        }
    }
    lab.disk.reset();
    assert_eq!(lab.study.run(&[]), well(0, COUNT));
}
