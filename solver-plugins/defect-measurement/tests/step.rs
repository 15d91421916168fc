//! A ply with a known wrinkle and bridge, and a scan of it that was laid down elsewhere.

use plyflow_defect_measurement::DefectMeasurement;
use plyflow_sdk::On;
use plyflow_surface::memory_host::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, run};
use plyflow_surface::vector::Vec3;
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::fmt::Write;

const TOP: f64 = 0.060;
const OFFSET: f64 = 0.0003;
const THICKNESS: f64 = 0.0004;
/// Distance of nodes (m), and how many there are along x and y.
const H: f64 = 0.00125;
const N: [usize; 2] = [128, 80];

fn bump(s: f64, half: f64) -> f64 {
    if s.abs() < half {
        0.5 * (1.0 + (PI * s / half).cos())
    } else {
        0.0
    }
}

/// A wrinkle of height 1, 14 mm wide and 60 mm long along x through (-35, 0) mm.
fn wrinkle(x: f64, y: f64) -> f64 {
    let fade = if (x + 0.035).abs() < 0.030 {
        (0.5 * PI * (x + 0.035) / 0.030).cos()
    } else {
        0.0
    };
    bump(y, 0.007) * fade
}

/// A wrinkle 3 mm high, 14 mm wide and 60 mm long along x through (-35, 0) mm; a round blister 2 mm high, 50 mm wide at (40, 0) mm.
fn height(x: f64, y: f64) -> f64 {
    0.003 * wrinkle(x, y) + 0.002 * bump((x - 0.040).hypot(y), 0.025)
}

fn flat() -> Vec<Vec3> {
    (0..=N[1])
        .flat_map(|j| (0..=N[0]).map(move |i| [-0.080 + H * i as f64, -0.050 + H * j as f64, 0.2]))
        .collect()
}

fn cells() -> Vec<u32> {
    let at = |i: usize, j: usize| (j * (N[0] + 1) + i) as u32;
    (0..N[1])
        .flat_map(|j| (0..N[0]).map(move |i| (i, j)))
        .flat_map(|(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
        .collect()
}

/// Two plies on each other, sheared by 0.1 rad; the upper one has the wrinkle.
fn formed() -> MemoryArtifact {
    let ply = |name: &str, z: f64, size: f64| {
        let field = |name: &str, value: f64| MemoryField {
            name: name.into(),
            on: On::Cells,
            components: 1,
            values: vec![value; N[0] * N[1]],
        };
        let place = |p: &Vec3| [p[0], p[1], TOP + z + size * height(p[0], p[1])];
        MemoryBody {
            name: name.into(),
            nodes_per_cell: 4,
            cells: cells(),
            frames: vec![flat().iter().map(place).collect()],
            points: flat(),
            fields: vec![vec![
                field("shear_angle", 0.1),
                field("fibre_strain_1", 1e-4),
                field("fibre_strain_2", 2e-4),
            ]],
            ..Default::default()
        }
    };
    let tool = MemoryBody {
        name: "tool".into(),
        points: [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
            .map(|[x, y]| [x, y, TOP])
            .into(),
        nodes_per_cell: 3,
        cells: vec![0, 1, 2, 0, 2, 3],
        ..Default::default()
    };
    let sheet = |name: &str, offset: f64, turn: f64| {
        json!({"name": name, "kind": "ply", "offset": offset, "thickness": THICKNESS,
               "fibre_1": turn, "fibre_2": turn + PI / 2.0})
    };
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"sheets": [sheet("ply_1", OFFSET, 0.0), sheet("ply_2", OFFSET + THICKNESS, PI / 4.0)]}),
        times: vec![1.0],
        bodies: vec![
            tool,
            ply("ply_1", OFFSET, 0.0),
            ply("ply_2", OFFSET + THICKNESS, 1.0),
        ],
        ..Default::default()
    }
}

fn measured(parameters: Value) -> MemoryArtifact {
    let formed = formed();
    run::<DefectMeasurement>(parameters, &[MemoryInput::new("formed", &formed)], &[]).unwrap()
}

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

