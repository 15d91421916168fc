//! Materials through their C tables: energies against stresses, input curves, extremes.

mod common;
use common::*;

fn metric(l1: f64, l2: f64, g: f64) -> [f64; 3] {
    [l1 * l1, l2 * l2, l1 * l2 * g.sin()]
}

fn ncf_yarn(g: f64) -> f64 {
    let a = g.abs();
    let f = 29.56 * a.powi(5) - 65.56 * a.powi(4) + 137.06 * a.powi(3) + 94.73 * a * a + 112.19 * a;
    f.copysign(g)
}

fn ncf_curve(g: f64) -> f64 {
    let stitch = match g {
        g if (0.06..0.5).contains(&g) => 2000.0 * g - 120.0,
        g if (0.5..0.75).contains(&g) => -3520.0 * g + 2640.0,
        _ => 0.0,
    };
    ncf_yarn(g) + stitch
}

fn woven_curve(g: f64) -> f64 {
    let a = g.abs();
    let c = [
        0.0, 37.35, -322.61, 1458.51, -3539.56, 4727.84, -3275.20, 930.53,
    ];
    c.iter().rev().fold(0.0, |y, c| y * a + c).copysign(g)
}

/// Picture frame: relative root-mean-square difference of F = S12 l1 l2 and the curve.
fn frame_error(m: &Mat, curve: fn(f64) -> f64, to: f64, steps: usize) -> f64 {
    let mut p = Point::new(m);
    let (mut d, mut f) = (0.0, 0.0);
    for i in 1..=steps {
        let g = to * i as f64 / steps as f64;
        let s = p.at(m, metric(1.0, 1.0, g)).stress[2];
        d += (s - curve(g)).powi(2);
        f += curve(g).powi(2);
    }
    (d / f).sqrt()
}

#[test]
fn picture_frame_returns_the_woven_curve_in_both_forms_and_signs() {
    for form in ["fibre-energy", "hypoelastic"] {
        let m = fabric(&woven(form)).unwrap();
        for to in [1.0, -1.0] {
            let e = frame_error(&m, woven_curve, to, 1000);
            assert!(e < 0.003, "{form} to {to}: {e}");
        }
    }
}

#[test]
fn picture_frame_returns_the_ncf_curve_through_the_stitch_peak_in_both_forms_and_signs() {
    for form in ["fibre-energy", "hypoelastic"] {
        let m = fabric(&ncf(form, "")).unwrap();
        for to in [1.0, -1.0] {
            let e = frame_error(&m, ncf_curve, to, 1000);
            assert!(e < 0.01, "{form} to {to}: {e}");
        }
    }
}

/// Compares 2 dW/dC with the stress at fixed history.
fn check_gradient(m: &Mat, p: &Point, c: [f64; 3], tolerance: f64) {
    let a = p.peek(m, c);
    for k in 0..3 {
        let h = 1e-5;
        let w = |f: f64| {
            let mut x = c;
            x[k] += f * h;
            p.peek(m, x).energy
        };
        let d = (8.0 * (w(1.0) - w(-1.0)) - (w(2.0) - w(-2.0))) / (12.0 * h);
        let s = if k < 2 { 2.0 * d } else { d };
        let scale = a.stress.iter().fold(1.0f64, |m, x| m.max(x.abs()));
        assert!(
            (s - a.stress[k]).abs() < tolerance * scale,
            "{c:?}: dW {s}, stress {:?}",
            a.stress
        );
    }
}

#[test]
fn stress_is_the_gradient_of_the_energy_for_every_material() {
    let mut r = Random(1);
    for m in [
        fabric(&ncf("fibre-energy", "")).unwrap(),
        fabric(&woven("fibre-energy")).unwrap(),
    ] {
        for _ in 0..200 {
            let c = metric(1.0 + 0.02 * r.next(), 1.0 + 0.02 * r.next(), 1.3 * r.next());
            let mut p = Point::new(&m);
            // A history that the state does not move: sheared further before.
            p.at(&m, metric(1.0, 1.0, 1.35));
            check_gradient(&m, &p, c, 1e-5);
        }
    }
    let m = film(FILM).unwrap();
    let p = Point::new(&m);
    for _ in 0..500 {
        let (a, b) = (0.4 + 2.0 * r.next().abs(), 0.4 + 3.0 * r.next().abs());
        check_gradient(&m, &p, metric(a, b, 0.9 * r.next()), 1e-5);
    }
}

