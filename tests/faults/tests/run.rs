//! `plyflow run` from outside: caching, fan-out, failures, kills, locks.

use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// A folder with a workflow in it.
struct Study {
    folder: tempfile::TempDir,
}

impl Study {
    fn new(workflow: &str) -> Self {
        let study = Self {
            folder: tempfile::tempdir().unwrap(),
        };
        study.write(workflow);
        study
    }

    fn write(&self, workflow: &str) {
        let text = format!("plyflow: 1\nname: study\n{workflow}");
        std::fs::write(self.folder.path().join("workflow.yaml"), text).unwrap();
    }

    fn command(&self, words: &[&str]) -> Command {
        self.command_on("workflow.yaml", words)
    }

    fn command_on(&self, file: &str, words: &[&str]) -> Command {
        let mut command = Command::new(plyflow_faults::program());
        command.arg(words[0]).arg(file).args(&words[1..]);
        command
            .current_dir(self.folder.path())
            .env("PLYFLOW_PLUGINS", plyflow_faults::folder());
        command
    }

    fn call(&self, words: &[&str]) -> Output {
        self.command(words).output().unwrap()
    }

    /// Runs and returns (exit code, steps executed, cached, failed).
    fn run(&self, more: &[&str]) -> (i32, [u64; 3]) {
        let mut words = vec!["run", "--log-format", "json", "--no-report"];
        words.extend(more);
        let output = self.call(&words);
        let text = String::from_utf8(output.stderr).unwrap();
        let end = text
            .lines()
            .filter_map(|l| serde_json::from_str::<Value>(l).ok())
            .find(|l| l["event"] == "end")
            .unwrap_or_else(|| panic!("no end: {text}"));
        let n = |key: &str| end[key].as_u64().unwrap();
        (
            output.status.code().unwrap(),
            [n("executed"), n("cached"), n("failed")],
        )
    }

    fn results(&self) -> Value {
        let output = self.call(&["results", "--format", "json"]);
        serde_json::from_slice(&output.stdout).unwrap()
    }

    fn value(&self, step: &str, result: &str) -> f64 {
        let all = self.results();
        let list = all["results"].as_array().unwrap();
        let found = list
            .iter()
            .find(|r| r["step"] == step && r["result"] == result);
        found.unwrap_or_else(|| panic!("no {step}.{result} in {all}"))["value"]
            .as_f64()
            .unwrap()
    }

    /// All artifacts: file name -> bytes.
    fn artifacts(&self) -> BTreeMap<String, Vec<u8>> {
        let mut found = BTreeMap::new();
        let root = self.folder.path().join(".plyflow/artifacts");
        for shard in std::fs::read_dir(root).into_iter().flatten().flatten() {
            for file in std::fs::read_dir(shard.path()).unwrap().flatten() {
                let name = file.file_name().into_string().unwrap();
                if name.ends_with(".vtkhdf") {
                    found.insert(name, std::fs::read(file.path()).unwrap());
                }
            }
        }
        found
    }

    fn start(&self) -> Child {
        let mut command = self.command(&["run", "--log-format", "json", "--no-report"]);
        command
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap()
    }
}