/// A cloud of the outer face of the upper ply, tilted and lifted, in mm.
#[test]
fn a_scan_that_lies_elsewhere_is_measured_as_the_ply_that_it_shows() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.xyz");
    let outer = TOP + OFFSET + 1.5 * THICKNESS;
    let (sin, cos) = 0.03f64.sin_cos();
    let mut text = String::new();
    for p in flat() {
        let z = outer + height(p[0], p[1]);
        let [x, z] = [cos * p[0] - sin * z, sin * p[0] + cos * z + 0.004];
        writeln!(text, "{} {} {}", 1e3 * x, 1e3 * p[1], 1e3 * z).unwrap();
    }
    std::fs::write(&path, text).unwrap();
    let out = measured(json!({"scan": path.to_str().unwrap()}));
    assert_eq!(out.result("wrinkle_count"), 1.0, "of the plies alone");
    assert_eq!(out.result("scan_freedoms"), 3.0);
    assert!(out.result("scan_rms") < 2e-5, "{}", out.result("scan_rms"));
    for (name, unit) in [
        ("wrinkle_length", 0.06),
        ("wrinkle_amplitude", 0.003),
        ("bridging_area", 5e-4),
    ] {
        let [ply, scan] = ["ply_2", "scan"].map(|b| out.result(&format!("{name}.{b}")));
        assert!((scan / ply - 1.0).abs() < 0.03, "{name}: {ply} {scan}");
        assert!(ply > 0.5 * unit, "{name}: {ply}");
    }
    // Left where it is, it stands off everywhere.
    let out = measured(json!({"scan": path.to_str().unwrap(), "scan_align": "none"}));
    assert!(out.result("distance_q50.scan") > 0.001);
    assert!(out.attributes["alignment"].is_null());
}

