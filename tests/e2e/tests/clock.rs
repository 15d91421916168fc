//! A clock that is set back, or far forward, between runs and while one goes on: nothing is run again, lost or told wrongly.

use plyflow_e2e::disk::Lab;
use plyflow_e2e::watch::leftovers;
use plyflow_e2e::{Ended, ended, wait_for, well, workers_of};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

const STEPS: &str = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  second: {plugin: sum, from: {in: first}}
  wait: {plugin: sleep, with: {seconds: 0.6}, from: {in: second}, resources: {time_limit: 1 min}}
  all: {plugin: sum, from: {in: [second, wait]}}
";

const YEAR: i64 = 31_557_600;
/// Ten years back and on, an hour, and before 1970.
const JUMPS: [i64; 5] = [-10 * YEAR, 10 * YEAR, -3600, 3600, -60 * YEAR];

fn run(lab: &Lab) -> Ended {
    let output = lab.call(&["run", "--log-format", "json"]);
    ended(&output.stderr, output.status)
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(at).expect("a folder").flatten() {
            match entry.path() {
                path if path.is_dir() => folders.push(path),
                path => found.push(path),
            }
        }
    }
    found
}

/// The dates of all files as they are when the clock is set by so much after they were written: the other way.
fn seen_from(folder: &Path, jump: i64) {
    for path in files(folder) {
        let file = std::fs::File::options()
            .write(true)
            .open(path)
            .expect("a file");
        let was = file.metadata().and_then(|m| m.modified()).expect("a date");
        let by = Duration::from_secs(jump.unsigned_abs());
        let is = if jump < 0 {
            was + by
        } else {
            was.checked_sub(by).unwrap_or(SystemTime::UNIX_EPOCH)
        };
        file.set_modified(is).expect("another date");
    }
}

#[test]
fn a_clock_that_jumps_between_runs_makes_nothing_run_again_and_nothing_vanish() {
    for jump in JUMPS {
        let lab = Lab::new(STEPS);
        assert_eq!(run(&lab), well(4, 0));
        let (bytes, results) = (lab.study.artifacts(), lab.study.results());
        seen_from(&lab.study.path(".plyflow"), jump);
        lab.disk.move_clock(jump);
        assert_eq!(run(&lab), well(0, 4), "by {jump} s");
        assert_eq!(lab.study.results(), results, "by {jump} s");
        for words in [&["verify"][..], &["clean"], &["plan"], &["report"]] {
            let output = lab.call(words);
            let text = String::from_utf8_lossy(&output.stderr).into_owned();
            assert_eq!(
                output.status.code(),
                Some(0),
                "{words:?} by {jump} s: {text}"
            );
        }
        assert!(lab.study.artifacts() == bytes, "by {jump} s");
        // What is new is run, and only that.
        lab.study
            .write(&STEPS.replace("value: 2", "value: 3").replace("0.6", "0.0"));
        assert_eq!(run(&lab), well(4, 0), "by {jump} s");
        assert_eq!(lab.study.values("second", "sum"), [3.0]);
        assert!(leftovers(&lab.study.path(""), &lab.study.path(".plyflow")).is_empty());
    }
}

#[test]
fn a_clock_that_jumps_while_a_step_runs_changes_no_byte_and_ends_no_step() {
    let calm = Lab::new(STEPS);
    assert_eq!(run(&calm), well(4, 0));
    for jump in JUMPS {
        let lab = Lab::new(STEPS);
        let log = std::fs::File::create(lab.study.path("run.log")).expect("a log");
        let mut head = lab.command(&["run", "--log-format", "json"]);
        let mut head = head.stderr(log).spawn().expect("plyflow starts");
        wait_for("the step that waits", || {
            workers_of(head.id()) == 1 && lab.study.artifacts().len() == 2
        });
        lab.disk.move_clock(jump);
        let status = head.wait().expect("a child");
        assert_eq!(
            ended(lab.study.log().as_bytes(), status),
            well(4, 0),
            "by {jump} s"
        );
        assert!(
            lab.study.artifacts() == calm.study.artifacts(),
            "by {jump} s"
        );
        let said = lab.study.log();
        assert!(!said.contains("\"wall_seconds\":-"), "by {jump} s: {said}");
        assert_eq!(run(&lab), well(0, 4), "by {jump} s");
        // And back.
        lab.disk.move_clock(0);
        assert_eq!(run(&lab), well(0, 4), "by {jump} s and back");
    }
}

#[test]
fn clean_keeps_what_a_run_could_not_note_also_when_the_clock_was_set_back_before_it() {
    let lab = Lab::new(STEPS);
    assert_eq!(run(&lab), well(4, 0));
    // As a full disk leaves it: nothing noted. The journal was last written to when the clock was an hour ahead.
    let journal = lab.study.path(".plyflow/runs/study/journal");
    let file = std::fs::File::options()
        .write(true)
        .open(journal)
        .expect("a journal");
    file.set_len(8).expect("a length");
    let ahead = SystemTime::now() + Duration::from_secs(3600);
    file.set_modified(ahead).expect("another date");
    let output = lab.call(&["clean"]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(lab.study.artifacts().len(), 4, "finished work is lost");
    assert_eq!(run(&lab), well(0, 4));
}