/// Waits for a condition; a machine under load may take long, so the limit is generous.
fn until(what: &str, mut condition: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !condition() {
        assert!(
            begun.elapsed() < Duration::from_secs(60),
            "waited too long for {what}"
        );
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Workers whose engine is or was `parent`.
fn workers_of(parent: u32) -> usize {
    let mark = format!("--parent\0{parent}\0");
    let processes = std::fs::read_dir("/proc").unwrap().flatten();
    let lines = processes.filter_map(|p| std::fs::read(p.path().join("cmdline")).ok());
    lines
        .filter(|l| String::from_utf8_lossy(l).contains(&mark))
        .count()
}

fn signal(child: &Child, number: i32) {
    // SAFETY: numbers alone. A child that has not been waited for: its number is no other's.
    let code = unsafe { libc::kill(child.id() as i32, number) };
    assert_eq!(code, 0);
}

const FAN_OUT: &str = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  zones: {plugin: split, with: {items: 3}, from: {in: first}}
  local: {plugin: trivial, with: {value: 5}, for_each: {zone: zones}, from: {in: [zones, first]}}
  all: {plugin: sum, from: {in: [local, first]}}
";

#[test]
fn a_second_run_does_nothing_and_neither_does_a_change_of_form() {
    let study = Study::new(FAN_OUT);
    assert_eq!(study.run(&[]), (0, [6, 0, 0]));
    assert_eq!(study.value("all", "sum"), 17.0);
    assert_eq!(study.run(&[]), (0, [0, 6, 0]));
    let first = "first:\n    # two\n    with:\n      'value':   2.0\n    plugin: \"trivial\"";
    study.write(&FAN_OUT.replace("first: {plugin: trivial, with: {value: 2}}", first));
    assert_eq!(study.run(&[]), (0, [0, 6, 0]));
}

#[test]
fn a_changed_value_runs_only_what_depends_on_it_and_plan_says_so_before() {
    let study = Study::new(FAN_OUT);
    study.run(&[]);
    study.write(&FAN_OUT.replace("value: 5", "value: 6"));
    let plan = study.call(&["plan", "--format", "json"]);
    let plan: Value = serde_json::from_slice(&plan.stdout).unwrap();
    let states: Vec<String> = plan
        .as_array()
        .unwrap()
        .iter()
        .map(|p| {
            format!(
                "{} {}",
                p["step"].as_str().unwrap(),
                p["state"].as_str().unwrap()
            )
        })
        .collect();
    let expected = [
        "first cached",
        "zones cached",
        "local[item-0] run",
        "local[item-1] run",
        "local[item-2] run",
        "all run",
    ];
    assert_eq!(states, expected);
    // What they cost when they ran last: of those that are to run, and of those alone.
    for p in plan.as_array().unwrap() {
        let cost = &p["last_cpu_seconds"];
        assert_eq!(cost.is_f64(), p["state"] == "run", "{p}");
    }
    assert_eq!(study.run(&[]), (0, [4, 2, 0]));
    assert_eq!(study.value("all", "sum"), 20.0);
    // And back: everything is still there.
    study.write(FAN_OUT);
    assert_eq!(study.run(&[]), (0, [0, 6, 0]));
}

#[test]
fn an_empty_collection_leaves_no_local_runs_and_the_run_goes_on() {
    let study = Study::new(&FAN_OUT.replace("items: 3", "items: 0"));
    assert_eq!(study.run(&[]), (0, [3, 0, 0]));
    assert_eq!(study.value("all", "sum"), 2.0);
}

#[test]
fn each_way_to_fail_fails_its_step_alone_with_its_cause_and_log() {
    let study = Study::new(
        "
steps:
  good: {plugin: trivial}
  crash: {plugin: segfault}
  panic: {plugin: panic}
  error: {plugin: error, retries: 1}
  nan: {plugin: nan-field}
  stuck: {plugin: hang, resources: {time_limit: 500 ms}}
  after: {plugin: sum, from: {in: [good, crash]}}
  other: {plugin: sum, from: {in: good}}
",
    );
    let output = study.call(&["run"]);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(4), "{text}");
    let failed = |step: &str, cause: &str| {
        let line = text
            .lines()
            .filter(|l| l.starts_with("FAILED"))
            .find(|l| l.contains(step));
        assert!(line.is_some_and(|l| l.contains(cause)), "{step}: {text}");
    };
    failed(" crash:", "SIGSEGV");
    failed(" panic:", "panicked");
    failed(" nan:", "malformed");
    failed(" stuck:", "time limit of 0.5 s");
    assert_eq!(
        text.lines()
            .filter(|l| l.starts_with("start    error"))
            .count(),
        2,
        "{text}"
    );
    assert!(
        text.contains("skip     after because crash failed"),
        "{text}"
    );
    assert!(text.contains("finish   other"), "{text}");
    let last = text
        .rfind("first failure:")
        .expect("the first failure is told");
    assert!(text[last..].contains("log: "), "{text}");
    assert_eq!(study.artifacts().len(), 2);
    // A log is written only by those that had something to say.
    let logs = study.folder.path().join(".plyflow/runs/study/logs");
    assert!(logs.join("crash.log").exists() && !logs.join("good.log").exists());
}

#[test]
fn until_and_set_choose_what_runs_and_with_what() {
    let study = Study::new(FAN_OUT);
    assert_eq!(study.run(&["--until", "zones"]), (0, [2, 0, 0]));
    assert_eq!(study.run(&["--set", "local.value=7"]), (0, [4, 2, 0]));
    assert_eq!(study.run(&[]), (0, [4, 2, 0]));
    assert_eq!(study.value("all", "sum"), 17.0);
}

#[test]
fn a_missed_expectation_is_code_5_only_when_asked() {
    let study = Study::new(&format!(
        "{FAN_OUT}expect:\n  - {{step: all, result: sum, value: 18, tolerance: 0.5, source: made up}}\n"
    ));
    // Of a step that is not asked for, nothing is expected.
    assert_eq!(study.run(&["--until", "zones", "--check"]).0, 0);
    assert_eq!(study.run(&[]).0, 0);
    assert_eq!(study.run(&["--check"]).0, 5);
    assert_eq!(study.call(&["results", "--check"]).status.code(), Some(5));
}

const SLOW: &str = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  second: {plugin: sum, from: {in: first}}
  slow: {plugin: sleep, with: {seconds: 30}, from: {in: second}}
";

#[test]
fn a_second_engine_on_the_same_workflow_is_refused_and_told_by_whom() {
    let study = Study::new(SLOW);
    let mut first = study.start();
    until("the slow step", || {
        workers_of(first.id()) == 1 && study.artifacts().len() == 2
    });
    let output = study.call(&["run"]);
    assert_eq!(output.status.code(), Some(6));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(text.contains(&format!("process {}", first.id())), "{text}");
    // Looking is allowed.
    assert_eq!(study.call(&["plan"]).status.code(), Some(0));
    first.kill().unwrap();
    first.wait().unwrap();
}

#[test]
fn a_killed_engine_leaves_no_worker_and_the_same_command_resumes() {
    let study = Study::new(SLOW);
    let mut engine = study.start();
    until("the slow step", || {
        workers_of(engine.id()) == 1 && study.artifacts().len() == 2
    });
    engine.kill().unwrap();
    engine.wait().unwrap();
    until("the worker's end", || workers_of(engine.id()) == 0);
    study.write(&SLOW.replace("seconds: 30", "seconds: 0"));
    assert_eq!(study.run(&[]), (0, [1, 2, 0]));
    let tmp = study.folder.path().join(".plyflow/runs/study/tmp");
    assert!(!tmp.exists(), "temporary files are left");
}

#[test]
fn ctrl_c_stops_the_worker_keeps_what_is_done_and_says_how_to_resume() {
    let study = Study::new(SLOW);
    let mut command = study.command(&["run"]);
    let engine = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    until("the slow step", || {
        workers_of(engine.id()) == 1 && study.artifacts().len() == 2
    });
    signal(&engine, libc::SIGINT);
    let id = engine.id();
    let output = engine.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains("To go on: plyflow run"), "{text}");
    assert_eq!(workers_of(id), 0);
    study.write(&SLOW.replace("seconds: 30", "seconds: 0"));
    assert_eq!(study.run(&[]), (0, [1, 2, 0]));
}

