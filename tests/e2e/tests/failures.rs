//! Plugins that fail in every known way: a clear failure of their step alone.

use plyflow_e2e::{Ended, Study, program, wait_for, workers_of};
use std::process::Command;

/// Runs a workflow in text form; returns exit code and messages.
fn told(study: &Study, more: &[&str]) -> (Option<i32>, String) {
    let mut words = vec!["run", "--no-report"];
    words.extend(more);
    let output = study.call(&words);
    (
        output.status.code(),
        String::from_utf8(output.stderr).unwrap(),
    )
}

/// Plugin and what its failure must say.
const WAYS_TO_FAIL: [(&str, &str); 9] = [
    (
        "error",
        "the tool has no surface: give it at least one triangle",
    ),
    ("panic", "the plugin panicked"),
    ("segfault", "SIGSEGV"),
    ("hang", "time limit of 0.4 s"),
    ("nan-field", "field 'temperature'"),
    ("open-frame", "frame"),
    ("missing-field", "field"),
    ("writes-after-frame", "frame"),
    ("no-collection", "collection"),
];

#[test]
fn every_way_to_fail_fails_one_step_with_its_cause_last_and_spares_the_rest() {
    for (plugin, cause) in WAYS_TO_FAIL {
        // On a machine that is busy with other things a panic's trace alone may take a second.
        let limit = if plugin == "hang" { "400 ms" } else { "2 min" };
        let study = Study::new(&format!(
            "
steps:
  first: {{plugin: trivial, with: {{value: 2}}}}
  bad: {{plugin: {plugin}, resources: {{time_limit: {limit}}}}}
  after: {{plugin: sum, from: {{in: bad}}}}
  other: {{plugin: sum, from: {{in: first}}}}
"
        ));
        let (code, text) = told(&study, &[]);
        assert_eq!(code, Some(4), "{plugin}: {text}");
        assert!(text.contains("finish   other"), "{plugin}: {text}");
        assert!(
            text.contains("skip     after because bad failed"),
            "{plugin}: {text}"
        );
        let last = text
            .rfind("first failure: bad\n")
            .unwrap_or_else(|| panic!("{plugin}: {text}"));
        assert!(
            text[last..].contains(cause),
            "{plugin}: no '{cause}' in {}",
            &text[last..]
        );
        assert!(!text[last..].contains("first failure: after"), "{text}");
        assert_eq!(
            study.artifacts().len(),
            2,
            "{plugin}: only whole artifacts are visible"
        );
        assert_eq!(study.values("other", "sum"), [2.0]);
    }
}

#[test]
fn why_a_step_failed_is_told_afterwards_until_it_is_done() {
    let bad = "  bad: {plugin: error}\n";
    let steps = format!("steps:\n{bad}  after: {{plugin: sum, from: {{in: bad}}}}\n");
    let study = Study::new(&steps);
    let said = |words: &[&str]| {
        let out = study.call(words);
        String::from_utf8_lossy(&[out.stdout, out.stderr].concat()).into_owned()
    };
    let cause = "the tool has no surface: give it at least one triangle";
    assert_eq!(study.run(&[]).code, Some(4));
    let report = said(&["report"]);
    assert!(
        report.contains(&format!("bad failed last time:\n  {cause}")),
        "{report}"
    );
    study.write(&format!("{steps}  other: {{plugin: trivial}}\n"));
    assert_eq!(study.run(&["--until", "other"]).code, Some(0));
    let plan = said(&["plan"]);
    assert!(
        plan.contains(&format!("failed last time: {cause}")),
        "{plan}"
    );
    let explained = said(&["explain", "bad"]);
    assert!(
        explained.contains("it failed last time (key"),
        "{explained}"
    );
    assert!(explained.contains(cause), "{explained}");
    said(&["report"]);
    let page = std::fs::read_to_string(study.path("report.html")).unwrap();
    assert!(page.contains(cause), "the report does not say why");
    assert!(page.contains("1 step failed; 1 step did not run"));
    // Another step is in its place now.
    study.write(&steps.replace("error", "trivial"));
    assert!(!said(&["plan"]).contains("failed last time"));
}

