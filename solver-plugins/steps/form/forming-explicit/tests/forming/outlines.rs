//! Plies of different outlines in one bag and in one press: each touches what really lies under and over it.

use crate::common::form;
use crate::common::scenes::{bag, press};
use plyflow_forming_explicit::Forming;
use plyflow_mechanics::model::Model;
use serde_json::json;

/// Mean height (m) of a body's nodes within a strip across x (m), near the middle of the width.
fn height(forming: &Forming, name: &str, [from, to]: [f64; 2]) -> f64 {
    let body = forming.bodies.iter().find(|b| b.name == name).unwrap();
    let points = forming.points(body);
    let inside = |p: &&[f64; 3]| from < p[0] && p[0] < to && p[1].abs() < 0.016;
    let heights: Vec<f64> = points.iter().filter(inside).map(|p| p[2]).collect();
    assert!(heights.len() >= 5, "{name}: {} nodes", heights.len());
    heights.iter().sum::<f64>() / heights.len() as f64
}

/// Two plies that overlap in the middle third of a block alone.
fn staggered(p: &mut serde_json::Value) {
    for (k, centre) in [(1, "-0.02 m"), (2, "0.02 m")] {
        let ply = &mut p["scene"]["sheets"][k];
        ply["length"] = json!("0.08 m");
        ply["centre"] = json!([centre, "0 m"]);
    }
    // Wide enough for both ends, and finer than the steps between them.
    p["scene"]["tool"]["flat"]["length"] = json!("0.13 m");
    p["element_size"] = json!(0.005);
    p["time_step"] = json!(9e-6);
}

#[test]
fn plies_that_overlap_in_part_lie_on_the_film_and_under_it_where_the_other_one_is_not() {
    let (forming, outcome) = form(&bag(2, staggered), 1);
    assert!(
        outcome.health.peak_drift_ratio < 0.02,
        "{:?}",
        outcome.health
    );
    let [film, ply] = [0, 1].map(|k| forming.stack[k].thickness);
    let top = 0.02 + film;
    let (left, middle, right) = ([-0.045, -0.03], [-0.01, 0.01], [0.03, 0.045]);
    for (name, strip, expected) in [
        ("ply_1", left, top + 0.5 * ply),
        ("ply_1", middle, top + 0.5 * ply),
        ("ply_2", middle, top + 1.5 * ply),
        ("ply_2", right, top + 0.5 * ply),
        ("upper", left, top + ply + 0.5 * film),
        ("upper", middle, top + 2.0 * ply + 0.5 * film),
        ("upper", right, top + ply + 0.5 * film),
    ] {
        let found = height(&forming, name, strip);
        // A sixth of a ply; a missing one is six times that.
        let bound = 6e-5;
        assert!(
            (found - expected).abs() < bound,
            "{name} in {strip:?}: {found} instead of {expected}"
        );
    }
    for pair in ["lower/ply_2", "upper/ply_1"] {
        let all = forming.penetrations();
        let found = all.iter().find(|p| p.pair == pair);
        let found = found.unwrap_or_else(|| panic!("no {pair} in {all:?}"));
        assert!(found.nodes > 30 && found.overlap() < 0.2, "{found:?}");
    }
}

#[test]
fn any_two_sheets_of_a_stack_have_a_contact_whatever_their_outlines() {
    let names = |p| -> Vec<String> {
        let model = plyflow_forming_explicit::build_global(&p, &crate::common::BuiltIn)
            .unwrap()
            .model;
        let rigid = model.rigid_contacts().iter().map(|c| c.name.clone());
        rigid
            .chain(model.sheet_contacts().iter().map(|c| c.name.clone()))
            .collect()
    };
    let gap = json!({"gap": "0.003 m"});
    let small = |p: &mut serde_json::Value, k: usize| {
        p["scene"]["sheets"][k]["width"] = json!("0.03 m");
    };
    let between = ["ply_1/ply_2", "ply_1/ply_3", "ply_2/ply_3"];
    let in_bag = [
        "lower/ply_1",
        "lower/ply_2",
        "lower/ply_3",
        "upper/ply_1",
        "upper/ply_2",
        "upper/ply_3",
        "lower/upper",
        "tool/ply_3",
        "tool/ply_3/beside_ply_1_ply_2",
    ];
    let in_press = [
        "die/ply_1",
        "die/ply_1/beside_ply_2_ply_3",
        "tool/ply_3",
        "tool/ply_3/beside_ply_1_ply_2",
        "holder/ply_2/beside_ply_1",
    ];
    for unequal in [false, true] {
        let bag = names(bag(3, |p| {
            if unequal {
                small(p, 2)
            }
        }));
        let press = names(press(3, &gap, |p| {
            if unequal {
                small(p, 1)
            }
        }));
        for (found, more) in [(&bag, &in_bag[..]), (&press, &in_press[..])] {
            for pair in between.iter().chain(more) {
                let count = found.iter().filter(|n| n == pair).count();
                assert_eq!(count, 1, "{pair} in {found:?}");
            }
            // The artifact has arrays of these names.
            let plain = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
            assert!(found.iter().all(|n| n.chars().all(plain)), "{found:?}");
        }
    }
}

#[test]
fn friction_of_what_meets_past_a_ply_can_be_named_and_else_is_that_of_its_neighbours() {
    let build = |p| {
        plyflow_forming_explicit::build_global(&p, &crate::common::BuiltIn)
            .map_err(|e| panic!("{e}"))
            .unwrap()
            .model
    };
    let law = |model: &Model, name: &str| {
        let found = model
            .sheet_contacts()
            .iter()
            .find(|c| c.name == name)
            .unwrap();
        format!("{:?}", found.friction)
    };
    let pair = json!([{"between": ["lower", "ply_2"], "coefficient": 0.1}]);
    for unequal in [false, true] {
        let contacts = build(bag(2, |p| {
            if unequal {
                staggered(p);
            }
            p["scene"]["friction"]["pairs"] = pair.clone();
        }));
        assert_eq!(law(&contacts, "lower/ply_2"), "Constant(0.1)");
        assert_eq!(law(&contacts, "lower/ply_1"), "Constant(0.4)");
    }
    // A scene that gives its plies' friction pair by pair need not know of the first and the third.
    let contacts = build(bag(3, |p| {
        let pair = |a, b, mu| json!({"between": [a, b], "coefficient": mu});
        let friction = &mut p["scene"]["friction"];
        friction["pairs"] = json!([pair("ply_1", "ply_2", 0.2), pair("ply_3", "ply_2", 0.3)]);
        friction.as_object_mut().unwrap().remove("fabric_fabric");
    }));
    assert_eq!(law(&contacts, "ply_1/ply_3"), "Constant(0.2)");
    assert_eq!(law(&contacts, "ply_2/ply_3"), "Constant(0.3)");
}
