//! What an artifact carries for people: plots in the report, files for `plyflow extract`, numbers held against a file.

use plyflow_e2e::{Study, repository, well};
use std::process::{Command, Output};

const WORKFLOW: &str = "
expect: expected.json
steps:
  zones: {plugin: split, with: {items: 2}}
  one: {plugin: ./libcurves.so}
  each: {plugin: ./libcurves.so, for_each: {z: zones}, from: {in: zones}}
";

const EXPECTED: &str = r#"{"plyflow_expected": 1, "source": "closed form",
 "expectations": [
  {"step": "one", "result": "peak", "value": "40 mm", "tolerance": "0.1 mm"},
  {"step": "one", "result": "peak", "maximum": "50 mm", "source": "own bound"}
 ]}
"#;

/// A study with the plugin in C, built from its source with a change.
fn study(change: impl Fn(String) -> String) -> Study {
    let study = Study::new(WORKFLOW);
    std::fs::write(study.path("expected.json"), EXPECTED).unwrap();
    let source = repository().join("tests/e2e/plugins/curves.c");
    let source = std::fs::read_to_string(source).unwrap();
    std::fs::write(study.path("curves.c"), change(source)).unwrap();
    let built = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()))
        .args([
            "-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-I",
        ])
        .arg(repository().join("schemas/abi"))
        .arg("-o")
        .args([study.path("libcurves.so"), study.path("curves.c")])
        .status()
        .expect("a C compiler");
    assert!(built.success());
    study
}

fn told(output: &Output) -> (Option<i32>, String, String) {
    let text = |b: &[u8]| String::from_utf8(b.to_vec()).unwrap();
    (
        output.status.code(),
        text(&output.stdout),
        text(&output.stderr),
    )
}

#[test]
fn expectations_in_a_file_are_no_input_of_a_step_and_a_change_of_them_is_seen_at_once() {
    let study = study(|s| s);
    let run = || {
        let output = study.call(&["run", "--log-format", "json", "--check"]);
        plyflow_e2e::ended(&output.stderr, output.status)
    };
    let report = || std::fs::read_to_string(study.path("report.html")).unwrap();
    assert_eq!(run(), well(4, 0));
    assert_eq!(run(), well(0, 4));
    let page = report();
    assert!(page.contains("all 2 expectations met") && page.contains("closed form"));
    // The same size, so that only the content tells.
    let stricter = EXPECTED.replace("40 mm", "30 mm");
    assert_eq!(stricter.len(), EXPECTED.len());
    std::fs::write(study.path("expected.json"), stricter).unwrap();
    let ended = run();
    assert_eq!((ended.code, ended.executed, ended.cached), (Some(5), 0, 4));
    assert!(report().contains("1 of 2 expectations missed"));
    let rows = study.results()["results"].as_array().unwrap().clone();
    let of_one: Vec<_> = rows.iter().filter(|r| r["step"] == "one").collect();
    assert_eq!(of_one.len(), 2, "one row per expectation");
    assert_eq!(
        (of_one[0]["verdict"].as_str(), of_one[1]["verdict"].as_str()),
        (Some("missed"), Some("ok"))
    );
    assert_eq!(of_one[0]["expected"]["source"], "closed form");
    // A mistake in it stops the run at its place.
    let wrong = EXPECTED.replace("0.1 mm", "0.1 kg");
    std::fs::write(study.path("expected.json"), wrong).unwrap();
    let (code, _, text) = told(&study.call(&["run"]));
    assert_eq!(code, Some(3));
    assert!(
        text.contains("expected.json:3") && text.contains("0.1 kg"),
        "{text}"
    );
}

#[test]
fn the_report_draws_the_plot_of_a_step_in_c() {
    let study = study(|s| s);
    let output = study.call(&["run", "--quiet"]);
    assert_eq!(output.status.code(), Some(0));
    let page = std::fs::read_to_string(study.path("report.html")).unwrap();
    assert_eq!(page.matches("Displacement of the grip</p>").count(), 3);
    for text in [
        "A curve in C",
        "time (ms)",
        "displacement (mm)",
        ">300</text>",
        "class=\"line c0\"",
        "≤ 50 mm",
        "plyflow extract workflow.yaml",
    ] {
        assert!(page.contains(text), "{text}");
    }
    assert!(!page.contains("id=\"warnings\""));
}

