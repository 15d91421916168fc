//! The step on runs whose defects are known: which stay, hang on something, are gone or new.

mod common;

use common::*;
use plyflow_testing::{MemoryArtifact, MemoryInput, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

const SIZE: f64 = 0.00125;
const FINER: f64 = 0.001;

fn base() -> MemoryArtifact {
    fine(("A", ZONE), SIZE, USUAL)
}

fn number(of: &Value) -> f64 {
    of.as_f64().unwrap_or_else(|| panic!("{of} is no number"))
}

#[test]
fn defects_that_every_variant_has_with_the_same_sizes_stay() {
    let base = base();
    let finer = fine(("A", ZONE), FINER, USUAL);
    let mut slower = base.clone();
    slower.attributes["slower"] = json!(2.0);
    let mut half_step = base.clone();
    half_step.attributes["time_step"] = json!(2e-6);
    let wider = fine(("B", WIDE), SIZE, USUAL);
    let out = confirmed(
        &base,
        &[
            ("finer", &finer),
            ("slower", &slower),
            ("half_step", &half_step),
            ("wider", &wider),
        ],
    )
    .unwrap();
    assert_eq!(
        (out.result("defect_count"), out.result("stay_count")),
        (2.0, 2.0)
    );
    assert_eq!(
        (
            out.result("verdict_stays"),
            out.result("new_count"),
            out.result("outside_count")
        ),
        (1.0, 0.0, 0.0)
    );
    for id in ["AW1", "AB1"] {
        let told = defect(&out, id);
        assert_eq!(
            (&told["stands"], &told["hangs_on"]),
            (&json!("stays"), &json!([])),
            "{told}"
        );
        assert!(
            told["text"].as_str().unwrap().ends_with(", stays"),
            "{told}"
        );
        assert_eq!(out.result(&format!("stays.{id}")), 1.0);
    }
    // The true amplitudes lie between the bounds.
    for (id, true_value) in [("AW1", 0.003), ("AB1", 0.002)] {
        let low = out.result(&format!("amplitude_low.{id}"));
        let high = out.result(&format!("amplitude_high.{id}"));
        assert!(
            low <= true_value + 1e-9 && true_value <= high + 1e-9,
            "{id}: {low} {high}"
        );
        assert!(high - low < 1e-4, "{id}: {low} {high}");
    }
    // 1 mm (1 + cos) exceeds 1 mm within 12.5 mm.
    let circle = PI * 0.0125f64.powi(2);
    let (low, high) = (out.result("area_low.AB1"), out.result("area_high.AB1"));
    assert!(low < circle && circle < high, "{low} {high}");
    let text = out.attributes["verdict"]["text"].as_str().unwrap();
    assert_eq!(
        text,
        "the verdict stays: there are wrinkles and bridging; 2 of 2 defects stay"
    );
    assert!(out.attributes["left_out"].as_array().unwrap().is_empty());
    assert_eq!(out.attributes["variants"].as_array().unwrap().len(), 4);
}

#[test]
fn defects_are_numbered_as_a_comparison_numbers_them_from_the_uppermost_ply_down() {
    // A second ply above it with a longer wrinkle.
    let two_plies = |size: f64| {
        let mut run = fine(("A", ZONE), size, USUAL);
        let longer = Shape {
            half_length: 0.030,
            ..USUAL
        };
        let mut upper = fine(("A", ZONE), size, longer).bodies[1].clone();
        upper.name = "ply_2".into();
        run.bodies.push(upper);
        let sheet = json!({"name": "ply_2", "kind": "ply", "thickness": 0.0004, "offset": OFFSET});
        let sheets = run.attributes["sheets"].as_array_mut().unwrap();
        sheets.push(sheet);
        run
    };
    let out = confirmed(&two_plies(SIZE), &[("finer", &two_plies(FINER))]).unwrap();
    let all = out.attributes["defects"].as_array().unwrap();
    let named: Vec<[&str; 2]> = (all.iter())
        .map(|d| ["id", "ply"].map(|k| d[k].as_str().unwrap()))
        .collect();
    let expected = [
        ["AW1", "ply_2"],
        ["AB1", "ply_2"],
        ["AW2", "ply_1"],
        ["AB2", "ply_1"],
    ];
    assert_eq!(named, expected);
    let length = |id: &str| number(&defect(&out, id)["sizes"]["length"]["value"]);
    assert!(length("AW1") > length("AW2") + 0.005);
}

#[test]
fn a_size_that_converges_with_order_two_is_bounded_and_its_order_observed() {
    // Heights that the mesh has wrong by C h^2, as an element of second order would.
    let at = |size: f64| {
        let wrong = 100.0 * size * size;
        fine(
            ("A", ZONE),
            size,
            Shape {
                wrinkle: 0.003 + wrong,
                blister: 0.002 + wrong,
                ..USUAL
            },
        )
    };
    let runs = [0.002, 0.00125, 0.001].map(at);
    let two = confirmed(&runs[0], &[("finer", &runs[1])]).unwrap();
    let three = confirmed(&runs[0], &[("finer", &runs[2]), ("finer", &runs[1])]).unwrap();
    for (id, limit) in [("AW1", 0.003), ("AB1", 0.002)] {
        for out in [&two, &three] {
            let size = &defect(out, id)["sizes"]["amplitude"];
            let (low, high) = (number(&size["low"]), number(&size["high"]));
            assert!(low <= limit && limit <= high, "{id}: {size}");
        }
        let order = &defect(&two, id)["sizes"]["amplitude"]["order"];
        assert_eq!(order, &Value::Null);
        let order = number(&defect(&three, id)["sizes"]["amplitude"]["order"]);
        // A crest is told from nodes that the meshes do not share: not to the last digit.
        assert!((1.7..=2.0).contains(&order), "{id}: {order}");
        let width = |out| {
            let size = &defect(out, id)["sizes"]["amplitude"];
            number(&size["high"]) - number(&size["low"])
        };
        assert!(width(&three) < width(&two), "{id}");
    }
}

#[test]
fn a_defect_that_a_variant_has_not_is_gone_and_the_verdict_hangs_on_it() {
    let base = base();
    let finer = fine(
        ("A", ZONE),
        FINER,
        Shape {
            wrinkle: 0.0,
            ..USUAL
        },
    );
    let out = confirmed(&base, &[("finer", &finer)]).unwrap();
    let gone = defect(&out, "AW1");
    assert_eq!(gone["stands"], "gone");
    assert_eq!(
        (
            &gone["hangs_on"][0]["variant"],
            &gone["hangs_on"][0]["size"]
        ),
        (&json!("finer"), &Value::Null)
    );
    assert!(
        gone["text"]
            .as_str()
            .unwrap()
            .ends_with("gone with smaller elements"),
        "{gone}"
    );
    assert_eq!(defect(&out, "AB1")["stands"], "stays");
    assert_eq!(
        (out.result("verdict_stays"), out.result("gone_count")),
        (0.0, 1.0)
    );
    assert_eq!(out.attributes["verdict"]["hangs_on"], json!(["finer"]));
    let text = out.attributes["verdict"]["text"].as_str().unwrap();
    assert!(
        text.starts_with("the verdict hangs on the element size: there are wrinkles and bridging; with smaller elements there is bridging and no wrinkle"),
        "{text}"
    );
    assert!(
        text.ends_with("not looked at: speed, time step, margin"),
        "{text}"
    );
    let warned = out.log.iter().any(|l| format!("{l:?}").contains("AW1"));
    assert!(warned, "{:?}", out.log);
}

#[test]
fn a_size_that_moves_with_the_speed_hangs_on_it_by_as_much() {
    let base = base();
    let mut slower = fine(
        ("A", ZONE),
        SIZE,
        Shape {
            wrinkle: 0.0036,
            moved: 0.003,
            ..USUAL
        },
    );
    slower.attributes["slower"] = json!(2.0);
    let out = confirmed(&base, &[("slower", &slower)]).unwrap();
    let told = defect(&out, "AW1");
    assert_eq!(told["stands"], "hangs");
    let amplitude = told["hangs_on"]
        .as_array()
        .unwrap()
        .iter()
        .find(|h| h["size"] == "amplitude")
        .unwrap();
    assert!(
        (number(&amplitude["change"]) - 0.2).abs() < 0.01,
        "{amplitude}"
    );
    assert_eq!(amplitude["variant"], "slower");
    assert!(
        told["text"]
            .as_str()
            .unwrap()
            .contains("hangs on the speed ("),
        "{told}"
    );
    // Both are within the bounds, and no more than both: one variant alone.
    let size = &told["sizes"]["amplitude"];
    assert!(
        (number(&size["low"]) - 0.003).abs() < 2e-5
            && (number(&size["high"]) - 0.0036).abs() < 2e-5,
        "{size}"
    );
    assert_eq!(
        out.result("verdict_stays"),
        1.0,
        "there are wrinkles all the same"
    );
}

#[test]
fn what_only_a_wider_zone_sees_is_told_and_is_not_new_in_the_zone() {
    let flat = fine(
        ("A", ZONE),
        SIZE,
        Shape {
            wrinkle: 0.0,
            ..USUAL
        },
    );
    let wider = fine(
        ("A", WIDE),
        SIZE,
        Shape {
            wrinkle: 0.0,
            outside: 0.003,
            ..USUAL
        },
    );
    let out = confirmed(&flat, &[("wider", &wider)]).unwrap();
    assert_eq!(
        (out.result("new_count"), out.result("outside_count")),
        (0.0, 1.0)
    );
    let new = &out.attributes["new"][0];
    assert_eq!(
        (&new["zone"], &new["type"], &new["variant"]),
        (&Value::Null, &json!("wrinkle"), &json!("wider"))
    );
    assert!((number(&new["centre"][1]) - 0.066).abs() < 0.002, "{new}");
    // The part has a wrinkle that the zones do not see.
    assert_eq!(out.result("verdict_stays"), 0.0);
    // Of a run that shares the zone nothing outside of it counts: its mesh may reach past it.
    let past = {
        let mut run = fine(
            ("A", WIDE),
            FINER,
            Shape {
                wrinkle: 0.0,
                outside: 0.003,
                ..USUAL
            },
        );
        run.attributes["zone"] = zone_a();
        run
    };
    let out = confirmed(&flat, &[("finer", &past)]).unwrap();
    assert_eq!(
        (
            out.result("new_count"),
            out.result("outside_count"),
            out.result("verdict_stays")
        ),
        (0.0, 0.0, 1.0)
    );
}

#[test]
fn a_defect_that_only_a_variant_has_in_the_zone_is_new() {
    let flat = fine(
        ("A", ZONE),
        SIZE,
        Shape {
            wrinkle: 0.0,
            ..USUAL
        },
    );
    let finer = fine(("A", ZONE), FINER, USUAL);
    let out = confirmed(&flat, &[("finer", &finer)]).unwrap();
    assert_eq!(
        (out.result("new_count"), out.result("verdict_stays")),
        (1.0, 0.0)
    );
    assert_eq!(out.attributes["new"][0]["zone"], "A");
    assert_eq!(out.attributes["tables"].as_array().unwrap().len(), 2);
}

#[test]
fn what_is_just_below_a_least_size_in_one_run_alone_changes_no_answer() {
    // A crest of about 12 mm, and one of about 8 mm.
    let run = |size, half_length| {
        fine(
            ("A", ZONE),
            size,
            Shape {
                half_length,
                blister: 0.0,
                ..USUAL
            },
        )
    };
    let long = run(SIZE, 0.0085);
    let short = run(FINER, 0.0065);
    let lengths = |base: &MemoryArtifact, finer: &MemoryArtifact| {
        let out = confirmed(base, &[("finer", finer)]).unwrap();
        (
            out.result("defect_count"),
            out.result("gone_count"),
            out.result("new_count"),
            out.result("verdict_stays"),
        )
    };
    let (count, gone, new, stays) = lengths(&long, &short);
    assert_eq!((count, gone, new, stays), (1.0, 0.0, 0.0, 1.0));
}

#[test]
fn runs_that_are_no_variants_of_the_zones_are_refused_with_what_was_expected() {
    let base = base();
    let refused = |others: &[(&str, &MemoryArtifact)]| confirmed(&base, others).unwrap_err();
    let text = refused(&[]);
    assert!(text.contains("finer") && text.contains("wider"), "{text}");
    let as_fine = fine(("A", ZONE), SIZE, USUAL);
    let text = refused(&[("finer", &as_fine)]);
    assert!(
        text.contains("1.25 mm") && text.contains("smaller by 5 %"),
        "{text}"
    );
    let elsewhere = fine(("Z", [0.2, 0.0, 0.3, 0.1]), FINER, USUAL);
    let text = refused(&[("finer", &elsewhere)]);
    assert!(
        text.contains("zone Z") && text.contains("none of the zones"),
        "{text}"
    );
    let text = refused(&[("slower", &base), ("slower", &base)]);
    assert!(text.contains("2 runs look at zone A"), "{text}");
    let whole = formed(vec![base.bodies[1].clone()], Value::Null);
    let text = refused(&[("wider", &whole)]);
    assert!(text.contains("no run of a zone"), "{text}");
    // A variant that is none is told and not looked at; where there is no other, nothing is confirmed.
    let finer = fine(("A", ZONE), FINER, USUAL);
    for (port, word) in [
        ("slower", "speed"),
        ("half_step", "step"),
        ("wider", "margin"),
    ] {
        let out = confirmed(&base, &[(port, &base), ("finer", &finer)]).unwrap();
        assert!(
            out.log.iter().any(|l| format!("{l:?}").contains(word)),
            "{port}: {:?}",
            out.log
        );
        let left_out = out.attributes["left_out"].as_array().unwrap();
        assert!(left_out.contains(&json!(port)), "{left_out:?}");
        let text = refused(&[(port, &base)]);
        assert!(
            text.contains(&format!("`{port}`")) && text.contains("nothing can be confirmed"),
            "{text}"
        );
    }
}

/// A run of the whole scene, which reaches past the zone.
fn whole(size: f64, shape: Shape) -> MemoryArtifact {
    let mut run = fine(("A", WIDE), size, shape);
    run.attributes["zone"] = Value::Null;
    run
}

#[test]
fn bounds_are_judged_by_the_whole_in_smaller_elements_and_not_changed_by_it() {
    let (base, finer) = (base(), fine(("A", ZONE), FINER, USUAL));
    let half = SIZE / 2.0;
    let without = confirmed(&base, &[("finer", &finer)]).unwrap();
    let judged = |reference: &MemoryArtifact| {
        let out = confirmed(&base, &[("finer", &finer), ("reference", reference)]).unwrap();
        for id in ["AW1", "AB1"] {
            for key in ["low", "high", "value"] {
                let size = |o| defect(o, id)["sizes"]["amplitude"][key].clone();
                assert_eq!(size(&out), size(&without), "{id}");
            }
        }
        assert_eq!(out.result("verdict_stays"), 1.0);
        out
    };
    let count = |out: &MemoryArtifact| {
        [
            "bounds_judged",
            "bounds_held",
            "reference_gone",
            "reference_missed",
        ]
        .map(|r| out.result(r))
    };
    // The same shape, seen more sharply: three sizes of the wrinkle and two of the blister. What lies outside of the zone is not judged.
    let same = judged(&whole(
        half,
        Shape {
            outside: 0.003,
            ..USUAL
        },
    ));
    assert_eq!(count(&same), [5.0, 5.0, 0.0, 0.0], "{}", same.attributes);
    assert_eq!(same.result("bounds_held_ratio"), 1.0);
    // A wrinkle that is higher by a third: its height is outside of its bounds.
    let higher = judged(&whole(
        half,
        Shape {
            wrinkle: 0.004,
            ..USUAL
        },
    ));
    let size = &defect(&higher, "AW1")["sizes"]["amplitude"];
    assert!((number(&size["reference"]) - 0.004).abs() < 1e-5, "{size}");
    assert_eq!(count(&higher)[0], 5.0);
    assert!(count(&higher)[1] < 5.0 && number(&size["reference"]) > number(&size["high"]));
    // No blister there, and one where there is none.
    let gone = judged(&whole(
        half,
        Shape {
            blister: 0.0,
            ..USUAL
        },
    ));
    assert_eq!(count(&gone), [3.0, 3.0, 1.0, 0.0], "{}", gone.attributes);
    assert_eq!(
        defect(&gone, "AB1")["sizes"]["area"]["reference"],
        Value::Null
    );
    let flat = fine(
        ("A", ZONE),
        SIZE,
        Shape {
            blister: 0.0,
            ..USUAL
        },
    );
    let flat_finer = fine(
        ("A", ZONE),
        FINER,
        Shape {
            blister: 0.0,
            ..USUAL
        },
    );
    let reference = whole(half, USUAL);
    let out = confirmed(&flat, &[("finer", &flat_finer), ("reference", &reference)]).unwrap();
    assert_eq!(count(&out)[2..], [0.0, 1.0]);
    // One that is no finer is told, and a zone is refused.
    let coarse = judged(&whole(SIZE, USUAL));
    assert!(
        coarse
            .log
            .iter()
            .any(|l| format!("{l:?}").contains("half as large")),
        "{:?}",
        coarse.log
    );
    let text = confirmed(&base, &[("finer", &finer), ("reference", &finer)]).unwrap_err();
    assert!(
        text.contains("`reference`") && text.contains("whole scene"),
        "{text}"
    );
}

#[test]
fn without_a_zone_there_is_nothing_to_confirm() {
    let (global, none) = (global(), zones(json!([])));
    let inputs = [
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &none),
    ];
    let out = run::<plyflow_confirm::Confirm>(json!({}), &inputs, &[]).unwrap();
    assert_eq!(
        (out.result("defect_count"), out.result("verdict_stays")),
        (0.0, 1.0)
    );
    assert_eq!(
        out.attributes["verdict"]["text"],
        "there is no zone, and nothing to confirm"
    );
}

