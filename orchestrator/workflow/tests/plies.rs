//! Ply books and drawn outlines in a scene: what they say is as if it stood there, and what is wrong in them is told where it stands.

mod common;

use common::{Study, catalog, step};
use plyflow_workflow::resolve;

const PLY: &str = "  - name: ply-1\n    kind: ply\n    material: materials/fabric.yaml\n    length: 480 mm\n    width: 300 mm\n    fibre_1: 45 deg\n    fibre_2: -45 deg\n";

const BOOK: &str = "# the layup
name,material,angle,outline,layer,x [mm],y [mm],rotation,tied,note
ply-1,fabric,45,skin.dxf,PLY,10,-5,,,first
ply-2,../materials/fabric.yaml,-45 deg,cap.csv,,,1 cm,90,yes,
ply-3,,0,,,12.5,,,,\"a, b\"
";

const ENTRY: &str = "  - plies:
      book: layup/plies.csv
      material: {file: materials/fabric.yaml, with: {shear: 90 N/m}}
      materials: {fabric: materials/fabric.yaml}
      length: 480 mm
      width: 300 mm
";

/// What the entry with the book comes to.
const LISTED: &str = "  - name: ply-1
    kind: ply
    material: materials/fabric.yaml
    outline: [[0 mm, 0 mm], [200.1 mm, 0 mm], [200.1 mm, 100 mm], [0 mm, 100 mm]]
    holes: [[[50 mm, 50 mm], [60 mm, 50 mm], [60 mm, 60 mm]]]
    centre: [10 mm, -5 mm]
    fibre_1: 45 deg
    fibre_2: 135 deg
  - name: ply-2
    kind: ply
    material: materials/fabric.yaml
    outline: [[0 mm, 0 mm], [0 mm, 30.3 mm], [-20 mm, 0 mm]]
    centre: [0 mm, 10 mm]
    fibre_1: -45 deg
    fibre_2: 45 deg
    tied: true
  - name: ply-3
    kind: ply
    material: {file: materials/fabric.yaml, with: {shear: 90 N/m}}
    length: 480 mm
    width: 300 mm
    centre: [12.5 mm, 0 mm]
    fibre_1: 0 deg
    fibre_2: 90 deg
";

fn drawing() -> String {
    let words = "0 SECTION 2 HEADER 9 $INSUNITS 70 4 0 ENDSEC 0 SECTION 2 ENTITIES \
                 0 LWPOLYLINE 8 PLY 70 1 10 0 20 0 10 200.1 20 0 10 200.1 20 100 10 0 20 100 \
                 0 LWPOLYLINE 8 PLY 70 1 10 50 20 50 10 60 20 50 10 60 20 60 \
                 0 LINE 8 NOTES 10 0 20 0 11 1 21 1 0 ENDSEC 0 EOF";
    words.replace(' ', "\n") + "\n"
}

/// The sound study with other plies, and the files of a book.
fn study(plies: &str) -> Study {
    let study = Study::sound();
    study.mutate("scene.yaml", PLY, plies);
    std::fs::create_dir(study.path("layup")).unwrap();
    study.write("layup/plies.csv", BOOK);
    study.write("layup/skin.dxf", &drawing());
    study.write("layup/cap.csv", "x [mm],y [mm]\n0,0\n30.3,0\n0,20\n");
    study
}

fn told(study: &Study) -> String {
    let found = study.load().expect_err("nothing was found");
    found.to_string()
}

#[test]
fn a_book_is_the_scene_that_lists_its_plies_to_the_last_bit() {
    let [book, listed] = [ENTRY, LISTED].map(|plies| {
        let found = study(plies).load();
        found.unwrap_or_else(|e| panic!("{}", e.render(false)))
    });
    for name in ["coarse", "local"] {
        let [a, b] = [&book, &listed].map(|w| step(w, name));
        assert_eq!(a.parameters, b.parameters);
        assert_eq!((&a.components, &a.files), (&b.components, &b.files));
    }
}

#[test]
fn a_book_has_one_angle_and_the_material_says_where_the_second_family_lies() {
    let crossed = |study: Study| {
        study.mutate(
            "materials/fabric.yaml",
            "fibre_modulus:",
            "crossing: 60 deg\n  fibre_modulus:",
        );
        study
    };
    let listed = LISTED
        .replace("fibre_2: 135 deg", "fibre_2: 105 deg")
        .replace(
            "fibre_1: -45 deg\n    fibre_2: 45 deg",
            "fibre_1: -45 deg\n    fibre_2: 15 deg",
        )
        .replace("fibre_2: 90 deg", "fibre_2: 60 deg");
    let [book, listed] = [ENTRY, &listed].map(|plies| {
        let found = crossed(study(plies)).load();
        found.unwrap_or_else(|e| panic!("{}", e.render(false)))
    });
    let [a, b] = [&book, &listed].map(|w| step(w, "coarse"));
    assert_eq!(a.parameters, b.parameters);
    // A scene that says both says it wrong, in its line.
    let told = told(&crossed(study(LISTED)));
    for part in [
        "`fibre_2` lies 90 deg counter-clockwise",
        "cross at 60 deg",
        "`fibre_2: 105 deg`",
        "scene.yaml",
    ] {
        assert!(told.contains(part), "'{part}' in: {told}");
    }
}

