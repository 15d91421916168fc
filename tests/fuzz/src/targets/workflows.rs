//! What people write in YAML and JSON: workflows, and the files that they name.

use crate::fixture::{CATALOG, Folder, judge};
use camino::Utf8Path;
use plyflow_model::scene::Scene;
use plyflow_workflow::{Override, Part, Resolution, check_part, load_with, resolve};

thread_local! {
    static STUDY: Folder = Folder::of_study();
}

/// A workflow that was read is read as the same again, keeps what it rests on, and is kept in a store bit by bit.
fn sound(folder: &Folder, path: &Utf8Path, first: &Resolution) {
    let again = resolve(path, &*CATALOG, &[]).expect("a workflow that was sound a moment ago");
    assert_eq!(again.workflow, first.workflow, "another workflow");
    assert!(first.evidence.holds(&*CATALOG), "what it rests on is gone");
    // Those with an optimisation are not kept.
    let study = first.workflow.study.as_ref();
    if study.is_some_and(|s| s.optimisation.is_some()) {
        return;
    }
    let recipes = plyflow::plan::recipes(&first.workflow);
    let root = folder.path("");
    plyflow::store::resolved::write(&root, path, &[7; 32], (first, &recipes));
    let kept = plyflow::store::resolved::read(&root, path, &[7; 32], &*CATALOG);
    assert_eq!(kept, Some((again.workflow, recipes)), "kept as another");
}

pub(super) fn load(folder: &Folder, workflow: &str, written: &Utf8Path, bytes: &[u8]) {
    let path = folder.path(workflow);
    match resolve(&path, &*CATALOG, &[]) {
        Ok(found) => sound(folder, &path, &found),
        Err(found) => judge(&found, written, bytes),
    }
}

/// The bytes as a workflow, beside a scene, materials, points and expectations.
pub(super) fn workflow(bytes: &[u8]) {
    STUDY.with(|folder| {
        let path = folder.write("fuzzed.yaml", bytes);
        load(folder, "fuzzed.yaml", &path, bytes);
    });
}

/// The bytes as the expectations of a workflow.
pub(super) fn expected(bytes: &[u8]) {
    STUDY.with(|folder| {
        let path = folder.write("expected.json", bytes);
        load(folder, "workflow-expected.yaml", &path, bytes);
    });
}

/// The bytes as the table of a study's points.
pub(super) fn points(bytes: &[u8]) {
    STUDY.with(|folder| {
        let path = folder.write("points.csv", bytes);
        load(folder, "workflow-points.yaml", &path, bytes);
    });
}

/// The bytes as a scene. One that `plan` finds sound can be read by plugins, and what they would write is the same scene.
pub(super) fn scene(bytes: &[u8]) {
    STUDY.with(|folder| {
        let path = folder.write("scene.yaml", bytes);
        match check_part(&path, &*CATALOG) {
            None => {}
            Some(Err(found)) => judge(&found, &path, bytes),
            Some(Ok(Part::Material)) => {}
            Some(Ok(Part::Scene)) => in_a_workflow(folder),
        }
    });
}

fn in_a_workflow(folder: &Folder) {
    let workflow = folder.path("workflow.yaml");
    // The step may want of a scene more than that it is one.
    let Ok(found) = load_with(&workflow, &*CATALOG, &[]) else {
        return;
    };
    let given = &found.steps[0].parameters["scene"];
    let typed = || Scene::from_json(given.clone());
    let scene = typed().unwrap_or_else(|e| panic!("plan passes what a plugin refuses: {e}"));
    let written = serde_json::to_value(&scene).expect("a scene is JSON");
    let again = Scene::from_json(written).expect("a scene that was written");
    assert_eq!(again, scene, "written and read as another scene");
}

/// The bytes as a material.
pub(super) fn material(bytes: &[u8]) {
    STUDY.with(|folder| {
        let path = folder.write("materials/fabric.yaml", bytes);
        if let Some(Err(found)) = check_part(&path, &*CATALOG) {
            judge(&found, &path, bytes);
        }
    });
}

/// The bytes as parameters of the command line, one a line.
pub(super) fn overrides(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let mut all: Vec<Override> = Vec::new();
    for line in text.lines() {
        match line.parse() {
            Ok(read) => all.push(read),
            Err(e) => {
                let e: plyflow_workflow::OverrideError = e;
                assert!(!e.to_string().trim().is_empty());
            }
        }
    }
    STUDY.with(|folder| {
        let path = folder.path("workflow.yaml");
        if let Err(found) = load_with(&path, &*CATALOG, &all) {
            judge(&found, Utf8Path::new(""), b"");
        }
    });
}