#[test]
fn energy_output_is_the_work_done_when_the_stitch_fails() {
    for form in ["fibre-energy", "hypoelastic"] {
        let m = fabric(&ncf(form, "")).unwrap();
        let mut p = Point::new(&m);
        let (mut work, mut before) = (0.0, 0.0);
        let (mut old, mut s) = (0.0f64, 0.0f64);
        // Out past the peak, back, and out again further, then to negative shear.
        for (to, steps) in [(0.6, 4000), (0.1, 4000), (0.7, 4000), (-0.5, 8000)] {
            let from = s.asin();
            for i in 1..=steps {
                let g: f64 = from + (to - from) * i as f64 / steps as f64;
                let a = p.at(&m, metric(1.0, 1.0, g));
                work += 0.5 * (a.stress[2] + before) * (g.sin() - s);
                (before, s, old) = (a.stress[2], g.sin(), a.energy);
            }
            assert!(
                (old - work).abs() < 1e-3 * work,
                "{form} at {to}: {old} J/m2, work {work}"
            );
        }
    }
}

#[test]
fn hypoelastic_agrees_with_the_energy_form_when_fibres_stretch_while_they_shear() {
    let energy = fabric(&ncf("fibre-energy", "")).unwrap();
    let hypo = fabric(&ncf("hypoelastic", "")).unwrap();
    for to in [0.45, -0.7] {
        let (mut p, mut q) = (Point::new(&energy), Point::new(&hypo));
        for i in 1..=2000 {
            let t = i as f64 / 2000.0;
            let c = metric(1.0 + 0.004 * t, 1.0 - 0.002 * t, to * t);
            let (a, b) = (p.at(&energy, c), q.at(&hypo, c));
            if i % 200 == 0 {
                let scale = a.stress.iter().fold(0.0f64, |m, s| m.max(s.abs()));
                for k in 0..3 {
                    let d = (a.stress[k] - b.stress[k]).abs();
                    assert!(
                        d < 0.01 * scale,
                        "{t}: {:?} against {:?}",
                        a.stress,
                        b.stress
                    );
                }
                assert!((a.energy - b.energy).abs() < 0.01 * a.energy, "{a:?} {b:?}");
            }
        }
    }
}

#[test]
fn hypoelastic_returns_to_rest_after_a_closed_path_within_a_thousandth() {
    let m = fabric(&woven("hypoelastic")).unwrap();
    let mut p = Point::new(&m);
    let (mut top, mut last) = (0.0f64, [0.0; 3]);
    for i in 0..=4000 {
        let t = std::f64::consts::TAU * i as f64 / 4000.0;
        let c = metric(
            1.0 + 0.003 * t.sin(),
            1.0 + 0.003 * (1.0 - t.cos()),
            0.6 * t.sin(),
        );
        last = p.at(&m, c).stress;
        top = last.iter().fold(top, |m, s| m.max(s.abs()));
    }
    assert!(
        last.iter().all(|s| s.abs() < 1e-3 * top),
        "left {last:?} of {top} N/m"
    );
}

