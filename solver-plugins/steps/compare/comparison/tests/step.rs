//! The comparison of models whose wrinkles and bridging are known.

mod common;

use common::*;
use plyflow_comparison::Comparison;
use plyflow_defects::quantiles;
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryField, MemoryInput, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

/// Length of the wrinkle's crest where its curvature exceeds half of 100 1/m and it stands off by more than 1 mm.
fn crest_length() -> f64 {
    let peak = 0.0015 * (PI / 0.007f64).powi(2);
    let half = 0.060 / PI * (50.0 / peak).max(1.0 / 3.0).acos();
    let z = |s: f64| 0.003 * (PI * s / 0.060).cos();
    (0..1000)
        .map(|i| {
            let at = |i: f64| half * (i / 500.0 - 1.0);
            let (a, b) = (at(f64::from(i)), at(f64::from(i + 1)));
            (b - a).hypot(z(b) - z(a))
        })
        .sum()
}

#[test]
fn a_wrinkle_and_a_bridge_are_told_apart_and_measured() {
    let (global, local, zones) = (global(), local(1.0), zones(json!([zone_a()])));
    let out = compare(&[
        MemoryInput {
            cost: [10.0, 12.0, 1e8],
            ..MemoryInput::new("global", &global)
        },
        MemoryInput::new("zones", &zones),
        MemoryInput {
            cost: [30.0, 50.0, 2e8],
            item: &[0],
            ..MemoryInput::new("local", &local)
        },
    ]);
    assert_eq!(
        (out.result("wrinkle_count"), out.result("bridging_count")),
        (1.0, 1.0)
    );
    let length = out.result("wrinkle_length.AW1");
    // Short of the crest by up to one cell's diagonal (1.8 mm) at each end.
    let short = crest_length() - length;
    assert!(
        (-0.001..0.0036).contains(&short),
        "{length} {}",
        crest_length()
    );
    assert!((out.result("wrinkle_amplitude.AW1") - 0.003).abs() < 1e-5);
    // 1 mm (1 + cos) exceeds 1 mm for r < 12.5 mm: 491 mm2.
    let area = out.result("bridging_area.AB1");
    assert!((area * 1e6 / 490.9 - 1.0).abs() < 0.05, "{area}");
    let defects = out.attributes["defects"].as_array().unwrap();
    assert_eq!(
        defects.len(),
        2,
        "the flanks of the wrinkle are no bridging, the flat global run has none"
    );
    let wrinkle = &defects[0];
    assert_eq!(
        (&wrinkle["id"], &wrinkle["model"], &wrinkle["ply"]),
        (&json!("AW1"), &json!("local.A"), &json!("ply_1"))
    );
    let number = |v: &Value| v.as_f64().unwrap();
    assert!((number(&wrinkle["direction"]) - PI / 4.0).abs() < 0.05);
    assert!(
        (number(&wrinkle["radius"]) * 302.0 - 1.0).abs() < 0.06,
        "{wrinkle}"
    );
    assert!((number(&wrinkle["centre"][0]) + 0.035).abs() < 0.001);
    let bridge = &defects[1];
    assert!(
        (number(&bridge["shear_max"]) - 0.0525 / 0.8).abs() < 0.003,
        "{bridge}"
    );
    assert_eq!(bridge["touches_cut"], false);
    assert_eq!(
        (&out.attributes["zones"], &out.attributes["zone_boxes"]),
        (&json!(["A"]), &json!([ZONE]))
    );
    // Measured numbers are not in the artifact proper.
    assert_eq!(out.measured["cost.local.A.cpu_seconds"], (50.0, "s".into()));
    assert_eq!(out.measured["cost.total.wall_seconds"], (40.0, "s".into()));
    assert!(
        !out.measured.contains_key("cost_saving")
            && !out.results.keys().any(|k| k.contains("cost"))
    );
    let body = out.body("local_A_ply_1");
    assert_eq!(
        body.last("defect").iter().fold(0.0, |a: f64, &b| a.max(b)),
        2.0
    );
    let model = &out.attributes["models"][1];
    assert_eq!(
        (&model["role"], &model["zone"], &model["elements"]),
        (&json!("local"), &json!("A"), &json!(128 * 80))
    );
}

