//! Several heads at once on one store, and plugins that are exchanged while a run goes on.

use plyflow_e2e::disk::Disk;
use plyflow_e2e::random::Random;
use plyflow_e2e::watch::{Watch, leftovers};
use plyflow_e2e::{Study, ended, program, wait_for, well, workers_of};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const STEPS: &str = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  zones: {plugin: split, with: {items: 4}, from: {in: first}}
  mesh: {plugin: mesh, with: {points: 64, frames: 6}, for_each: {z: zones}, from: {in: zones}}
  all: {plugin: sum, from: {in: [mesh, first]}}
";
const COUNT: u64 = 7;

fn start(study: &Study, file: &str, log: &str) -> Child {
    let log = std::fs::File::create(study.path(log)).expect("a log");
    let mut command = study.command_on(file, &["run", "--no-report", "--log-format", "json"]);
    command.stdout(Stdio::null()).stderr(log);
    command.spawn().expect("plyflow starts")
}

#[test]
fn two_workflows_with_the_same_steps_share_a_store_and_neither_disturbs_the_other() {
    let calm = Study::new(STEPS);
    assert_eq!(calm.run(&[]), well(COUNT, 0));
    let expected = calm.artifacts();
    for round in 0..6 {
        let mut random = Random::new(7, round);
        let study = Study::new(STEPS);
        let other = format!("plyflow: 1\nname: other\n{STEPS}");
        std::fs::write(study.path("other.yaml"), other).expect("a workflow");
        let mut watch = Watch::begin(&study.path(".plyflow"));
        let mut heads = [("workflow.yaml", "a.log"), ("other.yaml", "b.log")]
            .map(|(file, log)| (start(&study, file, log), log));
        // In every other round one of the two is killed at some moment.
        if round % 2 == 1 {
            std::thread::sleep(Duration::from_millis(random.below(120) as u64));
            let _ = heads[0].0.kill();
        }
        for (head, log) in &mut heads {
            let status = head.wait().expect("a child");
            let said = std::fs::read(study.path(log)).expect("a log");
            if status.code().is_some() {
                let end = ended(&said, status);
                assert_eq!((end.code, end.executed + end.cached), (Some(0), COUNT));
            }
            wait_for("the workers' end", || workers_of(head.id()) == 0);
        }
        watch.take(&expected);
        assert!(watch.partial.is_empty(), "{:?}", watch.partial);
        for file in ["workflow.yaml", "other.yaml"] {
            let mut last = start(&study, file, "last.log");
            let status = last.wait().expect("a child");
            let said = std::fs::read(study.path("last.log")).expect("a log");
            assert_eq!(ended(&said, status), well(0, COUNT));
        }
        assert!(study.artifacts() == expected);
        let left = leftovers(&study.path(""), &study.path(".plyflow"));
        assert!(left.is_empty(), "{left:?}");
        assert_eq!(study.call(&["verify"]).status.code(), Some(0));
    }
}

#[test]
fn of_many_heads_of_one_workflow_one_runs_and_nothing_runs_twice() {
    let calm = Study::new(STEPS);
    assert_eq!(calm.run(&[]), well(COUNT, 0));
    let expected = calm.artifacts();
    for round in 0..6 {
        let mut random = Random::new(8, round);
        let study = Study::new(STEPS);
        let mut watch = Watch::begin(&study.path(".plyflow"));
        let mut heads = Vec::new();
        for k in 0..4 {
            heads.push(start(&study, "workflow.yaml", &format!("{k}.log")));
            std::thread::sleep(Duration::from_millis(random.below(30) as u64));
        }
        let mut done = 0;
        for (k, head) in heads.iter_mut().enumerate() {
            let said = |study: &Study| {
                std::fs::read_to_string(study.path(&format!("{k}.log"))).expect("a log")
            };
            match head.wait().expect("a child").code() {
                Some(0) => done += 1,
                Some(6) => {
                    let text = said(&study);
                    assert!(
                        text.contains("is in use by") && text.contains("wait for it"),
                        "{text}"
                    );
                }
                other => panic!("code {other:?}: {}", said(&study)),
            }
        }
        assert!(done > 0);
        watch.take(&expected);
        assert!(
            watch.partial.is_empty() && watch.again == 0,
            "{:?}",
            watch.partial
        );
        assert!(study.artifacts() == expected);
    }
}

/// A study whose libraries lie in a folder of its own, so that they can be exchanged.
struct Own {
    study: Study,
    disk: Disk,
    _orders: tempfile::TempDir,
}