/// A fibre that trembles about no strain, in unequal steps: what is stored is what its stretch says, however often it went through, and is never negative.
#[test]
fn fibres_softer_in_compression_make_no_energy_as_they_pass_no_strain() {
    let json = woven("hypoelastic").replace(
        "\"fibre_modulus\":3e9",
        "\"fibre_modulus\":3e9,\"compression_factor\":0.1",
    );
    let m = fabric(&json).unwrap();
    let mut p = Point::new(&m);
    let k = 3e9 * 3e-4;
    for i in 0..4000 {
        let strain = 1e-4 * (0.7 * f64::from(i)).sin();
        let out = p.at(&m, metric(1.0 + strain, 1.0, 0.0));
        let stiffness = if strain < 0.0 { 0.1 * k } else { k };
        let stress = stiffness * strain;
        assert!(
            (out.stress[0] - stress).abs() < 1e-3 * k * 1e-4,
            "step {i}: {} N/m, expected {stress}",
            out.stress[0]
        );
        let energy = 0.5 * stiffness * strain * strain;
        assert!(
            (out.energy - energy).abs() < 1e-3 * 0.5 * k * 1e-8,
            "step {i}: {} J/m2, expected {energy}",
            out.energy
        );
    }
}

#[test]
fn stitch_unloads_along_the_secant_after_its_peak() {
    let m = fabric(&ncf("fibre-energy", "")).unwrap();
    let mut p = Point::new(&m);
    p.at(&m, metric(1.0, 1.0, 0.6));
    let top = ncf_curve(0.6) - ncf_yarn(0.6);
    for g in [0.55, 0.3, 0.1] {
        let f = p.at(&m, metric(1.0, 1.0, g)).stress[2] - ncf_yarn(g);
        let secant = top * (g - 0.06) / (0.6 - 0.06);
        assert!(
            (f - secant).abs() < 1e-6 * top,
            "g = {g}: {f} N/m, secant {secant}"
        );
    }
    p.at(&m, metric(1.0, 1.0, 0.8));
    let f = p.at(&m, metric(1.0, 1.0, 0.4)).stress[2];
    assert!(
        (f - ncf_yarn(0.4)).abs() < 1e-6,
        "a broken stitch carries nothing, not {f}"
    );
}

#[test]
fn uniaxial_film_returns_its_input_curve() {
    let m = film(FILM).unwrap();
    let p = Point::new(&m);
    for i in 1..=500 {
        let e = i as f64 * 0.01;
        let l = 1.0 + e;
        // Uniaxial and incompressible: both other stretches are l^-1/2.
        let a = p.peek(&m, [l * l, 1.0 / l, 0.0]);
        let nominal = a.stress[0] * l / 8e-5;
        let want = 6.364e6 * ((0.4451 * e).exp() - (-7.545 * e).exp());
        assert!(
            (nominal - want).abs() < 1e-9 * want,
            "e = {e}: {nominal} Pa, not {want}"
        );
        assert!(
            a.stress[1].abs() < 1e-9 * a.stress[0].abs(),
            "lateral stress {}",
            a.stress[1]
        );
    }
}

#[test]
fn film_from_a_table_returns_the_table() {
    let json = r#"{"uniaxial":{"strains":[0,0.1,1,5],"stresses":[0,4e6,9e6,6e7]},
                   "thickness":8e-5,"areal_mass":0.08}"#;
    let m = film(json).unwrap();
    let p = Point::new(&m);
    for (e, want) in [
        (0.05, 2e6),
        (0.1, 4e6),
        (0.55, 6.5e6),
        (5.0, 6e7),
        (6.0, 7.275e7),
    ] {
        let l: f64 = 1.0 + e;
        let t = p.peek(&m, [l * l, 1.0 / l, 0.0]).stress[0] * l / 8e-5;
        assert!(
            (t - want).abs() < 1e-9 * want,
            "e = {e}: {t} Pa, not {want}"
        );
    }
    check_gradient(&m, &p, [1.5, 1.1, 0.2], 1e-5);
}

/// The film's nominal stress by its definition, without the kernel: U'(I1) from the uniaxial curve, the strain of the
/// same I1 by bisection.
fn marlow_by_bisection(first: f64, power: i32, l: f64) -> f64 {
    let t = |e: f64| 6.364e6 * ((0.4451 * e).exp() - (-7.545 * e).exp());
    let (mut low, mut high) = (1.0f64, 50.0f64);
    for _ in 0..200 {
        let m = 0.5 * (low + high);
        if m * m + 2.0 / m < first {
            low = m;
        } else {
            high = m;
        }
    }
    let rate = t(low - 1.0) / (2.0 * (low - low.powi(-2)));
    2.0 * rate * (l - l.powi(-power))
}