/// Shear grows along x; the crest runs along the diagonal, the blister lies beside it.
#[test]
fn a_wrinkle_has_its_cause_and_the_shear_along_its_crest_as_a_measurement_would_give_them() {
    let (mut global, mut local, zones) = (global(), local(1.0), zones(json!([zone_a()])));
    let wrinkle = |parameters: Value, global: &MemoryArtifact, local: &MemoryArtifact| {
        let inputs = [
            MemoryInput::new("global", global),
            MemoryInput::new("zones", &zones),
            MemoryInput::new("local", local),
        ];
        let out = run::<Comparison>(parameters, &inputs, &[]).unwrap();
        out.attributes["defects"].as_array().unwrap().clone()
    };
    let found = wrinkle(json!({}), &global, &local);
    let [aw1, ab1] = &found[..] else {
        panic!("{found:?}")
    };
    assert_eq!(aw1["cause"], "undetermined");
    for name in ["cause", "direction", "ridge_shear", "ridge_shear_profile"] {
        assert_eq!(ab1[name], Value::Null, "{name} of bridging");
    }
    let number = |name: &str| aw1[name].as_f64().unwrap();
    let (mean, min, max) = (
        number("ridge_shear"),
        number("ridge_shear_min"),
        number("ridge_shear_max"),
    );
    assert!((mean + 0.035 / 0.8).abs() < 0.002, "{mean}");
    let profile: Vec<[f64; 2]> = (aw1["ridge_shear_profile"].as_array().unwrap().iter())
        .map(|p| [0, 1].map(|k| p[k].as_f64().unwrap()))
        .collect();
    let [first, last] = [profile[0], profile[profile.len() - 1]];
    assert!(first[0] >= 0.0 && last[0] <= number("length"));
    assert!(profile.windows(2).all(|w| w[0][0] < w[1][0]));
    assert!((first[1].min(last[1]) - min).abs() < 1e-12);
    assert!((first[1].max(last[1]) - max).abs() < 1e-12);
    // Along the diagonal x grows by the length's part in it (the crest rises by 3 mm at most).
    let slope = (last[1] - first[1]).abs() / (last[0] - first[0]);
    assert!((slope * 0.8 * 2f64.sqrt() - 1.0).abs() < 0.03, "{slope}");

    let cause = |parameters: Value| wrinkle(parameters, &global, &local)[0]["cause"].clone();
    assert_eq!(cause(json!({"over_shear_negative": -0.03})), "over-shear");
    // What the material of the ply says counts as well, but less than what the step is asked for.
    let mut of_material = local.clone();
    of_material.attributes["sheets"][0]["over_shear"] = json!({"positive": 1.0, "negative": -0.03});
    let cause_of =
        |parameters: Value| wrinkle(parameters, &global, &of_material)[0]["cause"].clone();
    assert_eq!(cause_of(json!({})), "over-shear");
    assert_eq!(
        cause_of(json!({"over_shear_negative": -0.5})),
        "undetermined"
    );
    assert_eq!(cause(json!({"bridging_reach": 0.06})), "bridging");
    // A second ply at an angle, and fibres that are compressed along the crest.
    for run_off in [&mut global, &mut local] {
        let sheets = run_off.attributes["sheets"].as_array_mut().unwrap();
        sheets[0]["fibre_1"] = json!(0.0);
        sheets[0]["fibre_2"] = json!(PI / 2.0);
        sheets.push(
            json!({"name": "ply_2", "kind": "ply", "thickness": 0.0004, "offset": OFFSET + 0.0004,
            "fibre_1": PI / 4.0, "fibre_2": 3.0 * PI / 4.0}),
        );
        let mut other = run_off.bodies[1].clone();
        other.name = "ply_2".into();
        let flat = other
            .points
            .iter()
            .map(|p| [p[0], p[1], TOP + OFFSET + 0.0004]);
        other.frames = vec![flat.collect()];
        let strain = run_off.bodies[1].fields[0][0].values.len();
        for name in ["fibre_strain_1", "fibre_strain_2"] {
            run_off.bodies[1].fields[0].push(MemoryField {
                name: name.into(),
                on: On::Cells,
                components: 1,
                values: vec![-2e-4; strain],
            });
        }
        run_off.bodies.push(other);
    }
    let found = wrinkle(json!({}), &global, &local);
    assert_eq!(found[0]["cause"], "inter-ply-compression");
}

