//! Several ways to one answer, measured by a whole reference, or by the fine runs of the zones where there is none.

mod common;

use common::*;
use plyflow_comparison::Comparison;
use plyflow_testing::{MemoryArtifact, MemoryInput, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

/// A run of the whole blank with elements of `size` (m).
fn whole(size: f64, f: impl Fn(f64, f64) -> f64) -> MemoryArtifact {
    formed(
        vec![ply("ply_1", BLANK, size, OFFSET, f)],
        size,
        Value::Null,
    )
}

fn other<'a>(step: &'a str, artifact: &'a MemoryArtifact, cost: f64) -> MemoryInput<'a> {
    MemoryInput {
        step,
        cost: [cost, cost, 1e9 * cost],
        ..MemoryInput::new("others", artifact)
    }
}

#[test]
fn every_other_run_is_measured_by_the_reference_and_costs_nothing_of_the_two_stages() {
    let (global, local, zones) = (global(), local(1.0), zones(json!([zone_a()])));
    let reference = whole(0.00125, height(1.0));
    let (flat, same) = (whole(0.008, |_, _| 0.0), whole(0.00125, height(1.0)));
    let out = compare(&[
        MemoryInput {
            cost: [10.0, 10.0, 1e6],
            ..MemoryInput::new("global", &global)
        },
        MemoryInput::new("zones", &zones),
        MemoryInput {
            cost: [30.0, 20.0, 3e6],
            ..MemoryInput::new("local", &local)
        },
        other("drape", &flat, 1.0),
        other("again", &same, 200.0),
        MemoryInput {
            cost: [100.0, 100.0, 1e7],
            ..MemoryInput::new("reference", &reference)
        },
    ]);
    assert_eq!(out.attributes["measured_by"], "reference");
    for name in [
        "defect_error",
        "position_error",
        "distance_error",
        "shear_quantile_error",
    ] {
        assert!(out.result(&format!("{name}.other.again")) < 1e-9, "{name}");
        assert!(out.result(&format!("{name}.other.drape")) > 1e-4, "{name}");
    }
    assert_eq!(out.result("missed_wrinkles.other.drape"), 1.0);
    assert_eq!(out.result("missed_bridging.other.drape"), 1.0);
    assert_eq!(out.measured["cost.other.drape.cpu_seconds"].0, 1.0);
    assert_eq!(out.measured["cost.total.cpu_seconds"].0, 30.0);
    assert_eq!(out.measured["peak_memory.total"].0, 3e6);
    assert_eq!(out.measured["cost_saving"].0, 0.7);
    let models = out.attributes["models"].as_array().unwrap();
    let roles: Vec<&str> = models.iter().filter_map(|m| m["role"].as_str()).collect();
    assert_eq!(roles, ["global", "local", "other", "other", "reference"]);
    // The ways as data, without what they cost: an artifact holds what is reproducible.
    let ways = out.attributes["ways"].as_array().unwrap();
    let told: Vec<&str> = ways.iter().filter_map(|w| w["model"].as_str()).collect();
    assert_eq!(
        told,
        ["global", "other.drape", "other.again", "total", "reference"]
    );
    for (way, suffix) in ways
        .iter()
        .zip([".global", ".other.drape", ".other.again", ""])
    {
        let errors = way["errors"].as_object().unwrap();
        assert!(errors.len() >= 8, "{way}");
        for (name, value) in errors {
            let result = out.result(&format!("{name}{suffix}"));
            assert_eq!(value.as_f64(), Some(result), "{name}{suffix}");
        }
    }
    assert_eq!(ways[4]["errors"], json!({}));
    let elements: Vec<u64> = [0, 3].map(|k| ways[k]["elements"].as_u64().unwrap()).into();
    assert_eq!(elements[1], elements[0] + 128 * 80);
    assert!(!out.attributes.to_string().contains("seconds"));
}

/// The total errors and those by class are those of what the two runs are reported to have, for the zones and for the coarse run by itself.
#[test]
fn total_errors_and_classes_are_those_of_the_sizes_that_are_reported() {
    let (global, local, zones) = (global(), local(0.9), zones(json!([zone_a()])));
    let reference = whole(0.00125, height(1.0));
    let inputs = [
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &local),
        MemoryInput::new("reference", &reference),
    ];
    let out = compare(&inputs);
    let [ours, theirs] =
        ["wrinkle_length.AW1", "reference_wrinkle_length.AW1"].map(|n| out.result(n));
    let [area, their_area] =
        ["bridging_area.AB1", "reference_bridging_area.AB1"].map(|n| out.result(n));
    let (length, area) = (
        (ours - theirs).abs() / theirs,
        (area - their_area).abs() / their_area,
    );
    assert!(length > 0.001 && area > 0.01, "{length} {area}");
    let is = |name: &str, expected: f64| {
        let found = out.result(name);
        assert!(
            (found - expected).abs() < 1e-9,
            "{name}: {found}, expected {expected}"
        );
    };
    // The wrinkle is about 50 mm long, the bridging at (40, 0) mm about 490 mm2.
    for ending in ["", ".paired", ".long"] {
        is(&format!("wrinkle_length_total_error{ending}"), length);
    }
    assert!(
        theirs > 0.040 && their_area > 200e-6 && their_area < 500e-6,
        "{theirs} {their_area}"
    );
    is("bridging_area_total_error.medium", area);
    is("bridging_area_error.medium", area);
    is("defect_total_error", 0.5 * (length + area));
    is(
        "wrinkle_amplitude_total_error",
        out.result("wrinkle_amplitude_error"),
    );
    is("wrinkle_pairs.long", 1.0);
    is("wrinkle_pairs.short", 0.0);
    // The coarse run shows nothing: all of the reference is missed.
    for name in [
        "defect_total_error",
        "wrinkle_length_total_error",
        "bridging_area_total_error.missed",
    ] {
        is(&format!("{name}.global"), 1.0);
    }
    is("wrinkle_length_total_error.paired.global", 0.0);
    is("missed_wrinkles.long.global", 1.0);
    is("wrinkle_pairs.global", 0.0);
    is("wrinkle_class_from.long", 0.040);

    // Bounds of one's own.
    let classes = json!({"wrinkle_classes": [0.1, 0.2], "bridging_classes": [1e-4, 2e-4]});
    let out = run::<Comparison>(classes, &inputs, &[]).unwrap();
    assert_eq!(out.result("wrinkle_pairs.short"), 1.0);
    assert_eq!(out.result("bridging_pairs.large"), 1.0);
    assert_eq!(out.result("bridging_class_from.large"), 2e-4);
}

