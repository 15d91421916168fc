//! Picture frame: a square specimen whose edges turn rigidly about hinged corners.
//!
//! With the frame's side L, the fibres along its sides and shear angle g (positive when the stitch between
//! the fibre directions is stretched), `x = X f1(g) + Y f2(g)`, `f1 = (cos g/2, sin g/2)`, `f2 = (sin g/2, cos
//! g/2)`. The cross-head pulls two opposite hinges, distance `d = 2 L cos((pi/2 - g)/2)`, with the force F of
//! equal power; a law of normalised shear force gives `F = 2 F_norm(g) L cos((pi/2 - g)/2)`
//! (numerics: dW/dg = F_norm cos g per undeformed area).

use crate::distortion;
use crate::output::Output;
use crate::reference::{Curve, largest_between, rising};
use crate::run::{Finished, SAMPLES, Test, run, with_threads};
use crate::specimen::{Common, Specimen};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::Drive;
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::artifact::Style;
use plyflow_model::units::Dimension;
use plyflow_sdk::{Host, Step, StepError};
use serde::Deserialize;

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    /// Side of the frame (m).
    side: f64,
    /// Length of the elements along x over that along y.
    #[serde(default = "square")]
    stretch: f64,
    /// Shear angles (rad) that are visited one after the other, from 0.
    path: Vec<f64>,
    /// Time from one angle to the next (s).
    leg_time: f64,
    /// Strain of the sides, reached in the first leg.
    #[serde(default)]
    fibre_strain: f64,
    /// CSV with columns shear_angle, normalised_force.
    #[serde(default)]
    reference: Option<String>,
    /// CSV with columns path_length, normalised_force.
    #[serde(default)]
    path_reference: Option<String>,
    /// Energy per undeformed area that the whole path should cost (J/m2).
    #[serde(default)]
    dissipation: Option<f64>,
}

fn square() -> f64 {
    1.0
}

/// The shear angle over time: smooth legs between the angles of the path.
#[derive(Debug, Clone)]
struct Path {
    angles: Vec<f64>,
    leg: f64,
    /// Of the sides, from the end of the first leg on.
    strain: f64,
}

impl Path {
    /// Length of the sides over that at the start.
    fn stretch(&self, t: f64) -> f64 {
        1.0 + self.strain * smooth_step(t, 0.0, self.leg)
    }

    fn angle(&self, t: f64) -> f64 {
        let mut g = 0.0;
        for (k, w) in self.angles.windows(2).enumerate() {
            g += (w[1] - w[0]) * smooth_step(t, self.leg * k as f64, self.leg);
        }
        g
    }

    /// Shear passed through so far (rad): the sum of the sizes of its changes.
    fn length(&self, t: f64) -> f64 {
        let mut l = 0.0;
        for (k, w) in self.angles.windows(2).enumerate() {
            l += (w[1] - w[0]).abs() * smooth_step(t, self.leg * k as f64, self.leg);
        }
        l
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
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let half = 0.5 * self.path.angle(t);
        let (c, s) = (half.fixed_cos(), half.fixed_sin());
        let stretch = self.path.stretch(t);
        let [x, y] = self.corners[k].map(|x| stretch * x);
        [x * c + y * s, x * s + y * c, 0.0]
    }
}

/// Sums over the steps since the last sample.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    /// Generalised force (N m).
    moment: f64,
    /// Shear angle (rad).
    angle: f64,
    /// Shear passed through (rad).
    length: f64,
    steps: f64,
}

struct PictureFrame {
    path: Path,
    side: f64,
    corners: Vec<[f64; 2]>,
    sum: Sum,
    /// Work of the frame on the specimen (J).
    work: f64,
    /// Samples: work so far (J), shear passed through (rad), shear angle (rad), force (N).
    work_history: Vec<f64>,
    length: Vec<f64>,
    angle: Vec<f64>,
    force: Vec<f64>,
    extremes: [f64; 2],
}

impl PictureFrame {
    /// Force of the cross-head (N) from the generalised force dW/dg.
    fn crosshead(&self, generalised: f64, angle: f64) -> f64 {
        generalised / (self.side * (0.25 * std::f64::consts::PI - 0.5 * angle).fixed_sin())
    }
}

