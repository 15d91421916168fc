//! Steered fibres in a scene: a table is as if its points stood there, and what is wrong in it is told where it stands.

mod common;

use common::{Study, catalog, step};
use plyflow_model::manifest::Shape;
use plyflow_workflow::resolve;

const STRAIGHT: &str = "    fibre_1: 45 deg\n    fibre_2: -45 deg\n";

const NAMED: &str = "    fibre_1: {table: {file: layup/steered.csv}}\n";

const TABLE: &str = "# placed on machine 2
x [mm],y [mm],angle,note
-240,-150,0,begin
240.1,-150,20,
240,150,40 deg,
-240,15 cm,0.25 rad,
";

const LISTED: &str = "    fibre_1:
      points:
        - {x: -240 mm, y: -150 mm, angle: 0 deg}
        - {x: 240.1 mm, y: -150 mm, angle: 20 deg}
        - {x: 240 mm, y: 150 mm, angle: 40 deg}
        - {x: -240 mm, y: 15 cm, angle: 0.25 rad}
";

fn study(fibres: &str) -> Study {
    let study = Study::sound();
    study.mutate("scene.yaml", STRAIGHT, fibres);
    std::fs::create_dir(study.path("layup")).unwrap();
    study.write("layup/steered.csv", TABLE);
    study
}

#[test]
fn a_table_is_the_scene_that_lists_its_points_to_the_last_bit() {
    let [table, listed] = [NAMED, LISTED].map(|fibres| {
        let found = study(fibres).load();
        found.unwrap_or_else(|e| panic!("{}", e.render(false)))
    });
    let [a, b] = [&table, &listed].map(|w| &step(w, "coarse").parameters);
    assert_eq!(a, b);
    let sheet = &a["scene"]["sheets"][1];
    assert_eq!(sheet["fibre_1"]["points"][1]["x"], "0.2401 m");
    assert!(sheet["fibre_2"].is_null());
}

#[test]
fn directions_and_places_of_a_table_count_and_its_notes_do_not() {
    let study = study(NAMED);
    let file = study.path("workflow.yaml");
    let now = || resolve(&file, &catalog(), &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let scene =
        |r: &plyflow_workflow::Resolution| step(&r.workflow, "coarse").parameters["scene"].clone();
    let first = now();
    study.mutate("layup/steered.csv", "begin", "end");
    assert!(!first.evidence.holds(&catalog()), "the table is read again");
    assert_eq!(scene(&now()), scene(&first));
    for (from, to) in [("40 deg", "41 deg"), ("240.1", "240.2")] {
        let before = now();
        study.mutate("layup/steered.csv", from, to);
        assert!(!before.evidence.holds(&catalog()), "{from}");
        assert_ne!(scene(&now()), scene(&before), "{from}");
    }
}

#[test]
fn what_is_wrong_in_a_table_is_told_in_its_line_and_column() {
    let mut missed = Vec::new();
    for (name, from, to, says) in [
        (
            "layup/steered.csv",
            "0,begin",
            "steep,",
            "steered.csv:3:11: `angle` is `steep`, which is no angle",
        ),
        (
            "layup/steered.csv",
            "x [mm]",
            "x",
            "steered.csv:3:1: `x` is `-240`, without a unit",
        ),
        (
            "layup/steered.csv",
            "angle,",
            "angel,",
            "steered.csv:2:15: there is no column `angel`",
        ),
        (
            "layup/steered.csv",
            "240,150,",
            ",150,",
            "steered.csv:5:1: the point has no `x`",
        ),
        (
            "layup/steered.csv",
            "240,150,",
            "-240,-150,",
            "steered.csv:5:1: there are two points at (-240, -150) mm",
        ),
        // Where the ply lies, fibres turn by 100 degrees between two neighbours.
        (
            "layup/steered.csv",
            "40 deg",
            "100 deg",
            "steered.csv:5:9: fibres turn by 80 deg between neighbouring points",
        ),
        (
            "scene.yaml",
            "steered.csv",
            "steered.cvs",
            "cannot read `layup/steered.cvs`: there is no such file",
        ),
        (
            "scene.yaml",
            "{file:",
            "{fiel:",
            "unknown key `fiel` in `table`",
        ),
        (
            "scene.yaml",
            "csv}}",
            "csv, unit: 3 mm}}",
            "the places of a table cannot be in units of 0.003 m",
        ),
        (
            "scene.yaml",
            "csv}}",
            "csv}}\n    fibre_2: 90 deg",
            "`fibre_2` stands beside steered fibres",
        ),
        (
            "scene.yaml",
            "fibre_1: {table",
            "fibre_1: {tabel",
            "unknown key `tabel` in `fibre_1`",
        ),
        (
            "scene.yaml",
            "friction:",
            "symmetry: [x]\nfriction:",
            "the fibres of sheet `ply-1` are steered",
        ),
    ] {
        let study = study(NAMED);
        study.mutate(name, from, to);
        let told = match study.load() {
            Ok(_) => "nothing was found".to_owned(),
            Err(found) => found.to_string(),
        };
        if !told.contains(says) {
            missed.push(format!("{from} -> {to}: {says}\n{told}"));
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n\n"));
    // Of an angle as before: what it is, and what is expected.
    let study = study("    fibre_1: 45\n    fibre_2: -45 deg\n");
    let told = study.load().unwrap_err().to_string();
    assert!(
        told.contains("`fibre_1`") && told.contains("an angle such as"),
        "{told}"
    );
}

#[test]
fn a_step_that_cannot_steer_says_so_where_the_table_is_named() {
    let mut plugins = catalog();
    let forming = plugins.0.iter_mut().find(|m| m.name == "forming-explicit");
    let scene = forming.unwrap().parameters.get_mut("scene").unwrap();
    scene.shape = Shape::Scene {
        straight_fibres: true,
    };
    let told = |fibres: &str| {
        let study = study(fibres);
        let found = resolve(&study.path("workflow.yaml"), &plugins, &[]);
        found.map(|_| ()).map_err(|e| e.to_string())
    };
    for fibres in [NAMED, LISTED] {
        let text = told(fibres).unwrap_err();
        assert!(
            text.contains("scene.yaml:")
                && text.contains(
                    "the fibres of ply `ply-1` are steered, which this step cannot compute"
                ),
            "{text}"
        );
    }
    assert_eq!(told(STRAIGHT), Ok(()));
}
