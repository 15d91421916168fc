//! What is bridging, and what is a wrinkle, in the comparison of models.

mod common;

use common::*;
use plyflow_comparison::Comparison;
use plyflow_testing::{MemoryInput, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

#[test]
fn a_ply_that_stands_off_a_fillet_as_curved_as_the_tool_is_bridging_and_not_a_wrinkle() {
    // Half a cylinder of 10 mm radius; the ply 2 mm above it has 83 1/m, the threshold is 50 1/m.
    let arc = |r: f64, n: usize, columns: usize| {
        let mut points = Vec::new();
        for j in 0..=n {
            for i in 0..=columns {
                let a = PI * (1.0 - j as f64 / n as f64);
                points.push([0.002 * i as f64 - 0.030, r * a.cos(), r * a.sin()]);
            }
        }
        let node = |i: usize, j: usize| (j * (columns + 1) + i) as u32;
        let mut cells = Vec::new();
        for j in 0..n {
            for i in 0..columns {
                cells.extend([
                    node(i, j),
                    node(i + 1, j),
                    node(i + 1, j + 1),
                    node(i, j + 1),
                ]);
            }
        }
        (points, cells)
    };
    let (points, cells) = arc(0.010, 24, 30);
    let split = cells
        .chunks_exact(4)
        .flat_map(|c| [c[0], c[1], c[2], c[0], c[2], c[3]])
        .collect();
    let (off, off_cells) = arc(0.012, 18, 30);
    let mut run_off = local(1.0);
    run_off.bodies[0].points = points;
    run_off.bodies[0].cells = split;
    let sheet = &mut run_off.bodies[1];
    sheet.points = (0..off.len())
        .map(|k| [off[k][0], 0.0022 * ((k / 31) as f64 - 9.0), 0.2])
        .collect();
    sheet.frames = vec![off];
    sheet.fields[0][0].values = vec![0.0; off_cells.len() / 4];
    sheet.cells = off_cells;
    let (global, zones) = (global(), zones(json!([zone_a()])));
    let inputs = [
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &run_off),
    ];
    let out = run::<Comparison>(json!({"curvature_threshold": 50.0}), &inputs, &[]).unwrap();
    assert_eq!(
        (out.result("wrinkle_count"), out.result("bridging_count")),
        (0.0, 1.0)
    );
    let sharpest = out
        .body("local_A_ply_1")
        .last("curvature_max")
        .iter()
        .fold(0.0, |a: f64, &b| a.min(b));
    assert!(
        sharpest < -80.0,
        "the ply is curved beyond the threshold: {sharpest}"
    );
}

#[test]
fn a_ridge_too_short_for_a_wrinkle_is_bridging_beside_a_reference_too() {
    // A bump 2.5 mm high whose crest is about 8 mm long where it stands off by more than 1 mm.
    let bump = |x: f64, y: f64| {
        let (along, across) = (x / 0.010, y / 0.012);
        if along.abs() < 0.5 && across.abs() < 0.5 {
            0.0025 * (PI * along).cos() * 0.5 * (1.0 + (2.0 * PI * across).cos())
        } else {
            0.0
        }
    };
    let zones = zones(json!([zone_a()]));
    let same = |b, zone| formed(vec![ply("ply_1", b, 0.00125, OFFSET, bump)], 0.00125, zone);
    let (global, local) = (global(), same(ZONE, zone_a()));
    let reference = same([-0.12, -0.08, 0.12, 0.08], Value::Null);
    let inputs = [
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &local),
        MemoryInput::new("reference", &reference),
    ];
    let out = run::<Comparison>(json!({"minimum_bridging_area": 20e-6}), &inputs, &[]).unwrap();
    assert_eq!(
        (out.result("wrinkle_count"), out.result("bridging_count")),
        (0.0, 1.0)
    );
    for name in [
        "missed_wrinkles",
        "false_wrinkles",
        "missed_bridging",
        "false_bridging",
    ] {
        assert_eq!(out.result(name), 0.0, "{name}");
    }
    assert!(out.result("bridging_area_error") < 0.1);
    assert_eq!(out.result("missed_bridging.global"), 1.0);
}

/// Of one ridge in two runs, one is just long enough for a wrinkle and one is not: they are a pair, and the bridging that the short one is
/// part of is neither false nor missed.
#[test]
fn a_ridge_about_as_long_as_a_wrinkle_has_to_be_is_one_defect_in_both() {
    let bump = |long: f64| {
        move |x: f64, y: f64| {
            let (along, across) = (x / long, y / 0.012);
            if along.abs() < 0.5 && across.abs() < 0.5 {
                0.0025 * (PI * along).cos() * 0.5 * (1.0 + (2.0 * PI * across).cos())
            } else {
                0.0
            }
        }
    };
    let zones = zones(json!([zone_a()]));
    let global = global();
    let of = |ours: f64, theirs: f64, least: f64| {
        let run_of = |long, b, zone| {
            let plies = vec![ply("ply_1", b, 0.00125, OFFSET, bump(long))];
            formed(plies, 0.00125, zone)
        };
        let local = run_of(ours, ZONE, zone_a());
        let reference = run_of(theirs, [-0.12, -0.08, 0.12, 0.08], Value::Null);
        let inputs = [
            MemoryInput::new("global", &global),
            MemoryInput::new("zones", &zones),
            MemoryInput::new("local", &local),
            MemoryInput::new("reference", &reference),
        ];
        let sizes = json!({"minimum_bridging_area": 20e-6, "minimum_wrinkle_length": least});
        run::<Comparison>(sizes, &inputs, &[]).unwrap()
    };
    // Without a least length: how long the two are.
    let both = of(0.010, 0.012, 0.002);
    let [short, long] =
        ["wrinkle_length.AW1", "reference_wrinkle_length.AW1"].map(|name| both.result(name));
    assert!(short < long, "{short} {long}");
    let least = 0.5 * (short + long);
    for [ours, theirs] in [[0.010, 0.012], [0.012, 0.010]] {
        let out = of(ours, theirs, least);
        let error = (short - long).abs() / if ours < theirs { long } else { short };
        assert!((out.result("wrinkle_length_error") - error).abs() < 1e-6);
        assert!((out.result("defect_error") - error).abs() < 1e-6);
        for name in [
            "missed_wrinkles",
            "false_wrinkles",
            "missed_bridging",
            "false_bridging",
        ] {
            assert_eq!(out.result(name), 0.0, "{ours} {theirs}: {name}");
        }
    }
}
