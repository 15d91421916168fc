//! `plyflow new`, with all plugins beside the program: names that are theirs, and a folder that builds and is valid.

use plyflow_e2e::program;
use std::path::Path;
use std::process::{Command, Output, Stdio};

fn plyflow(folder: &Path, words: &[&str]) -> Output {
    let mut command = Command::new(program());
    command.args(words).current_dir(folder).stdin(Stdio::null());
    command.output().expect("plyflow starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_name_of_a_plugin_that_comes_along_is_refused_and_nothing_is_made() {
    let dir = tempfile::tempdir().unwrap();
    for (kind, name) in [
        ("element", "m4"),
        ("material", "fabric-linear"),
        ("step", "forming-explicit"),
        // Two plugins of one name are never both meant, whatever their kinds.
        ("step", "rf4"),
    ] {
        let output = plyflow(dir.path(), &["new", kind, name, "--c"]);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(
            said.contains(&format!("choose another, such as `my-{name}`")),
            "{said}"
        );
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn a_new_step_in_c_builds_and_its_workflow_is_valid() {
    let dir = tempfile::tempdir().unwrap();
    let made = plyflow(
        dir.path(),
        &["new", "step", "count-sheared", "--c", "--into", "a/b"],
    );
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    assert!(text(&made.stdout).contains("\n  cd a/b/count-sheared\n"));
    let folder = dir.path().join("a/b/count-sheared");
    let built = Command::new("make")
        .arg("--silent")
        .current_dir(&folder)
        .status()
        .expect("make and a C compiler are needed for this test");
    assert!(built.success());
    let valid = plyflow(&folder, &["validate", "workflow.yaml", "--trust"]);
    assert_eq!(valid.status.code(), Some(0), "{}", text(&valid.stderr));
    let shown = plyflow(&folder, &["plugins", "--trust", "./libcount_sheared.so"]);
    let shown = text(&shown.stdout);
    assert!(shown.starts_with("count-sheared 0.1.0 (step"), "{shown}");
}

/// The STL file of a block of 300 x 120 x 40 mm with leaning walls, in the coordinates of an aircraft: mm, up along y, 12 m off.
fn far_block() -> String {
    let corner = |k: usize, high: bool| {
        let (x, y) = ([-1.0, 1.0, 1.0, -1.0][k % 4], [-1.0, -1.0, 1.0, 1.0][k % 4]);
        let (by, up) = if high { (8.0, 40.0) } else { (0.0, 0.0) };
        [
            12_000.0 + x * (150.0 - by),
            900.0 + up,
            4_000.0 - y * (60.0 - by),
        ]
    };
    let (low, high) = (|k: usize| corner(k, false), |k: usize| corner(k, true));
    let mut facets = vec![
        [high(0), high(1), high(2)],
        [high(0), high(2), high(3)],
        [low(0), low(2), low(1)],
        [low(0), low(3), low(2)],
    ];
    for k in 0..4 {
        facets.extend([
            [low(k), low(k + 1), high(k + 1)],
            [low(k), high(k + 1), high(k)],
        ]);
    }
    let mut text = String::from("solid block\n");
    for facet in facets {
        text += "facet normal 0 0 0\nouter loop\n";
        for [x, y, z] in facet {
            text += &format!("vertex {x} {y} {z}\n");
        }
        text += "endloop\nendfacet\n";
    }
    text + "endsolid block\n"
}

#[test]
fn a_new_study_of_a_tool_in_aircraft_coordinates_is_valid_and_is_draped() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("block.stl"), far_block()).unwrap();
    let words = [
        "new",
        "study",
        "my-part",
        "--tool",
        "block.stl",
        "--unit",
        "mm",
        "--ply",
        "320 x 160 mm",
        "--material",
        "woven-38616",
        "--angles",
        "45,0",
    ];
    let made = plyflow(dir.path(), &words);
    assert_eq!(made.status.code(), Some(0), "{}", text(&made.stderr));
    assert!(text(&made.stdout).contains("`up: +y, centre: auto, foot: auto`"));
    let folder = dir.path().join("my-part");
    let draped = plyflow(
        &folder,
        &["run", "workflow.yaml", "--until", "drape", "--no-report"],
    );
    let said = text(&draped.stderr);
    assert_eq!(draped.status.code(), Some(0), "{said}");
    let line = said.lines().find(|l| l.starts_with("finish   drape in "));
    assert!(
        line.is_some_and(|l| l.contains(": shear_max ") && l.contains(" deg, ")),
        "{said}"
    );
    let results = plyflow(&folder, &["results", "workflow.yaml", "--format", "json"]);
    let results = text(&results.stdout);
    assert!(results.contains("\"coverage\""), "{results}");

    let again = plyflow(dir.path(), &words);
    assert_eq!(again.status.code(), Some(2));
    assert!(text(&again.stderr).contains("nothing in it is overwritten"));
    let none = plyflow(
        dir.path(),
        &["new", "study", "other", "--tool", "block.stl"],
    );
    assert_eq!(none.status.code(), Some(2));
    let said = text(&none.stderr);
    assert!(
        said.contains("--unit UNIT, --ply SIZE, --dxf FILE or --plies BOOK, --material NAME|FILE")
            && said.contains("mm in ft"),
        "{said}"
    );
    assert!(!dir.path().join("other").exists());
    let step = plyflow(
        dir.path(),
        &["new", "step", "mine", "--c", "--ply", "1 x 1 m"],
    );
    assert!(text(&step.stderr).contains("--ply is for a study"));
}
