//! Shear laws of a fabric, every kind in both forms: curves, energies, tangents, extremes.

mod common;
mod fabric_support;
use common::*;
use fabric_support::*;
use plyflow_kernels::{Level, level, limit_level, m4::M4};
use plyflow_sdk::Aligned;
use serde_json::json;

#[test]
fn picture_frame_returns_the_measured_curve_from_a_table_of_25_points() {
    for form in FORMS {
        for to in [1.0, -1.0] {
            let woven = build(&sheet(form, &sampled(&WOVEN, 25), None));
            let e = frame_error(&woven, woven_curve, to, 1000);
            println!("woven table, {form}, to {to} rad: {:.4} %", 100.0 * e);
            assert!(e < 0.003, "woven {form} to {to}: {e}");
            let shear = sampled(&NCF_YARN, 25);
            let ncf = build(&sheet(form, &shear, Some(stitch("positive"))));
            let e = frame_error(&ncf, ncf_curve, to, 1000);
            println!("NCF table, {form}, to {to} rad: {:.4} %", 100.0 * e);
            assert!(e < 0.01, "NCF {form} to {to}: {e}");
        }
    }
}

#[test]
fn picture_frame_returns_the_polynomials_closer_than_the_thesis_in_both_forms_and_signs() {
    for form in FORMS {
        for to in [1.0, -1.0] {
            let woven = build(&sheet(form, &json!({"coefficients": WOVEN}), None));
            let e = frame_error(&woven, woven_curve, to, 1000);
            println!("woven polynomial, {form}, to {to} rad: {:.2e}", e);
            assert!(e < 0.003, "woven {form} to {to}: {e}");
            let shear = json!({"coefficients": NCF_YARN});
            let ncf = build(&sheet(form, &shear, Some(stitch("positive"))));
            let e = frame_error(&ncf, ncf_curve, to, 1000);
            println!("NCF polynomial, {form}, to {to} rad: {:.2e}", e);
            assert!(e < 0.01, "NCF {form} to {to}: {e}");
        }
    }
}

/// One element in a picture frame, fibres along its sides: root-mean-square difference of the
/// cross-head force `2 F_norm L cos((pi/2 - g)/2)` from the one of the curve, over that of the curve.
fn element_frame_error(m: &Mat, curve: impl Fn(f64) -> f64, to: f64) -> f64 {
    let e = El::new::<M4>("{}", m).unwrap();
    let square = [[0.0, 0.0], [SIZE, 0.0], [SIZE, SIZE], [0.0, SIZE]].map(|[x, y]| [x, y, 0.0]);
    let mut batch = e.initialise(&[square; 8], &[[1.0, 0.0, 0.0]; 8]);
    let (mut d, mut f) = (0.0, 0.0);
    for i in 1..=400 {
        let g = to * i as f64 / 400.0;
        let side = [SIZE * g.sin(), SIZE * g.cos(), 0.0];
        let x = [[0.0; 3], square[1], [SIZE + side[0], side[1], 0.0], side];
        let force = e.forces(&mut batch, &[x; 8]).force;
        // Work of the two moving corners over the angle is F_norm cos g per undeformed area.
        let work: f64 = [2, 3]
            .iter()
            .map(|n| force[3 * n * 8] * side[1] - force[(3 * n + 1) * 8] * side[0])
            .sum();
        let lever = 2.0 * SIZE * (0.5 * (std::f64::consts::FRAC_PI_2 - g)).cos();
        let got = work / (SIZE * SIZE * g.cos()) * lever;
        d += (got - curve(g) * lever).powi(2);
        f += (curve(g) * lever).powi(2);
    }
    (d / f).sqrt()
}

#[test]
fn one_element_in_a_picture_frame_needs_the_cross_head_force_of_the_curve_for_every_law() {
    for form in FORMS {
        for to in [1.0, -1.0] {
            for (name, shear, bound) in [
                ("polynomial", json!({"coefficients": WOVEN}), 0.003),
                ("table", sampled(&WOVEN, 25), 0.003),
            ] {
                let m = build(&sheet(form, &shear, None));
                let e = element_frame_error(&m, woven_curve, to);
                println!(
                    "element, woven {name}, {form}, to {to} rad: {:.1e} %",
                    100.0 * e
                );
                assert!(e < bound, "woven {name}, {form} to {to}: {e}");
            }
            for (name, shear) in [
                ("polynomial", json!({"coefficients": NCF_YARN})),
                ("table", sampled(&NCF_YARN, 25)),
            ] {
                let m = build(&sheet(form, &shear, Some(stitch("positive"))));
                let e = element_frame_error(&m, ncf_curve, to);
                println!(
                    "element, NCF {name}, {form}, to {to} rad: {:.1e} %",
                    100.0 * e
                );
                assert!(e < 0.01, "NCF {name}, {form} to {to}: {e}");
            }
        }
    }
}

