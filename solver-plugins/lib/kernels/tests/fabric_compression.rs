//! Fibres that follow a curve in compression: the points of the curve are met, and all that a law must keep holds.

mod common;
mod fabric_support;
use common::*;
use fabric_support::*;
use plyflow_kernels::m4::M4;
use serde_json::{Value, json};

const THICKNESS: f64 = 4e-4;
const MODULUS: f64 = 3e9;
/// As stiff as in tension at first, then a plateau (Pa).
const STRAINS: [f64; 5] = [0.0, 0.001, 0.003, 0.01, 0.05];
const STRESSES: [f64; 5] = [0.0, 3e6, 4.5e6, 5e6, 5.2e6];

fn curve() -> Value {
    json!({"table": {"strains": STRAINS, "stresses": STRESSES}})
}

fn crushed(stitched: bool) -> Value {
    let stitch = stitched.then(|| stitch("positive"));
    let mut ply = sheet("fibre-energy", &json!({"coefficients": NCF_YARN}), stitch);
    ply["compression"] = curve();
    ply
}

#[test]
fn a_point_has_the_stress_of_the_curve_in_both_families_and_that_of_the_modulus_in_tension() {
    let m = build(&crushed(false));
    for family in 0..2 {
        let stress = |strain: f64| {
            let mut stretch = [1.0, 1.0];
            stretch[family] = 1.0 - strain;
            let answer = Point::new(&m).at(&m, metric(stretch[0], stretch[1], 0.0));
            assert!(answer.stress[1 - family].abs() < 1e-9);
            // Of S = N / l.
            answer.stress[family] * (1.0 - strain) / THICKNESS
        };
        for (e, s) in STRAINS.iter().zip(STRESSES) {
            assert!((stress(*e) + s).abs() <= 1e-9 * 5e6, "{e}: {}", stress(*e));
        }
        // Beyond the last point along the tangent there: a straight line, that rises and does not rise faster than the last chord.
        let beyond = [0.06, 0.1, 0.3].map(|e| (-stress(e) - 5.2e6) / (e - 0.05));
        assert!(
            (beyond[0] / beyond[2] - 1.0).abs() < 1e-9
                && (beyond[1] / beyond[2] - 1.0).abs() < 1e-9
        );
        assert!((0.0..=5e6).contains(&beyond[0]), "{beyond:?}");
        for e in [1e-4, 0.01] {
            assert!((stress(-e) / (MODULUS * e) - 1.0).abs() < 1e-9);
        }
        // It never falls between its points.
        let all: Vec<f64> = (0..=600).map(|k| -stress(1e-4 * f64::from(k))).collect();
        assert!(all.windows(2).all(|w| w[1] >= w[0] - 1e-3));
    }
}

#[test]
fn an_element_that_is_pressed_together_carries_the_force_of_the_curve() {
    let m = build(&crushed(false));
    let e = El::new::<M4>("{}", &m).unwrap();
    let (length, width) = (0.02, 0.01);
    let corners = [
        [0.0, 0.0, 0.0],
        [length, 0.0, 0.0],
        [length, width, 0.0],
        [0.0, width, 0.0],
    ];
    let mut batch = e.initialise(&[corners; 8], &[[1.0, 0.0, 0.0]; 8]);
    for (strain, stress) in STRAINS.iter().zip(STRESSES).skip(1) {
        let moved = corners.map(|[x, y, z]| [x * (1.0 - strain), y, z]);
        let f = e.forces(&mut batch, &[moved; 8]);
        let right: f64 = [1, 2].iter().map(|k| f.force[3 * k * 8]).sum();
        let wanted = stress * THICKNESS * width;
        // What an element gives is the force on its nodes from inside, or the one that it resists with: by size.
        assert!(
            (right.abs() / wanted - 1.0).abs() < 1e-9,
            "{right} N, {wanted} N at {strain}"
        );
    }
}

#[test]
fn the_energy_is_the_integral_of_the_stress() {
    let m = build(&crushed(true));
    let at = |e: f64| Point::new(&m).at(&m, metric(1.0 - e, 1.0, 0.0));
    let mut sum = 0.0;
    let n = 30_000;
    let h = 0.06 / f64::from(n);
    for k in 0..n {
        let e = (f64::from(k) + 0.5) * h;
        sum -= at(e).stress[0] * (1.0 - e) * h;
        if (k + 1) % 500 == 0 {
            let energy = at(h * f64::from(k + 1)).energy;
            assert!((energy / sum - 1.0).abs() < 1e-6, "{k}: {energy} {sum}");
        }
    }
    // And the stress is its gradient in any state.
    let mut r = Random(5);
    for _ in 0..300 {
        let c = metric(1.0 + 0.02 * r.next(), 1.0 + 0.1 * r.next(), 0.8 * r.next());
        let p = Point::new(&m);
        let a = p.peek(&m, c);
        let size = a.stress.iter().fold(1.0f64, |s, x| s.max(x.abs()));
        for k in 0..3 {
            let moved = |f: f64| {
                let mut x = c;
                x[k] += f * 1e-6;
                p.peek(&m, x)
            };
            let d = (moved(1.0).energy - moved(-1.0).energy) / 2e-6;
            let s = if k < 2 { 2.0 * d } else { d };
            assert!(
                (s - a.stress[k]).abs() < 1e-4 * size,
                "{c:?}: {s} {:?}",
                a.stress
            );
        }
    }
}