#[test]
fn around_the_zones_the_global_run_counts_and_in_them_the_fine_runs() {
    let (local, zones) = (local(1.0), zones(json!([zone_a()])));
    let reference = whole(0.00125, height(1.0));
    let lifted = whole(0.010, |_, _| 0.002);
    let out = compare(&[
        MemoryInput::new("global", &lifted),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &local),
        MemoryInput::new("reference", &reference),
    ]);
    // The global run is 2 mm off everywhere outside of the zone, whose defects the local run has exactly. Nodes count by their areas, those on the
    // blank's edge by half.
    let [x0, y0, x1, y1] = [0, 1, 2, 3].map(|k| (ZONE[k] / 0.00125).round());
    let inside = (x1 - x0 + 1.0) * (y1 - y0 + 1.0);
    let [x0, y0, x1, y1] = [0, 1, 2, 3].map(|k| (BLANK[k] / 0.00125).round());
    let all = (x1 - x0) * (y1 - y0);
    let expected = 0.002 * ((all - inside) / all).sqrt();
    for name in ["distance_error", "position_error"] {
        assert!((out.result(name) / expected - 1.0).abs() < 1e-9, "{name}");
        assert!(out.result(&format!("{name}.local.A")) < 1e-12);
        assert!(out.result(&format!("{name}.global")) > out.result(name));
    }
}