#[test]
fn each_sign_of_shear_follows_its_own_law_when_two_are_given() {
    for form in FORMS {
        let m = build(&sheet(form, &asymmetric(), None));
        assert!(frame_error(&m, |g| polynomial(&NCF_YARN, g), 1.0, 500) < 0.002);
        assert!(frame_error(&m, woven_curve, -1.0, 500) < 1e-9);
        let m = build(&sheet(form, &asymmetric_other(), None));
        assert!(frame_error(&m, |g| polynomial(&NCF_YARN, g), 1.0, 500) < 1e-9);
        for (g, force) in [(-0.2, -10.0), (-0.4, -15.0), (-0.7, -90.0)] {
            let f = Point::new(&m).at(&m, metric(1.0, 1.0, g)).stress[2];
            assert!((f - force).abs() < 1e-9, "{form}: {f} N/m at {g} rad");
        }
    }
}

#[test]
fn stitch_in_negative_shear_mirrors_one_in_positive_shear() {
    for form in FORMS {
        let shear = json!({"coefficients": NCF_YARN});
        let plus = build(&sheet(form, &shear, Some(stitch("positive"))));
        let minus = build(&sheet(form, &shear, Some(stitch("negative"))));
        let (mut p, mut q) = (Point::new(&plus), Point::new(&minus));
        let mut r = Random(4);
        let mut g = 0.0f64;
        for _ in 0..2000 {
            g = (g + 0.08 * r.next()).clamp(-1.2, 1.2);
            let (l1, l2) = (1.0 + 0.002 * r.next(), 1.0 + 0.002 * r.next());
            let (a, b) = (
                p.at(&plus, metric(l1, l2, g)),
                q.at(&minus, metric(l1, l2, -g)),
            );
            assert_eq!(a.stress[..2], b.stress[..2], "{form} at {g}");
            assert_eq!(a.stress[2], -b.stress[2], "{form} at {g}");
            assert_eq!((a.energy, a.stiffness), (b.energy, b.stiffness));
        }
    }
}

#[test]
fn stress_is_the_gradient_of_the_energy_for_every_shear_law() {
    for (name, shear, stitch) in every_shear_law() {
        let m = build(&sheet("fibre-energy", &shear, stitch));
        let mut r = Random(9);
        for round in 0..300 {
            let g = 1.3 * r.next();
            if g.abs() < 2e-4 {
                continue; // the difference quotient would reach over the corner of two laws
            }
            let c = metric(1.0 + 0.02 * r.next(), 1.0 + 0.02 * r.next(), g);
            let mut p = Point::new(&m);
            // A damage that this state does not move: sheared further before, and not yet failed.
            if round % 2 == 0 {
                for to in [0.62, -0.62] {
                    p.at(&m, metric(1.0, 1.0, to));
                }
                if g.abs() > 0.6 {
                    continue;
                }
            } else {
                for to in [1.35, -1.35] {
                    p.at(&m, metric(1.0, 1.0, to));
                }
            }
            let a = p.peek(&m, c);
            let scale = a.stress.iter().fold(1.0f64, |m, x| m.max(x.abs()));
            for k in 0..3 {
                let h = 1e-5;
                let w = |f: f64| {
                    let mut x = c;
                    x[k] += f * h;
                    p.peek(&m, x).energy
                };
                let d = (8.0 * (w(1.0) - w(-1.0)) - (w(2.0) - w(-2.0))) / (12.0 * h);
                let s = if k < 2 { 2.0 * d } else { d };
                assert!(
                    (s - a.stress[k]).abs() < 1e-5 * scale,
                    "{name} at g = {g}: dW {s}, stress {:?}",
                    a.stress
                );
            }
        }
    }
}

#[test]
fn energy_of_a_table_is_the_integral_of_its_force_over_the_sine() {
    for shear in [sampled(&WOVEN, 25), asymmetric_other()] {
        let m = build(&sheet("fibre-energy", &shear, None));
        for sign in [1.0, -1.0] {
            let p = Point::new(&m);
            let force = |s: f64| p.peek(&m, [1.0, 1.0, s]).stress[2];
            // Simpson between fine places, up to and beyond the end of the table.
            let (n, end) = (20_000, 0.99 * sign);
            let (mut work, h) = (0.0, end / n as f64);
            for i in 0..n {
                let s = i as f64 * h;
                work += h / 6.0 * (force(s) + 4.0 * force(s + 0.5 * h) + force(s + h));
                if i % 1000 == 999 {
                    let w = p.peek(&m, [1.0, 1.0, s + h]).energy;
                    assert!((w - work).abs() < 1e-9 * (1.0 + w), "{w} J/m2, not {work}");
                }
            }
        }
    }
}

