//! Friction between yarns, in shear and in bending: what a cycle costs, how tension adds to it, and that nothing comes back.

mod common;
mod fabric_support;
use common::*;
use fabric_support::*;
use serde_json::{Value, json};

/// Half of the width of the loop (N/m), and the sine over which it builds up.
const LIMIT: f64 = 20.0;
const SLIP: f64 = 0.03;

fn rubbing(form: &str, per_tension: f64) -> Value {
    let mut shear = json!({"coefficients": NCF_YARN});
    shear["hysteresis"] =
        json!({"force": LIMIT, "angle": f64::asin(SLIP), "per_tension": per_tension});
    sheet(form, &shear, None)
}

/// Goes to the sine `to` in `n` steps of the sine; the work on the way (J/m2), by the trapezoidal rule.
fn leg(p: &mut Point, m: &Mat, from: f64, to: f64, n: usize) -> f64 {
    let mut last = p.peek(m, [1.0, 1.0, from]).stress[2];
    let mut work = 0.0;
    for i in 1..=n {
        let s = from + (to - from) * i as f64 / n as f64;
        let now = p.at(m, [1.0, 1.0, s]).stress[2];
        work += 0.5 * (last + now) * (to - from) / n as f64;
        last = now;
    }
    work
}

#[test]
fn a_closed_loop_costs_what_the_closed_form_says_in_both_forms() {
    for form in FORMS {
        let m = build(&rubbing(form, 0.0));
        let mut p = Point::new(&m);
        let width = 0.8;
        leg(&mut p, &m, 0.0, 0.5 * width, 4000);
        let before = p.peek(&m, [1.0, 1.0, 0.5 * width]).energy;
        let there = leg(&mut p, &m, 0.5 * width, -0.5 * width, 4000);
        let back = leg(&mut p, &m, -0.5 * width, 0.5 * width, 4000);
        let lost = p.peek(&m, [1.0, 1.0, 0.5 * width]).energy - before;
        let wanted = 4.0 * LIMIT * (0.5 * width - SLIP);
        assert!(
            ((there + back) / wanted - 1.0).abs() < 1e-3,
            "{form}: {} {wanted}",
            there + back
        );
        assert!(
            (lost / wanted - 1.0).abs() < 1e-3,
            "{form}: {lost} {wanted}"
        );
    }
}

#[test]
fn the_law_is_the_middle_of_the_loop_and_the_limit_is_half_of_its_width() {
    let m = build(&rubbing("fibre-energy", 0.0));
    for i in 0..20 {
        let g: f64 = -0.5 + 0.05 * i as f64;
        let (mut up, mut down) = (Point::new(&m), Point::new(&m));
        leg(&mut up, &m, 0.0, -0.7, 200);
        leg(&mut down, &m, 0.0, 0.7, 200);
        let rising = up.at(&m, metric(1.0, 1.0, g)).stress[2];
        let falling = down.at(&m, metric(1.0, 1.0, g)).stress[2];
        let law = polynomial(&NCF_YARN, g);
        assert!(
            (0.5 * (rising + falling) - law).abs() < 1e-9,
            "{g}: {rising} {falling} {law}"
        );
        assert!(
            (0.5 * (rising - falling) - LIMIT).abs() < 1e-9,
            "{g}: {rising} {falling}"
        );
    }
}

/// A cycle within the slip costs nothing, and its force follows the spring.
#[test]
fn small_cycles_that_do_not_slide_give_all_back() {
    let m = build(&rubbing("fibre-energy", 0.0));
    let mut p = Point::new(&m);
    for round in 0..200 {
        let s = 0.99 * SLIP * (0.3 * f64::from(round)).sin();
        let a = p.at(&m, [1.0, 1.0, s]);
        let law = polynomial(&NCF_YARN, s.asin());
        assert!(
            (a.stress[2] - law - LIMIT / SLIP * s).abs() < 1e-9,
            "{s}: {:?}",
            a.stress
        );
    }
    assert_eq!(p.peek(&m, [1.0, 1.0, 0.0]).energy, 0.0);
}

#[test]
fn tension_of_both_families_adds_to_the_friction_and_compression_does_not() {
    let share = 0.05;
    for form in FORMS {
        let m = build(&rubbing(form, share));
        for (l1, l2) in [
            (1.0, 1.0),
            (1.001, 1.0),
            (1.001, 1.0005),
            (0.999, 1.001),
            (0.999, 0.998),
        ] {
            let mut p = Point::new(&m);
            // Stretched first, then sheared.
            p.at(&m, metric(l1, l2, 0.0));
            let mut force = 0.0;
            for i in 1..=200 {
                force = p.at(&m, metric(l1, l2, 0.002 * f64::from(i))).stress[2] * l1 * l2;
            }
            let pulled = |l: f64| 3e9 * 4e-4 * (l - 1.0).max(0.0);
            let wanted = polynomial(&NCF_YARN, 0.4) + LIMIT + share * (pulled(l1) + pulled(l2));
            assert!(
                (force / wanted - 1.0).abs() < 3e-3,
                "{form} {l1} {l2}: {force} {wanted}"
            );
        }
    }
}

