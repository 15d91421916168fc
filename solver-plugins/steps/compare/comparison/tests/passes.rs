//! Runs of several passes, and of zones that were drawn again: which is measured, and what all of them cost.

mod common;

use common::*;
use plyflow_comparison::Comparison;
use plyflow_testing::{MemoryArtifact, MemoryInput, run};
use serde_json::{Value, json};

#[test]
fn of_several_passes_the_last_is_measured_and_all_cost() {
    let with = |cycles: f64, mut run: MemoryArtifact| {
        run.attributes["element_cycles"] = json!(cycles);
        run
    };
    let (first, second) = (with(30.0, local(1.0)), with(50.0, local(0.5)));
    let (global, zones) = (with(7.0, global()), zones(json!([zone_a()])));
    // Memory here the larger, the earlier: 1 / CPU time.
    let costing = |cpu: f64, input| MemoryInput {
        cost: [cpu, cpu, 1.0 / cpu],
        ..input
    };
    let inputs = [
        MemoryInput::new("zones", &zones),
        costing(1.0, MemoryInput::new("global", &global)),
        costing(2.0, MemoryInput::new("global", &global)),
        costing(4.0, MemoryInput::new("local", &first)),
        costing(
            8.0,
            MemoryInput {
                step: "local_2",
                ..MemoryInput::new("local", &second)
            },
        ),
    ];
    let out = compare(&inputs);
    let alone = compare(&[inputs[0], inputs[2], inputs[4]]);
    assert_eq!(out.attributes["defects"], alone.attributes["defects"]);
    // The second coarse run stands on the first and on its fine run.
    assert_eq!(out.measured["cost.global.cpu_seconds"].0, 7.0);
    assert_eq!(out.measured["peak_memory.global"].0, 1.0);
    assert_eq!(out.measured["peak_memory.local.A"].0, 0.125);
    assert_eq!(alone.measured["peak_memory.global"].0, 0.5);
    assert_eq!(out.result("passes"), 2.0);
    assert!(!alone.results.contains_key("passes"));
    assert_eq!(out.measured["cost.local.A.cpu_seconds"].0, 8.0);
    assert_eq!(out.measured["cost.superseded.cpu_seconds"].0, 5.0);
    assert_eq!(out.measured["cost.total.cpu_seconds"].0, 15.0);
    let cycles = |out: &MemoryArtifact, way: &str| {
        let ways = out.attributes["ways"].as_array().unwrap();
        let way = ways.iter().find(|w| w["model"] == way).unwrap();
        way["element_cycles"].as_f64().unwrap()
    };
    assert_eq!(
        [cycles(&out, "global"), cycles(&out, "total")],
        [44.0, 94.0]
    );
    let one_pass = ["global", "total"].map(|way| cycles(&alone, way));
    assert_eq!(one_pass, [7.0, 57.0]);
}

#[test]
fn a_local_run_of_no_zone_or_of_a_taken_one_is_refused() {
    let (global, local, zones) = (global(), local(1.0), zones(json!([zone_a()])));
    let twice = [
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput::new("local", &local),
        MemoryInput::new("local", &local),
    ];
    let error = run::<Comparison>(json!({}), &twice, &[]).unwrap_err();
    assert!(error.contains("two local runs belong to zone A"), "{error}");
    // A second run of a zone is that of a later pass: of another step, and with a global run of its own.
    let of = |step, item| MemoryInput {
        step,
        item,
        ..MemoryInput::new("local", &local)
    };
    let refused = |globals: usize, locals: &[MemoryInput<'_>]| {
        let mut inputs = vec![twice[0]; globals];
        inputs.push(twice[1]);
        inputs.extend(locals);
        run::<Comparison>(json!({}), &inputs, &[]).unwrap_err()
    };
    let error = refused(2, &[of("local", &[0, 0]), of("local", &[1, 0])]);
    assert!(
        error.contains("'local' [0, 0] and 'local' [1, 0]") && error.contains("of another zone"),
        "{error}"
    );
    let error = refused(1, &[of("local", &[0]), of("local_2", &[0, 0])]);
    assert!(
        error.contains("there are 1 global runs") && error.contains("`earlier`"),
        "{error}"
    );
    let error = refused(
        2,
        &[of("local", &[0]), of("local_2", &[0]), of("local_3", &[0])],
    );
    assert!(error.contains("there are 2 global runs"), "{error}");
    // One that names no zone is of the zone at its place, where it has one place alone.
    let mut nameless = local.clone();
    nameless.attributes["zone"] = Value::Null;
    let inputs = |item| {
        [
            twice[0],
            twice[1],
            MemoryInput {
                item,
                ..MemoryInput::new("local", &nameless)
            },
        ]
    };
    assert_eq!(compare(&inputs(&[0])).result("wrinkle_count"), 1.0);
    let error = run::<Comparison>(json!({}), &inputs(&[1, 0]), &[]).unwrap_err();
    assert!(
        error.contains("names no zone (attribute `zone`)"),
        "{error}"
    );
    let mut lost = local.clone();
    lost.attributes["zone"]["name"] = json!("Q");
    let inputs = [twice[0], twice[1], MemoryInput::new("local", &lost)];
    let error = run::<Comparison>(json!({}), &inputs, &[]).unwrap_err();
    assert!(
        error.contains("zone 'Q'") && error.contains("the zones are: A"),
        "{error}"
    );
}