/// dS12/d(2 E12) by differences.
fn shear_tangent(m: &Mat, p: &Point, c: [f64; 3]) -> f64 {
    let h = 1e-6;
    let at = |s: f64| p.peek(m, [c[0], c[1], c[2] + s * h]).stress[2];
    (at(1.0) - at(-1.0)) / (2.0 * h)
}

#[test]
fn reported_shear_tangent_bounds_the_difference_quotient_for_every_law() {
    for form in FORMS {
        for (name, shear, stitch) in every_shear_law() {
            let m = build(&sheet(form, &shear, stitch));
            let mut tight = 0;
            for i in -130..=130 {
                let g = 0.01 * i as f64 + 0.003;
                let p = Point::new(&m);
                let c = metric(1.0, 1.0, g);
                let (bound, exact) = (p.peek(&m, c).stiffness[1], shear_tangent(&m, &p, c));
                // The hypoelastic frame stops at 80 deg; its response there is flat by its clamp.
                assert!(
                    bound > 0.999 * exact,
                    "{form}, {name}, {g}: {bound} < {exact}"
                );
                assert!(bound > 0.0, "{form}, {name}, {g}: {bound}");
                tight += usize::from(bound < 1.05 * exact);
            }
            assert!(
                tight > 40 || name.contains("stitch"),
                "{form}, {name}: tight at {tight} places"
            );
        }
    }
}

/// Largest eigenvalue of dS/dE by differences: the largest root of the characteristic polynomial of
/// the symmetric part in the orthonormal basis E11, E22, sqrt(2) E12, by Jacobi rotations.
fn largest_tangent(m: &Mat, p: &Point, c: [f64; 3]) -> f64 {
    let r2 = 2f64.sqrt();
    let mut d = [[0.0; 3]; 3];
    for j in 0..3 {
        let h = 1e-6;
        let at = |s: f64| {
            let mut x = c;
            x[j] += s * h * if j == 2 { r2 } else { 2.0 };
            p.peek(m, x).stress
        };
        let (a, b) = (at(1.0), at(-1.0));
        for i in 0..3 {
            d[i][j] = (a[i] - b[i]) / (2.0 * h) * if i == 2 { r2 } else { 1.0 };
        }
    }
    let mut s: [[f64; 3]; 3] =
        std::array::from_fn(|i| std::array::from_fn(|j| 0.5 * (d[i][j] + d[j][i])));
    for _ in 0..30 {
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let t = 0.5 * (2.0 * s[i][j]).atan2(s[j][j] - s[i][i]);
            let (cos, sin) = (t.cos(), t.sin());
            let old = s;
            for k in 0..3 {
                s[k][i] = cos * old[k][i] - sin * old[k][j];
                s[k][j] = sin * old[k][i] + cos * old[k][j];
            }
            let old = s;
            for k in 0..3 {
                s[i][k] = cos * old[i][k] - sin * old[j][k];
                s[j][k] = sin * old[i][k] + cos * old[j][k];
            }
        }
    }
    s[0][0].max(s[1][1]).max(s[2][2])
}

#[test]
fn reported_tangent_bounds_the_largest_eigenvalue_for_every_law() {
    for (name, shear, stitch) in every_shear_law() {
        let m = build(&sheet("fibre-energy", &shear, stitch));
        let mut r = Random(6);
        for _ in 0..100 {
            let c = metric(1.0 + 0.02 * r.next(), 1.0 + 0.02 * r.next(), 1.1 * r.next());
            let p = Point::new(&m);
            let (bound, exact) = (p.peek(&m, c).stiffness[0], largest_tangent(&m, &p, c));
            assert!(bound > 0.999 * exact, "{name}, {c:?}: {bound} < {exact}");
            assert!(bound < 20.0 * exact.abs() + 1e4, "{name}: useless {bound}");
        }
    }
}

#[test]
fn tangent_of_a_table_is_continuous_and_the_curve_does_not_overshoot() {
    // Steps that make an ordinary spline swing: a plateau between two rises.
    let angles = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6];
    let forces = [0.0, 1.0, 1.1, 40.0, 40.2, 41.0, 300.0];
    let table = json!({"table": {"angles": angles, "forces": forces}});
    for form in FORMS {
        let m = build(&sheet(form, &table, None));
        let p = Point::new(&m);
        let force = |g: f64| p.peek(&m, metric(1.0, 1.0, g)).stress[2];
        for i in 0..angles.len() - 1 {
            for j in 0..=100 {
                let g = angles[i] + 0.1 * j as f64 / 100.0;
                let f = force(g);
                assert!(
                    f > forces[i] - 1e-9 && f < forces[i + 1] + 1e-9,
                    "{form}: {f} at {g}"
                );
            }
        }
        for g in &angles[1..6] {
            // The step is small against the curvature of the curve, and a kink would be hundreds of N/m.
            let h = 1e-6;
            let slope =
                |s: f64| (force(g + s * h + h / 10.0) - force(g + s * h - h / 10.0)) / (h / 5.0);
            let (a, b) = (slope(-1.0), slope(1.0));
            assert!(
                (a - b).abs() < 0.5 + 0.01 * a.abs(),
                "{form}: {a} and {b} N/m at {g}"
            );
        }
    }
}

