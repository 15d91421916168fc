//! Fabrics that cannot be right are refused: the message says where, what was given, and what to do.

mod common;
mod fabric_support;
use common::*;
use fabric_support::*;
use serde_json::{Value, json};

/// A sound fabric with one thing changed.
fn with(change: impl Fn(&mut Value)) -> Value {
    let mut v = sheet("fibre-energy", &json!({"coefficients": NCF_YARN}), None);
    change(&mut v);
    v
}

fn shear(s: Value) -> Value {
    with(|v| v["shear"] = s.clone())
}

fn table(angles: Value, forces: Value) -> Value {
    shear(json!({"table": {"angles": angles, "forces": forces}}))
}

fn bending(b: Value) -> Value {
    with(|v| v["bending"] = b.clone())
}

fn moments(curvatures: Value, moments: Value) -> Value {
    bending(json!({"positive": {"table": {"curvatures": curvatures, "moments": moments}}}))
}

fn stitched(s: Value) -> Value {
    with(|v| v["stitch"] = s.clone())
}

/// Every text has all the words: the place, the value given, the way out.
fn check(cases: Vec<(Value, &[&str])>) {
    for (json, words) in cases {
        let text = match fabric(&json.to_string()) {
            Err(text) => text,
            Ok(_) => panic!("accepted: {json}"),
        };
        for word in words {
            assert!(text.contains(word), "'{text}' does not say '{word}'");
        }
        assert!(
            !text.ends_with(' ') && text.len() < 500,
            "cut off? '{text}'"
        );
    }
}

#[test]
fn wrong_shear_tables_are_refused_with_place_and_advice() {
    let many: Vec<f64> = (0..65).map(|i| 0.01 * f64::from(i)).collect();
    check(vec![
        (
            table(json!([0, 0.1]), json!([0, 1, 2])),
            &["shear.table", "2 angles", "3 forces"],
        ),
        (
            table(json!([0]), json!([0])),
            &["shear.table", "1 points", "2 to 64"],
        ),
        (
            table(json!(many), json!(many)),
            &["65 points", "fewer points"],
        ),
        (
            table(json!([0.05, 0.1]), json!([0, 1])),
            &["shear.table", "first point", "2.86 deg", "in front"],
        ),
        (
            table(json!([0, 0.1]), json!([2, 3])),
            &["first point", "2 N/m", "offset"],
        ),
        (
            table(json!([0, 0.2, 0.1]), json!([0, 1, 2])),
            &["shear.table.angles[2]", "5.73 deg", "11.46 deg", "sort"],
        ),
        (
            table(json!([0, 0.2, 0.2]), json!([0, 1, 2])),
            &["shear.table.angles[2]", "repeated"],
        ),
        (
            table(json!([0, -0.2, 0.2]), json!([0, 1, 2])),
            &["shear.table.angles[1]", "'negative'"],
        ),
        (
            table(json!([0, 0.2, 0.3]), json!([0, 5, 4])),
            &[
                "shear.table.forces[2]",
                "4 N/m",
                "5 N/m",
                "unstable",
                "'shear.allow_softening: true'",
            ],
        ),
        (
            table(json!([0, 0.2, 0.3]), json!([0, 5, 5])),
            &["shear.table.forces[2]", "rising"],
        ),
        (
            table(json!([0, 0.2, 0.3]), json!([0, -5, 5])),
            &["shear.table.forces[1]", "-5 N/m", "above 0"],
        ),
        (
            table(json!([0, 0.2, 1.56]), json!([0, 5, 6])),
            &["shear.table.angles[2]", "89.38 deg"],
        ),
        (
            table(json!([0, 0.005, 0.0175]), json!([0, 5, 6])),
            &["shear.table.angles[2]", "1.00 deg", "unit"],
        ),
        (
            shear(json!({"table": {"angles": [0, 0.5], "forces": [0, 5]}, "limit": 1.0})),
            &["shear.limit", "last angle"],
        ),
        (
            shear(json!({"table": {"angles": [0, 0.5], "forces": [0, 5]}, "coefficients": [0, 1]})),
            &["shear", "both"],
        ),
        (
            shear(json!({})),
            &["shear", "neither", "'coefficients'", "'table'"],
        ),
        (
            shear(json!({"coefficients": NCF_YARN, "negative": {}})),
            &["shear.negative", "neither"],
        ),
        (
            shear(
                json!({"coefficients": NCF_YARN, "negative": {"table": {"angles": [0, 0.1, 0.3], "forces": [0, 3, 2]}}}),
            ),
            &[
                "shear.negative.table.forces[2]",
                "'shear.allow_softening: true'",
            ],
        ),
        (
            shear(
                json!({"coefficients": NCF_YARN, "negative": {"table": {"angles": [0, -0.1], "forces": [0, -3]}}}),
            ),
            &["shear.negative.table.angles[1]", "sizes"],
        ),
    ]);
}