#[test]
fn all_plies_are_moved_and_those_without_an_outline_are_turned() {
    let centred = ENTRY.to_owned() + "      centre: [-100 mm, 1 mm]\n";
    let moved = study(&centred);
    moved.mutate("layup/plies.csv", "12.5,,,", "12.5,,30,");
    let found = moved
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let sheets = &step(&found, "coarse").parameters["scene"]["sheets"];
    assert_eq!(
        sheets[1]["centre"],
        serde_json::json!(["-0.09 m", "-0.004 m"])
    );
    assert_eq!(
        sheets[2]["centre"],
        serde_json::json!(["-0.1 m", "0.011 m"])
    );
    let corner: Vec<f64> = (0..2)
        .map(|k| {
            let text = sheets[3]["outline"][2][k].as_str().unwrap();
            text.trim_end_matches(" m").parse().unwrap()
        })
        .collect();
    // (240, 150) mm turned by 30 deg.
    let (s, c) = (0.5, 0.75_f64.sqrt());
    assert!(
        (corner[0] - (c * 0.24 - s * 0.15)).abs() < 1e-15,
        "{corner:?}"
    );
    assert!(
        (corner[1] - (s * 0.24 + c * 0.15)).abs() < 1e-15,
        "{corner:?}"
    );
    assert!(sheets[3]["length"].is_null());
}

#[test]
fn what_outlines_and_books_say_counts_and_what_they_say_to_readers_does_not() {
    let study = study(ENTRY);
    let file = study.path("workflow.yaml");
    let now = || resolve(&file, &catalog(), &[]).unwrap_or_else(|e| panic!("{}", e.render(false)));
    let first = now();
    let scene =
        |r: &plyflow_workflow::Resolution| step(&r.workflow, "coarse").parameters["scene"].clone();
    assert!(first.evidence.holds(&catalog()));
    study.mutate("layup/plies.csv", "first", "the first of three");
    assert!(!first.evidence.holds(&catalog()), "the book is read again");
    assert_eq!(scene(&now()), scene(&first));
    for (name, from, to) in [
        ("layup/plies.csv", ",45,", ",46,"),
        ("layup/skin.dxf", "200.1", "200.2"),
        ("layup/cap.csv", "30.3", "30.4"),
        ("materials/fabric.yaml", "3 GPa", "4 GPa"),
    ] {
        let before = now();
        study.mutate(name, from, to);
        assert!(!before.evidence.holds(&catalog()), "{name}");
        assert_ne!(scene(&now()), scene(&before), "{name}");
    }
}