#[test]
fn hypoelastic_agrees_with_the_energy_form_for_every_law_when_fibres_stretch() {
    for (name, shear, stitch) in every_shear_law() {
        let energy = build(&sheet("fibre-energy", &shear, stitch.clone()));
        let hypo = build(&sheet("hypoelastic", &shear, stitch));
        for to in [0.45, -0.45, 0.7, -0.7] {
            let (mut p, mut q) = (Point::new(&energy), Point::new(&hypo));
            for i in 1..=2000 {
                let t = i as f64 / 2000.0;
                let c = metric(1.0 + 0.004 * t, 1.0 - 0.002 * t, to * t);
                let (a, b) = (p.at(&energy, c), q.at(&hypo, c));
                let scale = a.stress.iter().fold(0.0f64, |m, s| m.max(s.abs()));
                for k in 0..3 {
                    let d = (a.stress[k] - b.stress[k]).abs();
                    assert!(d < 0.01 * scale, "{name}, {to}: {a:?} against {b:?}");
                }
                assert!(
                    (a.energy - b.energy).abs() < 0.01 * a.energy + 1e-9,
                    "{name}, {to} at {t}: {a:?} {b:?}"
                );
            }
        }
    }
}

#[test]
fn extreme_states_give_finite_answers_for_every_law() {
    let states = [
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 1.0],
        [1.0, 1.0, -1.5],
        [1e-12, 1.0, 0.0],
        [1e6, 1e-6, 0.0],
        [100.0, 100.0, 99.9999],
    ];
    for form in FORMS {
        for (name, shear, stitch) in every_shear_law() {
            let m = build(&sheet(form, &shear, stitch));
            let mut p = Point::new(&m);
            for c in states.iter().chain(states.iter().rev()) {
                let a = p.at(&m, *c);
                let mut all = a.stress.iter().chain([&a.energy]).chain(&a.stiffness);
                assert!(all.all(|x| x.is_finite()), "{form}, {name}, {c:?}: {a:?}");
            }
            let rest = Point::new(&m).at(&m, [1.0, 1.0, 0.0]);
            assert!(rest.stress.iter().all(|s| s.abs() < 1e-9) && rest.energy.abs() < 1e-12);
        }
    }
}

#[test]
fn every_instruction_set_and_every_lane_gives_the_same_bits() {
    let mut r = Random(12);
    let states: Vec<[f64; 3]> = (0..64)
        .map(|_| metric(1.0 + 0.01 * r.next(), 1.0 + 0.01 * r.next(), 1.3 * r.next()))
        .collect();
    let rows: Vec<f64> = (0..3)
        .flat_map(|k| states.iter().map(move |c| c[k]))
        .collect();
    let rows = Aligned::from(rows.as_slice());
    for form in FORMS {
        for (name, shear, stitch) in every_shear_law() {
            let m = build(&sheet(form, &shear, stitch));
            let run = || {
                let mut history = Aligned::zeros(m.0.sizes().membrane_history * 64);
                let (mut stress, mut energy) = (Aligned::zeros(192), Aligned::zeros(64));
                let mut stiffness = Aligned::zeros(128);
                m.0.membrane(&mut plyflow_sdk::MembraneBatch {
                    lanes: 64,
                    dt: 0.0,
                    metric: &rows,
                    history: &mut history,
                    stress: &mut stress,
                    energy: &mut energy,
                    stiffness: Some(&mut stiffness),
                });
                [stress, energy, stiffness, history].map(|a| a.to_vec())
            };
            let best = level();
            let wide = run();
            for less in [Level::Portable, Level::Avx2] {
                limit_level(less);
                assert_eq!(run(), wide, "{form}, {name}, {less:?}");
            }
            limit_level(best);
            // Alone, with eight copies of itself.
            for (l, c) in states.iter().enumerate() {
                let a = Point::new(&m).at(&m, *c);
                let together = [wide[0][l], wide[0][64 + l], wide[0][128 + l]];
                assert_eq!(
                    (a.stress, a.energy),
                    (together, wide[1][l]),
                    "{form}, {name}"
                );
            }
        }
    }
}
