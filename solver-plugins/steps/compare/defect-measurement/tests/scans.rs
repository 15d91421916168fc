//! Scans of a ply with a known wrinkle and bridge, that lie elsewhere, in patches, or over plies that end.

mod common;

use common::*;
use plyflow_defect_measurement::DefectMeasurement;
use plyflow_geometry::vec3::Vec3;
use plyflow_testing::{MemoryArtifact, MemoryInput, run};
use serde_json::{Value, json};
use std::fmt::Write;

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
    let mut formed = formed();
    for sheet in formed.attributes["sheets"].as_array_mut().unwrap() {
        sheet["over_shear"] = json!({"positive": 0.14, "negative": -0.87});
    }
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

/// The scan in three patches: the border of one runs along the wrinkle's crest, where the other patch has it in other last digits, and wound the other way.
#[test]
fn a_scan_in_patches_that_are_wound_against_each_other_is_one_surface() {
    let folder = tempfile::tempdir().unwrap();
    let outer = TOP + OFFSET + 1.5 * THICKNESS;
    let place = |p: &Vec3| [p[0], p[1], outer + height(p[0], p[1])];
    let points: Vec<Vec3> = flat().iter().map(place).collect();
    let facets: Vec<[u32; 3]> = (cells().as_chunks::<4>().0.iter())
        .flat_map(|c| [[c[0], c[1], c[2]], [c[0], c[2], c[3]]])
        .collect();
    let patch = |t: &[u32; 3]| {
        let middle = |d: usize| t.iter().map(|&i| points[i as usize][d]).sum::<f64>() / 3.0;
        match (middle(0) < -0.035, middle(1) < 0.0) {
            (true, true) => 0,
            (true, false) => 1,
            _ => 2,
        }
    };
    let scanned = |seams: bool| {
        let path = folder.path().join("scan.stl");
        let mut text = String::from("solid scan\n");
        for k in 0..3 {
            for t in facets.iter().filter(|t| patch(t) == k) {
                let mut t = *t;
                if seams && k == 1 {
                    t.reverse();
                }
                text += "facet normal 0 0 0\nouter loop\n";
                for p in t.map(|i| points[i as usize]) {
                    let noise = if seams { 1e-5 * f64::from(k) } else { 0.0 };
                    let [x, y, z] = p.map(|v| 1e3 * v + noise);
                    writeln!(text, "vertex {x:.6} {y:.6} {z:.6}").unwrap();
                }
                text += "endloop\nendfacet\n";
            }
        }
        std::fs::write(&path, text + "endsolid scan\n").unwrap();
        measured(json!({"scan": path.to_str().unwrap(), "scan_align": "none"}))
    };
    let (whole, patched) = (scanned(false), scanned(true));
    for out in [&whole, &patched] {
        assert_eq!(out.body("scan").points.len(), points.len());
        for name in ["missed_wrinkles", "false_wrinkles", "missed_bridging"] {
            assert_eq!(out.result(name), 0.0, "{name}");
        }
        let on_scan = |d: &&Value| d["on"] == "scan" && d["type"] == "wrinkle";
        let defects = out.attributes["defects"].as_array().unwrap();
        assert_eq!(defects.iter().filter(on_scan).count(), 1);
    }
    let lengths = [&whole, &patched].map(|o| o.result("wrinkle_length.scan"));
    assert!((lengths[0] - lengths[1]).abs() < 1e-5, "{lengths:?}");
}