#[test]
fn the_reference_takes_the_ids_of_the_same_defects_and_errors_are_relative_to_it() {
    let (mut global, local, zones) = (global(), local(1.0), zones(json!([zone_a()])));
    // Shear angles of the global run are 0.1 rad too large.
    let shear = &mut global.bodies[1].fields[0][0].values;
    shear.iter_mut().for_each(|s| *s += 0.1);
    // The reference's wrinkle and blister are 20 % higher; it covers the whole blank, so its defects must be
    // looked for in the zone's box.
    let reference = formed(
        vec![ply(
            "ply_1",
            [-0.12, -0.08, 0.12, 0.08],
            0.00125,
            OFFSET,
            height(1.2),
        )],
        0.00125,
        Value::Null,
    );
    let out = compare(&[
        MemoryInput {
            cost: [10.0, 10.0, 0.0],
            ..MemoryInput::new("global", &global)
        },
        MemoryInput::new("zones", &zones),
        MemoryInput {
            cost: [10.0, 10.0, 0.0],
            ..MemoryInput::new("local", &local)
        },
        MemoryInput {
            cost: [100.0, 100.0, 0.0],
            ..MemoryInput::new("reference", &reference)
        },
    ]);
    let (ours, theirs) = (
        out.result("bridging_area.AB1"),
        out.result("reference_bridging_area.AB1"),
    );
    assert!(theirs > ours);
    assert!((out.result("bridging_area_error") - (theirs - ours) / theirs).abs() < 1e-12);
    assert!(out.result("reference_wrinkle_length.AW1") > out.result("wrinkle_length.AW1"));
    assert!((out.measured["cost_saving"].0 - 0.8).abs() < 1e-12);
    assert!(out.result("distance_error.local.A") < out.result("distance_error.global"));
    assert!(out.result("distance_error.local.A") > 1e-5);
    assert_eq!(
        out.result("wrinkle_count"),
        1.0,
        "the reference is not counted"
    );
    // Amplitudes of 3 and 3.6 mm; the same shear; the global run has neither.
    assert!((out.result("wrinkle_amplitude_error") - 0.6 / 3.6).abs() < 1e-3);
    assert!(out.result("wrinkle_length_error") < 0.1);
    for kind in ["wrinkles", "bridging"] {
        let count = |what: &str, suffix: &str| out.result(&format!("{what}_{kind}{suffix}"));
        assert_eq!((count("missed", ""), count("false", "")), (0.0, 0.0));
        assert_eq!(
            (count("missed", ".global"), count("false", ".global")),
            (1.0, 0.0)
        );
    }
    assert!(!out.results.contains_key("wrinkle_length_error.global"));
    assert_eq!(out.result("defect_error.global"), 1.0);
    let mean = 0.5 * (out.result("wrinkle_length_error") + out.result("bridging_area_error"));
    assert!((out.result("defect_error") - mean).abs() < 1e-12);
    assert!(out.result("shear_quantile_error.local.A") < 0.002);
    assert!((out.result("shear_quantile_error.global") - 0.1).abs() < 0.01);
}

#[test]
fn what_the_reference_has_outside_of_all_zones_is_missed_and_what_it_has_not_is_false() {
    // The zone holds the blister alone; the local run shows a wrinkle there that nobody else has.
    let zone = json!({"name": "A", "box": [0.010, -0.050, 0.080, 0.050], "free_sides": vec![false; 4], "plies": ["ply_1"]});
    let odd = |x: f64, y: f64| height(1.0)(x, y) + height(1.0)(x - 0.078, y - 0.035);
    let bounds = [0.010, -0.050, 0.080, 0.050];
    let local = formed(
        vec![ply("ply_1", bounds, 0.00125, OFFSET, odd)],
        0.00125,
        zone.clone(),
    );
    let reference = formed(
        vec![ply(
            "ply_1",
            [-0.12, -0.08, 0.12, 0.08],
            0.00125,
            OFFSET,
            height(1.0),
        )],
        0.00125,
        Value::Null,
    );
    let (global, zones) = (global(), zones(json!([zone])));
    let out = compare(&[
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &local),
        MemoryInput::new("reference", &reference),
    ]);
    assert_eq!(out.result("missed_wrinkles"), 1.0);
    let wrong = out.result("false_wrinkles") + out.result("false_bridging");
    assert!(out.result("false_wrinkles") >= 1.0);
    assert_eq!(out.result("missed_bridging"), 0.0);
    let area = out.result("bridging_area_error");
    assert!(area < 0.03);
    // The missed and the false ones count as wholly wrong beside the one place that both have.
    let mean = (area + 1.0 + wrong) / (2.0 + wrong);
    assert!((out.result("defect_error") - mean).abs() < 1e-12);
}

#[test]
fn defects_of_the_upper_ply_come_first_and_each_ply_is_counted() {
    let bodies = vec![
        ply("ply_1", ZONE, 0.002, OFFSET, height(1.0)),
        ply("ply_2", ZONE, 0.002, OFFSET + 0.0004, height(1.1)),
    ];
    let both = formed(bodies, 0.002, zone_a());
    let (global, zones) = (global(), zones(json!([zone_a()])));
    let out = compare(&[
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &both),
    ]);
    assert_eq!(
        (out.result("wrinkle_count"), out.result("bridging_count")),
        (2.0, 2.0)
    );
    assert!((out.result("wrinkle_amplitude.AW1") - 0.0033).abs() < 1e-4);
    assert!((out.result("wrinkle_amplitude.AW2") - 0.0030).abs() < 1e-4);
    assert_eq!(out.attributes["defects"][0]["ply"], "ply_2");
}

