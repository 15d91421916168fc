//! Families that cross at another angle than a right one: the law over the images of both fibres, written down anew here, and what follows from it.

mod common;
mod fabric_support;
use common::*;
use fabric_support::*;
use serde_json::{Value, json};

const THICKNESS: f64 = 4e-4;
/// k = E h of both families (N/m).
const K: [f64; 2] = [3e9 * THICKNESS, 1e9 * THICKNESS];
const ANGLES: [f64; 5] = [25.0, 60.0, 80.0, 120.0, 150.0];

fn force(g: f64) -> f64 {
    60.0 * g + 120.0 * g.powi(3)
}

fn crossed(degrees: f64) -> Value {
    let mut ply = sheet(
        "fibre-energy",
        &json!({"coefficients": [0.0, 60.0, 0.0, 120.0], "limit": 1.3}),
        None,
    );
    ply["fibre_modulus_2"] = json!(1e9);
    ply["crossing"] = json!(degrees.to_radians());
    ply
}

/// Stretches of both fibres and their shear angle, from the images of the fibres under a symmetric square root of the metric.
fn fibres([c11, c22, c12]: [f64; 3], angle: f64) -> ([f64; 2], f64) {
    // sqrt(C) = (C + J 1) / sqrt(tr C + 2 J), Cayley-Hamilton.
    let j = (c11 * c22 - c12 * c12).sqrt();
    let over = 1.0 / (c11 + c22 + 2.0 * j).sqrt();
    let u = [
        [(c11 + j) * over, c12 * over],
        [c12 * over, (c22 + j) * over],
    ];
    let image = |a: [f64; 2]| [0, 1].map(|k| u[k][0] * a[0] + u[k][1] * a[1]);
    let (a, b) = (image([1.0, 0.0]), image([angle.cos(), angle.sin()]));
    let norm = |a: [f64; 2]| a[0].hypot(a[1]);
    let turned = (a[0] * b[1] - a[1] * b[0]).atan2(a[0] * b[0] + a[1] * b[1]);
    ([norm(a), norm(b)], angle - turned)
}

/// The energy (J/m2) of the polynomial law.
fn energy(c: [f64; 3], angle: f64) -> f64 {
    let ([l1, l2], g) = fibres(c, angle);
    let n = 4000;
    let h = g / f64::from(n);
    let place = |i: i32| (f64::from(i) + 0.5) * h;
    let phi: f64 = (0..n).map(|i| force(place(i)) * place(i).cos() * h).sum();
    0.5 * K[0] * (l1 - 1.0).powi(2) + 0.5 * K[1] * (l2 - 1.0).powi(2) + phi
}

/// A metric whose families are stretched by a little and sheared.
fn state(r: &mut Random, angle: f64) -> [f64; 3] {
    let [l1, l2] = [0, 1].map(|_| 1.0 + 0.02 * r.next());
    let most = 0.8 * angle.min(std::f64::consts::PI - angle).min(1.2);
    let now = angle - most * r.next();
    // x1 = l1 (1, 0), x2 = l2 (cos t, sin t) are the images of a1 and a2; e2 = (a2 - cos p a1) / sin p.
    let (c, s) = (angle.cos(), angle.sin());
    let e2 = [(l2 * now.cos() - c * l1) / s, l2 * now.sin() / s];
    [l1 * l1, e2[0] * e2[0] + e2[1] * e2[1], l1 * e2[0]]
}

#[test]
fn the_energy_is_that_of_the_images_of_both_fibres() {
    let mut r = Random(31);
    for degrees in ANGLES {
        let angle = degrees.to_radians();
        let m = build(&crossed(degrees));
        for _ in 0..100 {
            let c = state(&mut r, angle);
            let (got, wanted) = (Point::new(&m).at(&m, c).energy, energy(c, angle));
            assert!(
                (got - wanted).abs() < 1e-6 * (1.0 + wanted),
                "{degrees}: {c:?}: {got} {wanted}"
            );
        }
    }
}

