//! `--confirm`: the steps that it adds to workflows that come along, against the manifests of the plugins beside them.

mod common;

use camino::{Utf8Path, Utf8PathBuf};
use common::{Fake, step};
use plyflow_model::artifact::Variation;
use plyflow_model::manifest::Manifest;
use plyflow_workflow::resolved::{ResolvedStep, ResolvedWorkflow};
use plyflow_workflow::{Diagnostics, Override, Wanted, load, resolve_wanted};
use serde_json::{Value, json};
use std::f64::consts::SQRT_2;

fn root() -> Utf8PathBuf {
    Utf8Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// The manifests of a folder and those below.
fn manifests(folder: &Utf8Path, found: &mut Vec<Manifest>) {
    for entry in folder.read_dir_utf8().unwrap().map(Result::unwrap) {
        if entry.file_type().unwrap().is_dir() {
            manifests(entry.path(), found);
        } else if entry.file_name() == "manifest.json" {
            let text = std::fs::read_to_string(entry.path()).unwrap();
            found.push(Manifest::parse(&text).unwrap());
        }
    }
}

fn catalog() -> Fake {
    let mut found = Vec::new();
    manifests(&root().join("solver-plugins"), &mut found);
    Fake(found)
}

/// The demo's own files, with its workflow changed.
fn demo(change: impl Fn(String) -> String) -> (tempfile::TempDir, Utf8PathBuf) {
    let from = root().join("workflows/joggle-spar");
    let folder = tempfile::tempdir_in(root().join("workflows")).unwrap();
    let to = Utf8PathBuf::from_path_buf(folder.path().to_owned()).unwrap();
    std::fs::copy(from.join("scene.yaml"), to.join("scene.yaml")).unwrap();
    let text = std::fs::read_to_string(from.join("workflow.yaml")).unwrap();
    std::fs::write(to.join("workflow.yaml"), change(text)).unwrap();
    (folder, to.join("workflow.yaml"))
}

fn confirmed(
    file: &Utf8Path,
    chosen: &[Variation],
    set: &[&str],
) -> Result<ResolvedWorkflow, Diagnostics> {
    let overrides: Vec<Override> = set.iter().map(|s| s.parse().unwrap()).collect();
    let wanted = Wanted {
        overrides: &overrides,
        confirm: chosen,
        points: &|_, _, _| None,
    };
    resolve_wanted(file, &catalog(), &wanted).map(|r| r.workflow)
}

fn shipped() -> Utf8PathBuf {
    root().join("workflows/joggle-spar/workflow.yaml")
}

fn wires(of: &ResolvedStep) -> Vec<(&str, &str)> {
    of.inputs
        .iter()
        .map(|i| (i.port.as_str(), i.from.as_str()))
        .collect()
}

fn number(of: &ResolvedStep, parameter: &str) -> f64 {
    of.parameters[parameter].as_f64().unwrap()
}

/// The parameters of a step without some.
fn without(of: &ResolvedStep, names: &[&str]) -> Value {
    let mut all = serde_json::to_value(&*of.parameters).unwrap();
    names.iter().for_each(|n| {
        all.as_object_mut().unwrap().remove(*n);
    });
    all
}

#[test]
fn the_demo_gets_the_steps_of_four_variants_and_keeps_its_own_as_they_are() {
    let plain = load(&shipped(), &catalog()).unwrap();
    let w = confirmed(&shipped(), &Variation::ALL, &[]).unwrap();
    for own in &plain.steps {
        assert_eq!(step(&w, &own.name), own, "{}: its key stays", own.name);
    }
    let mut added: Vec<&str> = w.steps.iter().map(|s| s.name.as_str()).collect();
    added.retain(|n| plain.steps.iter().all(|s| s.name != *n));
    added.sort_unstable();
    let expected = [
        "boundary_finer",
        "boundary_slower",
        "boundary_wider",
        "confirm",
        "local_finer",
        "local_half_step",
        "local_slower",
        "local_wider",
        "zones_wider",
    ];
    assert_eq!(added, expected);

    let (boundary, local) = (step(&w, "boundary"), step(&w, "local"));
    let finer = step(&w, "boundary_finer");
    assert!((number(finer, "finer") - SQRT_2).abs() < 1e-5);
    assert_eq!(without(finer, &["finer"]), without(boundary, &["finer"]));
    let run = step(&w, "local_finer");
    assert!((number(run, "time_step") - 3e-6 / SQRT_2).abs() < 1e-11);
    assert_eq!(without(run, &["time_step"]), without(local, &["time_step"]));
    assert_eq!(wires(run), [("boundary", "boundary_finer")]);
    assert_eq!(run.dimensions, local.dimensions);

    assert_eq!(step(&w, "boundary_slower").parameters["slower"], json!(2.0));
    assert_eq!(without(step(&w, "local_slower"), &[]), without(local, &[]));
    let half = step(&w, "local_half_step");
    assert!((number(half, "time_step") - 1.5e-6).abs() < 1e-12);
    assert_eq!(wires(half), [("boundary", "boundary")]);

    assert_eq!(step(&w, "zones_wider").parameters["wider"], json!(2.0));
    let wider = step(&w, "boundary_wider");
    assert_eq!(
        wires(wider),
        [("formed", "coarse"), ("zones", "zones_wider")]
    );
    assert_eq!(wider.dimensions[0].over, "zones_wider");
    assert_eq!(step(&w, "local_wider").dimensions[0].over, "zones_wider");
    let confirm = wires(step(&w, "confirm"));
    for wire in [
        ("global", "coarse"),
        ("zones", "zones"),
        ("local", "local"),
        ("finer", "local_finer"),
        ("slower", "local_slower"),
        ("half_step", "local_half_step"),
        ("wider", "local_wider"),
    ] {
        assert!(confirm.contains(&wire), "{wire:?} of {confirm:?}");
    }
    let told = w.confirming.unwrap();
    assert!(told.left_out.is_empty() && plain.confirming.is_none());
    let factor = |name: &str| told.steps.iter().find(|s| s.name == name).unwrap().factor;
    assert!((factor("local_finer") - 2.0 * SQRT_2).abs() < 1e-12);
    assert_eq!(
        (factor("local_slower"), factor("local_half_step")),
        (2.0, 2.0)
    );
    assert!((factor("local_wider") - (1.3f64 / 1.15).powi(2)).abs() < 1e-12);
}

#[test]
fn variants_that_are_not_asked_for_are_named_and_values_by_set_hold_in_all() {
    let chosen = [Variation::Finer, Variation::HalfStep];
    let w = confirmed(
        &shipped(),
        &chosen,
        &[
            "local.time_step=8 us",
            "comparison.minimum_wrinkle_length=12 mm",
        ],
    )
    .unwrap();
    assert!((number(step(&w, "local_half_step"), "time_step") - 4e-6).abs() < 1e-12);
    // What counts as a defect is as in the comparison.
    assert!((number(step(&w, "confirm"), "minimum_wrinkle_length") - 0.012).abs() < 1e-12);
    assert!(
        w.steps
            .iter()
            .all(|s| !s.name.ends_with("_slower") && !s.name.ends_with("_wider"))
    );
    let left_out: Vec<Variation> = w
        .confirming
        .unwrap()
        .left_out
        .iter()
        .map(|l| l.variant)
        .collect();
    assert_eq!(left_out, [Variation::Slower, Variation::Wider]);
}

#[test]
fn a_step_in_time_that_the_workflow_leaves_out_is_the_plugin_s_default_divided() {
    let coarse = root().join("workflows/joggle-spar/workflow-coarse.yaml");
    let w = confirmed(&coarse, &Variation::ALL, &[]).unwrap();
    let (default, half) = (step(&w, "local"), step(&w, "local_half_step"));
    assert!((number(half, "time_step") - 0.5 * number(default, "time_step")).abs() < 1e-12);
}

#[test]
fn wider_is_left_out_where_element_sizes_are_advised_for_the_zones_as_they_are() {
    let advised = |text: String| {
        let more = "  meshes: {plugin: mesh-comparison, from: {runs: [local_8, local_5]}}\n  \
                    boundary_8: {plugin: boundary-interpolation, for_each: {zone: zones}, from: {formed: coarse, zones: zones}, with: {element_size: 8 mm}}\n  \
                    local_8: {plugin: forming-explicit, for_each: {zone: zones}, from: {boundary: boundary_8}, with: {scene: scene.yaml}}\n  \
                    boundary_5: {plugin: boundary-interpolation, for_each: {zone: zones}, from: {formed: coarse, zones: zones}, with: {element_size: 5 mm}}\n  \
                    local_5: {plugin: forming-explicit, for_each: {zone: zones}, from: {boundary: boundary_5}, with: {scene: scene.yaml}}\n";
        text.replace(
            "from: {formed: coarse, zones: zones}",
            "from: {formed: coarse, zones: zones, meshes: meshes}",
        )
        .replace("steps:\n", &format!("steps:\n{more}"))
    };
    let (_folder, file) = demo(advised);
    let w =
        confirmed(&file, &Variation::ALL, &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let told = w.confirming.clone().unwrap();
    assert_eq!(told.left_out.len(), 1);
    assert!(
        told.left_out[0].variant == Variation::Wider && told.left_out[0].why.contains("meshes")
    );
    // The finer run divides what is advised.
    assert!((number(step(&w, "boundary_finer"), "finer") - SQRT_2).abs() < 1e-5);
}

#[test]
fn what_cannot_be_confirmed_is_told_at_its_place_with_what_is_missing() {
    let refused = |file: &Utf8Path| {
        confirmed(file, &Variation::ALL, &[])
            .unwrap_err()
            .render(false)
    };
    let said = |change: &dyn Fn(String) -> String| {
        let (_folder, file) = demo(change);
        refused(&file)
    };
    let text = said(&|t| {
        t.replace("local_finer", "")
            .replace("  drape:", "  local_finer:")
            .replace("others: drape", "others: local_finer")
    });
    assert!(
        text.contains("adds a step `local_finer`") && text.contains("another name"),
        "{text}"
    );
    let text = said(&|t| {
        let at = t.find("  comparison:").unwrap();
        let end = t.find("expect:").unwrap();
        t[..at].to_owned() + &t[end..end]
    });
    assert!(
        text.contains("without a comparison")
            && text.contains("zone-extraction -> boundary-interpolation"),
        "{text}"
    );
    let text = said(&|t| t.replace(", local: local,", ","));
    assert!(
        text.contains("nothing arrives at `local` of `comparison`"),
        "{text}"
    );
    let growth = refused(&root().join("workflows/joggle-spar/workflow-growth.yaml"));
    assert!(
        growth.contains("by hand") && growth.contains("confirm.md"),
        "{growth}"
    );
    let study = refused(&root().join("workflows/kinematic/workflow-angles.yaml"));
    assert!(
        study.contains("`--confirm` for a workflow with `study`"),
        "{study}"
    );
}
