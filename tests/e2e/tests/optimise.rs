//! Optimisations: a method asks for points, is told what became of them, and goes on, whatever happens in between.

use plyflow_e2e::disk::{Disk, Victim};
use plyflow_e2e::{Study, repository, wait_for, well};
use serde_json::Value;
use std::process::Command;

/// An optimisation with this block, of (x - 1)^2 + (y - 2)^2 and x + y; points with x above 3 fail.
fn search(block: &str) -> String {
    format!(
        "
optimise:
  minimise: r
  over: {{x: {{from: 0, to: 4}}, y: {{from: 0, to: 4}}}}
{block}
steps:
  formed: {{plugin: error, with: {{value: \"${{x}}\", beyond: 3}}}}
  one: {{plugin: trivial, with: {{value: \"(${{x}} - 1) * (${{x}} - 1) + (${{y}} - 2) * (${{y}} - 2)\"}}}}
  two: {{plugin: trivial, with: {{value: \"${{x}} + ${{y}}\"}}, from: {{in: formed}}}}
responses:
  r: {{step: one, result: value}}
  s: {{step: two, result: value}}
"
    )
}

const EVOLUTION: &str = "  subject_to: [s >= 4]\n  method: evolution\n  seed: 3\n";

fn with_budget(block: &str, budget: u32) -> String {
    search(&format!("{block}  budget: {budget}\n"))
}

/// The bytes of the table: CSV and HDF5.
fn table(study: &Study) -> (String, Vec<u8>) {
    let csv = std::fs::read_to_string(study.path("study.csv")).expect("a table");
    (
        csv,
        std::fs::read(study.path("study.h5")).expect("an artifact"),
    )
}

/// What came of it, as `plyflow results --study --format json` tells it.
fn told(study: &Study) -> Value {
    let output = study.call(&["results", "--study", "--format", "json"]);
    let all: Value = serde_json::from_slice(&output.stdout).expect("a table in JSON");
    all["optimisation"].clone()
}

#[test]
fn a_search_that_is_killed_or_grows_ends_with_the_bytes_of_one_that_was_not() {
    let whole = Study::new(&with_budget(EVOLUTION, 32));
    assert_eq!(whole.run(&["--jobs", "1"]).code, Some(0));
    let study = Study::new(&with_budget(EVOLUTION, 16));
    for moment in [1, 7, 20] {
        let mut engine = study.start(&["--jobs", "4"]);
        wait_for("some steps", || {
            study.artifacts().len() >= moment || engine.try_wait().is_ok_and(|s| s.is_some())
        });
        let _ = engine.kill();
        let _ = engine.wait();
    }
    assert_eq!(study.run(&["--jobs", "4"]).code, Some(0));
    assert_eq!(table(&study).0.lines().count(), 17);
    let before = study.artifacts().len() as u64;
    study.write(&with_budget(EVOLUTION, 32));
    let end = study.run(&["--jobs", "2"]);
    assert_eq!((end.code, end.cached), (Some(0), before), "{end:?}");
    assert_eq!(table(&study), table(&whole));
    // Nothing is left to do, and a point that failed is not tried again.
    let again = study.run(&[]);
    assert_eq!((again.code, again.executed, again.failed), (Some(0), 0, 0));
    assert_eq!(table(&study), table(&whole));
}

#[test]
fn a_full_disk_and_a_killed_worker_are_no_answer_to_a_search() {
    let whole = Study::new(&with_budget(EVOLUTION, 12));
    assert_eq!(whole.run(&["--jobs", "1"]).code, Some(0));
    for at in (60..300).step_by(20) {
        let study = Study::new(&with_budget(EVOLUTION, 12));
        let orders = tempfile::tempdir().expect("a folder");
        let disk = Disk::new(&study.path(""), &orders.path().join("orders"));
        // For a moment only, so that what it did to a point can be noted.
        match at % 40 {
            0 => disk.kill(at, Victim::Doer, false),
            _ => disk.fail(at, Some(at + 4), libc::ENOSPC, false),
        }
        let mut command = study.command(&["run", "--no-report", "--jobs", "1"]);
        disk.under(&mut command);
        let output = command.output().expect("plyflow starts");
        let text = String::from_utf8_lossy(&output.stderr);
        let code = output.status.code();
        assert!(matches!(code, None | Some(0 | 1 | 4)), "{at}: {text}");
        disk.reset();
        assert_eq!(study.run(&["--jobs", "1"]).code, Some(0), "{at}");
        assert_eq!(table(&study), table(&whole), "{at}: {text}");
    }
}

#[test]
fn a_failed_point_is_a_row_and_the_best_point_meets_what_must_hold() {
    let study = Study::new(&with_budget(EVOLUTION, 40));
    let end = study.run(&[]);
    assert!(end.code == Some(0) && end.failed > 0, "{end:?}");
    let told = told(&study);
    // Without the constraint the answer would be 0; it is 0.5 at (1.5, 2.5).
    let best = told["best"]["value"].as_f64().unwrap();
    assert!((0.5..0.8).contains(&best), "{told}");
    assert_eq!((&told["told"], &told["ended"]), (&40.into(), &true.into()));
    let csv = table(&study).0;
    let head = csv.lines().next().unwrap();
    assert_eq!(
        head,
        "point,x,y,r,s,asked,excess_1,feasible,best_so_far,status,failed_step,failure_class,cause,key_one,key_two"
    );
    let failed: Vec<&str> = csv.lines().filter(|l| l.contains(",failed,")).collect();
    assert!(
        !failed.is_empty()
            && failed
                .iter()
                .all(|l| l.contains(",error,the tool has no surface")),
        "{csv}"
    );
    // Neither a number nor a verdict on what has no result.
    let empty = |l: &&str| l.split(',').nth(6 + 1) == Some("");
    assert!(failed.iter().all(empty), "{failed:?}");
}

#[test]
fn values_of_a_list_are_told_apart_by_what_they_are_and_not_by_how_they_are_written() {
    let points = |x: &str, start: &str| -> Vec<String> {
        let block = format!("  method: evolution\n  budget: 40\n  start: {{x: {start}, y: 1}}\n");
        let over = format!("over: {{x: {x}, y: [1, 2]}}");
        let text = search(&block)
            .replace("over: {x: {from: 0, to: 4}, y: {from: 0, to: 4}}", &over)
            .replace("${x}", "(${x} / (1 m))");
        let study = Study::new(&text);
        let end = study.run(&[]);
        assert_eq!(end.code, Some(0), "{x}: {end:?}");
        table(&study).0.lines().skip(1).map(str::to_owned).collect()
    };
    // One number in two units is two values, one value in two units is one.
    assert_eq!(points("[1 cm, 1 m]", "1 cm").len(), 4);
    assert_eq!(points("[9 cm, 90 mm, 100 mm]", "90 mm").len(), 4);
    // A step of a range, written otherwise: the first point that is asked for.
    let begun = points("{from: 80 mm, to: 100 mm, by: 10 mm}", "9 cm");
    let first = |l: &String| l.starts_with("\"x=90mm,y=1\"") && l.contains(",1,");
    assert!(begun.iter().any(first), "{begun:?}");
}

#[test]
fn points_that_fail_use_up_the_time_and_are_not_promised_again() {
    // Every point fails: there is always another one to ask for.
    let block = "  method: evolution\n  budget: 200 ms\n";
    let study = Study::new(&search(block).replace("beyond: 3", "beyond: -1"));
    let end = study.run(&["--jobs", "2"]);
    assert!(end.code == Some(0) && end.failed > 0, "{end:?}");
    assert_eq!(told(&study)["ended"], true);
    let asked = table(&study).0.lines().count() as u64 - 1;
    // What has been used up stays so.
    let again = study.run(&[]);
    assert_eq!((again.executed, again.failed), (0, 0), "{again:?}");
    assert_eq!(table(&study).0.lines().count() as u64 - 1, asked);
    let plan = study.call(&["plan", "--format", "json"]);
    let plan: Value = serde_json::from_slice(&plan.stdout).expect("a plan in JSON");
    assert_eq!(plan["study"]["points_failed"], asked, "{plan}");
    assert_eq!(plan["study"]["points_to_run"], Value::Array(Vec::new()));
    let kept = std::fs::read_to_string(study.path(".plyflow/runs/study/asked.json")).unwrap();
    let used = |text: &str| serde_json::from_str::<Value>(text).unwrap()["cpu_seconds"].as_f64();
    assert!(used(&kept) >= Some(0.2), "{kept}");
}

#[test]
fn a_failed_point_is_not_promised_again_where_it_shares_a_step_with_others() {
    let shared = |value: u32| {
        let base = format!("steps:\n  base: {{plugin: trivial, with: {{value: {value}}}}}\n");
        with_budget(EVOLUTION, 24)
            .replace("steps:\n", &base)
            .replace("- 2)\"}}", "- 2)\"}, from: {in: base}}")
    };
    let study = Study::new(&shared(1));
    let end = study.run(&[]);
    assert!(end.code == Some(0) && end.failed > 0, "{end:?}");
    study.write(&shared(2));
    let plan = study.call(&["plan", "--format", "json"]);
    let plan: Value = serde_json::from_slice(&plan.stdout).expect("a plan in JSON");
    let plan = &plan["study"];
    let open = plan["points_to_run"].as_array().unwrap().len() as u64;
    let failed = plan["points_failed"].as_u64().unwrap();
    assert_eq!((open + failed, failed), (24, end.failed), "{plan}");
    let text = String::from_utf8(study.call(&["plan"]).stdout).unwrap();
    let counts = format!("24 points, 0 done, {failed} failed (not run again), {open} to run");
    assert!(text.contains(&counts), "{text}");
}

#[test]
fn what_is_to_be_small_may_be_computed_from_the_variables() {
    let block = with_budget(
        "  subject_to: [s >= 4]\n  method: evolution\n  seed: 3\n",
        40,
    )
    .replace("minimise: r", "minimise: area")
    .replace("responses:\n", "responses:\n  area: {value: x * y}\n");
    let study = Study::new(&block);
    let end = study.run(&[]);
    assert!(end.code == Some(0) && end.failed > 0, "{end:?}");
    // x y is least on an edge, 0 at (0, 4); where x is above 3 points fail.
    let best = &told(&study)["best"];
    assert!(
        (0.0..0.8).contains(&best["value"].as_f64().unwrap()),
        "{best}"
    );
    let csv = table(&study).0;
    assert!(csv.starts_with("point,x,y,area,r,s,"), "{csv}");
    let number = |text: &str| -> f64 { text.parse().unwrap() };
    let mut seen = [0, 0];
    for line in csv.lines().skip(1) {
        // A point's name has a comma and stands in quotes.
        let row: Vec<&str> = line.split_once("\",").unwrap().1.split(',').collect();
        if line.contains(",done,") {
            assert!(
                (number(row[2]) - number(row[0]) * number(row[1])).abs() <= 1e-12,
                "{line}"
            );
            seen[0] += 1;
        } else {
            assert!(line.contains(",failed,"), "{line}");
            assert_eq!(row[2], "", "a point that failed has no numbers: {line}");
            seen[1] += 1;
        }
    }
    assert!(seen.iter().all(|n| *n > 0), "{seen:?}");
}

#[test]
fn the_simplex_goes_along_rosenbrock_s_valley_through_the_engine() {
    let study = Study::new(
        "
optimise:
  minimise: r
  over: {x: {from: -1.7, to: 2}, y: {from: -1, to: 2.6}}
  start: {x: -1.2, y: 1}
  budget: 90
  method: simplex
steps:
  one: {plugin: trivial, with: {value: \"(1 - ${x}) * (1 - ${x}) + 100 * (${y} - ${x} * ${x}) * (${y} - ${x} * ${x})\"}}
responses: {r: {step: one, result: value}}
expect:
  - {response: r, of: best, maximum: 1e-3}
  - {response: r, of: best, over: x, value: 1, tolerance: 0.05}
",
    );
    assert_eq!(study.run(&["--check"]), well(90, 0));
    let plan = String::from_utf8(study.call(&["plan"]).stdout).unwrap();
    assert!(
        plan.contains("minimise r, method simplex, budget 90 points: 90 asked for, at most 0 more"),
        "{plan}"
    );
}

#[test]
fn a_search_over_steps_settles_and_a_budget_of_time_ends_one() {
    let block = "  method: simplex\n  budget: 1000\n";
    let text = search(block).replace("{from: 0, to: 4}", "{from: 0, to: 3, by: 0.5}");
    let study = Study::new(&text.replace("minimise", "maximise"));
    assert_eq!(study.run(&[]).code, Some(0));
    let end = told(&study);
    assert!(
        end["settled"] == true && end["told"].as_u64() < Some(49),
        "{end}"
    );
    assert_eq!(end["best"]["point"], "x=3,y=0", "{end}");
    let study = Study::new(&search("  method: simplex\n  budget: 1 us\n"));
    assert_eq!(study.run(&[]).code, Some(0));
    assert_eq!(
        told(&study)["told"],
        3,
        "the first points are more than that"
    );
    // What is judged before its end is judged in vain.
    study.write(
        &(search("  method: simplex\n  budget: 50\n")
            + "expect:\n  - {response: r, of: best, maximum: 100}\n"),
    );
    let of_study = |study: &Study| {
        let all = study.results()["results"].as_array().unwrap().clone();
        all.into_iter().find(|r| r["step"] == "study").unwrap()["verdict"].clone()
    };
    assert_eq!(of_study(&study), "not judged");
    assert_eq!(study.run(&["--check"]).code, Some(0));
    assert_eq!(of_study(&study), "ok");
}

#[test]
fn a_part_of_an_optimisation_is_refused() {
    let study = Study::new(&with_budget(EVOLUTION, 8));
    let output = study.call(&["run", "--until", "one"]);
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.code() == Some(2) && text.contains("runs whole"),
        "{text}"
    );
}

#[test]
fn the_shipped_optimisation_finds_the_known_angle() {
    let store = tempfile::tempdir().unwrap();
    let file = repository().join("workflows/kinematic/workflow-optimise.yaml");
    // The table and the report would lie beside the workflow: a copy of the folder keeps the repository clean.
    let copy = store.path().join("kinematic");
    std::fs::create_dir(&copy).unwrap();
    for name in ["workflow-optimise.yaml", "hemisphere.yaml"] {
        std::fs::copy(file.with_file_name(name), copy.join(name)).unwrap();
    }
    let materials = store.path().join("materials");
    std::fs::create_dir(&materials).unwrap();
    for entry in std::fs::read_dir(repository().join("workflows/materials"))
        .unwrap()
        .flatten()
    {
        if entry.path().is_file() {
            std::fs::copy(entry.path(), materials.join(entry.file_name())).unwrap();
        }
    }
    let output = Command::new(plyflow_e2e::program())
        .args(["run", "--no-report", "--quiet", "--check"])
        .arg(copy.join("workflow-optimise.yaml"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(copy.join("study-optimise.csv").is_file());
}