#[test]
fn kills_at_many_moments_end_in_the_same_bytes_as_an_undisturbed_run() {
    let workflow = FAN_OUT.replace("items: 3", "items: 12");
    let calm = Study::new(&workflow);
    assert_eq!(calm.run(&["--jobs", "1"]).0, 0);
    let expected = calm.artifacts();
    let begun = Instant::now();
    Study::new(&workflow).run(&[]);
    let whole = begun.elapsed();
    for moment in 1..=10 {
        let study = Study::new(&workflow);
        let mut engine = study.start();
        std::thread::sleep(whole * moment / 11);
        let _ = engine.kill();
        engine.wait().unwrap();
        // Whatever is visible is whole.
        for (name, bytes) in study.artifacts() {
            assert!(
                expected.get(&name) == Some(&bytes),
                "{name} after a kill at {moment}/11"
            );
        }
        let (code, [_, _, failed]) = study.run(&["--jobs", "2"]);
        assert_eq!((code, failed), (0, 0));
        assert!(
            study.artifacts() == expected,
            "other bytes after a kill at {moment}/11"
        );
    }
}

#[test]
fn clean_keeps_what_the_last_run_uses() {
    let study = Study::new(FAN_OUT);
    study.run(&[]);
    study.run(&["--set", "local.value=7"]);
    assert_eq!(study.artifacts().len(), 10);
    // A name that is no workflow's cleans nothing.
    for slip in ["typo.yaml", "."] {
        let slipped = study
            .command_on(slip, &["clean", "--all"])
            .output()
            .unwrap();
        assert_eq!(slipped.status.code(), Some(2), "{slip}");
    }
    assert_eq!(study.call(&["clean"]).status.code(), Some(0));
    assert_eq!(study.artifacts().len(), 6);
    assert_eq!(study.run(&["--set", "local.value=7"]), (0, [0, 6, 0]));
    study.call(&["clean", "--all"]);
    assert!(study.artifacts().is_empty());
}

