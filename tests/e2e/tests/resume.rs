//! Caching, kills, stops, locks: what is finished is kept and the same command goes on.

use plyflow_e2e::random::Random;
use plyflow_e2e::{Study, ended, signal, wait_for, well, workers_of};
use std::time::Duration;

/// Several kinds of artifact (attributes, collections, meshes with frames, arrays), a fan-out, and steps
/// that last long enough to be killed in.
const MIXED: &str = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  zones: {plugin: split, with: {items: 4}, from: {in: first}}
  wait: {plugin: sleep, with: {seconds: 0.05}, for_each: {z: zones}, from: {in: zones}}
  mesh: {plugin: mesh, with: {points: 64, frames: 20}, for_each: {z: zones}, from: {in: wait}}
  all: {plugin: sum, from: {in: [wait, mesh, first]}}
";
const STEPS: u64 = 1 + 1 + 4 + 4 + 1;

#[test]
fn a_run_killed_at_many_moments_resumes_to_the_bytes_of_an_undisturbed_run() {
    let undisturbed = Study::new(MIXED);
    assert_eq!(undisturbed.run(&["--jobs", "2"]), well(STEPS, 0));
    let expected = undisturbed.artifacts();
    assert_eq!(expected.len() as u64, STEPS);

    let study = Study::new(MIXED);
    for moment in 0..16u64 {
        let mut engine = study.start(&["--jobs", "2"]);
        // From before the first step to after the last: the moments are coprime to the steps' duration.
        std::thread::sleep(Duration::from_millis(3 + 17 * moment));
        let _ = engine.kill();
        engine.wait().unwrap();
        wait_for("the workers' end", || workers_of(engine.id()) == 0);
        for (name, bytes) in study.artifacts() {
            assert!(
                expected.get(&name) == Some(&bytes),
                "kill {moment}: {name} is not whole"
            );
        }
    }
    let end = study.run(&["--jobs", "2"]);
    assert_eq!((end.code, end.executed + end.cached), (Some(0), STEPS));
    assert_eq!(study.artifacts(), expected);
    assert_eq!(study.run(&[]), well(0, STEPS));
    assert!(
        !study.path(".plyflow/runs/study/tmp").exists(),
        "temporary files are left"
    );
}

#[test]
fn a_killed_run_does_again_only_what_was_in_flight() {
    let steps = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  second: {plugin: sum, from: {in: first}}
  slow: {plugin: sleep, with: {seconds: 600}, from: {in: second}}
";
    let study = Study::new(steps);
    let mut engine = study.start(&[]);
    wait_for("the slow step", || {
        workers_of(engine.id()) == 1 && study.artifacts().len() == 2
    });
    engine.kill().unwrap();
    engine.wait().unwrap();
    study.write(&steps.replace("600", "0"));
    assert_eq!(study.run(&[]), well(1, 2));
}

#[test]
fn ctrl_c_keeps_what_is_finished_and_says_how_to_go_on() {
    for number in [libc::SIGINT, libc::SIGTERM] {
        let steps = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  slow: {plugin: sleep, with: {seconds: 600}, from: {in: first}}
";
        let study = Study::new(steps);
        let log = study.path("out.log");
        let out = std::fs::File::create(&log).unwrap();
        let mut command = study.command(&["run", "--no-report"]);
        let mut engine = command.stdout(out).spawn().unwrap();
        wait_for("the slow step", || {
            workers_of(engine.id()) == 1 && study.artifacts().len() == 1
        });
        signal(&engine, number);
        assert_eq!(engine.wait().unwrap().code(), Some(130));
        let said = std::fs::read_to_string(log).unwrap();
        let line = said.lines().last().unwrap_or_default();
        assert!(
            line.contains("To go on: plyflow run ") && line.ends_with("workflow.yaml"),
            "{said}"
        );
        study.write(&steps.replace("600", "0"));
        assert_eq!(study.run(&[]), well(1, 1));
    }
}

