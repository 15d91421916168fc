//! Plies of different outlines in one bag and in one press: each touches what really lies under and over it.

mod common;

use common::form;
use common::scenes::{bag, press};
use plyflow_forming_explicit::run::Forming;
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
    let (forming, outcome) = form(&bag(2, staggered), 2);
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
fn equal_plies_touch_their_neighbours_alone() {
    let names = |p| -> Vec<String> {
        let model = plyflow_forming_explicit::build_global(&p, &common::BuiltIn)
            .unwrap()
            .model;
        let rigid = model.rigid_contacts.iter().map(|c| c.name.clone());
        rigid
            .chain(model.sheet_contacts.iter().map(|c| c.name.clone()))
            .collect()
    };
    let bag = names(bag(3, |_| {}));
    assert!(
        bag.contains(&"ply_2/ply_3".into()) && bag.contains(&"tool/ply_3".into()),
        "{bag:?}"
    );
    let far = [
        "lower/ply_2",
        "lower/ply_3",
        "ply_1/ply_3",
        "upper/ply_1",
        "upper/ply_2",
    ];
    for pair in far {
        assert!(!bag.contains(&pair.into()), "{pair} in {bag:?}");
    }
    assert!(bag.iter().all(|n| !n.contains("beside")), "{bag:?}");
    let gap = json!({"gap": "0.003 m"});
    let equal = names(press(3, &gap, |_| {}));
    assert!(
        equal
            .iter()
            .all(|n| n != "ply_1/ply_3" && !n.contains("beside")),
        "{equal:?}"
    );
    // The middle one is a strip: the die reaches those beside it past it, and they each other.
    let strip = names(press(3, &gap, |p| {
        p["scene"]["sheets"][1]["width"] = json!("0.03 m")
    }));
    for pair in [
        "ply_1/ply_3",
        "die/ply_1/beside_ply_2",
        "tool/ply_3/beside_ply_2",
    ] {
        assert!(strip.contains(&pair.into()), "{pair} in {strip:?}");
    }
    // The artifact has arrays of these names.
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-./".contains(c);
    assert!(strip.iter().all(|n| n.chars().all(plain)), "{strip:?}");
}

#[test]
fn friction_of_what_meets_past_a_ply_can_be_named() {
    let pair = json!([{"between": ["lower", "ply_2"], "coefficient": 0.1}]);
    let build = |p| plyflow_forming_explicit::build_global(&p, &common::BuiltIn);
    let equal = build(bag(2, |p| p["scene"]["friction"]["pairs"] = pair.clone()));
    assert!(equal.err().unwrap().contains("do not rub on each other"));
    let model = build(bag(2, |p| {
        staggered(p);
        p["scene"]["friction"]["pairs"] = pair.clone();
    }))
    .map_err(|e| panic!("{e}"));
    let contacts = model.unwrap().model.sheet_contacts;
    let law = |name: &str| {
        let found = contacts.iter().find(|c| c.name == name).unwrap();
        format!("{:?}", found.friction)
    };
    assert_eq!(law("lower/ply_2"), "Constant(0.1)");
    assert_eq!(law("lower/ply_1"), "Constant(0.4)");
}
