//! What went into a made-up run, as its page tells it.

mod common;

use camino::{Utf8Path, Utf8PathBuf};
use common::{Study, whole, whole_study};
use plyflow_report::{ReportInput, write_report};
use serde_json::{Value, json};

fn folder() -> (tempfile::TempDir, Utf8PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let path = Utf8PathBuf::from_path_buf(dir.path().to_owned()).unwrap();
    (dir, path)
}

/// The part of the page that tells what went in; `None`: there is none.
fn inputs(input: &ReportInput, folder: &Utf8Path) -> Option<String> {
    let out = folder.join("report.html");
    write_report(input, &out).unwrap();
    let page = std::fs::read_to_string(&out).unwrap();
    let from = page.find("<section id=\"inputs\">")?;
    let length = page[from..].find("</section>").unwrap();
    Some(page[from..from + length].to_owned())
}

#[test]
fn plies_materials_friction_process_and_tool_are_told_as_the_run_had_them() {
    let (_keep, folder) = folder();
    let told = inputs(&whole(&folder), &folder).unwrap();
    for text in [
        // The ply book, drawn once for plies that are alike, with their dimensions.
        "<figcaption>ply_1, ply_2</figcaption>",
        "240 × 160 mm",
        ">1: -45 deg</text>",
        ">2: 45 deg</text>",
        "440 g/m²",
        // The material with a law of this program as curves, that of somebody else by its numbers.
        "Material Made-up fabric",
        "Source: nobody &lt;knows&gt;",
        "Modulus along the fibres: 3 GPa",
        "normalised force (N/m)",
        "moment per width (N)",
        "Material Another law",
        "&quot;modulus&quot;: 12.5",
        // Friction, by number and by law.
        "<th>fabric on fabric</th><td>0.35</td>",
        "0.2 (p / 10 kPa)^-0.1",
        // The process over the times of the history, with its phases.
        "double-diaphragm forming",
        ">lowering</text>",
        "pressure on the bag (kPa)",
        "forming pressure 90 kPa",
        "films stretched by 1 % before",
        // The tool: its size from its mesh, its words from the scene.
        "320 mm along x",
        "<span>radius</span> <b>60 mm</b>",
    ] {
        assert!(told.contains(text), "{text} is not in {told}");
    }
    // One scene for all runs: one set of inputs.
    assert_eq!(told.matches("<h4>Ply book</h4>").count(), 1);
}

#[test]
fn an_artifact_that_tells_no_scene_has_its_stack_and_its_tool_alone() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.scene = Value::Null;
    study.forming("coarse", None, 0.008);
    let told = inputs(&study.input(), &folder).unwrap();
    assert!(told.contains("<th>ply_2</th>") && told.contains("mm along x"));
    for text in ["Friction", "Process", "Material Made-up"] {
        assert!(!told.contains(text), "{text}");
    }
    let mut coupon = Study::new(&folder);
    coupon.coupon();
    assert_eq!(
        inputs(&coupon.input(), &folder),
        None,
        "a coupon has no scene"
    );
}

#[test]
fn runs_of_two_scenes_have_two_sets_of_inputs_and_press_and_holder_are_told_in_words() {
    let (_keep, folder) = folder();
    let mut study = whole_study(&folder);
    study.scene["process"] = json!({"press": {"stroke": "0.05 m", "forming_time": "0.5 s", "settling_time": "0.05 s",
        "die": {"opening_radius": "0.051 m", "edge_radius": "0.006 m"}, "holder": {"hold": {"force": "250 N"}}}});
    study.forming("other", None, 0.008);
    let told = inputs(&study.input(), &folder).unwrap();
    assert_eq!(told.matches("<h4>Ply book</h4>").count(), 2);
    assert!(told.contains("Of coarse") && told.contains("Of other"));
    assert!(told.contains("stroke 50 mm; die with an opening of 51 mm radius and an edge of 6 mm; blank holder with 250 N"));
}
