//! Two runs are compared step by step, whatever made them.

use plyflow_e2e::{Study, well};
use serde_json::Value;

const STEPS: &str = "
steps:
  parts: {plugin: split, with: {items: 2}}
  each: {plugin: trivial, with: {value: 1}, for_each: {p: parts}, from: {in: parts}}
  all: {plugin: sum, from: {in: each}}
";

/// Status of every step, and how the program ended.
fn diff(a: &Study, b: &Study, more: &[&str]) -> (Vec<(String, String)>, Option<i32>) {
    let other = b.path("workflow.yaml");
    let mut words = vec!["diff", other.to_str().unwrap(), "--format", "json"];
    words.extend(more);
    let output = a.call(&words);
    let told: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr)));
    let text = |v: &Value| v.as_str().unwrap().to_owned();
    let steps = told["compared"].as_array().unwrap();
    let steps = steps.iter().map(|s| (text(&s["step"]), text(&s["status"])));
    (steps.collect(), output.status.code())
}

#[test]
fn runs_of_the_same_steps_are_the_same_and_what_changed_is_named() {
    let [a, b] = [(); 2].map(|()| Study::new(STEPS));
    assert_eq!(a.run(&[]), well(4, 0));
    assert_eq!(b.run(&["--jobs", "1"]), well(4, 0));
    let (steps, code) = diff(&a, &b, &[]);
    let names: Vec<&str> = steps.iter().map(|s| s.0.as_str()).collect();
    assert_eq!(names, ["parts", "each[0]", "each[1]", "all"]);
    assert!(steps.iter().all(|s| s.1 == "same-bytes"), "{steps:?}");
    assert_eq!(code, Some(0));

    b.write(&STEPS.replace("value: 1", "value: 2"));
    assert_eq!(b.run(&[]), well(3, 1));
    let (steps, code) = diff(&a, &b, &[]);
    let status: Vec<&str> = steps.iter().map(|s| s.1.as_str()).collect();
    assert_eq!(status, ["same-bytes", "differs", "differs", "differs"]);
    assert_eq!(code, Some(9));
    let (steps, code) = diff(&a, &b, &["--step", "parts"]);
    assert_eq!((steps.len(), code), (1, Some(0)));

    // An item more, and a step that the other has not.
    b.write(
        &(STEPS.replace("items: 2", "items: 3") + "  extra: {plugin: trivial, with: {value: 5}}\n"),
    );
    assert_eq!(b.run(&[]).code, Some(0));
    let (steps, code) = diff(&a, &b, &[]);
    let only: Vec<&str> = (steps.iter().filter(|s| s.1 == "only-in-second"))
        .map(|s| s.0.as_str())
        .collect();
    assert_eq!(only, ["each[2]", "extra"]);
    assert_eq!(code, Some(9));
}

#[test]
fn the_numbers_that_differ_are_shown_and_a_damaged_artifact_is_not_compared() {
    let [a, b] = [1, 2].map(|value| {
        let study = Study::new(&format!(
            "\nsteps:\n  one: {{plugin: trivial, with: {{value: {value}}}}}\n"
        ));
        assert_eq!(study.run(&[]), well(1, 0));
        study
    });
    let file = |study: &Study| {
        let name = study.artifacts().keys().next().unwrap().clone();
        study.path(".plyflow/artifacts").join(&name[..2]).join(name)
    };
    let files = [file(&a), file(&b)];
    let ask = || {
        let words = files.each_ref().map(|f| f.to_str().unwrap().to_owned());
        let output = std::process::Command::new(plyflow_e2e::program())
            .arg("diff")
            .args(&words)
            .output()
            .unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (
            text(output.stdout),
            text(output.stderr),
            output.status.code(),
        )
    };
    let (out, _, code) = ask();
    assert!(out.contains(": 1 | 2 (+100.0 %)"), "{out}");
    assert_eq!(code, Some(9));
    let mut bytes = std::fs::read(&files[1]).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(&files[1], bytes).unwrap();
    let (out, err, code) = ask();
    assert_eq!((out.as_str(), code), ("", Some(8)));
    assert!(err.contains("nothing was compared with it"), "{err}");
}

#[test]
fn points_of_a_study_are_chosen_by_the_plain_name_and_what_failed_in_both_is_told() {
    let steps = "
study:
  vary: {v: [1, 2]}
steps:
  one: {plugin: error, with: {value: \"${v}\", beyond: 1}}
  two: {plugin: trivial, with: {value: \"${v}\"}}
";
    let [a, b] = [(); 2].map(|()| {
        let study = Study::new(steps);
        assert_eq!(study.run(&[]).failed, 1);
        study
    });
    let status = |more: &[&str]| {
        let (steps, code) = diff(&a, &b, more);
        let all: Vec<String> = steps.into_iter().map(|s| s.1).collect();
        (all, code)
    };
    let (all, code) = status(&[]);
    assert_eq!((all.len(), code), (4, Some(0)));
    assert_eq!(all.iter().filter(|s| *s == "in-neither").count(), 1);
    assert_eq!(status(&["--step", "two"]).0, ["same-bytes", "same-bytes"]);
    assert_eq!(status(&["--step", "one@v=2"]).0, ["in-neither"]);
}

#[test]
fn two_files_of_one_name_in_one_store_are_not_compared_with_themselves() {
    let study = Study::new("\nsteps:\n  one: {plugin: trivial, with: {value: 1}}\n");
    assert_eq!(study.run(&[]), well(1, 0));
    let text = std::fs::read_to_string(study.path("workflow.yaml")).unwrap();
    let other = study.path("other.yaml");
    std::fs::write(&other, text.replace("value: 1", "value: 2")).unwrap();
    let other = other.to_str().unwrap();
    for b in [other, "workflow.yaml"] {
        let output = study.call(&["diff", b]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("no two runs to compare"), "{said}");
    }
    // Another store has another last run of the name.
    let elsewhere = study.path("elsewhere");
    let elsewhere = elsewhere.to_str().unwrap();
    let words = ["run", "--store", elsewhere, "--no-report"];
    let run = study.command_on("other.yaml", &words).output().unwrap();
    assert!(run.status.success(), "{run:?}");
    let output = study.call(&["diff", other, "--store-b", elsewhere]);
    assert_eq!(output.status.code(), Some(9), "{output:?}");
}