#[test]
fn film_predicts_the_measured_biaxial_and_planar_curves_better_than_stated_under_every_norm() {
    let m = film(FILM).unwrap();
    let p = Point::new(&m);
    // Root-mean-square difference over 0 to the end of the test (200 even strains), over the largest
    // measured stress, over the root mean square of the measured stresses, and of the relative differences.
    let errors = |metric: fn(f64) -> [f64; 3],
                  first: fn(f64) -> f64,
                  power: i32,
                  curve: fn(f64) -> f64,
                  to: f64| {
        let (mut d, mut f, mut top, mut relative) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
        for i in 1..=200 {
            let e = to * i as f64 / 200.0;
            let l = 1.0 + e;
            let t = p.peek(&m, metric(l)).stress[0] * l / 8e-5;
            let own = marlow_by_bisection(first(l), power, l);
            assert!((t - own).abs() < 1e-7 * own, "{t} Pa, not {own}");
            d += (t - curve(e)).powi(2);
            f += curve(e).powi(2);
            relative += (t / curve(e) - 1.0).powi(2);
            top = top.max(curve(e));
        }
        [
            (d / 200.0).sqrt() / top,
            (d / f).sqrt(),
            (relative / 200.0).sqrt(),
        ]
    };
    let biaxial = errors(
        |l| [l * l, l * l, 0.0],
        |l| 2.0 * l * l + l.powi(-4),
        5,
        |e| 6.482e6 * ((0.4871 * e).exp() - (-12.04 * e).exp()),
        1.0,
    );
    let planar = errors(
        |l| [l * l, 1.0, 0.0],
        |l| l * l + 1.0 + l.powi(-2),
        3,
        |e| 7.238e6 * ((0.3774 * e).exp() - (-8.312 * e).exp()),
        2.0,
    );
    println!("largest, rms, relative: equibiaxial {biaxial:.4?}, planar {planar:.4?}");
    // The thesis states 7.5 % and 4.1 % and no norm.
    assert!(
        biaxial.iter().all(|e| *e < 0.075) && planar.iter().all(|e| *e < 0.041),
        "biaxial {biaxial:?}, planar {planar:?}"
    );
}

#[test]
fn voce_moments_follow_their_law_for_each_sign_and_family() {
    let voce = |k: f64, a: f64, b: f64, c: f64| a * k + b * (1.0 - (-k / c).exp());
    let m = fabric(&ncf("fibre-energy", "")).unwrap();
    for g in [0.0, 0.6, -0.8] {
        for k in [1.0, 7.0, 20.0, 50.0] {
            let up = bend(&m, metric(1.0, 1.0, g), [k, k, 0.0]).moment;
            let down = bend(&m, metric(1.0, 1.0, g), [-k, -k, 0.0]).moment;
            let plus = voce(k, 1.9457e-4, 0.03139, 4.0);
            let minus = voce(k, 1.0279e-4, 0.03619, 6.5);
            for (got, want) in [
                (up[0], plus),
                (up[1], minus),
                (down[0], -minus),
                (down[1], -plus),
            ] {
                assert!((got - want).abs() < 1e-12, "k = {k}: {got} N, not {want}");
            }
        }
    }
}

#[test]
fn moments_are_the_gradient_of_the_bending_energy() {
    let m = fabric(&ncf("fibre-energy", "")).unwrap();
    let mut r = Random(5);
    for _ in 0..100 {
        let k = [60.0 * r.next(), 60.0 * r.next(), 60.0 * r.next()];
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
            assert!((w - a.moment[i]).abs() < 1e-8, "{k:?}: {w}, {:?}", a.moment);
            assert!(
                (t - a.tangent[i]).abs() < 1e-6 * (1.0 + a.tangent[i]),
                "{k:?}: tangent {t}"
            );
        }
    }
}