#[test]
fn an_undeformed_ply_is_at_rest_to_the_last_bit() {
    for degrees in ANGLES {
        let m = build(&crossed(degrees));
        let a = Point::new(&m).at(&m, [1.0, 1.0, 0.0]);
        assert_eq!((a.stress, a.energy), ([0.0; 3], 0.0), "{degrees}");
    }
}

#[test]
fn a_right_angle_that_is_stated_changes_no_bit() {
    let mut plain = crossed(90.0);
    let stated = build(&plain);
    plain.as_object_mut().unwrap().remove("crossing");
    let plain = build(&plain);
    let mut r = Random(32);
    for _ in 0..100 {
        let c = state(&mut r, 90f64.to_radians());
        assert_eq!(
            Point::new(&stated).at(&stated, c),
            Point::new(&plain).at(&plain, c)
        );
    }
}

/// Every law that may cross: yarns by sign, a stitch, friction, a curve of compression.
fn every_law(degrees: f64) -> Vec<(&'static str, Value)> {
    let of = |shear: &Value, stitch: Option<Value>| {
        let mut ply = sheet("fibre-energy", shear, stitch);
        ply["crossing"] = json!(degrees.to_radians());
        ply
    };
    let mut laws: Vec<(&str, Value)> = every_shear_law()
        .into_iter()
        .map(|(name, shear, stitch)| (name, of(&shear, stitch)))
        .collect();
    let mut rubbing = json!({"coefficients": NCF_YARN});
    rubbing["hysteresis"] = json!({"force": 20.0, "angle": 0.03, "per_tension": 0.01});
    laws.push(("friction", of(&rubbing, None)));
    let mut crushed = of(&json!({"coefficients": NCF_YARN}), Some(stitch("positive")));
    crushed["compression"] =
        json!({"table": {"strains": [0.0, 0.001, 0.01], "stresses": [0.0, 2e6, 4e6]}});
    laws.push(("compression", crushed));
    laws
}

/// A law that falls, and one that rubs or breaks, has no energy whose gradient could be asked for beyond its way there: each state is one small step from
/// a history of its own.
#[test]
fn stress_is_the_gradient_of_the_energy_and_its_tangents_are_bounded() {
    let mut r = Random(33);
    for degrees in ANGLES {
        let angle = degrees.to_radians();
        for (name, law) in every_law(degrees) {
            let m = build(&law);
            for _ in 0..40 {
                let mut p = Point::new(&m);
                let c = state(&mut r, angle);
                let a = p.at(&m, c);
                let size = a.stress.iter().fold(1.0f64, |s, x| s.max(x.abs()));
                let h = 1e-6;
                let at = |d: [f64; 3], f: f64| {
                    let x: [f64; 3] = core::array::from_fn(|k| c[k] + f * h * d[k]);
                    p.peek(&m, x)
                };
                let unit = |k: usize| core::array::from_fn(|i| f64::from(u8::from(i == k)));
                // A history that goes on differs to both sides: what each loses is no derivative.
                let smooth = !["friction"].contains(&name) && law["stitch"].is_null();
                for k in 0..3 {
                    let d = (at(unit(k), 1.0).energy - at(unit(k), -1.0).energy) / (2.0 * h);
                    let s = if k < 2 { 2.0 * d } else { d };
                    assert!(
                        !smooth || (s - a.stress[k]).abs() < 1e-4 * size,
                        "{degrees} {name} {c:?}: {s} {:?}",
                        a.stress
                    );
                }
                // The tangent in random directions dE, against both bounds: dS : dE <= L |dE|^2.
                for _ in 0..6 {
                    let e = [r.next(), r.next(), r.next()];
                    let d = e.map(|x| 2.0 * x);
                    let (up, down) = (at(d, 1.0).stress, at(d, -1.0).stress);
                    let slope = |k: usize| (up[k] - down[k]) / (2.0 * h);
                    let work = slope(0) * e[0] + slope(1) * e[1] + 2.0 * slope(2) * e[2];
                    let square = e[0] * e[0] + e[1] * e[1] + 2.0 * e[2] * e[2];
                    assert!(
                        work < 1.001 * a.stiffness[0] * square,
                        "{degrees} {name} {c:?} {e:?}: {} {}",
                        work / square,
                        a.stiffness[0]
                    );
                }
                let soft = (at(unit(2), 1.0).stress[2] - at(unit(2), -1.0).stress[2]) / (2.0 * h);
                assert!(
                    soft < 1.001 * a.stiffness[1],
                    "{degrees} {name} {c:?}: {soft} {}",
                    a.stiffness[1]
                );
            }
        }
    }
}