#[test]
fn wrong_polynomials_are_refused_with_the_angle_where_they_fall() {
    // 100 g - 200 g^3 / 3 + .. has its top where the slope 100 - 100 g^2 * 4 is 0: g = 0.5.
    let falls = json!({"coefficients": [0, 100, 0, -400.0 / 3.0], "limit": 0.8});
    check(vec![
        (
            shear(falls.clone()),
            &[
                "shear.coefficients",
                "falls from 0.5000 rad (28.65 deg) to 0.8000 rad",
                "slope down to -156",
                "allow_softening",
            ],
        ),
        // Falls between 0.2 and 0.4 only: slope 100 (g - 0.2)(g - 0.4) * 12.5.
        (
            shear(json!({"coefficients": [0, 100, -375, 1250.0 / 3.0]})),
            &["from 0.2000 rad (11.46 deg) to 0.4000 rad (22.92 deg)"],
        ),
        (
            shear(json!({"coefficients": [0, 100, -400]})),
            &["shear.coefficients", "at 0.25", "above 0", "in rad"],
        ),
        (
            shear(json!({"coefficients": [0, 0, 100]})),
            &["shear.coefficients[1]", "0 N/m", "convex"],
        ),
        (
            shear(json!({"coefficients": [0, -3, 100]})),
            &["shear.coefficients[1]", "-3 N/m"],
        ),
        (
            shear(json!({"coefficients": [5, 100]})),
            &["shear.coefficients", "first 0 N/m"],
        ),
        (
            shear(json!({"coefficients": [0]})),
            &["1 coefficients", "2 to 10"],
        ),
        (
            shear(json!({"coefficients": [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10]})),
            &["11 coefficients"],
        ),
        (
            shear(json!({"coefficients": [0, 100], "limit": 1.6})),
            &["shear.limit", "1.6 rad"],
        ),
        (
            shear(json!({"coefficients": [0, 100], "negative": falls})),
            &["shear.negative.coefficients", "28.65 deg"],
        ),
    ]);
}

#[test]
fn softening_is_taken_when_the_file_says_so_and_forces_stay_above_zero() {
    let soft =
        json!({"coefficients": [0, 100, 0, -400.0 / 3.0], "limit": 0.8, "allow_softening": true});
    assert!(fabric(&shear(soft).to_string()).is_ok());
    let table =
        json!({"table": {"angles": [0, 0.2, 0.5], "forces": [0, 9, 5]}, "allow_softening": true});
    assert!(fabric(&shear(table).to_string()).is_ok());
    check(vec![(
        shear(
            json!({"table": {"angles": [0, 0.2, 0.5], "forces": [0, 9, 0]}, "allow_softening": true}),
        ),
        &["shear.table.forces[2]", "above 0"],
    )]);
}

#[test]
fn both_fabrics_of_the_thesis_rise_all_the_way() {
    for c in [&NCF_YARN[..], &WOVEN[..]] {
        assert!(fabric(&shear(json!({"coefficients": c})).to_string()).is_ok());
    }
}

#[test]
fn wrong_stitches_are_refused_with_place_and_advice() {
    let s = |a: Value, f: Value| stitched(json!({"angles": a, "forces": f}));
    check(vec![
        (
            s(json!([0, 0.5]), json!([0, 880])),
            &["stitch", "2 points", "3 to 8"],
        ),
        (
            s(json!([0, 0.5, 0.7]), json!([0, 880])),
            &["stitch", "3 angles", "2 forces"],
        ),
        (
            s(json!([0, 0.5, 0.4]), json!([0, 880, 0])),
            &["stitch.angles[2]", "22.92 deg"],
        ),
        (
            s(json!([-0.1, 0.5, 0.7]), json!([0, 880, 0])),
            &["stitch.angles[0]", "direction: negative"],
        ),
        (
            s(json!([0, 0.5, 1.2]), json!([0, 880, 0])),
            &["stitch.angles[2]", "limit", "60.00 deg"],
        ),
        (
            s(json!([0, 0.5, 0.7]), json!([0, 880, 10])),
            &["stitch.forces[2]", "10 N/m", "expected 0 N/m"],
        ),
        (
            s(json!([0, 0.5, 0.7]), json!([1, 880, 0])),
            &["stitch.forces[0]", "1 N/m"],
        ),
        (
            s(json!([0, 0.5, 0.7]), json!([0, 0, 0])),
            &["stitch.forces[1]", "peak"],
        ),
        (
            s(json!([0, 0.3, 0.5, 0.7]), json!([0, 100, 200, 0])),
            &["stitch.forces[2]", "does not heal"],
        ),
        (
            stitched(json!({"direction": "both", "angles": [0, 0.5, 0.7], "forces": [0, 880, 0]})),
            &["both", "positive"],
        ),
    ]);
    // The limit of the sign on which the stitch acts counts.
    let mut v = shear(json!({"coefficients": NCF_YARN,
        "negative": {"table": {"angles": [0, 0.6], "forces": [0, 50]}}}));
    v["stitch"] = stitch("positive");
    assert!(fabric(&v.to_string()).is_ok());
    v["stitch"] = stitch("negative");
    check(vec![(v, &["stitch.angles[2]", "34.38 deg"])]);
}