#[test]
fn of_wider_zones_that_have_become_one_each_zone_is_followed_in_it() {
    let left =
        json!({"name": "A", "box": [-0.080, -0.050, -0.005, 0.050], "free_sides": vec![false; 4]});
    let right =
        json!({"name": "B", "box": [0.010, -0.050, 0.080, 0.050], "free_sides": vec![false; 4]});
    let of = |zone: &Value| {
        let b: [f64; 4] = serde_json::from_value(zone["box"].clone()).unwrap();
        fine((zone["name"].as_str().unwrap(), b), SIZE, USUAL)
    };
    let (a, b, wider) = (of(&left), of(&right), fine(("A", WIDE), SIZE, USUAL));
    let (global, zones) = (global(), zones(json!([left, right])));
    let inputs = [
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput {
            item: &[1],
            ..MemoryInput::new("local", &b)
        },
        MemoryInput {
            item: &[0],
            ..MemoryInput::new("local", &a)
        },
        MemoryInput {
            item: &[0],
            ..MemoryInput::new("wider", &wider)
        },
    ];
    let out = run::<plyflow_confirm::Confirm>(json!({}), &inputs, &[]).unwrap();
    assert_eq!(
        (
            out.result("defect_count"),
            out.result("stay_count"),
            out.result("new_count")
        ),
        (2.0, 2.0, 0.0)
    );
    assert_eq!(
        (&defect(&out, "AW1")["zone"], &defect(&out, "BB1")["zone"]),
        (&json!("A"), &json!("B"))
    );
}