#[test]
fn two_runs_of_one_workflow_exclude_each_other_and_two_workflows_do_not() {
    let slow = "steps:\n  slow: {plugin: sleep, with: {seconds: 600}}\n";
    let study = Study::new(slow);
    let mut engine = study.start(&[]);
    wait_for("the slow step", || workers_of(engine.id()) == 1);
    let second = study.call(&["run", "--no-report"]);
    assert_eq!(second.status.code(), Some(6));
    let text = String::from_utf8_lossy(&second.stderr).into_owned();
    assert!(text.contains(&format!("process {}", engine.id())), "{text}");
    // Another workflow in the same store; looking at this one; but not cleaning under its feet.
    let other = "plyflow: 1\nname: other\nsteps:\n  a: {plugin: trivial}\n";
    std::fs::write(study.path("other.yaml"), other).unwrap();
    let words = ["run", "--log-format", "json", "--no-report"];
    let output = study.command_on("other.yaml", &words).output().unwrap();
    assert_eq!(ended(&output.stderr, output.status), well(1, 0));
    assert_eq!(study.call(&["plan"]).status.code(), Some(0));
    assert_eq!(study.call(&["clean", "--all"]).status.code(), Some(6));
    engine.kill().unwrap();
    engine.wait().unwrap();
    assert_eq!(study.call(&["clean", "--all"]).status.code(), Some(0));
    assert!(study.artifacts().is_empty());
}

#[test]
fn one_and_two_jobs_and_one_and_four_threads_give_the_same_bytes() {
    let one = Study::new(MIXED);
    assert_eq!(one.run(&["--jobs", "1"]), well(STEPS, 0));
    for jobs in ["2", "4"] {
        let other = Study::new(MIXED);
        assert_eq!(other.run(&["--jobs", jobs]), well(STEPS, 0));
        assert_eq!(other.artifacts(), one.artifacts(), "{jobs} jobs");
    }
}

#[test]
fn any_order_of_the_steps_in_the_file_and_any_number_of_jobs_give_the_same_bytes() {
    let mut random = Random::new(5, 0);
    let mut lines = Vec::new();
    for k in 0..24 {
        // Steps of different lengths, so that they become ready in another order with every number of jobs.
        lines.push(match k {
            0..4 => format!("  s{k}: {{plugin: trivial, with: {{value: {k}}}}}\n"),
            _ if k % 5 == 0 => format!(
                "  s{k}: {{plugin: sleep, with: {{seconds: 0.0{}}}, from: {{in: s{}}}}}\n",
                random.below(9),
                random.below(k)
            ),
            _ => format!(
                "  s{k}: {{plugin: sum, from: {{in: [s{}, s{}]}}}}\n",
                random.below(k / 2),
                k / 2 + random.below(k - k / 2)
            ),
        });
    }
    let study = |lines: &[String]| Study::new(&format!("steps:\n{}", lines.concat()));
    let first = study(&lines);
    assert_eq!(first.run(&["--jobs", "1"]), well(24, 0));
    for jobs in ["1", "2", "4", "4"] {
        random.shuffle(&mut lines);
        let other = study(&lines);
        assert_eq!(other.run(&["--jobs", jobs]), well(24, 0));
        assert_eq!(
            other.artifacts(),
            first.artifacts(),
            "{jobs} jobs, {lines:?}"
        );
    }
}

#[test]
fn a_change_of_form_and_of_unit_changes_nothing() {
    let study = Study::new(
        "
steps:
  stuck: {plugin: sleep, with: {seconds: 0}, resources: {time_limit: 1 min}}
  next: {plugin: trivial, with: {value: 10}, from: {in: stuck}}
",
    );
    assert_eq!(study.run(&[]), well(2, 0));
    study.write(
        "
# The same in other words: order, style, number format, and a limit that is no part of the result.
description: other words
steps:
  next:
    from: { in: [stuck] }
    with:
      'value': 1.0e+1
    plugin: \"trivial\"
  stuck:
    plugin: sleep
    resources: { time_limit: 90 s }
    retries: 2
    with: { seconds: 0.0 }
",
    );
    assert_eq!(study.run(&[]), well(0, 2));
}

