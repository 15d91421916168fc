//! Expectations in a JSON file: the same as in the workflow, and every mistake is found where it stands.

mod common;

use common::{EXPECTED, Study, catalog};
use plyflow_workflow::Diagnostics;

const W: &str = "workflow.yaml";
const E: &str = "expected.json";

fn findings(study: &Study) -> Diagnostics {
    match study.load() {
        Ok(_) => panic!("nothing was found"),
        Err(d) => d,
    }
}

#[test]
fn a_file_says_the_same_as_the_list_of_a_workflow() {
    let study = Study::with_expected_file();
    let found = study
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let list = Study::sound().load().unwrap().expectations;
    let of = |result: &str| {
        let find = |all: &[plyflow_workflow::resolved::Expectation]| {
            all.iter().find(|e| e.result == result).unwrap().clone()
        };
        (find(&found.expectations), find(&list))
    };
    assert_eq!(found.expectations.len(), 3);
    let (in_file, in_list) = of("wrinkle_length.AW1");
    assert_eq!(
        (in_file.value, in_file.tolerance),
        (Some(0.068), Some(0.007))
    );
    assert_eq!(
        (in_file.value, in_file.tolerance),
        (in_list.value, in_list.tolerance)
    );
    assert_eq!(in_file.source.as_deref(), Some("table 5.3"));
    // The unit is the one that the plugin declares, so that a number can be shown before its result is there.
    assert_eq!((&*in_file.unit, &*in_list.unit), ("m", "m"));
    let (in_file, in_list) = of("kinetic_ratio");
    assert_eq!(in_file.maximum, in_list.maximum);
    // The source of the file stands for entries without one.
    assert_eq!(in_file.source.as_deref(), Some("thesis 5.5.2"));
}

#[test]
fn an_entry_may_name_several_steps_and_mean_each_or_their_mean() {
    let study = Study::with_expected_file();
    let of = |step: &str, rest: &str| {
        let entry = format!("\"step\": {step}, \"result\": \"kinetic_ratio\"{rest}");
        let from = "\"step\": \"coarse\", \"result\": \"kinetic_ratio\"";
        study.write(E, &EXPECTED.replace(from, &entry));
        study.load()
    };
    let each = of("[\"coarse\", \"local\"]", "").unwrap().expectations;
    let steps: Vec<&str> = each.iter().skip(2).map(|e| e.step.as_str()).collect();
    assert_eq!(steps, ["coarse", "local"]);
    assert!(
        each.iter()
            .all(|e| e.mean_over.is_empty() && e.step != "zones")
    );
    let mean = of("[\"coarse\", \"local\"]", ", \"of\": \"mean\"").unwrap();
    let mean = &mean.expectations[2..];
    assert_eq!((mean.len(), mean[0].maximum), (1, Some(0.05)));
    assert_eq!(mean[0].mean_over, ["coarse", "local"]);
    for (step, rest, says) in [
        ("[]", "", "names no step"),
        ("[\"coarse\", \"lokal\"]", "", "there is no step `lokal`"),
        ("5", "", "a list of names"),
        ("\"coarse\"", ", \"of\": \"median\"", "median"),
    ] {
        let told = of(step, rest).unwrap_err().render(false);
        assert!(told.contains(says), "{told}");
    }
}

#[test]
fn a_file_with_tabs_and_without_a_line_break_is_read_as_any_json() {
    let study = Study::with_expected_file();
    let tabs = EXPECTED.replace("    ", "\t\t").replace("  ", "\t");
    study.write(E, tabs.trim_end());
    assert_eq!(study.load().unwrap().expectations.len(), 3);
    let one_line: String = EXPECTED.lines().map(str::trim).collect();
    study.write(E, &one_line);
    assert_eq!(study.load().unwrap().expectations.len(), 3);
}