#[test]
fn a_zone_that_was_drawn_again_counts_in_its_largest_form_and_the_cost_of_all() {
    // A was too small and B too near it: the new A takes the place of both.
    let small = json!({"name": "A", "box": [-0.060, -0.020, -0.010, 0.020], "free_sides": vec![false; 4], "plies": []});
    let beside = json!({"name": "B", "box": [0.0, -0.020, 0.060, 0.020], "free_sides": vec![false; 4], "plies": []});
    let mut again = zone_a();
    again["replaces"] = json!(["B"]);
    let (global, grown) = (global(), zones(json!([again])));
    let first = zones(json!([small, beside]));
    let of = |zone: &Value| {
        let mut run_off = local(1.0);
        run_off.attributes["zone"] = zone.clone();
        run_off
    };
    let locals = [of(&small), of(&beside), of(&again)];
    let mut inputs = vec![
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &first),
        MemoryInput::new("zones", &grown),
    ];
    inputs.extend(locals.iter().map(|l| MemoryInput {
        cost: [20.0, 10.0, 0.0],
        ..MemoryInput::new("local", l)
    }));
    let out = compare(&inputs);
    assert_eq!(out.result("zone_count"), 1.0);
    assert_eq!(out.result("wrinkle_count"), 1.0);
    assert_eq!(out.attributes["models"].as_array().unwrap().len(), 2);
    assert_eq!(out.measured["cost.superseded.cpu_seconds"].0, 20.0);
    assert_eq!(out.measured["cost.total.cpu_seconds"].0, 30.0);
    // A local run of no box that is known is refused still.
    let mut other = of(&small);
    other.attributes["zone"]["box"] = json!([0.0, 0.0, 0.01, 0.01]);
    inputs[3] = MemoryInput::new("local", &other);
    let error = run::<Comparison>(json!({}), &inputs, &[]).unwrap_err();
    assert!(error.contains("zone 'A'"), "{error}");
}

#[test]
fn runs_of_earlier_passes_are_not_measured_but_paid_for() {
    let (global, local, zones) = (global(), local(1.0), zones(json!([zone_a()])));
    let cost = |port, artifact, seconds: f64| MemoryInput {
        cost: [seconds, 2.0 * seconds, 0.0],
        ..MemoryInput::new(port, artifact)
    };
    let out = compare(&[
        cost("global", &global, 10.0),
        MemoryInput::new("zones", &zones),
        cost("local", &local, 30.0),
        cost("earlier", &global, 100.0),
        cost("earlier", &local, 300.0),
    ]);
    assert_eq!(
        out.measured["cost.superseded.wall_seconds"],
        (400.0, "s".into())
    );
    assert_eq!(out.measured["cost.total.cpu_seconds"], (880.0, "s".into()));
    assert_eq!(out.attributes["models"].as_array().unwrap().len(), 2);
}
