//! Bending laws of a fabric: constant, Voce and table, for each family and sign.

mod common;
mod fabric_support;
use common::*;
use fabric_support::*;
use serde_json::{Value, json};

fn with_bending(bending: Value) -> Value {
    let mut v = sheet("fibre-energy", &json!({"coefficients": NCF_YARN}), None);
    v["bending"] = bending;
    v
}

fn voce(k: f64, b: f64, m: f64, k0: f64) -> f64 {
    b * k + m * (1.0 - (-k / k0).exp())
}

/// Voce's law at `n` curvatures up to 60 1/m, denser towards 0.
fn voce_table(n: usize, b: f64, m: f64, k0: f64) -> Value {
    let k: Vec<f64> = (0..n)
        .map(|i| 60.0 * (i as f64 / (n - 1) as f64).powi(2))
        .collect();
    let y: Vec<f64> = k.iter().map(|k| voce(*k, b, m, k0)).collect();
    json!({"table": {"curvatures": k, "moments": y}})
}

fn every_bending() -> Vec<(&'static str, Value)> {
    let plus = json!({"linear": 1.9457e-4, "asymptote": 0.03139, "scale": 4.0});
    vec![
        (
            "constant",
            json!({"positive": {"stiffness": 0.0038}, "negative": {"stiffness": 0.0032}}),
        ),
        (
            "voce",
            json!({"positive": plus, "negative": {"asymptote": 0.03, "scale": 6.0}}),
        ),
        (
            "table",
            json!({"positive": voce_table(25, 1.9457e-4, 0.03139, 4.0), "families": "same"}),
        ),
        (
            "families",
            json!({"family_1": {"positive": plus, "negative": {"stiffness": 0.002}},
                   "family_2": {"positive": {"stiffness": 0.005}, "negative": voce_table(17, 1e-4, 0.02, 5.0)},
                   "families": "same", "positive_face": "down", "twist_stiffness": 1e-5}),
        ),
        (
            "families of one kind",
            json!({"family_1": {"positive": plus}, "family_2": {"positive": {"stiffness": 0.005}}}),
        ),
    ]
}

#[test]
fn moments_are_the_gradient_of_the_energy_and_tangents_that_of_the_moments_for_every_law() {
    for (name, bending) in every_bending() {
        let m = build(&with_bending(bending));
        let mut r = Random(5);
        for _ in 0..300 {
            // Up to beyond the end of the tables.
            let k = [80.0 * r.next(), 80.0 * r.next(), 60.0 * r.next()];
            if k.iter().any(|k| k.abs() < 0.01) {
                continue;
            }
            let a = bend(&m, [1.0, 1.0, 0.1], k);
            for i in 0..3 {
                let h = 1e-3;
                let at = |s: f64| {
                    let mut x = k;
                    x[i] += s * h;
                    bend(&m, [1.0, 1.0, 0.1], x)
                };
                let (p, q) = (at(1.0), at(-1.0));
                let w = (p.energy - q.energy) / (2.0 * h) / if i == 2 { 2.0 } else { 1.0 };
                let t = (p.moment[i] - q.moment[i]) / (2.0 * h);
                assert!(
                    (w - a.moment[i]).abs() < 1e-7,
                    "{name}, {k:?}: {w}, {:?}",
                    a.moment
                );
                // The corner of the tangent at a point of a table is averaged by the quotient.
                let near = 1e-6 + 1e-4 * a.tangent[i];
                assert!(
                    (t - a.tangent[i]).abs() < near,
                    "{name}, {k:?}: {t} {:?}",
                    a.tangent
                );
                assert!(a.tangent[i] >= 0.0 && a.energy >= 0.0);
            }
        }
    }
}

#[test]
fn constant_stiffness_is_a_straight_law_of_each_sign() {
    let b = json!({"positive": {"stiffness": 0.0038}, "negative": {"stiffness": 0.0032}});
    let m = build(&with_bending(b));
    for k in [0.5, 20.0, 100.0] {
        let up = bend(&m, [1.0, 1.0, 0.0], [k, k, 0.0]);
        // Families on opposite faces: what is positive for one is negative for the other.
        assert!(
            (up.moment[0] - 0.0038 * k).abs() < 1e-15 * k
                && (up.moment[1] - 0.0032 * k).abs() < 1e-15 * k
        );
        assert!((up.energy - 0.5 * 0.0070 * k * k).abs() < 1e-12 * k * k);
        assert_eq!(up.tangent[..2], [0.0038, 0.0032]);
    }
}