#[test]
fn a_mistake_far_along_one_long_line_is_told_with_its_place() {
    let study = Study::with_expected_file();
    let one_line: String = EXPECTED.lines().map(str::trim).collect();
    let entry = "{\"step\": \"coarse\", \"result\": \"kinetic_ratio\", \"maximum\": 1},";
    let long = one_line.replace("[{", &format!("[{}{{", entry.repeat(2000)));
    let wrong = long.replace("68 mm", "68 kg");
    assert!(wrong.find("68 kg").unwrap() > 70_000);
    study.write(E, &wrong);
    let found = findings(&study);
    let column = wrong.find("\"68 kg").unwrap() + 1;
    let told = found.render(false);
    assert!(
        told.contains(&format!("expected.json:1:{column}: ")) && told.contains("68 kg"),
        "{}",
        &told[..told.len().min(2000)]
    );
    assert!(told.len() < 2000);
    // The text is wrapped, with a bar before further lines.
    let words: Vec<&str> = told.split_whitespace().filter(|w| *w != "│").collect();
    assert!(words.join(" ").contains("a length such as"), "{told}");
}

/// (text of the file, replaced by, text at whose start the error stands, what it says)
type Case = (
    &'static str,
    &'static str,
    &'static str,
    &'static [&'static str],
);

const CASES: &[Case] = &[
    (
        "\"plyflow_expected\": 1",
        "\"plyflow_expected\": 2",
        "2,",
        &["version 2", "plyflow_expected: 1"],
    ),
    (
        "  \"plyflow_expected\": 1,\n",
        "",
        "{",
        &["`plyflow_expected` is missing"],
    ),
    (
        "\"expectations\": [",
        "\"expectation\": [",
        "\"expectation\"",
        &["unknown key `expectation`", "did you mean `expectations`"],
    ),
    (
        "\"source\": \"thesis 5.5.2\"",
        "\"source\": 5",
        "5,",
        &["`source` is the number 5", "text"],
    ),
    (
        "\"step\": \"coarse\"",
        "\"step\": \"coarze\"",
        "\"coarze\"",
        &["there is no step `coarze`", "did you mean `coarse`"],
    ),
    (
        "\"zone_count\"",
        "\"zone_cont\"",
        "\"zone_cont\"",
        &["no result `zone_cont`", "did you mean `zone_count`"],
    ),
    (
        "\"value\": \"68 mm\"",
        "\"value\": \"68 kg\"",
        "\"68 kg\"",
        &["`value` of `wrinkle_length.AW1`", "a length such as"],
    ),
    (
        "\"value\": \"68 mm\"",
        "\"value\": 68",
        "68,",
        &["`68` has no unit"],
    ),
    (
        "      \"value\": \"68 mm\",\n",
        "",
        "\"7 mm\"",
        &["`tolerance` without `value`"],
    ),
    (
        "\"maximum\": 5e-2",
        "\"maximun\": 5e-2",
        "\"maximun\"",
        &["unknown key `maximun`", "did you mean `maximum`"],
    ),
    (
        "\"maximum\": 5e-2",
        "\"maximum\": 5e-2, \"maximum\": 1",
        "\"maximum\": 1",
        &["the key `maximum` is repeated"],
    ),
    (
        "\"minimum\": 1}",
        "\"source\": \"s\"}",
        "\"zone_count\"",
        &["this expectation states nothing"],
    ),
    // JSON that YAML would take.
    (
        "\"maximum\": 5e-2}",
        "\"maximum\": 5e-2},",
        "\n  ]",
        &["no valid JSON", "no comma before"],
    ),
    (
        "  \"source\": \"thesis",
        "  # why\n  \"source\": \"thesis",
        "# why",
        &["no valid JSON", "JSON has no comments"],
    ),
    (
        "\"maximum\": 5e-2}",
        "\"maximum\": 5e-2",
        "\n  ]",
        &["no valid JSON"],
    ),
    (
        "\"minimum\": 1}",
        "\"minimum\": 1 \"µ\": 2}",
        "\"µ\"",
        &["no valid JSON"],
    ),
];

/// Line and column (characters), both from 1.
fn place(text: &str, at: usize) -> (usize, usize) {
    let before = &text[..at];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap().chars().count() + 1;
    (line, column)
}

