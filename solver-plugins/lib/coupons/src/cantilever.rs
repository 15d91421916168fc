//! Cantilever under gravity: a strip with one fibre family along it stands out of a clamp and hangs down.
//!
//! The static answer is found by time integration: the weight rises smoothly, mass-proportional damping near the
//! critical one of the lowest mode (2 omega_1) lets the strip come to rest. The tip's way in the last tenth
//! of the time is reported, so that nobody takes a swinging strip for a resting one.
//!
//! Places are written with the clamp line at x = 0 (see [`crate::strip`]) and z negative downwards, whichever
//! face looks up.

use crate::drives::Held;
use crate::output::Output;
use crate::reference::Curve;
use crate::run::{Outcome, Test, run, with_threads};
use crate::specimen::{Common, Specimen};
use crate::strip::{
    self, CLAMPED, Grid, axis_of_family, check_family, fibre_strain, largest, rows,
};
use plyflow_fixed::FixedBits;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::artifact::Style;
use plyflow_model::units::Dimension;
use plyflow_sdk::{Host, Step, StepError};
use serde::Deserialize;

/// Which face of the ply looks up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Face {
    /// The one with the ply's normal.
    Top,
    /// The other.
    Bottom,
}

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    /// Length outside of the clamp (m).
    overhang: f64,
    /// Width (m).
    width: f64,
    /// Fibre family along the strip: 1 or 2.
    family: u32,
    /// Face that looks up.
    upper_face: Face,
    /// Acceleration of free fall (m/s2).
    gravity: f64,
    /// Time in which the weight rises (s).
    ramp_time: f64,
    /// Whole time (s).
    duration: f64,
    /// CSV with columns x, z of the profile that is expected.
    #[serde(default)]
    reference: Option<String>,
    /// CSV with columns x, z of another profile, e.g. of another law.
    #[serde(default)]
    compared_with: Option<String>,
}

struct Cantilever {
    duration: f64,
    ramp: f64,
    gravity: f64,
    /// +1 when the normal looks up.
    up: f64,
    family: u32,
    tip: u32,
    time: Vec<f64>,
    /// Height of the tip (m), negative downwards.
    height: Vec<f64>,
    /// Upward force of the clamp on the strip, mean since the last sample (N), and steps in it.
    sum: (f64, f64),
    support: Vec<f64>,
    fibre_strain: f64,
    curvature: f64,
}

impl Test for Cantilever {
    fn duration(&self) -> f64 {
        self.duration
    }

    fn apply(&mut self, specimen: &mut Specimen, t: f64) {
        let g = self.gravity * smooth_step(t, 0.0, self.ramp);
        specimen
            .model
            .set_body_acceleration([0.0, 0.0, -self.up * g]);
    }

    fn stepped(&mut self, specimen: &Specimen) {
        let r: f64 = specimen.model.reactions().iter().map(|r| r[2]).sum();
        self.sum = (self.sum.0 + self.up * r, self.sum.1 + 1.0);
    }

    fn sample(&mut self, specimen: &Specimen, t: f64) {
        self.time.push(t);
        self.height
            .push(self.up * specimen.model.x()[self.tip as usize][2]);
        self.support.push(self.sum.0 / self.sum.1.max(1.0));
        self.sum = (0.0, 0.0);
        self.fibre_strain = self.fibre_strain.max(fibre_strain(specimen));
        self.curvature = largest(specimen, &format!("curvature_{}", self.family));
    }

    fn phase(&self) -> &'static str {
        "hanging"
    }
}

/// The step plugin `coupon-cantilever`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("cantilever/manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        with_threads(host, || test(host, &p))
    }
}

/// Columns and rows: the clamped columns, the clamp line at x = 0, the tip at the overhang.
fn grid(p: &Parameters, rotates: bool) -> Grid {
    let size = p.common.element_size;
    let (least, last) = (3.0, (CLAMPED - 1) as f64);
    let (elements, line) = if rotates {
        ((p.overhang / size).round().max(least), last)
    } else {
        (
            (p.overhang / size - 0.5).round().max(least) + 0.5,
            last - 0.5,
        )
    };
    let h = p.overhang / elements;
    let columns = (elements + line).round() as usize;
    Grid {
        xs: (0..=columns).map(|i| h * (i as f64 - line)).collect(),
        ys: rows(p.width, size),
    }
}

fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    check_family(p.family)?;
    p.common.allow(p.overhang * p.width)?;
    if p.duration <= p.ramp_time {
        return Err(format!(
            "duration: given {:.3} s, the weight rises for {:.3} s; expected time to come to rest after it",
            p.duration, p.ramp_time
        )
        .into());
    }
    let (x, z) = (("x", Dimension::Length), ("z", Dimension::Length));
    let reference = Curve::given(p.reference.as_ref(), x, z)?;
    let other = Curve::given(p.compared_with.as_ref(), x, z)?;
    let grid = grid(p, strip::rotates(host, &p.common)?);
    let axis = axis_of_family(p.family);
    let mut specimen = Specimen::new(host, &p.common, grid.mesh(), axis, Pressed::No)?;
    let driven = grid.columns(0..CLAMPED);
    let places = driven
        .iter()
        .map(|n| specimen.mesh.points[*n as usize])
        .collect();
    specimen.model.set_driven(driven, Box::new(Held { places }));
    let middle = grid.ys.len() / 2;
    let mut test = Cantilever {
        duration: p.duration,
        ramp: p.ramp_time,
        gravity: p.gravity,
        up: if p.upper_face == Face::Top { 1.0 } else { -1.0 },
        family: p.family,
        tip: grid.node(grid.xs.len() - 1, middle),
        time: Vec::new(),
        height: Vec::new(),
        sum: (0.0, 0.0),
        support: Vec::new(),
        fibre_strain: 0.0,
        curvature: 0.0,
    };
    let outcome = run(host, &p.common, &mut specimen, &mut test)?;
    // From the clamp line outwards; an element without rotations has no node there.
    let mut shape = vec![[0.0, 0.0]];
    for i in (0..grid.xs.len()).filter(|i| grid.xs[*i] > 0.0) {
        let x = specimen.model.x()[grid.node(i, middle) as usize];
        shape.push([x[0], test.up * x[2]]);
    }
    let done = Done {
        p,
        test: &test,
        shape: &shape,
        reference,
        other,
    };
    done.write(host, &specimen, &outcome)
}

/// A finished test.
struct Done<'a> {
    p: &'a Parameters,
    test: &'a Cantilever,
    /// Middle line from the clamp outwards: x, z (m).
    shape: &'a [[f64; 2]],
    reference: Option<Curve>,
    other: Option<Curve>,
}

