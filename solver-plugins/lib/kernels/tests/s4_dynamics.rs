//! Small structures of `s4` stepped explicitly, with spins.

mod common;
mod s4_support;
use common::*;
use s4_support::model::{Model, rectangle};

/// A distorted 6 x 6 mesh with random velocities and spins.
fn shaken(json: &str, form: &str) -> Model {
    let mesh = rectangle([6, 6], [0.03, 0.03], 0.2);
    let mut s = Model::new(json, &fabric(&ncf(form, "")).unwrap(), mesh, AXIS);
    let mut r = Random(44);
    for n in 0..s.x.len() {
        s.v[n] = std::array::from_fn(|_| 0.5 * r.next());
        // As fast as half an element's length would ask of the directors.
        s.w[n] = std::array::from_fn(|_| 200.0 * r.next());
    }
    s
}

#[test]
fn free_vibration_with_spins_at_the_reported_step_conserves_energy() {
    for (json, form) in [
        (r#"{"bending":"lagged-tangent"}"#, "fibre-energy"),
        (r#"{"bending":"lagged-tangent"}"#, "hypoelastic"),
        ("{}", "fibre-energy"),
        (r#"{"bending":"total","twist":"material"}"#, "fibre-energy"),
    ] {
        let mut s = shaken(json, form);
        let mut f = s.internal(0.0);
        let dt = 0.9 * f.step;
        let (mut first, mut last, mut bending) = (0.0, 0.0, 0.0f64);
        for i in 0..4000 {
            let before = s.kinetic();
            let stored: f64 = f.energy.iter().sum();
            bending = bending.max(f.energy[1]);
            s.step(dt, &f);
            // Kinetic energy at whole steps from the half steps around; it swings with the highest
            // modes, so means count.
            let sum = 0.5 * (before + s.kinetic()) + stored;
            if i < 1000 {
                first += sum / 1000.0;
            } else if i >= 3000 {
                last += sum / 1000.0;
            }
            f = s.internal(dt);
        }
        println!("{json}: {first} J, {last} J, bending up to {bending} J");
        assert!(
            (last / first - 1.0).abs() < 0.01,
            "{json}: {first} J became {last} J"
        );
        assert!(
            bending > 0.01 * first,
            "bending played no part: {bending} of {first} J"
        );
    }
}

#[test]
fn reported_step_is_not_needlessly_small() {
    let mut s = shaken(r#"{"bending":"total"}"#, "fibre-energy");
    let start = s.kinetic();
    let mut f = s.internal(0.0);
    let dt = 2.25 * f.step;
    for _ in 0..300 {
        s.step(dt, &f);
        f = s.internal(dt);
    }
    let wild = s.kinetic();
    assert!(
        wild.is_nan() || wild > 10.0 * start,
        "2.25 times the step is stable too: {wild} J"
    );
}
