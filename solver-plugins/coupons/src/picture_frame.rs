//! Picture frame: a square specimen whose edges turn rigidly about hinged corners.
//!
//! With the frame's side L, the fibres along its sides and shear angle g (positive when the stitch between
//! the fibre directions is stretched), `x = X f1(g) + Y f2(g)`, `f1 = (cos g/2, sin g/2)`, `f2 = (sin g/2, cos
//! g/2)`. The cross-head pulls two opposite hinges, distance `d = 2 L cos((pi/2 - g)/2)`, with the force F of
//! equal power; a law of normalised shear force gives `F = 2 F_norm(g) L cos((pi/2 - g)/2)`
//! (numerics: dW/dg = F_norm cos g per undeformed area).

use crate::output::{Output, Style};
use crate::reference::Curve;
use crate::run::{Outcome, Test, run, with_threads};
use crate::specimen::{Common, Specimen};
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::Drive;
use plyflow_mechanics::sheet::Pressed;
use plyflow_mechanics::vec3::V;
use plyflow_model::units::Dimension;
use plyflow_sdk::{Host, StepError};
use serde::Deserialize;

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    /// Side of the frame (m).
    side: f64,
    /// Shear angles (rad) that are visited one after the other, from 0.
    path: Vec<f64>,
    /// Time from one angle to the next (s).
    leg_time: f64,
    /// CSV with columns shear_angle, normalised_force.
    #[serde(default)]
    reference: Option<String>,
}

/// The shear angle over time: smooth legs between the angles of the path.
#[derive(Debug, Clone)]
struct Path {
    angles: Vec<f64>,
    leg: f64,
}

impl Path {
    fn angle(&self, t: f64) -> f64 {
        let mut g = 0.0;
        for (k, w) in self.angles.windows(2).enumerate() {
            g += (w[1] - w[0]) * smooth_step(t, self.leg * k as f64, self.leg);
        }
        g
    }

    fn duration(&self) -> f64 {
        self.leg * (self.angles.len() - 1) as f64
    }
}

struct Frame {
    path: Path,
    /// Material coordinates of the driven nodes (m).
    corners: Vec<[f64; 2]>,
}

impl Drive for Frame {
    fn position(&self, k: usize, t: f64) -> V {
        let half = 0.5 * self.path.angle(t);
        let (c, s) = (half.cos(), half.sin());
        let [x, y] = self.corners[k];
        [x * c + y * s, x * s + y * c, 0.0]
    }
}

struct PictureFrame {
    path: Path,
    side: f64,
    corners: Vec<[f64; 2]>,
    /// Sum of the generalised force over the steps since the last sample (N m), of their angles, number.
    sum: (f64, f64, f64),
    angle: Vec<f64>,
    force: Vec<f64>,
    extremes: [f64; 2],
}

impl PictureFrame {
    /// Force of the cross-head (N) from the generalised force dW/dg.
    fn crosshead(&self, generalised: f64, angle: f64) -> f64 {
        generalised / (self.side * (0.25 * std::f64::consts::PI - 0.5 * angle).sin())
    }
}

impl Test for PictureFrame {
    fn duration(&self) -> f64 {
        self.path.duration()
    }

    fn stepped(&mut self, specimen: &Specimen) {
        // Reactions belong to the positions before the step.
        let angle = self.path.angle(specimen.model.time - specimen.model.dt);
        let (c, s) = ((0.5 * angle).cos(), (0.5 * angle).sin());
        let mut work = 0.0;
        for (r, [x, y]) in specimen.model.reactions().iter().zip(&self.corners) {
            work += 0.5 * (r[0] * (y * c - x * s) + r[1] * (x * c - y * s));
        }
        self.sum = (self.sum.0 + work, self.sum.1 + angle, self.sum.2 + 1.0);
    }

    fn sample(&mut self, specimen: &Specimen, _t: f64) {
        if self.sum.2 > 1.0 {
            let angle = self.sum.1 / self.sum.2;
            self.angle.push(angle);
            self.force
                .push(self.crosshead(self.sum.0 / self.sum.2, angle));
        }
        self.sum = (0.0, 0.0, 0.0);
        if let Some(shear) = specimen.field("shear_angle") {
            let fold = |f: fn(f64, f64) -> f64, a: f64| shear.iter().copied().fold(a, f);
            self.extremes = [
                fold(f64::min, f64::INFINITY),
                fold(f64::max, f64::NEG_INFINITY),
            ];
        }
    }

    fn phase(&self) -> &'static str {
        "shearing"
    }
}

/// Runs the step.
///
/// # Errors
/// Whatever stops it, as a text for the user.
pub fn main(host: &Host) -> Result<(), StepError> {
    let p: Parameters = host.parameters()?;
    with_threads(host, || test(host, &p))
}

fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    check(p)?;
    let reference = match &p.reference {
        Some(path) => Some(Curve::read(
            path,
            ("shear_angle", Dimension::Angle),
            ("normalised_force", Dimension::ForcePerLength),
        )?),
        None => None,
    };
    let axis = even_axis(0.0, p.side, p.common.element_size);
    let mesh = QuadMesh::grid(&axis, &axis);
    let driven: Vec<u32> = (mesh.on_boundary().iter().enumerate())
        .filter(|(_, on)| **on)
        .map(|(n, _)| n as u32)
        .collect();
    let corners: Vec<[f64; 2]> = driven
        .iter()
        .map(|n| [mesh.points[*n as usize][0], mesh.points[*n as usize][1]])
        .collect();
    let mut specimen = Specimen::new(host, &p.common, mesh, [1.0, 0.0, 0.0], Pressed::No)?;
    let path = Path {
        angles: std::iter::once(0.0).chain(p.path.iter().copied()).collect(),
        leg: p.leg_time,
    };
    let frame = Frame {
        path: path.clone(),
        corners: corners.clone(),
    };
    specimen.model.set_driven(driven, Box::new(frame));
    let mut test = PictureFrame {
        path,
        side: p.side,
        corners,
        sum: (0.0, 0.0, 0.0),
        angle: Vec::new(),
        force: Vec::new(),
        extremes: [0.0; 2],
    };
    let outcome = run(host, &p.common, &mut specimen, &mut test)?;
    write(host, p, &specimen, &test, reference.as_ref(), &outcome)
}

fn check(p: &Parameters) -> Result<(), StepError> {
    let limit = 80f64.to_radians();
    if p.path.is_empty() {
        return Err("path: is empty; expected at least one shear angle, e.g. [40 deg]".into());
    }
    if let Some(g) = p.path.iter().find(|g| g.abs() > limit) {
        return Err(format!(
            "path: given {:.1} deg; expected -80 to 80 deg",
            g.to_degrees()
        )
        .into());
    }
    Ok(())
}

fn write(
    host: &Host,
    p: &Parameters,
    specimen: &Specimen,
    test: &PictureFrame,
    reference: Option<&Curve>,
    outcome: &Outcome,
) -> Result<(), StepError> {
    let mut out = Output::new(host);
    let lever = |g: f64| 2.0 * p.side * (0.25 * std::f64::consts::PI - 0.5 * g).cos();
    let normalised: Vec<f64> = test
        .angle
        .iter()
        .zip(&test.force)
        .map(|(g, f)| f / lever(*g))
        .collect();
    let angle = out.curve("run/shear_angle", "rad", &test.angle)?;
    let force = out.curve("run/crosshead_force", "N", &test.force)?;
    let norm = out.curve("run/normalised_force", "N/m", &normalised)?;
    let mut theory = None;
    if let Some(curve) = reference {
        let forces: Vec<f64> = curve
            .x
            .iter()
            .zip(&curve.y)
            .map(|(g, f)| f * lever(*g))
            .collect();
        let x = out.curve("reference/shear_angle", "rad", &curve.x)?;
        let y = out.curve("reference/crosshead_force", "N", &forces)?;
        let n = out.curve("reference/normalised_force", "N/m", &curve.y)?;
        theory = Some((x, y, n));
    }
    let axis = ("shear angle", "deg");
    let mut plot = out.plot(
        "force",
        "Picture frame: cross-head force",
        axis,
        ("force", "N"),
    );
    plot = plot.series("this run", &angle, &force, Style::Line);
    if let Some((x, y, _)) = &theory {
        plot = plot.series("closed form of the input curve", x, y, Style::Dashed);
    }
    plot.done();
    let label = ("normalised force", "N/m");
    let mut plot = out.plot(
        "normalised",
        "Picture frame: normalised shear force",
        axis,
        label,
    );
    plot = plot.series("this run", &angle, &norm, Style::Line);
    if let Some((x, _, n)) = &theory {
        plot = plot.series("input curve", x, n, Style::Dashed);
    }
    plot.done();
    if let Some(curve) = reference {
        // The first leg: on the way back a damaged stitch has another curve.
        let first = p.path[0];
        let mut points: Vec<(f64, f64)> = test
            .angle
            .iter()
            .copied()
            .zip(normalised.iter().copied())
            .take(crate::run::SAMPLES / p.path.len())
            .filter(|(g, _)| g * first > 0.0)
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        let error = curve.relative_rms(&x, &y).ok_or_else(|| {
            "reference: fewer than two measured points lie in its range of shear angles".to_owned()
        })?;
        host.result("force_error", error, "1")?;
    }
    let peak = test.force.iter().map(|f| f.abs()).fold(0.0, f64::max);
    host.result("force_peak", peak, "N")?;
    host.result("shear_min", test.extremes[0], "rad")?;
    host.result("shear_max", test.extremes[1], "rad")?;
    out.attribute("side", p.side.into());
    out.finish(&p.common, specimen, outcome)
}