#[test]
fn every_mistake_in_the_file_is_reported_at_its_line_and_column() {
    let mut failures = Vec::new();
    for (from, to, at, says) in CASES {
        let study = Study::with_expected_file();
        study.mutate(E, from, to);
        let text = study.read(E);
        let start = if to.contains(at.trim_end_matches(',')) || to.is_empty() {
            let near = EXPECTED.find(from).unwrap();
            let near = if to.is_empty() { 0 } else { near };
            near + text[near..].find(at).unwrap()
        } else {
            text.rfind(at).unwrap() + at.len() - at.trim_start().len()
        };
        let found = findings(&study);
        let here = found
            .items
            .iter()
            .find(|d| d.file == study.path(E) && (d.line, d.column) == place(&text, start));
        let told = found.to_string() + &found.render(false);
        if here.is_none() || !says.iter().all(|s| told.contains(s)) {
            let wanted = place(&text, start);
            failures.push(format!("{from:?} -> {to:?}: {wanted:?} {says:?}\n{told}"));
        }
        // An unknown key is also a missing one; a value that is not there leaves nothing stated.
        let two = told.contains("unknown key") || told.contains("without `value`");
        if found.items.len() > 1 + usize::from(two) {
            failures.push(format!("{from:?} -> {to:?}: several findings\n{told}"));
        }
    }
    assert!(
        failures.is_empty(),
        "{} of {}:\n{}",
        failures.len(),
        CASES.len(),
        failures.join("\n")
    );
}

#[test]
fn a_file_that_is_not_there_or_no_text_is_reported() {
    let study = Study::with_expected_file();
    let line = study.mutate(W, "expected.json", "expectd.json");
    let found = findings(&study);
    assert_eq!((found.items.len(), found.items[0].line), (1, line));
    let told = found.to_string();
    assert!(
        told.contains("cannot read `expectd.json`: there is no such file")
            && told.contains("did you mean `expected.json`"),
        "{told}"
    );
    let study = Study::with_expected_file();
    std::fs::write(study.path(E), [0x7b, 0xff, 0x7d]).unwrap();
    assert!(findings(&study).to_string().contains("UTF-8"));
}

#[test]
fn what_is_neither_a_list_nor_a_path_is_refused_with_both_named() {
    for wrong in ["5", "true", "{step: coarse}"] {
        let study = Study::with_expected_file();
        let line = study.mutate(W, "expect: expected.json", &format!("expect: {wrong}"));
        let found = findings(&study);
        assert_eq!(
            (found.items.len(), found.items[0].line),
            (1, line),
            "{wrong}"
        );
        let expected = found.items[0].expected.as_deref().unwrap();
        assert!(
            expected.contains("a list") && expected.contains("JSON file"),
            "{wrong}: {expected}"
        );
    }
}

#[test]
fn mistakes_of_the_workflow_and_of_the_file_are_found_in_one_pass() {
    let study = Study::with_expected_file();
    study.mutate(W, "on_failure: keep-going", "on_failure: keep-goin");
    study.mutate(E, "\"68 mm\"", "\"68 kg\"");
    study.mutate(E, "\"step\": \"coarse\"", "\"step\": \"coarze\"");
    let found = findings(&study);
    let in_file = |name: &str| {
        let path = study.path(name);
        found.items.iter().filter(|d| d.file == path).count()
    };
    assert_eq!((in_file(W), in_file(E)), (1, 2), "{found}");
}

#[test]
fn the_evidence_fails_after_a_change_of_the_file_and_no_step_differs() {
    let study = Study::with_expected_file();
    let resolve = || plyflow_workflow::resolve(&study.path(W), &catalog(), &[]).unwrap();
    let before = resolve();
    assert!(before.evidence.holds(&catalog()));
    study.mutate(E, "68 mm", "60 mm");
    assert!(!before.evidence.holds(&catalog()));
    let after = resolve();
    assert_eq!(before.workflow.steps, after.workflow.steps);
    assert_ne!(before.workflow.expectations, after.workflow.expectations);
    std::fs::remove_file(study.path(E)).unwrap();
    assert!(!after.evidence.holds(&catalog()));
}