#[test]
fn what_was_lost_never_comes_back_and_energy_is_the_work_that_was_done() {
    let m = build(&rubbing("fibre-energy", 0.02));
    let mut p = Point::new(&m);
    let mut r = Random(21);
    let rest = |p: &Point| {
        // Lost, and what the spring holds at most.
        p.history[3 * LANES]
    };
    let (mut lost, mut work) = (0.0, 0.0);
    let (mut c, mut a) = ([1.0, 1.0, 0.0], Point::new(&m).at(&m, [1.0, 1.0, 0.0]));
    for _ in 0..400 {
        // Straight ways in small steps, so that the trapezoidal rule does.
        let to = metric(1.0 + 4e-4 * r.next(), 1.0 + 4e-4 * r.next(), 0.6 * r.next());
        let from = c;
        for i in 1..=200 {
            let t = f64::from(i) / 200.0;
            let next: [f64; 3] = std::array::from_fn(|k| from[k] + t * (to[k] - from[k]));
            let b = p.at(&m, next);
            // dW = S11 dE11 + S22 dE22 + 2 S12 dE12, E = (C - 1) / 2.
            for (k, share) in [0.5, 0.5, 1.0].into_iter().enumerate() {
                work += 0.5 * (a.stress[k] + b.stress[k]) * share * (next[k] - c[k]);
            }
            (c, a) = (next, b);
            assert!(rest(&p) >= lost, "{} after {lost}", rest(&p));
            lost = rest(&p);
        }
    }
    assert!(lost > 1000.0, "{lost}");
    assert!((a.energy / work - 1.0).abs() < 2e-3, "{} {work}", a.energy);
}

#[test]
fn the_shear_tangent_counts_the_spring() {
    let m = build(&rubbing("fibre-energy", 0.0));
    let plain = build(&sheet(
        "fibre-energy",
        &json!({"coefficients": NCF_YARN}),
        None,
    ));
    let [with, without] = [&m, &plain].map(|m| Point::new(m).at(m, [1.0, 1.0, 0.0]).stiffness[1]);
    assert!(
        (with - without - LIMIT / SLIP).abs() < 1e-9,
        "{with} {without}"
    );
}

#[test]
fn a_stitch_and_friction_do_not_disturb_each_other() {
    for form in FORMS {
        let mut both = rubbing(form, 0.0);
        both["stitch"] = stitch("positive");
        let m = build(&both);
        let stitched = build(&sheet(
            form,
            &json!({"coefficients": NCF_YARN}),
            Some(stitch("positive")),
        ));
        let (mut p, mut q) = (Point::new(&m), Point::new(&stitched));
        let mut last = (0.0f64, 0.0f64);
        for i in 0..2000 {
            let g = 0.7 * (0.01 * f64::from(i)).sin();
            let rubs = p.at(&m, metric(1.0, 1.0, g)).stress[2]
                - q.at(&stitched, metric(1.0, 1.0, g)).stress[2];
            assert!(rubs.abs() < LIMIT + 1e-9, "{form} {g}: {rubs}");
            let way = g.sin() - last.0;
            // Where it turns round.
            if i > 0 && way * (last.0 - last.1) < 0.0 {
                last.1 = last.0;
            }
            // While it has slid for long, it is the limit against the way.
            if (g.sin() - last.1).abs() > 3.0 * SLIP {
                assert!(
                    (rubs - LIMIT * way.signum()).abs() < 1e-9,
                    "{form} {g}: {rubs}"
                );
            }
            last.0 = g.sin();
        }
    }
}

fn bending(hysteresis: &Value) -> Mat {
    let mut ply = sheet("fibre-energy", &json!({"coefficients": NCF_YARN}), None);
    ply["bending"] = json!({
        "family_1": {"positive": {"linear": 1e-4, "asymptote": 0.01, "scale": 10.0}, "hysteresis": hysteresis},
        "family_2": {"positive": {"stiffness": 1e-5}},
        "twist_stiffness": 1e-6
    });
    build(&ply)
}