#[test]
fn a_plot_that_cannot_be_drawn_is_a_warning_and_the_run_is_well() {
    let study = study(|s| s.replace("\"y\\\": \\\"curves/u\\\"", "\"y\\\": \\\"curves/w\\\""));
    let output = study.call(&["run", "--quiet", "--check"]);
    assert_eq!(output.status.code(), Some(0));
    let page = std::fs::read_to_string(study.path("report.html")).unwrap();
    let warnings = &page[page.find("id=\"warnings\"").expect("a warning")..];
    assert!(warnings.contains("one: plot 'u': series 1: there is no array 'curves/w'"));
    assert!(page.contains("id=\"results\"") && !page.contains("Displacement of the grip</p>"));
}

#[test]
fn files_of_a_step_or_an_item_are_written_where_asked_and_nothing_is_overwritten_unasked() {
    let study = study(|s| s);
    let before = told(&study.call(&["extract", "one"]));
    assert_eq!(before.0, Some(2));
    assert!(
        before.2.contains("one has no artifact yet") && before.2.contains("plyflow run"),
        "{}",
        before.2
    );
    assert_eq!(study.run(&[]), well(4, 0));

    let (code, list, _) = told(&study.call(&["extract", "one", "--list"]));
    assert_eq!(code, Some(0));
    assert_eq!(
        list,
        "file           size\nmaterial.yaml  20 B\nnotes.txt       9 B\n"
    );
    assert!(!study.path("material.yaml").exists());

    let (code, said, _) = told(&study.call(&["extract", "one", "--to", "new/out"]));
    assert_eq!((code, said.lines().count()), (Some(0), 2), "{said}");
    let read = |name: &str| std::fs::read_to_string(study.path(name)).unwrap();
    assert_eq!(read("new/out/material.yaml"), "plyflow_material: 1\n");
    assert_eq!(read("new/out/notes.txt"), "µ = 0.3\n");

    // Here, and for one item.
    assert_eq!(told(&study.call(&["extract", "each[0]"])).0, Some(0));
    assert_eq!(read("notes.txt"), "µ = 0.3\n");
    std::fs::write(study.path("notes.txt"), "my own notes").unwrap();
    let (code, _, text) = told(&study.call(&["extract", "each[0]"]));
    assert_eq!(code, Some(2));
    assert!(
        text.contains("notes.txt") && text.contains("--force"),
        "{text}"
    );
    assert_eq!(read("notes.txt"), "my own notes");
    assert_eq!(
        told(&study.call(&["extract", "each[0]", "--force"])).0,
        Some(0)
    );
    assert_eq!(read("notes.txt"), "µ = 0.3\n");
}

#[test]
fn what_cannot_be_extracted_or_exported_says_why() {
    let study = study(|s| s);
    assert_eq!(study.run(&[]), well(4, 0));
    for (step, says) in [
        ("two", "there is no step 'two'; the steps are: "),
        ("each", "'each' has several items: "),
        ("each[7]", "there is no 'each[7]'; there are: "),
        ("zones", "carries no files"),
    ] {
        let (code, out, text) = told(&study.call(&["extract", step]));
        assert_eq!(code, Some(2), "{step}: {text}");
        assert!(text.contains(says) && out.is_empty(), "{step}: {text}");
    }
    // Nor exported.
    for (step, says) in [
        ("two", "there is no step 'two'; the steps are: "),
        ("each", "'each' has several items: "),
        ("one", "has no bodies, so there is nothing to export"),
    ] {
        let words = ["export", step, "--format", "vtu,csv", "--to", "out"];
        let (code, out, text) = told(&study.call(&words));
        assert_eq!(code, Some(2), "{step}: {text}");
        assert!(text.contains(says) && out.is_empty(), "{step}: {text}");
        assert!(!study.path("out").exists());
    }
}

#[test]
fn a_file_whose_name_leads_elsewhere_is_refused_with_all_others() {
    let study = study(|s| s.replace("notes.txt", "../notes.txt"));
    assert_eq!(study.run(&[]), well(4, 0));
    let (code, _, text) = told(&study.call(&["extract", "one", "--to", "out", "--force"]));
    assert_eq!(code, Some(1));
    assert!(
        text.contains("../notes.txt") && text.contains("nothing is written"),
        "{text}"
    );
    assert!(!study.path("notes.txt").exists() && !study.path("out").exists());
}