/// Of three plies the lowest ends at x = 0 and the uppermost at x = 40 mm; all lie on what is there.
fn stepped() -> MemoryArtifact {
    let mut run = formed();
    let outline = |x0: f64, x1: f64| json!([[x0, -0.05], [x1, -0.05], [x1, 0.05], [x0, 0.05]]);
    let ends = [(-0.080, 0.0), (-0.080, 0.080), (-0.080, 0.040)];
    let sheets: Vec<Value> = (0..3)
        .map(|k| {
            json!({"name": format!("ply_{}", k + 1), "kind": "ply", "offset": OFFSET + f64::from(k) * THICKNESS,
                   "thickness": THICKNESS, "outline": outline(ends[k as usize].0, ends[k as usize].1),
                   "over_shear": {"positive": 0.14, "negative": -0.87}})
        })
        .collect();
    run.attributes = json!({"sheets": sheets, "contact_by_place": true});
    let tool = run.bodies.remove(0);
    let one = run.bodies[1].clone();
    run.bodies = vec![tool];
    for (k, end) in ends.iter().enumerate() {
        let mut body = one.clone();
        body.name = format!("ply_{}", k + 1);
        let within = |c: &&[u32; 4]| c.iter().all(|&i| flat()[i as usize][0] < end.1 + 1e-9);
        let kept: Vec<[u32; 4]> = (cells().as_chunks::<4>().0.iter())
            .filter(within)
            .copied()
            .collect();
        // Nodes of no cell are left out.
        let used: Vec<u32> = (0..flat().len() as u32)
            .filter(|&i| flat()[i as usize][0] < end.1 + 1e-9)
            .collect();
        let new = |i: u32| used.binary_search(&i).unwrap() as u32;
        body.cells = kept.iter().flatten().map(|&i| new(i)).collect();
        body.points = used.iter().map(|&i| flat()[i as usize]).collect();
        let below = |x: f64| ends[..k].iter().filter(|e| x < e.1 + 1e-9).count() as f64;
        let place = |p: &Vec3| [p[0], p[1], TOP + OFFSET + THICKNESS * below(p[0])];
        body.frames = vec![body.points.iter().map(place).collect()];
        for field in &mut body.fields[0] {
            field.values.truncate(kept.len());
        }
        run.bodies.push(body);
    }
    run
}

#[test]
fn a_scan_over_plies_that_end_lies_on_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let run_off = stepped();
    let there = |x: f64| [0.0, 0.080, 0.040].iter().filter(|e| x < **e).count() as f64;
    // To 20 mm beyond the plies, where the run says nothing; but for a band at either step, which a scanner rounds off.
    let scan = |from: f64, to: f64| {
        let path = folder.path().join("scan.xyz");
        let mut text = String::new();
        for p in flat() {
            let x = from + (to - from) * (p[0] + 0.080) / 0.160;
            if [0.0, 0.040].iter().any(|e| (x - e).abs() < 1e-4) {
                continue;
            }
            let face = TOP + OFFSET - 0.5 * THICKNESS + THICKNESS * there(x.min(0.079));
            writeln!(text, "{} {} {}", 1e3 * x, 1e3 * p[1], 1e3 * face).unwrap();
        }
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let told = |parameters: Value| {
        let inputs = [MemoryInput::new("formed", &run_off)];
        run::<DefectMeasurement>(parameters, &inputs, &[]).unwrap()
    };
    let scan = scan(-0.080, 0.100);
    for align in ["none", "closest-points"] {
        let out = told(json!({"scan": scan, "scan_align": align}));
        let worst = out.body("scan").last("nodal_distance").iter();
        let worst = worst.map(|d| d.abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6, "{align}: {worst}");
        assert!(out.result("distance_largest.scan") < 1e-6);
        assert!(out.log.is_empty(), "{:?}", out.log);
        if align == "closest-points" {
            assert!(out.result("scan_rms") < 1e-7, "{}", out.result("scan_rms"));
            let shift = &out.attributes["alignment"]["shift"];
            assert!((0..3).all(|d| shift[d].as_f64().unwrap().abs() < 1e-6));
        }
    }
    // The offset of the face of the second ply counts nothing of the third: over that, the scan is too high by it.
    let second = OFFSET + 1.5 * THICKNESS;
    let out = told(
        json!({"scan": scan, "scan_align": "none", "scan_offset": second, "scan_ply": "ply_2"}),
    );
    let points = &out.body("scan").points;
    let found = out.body("scan").last("nodal_distance");
    for (p, d) in points.iter().zip(found) {
        let more = if p[0] < 0.040 { THICKNESS } else { 0.0 };
        assert!((d - more).abs() < 1e-6, "{p:?}: {d}");
    }
}

#[test]
fn a_scan_that_does_not_come_to_rest_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let scan = scan_file(&folder, height, 0.9);
    let told = |wider: f64| {
        let mut run_off = formed();
        let tool = &mut run_off.bodies[0];
        tool.points = flat()
            .iter()
            .map(|p| [wider * p[0], wider * p[1], TOP])
            .collect();
        (tool.nodes_per_cell, tool.cells) = (4, cells());
        let inputs = [MemoryInput::new("formed", &run_off)];
        let with = json!({"scan": scan, "scan_kept": 1.0});
        run::<DefectMeasurement>(with, &inputs, &[]).unwrap().log
    };
    let restless = |log: &[String]| log.iter().any(|l| l.contains("not come to rest"));
    assert!(!restless(&told(2.0)));
    // Points on the rim of the tool lie over it in one pass and beyond it in the next.
    assert!(restless(&told(1.0)));
}