/// Where nothing is sheared yet the bound is near: two families of inextensible fibres at 60 degrees are at most 1.25 times as stiff as one.
#[test]
fn the_bound_of_a_ply_at_rest_is_near_its_largest_tangent() {
    let mut law = crossed(60.0);
    law.as_object_mut().unwrap().remove("fibre_modulus_2");
    let m = build(&law);
    let a = Point::new(&m).at(&m, [1.0, 1.0, 0.0]);
    let ratio = a.stiffness[0] / (1.25 * K[0]);
    assert!((1.0..1.02).contains(&ratio), "{ratio}");
}

/// Family 2 as the first one, and family 1 the supplement of the angle behind it: the same ply, whose shear has the other sign.
#[test]
fn a_ply_that_names_its_families_the_other_way_round_is_the_same() {
    let mut r = Random(34);
    for degrees in ANGLES {
        let angle = degrees.to_radians();
        let one = build(&crossed(degrees));
        let mut other = crossed(180.0 - degrees);
        other["fibre_modulus"] = json!(1e9);
        other["fibre_modulus_2"] = json!(3e9);
        let other = build(&other);
        let (c, s) = (angle.cos(), angle.sin());
        for _ in 0..50 {
            let [c11, c22, c12] = state(&mut r, angle);
            // The metric in the axes along family 2 and a quarter turn on.
            let turned = [
                c * c * c11 + s * s * c22 + 2.0 * c * s * c12,
                s * s * c11 + c * c * c22 - 2.0 * c * s * c12,
                c * s * (c22 - c11) + (c * c - s * s) * c12,
            ];
            let (a, b) = (
                Point::new(&one).at(&one, [c11, c22, c12]),
                Point::new(&other).at(&other, turned),
            );
            assert!(
                (a.energy - b.energy).abs() < 1e-9 * (1.0 + a.energy),
                "{degrees}: {} {}",
                a.energy,
                b.energy
            );
            // Stresses turn as tensors do; S11 of the other one is the stress along family 2.
            let along = c * c * a.stress[0] + s * s * a.stress[1] + 2.0 * c * s * a.stress[2];
            assert!(
                (along - b.stress[0]).abs() < 1e-6 * (1.0 + along.abs()),
                "{degrees}: {along} {}",
                b.stress[0]
            );
        }
    }
}

/// A ply that bends by Voce's law along family 1 and by a table along family 2, with its own faces, twist and friction.
fn bent(degrees: f64, rubs: bool) -> Mat {
    let mut ply = crossed(degrees);
    ply["bending"] = json!({
        "family_1": {"positive": {"linear": 2e-4, "asymptote": 0.03, "scale": 4.0}, "negative": {"stiffness": 3e-4}},
        "family_2": {"positive": {"table": {"curvatures": [0.0, 10.0, 40.0], "moments": [0.0, 2e-3, 4e-3]}}},
        "twist_stiffness": 1e-4,
    });
    if rubs {
        for (family, moment) in [("family_1", 4e-4), ("family_2", 6e-4)] {
            ply["bending"][family]["hysteresis"] = json!({"moment": moment, "curvature": 0.5});
        }
    }
    build(&ply)
}

