//! Files with one mistake each: the error names the right file and line, and says what helps.

#[path = "../common/mod.rs"]
mod common;
mod material;
mod scene;
mod workflow;

use common::Study;
use plyflow_workflow::Diagnostics;

const W: &str = "workflow.yaml";
const S: &str = "scene.yaml";
const F: &str = "materials/fabric.yaml";

/// (file, text, replaced by, lines below the start of the replaced text, what the error says)
type Case = (
    &'static str,
    &'static str,
    &'static str,
    usize,
    &'static [&'static str],
);

/// All mistakes, one for each run.
fn cases() -> impl Iterator<Item = &'static Case> {
    [workflow::CASES, scene::CASES, material::CASES]
        .into_iter()
        .flatten()
}

fn findings(study: &Study) -> Diagnostics {
    match study.load() {
        Ok(_) => panic!("nothing was found"),
        Err(d) => d,
    }
}

#[test]
fn every_mutation_is_reported_in_its_file_and_line() {
    let number = cases().count();
    assert!(number >= 40);
    let mut failures = Vec::new();
    for (file, from, to, below, says) in cases() {
        let study = Study::sound();
        let mut line = study.mutate(file, from, to);
        // What is missing is reported at the mapping that lacks it (a ply: at its kind), which stands
        // above the removed line.
        let given_line = *below != usize::MAX;
        line += if given_line { *below } else { 0 };
        let found = match study.load() {
            Ok(_) => {
                failures.push(format!("{from:?} -> {to:?}: nothing was found"));
                continue;
            }
            Err(d) => d,
        };
        let path = study.path(file);
        let hit = found.items.iter().any(|d| {
            let text = format!(
                "{} {} {}",
                d.message,
                d.expected.as_deref().unwrap_or_default(),
                d.help.as_deref().unwrap_or_default()
            );
            d.file == path
                && (d.line == line || (!given_line && d.line < line && d.line > 0))
                && d.column > 0
                && text.contains(says[0])
        });
        let all = found.to_string() + &found.render(false);
        let says_all = says.iter().all(|s| all.contains(s));
        if !hit || !says_all {
            failures.push(format!(
                "{from:?} -> {to:?}: line {line} of {file}, {says:?}\n{}",
                found.render(false)
            ));
        }
    }
    assert!(
        failures.is_empty(),
        "{} of {}:\n{}",
        failures.len(),
        number,
        failures.join("\n")
    );
}

#[test]
fn friction_is_asked_for_where_surfaces_touch() {
    let found = |from: &str, to: &str| {
        let study = Study::sound();
        study.mutate(S, from, to);
        study
            .load()
            .err()
            .map(|d| d.to_string())
            .unwrap_or_default()
    };
    // One ply needs no friction between plies; two do.
    assert_eq!(found("  fabric_fabric: 0.35\n", ""), "");
    let study = Study::sound();
    study.mutate(S, "  fabric_fabric: 0.35\n", "");
    let second = "  - {name: ply-2, kind: ply, material: materials/fabric.yaml, length: 480 mm, width: 300 mm}\n  - name: upper-film";
    study.mutate(S, "  - name: upper-film", second);
    let two = findings(&study).to_string();
    assert!(two.contains("`fabric_fabric` is missing"), "{two}");
    // A press touches the plies with tool, die and holder.
    let press = "process:\n  press:\n    stroke: 50 mm\n    forming_time: 1 s\n    settling_time: 0 s\n    die: {opening_radius: 53 mm, edge_radius: 6 mm}\n#";
    let missing = found("process:", press);
    assert!(missing.contains("`tool_fabric` is missing"), "{missing}");
}

#[test]
fn one_mistake_gives_no_crowd_of_errors() {
    for (file, from, to, _, _) in cases() {
        let study = Study::sound();
        study.mutate(file, from, to);
        let n = findings(&study).items.len();
        assert!(
            n <= 2,
            "{from:?} -> {to:?}: {n} errors\n{}",
            findings(&study).render(false)
        );
    }
}