#[test]
fn clean_leaves_alone_what_is_no_store() {
    let study = Study::new(FAN_OUT);
    let result = study.folder.path().join("other/runs/exp1/result.csv");
    std::fs::create_dir_all(result.parent().unwrap()).unwrap();
    std::fs::write(&result, "x").unwrap();
    let output = study.call(&["clean", "--store", "other", "--all"]);
    assert_eq!(output.status.code(), Some(2));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(text.contains("is no store"), "{text}");
    assert!(result.exists() && !study.folder.path().join("other/lock").exists());
}

#[test]
fn a_run_of_a_part_has_a_page_of_its_own() {
    let study = Study::new(FAN_OUT);
    assert_eq!(study.call(&["run"]).status.code(), Some(0));
    let page = |name: &str| std::fs::read_to_string(study.folder.path().join(name)).unwrap();
    let whole = page("report.html");
    assert!(!whole.contains("only up to"));
    let output = study.call(&["run", "--until", "zones"]);
    assert_eq!(output.status.code(), Some(0));
    assert!(page("report.html") == whole);
    let part = page("report-until-zones.html");
    assert!(part.contains("only up to zones"));
    assert!(part.contains("plyflow run workflow.yaml --until zones"));
}

#[test]
fn the_exit_code_tells_how_it_went_although_nothing_can_be_written() {
    let study = Study::new("steps:\n  bad: {plugin: error}\n");
    let full = || {
        std::fs::File::options()
            .write(true)
            .open("/dev/full")
            .unwrap()
    };
    for format in ["text", "json"] {
        let words = ["run", "--no-report", "--log-format", format];
        let mut command = study.command(&words);
        let status = command.stdout(full()).stderr(full()).status().unwrap();
        assert_eq!(status.code(), Some(4), "{format}");
    }
}

#[test]
fn a_damaged_artifact_is_made_again() {
    let study = Study::new(FAN_OUT);
    study.run(&[]);
    let name = study.artifacts().keys().next().unwrap().clone();
    let path = study
        .folder
        .path()
        .join(".plyflow/artifacts")
        .join(&name[..2])
        .join(&name);
    std::fs::write(&path, "").unwrap();
    assert_eq!(study.run(&[]), (0, [1, 5, 0]));
}

impl Study {
    /// The files of an artifact, by a part of the name of the step that its record tells.
    fn files_of(&self, step: &str) -> Vec<(PathBuf, PathBuf)> {
        let root = self.folder.path().join(".plyflow/artifacts");
        let names = self.artifacts().into_keys();
        let paths = names.map(|name| {
            let artifact = root.join(&name[..2]).join(&name);
            let record = artifact.with_extension("record.json");
            (artifact, record)
        });
        let is_of = |(_, record): &(PathBuf, PathBuf)| {
            let text = std::fs::read_to_string(record).unwrap();
            text.contains(&format!("\"step\": \"{step}\""))
        };
        paths.filter(is_of).collect()
    }
}

#[test]
fn an_artifact_whose_record_a_power_cut_left_empty_is_made_again() {
    let study = Study::new(FAN_OUT);
    study.run(&[]);
    let (_, record) = study.files_of("all").remove(0);
    std::fs::write(&record, "").unwrap();
    assert_eq!(study.run(&[]), (0, [1, 5, 0]));
    assert_eq!(study.value("all", "sum"), 17.0);
}

#[test]
fn clean_keeps_what_a_run_could_not_note_in_its_journal() {
    let study = Study::new(FAN_OUT);
    study.run(&[]);
    // As a full disk leaves it: nothing noted, and last written to before the artifacts.
    let journal = study.folder.path().join(".plyflow/runs/study/journal");
    let file = std::fs::File::options().write(true).open(journal).unwrap();
    file.set_len(8).unwrap();
    let before = std::time::SystemTime::now() - Duration::from_secs(60);
    file.set_modified(before).unwrap();
    assert_eq!(study.call(&["clean"]).status.code(), Some(0));
    assert_eq!(study.artifacts().len(), 6);
    assert_eq!(study.run(&[]), (0, [0, 6, 0]));
}

