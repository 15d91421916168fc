//! Studies: points share steps, grow and go on, and have one table whatever happened on the way.

use plyflow_e2e::{Study, wait_for, well};
use serde_json::Value;

/// A study of these values, with a step that is the same for all.
fn points(values: &str) -> String {
    format!(
        "
study:
  vary: {{v: {values}}}
steps:
  base: {{plugin: trivial, with: {{value: 10}}}}
  one: {{plugin: trivial, with: {{value: \"${{v}}\"}}}}
  all: {{plugin: sum, from: {{in: [base, one]}}}}
responses:
  total: {{step: all, result: sum}}
"
    )
}

/// The bytes of the table: CSV and HDF5.
fn table(study: &Study) -> (String, Vec<u8>) {
    let csv = std::fs::read_to_string(study.path("study.csv")).expect("a table");
    (
        csv,
        std::fs::read(study.path("study.h5")).expect("an artifact"),
    )
}

/// The table as `plyflow results --study --format json` tells it.
fn told(study: &Study) -> Value {
    let output = study.call(&["results", "--study", "--format", "json"]);
    serde_json::from_slice(&output.stdout).expect("a table in JSON")
}

#[test]
fn added_points_run_alone_and_the_table_has_the_bytes_of_one_run() {
    let grown = Study::new(&points("[1, 2, 3]"));
    assert_eq!(grown.run(&["--jobs", "1"]), well(1 + 2 * 3, 0));
    // In the middle, at the front, and as another way to write the same.
    grown.write(&points("{from: 0, to: 5, by: 1}"));
    assert_eq!(grown.run(&["--jobs", "4"]), well(2 * 3, 7));
    assert_eq!(grown.run(&[]), well(0, 13));
    let whole = Study::new(&points("{from: 0, to: 5, count: 6}"));
    assert_eq!(whole.run(&["--jobs", "3"]), well(13, 0));
    assert_eq!(table(&grown), table(&whole));
    assert_eq!(grown.artifacts(), whole.artifacts());
    // What was printed is what lies there.
    let printed = grown.call(&["results", "--study", "--format", "csv"]);
    assert_eq!(String::from_utf8(printed.stdout).unwrap(), table(&grown).0);
    // Fewer points run nothing, and more that were there before neither.
    grown.write(&points("[4]"));
    assert_eq!(grown.run(&[]), well(0, 3));
    assert_eq!(table(&grown).0.lines().count(), 2);
}

#[test]
fn other_names_run_nothing_and_a_step_by_hand_is_the_same() {
    let study = Study::new(&points("[1, 2]"));
    assert_eq!(study.run(&[]), well(5, 0));
    study.write(
        &points("[1, 2]")
            .replace("vary: {v:", "vary: {w:")
            .replace("${v}", "${w}"),
    );
    assert_eq!(study.run(&[]), well(0, 5));
    // Without a study, with the value of a point.
    let by_hand = "
steps:
  base: {plugin: trivial, with: {value: 10}}
  one: {plugin: trivial, with: {value: 2}}
  all: {plugin: sum, from: {in: [base, one]}}
";
    study.write(by_hand);
    assert_eq!(study.run(&[]), well(0, 3));
}

#[test]
fn a_study_killed_at_many_moments_goes_on_to_the_table_of_an_undisturbed_one() {
    let slow = points("{from: 1, to: 12, by: 1}").replace(
        "one: {plugin: trivial, with: {value: \"${v}\"}}",
        "one: {plugin: trivial, with: {value: \"${v}\"}}\n  wait: {plugin: sleep, with: {seconds: \"${v} / 100\"}}",
    );
    let whole = Study::new(&slow);
    assert_eq!(whole.run(&["--jobs", "2"]), well(1 + 3 * 12, 0));
    let study = Study::new(&slow);
    for moment in [3, 9, 20] {
        let mut engine = study.start(&["--jobs", "2"]);
        wait_for("some steps", || {
            study.artifacts().len() >= moment || engine.try_wait().is_ok_and(|s| s.is_some())
        });
        let _ = engine.kill();
        let _ = engine.wait();
    }
    let end = study.run(&["--jobs", "2"]);
    assert_eq!((end.code, end.executed + end.cached), (Some(0), 37));
    assert!(end.cached >= 9, "{end:?}");
    assert_eq!(table(&study), table(&whole));
}

const SOME_TOO_LONG: &str = "
study:
  vary: {seconds: [0, 60], v: [1, 2]}
BEARS
steps:
  wait: {plugin: sleep, with: {seconds: \"${seconds}\"}, resources: {time_limit: 1 s}}
  one: {plugin: trivial, with: {value: \"${v}\"}, from: {in: wait}}
responses:
  value: {step: one, result: value}
expect:
  - {response: value, of: max, value: 2}
  - {response: value, of: monotone, over: v, direction: increasing, where: 'seconds == 0'}
  - {response: value, maximum: 1.5}
";

#[test]
fn a_failed_point_is_a_row_with_its_class_and_cause() {
    let study = Study::new(&SOME_TOO_LONG.replace("BEARS", ""));
    let end = study.run(&[]);
    assert_eq!((end.code, end.failed, end.not_run), (Some(4), 1, 2));
    let rows = told(&study)["points"].clone();
    let of = |i: usize| &rows[i];
    assert_eq!(of(0)["point"], "seconds=0,v=1");
    assert_eq!(
        (&of(0)["status"], &of(0)["responses"]["value"]),
        (&"done".into(), &1.0.into())
    );
    for i in [2, 3] {
        assert_eq!(
            (&of(i)["status"], &of(i)["responses"]["value"]),
            (&"failed".into(), &Value::Null)
        );
        assert_eq!(of(i)["failure"]["class"], "time-limit");
        assert_eq!(of(i)["failure"]["step"], "wait@seconds=60");
        assert!(
            of(i)["failure"]["cause"]
                .as_str()
                .unwrap()
                .contains("time limit of 1 s")
        );
    }
    let csv = table(&study).0;
    assert_eq!(csv.lines().count(), 5);
    assert!(csv.contains("\"seconds=60,v=1\",60,1,,failed,"), "{csv}");
    // A largest value is not known while points are missing; a bound that is broken already is.
    let verdicts: Vec<Value> = study.results()["results"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|r| r["step"] == "study")
        .map(|r| r["verdict"].clone())
        .collect();
    assert_eq!(verdicts, ["not judged", "ok", "missed"]);
}

/// What stands between two texts, wherever the first stands.
fn all_between<'a>(text: &'a str, from: &str, to: &str) -> Vec<&'a str> {
    let pieces = text.split(from).skip(1);
    pieces
        .map(|p| p.split(to).next().unwrap_or_default())
        .collect()
}

#[test]
fn the_page_of_a_study_has_the_numbers_of_its_csv_and_leads_to_pages_of_points() {
    let study = Study::new(&SOME_TOO_LONG.replace("BEARS", ""));
    assert_eq!(study.run(&[]).failed, 1);
    let read = |name: &str| std::fs::read_to_string(study.path(name)).expect(name);
    assert!(study.call(&["report"]).status.success());
    let page = read("report.html");
    let csv = read("study.csv");
    let body = all_between(&page, "<table class=\"points\">", "</table>")[0];
    let rows = all_between(body, "<tr data-place", "</tr>");
    let lines: Vec<&str> = csv.lines().skip(1).collect();
    assert_eq!((rows.len(), lines.len()), (4, 4));
    for (row, line) in rows.iter().zip(&lines) {
        let (name, rest) = line[1..].split_once('"').expect("a name with a comma");
        assert!(row.replace("<wbr>", "").contains(name), "{row}");
        // Both variables, the response, and the status.
        let cells: Vec<&str> = rest[1..].split(',').take(4).collect();
        let numbers = all_between(row, "data-value=\"", "\"");
        let told: Vec<&str> = cells[..3]
            .iter()
            .copied()
            .filter(|c| !c.is_empty())
            .collect();
        assert_eq!(numbers, told, "{line}");
        assert!(row.contains(cells[3]), "{line}");
    }
    let failed = all_between(&page, "id=\"failed\"", "</section>")[0];
    assert!(
        failed.contains("time-limit") && failed.contains("time limit of 1 s"),
        "{failed}"
    );
    // A page of one point, which the study's leads to when it is written again, with the same bytes each time.
    let output = study.call(&["report", "--point", "seconds=0,v=2"]);
    assert!(output.status.success(), "{output:?}");
    let own = read("report-points/seconds=0,v=2.html");
    assert!(
        own.contains("one@v=2") || own.contains("v=2"),
        "the steps of the point"
    );
    assert!(!own.contains("v=1"), "nothing of another point");
    let link = "href=\"report-points/seconds=0,v=2.html\"";
    assert!(!page.contains(link));
    assert!(study.call(&["report"]).status.success());
    let again = read("report.html");
    assert_eq!(again.matches(link).count(), 1);
    assert!(study.call(&["report"]).status.success());
    assert!(again == read("report.html"), "the page has other bytes");
    let unknown = study.call(&["report", "--point", "v=2"]);
    let told = String::from_utf8_lossy(&unknown.stderr).into_owned();
    assert!(
        !unknown.status.success() && told.contains("there is no point 'v=2'"),
        "{told}"
    );
}

#[test]
fn as_many_failed_points_are_borne_as_the_study_says() {
    let bears = |n: u32| {
        let study =
            Study::new(&SOME_TOO_LONG.replace("BEARS", &format!("  at_most_failures: {n}")));
        study.run(&["--jobs", "1"])
    };
    let end = bears(2);
    assert_eq!((end.code, end.failed), (Some(0), 1), "one step, two points");
    assert_eq!(bears(1).code, Some(4));
}

#[test]
fn a_plan_tells_points_what_they_share_and_what_the_rest_costs() {
    let study = Study::new(&points("[1, 2]"));
    let plan = |words: &[&str]| {
        let output = study.call(words);
        String::from_utf8(output.stdout).unwrap()
    };
    let first = plan(&["plan"]);
    assert!(
        first.contains("study over v: 2 points, 0 done, 2 to run"),
        "{first}"
    );
    assert!(first.contains("cost is not known"), "{first}");
    assert_eq!(study.run(&[]), well(5, 0));
    study.write(&points("[1, 2, 3]"));
    let more = plan(&["plan"]);
    assert!(
        more.contains("3 points, 2 done, 1 to run") && more.contains("  v=3\n"),
        "{more}"
    );
    assert!(
        more.contains("base  one for all points") && more.contains("2 steps to run; about"),
        "{more}"
    );
    let json: Value = serde_json::from_str(&plan(&["plan", "--format", "json"])).unwrap();
    assert_eq!(json["study"]["points_to_run"], serde_json::json!(["v=3"]));
    assert_eq!(json["study"]["steps_without_estimate"], 0);
    assert_eq!(json["steps"].as_array().unwrap().len(), 7);
}

#[test]
fn steps_of_a_study_are_named_together_or_at_one_point() {
    let study = Study::new(&points("[1, 2]"));
    assert_eq!(study.run(&["--until", "one@v=2"]), well(1, 0));
    assert_eq!(study.run(&["--until", "one"]), well(1, 1));
    assert_eq!(study.run(&[]), well(3, 2));
    let end = study.run(&["--force", "one"]);
    assert_eq!((end.code, end.executed), (Some(0), 2));
    let wrong = study.call(&["run", "--until", "two"]);
    let text = String::from_utf8(wrong.stderr).unwrap();
    assert!(
        wrong.status.code() == Some(2) && text.contains("one@v=1"),
        "{text}"
    );
}

#[test]
fn a_thousand_points_are_one_table() {
    let study = Study::new(
        &points("{from: 1, to: 1000, by: 1}")
            .replace("  all: {plugin: sum, from: {in: [base, one]}}\n", "")
            .replace("step: all, result: sum", "step: one, result: value"),
    );
    assert_eq!(study.run(&[]), well(1001, 0));
    let (csv, _) = table(&study);
    assert_eq!(csv.lines().count(), 1001);
    assert!(
        csv.lines()
            .nth(500)
            .unwrap()
            .starts_with("v=500,500,500,done,")
    );
    study.write(
        &points("{from: 1, to: 1003, by: 1}")
            .replace("  all: {plugin: sum, from: {in: [base, one]}}\n", "")
            .replace("step: all, result: sum", "step: one, result: value"),
    );
    assert_eq!(study.run(&[]), well(3, 1001));
}

#[test]
fn expectations_over_a_study_hold_for_a_part_of_it_that_has_their_response() {
    let study = Study::new(
        "
study:
  vary: {v: [0, 1, 3]}
steps:
  one: {plugin: trivial, with: {value: \"${v}\"}}
  all: {plugin: sum, from: {in: one}}
responses:
  v1: {step: one, result: value}
  total: {step: all, result: sum}
expect:
  - {response: v1, maximum: 0.5}
  - {response: total, maximum: 0.5}
",
    );
    // Only the first is judged, and it is missed.
    assert_eq!(study.run(&["--until", "one", "--check"]).code, Some(5));
    assert_eq!(study.run(&["--until", "one@v=0", "--check"]).code, Some(0));
}

#[test]
fn points_that_an_expectation_says_nothing_of_are_told() {
    let study = Study::new(
        "
study:
  vary: {v: [0, 1, 2, 5]}
steps:
  one: {plugin: trivial, with: {value: \"abs(${v} - 1)\"}}
responses:
  r: {step: one, result: value}
expect:
  - {response: r, of: symmetric_about, over: v, about: 1}
  - {response: r, of: argmin, over: v, value: 1}
",
    );
    assert_eq!(study.run(&["--check"]).code, Some(0));
    let results = study.results();
    let names = results["results"].as_array().unwrap().iter();
    let told = names.map(|r| r["result"].as_str().unwrap_or_default());
    let told: Vec<&str> = told.filter(|n| n.contains("asymmetry")).collect();
    assert_eq!(
        told,
        ["asymmetry of r about v = 1 (1 of 4 points without a mirror point)"]
    );
}
