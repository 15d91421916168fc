//! Files of another format than the one wanted, and what the command line sets.

mod common;

use common::Study;
use plyflow_workflow::Diagnostics;

const W: &str = "workflow.yaml";
const S: &str = "scene.yaml";
const F: &str = "materials/fabric.yaml";

fn findings(study: &Study) -> Diagnostics {
    match study.load() {
        Ok(_) => panic!("nothing was found"),
        Err(d) => d,
    }
}

#[test]
fn a_scene_or_a_material_in_the_place_of_a_workflow_is_one_error() {
    let study = Study::with_expected_file();
    for (file, says) in [
        (S, "this is a scene (`plyflow_scene`), not a workflow"),
        (F, "this is a material (`plyflow_material`), not a workflow"),
        (
            "expected.json",
            "this is a file of expectations (`plyflow_expected`), not a workflow",
        ),
    ] {
        let found = plyflow_workflow::load(&study.path(file), &common::catalog()).unwrap_err();
        assert_eq!(found.items.len(), 1, "{}", found.render(false));
        let told = found.to_string();
        assert!(
            told.contains(says) && told.contains("give the workflow"),
            "{told}"
        );
    }
    // In the place of a scene and of a material too.
    study.mutate(W, "scene: scene.yaml", "scene: film.yaml");
    let found = findings(&study);
    assert_eq!(found.items.len(), 1, "{}", found.render(false));
    assert!(
        found
            .to_string()
            .contains("a material (`plyflow_material`), not a scene"),
        "{found}"
    );
    let study = Study::sound();
    study.mutate(S, "material: film.yaml", "material: workflow.yaml");
    let found = findings(&study);
    assert_eq!(found.items.len(), 1, "{}", found.render(false));
    assert!(
        found
            .to_string()
            .contains("a workflow (`plyflow`), not a material"),
        "{found}"
    );
}

#[test]
fn a_list_that_the_plugin_would_refuse_when_it_runs_is_refused_before() {
    let told = |list: &str| {
        let study = Study::sound();
        study.mutate(
            W,
            "damping: 0.1",
            &format!("damping: 0.1\n      curve: {list}"),
        );
        study.load().err().map(|found| found.to_string())
    };
    assert_eq!(told("[0 deg, 5 deg, 0.2 rad]"), None);
    for (list, says) in [
        ("[0 deg]", &["`curve` has 1 item", "2 to 4 items"][..]),
        (
            "[0 deg, 1 deg, 2 deg, 3 deg, 4 deg]",
            &["`curve` has 5 items", "2 to 4 items"],
        ),
        // By the angles, not by their numbers.
        (
            "[0 deg, 0.2 rad, 5 deg]",
            &["`curve[2]`", "more than the item before it"],
        ),
        ("[0 deg, 1 deg, 1 deg]", &["`curve[2]`"]),
    ] {
        let told = told(list).unwrap_or_default();
        assert!(says.iter().all(|s| told.contains(s)), "{list}: {told}");
    }
}

#[test]
fn what_is_wrong_with_set_is_shown_in_its_own_text() {
    let study = Study::sound();
    for (set, place, says) in [
        (
            "coars.element_size=4 mm",
            1,
            &["no step `coars`", "did you mean `coarse`"][..],
        ),
        (
            "coarse.elementsize=4 mm",
            8,
            &[
                "`elementsize` is no parameter",
                "did you mean `element_size`",
            ],
        ),
        ("coarse.element_size=4", 21, &["`4` has no unit"]),
        // The short form of a component has nothing in it that could be set.
        (
            "coarse.element.with.hourglass=1",
            16,
            &[
                "`element` is",
                "no `with` in it",
                "--set 'coarse.element={..}'",
            ],
        ),
        // A path goes on into the scene's file, and by names into its lists.
        (
            "coarse.scene.friction.fabric_fabrik=0.1",
            23,
            &["unknown key `fabric_fabrik`", "`fabric_fabric`"],
        ),
        (
            "coarse.scene.sheets.ply_9.fibre_1=1 deg",
            21,
            &["no `ply_9` in the list `sheets`", "did you mean"],
        ),
        (
            "coarse.scene.sheets.ply-1.material.with.sheer=1 N/m",
            41,
            &["`sheer` is no parameter", "`shear`"],
        ),
        (
            "coarse.scene.sheets.ply-1.fibre_1=1 mm",
            35,
            &["`1 mm` is a length"],
        ),
        ("local.element_size=5,5 mm", 20, &["write `5.5 mm`"]),
        (
            "coarse.element={plugin: m4, with: {hourglas: 1}}",
            36,
            &["no parameter of `m4`"],
        ),
        (
            "coarse.probes=[{x: 1 mm}, {x: 2}]",
            31,
            &["`2` has no unit"],
        ),
    ] {
        let overrides = ["defects.over_shear_positive=9 deg", set].map(|t| t.parse().unwrap());
        let found = plyflow_workflow::load_with(&study.path(W), &common::catalog(), &overrides)
            .unwrap_err();
        assert_eq!(found.items.len(), 1, "{}", found.render(false));
        let told = found.to_string();
        assert!(
            told.starts_with(&format!("--set:1:{place}: "))
                && told.contains(&format!("(given by `--set {set}`)")),
            "{told}"
        );
        assert!(says.iter().all(|s| told.contains(s)), "{told}");
        // The text stands under the message, with a caret.
        let shown = found.render(false);
        assert!(
            shown.contains(&format!("[--set:1:{place}]")) && shown.contains(&format!("│ {set}")),
            "{shown}"
        );
    }
    // What an override leaves out is missing in the file.
    let set = ["local.damping=0.2".parse().unwrap()];
    study.mutate(W, ", element: rf4", "");
    let told = plyflow_workflow::load_with(&study.path(W), &common::catalog(), &set)
        .unwrap_err()
        .to_string();
    assert!(!told.contains("--set"), "{told}");
}

#[test]
fn a_scene_or_a_material_is_checked_by_itself() {
    use plyflow_workflow::{Part, check_part};
    let study = Study::sound();
    let check = |file: &str| check_part(&study.path(file), &common::catalog());
    assert_eq!(check("scene.yaml").unwrap().unwrap(), Part::Scene);
    let fabric = "materials/fabric.yaml";
    assert_eq!(check(fabric).unwrap().unwrap(), Part::Material);
    assert!(check(W).is_none());
    study.mutate(fabric, "fibre_modulus:", "fibre_modulos:");
    // Its own file, and the scene that names it.
    for file in [fabric, "scene.yaml"] {
        let told = check(file).unwrap().unwrap_err().to_string();
        assert!(told.contains("did you mean `fibre_modulus`"), "{told}");
    }
}
