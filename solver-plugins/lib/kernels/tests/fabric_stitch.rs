//! The stitch as irreversible damage: what is held, what is lost, and when.

mod common;
mod fabric_support;
use common::*;
use fabric_support::*;
use serde_json::{Value, json};

/// Points of three pieces after the peak, with a plateau.
fn long_stitch(direction: &str) -> Value {
    json!({"direction": direction, "angles": [0.1, 0.4, 0.5, 0.6, 0.8], "forces": [0.0, 500.0, 200.0, 200.0, 0.0]})
}

fn curve(points: &Value, g: f64) -> f64 {
    let row = |k: &str| -> Vec<f64> {
        let list = points[k].as_array().unwrap();
        list.iter().map(|x| x.as_f64().unwrap()).collect()
    };
    let (x, y) = (row("angles"), row("forces"));
    (0..x.len() - 1)
        .find(|i| g >= x[*i] && g < x[*i + 1])
        .map_or(0.0, |i| {
            y[i] + (y[i + 1] - y[i]) * (g - x[i]) / (x[i + 1] - x[i])
        })
}

struct Rig {
    m: Mat,
    p: Point,
    sign: f64,
    points: Value,
}

impl Rig {
    fn new(direction: &str, points: fn(&str) -> Value) -> Self {
        let points = points(direction);
        let shear = json!({"coefficients": NCF_YARN});
        let m = build(&sheet("fibre-energy", &shear, Some(points.clone())));
        let sign = if direction == "positive" { 1.0 } else { -1.0 };
        Self {
            p: Point::new(&m),
            m,
            sign,
            points,
        }
    }

    /// Stitch force at the angle (size), after going there.
    fn force(&mut self, g: f64) -> f64 {
        let s = self.p.at(&self.m, metric(1.0, 1.0, self.sign * g)).stress[2];
        self.sign * s - polynomial(&NCF_YARN, g)
    }

    /// Energy lost so far: what is left of the energy in the flat, unsheared state.
    fn lost(&self) -> f64 {
        self.p.peek(&self.m, [1.0, 1.0, 0.0]).energy
    }

    fn yarn_energy(g: f64) -> f64 {
        // Simpson of F cos g dg.
        let n = 200;
        let f = |g: f64| polynomial(&NCF_YARN, g) * g.cos();
        let h = g / n as f64;
        (0..n)
            .map(|i| {
                let a = i as f64 * h;
                h / 6.0 * (f(a) + 4.0 * f(a + 0.5 * h) + f(a + h))
            })
            .sum()
    }
}

const BOTH: [&str; 2] = ["positive", "negative"];

#[test]
fn stitch_follows_its_curve_while_the_shear_grows_and_the_secant_below() {
    for direction in BOTH {
        for points in [stitch as fn(&str) -> Value, long_stitch] {
            let mut rig = Rig::new(direction, points);
            let onset = rig.points["angles"][0].as_f64().unwrap();
            for i in 1..=90 {
                let top = 0.01 * i as f64;
                let f = rig.force(top);
                let want = curve(&rig.points, top);
                assert!(
                    (f - want).abs() < 1e-9 * 880.0,
                    "{direction}: {f} N/m at {top}"
                );
                // Down and up again: both on the secant from the onset, which is the rise before the peak.
                let peak = rig.points["angles"][1].as_f64().unwrap();
                let (to, height) = (top.max(peak), curve(&rig.points, top.max(peak)));
                for part in [0.9, 0.5, 0.1, 0.5, 0.9, 1.0] {
                    let g = part * top;
                    let secant = height * ((g - onset) / (to - onset)).max(0.0);
                    let f = rig.force(g);
                    assert!(
                        (f - secant).abs() < 1e-9 * 880.0,
                        "{direction}: {f} N/m at {g} after {top}, secant {secant}"
                    );
                }
                assert!(
                    rig.force(-0.3).abs() < 1e-9,
                    "{direction}: compressed stitch"
                );
            }
        }
    }
}

#[test]
fn nothing_lost_before_the_peak_and_the_whole_curve_after_failure() {
    for direction in BOTH {
        for points in [stitch as fn(&str) -> Value, long_stitch] {
            let mut rig = Rig::new(direction, points);
            let peak = rig.points["angles"][1].as_f64().unwrap();
            rig.force(0.999 * peak);
            assert!(rig.lost().abs() < 1e-12, "{direction}: {}", rig.lost());
            rig.force(1.0);
            // Work of the whole curve, F cos g dg, by Simpson.
            let (n, h) = (100_000, 1e-5);
            let f = |g: f64| curve(&rig.points, g) * g.cos();
            let area: f64 = (0..n)
                .map(|i| i as f64 * h)
                .map(|a| h / 6.0 * (f(a) + 4.0 * f(a + 0.5 * h) + f(a + h)))
                .sum();
            assert!(
                (rig.lost() - area).abs() < 1e-4 * area,
                "{direction}: lost {} of {area} J/m2",
                rig.lost()
            );
        }
    }
}

#[test]
fn loss_never_shrinks_and_the_energy_held_is_never_negative_on_random_paths() {
    for direction in BOTH {
        for points in [stitch as fn(&str) -> Value, long_stitch] {
            for seed in 1..20 {
                let mut rig = Rig::new(direction, points);
                let mut r = Random(seed);
                let (mut g, mut lost, mut largest) = (0.0f64, 0.0, 0.0f64);
                for _ in 0..400 {
                    g = (g + 0.12 * r.next()).clamp(-1.0, 1.0);
                    let energy = {
                        rig.force(g);
                        rig.p.peek(&rig.m, metric(1.0, 1.0, rig.sign * g)).energy
                    };
                    let now = rig.lost();
                    assert!(
                        now > lost - 1e-10,
                        "{direction}: lost {now} after {lost} J/m2"
                    );
                    if g <= largest {
                        assert!(
                            (now - lost).abs() < 1e-10,
                            "lost without growth: {now} {lost}"
                        );
                    }
                    let held = energy - now - Rig::yarn_energy(g);
                    assert!(held > -1e-8, "{direction}: holds {held} J/m2 at {g}");
                    largest = largest.max(g);
                    lost = now;
                }
            }
        }
    }
}

#[test]
fn closed_path_at_constant_damage_does_no_work() {
    for form in FORMS {
        let shear = json!({"coefficients": NCF_YARN});
        let m = build(&sheet(form, &shear, Some(stitch("positive"))));
        let mut p = Point::new(&m);
        // Broken in part, then twice around below the largest angle.
        for i in 0..=600 {
            p.at(&m, metric(1.0, 1.0, 0.001 * i as f64));
        }
        let start = p.at(&m, metric(1.0, 1.0, 0.3));
        let (mut work, mut before) = (0.0, (start.stress[2], 0.3f64.sin()));
        let n = 4000;
        for i in 1..=n {
            let g: f64 = 0.3 + 0.25 * (2.0 * std::f64::consts::TAU * i as f64 / n as f64).sin();
            let a = p.at(&m, metric(1.0, 1.0, g));
            work += 0.5 * (a.stress[2] + before.0) * (g.sin() - before.1);
            before = (a.stress[2], g.sin());
        }
        let end = p.peek(&m, metric(1.0, 1.0, 0.3));
        assert!(work.abs() < 1e-6 * start.energy, "{form}: {work} J/m2");
        assert!(
            (end.energy - start.energy).abs() < 1e-4 * start.energy,
            "{form}"
        );
    }
}