/// Largest eigenvalue of dS/dE (as a map of symmetric tensors) by differences.
fn largest_tangent(m: &Mat, p: &Point, c: [f64; 3]) -> f64 {
    let r2 = 2f64.sqrt();
    // Orthonormal basis of symmetric tensors: E11, E22, sqrt(2) E12.
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
    // Power iteration on D + shift: D may be indefinite.
    let shift: f64 = d.iter().flatten().map(|x| x.abs()).sum();
    let mut v = [0.6, 0.5, 0.4];
    let mut value = 0.0;
    for _ in 0..20_000 {
        let w: [f64; 3] = std::array::from_fn(|i| {
            (0..3)
                .map(|j| 0.5 * (d[i][j] + d[j][i]) * v[j])
                .sum::<f64>()
                + shift * v[i]
        });
        value = w.iter().map(|x| x * x).sum::<f64>().sqrt();
        v = w.map(|x| x / value);
    }
    value - shift
}

#[test]
fn reported_tangent_bounds_the_largest_eigenvalue_in_random_states() {
    let mut r = Random(3);
    for (m, stretch) in [
        (fabric(&ncf("fibre-energy", "")).unwrap(), 0.02),
        (fabric(&woven("fibre-energy")).unwrap(), 0.02),
        (film(FILM).unwrap(), 0.9),
    ] {
        for _ in 0..60 {
            let wide = |x: f64| {
                if stretch > 0.5 {
                    1.0 + 0.6 * (x + 0.5)
                } else {
                    1.0 + stretch * x
                }
            };
            let c = metric(wide(r.next()), wide(r.next()), 0.9 * r.next());
            let p = Point::new(&m);
            let (bound, exact) = (p.peek(&m, c).stiffness[0], largest_tangent(&m, &p, c));
            assert!(bound > 0.999 * exact, "{c:?}: bound {bound}, exact {exact}");
            assert!(
                bound < 20.0 * exact.abs() + 1e4,
                "{c:?}: bound {bound} is useless ({exact})"
            );
            assert!(p.peek(&m, c).stiffness[1] > 0.0);
        }
    }
}

#[test]
fn reported_tangent_is_exact_for_undeformed_sheets() {
    for m in [fabric(&woven("fibre-energy")).unwrap(), film(FILM).unwrap()] {
        let p = Point::new(&m);
        // A state next to rest, because the film's U'' has a kink there.
        let c = [1.0 + 1e-6, 1.0 + 1e-6, 0.0];
        let (bound, exact) = (p.peek(&m, c).stiffness[0], largest_tangent(&m, &p, c));
        assert!(
            bound > 0.999 * exact && bound < 1.01 * exact,
            "bound {bound}, exact {exact}"
        );
    }
}

#[test]
fn shear_stiffness_stays_positive_while_the_stitch_softens() {
    for form in ["fibre-energy", "hypoelastic"] {
        let m = fabric(&ncf(form, "")).unwrap();
        let mut p = Point::new(&m);
        for i in -120..=140 {
            let a = p.at(&m, metric(1.0, 1.0, 0.01 * i as f64));
            assert!(a.stiffness[1] > 50.0, "{form} at {i}: {:?}", a.stiffness);
        }
    }
}

#[test]
fn extreme_states_give_finite_answers_in_every_material() {
    let states = [
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 1.0],
        [1.0, 1.0, -1.0],
        [1.0, 1.0, 1.5],
        [1e-12, 1.0, 0.0],
        [1e6, 1e-6, 0.0],
        [1e4, 1e4, 0.0],
        [100.0, 100.0, 99.9999],
        [1e-9, 1e-9, 1e-9],
    ];
    for m in [
        fabric(&ncf("fibre-energy", "")).unwrap(),
        fabric(&ncf("hypoelastic", "")).unwrap(),
        fabric(&woven("hypoelastic")).unwrap(),
        film(FILM).unwrap(),
    ] {
        let mut p = Point::new(&m);
        for c in states.iter().chain(states.iter().rev()) {
            let a = p.at(&m, *c);
            let all = a.stress.iter().chain([&a.energy]).chain(&a.stiffness);
            assert!(all.clone().all(|x| x.is_finite()), "{c:?}: {a:?}");
        }
    }
}