impl Done<'_> {
    fn write(&self, host: &Host, specimen: &Specimen, outcome: &Outcome) -> Result<(), StepError> {
        let mut out = Output::new(host);
        let (x, z): (Vec<f64>, Vec<f64>) = self.shape.iter().map(|p| (p[0], p[1])).unzip();
        host.write_f64("profile/x", &[x.len()], "m", &x)?;
        host.write_f64("profile/z", &[z.len()], "m", &z)?;
        let time = out.curve("run/time", "s", &self.test.time)?;
        let height = out.curve("run/tip_height", "m", &self.test.height)?;
        let mut lines = vec![(
            "this run",
            "profile/x".to_owned(),
            "profile/z".to_owned(),
            Style::Line,
        )];
        for (name, label, curve) in [
            (
                "reference",
                "heavy elastica (ODE) or measured",
                &self.reference,
            ),
            ("compared_with", "compared with", &self.other),
        ] {
            if let Some(c) = curve {
                let x = out.curve(&format!("{name}/x"), "m", &c.x)?;
                let z = out.curve(&format!("{name}/z"), "m", &c.y)?;
                lines.push((label, x, z, Style::Dashed));
            }
        }
        let axes = (("distance from the clamp", "mm"), ("height", "mm"));
        let mut plot = out.plot(
            "profile",
            "Cantilever: profile of the middle line",
            axes.0,
            axes.1,
        );
        for (label, x, z, style) in &lines {
            plot = plot.series(label, x, z, *style);
        }
        plot.done();
        out.plot(
            "tip",
            "Cantilever: height of the tip over time",
            ("time", "s"),
            ("height", "mm"),
        )
        .series("this run", &time, &height, Style::Line)
        .done();
        self.results(host, specimen)?;
        // The strip falls: its kinetic energy on the way says nothing of the rest that it comes to.
        let rest = outcome
            .ledger
            .last()
            .map_or(0.0, |l| l.kinetic / l.internal());
        host.result("kinetic_ratio_at_end", rest, "1")?;
        out.about.overhang = Some(self.p.overhang);
        out.about.family = Some(self.p.family);
        out.finish(&self.p.common, specimen, outcome)
    }

    fn results(&self, host: &Host, specimen: &Specimen) -> Result<(), StepError> {
        let [x, z] = self.shape[self.shape.len() - 1];
        host.result("tip_x", x, "m")?;
        host.result("tip_height", z, "m")?;
        host.result("secant_angle", (-z).fixed_atan2(x), "rad")?;
        if let Some(c) = &self.reference {
            let last = c.x.len() - 1;
            host.result("tip_error", (z - c.y[last]).abs(), "m")?;
            host.result("tip_x_error", (x - c.x[last]).abs(), "m")?;
            let inside: Vec<f64> = (self.shape.iter())
                .filter(|p| p[0] <= c.x[last])
                .map(|p| (p[1] - c.at(p[0])).powi(2))
                .collect();
            let mean = inside.iter().sum::<f64>() / inside.len() as f64;
            host.result("profile_error", mean.sqrt(), "m")?;
        }
        if let Some(c) = &self.other {
            let above = z - c.y[c.y.len() - 1];
            host.result("tip_above", above, "m")?;
            host.result("tip_above_share", above / c.y[c.y.len() - 1].abs(), "1")?;
        }
        let t = self.test;
        let late = t
            .time
            .iter()
            .position(|s| *s >= 0.9 * t.duration)
            .unwrap_or(0);
        let range = |f: fn(f64, f64) -> f64, start| t.height[late..].iter().copied().fold(start, f);
        let way = range(f64::max, f64::NEG_INFINITY) - range(f64::min, f64::INFINITY);
        host.result("tip_way_at_end", way, "m")?;
        let weight: f64 = specimen.model.own_masses().iter().sum::<f64>() * self.p.gravity;
        let force = t.support[t.support.len() - 1];
        host.result("support_share", force / weight, "1")?;
        host.result("curvature_largest", t.curvature, "1/m")?;
        host.result("fibre_strain_largest", t.fibre_strain, "1")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parameters(size: f64) -> Parameters {
        serde_json::from_value(serde_json::json!({
            "material": {"plyflow_material": 1, "name": "m", "plugin": "p", "thickness": "0.4 mm", "areal_mass": "440 g/m2", "with": {}},
            "element": {"plugin": "rf4"}, "element_size": size, "step_safety": 0.8, "damping": 1.0, "frames": 1,
            "kinetic_bound": 0.05, "overhang": 0.21, "width": 0.03, "family": 1, "upper_face": "top",
            "gravity": 9.81, "ramp_time": 0.1, "duration": 1.0
        }))
        .unwrap()
    }

    #[test]
    fn the_overhang_is_exact_and_the_clamp_line_is_where_the_element_holds_the_slope() {
        for size in [0.002, 0.005, 0.0071, 0.03] {
            let with = grid(&parameters(size), true);
            assert_eq!(with.xs[CLAMPED - 1], 0.0);
            assert!((with.xs.last().unwrap() - 0.21).abs() < 1e-15);
            let without = grid(&parameters(size), false);
            assert!((without.xs[CLAMPED - 1] + without.xs[CLAMPED - 2]).abs() < 1e-15);
            assert!((without.xs.last().unwrap() - 0.21).abs() < 1e-15);
        }
    }
}