/// A step in time that is set by the bound of the tangent is safe where the bound is one: all eigenvalues lie below it.
#[test]
fn no_tangent_is_larger_than_its_bound() {
    let mut steep = crushed(false);
    // The cubic rises faster than its chords, which rise as tension does.
    steep["compression"] = json!({"table": {"strains": [0.0, 0.01, 0.02, 0.03], "stresses": [0.0, 1.0e6, 3.1e7, 3.2e7]}});
    for ply in [crushed(false), crushed(true), steep] {
        let m = build(&ply);
        let mut r = Random(7);
        for _ in 0..2000 {
            let c = metric(
                1.0 - 0.04 * r.next().abs(),
                1.0 + 0.04 * r.next(),
                0.5 * r.next(),
            );
            let p = Point::new(&m);
            let bound = p.peek(&m, c).stiffness[0];
            for k in 0..3 {
                let moved = |f: f64| {
                    let mut x = c;
                    x[k] += f * 1e-7;
                    p.peek(&m, x).stress[k]
                };
                let steps = if k < 2 { 0.5 } else { 1.0 };
                let slope = (moved(1.0) - moved(-1.0)) / (2e-7 * steps);
                assert!(slope < 1.001 * bound, "{c:?}: {slope} {bound}");
            }
        }
    }
}

#[test]
fn families_may_differ_and_a_straight_curve_is_a_share_of_the_modulus() {
    let mut ply = crushed(false);
    ply["fibre_modulus_2"] = json!(6e6);
    ply["compression_factor_2"] = json!(0.4);
    let m = build(&ply);
    let a = Point::new(&m).at(&m, metric(0.99, 0.96, 0.0));
    let of = |stress: f64, l: f64| stress * l / THICKNESS;
    assert!((of(a.stress[0], 0.99) / -5e6 - 1.0).abs() < 1e-9);
    assert!((of(a.stress[1], 0.96) / (-0.4 * 6e6 * 0.04) - 1.0).abs() < 1e-9);
    let mut second = sheet("fibre-energy", &json!({"coefficients": NCF_YARN}), None);
    second["compression_2"] = curve();
    let m = build(&second);
    let a = Point::new(&m).at(&m, metric(0.99, 0.99, 0.0));
    assert!((of(a.stress[0], 0.99) / (-MODULUS * 0.01) - 1.0).abs() < 1e-9);
    assert!((of(a.stress[1], 0.99) / -5e6 - 1.0).abs() < 1e-9);
    // All the same law, by either way.
    let mut factor = sheet(
        "fibre-energy",
        &json!({"coefficients": NCF_YARN}),
        Some(stitch("positive")),
    );
    let mut straight = factor.clone();
    factor["compression_factor"] = json!(0.1);
    straight["compression"] =
        json!({"table": {"strains": [0.0, 0.02], "stresses": [0.0, 0.02 * 0.1 * MODULUS]}});
    let (a, b) = (build(&factor), build(&straight));
    let mut r = Random(9);
    let (mut p, mut q) = (Point::new(&a), Point::new(&b));
    for _ in 0..500 {
        let c = metric(1.0 + 0.05 * r.next(), 1.0 + 0.05 * r.next(), 0.7 * r.next());
        let (x, y) = (p.at(&a, c), q.at(&b, c));
        for k in 0..3 {
            assert!((x.stress[k] - y.stress[k]).abs() < 1e-9 * (1.0 + x.stress[k].abs()));
        }
        assert!((x.energy - y.energy).abs() < 1e-9 * (1.0 + x.energy));
    }
}

#[test]
fn curves_that_are_none_are_refused_by_name() {
    let table = |strains: Value, stresses: Value| json!({"table": {"strains": strains, "stresses": stresses}});
    let cases: [(Value, &str); 9] = [
        (
            json!({"compression": curve(), "compression_factor": 1.0}),
            "compression: given together with 'compression_factor'",
        ),
        (
            json!({"compression_2": curve(), "compression_factor_2": 0.2}),
            "compression_2: given together with 'compression_factor_2'",
        ),
        (
            json!({"compression": curve(), "form": "hypoelastic"}),
            "expected form 'fibre-energy'",
        ),
        (
            json!({"compression": curve(), "fibre_modulus_2": 6e6}),
            "compression_2: not given, and family 2 has a modulus of its own",
        ),
        (
            json!({"compression": table(json!([0.0, 0.1, 0.2]), json!([0.0, 3e6, 2e6]))}),
            "compression.table.stresses[2]: given 2000000 Pa at 0.2 (20 %) after 3000000 Pa; expected stresses that do not fall",
        ),
        (
            json!({"compression": table(json!([0.0, 0.1]), json!([0.0, 0.0]))}),
            "compression.table.stresses[1]: given 0 Pa",
        ),
        (
            json!({"compression": table(json!([0.0, 0.1]), json!([0.0, 4e8]))}),
            "compression.table.stresses[1]: given 400000000 Pa at 0.1 (10 %), which rises by 4000000000 Pa for each strain; expected at most the modulus",
        ),
        (
            json!({"compression": table(json!([0.0, 2.0]), json!([0.0, 5e6]))}),
            "compression.table.strains[1]: given 2 (200 %); expected less than 1",
        ),
        (
            json!({"compression": table(json!([0.01, 0.1]), json!([0.0, 5e6]))}),
            "as first point; expected 0 and 0",
        ),
    ];
    for (more, says) in cases {
        let mut ply = sheet("fibre-energy", &json!({"coefficients": NCF_YARN}), None);
        for (key, value) in more.as_object().unwrap() {
            ply[key] = value.clone();
        }
        let error = fabric(&ply.to_string())
            .err()
            .unwrap_or_else(|| panic!("{says}: taken"));
        assert!(error.contains(says), "{error}");
    }
}
