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
fn a_single_film_is_told_with_its_frame_and_absolute_pressures() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    study.scene["process"] = json!({"single_diaphragm": {
        "frame_length": "0.29 m", "frame_width": "0.21 m", "clearance": "0.005 m", "forming_pressure": "90000 Pa", "surroundings": "100000 Pa",
        "stretching_time": "0.08 s", "lowering_time": "0.3 s", "drawing_time": "0.4 s", "settling_time": "0.04 s", "film_pre_stretch": 0.01,
        "bed": false, "frame_height": "0.01 m", "weight": "tool"}});
    study.forming("coarse", None, 0.008);
    let told = inputs(&study.input(), &folder).unwrap();
    for text in [
        "single-diaphragm forming",
        ">stretching</text>",
        "height of the frame (mm)",
        "Pressures are absolute.",
        "forming pressure 90 kPa",
        "surroundings at 100 kPa",
        "no bed, the frame ends at z = 10 mm",
        "weight towards the tool",
    ] {
        assert!(told.contains(text), "{text} is not in {told}");
    }
    assert!(!told.contains("bag pressure"), "{told}");
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

#[test]
fn ways_and_forces_of_the_parts_of_a_stamping_are_drawn_over_time() {
    let (_keep, folder) = folder();
    let mut study = Study::new(&folder);
    let flat = json!({"flat": {"length": "0.2 m", "width": "0.1 m", "height": "0.01 m", "fillet": "0.002 m", "facet_size": "0.01 m"}});
    study.scene["process"] = json!({"stamping": {"forming_time": "0.8 s", "settling_time": "0.2 s", "parts": [
        {"name": "punch", "side": "above", "tool": flat.clone(), "motion": {"table": [{"time": "0 s", "way": "0.03 m"}, {"time": "0.8 s", "way": "0 m"}]}},
        {"name": "holder", "side": "below", "tool": flat, "motion": {"pressed": {"force": "40 N"}}}]}});
    // The scene's tool stands still and is pressed on by nothing.
    study.parts = vec![("punch", 250.0), ("holder", 40.0)];
    study.forming("coarse", None, 0.008);
    let told = inputs(&study.input(), &folder).unwrap();
    for name in [
        "punch: way (mm)",
        "punch: force (N), at the right",
        "holder: way (mm)",
        "holder: force (N), at the right",
    ] {
        assert!(
            told.contains(&format!("</svg> {name}")),
            "{name} is not in {told}"
        );
    }
    assert!(!told.contains("tool: way"));
    // Four curves, each of a line that goes on to its end.
    let from = told.find("aria-label=\"Process over time").unwrap();
    let diagram = &told[from..from + told[from..].find("</svg>").unwrap()];
    let paths: Vec<&str> = diagram.split("<path class=\"line c").skip(1).collect();
    assert_eq!(paths.len(), 4);
    let ends = |path: &str| -> [[f64; 2]; 2] {
        let d = path
            .split("d=\"")
            .nth(1)
            .unwrap()
            .split('"')
            .next()
            .unwrap();
        let place = |s: &str| {
            let mut n = s.trim().split([' ', ',']).map(|n| n.parse().unwrap());
            [n.next().unwrap(), n.next().unwrap()]
        };
        let all: Vec<[f64; 2]> = d
            .split(['M', 'L'])
            .filter(|s| !s.is_empty())
            .map(place)
            .collect();
        [all[0], all[all.len() - 1]]
    };
    let [[_, open], [_, closed]] = ends(paths[0]);
    let [[_, bare], [_, pressed]] = ends(paths[1]);
    assert!(open < closed, "the way falls: the picture's y counts down");
    assert!(bare > pressed, "the force grows");
    // Both parts close alike, and the holder's force at the end is 40 of 250 of the punch's, on one axis.
    assert_eq!(ends(paths[2]), ends(paths[0]));
    let [[_, from], [_, to]] = ends(paths[3]);
    let share = (from - to) / (bare - pressed);
    assert!((share - 40.0 / 250.0).abs() < 0.01, "{share}");
}