#[test]
fn table_of_25_points_returns_voces_law_and_goes_on_straight_beyond_it() {
    for (b, asymptote, k0) in [
        (1.9457e-4, 0.03139, 4.0),
        (1.0279e-4, 0.03619, 6.5),
        (1.549e-5, 0.00757, 20.0),
    ] {
        let law = json!({"positive": voce_table(25, b, asymptote, k0), "families": "same"});
        let m = build(&with_bending(law));
        let (mut d, mut f) = (0.0, 0.0);
        for i in 1..=1000 {
            let k = 0.06 * i as f64;
            let want = voce(k, b, asymptote, k0);
            for sign in [1.0, -1.0] {
                let got = bend(&m, [1.0, 1.0, 0.0], [sign * k, 0.0, 0.0]).moment[0];
                d += (got - sign * want).powi(2);
                f += want.powi(2);
            }
        }
        let error = f64::sqrt(d / f);
        println!(
            "Voce from 25 points, scale {k0} 1/m: {:.4} %",
            100.0 * error
        );
        assert!(error < 0.002, "{error}");
        let at = |k: f64| bend(&m, [1.0, 1.0, 0.0], [k, 0.0, 0.0]);
        let (end, far) = (at(60.0), at(200.0));
        let straight = end.moment[0] + 140.0 * end.tangent[0];
        assert!(
            (far.moment[0] - straight).abs() < 1e-12
                && (far.tangent[0] - end.tangent[0]).abs() < 1e-12 * end.tangent[0]
        );
    }
}

/// The guide's own table, and others whose last interval is the longest: the parabola through the last three points has a third of the law's slope at the
/// end or none, and a ply that goes on without any folds at a point.
#[test]
fn a_table_that_flattens_goes_on_with_the_slope_of_its_law() {
    let (b, asymptote, k0) = (1.549e-5, 0.00757, 20.0);
    for last in [[20.0, 50.0], [20.0, 60.0], [50.0, 100.0]] {
        let k: Vec<f64> = [0.0, 2.0, 5.0, 10.0].into_iter().chain(last).collect();
        let y: Vec<f64> = k.iter().map(|k| voce(*k, b, asymptote, k0)).collect();
        let law = json!({"positive": {"table": {"curvatures": k, "moments": y}}});
        let m = build(&with_bending(law));
        let tangent = bend(&m, [1.0, 1.0, 0.0], [1.01 * last[1], 0.0, 0.0]).tangent[0];
        let own = b + asymptote / k0 * (-last[1] / k0).exp();
        println!("{last:?}: {:.3} of the law's slope", tangent / own);
        // (In the last one the law has come near to its own straight line.)
        assert!(
            (0.6..1.1).contains(&(tangent / own)),
            "{last:?}: {tangent}, law {own}"
        );
    }
}

#[test]
fn each_family_follows_its_own_laws_by_face_and_order() {
    let laws = |face: &str, families: &str| {
        json!({"family_1": {"positive": {"stiffness": 1e-3}, "negative": {"stiffness": 2e-3}},
               "family_2": {"positive": {"stiffness": 3e-3}, "negative": {"stiffness": 4e-3}},
               "positive_face": face, "families": families})
    };
    for (face, families, up, down) in [
        ("up", "same", [1e-3, 3e-3], [2e-3, 4e-3]),
        ("up", "opposite", [1e-3, 4e-3], [2e-3, 3e-3]),
        ("down", "same", [2e-3, 4e-3], [1e-3, 3e-3]),
        ("down", "opposite", [2e-3, 3e-3], [1e-3, 4e-3]),
    ] {
        let m = build(&with_bending(laws(face, families)));
        for (sign, want) in [(1.0, up), (-1.0, down)] {
            let got = bend(&m, [1.0, 1.0, 0.0], [10.0 * sign, 10.0 * sign, 0.0]).moment;
            for f in 0..2 {
                assert!(
                    (got[f] - sign * 10.0 * want[f]).abs() < 1e-15,
                    "{face}, {families}: {got:?}"
                );
            }
        }
    }
}

#[test]
fn twist_stiffness_by_default_is_that_of_a_homogeneous_ply_of_the_initial_shear_stiffness() {
    for (shear, slope) in [
        (json!({"coefficients": NCF_YARN}), 112.19),
        // The mean of both signs.
        (
            json!({"coefficients": NCF_YARN, "negative": {"coefficients": WOVEN}}),
            0.5 * (112.19 + 37.35),
        ),
        (
            json!({"table": {"angles": [0.0, 0.5], "forces": [0.0, 40.0]}}),
            40.0 / 0.5f64.sin(),
        ),
    ] {
        let mut v = with_bending(json!({"positive": {"stiffness": 1e-3}}));
        v["shear"] = shear;
        let t = bend(&build(&v), [1.0, 1.0, 0.0], [0.0, 0.0, 1.0]).tangent[2];
        let want = slope * 4e-4 * 4e-4 / 6.0;
        assert!(
            (t - want).abs() < 1e-12 * want.max(1.0),
            "{t}, not {want} N m"
        );
    }
}