#[test]
fn undeformed_state_is_free_of_stress_and_energy() {
    for m in [
        fabric(&ncf("fibre-energy", "")).unwrap(),
        fabric(&ncf("hypoelastic", "")).unwrap(),
        film(FILM).unwrap(),
    ] {
        let a = Point::new(&m).at(&m, [1.0, 1.0, 0.0]);
        assert!(
            a.stress.iter().all(|s| s.abs() < 1e-9) && a.energy.abs() < 1e-12,
            "{a:?}"
        );
    }
}

#[test]
fn wrong_parameters_are_refused_with_the_reason() {
    let cases = [
        (
            ncf("fibre-energy", "").replace("[0,112.19", "[5,112.19"),
            "shear.coefficients",
        ),
        (
            ncf("fibre-energy", "").replace("\"forces\":[0,880,0]", "\"forces\":[0,880,10]"),
            "stitch",
        ),
        (
            ncf("fibre-energy", "").replace("\"scale\":4.0", "\"scale\":0"),
            "bending.positive.scale",
        ),
        (
            ncf("fibre-energy", "").replace("3e9", "-3e9"),
            "fibre_modulus",
        ),
        (ncf("fibre-energy", ",\"typo\":1"), "typo"),
        (ncf("elastic", ""), "elastic"),
    ];
    for (json, word) in cases {
        let text = fabric(&json).err().unwrap();
        assert!(text.contains(word), "'{text}' does not name '{word}'");
    }
    for (json, word) in [
        (FILM.replace("\"decay\":7.545", "\"decay\":0"), "decay"),
        (FILM.replace(",\"decay\":7.545", ""), "decay"),
        (FILM.replace("\"growth\":0.4451,", ""), "growth"),
    ] {
        assert!(film(&json).err().is_some_and(|t| t.contains(word)));
    }
}

#[test]
fn film_tables_that_cannot_be_are_refused_with_place_and_advice() {
    let make = |e: &str, t: &str| {
        film(&format!(
            r#"{{"uniaxial":{{"strains":{e},"stresses":{t}}},"thickness":8e-5,"areal_mass":0.08}}"#
        ))
    };
    assert!(make("[0,0.1,1]", "[0,4e6,9e6]").is_ok());
    let table = r#"{"strains":[0,0.1,1],"stresses":[0,4e6,9e6]}"#;
    let limited =
        format!(r#"{{"uniaxial":{table},"limit":5.0,"thickness":8e-5,"areal_mass":0.08}}"#);
    assert!(film(&limited).is_err_and(|t| t.contains("limit: given 5")));
    let long = format!("{:?}", (0..33).collect::<Vec<i32>>());
    for (e, t, words) in [
        ("[0,0.1]", "[0,4e6,9e6]", ["2 strains", "3 stresses"]),
        ("[0]", "[0]", ["1 points", "2 to 32"]),
        (&long, &long, ["33 points", "2 to 32"]),
        ("[0.1,1]", "[0,4e6]", ["uniaxial.strains[0]", "in front"]),
        ("[0,1]", "[5,4e6]", ["uniaxial.stresses[0]", "offset"]),
        (
            "[0,0.1,0.1]",
            "[0,4e6,9e6]",
            ["uniaxial.strains[2]", "0.1 after 0.1"],
        ),
        (
            "[0,0.1,1]",
            "[0,4e6,3e6]",
            ["uniaxial.stresses[2]", "3000000 Pa after 4000000 Pa"],
        ),
        ("[0,0.1,-1]", "[0,4e6,9e6]", ["uniaxial.strains[2]", "sort"]),
    ] {
        let text = make(e, t).err().unwrap();
        for word in words {
            assert!(text.contains(word), "'{text}' does not say '{word}'");
        }
    }
}