#[test]
fn all_mistakes_of_all_files_are_found_in_one_pass() {
    let study = Study::sound();
    let mut wanted = Vec::new();
    for (file, from, to) in [
        (W, "on_failure: keep-going", "on_failure: never"),
        (W, "element_size: 8 mm", "element_size: 8"),
        (W, "contact: penalty", "contact: glue"),
        (W, "time_limit: 30 min", "time_limit: 30 mm"),
        (W, "over_shear_positive: 8 deg", "over_shear_positive: 8 mm"),
        (W, "plugin: zone-extraction", "plugin: zone-extractor"),
        (W, "for_each: {zone: zones}", "for_each: {zone: coarse}"),
        (W, "element: rf4", "element: rf44"),
        (W, "global: coarse", "globl: coarse"),
        (W, "maximum: 0.05", "maximum: 0.05 m"),
        (S, "draft: 10 deg", "draft: 80 deg"),
        (S, "kind: ply", "kind: sheet"),
        (S, "fabric_fabric: 0.35", "fabric_fabric: 3.5"),
        (F, "thickness: 0.4 mm", "thickness: 0.4"),
        (F, "shear: 112.19 N/m", "shear: 112.19 N"),
    ] {
        let line = study.mutate(file, from, to);
        wanted.push((study.path(file), line));
    }
    let found = findings(&study);
    for (file, line) in wanted {
        assert!(
            found.items.iter().any(|d| d.file == file && d.line == line),
            "{file}:{line}\n{}",
            found.render(false)
        );
    }
    // A file that two steps read is reported once.
    let mut places: Vec<String> = found
        .items
        .iter()
        .map(|d| format!("{}:{}:{}", d.file, d.line, d.message))
        .collect();
    let n = places.len();
    places.sort();
    places.dedup();
    assert_eq!(places.len(), n, "{}", found.render(false));
}

#[test]
fn a_cycle_is_shown_with_its_path() {
    let study = Study::sound();
    let line = study.mutate(
        W,
        "  zones: {plugin: zone-extraction, from: {defects: defects}}",
        "  zones: {plugin: zone-extraction, from: {defects: zones}}",
    );
    let found = findings(&study);
    assert!(
        found
            .items
            .iter()
            .any(|d| d.line == line && d.message.contains("zones -> zones")),
        "{found}"
    );
}

#[test]
fn findings_as_json_have_place_value_expectation_and_remedy() {
    let study = Study::sound();
    let line = study.mutate(W, "element_size: 8 mm", "element_size: 8");
    let json = findings(&study).to_json();
    let wanted = serde_json::json!([{
        "file": study.path(W), "line": line, "column": 21, "severity": "error",
        "message": "`element_size`: `8` has no unit", "given": "8",
        "expected": "a length such as `5 mm`",
        "help": "write the unit after the number, such as `8 mm`"
    }]);
    assert_eq!(json, wanted);
}

#[test]
fn findings_as_text_show_the_line_with_a_caret() {
    let study = Study::sound();
    let line = study.mutate(W, "element_size: 8 mm", "element_size: 8 ms");
    let text = findings(&study).render(false);
    assert!(
        text.contains(&format!("workflow.yaml:{line}:21]")),
        "{text}"
    );
    assert!(
        text.contains("      element_size: 8 ms") && text.contains("──┬─"),
        "{text}"
    );
    assert!(
        text.contains("expected a length such as `5 mm`") && text.contains("1 error"),
        "{text}"
    );
}

#[test]
fn a_missing_workflow_file_is_named() {
    let error = plyflow_workflow::load("/nowhere/w.yaml".into(), &common::catalog()).unwrap_err();
    assert!(
        error.render(false).contains("/nowhere/w.yaml"),
        "{}",
        error.render(false)
    );
    assert!(error.has_errors());
}

#[test]
fn a_missing_plugin_folder_is_reported() {
    let study = Study::sound();
    let line = study.mutate(W, "steps:", "plugins: [./plugns]\nsteps:");
    let found = findings(&study);
    assert_eq!(found.items[0].line, line, "{found}");
}