#[test]
fn a_plugin_built_anew_while_a_run_goes_on_makes_nothing_under_the_old_key() {
    let study = Study::new(
        "steps:\n  slow: {plugin: sleep, with: {seconds: 2}}\n  after: {plugin: sum, from: {in: slow}}\n",
    );
    let own = study.folder.path().join("plugins");
    std::fs::create_dir(&own).unwrap();
    for name in ["libsleep.so", "libsum.so"] {
        std::fs::copy(plyflow_faults::folder().join(name), own.join(name)).unwrap();
    }
    let run = ["run", "--no-report", "--plugins", "plugins"];
    let mut command = study.command(&run);
    command.env_remove("PLYFLOW_PLUGINS");
    let engine = command
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    until("the slow step", || workers_of(engine.id()) == 1);
    let library = std::fs::read(own.join("libsum.so")).unwrap();
    std::fs::write(own.join("libsum.so"), [&library[..], b"newer"].concat()).unwrap();
    let output = engine.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(4));
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        text.contains("libsum.so has changed since this run began"),
        "{text}"
    );
    assert_eq!(study.artifacts().len(), 1, "the slow step is kept");
    let again = study.command(&run).env_remove("PLYFLOW_PLUGINS").output();
    assert_eq!(again.unwrap().status.code(), Some(0));
    assert_eq!(study.artifacts().len(), 2);
}

#[test]
fn an_expectation_is_of_every_item_and_of_none_where_there_is_none() {
    let expected = format!(
        "{FAN_OUT}expect:\n  - {{step: local, result: value, minimum: 0, source: made up}}\n"
    );
    let study = Study::new(&expected);
    study.run(&[]);
    let check = |study: &Study| study.call(&["results", "--check"]);
    assert_eq!(check(&study).status.code(), Some(0));
    let (artifact, _) = study.files_of("local").remove(1);
    std::fs::remove_file(artifact).unwrap();
    let output = check(&study);
    assert_eq!(output.status.code(), Some(5), "an item is not there");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(text.contains("local[item-"), "{text}");

    let none = Study::new(&expected.replace("items: 3", "items: 0"));
    assert_eq!(none.run(&["--check"]).0, 0);
    assert_eq!(check(&none).status.code(), Some(0));
}

/// `1` begins with half of the cores and `2` and, after that, `3` with the rest; when nothing else runs it may use them all.
#[test]
fn a_step_goes_on_with_the_cores_that_others_have_left() {
    let study = Study::new(
        "steps:\n\
         \x20 long: {plugin: patient, with: {value: 1, seconds: 4, ledger: ledger}}\n\
         \x20 short: {plugin: patient, with: {value: 2, seconds: 0.1, ledger: ledger}}\n\
         \x20 next: {plugin: patient, from: {in: short}, with: {value: 3, seconds: 0.3, ledger: ledger}}\n",
    );
    let ledger = study.folder.path().join("ledger");
    let workflow = study.folder.path().join("workflow.yaml");
    let text = std::fs::read_to_string(&workflow).unwrap();
    let named = format!("ledger: {}", ledger.display());
    std::fs::write(&workflow, text.replace("ledger: ledger", &named)).unwrap();
    assert_eq!(study.run(&["--jobs", "4"]), (0, [3, 0, 0]));
    let told = std::fs::read_to_string(&ledger).unwrap();
    let of_long: Vec<&str> = told
        .lines()
        .filter(|l| l.starts_with("threads") && l.ends_with(" of 1"))
        .collect();
    assert_eq!(of_long.last(), Some(&"threads 4 of 1"), "{told}");
    let record = study.call(&["results", "--format", "json"]);
    let all: Value = serde_json::from_slice(&record.stdout).unwrap();
    let steps = all["steps"].as_array().unwrap_or_else(|| panic!("{all}"));
    let threads = |name: &str| {
        let found = steps.iter().find(|s| s["step"] == name);
        found.unwrap_or_else(|| panic!("no {name} in {all}"))["cost"]["threads"].clone()
    };
    assert_eq!((threads("long"), threads("next")), (4.into(), 2.into()));
}