/// Family 1 goes through the curvatures (1/m) while family 2 follows at half of them: its moments and the energy of both.
fn bent(m: &Mat, curvatures: &[f64]) -> Vec<(f64, f64, f64)> {
    let mut history = plyflow_sdk::Aligned::zeros(m.0.sizes().bending_history * LANES);
    let metric = plyflow_sdk::Aligned::filled(1.0, 3 * LANES);
    let one = |k: f64, history: &mut plyflow_sdk::Aligned| {
        let mut curvature = plyflow_sdk::Aligned::zeros(3 * LANES);
        curvature[..LANES].fill(k);
        curvature[LANES..2 * LANES].fill(0.5 * k);
        let mut moment = plyflow_sdk::Aligned::zeros(3 * LANES);
        let mut tangent = plyflow_sdk::Aligned::zeros(3 * LANES);
        let mut energy = plyflow_sdk::Aligned::zeros(LANES);
        let code = m.0.bending(&mut plyflow_sdk::BendingBatch {
            lanes: LANES,
            dt: 0.0,
            metric: &metric,
            curvature: &curvature,
            history,
            moment: &mut moment,
            energy: &mut energy,
            tangent: Some(&mut tangent),
        });
        assert_eq!(code, plyflow_sdk::abi::PF_OK);
        assert!(
            (moment[LANES] - 0.5e-5 * k).abs() < 1e-15,
            "family 2 has no friction"
        );
        (moment[0], energy[0], tangent[0])
    };
    curvatures.iter().map(|k| one(*k, &mut history)).collect()
}

#[test]
fn a_bending_loop_costs_what_the_closed_form_says() {
    let (limit, slip, largest) = (0.004, 2.0, 40.0);
    let m = bending(&json!({"moment": limit, "curvature": slip}));
    let n = 4000;
    // 0, there, to the other side, and there again.
    let way: Vec<f64> = (0..=5 * n)
        .map(|i| {
            let t = i as f64 / n as f64;
            largest
                * if t < 1.0 {
                    t
                } else if t < 3.0 {
                    2.0 - t
                } else {
                    t - 4.0
                }
        })
        .collect();
    let states = bent(&m, &way);
    let work: f64 = (n + 1..=5 * n)
        .map(|i| 0.5 * (states[i].0 + states[i - 1].0) * (way[i] - way[i - 1]))
        .sum();
    let wanted = 4.0 * limit * (largest - slip);
    assert!((work / wanted - 1.0).abs() < 1e-3, "{work} {wanted}");
    let told = states[5 * n].1 - states[n].1;
    assert!((told / wanted - 1.0).abs() < 1e-3, "{told} {wanted}");
    // At rest the tangent is that of the law and of the spring; where it slides, that of the law alone.
    let law = |k: f64| 1e-4 + 0.01 / 10.0 * (-k / 10.0).exp();
    assert!((states[0].2 - law(0.0) - limit / slip).abs() < 1e-12);
    assert!((states[n].2 - law(largest)).abs() < 1e-12);
}

#[test]
fn without_friction_there_is_no_history_for_it() {
    let ply = sheet("fibre-energy", &json!({"coefficients": NCF_YARN}), None);
    let sizes = build(&ply).0.sizes();
    assert_eq!((sizes.membrane_history, sizes.bending_history), (0, 0));
    let sizes = build(&rubbing("hypoelastic", 0.0)).0.sizes();
    assert_eq!(sizes.membrane_history, 13);
    assert_eq!(
        bending(&json!({"moment": 0.001, "curvature": 1.0}))
            .0
            .sizes()
            .bending_history,
        4
    );
}

#[test]
fn friction_that_makes_no_sense_is_refused_by_its_place() {
    let error = |change: &dyn Fn(&mut Value)| {
        let mut ply = rubbing("fibre-energy", 0.0);
        change(&mut ply);
        fabric(&ply.to_string()).err().unwrap()
    };
    for (key, value, text) in [
        ("force", 0.0, "shear.hysteresis.force: given 0 N/m"),
        (
            "angle",
            1.0,
            "shear.hysteresis.angle: given 1.0000 rad (57.30 deg); expected more than 0 deg and at most 30 deg",
        ),
        ("angle", 0.0, "shear.hysteresis.angle"),
        (
            "per_tension",
            -0.1,
            "shear.hysteresis.per_tension: given -0.1",
        ),
    ] {
        let told = error(&|ply| ply["shear"]["hysteresis"][key] = json!(value));
        assert!(told.contains(text), "{told}");
    }
    let told = error(&|ply| {
        ply["bending"] = json!({
            "hysteresis": {"moment": 1e-3, "curvature": 1.0},
            "family_1": {"positive": {"stiffness": 1e-4}}, "family_2": {"positive": {"stiffness": 1e-4}}
        });
    });
    assert!(
        told.contains("bending.hysteresis: given together with"),
        "{told}"
    );
    let told = error(&|ply| {
        ply["bending"] = json!({"positive": {"stiffness": 1e-4}, "hysteresis": {"moment": 1e-3, "curvature": 0.0}});
    });
    assert!(
        told.contains("bending.hysteresis.curvature: given 0 1/m"),
        "{told}"
    );
}