#[test]
fn without_a_reference_the_fine_runs_measure_the_others_in_their_zones() {
    let (local, zones) = (local(1.0), zones(json!([zone_a()])));
    // Within the zone as the local run; far outside a wrinkle more, which nobody can judge.
    let odd = |x: f64, y: f64| height(1.0)(x, y) + height(1.0)(x - 0.17, y - 0.08);
    let (flat, fine) = (whole(0.010, |_, _| 0.0), whole(0.00125, odd));
    let out = compare(&[
        MemoryInput::new("global", &flat),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &local),
        other("fine", &fine, 1.0),
    ]);
    assert_eq!(out.attributes["measured_by"], "zones");
    // One node lies on the threshold, on this or that side by rounding: its area is 0.3 % of the bridging.
    assert!(out.result("defect_error.other.fine") < 0.002);
    assert!(out.result("position_error.other.fine") < 1e-9);
    for kind in ["wrinkles", "bridging"] {
        let count = |what: &str, way: &str| out.result(&format!("{what}_{kind}.{way}"));
        assert_eq!(count("false", "other.fine"), 0.0);
        assert_eq!(
            (count("missed", "global"), count("false", "global")),
            (1.0, 0.0)
        );
    }
    // The two stages are the measure: they have no error of their own.
    assert!(!out.results.contains_key("defect_error"));
    assert!(!out.results.contains_key("position_error"));
    assert!(!out.measured.contains_key("cost_saving"));
}

/// A wrinkle along x over the whole blank: what of it lies beyond the zone is neither missed, nor false, nor too long.
#[test]
fn without_a_reference_what_lies_outside_of_the_zones_counts_for_nobody() {
    let ridge = |_: f64, y: f64| 0.0015 * (1.0 + (PI * (y / 0.007).clamp(-1.0, 1.0)).cos());
    let same = whole(0.002, ridge);
    // The zone's mesh reaches past it by an element.
    let [x0, y0, x1, y1] = ZONE;
    let mesh = [x0 - 0.002, y0 - 0.002, x1 + 0.002, y1 + 0.002];
    let local = formed(
        vec![ply("ply_1", mesh, 0.002, OFFSET, ridge)],
        0.002,
        zone_a(),
    );
    let zones = zones(json!([zone_a()]));
    let out = compare(&[
        MemoryInput::new("global", &same),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &local),
    ]);
    assert!((out.result("wrinkle_length.AW1") - 0.160).abs() < 1e-6);
    for error in [
        "wrinkle_length_error",
        "wrinkle_amplitude_error",
        "defect_error",
    ] {
        let found = out.result(&format!("{error}.global"));
        assert!(found < 1e-6, "{error}: {found}");
    }
}

/// What a zone's mesh has beyond the zone is the surroundings' business, beside a reference too.
#[test]
fn a_wrinkle_in_the_strip_past_a_zone_is_nobodys() {
    let ridge = |middle: f64| {
        move |_: f64, y: f64| 0.0015 * (1.0 + (PI * ((y - middle) / 0.007).clamp(-1.0, 1.0)).cos())
    };
    let [x0, y0, x1, y1] = ZONE;
    let mesh = [x0, y0, x1, y1 + 0.016];
    let beyond = vec![ply("ply_1", mesh, 0.002, OFFSET, ridge(y1 + 0.008))];
    let local = formed(beyond, 0.002, zone_a());
    let (global, zones) = (global(), zones(json!([zone_a()])));
    let flat = whole(0.002, |_, _| 0.0);
    let out = compare(&[
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &local),
        MemoryInput::new("reference", &flat),
    ]);
    assert_eq!(out.result("false_wrinkles"), 0.0);
    // Nor is it an error of the coarse run where the fine runs are the measure.
    let out = compare(&[
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &local),
    ]);
    assert_eq!(out.result("missed_wrinkles.global"), 0.0);
    assert!(out.result("position_error.global") < 1e-9);
}

