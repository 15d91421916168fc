//! Rucks against published constants, and against an integration of the strip that knows nothing of harmonics.

use plyflow_defect_detection::{Harmonic, Ruck, Stretch};

/// A linear law (N m).
fn linear(stiffness: f64) -> Harmonic {
    Harmonic::of(|curvatures| curvatures.iter().map(|k| stiffness * k).collect())
}

/// The positive law of the non-crimp fabric (thesis tables 3.1 and 3.2): `linear` (N m), `asymptote` (N) and `scale` (1/m).
const VOCE: [f64; 3] = [0.19457e-3, 0.03139, 4.0];

fn moment(k: f64) -> f64 {
    let [linear, asymptote, scale] = VOCE;
    linear * k + asymptote * (1.0 - (-k.abs() / scale).exp()).copysign(k)
}

/// The inverse of [`moment`], by halving.
fn curvature(m: f64) -> f64 {
    let (mut low, mut high) = (0.0, m.abs() / VOCE[0]);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if moment(middle) < m.abs() {
            low = middle;
        } else {
            high = middle;
        }
    }
    (0.5 * (low + high)).copysign(m)
}

fn voce() -> Harmonic {
    Harmonic::of(|curvatures| curvatures.iter().map(|k| moment(*k)).collect())
}

/// Within a share of the expected value.
fn near(got: f64, expected: f64, share: f64, what: &str) {
    assert!(
        (got - expected).abs() <= share * expected.abs(),
        "{what}: {got}, expected {expected}"
    );
}

#[test]
fn a_linear_strip_has_the_constants_of_hobbs() {
    for (stiffness, pressure, height) in [(1e-3, 1e5, 1e-3), (8e-3, 2e3, 5e-4), (0.5, 1e4, 3e-3)] {
        let ruck = Ruck::under(&linear(stiffness), pressure, height);
        let l = ruck.length;
        // Hobbs 1984: P = 80.76 EI / L^2, w = 2.408e-3 q L^4 / EI; length taken by the mode in his balance of lengths 1.597e-5 q^2 L^7 / EI^2.
        near(ruck.force, 80.76 * stiffness / (l * l), 1e-4, "force");
        near(
            height,
            2.408e-3 * pressure * l.powi(4) / stiffness,
            1e-3,
            "height",
        );
        let excess = 1.597e-5 * pressure.powi(2) * l.powi(7) / stiffness.powi(2);
        near(ruck.excess, excess, 1e-3, "excess length");
    }
}