#[test]
fn a_defect_that_reaches_the_cut_is_marked_and_one_at_a_free_side_is_not() {
    let ridge = |_: f64, y: f64| {
        if y.abs() < 0.007 {
            0.0015 * (1.0 + (PI * y / 0.007).cos())
        } else {
            0.0
        }
    };
    let through = formed(
        vec![ply("ply_1", ZONE, 0.002, OFFSET, ridge)],
        0.002,
        zone_a(),
    );
    let global = global();
    let marked = |free: bool| {
        let zones = zones(json!([{"name": "A", "box": ZONE, "free_sides": vec![free; 4]}]));
        let out = compare(&[
            MemoryInput::new("global", &global),
            MemoryInput::new("zones", &zones),
            MemoryInput::new("local", &through),
        ]);
        assert!((out.result("wrinkle_length.AW1") - 0.160).abs() < 1e-6);
        let marked = out.attributes["defects"][0]["touches_cut"]
            .as_bool()
            .unwrap();
        assert_eq!(
            out.log
                .iter()
                .any(|l| l.contains("AW1 reaches the cut of zone A")),
            marked
        );
        marked
    };
    assert!(marked(false));
    assert!(!marked(true));
}

/// A ridge along x over all of a ply that ends one element inside of the zone's right side, at it, or before the next line past it.
#[test]
fn the_edge_of_a_ply_that_ends_inside_of_its_zone_is_no_cut() {
    let ridge = |_: f64, y: f64| 0.0015 * (1.0 + (PI * (y / 0.007).clamp(-1.0, 1.0)).cos());
    let run_off = |b: [f64; 4], right: f64, size: f64, zone: Value| {
        let narrow = [b[0], b[1], right, b[3]];
        let plies = vec![
            ply("ply_1", b, size, OFFSET, |_, _| 0.0),
            ply("ply_2", narrow, size, OFFSET + 0.0004, ridge),
        ];
        formed(plies, size, zone)
    };
    let zones = zones(json!([zone_a()]));
    let sides = |right: f64| {
        let (global, local) = (
            run_off(BLANK, right, 0.002, Value::Null),
            run_off(
                ZONE,
                // The zone's mesh goes on to the next line.
                if right < 0.082 { right } else { 0.080 },
                0.002,
                zone_a(),
            ),
        );
        let inputs = [
            MemoryInput::new("global", &global),
            MemoryInput::new("zones", &zones),
            MemoryInput::new("local", &local),
        ];
        let out = compare(&inputs);
        assert_eq!(out.attributes["defects"][0]["id"], "AW1");
        out.attributes["defects"][0]["cut_sides"].clone()
    };
    assert_eq!(sides(0.240), json!([true, true, false, false]));
    for end in [0.080, 0.078, 0.081] {
        assert_eq!(sides(end), json!([true, false, false, false]), "{end}");
    }
}

#[test]
fn without_zones_the_artifact_says_so_and_holds_the_global_run_alone() {
    let (global, zones) = (global(), zones(json!([])));
    let out = compare(&[
        MemoryInput {
            cost: [1.0, 2.0, 0.0],
            ..MemoryInput::new("global", &global)
        },
        MemoryInput::new("zones", &zones),
    ]);
    for name in ["zone_count", "wrinkle_count", "bridging_count"] {
        assert_eq!(out.result(name), 0.0, "{name}");
    }
    assert_eq!(out.attributes["defects"], json!([]));
    assert_eq!(out.attributes["models"].as_array().unwrap().len(), 1);
    assert!(out.bodies.is_empty() && out.times.is_empty());
    assert!((out.result("shear_max") - 0.230 / 0.8).abs() < 1e-9);
    assert_eq!(out.measured["cost.total.cpu_seconds"].0, 2.0);
}

#[test]
fn quantiles_are_linear_between_ordered_values() {
    let values = [4.0, 1.0, 3.0, 2.0, 5.0];
    assert_eq!(
        quantiles(&values, &[0.0, 0.25, 0.5, 0.875, 1.0]),
        [1.0, 2.0, 3.0, 4.5, 5.0]
    );
    assert_eq!(quantiles(&[], &[0.5]), [0.0]);
}
