//! A ply with a known wrinkle and bridge.

mod common;

use common::*;
use plyflow_defect_measurement::DefectMeasurement;
use plyflow_surface::memory_host::{MemoryArtifact, MemoryInput, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

#[test]
fn plies_are_measured_with_sections_and_distribution() {
    let out = measured(json!({"sections": [
        {"label": "A-A'", "from": [-0.035, -0.02], "to": [-0.035, 0.02]}]}));
    assert_eq!(out.result("wrinkle_count"), 1.0);
    assert_eq!(out.result("bridging_count"), 1.0);
    assert_eq!(out.result("wrinkle_length.ply_1"), 0.0);
    assert!((out.result("wrinkle_amplitude.ply_2") - 0.003).abs() < 1e-5);
    let area = PI * 0.0125f64.powi(2);
    assert!((out.result("bridging_area.ply_2") / area - 1.0).abs() < 0.03);
    assert!(out.result("distance_largest.ply_1") < 1e-12);
    let defects = &out.attributes["defects"];
    assert_eq!(defects[0]["cause"], "undetermined");
    assert_eq!(
        (&defects[0]["on"], &defects[0]["type"]),
        (&json!("ply_2"), &json!("wrinkle"))
    );
    for name in ["ridge_shear", "ridge_shear_min", "ridge_shear_max"] {
        let shear = defects[0][name].as_f64().unwrap();
        assert!((shear - 0.1).abs() < 1e-9, "{name}");
    }
    assert!(defects[0]["ridge_shear_profile"].as_array().unwrap().len() > 10);
    assert_eq!(
        out.attributes["tables"][0]["rows"]
            .as_array()
            .unwrap()
            .len(),
        2
    );
    // The highest place of the section is the crest, and its line has the arc's length.
    let (_, heights) = &out.arrays["sections/section_0/ply_2/height"];
    let top = heights.iter().copied().fold(0.0, f64::max);
    assert!(
        (top - (TOP + OFFSET + THICKNESS + 0.003)).abs() < 1e-5,
        "{top}"
    );
    let (_, stations) = &out.arrays["sections/section_0/ply_2/station"];
    assert!((stations[stations.len() - 1] - 0.04).abs() < 2.0 * H);
    // The density is one over what is judged.
    let (_, x) = &out.arrays["distributions/ply_2/value"];
    let (_, y) = &out.arrays["distributions/ply_2/density"];
    let sum: f64 = y.iter().map(|d| d * (x[1] - x[0])).sum();
    assert!((sum - 1.0).abs() < 0.01, "{sum}");
    let number = out.body("ply_2").last("defect");
    assert!(number.contains(&1.0) && number.contains(&2.0));
}

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
    zone.attributes["zone"] = json!({"name": "B"});
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

#[test]
fn causes_are_told_from_shear_bridging_and_layup() {
    let cause = |parameters: Value| measured(parameters).attributes["defects"][0]["cause"].clone();
    // 0.1 rad are 5.7 degrees. The crest ends 22 mm from where the blister is 1 mm high, or somewhat more.
    assert_eq!(cause(json!({"over_shear_positive": 0.09})), "over-shear");
    assert_eq!(cause(json!({"bridging_reach": 0.06})), "bridging");
    let mut run_off = formed();
    run_off.bodies[2].fields[0][1].values.fill(-2e-4);
    let inputs = [MemoryInput::new("formed", &run_off)];
    let out = run::<DefectMeasurement>(json!({}), &inputs, &[]).unwrap();
    assert_eq!(
        out.attributes["defects"][0]["cause"],
        "inter-ply-compression"
    );
}

#[test]
fn what_cannot_be_measured_is_told() {
    let formed = formed();
    let refused = |parameters: Value, artifact: &MemoryArtifact| {
        let inputs = [MemoryInput::new("formed", artifact)];
        run::<DefectMeasurement>(parameters, &inputs, &[]).unwrap_err()
    };
    let beside = json!({"sections": [{"label": "B", "from": [0.3, 0.3], "to": [0.4, 0.3]}]});
    assert!(refused(beside, &formed).contains("meets no ply"));
    let point = json!({"sections": [{"label": "B", "from": [0.0, 0.0], "to": [0.0, 0.0]}]});
    assert!(refused(point, &formed).contains("different places"));
    let both = json!({"sections": [{"label": "B", "from": [0.0, 0.0], "path": [[0.0, 0.0]]}]});
    assert!(refused(both, &formed).contains("or a `path`"));
    let flat =
        json!({"sections": [{"label": "B", "path": [[0.3, 0.0], [0.4, 0.0]], "on": "flat-ply"}]});
    assert!(refused(flat, &formed).contains("in the flat ply"));
    let missing = json!({"scan": "/nowhere/scan.stl"});
    assert!(refused(missing, &formed).contains("cannot read the scan `/nowhere/scan.stl`"));
    let folder = tempfile::tempdir().unwrap();
    let scan = scan_file(&folder, height, 1.0);
    let named = json!({"scan": scan, "scan_ply": "ply_7"});
    let told = refused(named, &formed);
    assert!(
        told.contains("no ply 'ply_7'; its plies are: ply_1, ply_2"),
        "{told}"
    );
    let mut without = formed.clone();
    without.attributes = json!({"sheets": []});
    assert!(refused(json!({}), &without).contains("no sheet of kind 'ply'"));
}

#[test]
fn what_a_net_does_not_reach_is_no_bridging_and_told() {
    let mut input = formed();
    let ply = input.bodies.iter_mut().find(|b| b.name == "ply_2").unwrap();
    // The blister lies about x = 40 mm, the wrinkle left of 0.
    let cells = ply.cells.chunks_exact(4);
    let draped = cells.map(|c| f64::from(u8::from(ply.points[c[0] as usize][0] < 0.005)));
    let draped: Vec<f64> = draped.collect();
    let on: f64 = draped.iter().sum();
    for (shear, draped) in ply.fields[0][0].values.iter_mut().zip(&draped) {
        *shear = if *draped > 0.5 { *shear } else { 1.4 };
    }
    ply.fields[0].push(plyflow_surface::memory_host::MemoryField {
        name: "draped".into(),
        on: plyflow_sdk::On::Cells,
        components: 1,
        values: draped,
    });
    let inputs = [MemoryInput::new("formed", &input)];
    let out = run::<DefectMeasurement>(json!({}), &inputs, &[]).unwrap();
    assert_eq!(out.result("wrinkle_count"), 1.0);
    assert_eq!(out.result("bridging_count"), 0.0);
    let shown = out.body("ply_2");
    assert_eq!(
        shown.cells.len(),
        4 * on as usize,
        "what is shown is what was measured"
    );
    assert!(shown.last("shear_angle").iter().all(|g| *g == 0.1));
    let text = out.log.join("\n");
    assert!(
        text.contains("ply 'ply_2'") && text.contains("of its area (field `draped`)"),
        "{text}"
    );
}