#[test]
fn wrong_bending_laws_are_refused_with_place_and_advice() {
    let one = |l: Value| bending(json!({"positive": l}));
    let good = json!({"stiffness": 1e-3});
    check(vec![
        (bending(json!({})), &["bending", "'positive'", "'family_1'"]),
        (
            bending(json!({"negative": good})),
            &["bending", "negative", "'positive'"],
        ),
        (
            bending(json!({"family_1": {"positive": good}})),
            &["bending", "family_1", "'family_2'"],
        ),
        (
            bending(
                json!({"positive": good, "family_1": {"positive": good}, "family_2": {"positive": good}}),
            ),
            &["positive", "family_1"],
        ),
        (
            bending(
                json!({"family_1": {"positive": good}, "family_2": {"positive": {"stiffness": 0}}}),
            ),
            &["bending.family_2.positive.stiffness", "0 N m"],
        ),
        (
            bending(json!({"positive": good, "negative": {}})),
            &["bending.negative", "'stiffness'", "'table'", "'linear'"],
        ),
        (
            one(json!({"stiffness": 1e-3, "linear": 1e-3})),
            &["bending.positive", "exactly one law"],
        ),
        (
            one(json!({"linear": -1e-3})),
            &["bending.positive.linear", "-0.001 N m"],
        ),
        (
            one(json!({"linear": 1e-3, "asymptote": -0.1, "scale": 4})),
            &["bending.positive.asymptote", "-0.1 N"],
        ),
        (
            one(json!({"linear": 1e-3, "asymptote": 0.1})),
            &["bending.positive", "'scale'", "63 %"],
        ),
        (
            one(json!({"asymptote": 0.1, "scale": 0})),
            &["bending.positive.scale", "0 1/m"],
        ),
        (
            one(json!({"linear": 0})),
            &["bending.positive", "at rest", "leave 'bending' out"],
        ),
        (
            moments(json!([0, 5, 10]), json!([0, 1, 0.5])),
            &[
                "bending.positive.table.moments[2]",
                "0.5 N",
                "0.01 1/mm",
                "tangent",
            ],
        ),
        (
            moments(json!([0, 5, 10]), json!([0, 0, 0.5])),
            &["bending.positive.table.moments[1]", "at rest"],
        ),
        (
            moments(json!([0, 5, 4]), json!([0, 1, 2])),
            &[
                "bending.positive.table.curvatures[2]",
                "0.004 1/mm",
                "0.005 1/mm",
            ],
        ),
        (
            moments(json!([1, 5]), json!([0, 1])),
            &["bending.positive.table", "first point"],
        ),
        (
            moments(json!([0]), json!([0])),
            &["bending.positive.table", "1 points"],
        ),
        (
            bending(json!({"positive": good, "twist_stiffness": -1})),
            &["bending.twist_stiffness", "-1 N m"],
        ),
    ]);
}

#[test]
fn wrong_sheets_and_unknown_names_are_refused() {
    check(vec![
        (
            with(|v| v["fibre_modulus"] = json!(-3e9)),
            &["fibre_modulus", "Pa"],
        ),
        (
            with(|v| v["compression_factor"] = json!(2)),
            &["compression_factor", "0 to 1"],
        ),
        (with(|v| v["thickness"] = json!(0)), &["thickness"]),
        (with(|v| v["areal_mass"] = json!(0)), &["areal_mass"]),
        (
            with(|v| v["form"] = json!("elastic")),
            &["elastic", "hypoelastic"],
        ),
        (with(|v| v["sheer"] = json!(1)), &["sheer"]),
        (shear(json!({"coeficients": [0, 1]})), &["coeficients"]),
        (
            shear(json!({"coefficients": [0, "1 N/m"]})),
            &["string", "f64"],
        ),
    ]);
}

#[test]
fn numbers_that_are_not_finite_are_refused() {
    let sound = table(json!([0, 0.1, 0.2]), json!([0, 1, 2])).to_string();
    for bad in ["1e999", "-1e999", "NaN", "null"] {
        let text = sound.replace("[0,1,2]", &format!("[0,1,{bad}]"));
        assert_ne!(text, sound);
        assert!(fabric(&text).is_err(), "{bad}");
    }
}