#[test]
fn what_is_wrong_in_a_book_is_told_in_its_line_and_column() {
    let mut missed = Vec::new();
    for (name, from, to, says) in [
        (
            "layup/plies.csv",
            ",45,",
            ",steep,",
            "plies.csv:3:14: `angle` is `steep`, which is no angle",
        ),
        (
            "layup/plies.csv",
            "note",
            "colour",
            "plies.csv:2:63: there is no column `colour`",
        ),
        (
            "layup/plies.csv",
            ",10,-5",
            ",10 kg,-5",
            "plies.csv:3:30: `x`:",
        ),
        (
            "layup/plies.csv",
            "ply-2,",
            "ply-1,",
            "plies.csv:4:1: the name `ply-1` is taken, by the ply in line 3",
        ),
        (
            "layup/plies.csv",
            "ply-2,",
            "tool,",
            "plies.csv:4:1: the name `tool` is taken",
        ),
        (
            "layup/plies.csv",
            "ply-2,",
            "a ply,",
            "plies.csv:4:1: `a ply` cannot name a body",
        ),
        (
            "layup/plies.csv",
            "ply-1,fabric",
            "ply-1,wool",
            "plies.csv:3:7: there is no material `wool`",
        ),
        (
            "layup/plies.csv",
            "cap.csv",
            "cup.csv",
            "plies.csv:4:40: cannot read `layup/cup.csv`: there is no such file",
        ),
        (
            "layup/plies.csv",
            ",PLY,",
            ",GONE,",
            "plies.csv:3:17: `layup/skin.dxf`: there is no curve on the layer `GONE`",
        ),
        (
            "layup/plies.csv",
            ",PLY,",
            ",,",
            "plies.csv:3:17: `layup/skin.dxf`: curves lie on 2 layers: `NOTES`, `PLY`",
        ),
        (
            "layup/skin.dxf",
            "$INSUNITS\n70\n4",
            "$INSUNITS\n70\n0",
            "plies.csv:3:17: `layup/skin.dxf`: the drawing does not say what its unit is",
        ),
        (
            "layup/skin.dxf",
            "200.1\n20\n100",
            "x\n20\n100",
            "skin.dxf:30:1: `x` is no number",
        ),
        (
            "layup/cap.csv",
            "30.3",
            "far",
            "cap.csv:3:1: `x` is `far`, which is no length",
        ),
        (
            "layup/cap.csv",
            "30.3,0\n",
            "0,0\n",
            "cap.csv:2:1: the contour that begins here",
        ),
        (
            "scene.yaml",
            "      length: 480 mm\n      width: 300 mm\n",
            "",
            "plies.csv:5:1: the ply `ply-3` has no outline",
        ),
        (
            "scene.yaml",
            "      material: {file: materials/fabric.yaml, with: {shear: 90 N/m}}\n",
            "",
            "plies.csv:5:1: the ply `ply-3` has no material",
        ),
        (
            "scene.yaml",
            "      width: 300 mm\n",
            "",
            "plies.csv:5:1: a ply needs `width`",
        ),
        (
            "scene.yaml",
            "plies.csv",
            "plies.cvs",
            "cannot read `layup/plies.cvs`: there is no such file",
        ),
        (
            "scene.yaml",
            "      length: 480 mm",
            "      lenght: 480 mm",
            "unknown key `lenght` in `plies`",
        ),
    ] {
        let study = study(ENTRY);
        study.mutate(name, from, to);
        let told = told(&study);
        if !told.contains(says) {
            missed.push(format!("{from} -> {to}: {says}\n{told}"));
        }
    }
    assert!(missed.is_empty(), "{}", missed.join("\n\n"));
    // Everything at once, and nothing twice for the two steps that form the scene.
    let study = study(ENTRY);
    study.mutate("layup/plies.csv", ",45,", ",steep,");
    study.mutate("layup/plies.csv", ",90,", ",turned,");
    let found = study.load().unwrap_err();
    assert_eq!(found.items.len(), 2, "{found}");
}

#[test]
fn an_outline_of_a_drawing_brings_its_holes_and_other_contours_have_none() {
    let drawn = "  - name: ply-1\n    kind: ply\n    material: materials/fabric.yaml\n    outline: {drawing: {file: layup/skin.dxf, layer: ply, centred: true}}\n    fibre_1: 0 deg\n    fibre_2: 90 deg\n";
    let found = study(drawn)
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let ply = &step(&found, "coarse").parameters["scene"]["sheets"][1];
    assert_eq!(
        ply["outline"][0],
        serde_json::json!(["-0.10005 m", "-0.05 m"])
    );
    assert_eq!(ply["holes"].as_array().map(Vec::len), Some(1));

    let region = drawn.to_owned()
        + "    regions:\n      - {name: slippery, polygon: {drawing: {file: layup/cap.csv}}, friction: {all: 0.1}}\n";
    let found = study(&region)
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let region_of = &step(&found, "coarse").parameters["scene"]["sheets"][1]["regions"][0];
    assert_eq!(region_of["polygon"].as_array().map(Vec::len), Some(3));

    let holed = region.replace("layup/cap.csv", "layup/skin.dxf, layer: PLY");
    assert!(told(&study(&holed)).contains("the drawing has 1 contours inside of the largest one"));
    let film = ENTRY.replace(
        "      length: 480 mm\n      width: 300 mm\n",
        "      outline: {drawing: {file: layup/cap.csv}}\n",
    );
    let found = study(&film)
        .load()
        .unwrap_or_else(|e| panic!("{}", e.render(false)));
    let ply = &step(&found, "coarse").parameters["scene"]["sheets"][3];
    assert_eq!(ply["outline"].as_array().map(Vec::len), Some(3));

    // A limit has corners of its own.
    let limit = study(PLY);
    limit.mutate(
        "workflow.yaml",
        "rectangle: {length: 100 mm, width: 50 mm}",
        "polygon: {drawing: {file: layup/cap.csv}}",
    );
    let told = told(&limit);
    assert!(
        told.contains("the polygon of a limit cannot come from a drawing"),
        "{told}"
    );
}