#[test]
fn moments_are_the_gradient_of_the_energy_and_their_tangents_the_diagonal() {
    let mut r = Random(35);
    for degrees in ANGLES {
        for rubs in [false, true] {
            let m = bent(degrees, rubs);
            for _ in 0..50 {
                let k = [20.0 * r.next(), 20.0 * r.next(), 20.0 * r.next()];
                let a = bend(&m, [1.0, 1.0, 0.0], k);
                let h = 1e-5;
                for i in 0..3 {
                    let at = |f: f64| {
                        let mut x = k;
                        x[i] += f * h;
                        bend(&m, [1.0, 1.0, 0.0], x)
                    };
                    let (up, down) = (at(1.0), at(-1.0));
                    let share = if i < 2 { 1.0 } else { 0.5 };
                    let moment = share * (up.energy - down.energy) / (2.0 * h);
                    // What has slid is lost, and its energy is the work alone: the gradient is that of one step.
                    assert!(
                        (moment - a.moment[i]).abs() < 1e-6 * (1.0 + a.moment[i].abs()) || rubs,
                        "{degrees} {k:?}: {moment} {}",
                        a.moment[i]
                    );
                    let tangent = (up.moment[i] - down.moment[i]) / (2.0 * h);
                    assert!(
                        (tangent - a.tangent[i]).abs() < 1e-4 * a.tangent[i].abs() + 1e-9,
                        "{degrees} {rubs} {k:?}: {tangent} {}",
                        a.tangent[i]
                    );
                }
            }
        }
    }
}

/// Bent about the direction square to family 2 only that family bends, and only by its own law.
#[test]
fn a_ply_rolled_up_along_family_2_bends_by_its_law() {
    for degrees in ANGLES {
        let angle = degrees.to_radians();
        let (c, s) = (angle.cos(), angle.sin());
        let mut ply = crossed(degrees);
        ply["bending"] = json!({
            "family_1": {"positive": {"stiffness": 1e-9}},
            "family_2": {"positive": {"stiffness": 5e-4}},
            "twist_stiffness": 0.0,
        });
        let m = build(&ply);
        let k = 8.0;
        let a = bend(&m, [1.0, 1.0, 0.0], [k * c * c, k * s * s, k * c * s]);
        let along = c * c * a.moment[0] + s * s * a.moment[1] + 2.0 * c * s * a.moment[2];
        assert!(
            (along / (5e-4 * k) - 1.0).abs() < 1e-5,
            "{degrees}: {along}"
        );
        let wanted = 0.5 * 5e-4 * k * k;
        assert!(
            (a.energy / wanted - 1.0).abs() < 1e-5,
            "{degrees}: {}",
            a.energy
        );
    }
}

/// Friction between the yarns turns with its family, in shear and in bending: a closed way costs what it costs at a right angle.
#[test]
fn a_closed_way_costs_what_it_costs_at_a_right_angle() {
    let loss = |degrees: f64| {
        let angle = degrees.to_radians();
        let mut ply = crossed(degrees);
        ply["shear"]["hysteresis"] = json!({"force": 20.0, "angle": 0.03});
        let m = build(&ply);
        let mut p = Point::new(&m);
        let (c, s) = (angle.cos(), angle.sin());
        // Fibres that keep their length, at the shear angle g.
        let at = |g: f64| {
            let now = angle - g;
            let e2 = [(now.cos() - c) / s, now.sin() / s];
            [1.0, e2[0] * e2[0] + e2[1] * e2[1], e2[0]]
        };
        let mut last = 0.0;
        for (from, to) in [(0.0, 0.3), (0.3, -0.3), (-0.3, 0.0)] {
            for i in 1..=400 {
                last = p
                    .at(&m, at(from + (to - from) * f64::from(i) / 400.0))
                    .energy;
            }
        }
        last
    };
    let square = loss(90.0);
    for degrees in ANGLES {
        let lost = loss(degrees);
        assert!(
            (lost / square - 1.0).abs() < 1e-3,
            "{degrees}: {lost} {square}"
        );
    }
}

#[test]
fn angles_and_forms_that_make_no_ply_are_told() {
    let refused = |v: &Value| fabric(&v.to_string()).err().expect("refused");
    for degrees in [0.0, 10.0, 175.0, 200.0, -60.0] {
        let told = refused(&crossed(degrees));
        assert!(
            told.contains("crossing") && told.contains("20 to 160 deg"),
            "{told}"
        );
    }
    let mut law = crossed(60.0);
    law["form"] = json!("hypoelastic");
    let told = refused(&law);
    assert!(
        told.contains("crossing") && told.contains("fibre-energy"),
        "{told}"
    );
}