/// A whole that begins late is the run of a zone over all of the blank: a measure like another, but no measure of what is saved.
#[test]
fn the_run_of_a_zone_over_the_blank_is_a_reference_and_nothing_is_saved_against_half_a_process() {
    let (global, local, zones) = (global(), local(1.0), zones(json!([zone_a()])));
    let blank = json!({"name": "A", "box": BLANK, "free_sides": vec![true; 4], "plies": ["ply_1"]});
    let mut late = formed(
        vec![ply("ply_1", BLANK, 0.00125, OFFSET, height(1.0))],
        0.00125,
        blank,
    );
    late.times = vec![0.6, 1.0];
    for body in &mut late.bodies {
        let last = |all: &mut Vec<Vec<_>>| all.extend(all.first().cloned());
        last(&mut body.frames);
        body.fields.extend(body.fields.first().cloned());
    }
    // It leaves its tool out, as runs of zones may.
    late.bodies.retain(|b| b.name != "tool");
    let cost = |port, artifact, cost| MemoryInput {
        cost: [cost, cost, 1e6],
        ..MemoryInput::new(port, artifact)
    };
    let mut inputs = vec![
        cost("global", &global, 10.0),
        cost("zones", &zones, 0.0),
        cost("local", &local, 20.0),
        cost("reference", &late, 100.0),
    ];
    let out = compare(&inputs);
    assert_eq!(out.attributes["measured_by"], "reference");
    assert!(out.result("wrinkle_length_error") < 0.01);
    assert_eq!(out.result("missed_wrinkles.global"), 1.0);
    assert_eq!(out.measured["cost.reference.cpu_seconds"].0, 100.0);
    assert!(!out.measured.contains_key("cost_saving"));
    assert_eq!(out.result("start_time.reference"), 0.6);
    let ways = out.attributes["ways"].as_array().unwrap();
    assert_eq!(ways.last().unwrap()["start_time"], 0.6);
    assert_eq!(ways[0]["start_time"], Value::Null);
    assert!(!out.results.contains_key("start_time.global"));

    // The global run began late: what it began from is in no cost, but where it is given.
    let mut driving = late.clone();
    let mut tool = global.body("tool").clone();
    tool.frames.extend(tool.frames.first().cloned());
    tool.fields.extend(tool.fields.first().cloned());
    driving.bodies.push(tool);
    inputs[0] = cost("global", &driving, 10.0);
    inputs[3] = cost("reference", &global, 100.0);
    let out = compare(&inputs);
    let started = |out: &MemoryArtifact, way: &str| {
        let ways = out.attributes["ways"].as_array().unwrap();
        let way = ways.iter().find(|w| w["model"] == way).unwrap();
        way["start_time"].as_f64()
    };
    let both = ["global", "total"];
    assert_eq!(
        both.map(|w| out.result(&format!("start_time.{w}"))),
        [0.6; 2]
    );
    assert_eq!(both.map(|w| started(&out, w)), [Some(0.6); 2]);
    assert!(!out.measured.contains_key("cost_saving"));
    inputs.push(cost("earlier", &global, 5.0));
    let out = compare(&inputs);
    assert_eq!(both.map(|w| started(&out, w)), [None; 2]);
    assert_eq!(out.measured["cost.global.cpu_seconds"].0, 15.0);
    assert!((out.measured["cost_saving"].0 - 0.65).abs() < 1e-12);
    inputs.pop();
    inputs[0] = cost("global", &global, 10.0);
    inputs[3] = cost("reference", &late, 100.0);

    inputs.push(cost("reference", &late, 100.0));
    let error = run::<Comparison>(json!({}), &inputs, &[]).unwrap_err();
    let message = format!("{error:?}");
    assert!(message.contains("reference: given 2 runs"), "{message}");
}