impl Test for PictureFrame {
    fn duration(&self) -> f64 {
        self.path.duration()
    }

    fn stepped(&mut self, specimen: &Specimen) {
        // Reactions belong to the positions before the step.
        let (t, dt) = (
            specimen.model.time() - specimen.model.dt(),
            specimen.model.dt(),
        );
        let angle = self.path.angle(t);
        let (c, s) = ((0.5 * angle).fixed_cos(), (0.5 * angle).fixed_sin());
        let stretch = self.path.stretch(t);
        let mut moment = 0.0;
        for (r, corner) in specimen.model.reactions().iter().zip(&self.corners) {
            let [x, y] = corner.map(|x| stretch * x);
            moment += 0.5 * (r[0] * (y * c - x * s) + r[1] * (x * c - y * s));
        }
        self.work += moment * 0.5 * (self.path.angle(t + dt) - self.path.angle(t - dt));
        self.sum.moment += moment;
        self.sum.angle += angle;
        self.sum.length += self.path.length(t);
        self.sum.steps += 1.0;
    }

    fn sample(&mut self, specimen: &Specimen, _t: f64) {
        let sum = std::mem::take(&mut self.sum);
        if sum.steps > 1.0 {
            let angle = sum.angle / sum.steps;
            self.angle.push(angle);
            self.length.push(sum.length / sum.steps);
            self.force
                .push(self.crosshead(sum.moment / sum.steps, angle));
            self.work_history.push(self.work);
        }
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

/// The step plugin `coupon-picture-frame`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("picture_frame/manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        with_threads(host, || test(host, &p))
    }
}

fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    check(p)?;
    let force = ("normalised_force", Dimension::ForcePerLength);
    let angle = ("shear_angle", Dimension::Angle);
    let length = ("path_length", Dimension::Angle);
    let references = References {
        first_leg: Curve::given(p.reference.as_ref(), angle, force)?,
        whole_path: Curve::given(p.path_reference.as_ref(), length, force)?,
    };
    p.common.allow(p.side * p.side * p.stretch)?;
    let axis = |size: f64| even_axis(0.0, p.side, size);
    let size = p.common.element_size;
    let mut mesh = QuadMesh::grid(&axis(size), &axis(size / p.stretch));
    distortion::scatter(&mut mesh, p.common.distortion, |_| false)?;
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
        strain: p.fibre_strain,
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
        sum: Sum::default(),
        work: 0.0,
        work_history: Vec::new(),
        length: Vec::new(),
        angle: Vec::new(),
        force: Vec::new(),
        extremes: [0.0; 2],
    };
    let outcome = run(host, &p.common, &mut specimen, &mut test)?;
    let done = Finished {
        p,
        specimen: &specimen,
        test: &test,
        outcome: &outcome,
    };
    write(host, &done, &references)
}

/// What the run is compared with.
struct References {
    first_leg: Option<Curve>,
    whole_path: Option<Curve>,
}