/// A scan in mm, as a file of points, of heights over the outer face of the upper ply.
fn scan_file(folder: &tempfile::TempDir, height: impl Fn(f64, f64) -> f64, wider: f64) -> String {
    let path = folder.path().join("scan.xyz");
    let outer = TOP + OFFSET + 1.5 * THICKNESS;
    let mut text = String::new();
    for p in flat() {
        let [x, y] = [wider * p[0], p[1]];
        writeln!(
            text,
            "{} {} {}",
            1e3 * x,
            1e3 * y,
            1e3 * (outer + height(x, y))
        )
        .unwrap();
    }
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// The wrinkle is a fifth higher, another lies beside it, and where the ply bridges the scan does not.
#[test]
fn defects_of_a_scan_are_paired_with_those_of_the_ply_that_it_shows() {
    let folder = tempfile::tempdir().unwrap();
    let seen = |x: f64, y: f64| 0.0036 * wrinkle(x, y) + 0.003 * wrinkle(x, y - 0.030);
    let scan = scan_file(&folder, seen, 1.0);
    let out = measured(json!({"scan": scan, "scan_align": "none"}));
    let count = |name: &str| out.result(name);
    assert_eq!(
        [count("missed_wrinkles"), count("false_wrinkles")],
        [1.0, 0.0]
    );
    assert_eq!(
        [count("missed_bridging"), count("false_bridging")],
        [0.0, 1.0]
    );
    let amplitude = out.result("wrinkle_amplitude_error");
    assert!((amplitude - 1.0 / 6.0).abs() < 0.005, "{amplitude}");
    // The crest is off the tool by 1 mm for cos > 1/3 and 1/3.6 of its length, or as far as it is curved enough.
    let length = out.result("wrinkle_length_error");
    assert!(length > 0.005 && length < 0.06, "{length}");
    assert!((out.result("defect_error") - (2.0 + length) / 3.0).abs() < 1e-12);
    // Heights over the simulated face, which is smooth there but for the mesh.
    let difference = |p: &Vec3| seen(p[0], p[1]) - height(p[0], p[1]);
    let deviation = out.body("scan").last("deviation");
    for (found, p) in deviation.iter().zip(&flat()) {
        // Beside crests the closest place is not the one below, and at the rim there is none.
        if seen(p[0], p[1]) == 0.0 && height(p[0], p[1]) == 0.0
            || (p[0] - 0.040).hypot(p[1]) < 0.002
        {
            assert!((found - difference(p)).abs() < 2e-5, "{p:?} {found}");
        }
    }
    let largest = out.result("deviation_largest");
    assert!((largest - 0.003).abs() < 2e-5, "{largest}");
    assert!(out.result("deviation_q50") < 1e-9);
    // By area of the scan, whose flanks are steeper than they look from above.
    let mean = |f: &dyn Fn(&Vec3) -> f64| flat().iter().map(f).sum::<f64>() / flat().len() as f64;
    let (signed, size) = (mean(&difference), mean(&|p| difference(p).abs()));
    let found = out.result("deviation_mean");
    assert!(
        (found - signed).abs() < 0.1 * size,
        "{found} {signed} {size}"
    );
    let told = &out.attributes["agreement"];
    assert_eq!(told["ply"], "ply_2");
    let told = told["defects"].as_array().unwrap();
    let numbers: Vec<_> = told
        .iter()
        .map(|d| [&d["simulated"], &d["scanned"]])
        .collect();
    assert_eq!(numbers.len(), 3);
    assert_eq!(numbers[0], [&json!(1), &json!(1)], "the wrinkle of both");
    assert_eq!([numbers[1][0], numbers[2][1]], [&Value::Null; 2]);
    let maps = out.attributes["maps"].as_array().unwrap();
    let shows = |map: &Value, field: &str| {
        let panels = map["panels"].as_array().unwrap();
        panels
            .iter()
            .any(|p| p["body"] == "scan" && p["field"] == field)
    };
    assert!(shows(&maps[0], "nodal_distance") && shows(&maps[2], "deviation"));
    let rows = out.attributes["tables"][1]["rows"].as_array().unwrap();
    assert_eq!([&rows[1][1], &rows[2][2]], [&json!("none"), &json!("none")]);
}

#[test]
fn what_a_scan_has_beyond_the_ply_does_not_count_and_the_ply_can_be_named() {
    let folder = tempfile::tempdir().unwrap();
    // Half as long again as the ply: a wrinkle and a blister that the ply has, and another wrinkle 15 mm off its end.
    let seen = |x: f64, y: f64| height(x, y) + 0.003 * wrinkle(y - 0.035, x - 0.095);
    let scan = scan_file(&folder, seen, 1.5);
    let agrees = |parameters: Value| {
        let out = measured(parameters);
        let names = [
            "missed_wrinkles",
            "false_wrinkles",
            "missed_bridging",
            "false_bridging",
        ];
        (names.map(|n| out.result(n)), out)
    };
    let (alone, out) = agrees(json!({"scan": scan, "scan_align": "none"}));
    assert_eq!(alone, [0.0; 4]);
    assert!(
        out.result("defect_error") < 0.03,
        "{}",
        out.result("defect_error")
    );
    assert!(out.result("deviation_largest") < 1e-4);
    // The lower ply is flat: all that the scan shows is missed there.
    let (alone, out) = agrees(json!({"scan": scan, "scan_align": "none", "scan_ply": "ply_1"}));
    assert_eq!(alone, [1.0, 0.0, 1.0, 0.0]);
    assert_eq!(out.attributes["agreement"]["ply"], "ply_1");
    assert!((out.result("deviation_largest") - 0.003).abs() < 2e-5);
    // Wound the other way round, a ply has the same upper side.
    let mut run_off = formed();
    for cell in run_off.bodies[2].cells.as_chunks_mut::<4>().0 {
        cell.reverse();
    }
    let inputs = [MemoryInput::new("formed", &run_off)];
    let out = run::<DefectMeasurement>(json!({"scan": scan, "scan_align": "none"}), &inputs, &[]);
    let out = out.unwrap();
    assert!(out.result("deviation_largest") < 1e-4);
    assert_eq!(
        [out.result("wrinkle_count"), out.result("bridging_count")],
        [1.0, 1.0]
    );
    for name in [
        "missed_wrinkles",
        "false_wrinkles",
        "missed_bridging",
        "false_bridging",
    ] {
        assert_eq!(out.result(name), 0.0, "{name}");
    }
}

/// Points of the outer face of the upper ply in `unit` (m), as a file, each moved by `shift` (m).
fn moved_scan(folder: &tempfile::TempDir, unit: f64, shift: Vec3) -> String {
    let path = folder.path().join("moved.xyz");
    let outer = TOP + OFFSET + 1.5 * THICKNESS;
    let mut text = String::new();
    for p in flat() {
        let place = [p[0], p[1], outer + height(p[0], p[1])];
        let [x, y, z] = [0, 1, 2].map(|d| (place[d] + shift[d]) / unit);
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn a_scan_that_lies_where_nothing_is_judged_is_refused_and_one_that_does_not_says_how_much_is() {
    let folder = tempfile::tempdir().unwrap();
    let formed = formed();
    let inputs = [MemoryInput::new("formed", &formed)];
    let told = |unit: f64, shift: Vec3, align: &str| {
        let scan = moved_scan(&folder, unit, shift);
        run::<DefectMeasurement>(json!({"scan": scan, "scan_align": align}), &inputs, &[])
    };
    let refused = |unit, shift, align, with: &[&str]| {
        let error = told(unit, shift, align).unwrap_err();
        assert!(with.iter().all(|w| error.contains(w)), "{error}");
    };
    // Metres read as mm: a speck on the tool that fits it perfectly. Micrometres read as mm: a thousand times as large as the ply.
    for align in ["closest-points", "none"] {
        refused(
            1.0,
            [0.0; 3],
            align,
            &["it is 0.160 x 0.100", "larger unit than `scan_unit`"],
        );
    }
    refused(
        1e-6,
        [0.0; 3],
        "none",
        &[
            "of its area lies over the tool",
            "160000.000 x",
            "`scan_unit`",
        ],
    );
    // Beside the tool, which ends 0.5 m from its middle: by three quarters, and wholly.
    refused(
        1e-3,
        [0.54, 0.0, 0.0],
        "none",
        &["of its area lies over the tool above its foot; expected at least 50.000 %"],
    );
    refused(
        1e-3,
        [5.0, 0.0, 0.0],
        "closest-points",
        &[
            "fewer than six of the 10449 points",
            "`scan_unit`",
            "within some centimetres",
        ],
    );
    // On the tool and beside the ply.
    refused(
        1e-3,
        [0.2, 0.0, 0.0],
        "none",
        &[
            "lies over ply 'ply_2'; expected at least 10.000 %",
            "`scan_ply`",
        ],
    );

    let out = told(1e-3, [0.0; 3], "none").unwrap();
    assert!(out.log.is_empty(), "{:?}", out.log);
    // Nodes at the rim lie on the edge.
    for name in ["scan_judged_share", "scan_covered_share"] {
        let share = out.result(name);
        assert!(share > 0.9 && share <= 1.0, "{name}: {share}");
    }
    // 100 of 160 mm beside each other.
    let out = told(1e-3, [0.1, 0.0, 0.0], "none").unwrap();
    for name in ["scan_judged_share", "scan_covered_share"] {
        assert!((out.result(name) - 0.375).abs() < 0.02, "{name}");
    }
    assert!(
        out.log[0].contains("% of ply 'ply_2': defects"),
        "{:?}",
        out.log
    );
}

/// The scan shows the half with the blister.
#[test]
fn what_the_ply_has_beyond_a_partial_scan_does_not_count() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("half.xyz");
    let outer = TOP + OFFSET + 1.5 * THICKNESS;
    let half = flat().into_iter().filter(|p| p[0] > -1e-9);
    let line = |p: Vec3| {
        format!(
            "{} {} {}\n",
            1e3 * p[0],
            1e3 * p[1],
            1e3 * (outer + height(p[0], p[1]))
        )
    };
    std::fs::write(&path, half.map(line).collect::<String>()).unwrap();
    let out = measured(json!({"scan": path.to_str().unwrap(), "scan_align": "none"}));
    assert_eq!(
        out.result("wrinkle_count"),
        1.0,
        "the ply has it all the same"
    );
    for name in [
        "missed_wrinkles",
        "false_wrinkles",
        "missed_bridging",
        "false_bridging",
    ] {
        assert_eq!(out.result(name), 0.0, "{name}");
    }
    assert!(out.result("bridging_area_error") < 0.01);
    assert!((out.result("scan_covered_share") - 0.5).abs() < 0.02);
    assert!(out.result("scan_judged_share") > 0.9);
}

#[test]
fn facets_of_a_scan_may_be_wound_either_way() {
    let folder = tempfile::tempdir().unwrap();
    let outer = TOP + OFFSET + 1.5 * THICKNESS;
    let points: Vec<Vec3> = flat()
        .iter()
        .map(|p| [p[0], p[1], outer + height(p[0], p[1])])
        .collect();
    let scanned = |inwards: bool| {
        let path = folder.path().join("scan.stl");
        let mut text = String::from("solid scan\n");
        for c in cells().as_chunks::<4>().0 {
            for mut facet in [[c[0], c[1], c[2]], [c[0], c[2], c[3]]] {
                if inwards {
                    facet.reverse();
                }
                text += "facet normal 0 0 0\nouter loop\n";
                for [x, y, z] in facet.map(|i| points[i as usize].map(|v| 1e3 * v)) {
                    writeln!(text, "vertex {x} {y} {z}").unwrap();
                }
                text += "endloop\nendfacet\n";
            }
        }
        std::fs::write(&path, text + "endsolid scan\n").unwrap();
        measured(json!({"scan": path.to_str().unwrap()}))
    };
    let (right, inwards) = (scanned(false), scanned(true));
    for out in [&right, &inwards] {
        assert_eq!(
            [out.result("missed_wrinkles"), out.result("false_wrinkles")],
            [0.0; 2]
        );
        assert!((out.result("wrinkle_amplitude.scan") - 0.003).abs() < 1e-5);
        // It is aligned, by what wrinkle and blister pull along.
        assert!(out.result("deviation_largest") < 1e-4);
    }
    let lengths = [&right, &inwards].map(|o| o.result("wrinkle_length.scan"));
    assert!((lengths[0] - lengths[1]).abs() < 1e-6, "{lengths:?}");
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