#[test]
fn an_artifact_that_is_gone_or_cut_short_is_made_again_and_nothing_else() {
    let study = Study::new(MIXED);
    assert_eq!(study.run(&[]), well(STEPS, 0));
    let whole = study.artifacts();
    let place = |name: &str| study.path(".plyflow/artifacts").join(&name[..2]).join(name);
    for (k, name) in whole.keys().enumerate() {
        if k % 2 == 0 {
            std::fs::remove_file(place(name)).unwrap();
        } else {
            let file = std::fs::File::options()
                .write(true)
                .open(place(name))
                .unwrap();
            file.set_len(100).unwrap();
        }
    }
    let half = whole.len() as u64;
    assert_eq!(study.run(&[]), well(half, 0));
    assert_eq!(study.artifacts(), whole);
    let name = whole.keys().next().unwrap();
    std::fs::remove_file(place(name)).unwrap();
    assert_eq!(study.run(&[]), well(1, half - 1));
    assert_eq!(study.artifacts(), whole);
}

/// Files of kept resolved workflows.
fn kept(study: &Study) -> Vec<std::path::PathBuf> {
    let entries = std::fs::read_dir(study.path(".plyflow/resolved")).unwrap();
    entries.map(|e| e.unwrap().path()).collect()
}

#[test]
fn a_kept_workflow_gives_the_run_that_reading_it_anew_gives() {
    let steps = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  second: {plugin: sum, from: {in: first}}
";
    let study = Study::new(steps);
    assert_eq!(study.run(&[]), well(2, 0));
    let [file] = &kept(&study)[..] else {
        panic!("one workflow is kept as one file");
    };
    // In use, gone, cut, damaged: nothing runs.
    assert_eq!(study.run(&[]), well(0, 2));
    std::fs::remove_file(file).unwrap();
    assert_eq!(study.run(&[]), well(0, 2));
    let whole = std::fs::read(file).unwrap();
    std::fs::write(file, &whole[..whole.len() / 2]).unwrap();
    assert_eq!(study.run(&[]), well(0, 2));
    assert_eq!(std::fs::read(file).unwrap(), whole, "it is made anew");
    let damaged: Vec<u8> = whole.iter().map(|b| !b).collect();
    std::fs::write(file, damaged).unwrap();
    assert_eq!(study.run(&[]), well(0, 2));
    // Another value of the same length, by the file and by the command line.
    study.write(&steps.replace("value: 2", "value: 3"));
    assert_eq!(study.run(&[]), well(2, 0));
    assert_eq!(study.values("first", "value"), [3.0]);
    assert_eq!(study.run(&["--set", "first.value=4"]), well(2, 0));
    assert_eq!(study.run(&[]), well(0, 2));
    // Findings are told each time.
    study.write(&steps.replace("value: 2", "valu3: 2"));
    for _ in 0..2 {
        let output = study.call(&["run", "--no-report"]);
        assert_eq!(output.status.code(), Some(3));
        assert!(String::from_utf8_lossy(&output.stderr).contains("valu3"));
    }
}

#[test]
fn results_of_an_older_workflow_are_told_apart_from_none() {
    let steps = "
steps:
  first: {plugin: trivial, with: {value: 2}}
  second: {plugin: sum, from: {in: first}}
";
    let study = Study::new(steps);
    let said = |words: &[&str]| {
        let out = study.call(words);
        String::from_utf8_lossy(&[out.stdout, out.stderr].concat()).into_owned()
    };
    for word in ["results", "report"] {
        let text = said(&[word]);
        assert!(text.contains("nothing has been run yet"), "{text}");
    }
    assert_eq!(study.run(&["--until", "first"]), well(1, 0));
    let text = said(&["results", "--step", "second"]);
    assert!(
        text.contains("nothing of these steps is in the store"),
        "{text}"
    );
    study.write(&steps.replace('2', "3"));
    for words in [
        &["results"][..],
        &["report"],
        &["results", "--step", "first"],
    ] {
        let text = said(words);
        assert!(
            text.contains("as it is now") && text.contains("plyflow plan"),
            "{text}"
        );
    }
}