fn check(p: &Parameters) -> Result<(), StepError> {
    let limit = 80f64.to_radians();
    if p.path.is_empty() {
        return Err("path: is empty; expected at least one shear angle, e.g. [40 deg]".into());
    }
    if p.path.len() > SAMPLES {
        return Err(format!(
            "path: given {} angles; expected no more than {SAMPLES}, as many as there are measurements in a run",
            p.path.len()
        )
        .into());
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
    done: &Finished<'_, Parameters, PictureFrame>,
    references: &References,
) -> Result<(), StepError> {
    let (p, test) = (done.p, done.test);
    let reference = references.first_leg.as_ref();
    let mut out = Output::new(host);
    let lever = |g: f64| 2.0 * p.side * (0.25 * std::f64::consts::PI - 0.5 * g).fixed_cos();
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
    let label = ("force", "N");
    let title = "Picture frame: cross-head force";
    let known = theory.as_ref().map(|(x, y, _)| (&**x, &**y));
    out.plot("force", title, axis, label)
        .series("this run", &angle, &force, Style::Line)
        .also("closed form of the input curve", known, Style::Dashed)
        .done();
    let label = ("normalised force", "N/m");
    let title = "Picture frame: normalised shear force";
    let known = theory.as_ref().map(|(x, _, n)| (&**x, &**n));
    out.plot("normalised", title, axis, label)
        .series("this run", &angle, &norm, Style::Line)
        .also("input curve", known, Style::Dashed)
        .done();
    if let Some(curve) = reference {
        let error = first_leg_error(p, test, &normalised, curve)?;
        host.result("force_error", error, "1")?;
    }
    write_path(host, &mut out, done, (&normalised, &norm), references)?;
    let sizes: Vec<f64> = test.force.iter().map(|f| f.abs()).collect();
    let peak = largest_between(&sizes);
    host.result("force_peak", peak, "N")?;
    host.result("shear_min", test.extremes[0], "rad")?;
    host.result("shear_max", test.extremes[1], "rad")?;
    distortion::tell(host, &done.specimen.mesh, p.common.distortion)?;
    out.about.side = Some(p.side);
    out.finish(&p.common, done.specimen, done.outcome)
}

/// Error of the normalised force on the first leg: on the way back a damaged stitch has another curve.
fn first_leg_error(
    p: &Parameters,
    test: &PictureFrame,
    normalised: &[f64],
    curve: &Curve,
) -> Result<f64, StepError> {
    let first = p.path[0];
    let points = test
        .angle
        .iter()
        .copied()
        .zip(normalised.iter().copied())
        .take(SAMPLES / p.path.len())
        .filter(|(g, _)| g * first > 0.0);
    let (x, y) = rising(points);
    curve.relative_rms(&x, &y).ok_or_else(|| {
        "reference: fewer than two measured points lie in its range of shear angles".into()
    })
}

/// What belongs to a path of several legs: its curve, its work, the largest force of each leg.
fn write_path(
    host: &Host,
    out: &mut Output<'_>,
    done: &Finished<'_, Parameters, PictureFrame>,
    (normalised, norm): (&[f64], &str),
    references: &References,
) -> Result<(), StepError> {
    let (p, test) = (done.p, done.test);
    let area = p.side * p.side;
    let density: Vec<f64> = test.work_history.iter().map(|w| w / area).collect();
    let length = out.curve("run/path_length", "rad", &test.length)?;
    let work = out.curve("run/work_density", "N/m", &density)?;
    let legs = p.path.len();
    for k in 0..legs {
        // What was measured in the time of the leg.
        let at = |k: usize| (k * SAMPLES / legs).min(normalised.len());
        let leg = &normalised[at(k)..at(k + 1)];
        let peak = leg.iter().map(|f| f.abs()).fold(0.0, f64::max);
        host.result(&format!("leg_force.{}", k + 1), peak, "N/m")?;
    }
    if legs > 1 {
        let axis = ("shear passed through", "deg");
        let mut theory = None;
        if let Some(curve) = &references.whole_path {
            let x = out.curve("reference/path_length", "rad", &curve.x)?;
            theory = Some((x, out.curve("reference/path_force", "N/m", &curve.y)?));
        }
        let known = theory.as_ref().map(|(x, y)| (&**x, &**y));
        let label = ("normalised force", "N/m");
        let title = "Picture frame: normalised force along the path";
        out.plot("path", title, axis, label)
            .series("this run", &length, norm, Style::Line)
            .also("closed form", known, Style::Dashed)
            .done();
        let title = "Picture frame: work per area along the path";
        out.plot("work", title, axis, ("work", "N/m"))
            .series("this run", &length, &work, Style::Line)
            .done();
    }
    if let Some(curve) = &references.whole_path {
        let error = curve
            .relative_rms(&test.length, normalised)
            .ok_or_else(|| {
                "path_reference: fewer than two points of the run lie in its range".to_owned()
            })?;
        host.result("path_error", error, "1")?;
    }
    let density = test.work / area;
    host.result("work_density", density, "N/m")?;
    if let Some(expected) = p.dissipation {
        host.result("dissipation_error", (density / expected - 1.0).abs(), "1")?;
    }
    Ok(())
}
