//! Sections of a ply with a known wrinkle and bridge.

mod common;

use common::*;
use plyflow_defect_measurement::DefectMeasurement;
use plyflow_testing::{MemoryInput, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

/// About the blister, 15 mm from its middle, and beyond the plies.
#[test]
fn a_section_along_a_bend_has_the_heights_of_its_path_from_above_and_in_the_flat_ply() {
    let arc: Vec<Value> = (0..=60)
        .map(|k| PI * f64::from(k) / 60.0)
        .map(|a| json!([0.040 + 0.015 * a.cos(), 0.015 * a.sin()]))
        .collect();
    let mut beyond = arc.clone();
    beyond.push(json!([0.025, -0.2]));
    let mut run_off = formed();
    // The upper ply goes along x by 10 mm: its material is where it was, seen from above it is not.
    for p in &mut run_off.bodies[2].frames[0] {
        p[0] += 0.010;
    }
    let sections = json!([
        {"label": "above", "path": arc},
        {"label": "material", "path": arc, "on": "flat-ply"},
        {"label": "beyond", "path": beyond},
    ]);
    let inputs = [MemoryInput::new("formed", &run_off)];
    let out = run::<DefectMeasurement>(json!({"sections": sections}), &inputs, &[]).unwrap();
    let line = |section: usize, body: &str| {
        let array = |what: &str| {
            let path = format!("sections/section_{section}/{body}/{what}");
            out.arrays[&path].1.clone()
        };
        (array("station"), array("height"))
    };
    let (low, top) = (TOP + OFFSET, TOP + OFFSET + THICKNESS);
    let near = |found: &[f64], height: &dyn Fn(usize) -> f64| {
        let off = |(k, z): (usize, &f64)| (z - height(k)).abs();
        found.iter().enumerate().map(off).fold(0.0, f64::max)
    };
    for section in [0, 1] {
        for (body, z) in [("tool", TOP), ("ply_1", low)] {
            let (s, found) = line(section, body);
            assert!(near(&found, &|_| z) < 1e-9, "{body}");
            assert!(s[0].abs() < 1e-9 && (s[s.len() - 1] - 0.015 * PI).abs() < 1e-4);
        }
    }
    let at = |a: f64| [0.040 + 0.015 * a.cos(), 0.015 * a.sin()];
    let (s, found) = line(1, "ply_2");
    let blister = 0.001 * (1.0 + (PI * 0.6).cos());
    assert!(near(&found, &|_| top + blister) < 3e-5);
    assert!((s[s.len() - 1] - 0.015 * PI).abs() < 1e-4);
    let (s, found) = line(0, "ply_2");
    let moved = |k: usize| {
        let [x, y] = at(s[k] / 0.015);
        top + height(x - 0.010, y)
    };
    assert!(near(&found, &moved) < 3e-5);
    // To the edge of the ply, at y = -50 mm.
    let (s, _) = line(2, "ply_1");
    assert!((s[s.len() - 1] - (0.015 * PI + 0.050)).abs() < 1e-4);
    let told = &out.attributes["sections"][1];
    assert_eq!(
        (&told["on"], &told["path"]),
        (&json!("flat-ply"), &json!(arc))
    );
}

#[test]
fn sections_show_runs_beside_as_far_as_they_meet_them() {
    let whole = formed();
    // Of a zone, 1 mm higher; and a run whose plies lie elsewhere.
    let mut zone = formed();
    zone.attributes["zone"] = json!({"name": "B", "box": [-0.08, -0.05, 0.08, 0.05], "free_sides": [false, false, false, false]});
    let mut elsewhere = formed();
    for (run, shift) in [(&mut zone, [0.0, 0.001]), (&mut elsewhere, [0.5, 0.0])] {
        for p in run.bodies[1..].iter_mut().flat_map(|b| &mut b.frames[0]) {
            *p = [p[0] + shift[0], p[1], p[2] + shift[1]];
        }
    }
    let inputs = [
        MemoryInput::new("formed", &whole),
        MemoryInput::new("beside", &zone),
        MemoryInput {
            step: "other",
            item: &[1],
            ..MemoryInput::new("beside", &elsewhere)
        },
    ];
    let sections = json!({"sections": [
        {"label": "A-A'", "from": [-0.035, -0.02], "to": [-0.035, 0.02]},
        {"label": "material", "from": [0.0, -0.02], "to": [0.0, 0.02], "on": "flat-ply"}]});
    let out = run::<DefectMeasurement>(sections, &inputs, &[]).unwrap();
    let labels = |section: usize| -> Vec<String> {
        let lines = out.attributes["sections"][section]["lines"]
            .as_array()
            .unwrap();
        lines
            .iter()
            .map(|l| l["label"].as_str().unwrap().to_owned())
            .collect()
    };
    let own = ["tool", "ply_1", "ply_2", "ply_1, zone B", "ply_2, zone B"];
    assert_eq!(labels(0), own);
    // Along the material every run has the line.
    assert_eq!(labels(1)[..5], own);
    assert_eq!(labels(1)[5..], ["ply_1 of other_1", "ply_2 of other_1"]);
    let lines = out.attributes["sections"][0]["lines"].as_array().unwrap();
    let top = |k: usize| {
        let (_, heights) = &out.arrays[lines[k]["y"].as_str().unwrap()];
        heights.iter().copied().fold(0.0, f64::max)
    };
    assert!((top(4) - top(2) - 0.001).abs() < 1e-9);
    assert_eq!(
        out.result("wrinkle_count"),
        1.0,
        "of the run that is measured alone"
    );
}