/// Integrates the strip from where it leaves the plane (`M = 0`, `M' = q l`) to the middle by Runge and Kutta: `M'' = -q - P k(M)`, `w'' = k`. Gives
/// the shear in the middle, the height there and the excess length of both halves.
fn integrated(force: f64, pressure: f64, half: f64, steps: usize) -> [f64; 3] {
    let h = half / steps as f64;
    let rates = |s: [f64; 5]| {
        let k = curvature(s[0]);
        [s[1], -pressure - force * k, s[3], k, s[3] * s[3]]
    };
    let mut state = [0.0, pressure * half, 0.0, 0.0, 0.0];
    for _ in 0..steps {
        let moved = |by: [f64; 5], f: f64| std::array::from_fn(|i| state[i] + f * h * by[i]);
        let a = rates(state);
        let b = rates(moved(a, 0.5));
        let c = rates(moved(b, 0.5));
        let d = rates(moved(c, 1.0));
        state =
            std::array::from_fn(|i| state[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
    }
    [state[1], state[2].abs(), state[4]]
}

/// The force at which the middle of a half of that length (m) has no shear, between the forces of the two linear limits of the law.
fn held(pressure: f64, half: f64) -> f64 {
    let [linear, asymptote, scale] = VOCE;
    let limit = |d: f64| 4.493_409_457_909_064_f64.powi(2) * d / (half * half);
    let (from, to) = (0.9 * limit(linear), 1.1 * limit(linear + asymptote / scale));
    let shear = |force: f64| integrated(force, pressure, half, 400)[0];
    let ladder: Vec<f64> = (0..=40)
        .map(|i| from * (to / from).powf(f64::from(i) / 40.0))
        .collect();
    let sign = shear(from);
    let after = ladder
        .iter()
        .position(|p| shear(*p) * sign < 0.0)
        .expect("a balance");
    let (mut low, mut high) = (ladder[after - 1], ladder[after]);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if shear(middle) * sign > 0.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[test]
fn a_softening_law_is_met_within_six_per_cent_of_the_integrated_strip() {
    let law = voce();
    let cases = [
        (1e5, 2e-3),
        (1e5, 3e-3),
        (1e4, 5e-3),
        (1e4, 8e-3),
        (1e3, 12e-3),
    ];
    for (pressure, half) in cases {
        let force = held(pressure, half);
        let [_, height, excess] = integrated(force, pressure, half, 2000);
        let ruck = Ruck::under(&law, pressure, height);
        let what = format!("{pressure} Pa, {height} m");
        near(ruck.force, force, 0.06, &format!("force at {what}"));
        near(ruck.length, 2.0 * half, 0.04, &format!("length at {what}"));
        near(
            ruck.excess,
            excess,
            0.05,
            &format!("excess length at {what}"),
        );
    }
}

#[test]
fn the_integration_itself_has_the_constants_of_hobbs_where_the_law_is_stiff() {
    // Heights of some micrometres: curvatures far below the law's scale, so it is linear with B + M / k.
    let [linear, asymptote, scale] = VOCE;
    let stiffness = linear + asymptote / scale;
    let (pressure, half) = (10.0, 5e-3);
    let force = held(pressure, half);
    near(
        force,
        80.76 * stiffness / (4.0 * half * half),
        2e-3,
        "force",
    );
    let [_, height, _] = integrated(force, pressure, half, 2000);
    near(
        height,
        2.408e-3 * pressure * (2.0 * half).powi(4) / stiffness,
        5e-3,
        "height",
    );
}

#[test]
fn a_strip_between_clamps_is_that_of_euler() {
    let ruck = Ruck::clamped(&linear(2e-3), 0.05, 1e-3);
    let pi = std::f64::consts::PI;
    near(
        ruck.force,
        4.0 * pi * pi * 2e-3 / 0.05f64.powi(2),
        1e-9,
        "force",
    );
    // The arc of (a / 2) (1 + cos(2 pi x / L)) over its chord, by adding up chords.
    let n = 20_000;
    let w = |i: usize| 0.5e-3 * (1.0 + (2.0 * pi * i as f64 / n as f64).cos());
    let dx: f64 = 0.05 / f64::from(n as u32);
    let arc: f64 = (0..n).map(|i| dx.hypot(w(i + 1) - w(i))).sum();
    near(ruck.excess, arc - 0.05, 2e-3, "excess length");
}

/// A stretch of a uniform state, 100 mm long.
fn uniform(compression: f64, pressure: f64) -> Stretch {
    Stretch {
        compression: vec![compression; 100],
        pressure: vec![pressure; 100],
        step: 1e-3,
        at: 40,
    }
}

#[test]
fn a_uniform_stretch_gives_what_its_force_leaves_over_that_of_the_ruck() {
    let law = linear(2e-3);
    let (stiffness, height) = (1.2e6, 1e-3);
    let ruck = uniform(0.0, 1e5).ruck(&law, height);
    near(
        ruck.length,
        Ruck::under(&law, 1e5, height).length,
        1e-6,
        "length",
    );
    let gives = uniform(ruck.force + 600.0, 1e5).gives(ruck.force, stiffness);
    near(gives, 600.0 * 0.1 / stiffness, 1e-9, "length given");
    // Just enough for the least height, and for no higher one.
    let enough = ruck.force + ruck.excess * stiffness / 0.1;
    near(
        uniform(enough, 1e5).excess(&law, stiffness, height),
        1.0,
        1e-6,
        "excess",
    );
    assert!(uniform(0.99 * enough, 1e5).excess(&law, stiffness, height) < 1.0);
    assert_eq!(
        uniform(0.5 * ruck.force, 1e5).excess(&law, stiffness, 1e-4),
        0.0
    );
}

#[test]
fn where_nothing_presses_a_ruck_is_as_long_as_the_place_that_lets_it() {
    let law = linear(2e-3);
    let height = 1e-3;
    // 20 mm in the middle of 100 without pressure: longer than the ruck under 1 bar, and no longer than the place and its margins.
    let mut stretch = uniform(1e3, 1e5);
    stretch.at = 50;
    stretch.pressure[40..60].fill(0.0);
    let held = uniform(1e3, 1e5).ruck(&law, height);
    let free = stretch.ruck(&law, height);
    assert!(
        free.length > held.length && free.length > 0.02 && free.length < 0.035,
        "{free:?}"
    );
    assert!(free.force < 0.5 * held.force && free.excess < held.excess);
    // Nothing presses at all: Euler's strip over all of it.
    let none = uniform(1e3, 0.0).ruck(&law, height);
    assert_eq!(none, Ruck::clamped(&law, 0.1, height));
}

#[test]
fn more_pressure_or_a_stiffer_ply_never_needs_less_force() {
    let mut last = 0.0;
    for pressure in [1e2, 1e3, 1e4, 1e5, 1e6] {
        let force = Ruck::under(&voce(), pressure, 1e-3).force;
        assert!(force > last, "{pressure} Pa: {force} after {last} N/m");
        last = force;
    }
    let (one, two) = (voce(), voce().plus(&voce()));
    for height in [5e-4, 1e-3, 2e-3] {
        let [one, two] = [&one, &two].map(|law| Ruck::under(law, 1e5, height));
        assert!(two.force > one.force && two.length > one.length);
        // Two that lift together share the pressure: each needs less than alone.
        assert!(two.force < 2.0 * one.force);
    }
}