impl Own {
    fn new(steps: &str) -> Self {
        let study = Study::new(steps);
        let folder = study.path("plugins");
        std::fs::create_dir(&folder).expect("a folder");
        for name in ["libtrivial.so", "libsum.so", "libsleep.so"] {
            std::fs::copy(plyflow_faults::folder().join(name), folder.join(name)).expect("a copy");
        }
        let orders = tempfile::tempdir().expect("a folder");
        let disk = Disk::new(&study.path(""), &orders.path().join("orders"));
        Self {
            study,
            disk,
            _orders: orders,
        }
    }

    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(program());
        command.arg(words[0]).arg("workflow.yaml").args(&words[1..]);
        command.args(["--plugins", "plugins"]).stdin(Stdio::null());
        command
            .current_dir(self.study.path(""))
            .env_remove("PLYFLOW_PLUGINS");
        self.disk.under(&mut command);
        command
    }

    fn start(&self) -> Child {
        let log = std::fs::File::create(self.study.path("run.log")).expect("a log");
        let mut command = self.command(&["run", "--no-report", "--log-format", "json"]);
        command.stderr(log).spawn().expect("plyflow starts")
    }

    fn library(&self, name: &str) -> PathBuf {
        self.study.path("plugins").join(name)
    }
}

/// Another library in its place, with the same function: as a build leaves it.
fn exchange(library: &Path) {
    let mut bytes = std::fs::read(library).expect("a library");
    bytes.extend_from_slice(b"newer");
    let new = library.with_extension("new");
    std::fs::write(&new, bytes).expect("a file");
    std::fs::rename(new, library).expect("a library");
}

#[test]
fn a_library_exchanged_between_the_start_of_a_worker_and_its_loading_makes_nothing_under_the_old_key()
 {
    // A step that never says a word before it is done.
    let own = Own::new("steps:\n  quiet: {plugin: trivial, with: {value: 2}}\n");
    assert!(
        own.command(&["plan"])
            .output()
            .expect("plyflow starts")
            .status
            .success()
    );
    own.disk.hold(true);
    let mut head = own.start();
    wait_for("the worker", || own.disk.held() == 1);
    exchange(&own.library("libtrivial.so"));
    own.disk.hold(false);
    let status = head.wait().expect("a child");
    let said = own.study.log();
    assert_eq!(status.code(), Some(4), "{said}");
    assert!(
        said.contains("libtrivial.so has changed since this run began"),
        "{said}"
    );
    assert!(said.contains("run again"), "{said}");
    assert!(
        own.study.artifacts().is_empty(),
        "it is stored under the key of the old library"
    );
    let mut head = own.start();
    let status = head.wait().expect("a child");
    assert_eq!(ended(own.study.log().as_bytes(), status), well(1, 0));
}

#[test]
fn a_library_exchanged_while_its_step_runs_leaves_that_step_as_it_was_loaded() {
    let steps = "
steps:
  slow: {plugin: sleep, with: {seconds: 1}}
  again: {plugin: sleep, with: {seconds: 0}, from: {in: slow}}
  other: {plugin: trivial, with: {value: 3}, from: {in: slow}}
";
    let own = Own::new(steps);
    let mut head = own.start();
    wait_for("the slow step", || own.study.log().contains("\"progress\""));
    exchange(&own.library("libsleep.so"));
    let status = head.wait().expect("a child");
    let said = own.study.log();
    assert_eq!(status.code(), Some(4), "{said}");
    // It had its library, and is what its key says; those after it are told apart by theirs.
    let end = ended(said.as_bytes(), status);
    assert_eq!((end.executed, end.failed, end.not_run), (2, 1, 0), "{said}");
    assert!(
        said.contains("libsleep.so has changed since this run began"),
        "{said}"
    );
    let kept = own.study.artifacts();
    // All that the new library is in is made, and the old is not lost.
    let status = own.start().wait().expect("a child");
    assert_eq!(ended(own.study.log().as_bytes(), status), well(3, 0));
    let now = own.study.artifacts();
    assert!(
        kept.iter()
            .all(|(name, bytes)| now.get(name) == Some(bytes))
    );
}

#[test]
fn a_library_overwritten_in_place_while_its_step_runs_is_named_as_the_cause() {
    let own = Own::new("steps:\n  slow: {plugin: sleep, with: {seconds: 2}}\n");
    let mut head = own.start();
    wait_for("the slow step", || own.study.log().contains("\"progress\""));
    // A linker that writes into the old file: what is mapped is gone, and whoever runs in it crashes.
    let library = own.library("libsleep.so");
    let whole = std::fs::read(&library).expect("a library");
    std::fs::write(&library, b"").expect("a file");
    let status = head.wait().expect("a child");
    let said = own.study.log();
    assert_eq!(status.code(), Some(4), "{said}");
    assert!(
        said.contains("libsleep.so has changed since this run began"),
        "{said}"
    );
    assert!(own.study.artifacts().is_empty());
    std::fs::write(&library, whole).expect("a library");
    own.study
        .write("steps:\n  slow: {plugin: sleep, with: {seconds: 0}}\n");
    let status = own.start().wait().expect("a child");
    assert_eq!(ended(own.study.log().as_bytes(), status), well(1, 0));
}