#[test]
fn a_library_that_cannot_be_used_is_an_error_of_the_workflow_and_nothing_runs() {
    let ways = [
        ("wrong-abi", "ABI 99.0"),
        ("bad-magic", "magic"),
        ("bad-manifest", "manifest"),
        ("wrong-kind", "kind"),
        ("crash-on-load", "signal 6"),
        ("no-such-plugin", "no-such-plugin"),
    ];
    for (plugin, cause) in ways {
        let study = Study::new(&format!(
            "steps:\n  good: {{plugin: trivial}}\n  bad: {{plugin: {plugin}}}\n"
        ));
        let (code, text) = told(&study, &[]);
        assert_eq!(code, Some(3), "{plugin}: {text}");
        assert!(text.contains(cause), "{plugin}: no '{cause}' in {text}");
        assert!(
            text.contains("workflow.yaml:5"),
            "{plugin}: no place in {text}"
        );
        assert!(study.artifacts().is_empty());
    }
}

#[test]
fn fail_fast_stops_what_is_running_and_keep_going_lets_it_finish() {
    let steps = "
steps:
  bad: {plugin: error}
  slow: {plugin: sleep, with: {seconds: 600}}
  late: {plugin: sum, from: {in: slow}}
";
    let study = Study::new(&format!("on_failure: fail-fast{steps}"));
    let ended = study.run(&["--jobs", "2"]);
    assert_eq!(
        ended,
        Ended {
            code: Some(4),
            executed: 0,
            cached: 0,
            failed: 1,
            not_run: 2
        }
    );
    let short = steps.replace("600", "0.2");
    let study = Study::new(&short);
    let ended = study.run(&["--jobs", "2"]);
    assert_eq!(
        ended,
        Ended {
            code: Some(4),
            executed: 2,
            cached: 0,
            failed: 1,
            not_run: 0
        }
    );
    let study = Study::new(&short);
    let ended = study.run(&["--jobs", "1", "--fail-fast"]);
    assert_eq!((ended.code, ended.failed), (Some(4), 1));
}

#[test]
fn a_repaired_failure_runs_only_what_was_missing() {
    let bad = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  middle: {plugin: error}
  last: {plugin: sum, from: {in: [first, middle]}}
";
    let study = Study::new(bad);
    assert_eq!(study.run(&[]).failed, 1);
    study.write(&bad.replace("plugin: error", "plugin: trivial, with: {value: 3}"));
    let ended = study.run(&[]);
    assert_eq!((ended.code, ended.executed, ended.cached), (Some(0), 2, 1));
    assert_eq!(study.values("last", "sum"), [5.0]);
}

#[test]
fn a_step_that_hangs_in_a_stopped_run_is_killed() {
    let study = Study::new("steps:\n  stuck: {plugin: hang}\n");
    let mut engine = study.start(&[]);
    wait_for("the worker", || workers_of(engine.id()) == 1);
    // The first asks, which this plugin does not hear; the second does not ask. Two at once may count as one.
    let mut status = None;
    wait_for("the end", || {
        plyflow_e2e::signal(&engine, libc::SIGINT);
        status = engine.try_wait().unwrap();
        status.is_some()
    });
    assert_eq!(status.unwrap().code(), Some(130), "{}", study.log());
    assert_eq!(workers_of(engine.id()), 0);
}

#[test]
fn what_the_plugin_prints_is_in_its_log_and_not_between_the_messages() {
    let study = Study::new("steps:\n  chatty: {plugin: prints}\n");
    let output = study.call(&["run", "--no-report", "--log-format", "json"]);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    for line in String::from_utf8(output.stderr).unwrap().lines() {
        assert!(
            serde_json::from_str::<serde_json::Value>(line).is_ok(),
            "not JSON: {line}"
        );
    }
}

#[test]
fn a_store_that_cannot_be_written_is_code_1_and_names_the_place() {
    let study = Study::new("steps:\n  a: {plugin: trivial}\n");
    std::fs::write(study.path(".plyflow"), "a file where a folder is needed").unwrap();
    let (code, text) = told(&study, &[]);
    assert_eq!(code, Some(1), "{text}");
    assert!(text.contains(".plyflow"), "{text}");
    let nowhere = Command::new(program())
        .args(["run", "no-such-file.yaml"])
        .output()
        .unwrap();
    assert_eq!(nowhere.status.code(), Some(2));
}
