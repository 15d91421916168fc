//! Pure bending: a strip with one fibre family along it whose ends follow a circle.
//!
//! The strip may be sheared first. It then is rolled about an axis parallel to the other family, so that those
//! fibres stay straight and without twist (their direction is the same everywhere) and the moment is that of the
//! bent family alone. With X along the bent family, Y along the other and shear g between them, a place is
//! `X f + Y y`, `f = (cos g, sin g)`; on a cylinder about y the bent family becomes a helix, of normal curvature
//! k = k_c cos^2 g, where k_c is the cylinder's. `k` is what the test prescribes.
//!
//! The nodes of the ends lie on the folded strip: every column of elements stays flat and is turned by
//! delta = k h / cos g against its neighbour (h: element length along X), which is an isometry, so the fibres are
//! not strained by the polygon. The long edges are free, and driven too when the strip is sheared: the shear would
//! relax from a free edge.
//!
//! Moment per undeformed width: the generalised force dW/dk over the undeformed area, from the reactions
//! (and moments, for elements with rotations) of the driven nodes: `M = sum r . dx/dk / area`. For strips that
//! are not sheared also the moment of the reactions of one end, which knows nothing of energies.

mod shape;

use crate::distortion;
use crate::output::Output;
use crate::reference::{Curve, rising};
use crate::run::{Finished, Test, run, with_threads};
use crate::specimen::{Common, Specimen};
use crate::strip::{self, CLAMPED, Grid, axis_of_family, check_family, fibre_strain, rows};
use plyflow_fixed::FixedBits;
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::artifact::Style;
use plyflow_model::units::Dimension;
use plyflow_sdk::{Host, Step, StepError};
use serde::Deserialize;
use shape::{History, Roll, Shape};

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    /// Length of the strip along the bent family (m).
    length: f64,
    /// Width along the other family (m).
    width: f64,
    /// Fibre family that is bent: 1 or 2.
    family: u32,
    /// Shear of the strip before it is bent (rad).
    shear_angle: f64,
    /// Time for that (s).
    shear_time: f64,
    /// Curvatures (1/m) that are visited one after the other, from 0.
    path: Vec<f64>,
    /// Time from one curvature to the next (s).
    leg_time: f64,
    /// CSV with columns curvature, moment (per width).
    #[serde(default)]
    reference: Option<String>,
    /// Energy per undeformed area that the whole path should cost (J/m2).
    #[serde(default)]
    dissipation: Option<f64>,
}

struct PureBending {
    grid: Grid,
    driven: Vec<u32>,
    shape: Shape,
    history: History,
    family: u32,
    /// Whether the nodes of the element rotate.
    rotates: bool,
    /// Sums over the steps since the last sample: generalised force, end moment, curvature, number.
    sum: [f64; 4],
    /// Work per undeformed area so far (J/m2).
    work: f64,
    curvature: Vec<f64>,
    moment: Vec<f64>,
    end_moment: Vec<f64>,
    fibre_strain: f64,
    /// Largest difference of the elements' curvature to the prescribed one (1/m).
    curvature_error: f64,
}

impl PureBending {
    fn width(&self) -> f64 {
        self.grid.ys[self.grid.ys.len() - 1] - self.grid.ys[0]
    }

    fn area(&self) -> f64 {
        (self.grid.xs[self.grid.xs.len() - 1] - self.grid.xs[0]) * self.width()
    }

    /// Moments per width from the reactions of the last step: by virtual work, at the right end.
    fn moments(&self, specimen: &Specimen, shear: f64, curvature: f64) -> [f64; 2] {
        let small = 1e-3;
        let columns = self.grid.xs.len();
        let at = |k: f64| -> Vec<[f64; 3]> {
            (0..columns)
                .map(|i| self.shape.column(i, shear, k))
                .collect()
        };
        let (less, more, here) = (at(curvature - small), at(curvature + small), at(curvature));
        let no_moments = vec![[0.0; 3]; self.driven.len()];
        let moments = if specimen.model.spins().is_some() {
            specimen.model.reaction_moments()
        } else {
            &no_moments
        };
        let (mut work, mut end) = (0.0, 0.0);
        for ((n, r), m) in self
            .driven
            .iter()
            .zip(specimen.model.reactions())
            .zip(moments)
        {
            let (i, _) = self.grid.place(*n);
            let slope = |c: usize| (more[i][c] - less[i][c]) / (2.0 * small);
            // The turn of a column is about -y.
            work += r[0] * slope(0) + r[2] * slope(1) - m[1] * slope(2);
            if i + CLAMPED >= columns {
                let [x, z, _] = here[i];
                end += x * r[2] - z * r[0] - m[1];
            }
        }
        [work / self.area(), end / self.width()]
    }
}

impl Test for PureBending {
    fn duration(&self) -> f64 {
        self.history.duration()
    }

    fn stepped(&mut self, specimen: &Specimen) {
        // Reactions belong to the positions before the step.
        let t = specimen.model.time() - specimen.model.dt();
        let (shear, curvature) = self.history.at(t);
        let [work, end] = self.moments(specimen, shear, curvature);
        let dt = specimen.model.dt();
        self.work += work * 0.5 * (self.history.at(t + dt).1 - self.history.at(t - dt).1);
        for (s, v) in self.sum.iter_mut().zip([work, end, curvature, 1.0]) {
            *s += v;
        }
    }

    fn sample(&mut self, specimen: &Specimen, t: f64) {
        self.fibre_strain = self.fibre_strain.max(fibre_strain(specimen));
        let [work, end, curvature, n] = std::mem::take(&mut self.sum);
        // The first sample's sum may hold a single step; the strip is being sheared until `begin`.
        if n > 1.0 && t > self.history.begin() {
            self.curvature.push(curvature / n);
            self.moment.push(work / n);
            self.end_moment.push(end / n);
        }
        let (_, wanted) = self.history.at(specimen.model.time() - specimen.model.dt());
        let name = format!("curvature_{}", self.family);
        let patch = specimen.fields.iter().any(|f| f.name == name && f.patch);
        if t <= self.history.begin() {
            return;
        }
        let edge = specimen.mesh.on_boundary();
        for (k, value) in specimen.field(&name).iter().flatten().enumerate() {
            if !(patch && edge[k]) {
                self.curvature_error = self.curvature_error.max((value - wanted).abs());
            }
        }
    }

    fn phase(&self) -> &'static str {
        "bending"
    }
}

/// The step plugin `coupon-bending`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("pure_bending/manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        with_threads(host, || test(host, &p))
    }
}

/// Those of the clamped ends; of a sheared strip also those of its long edges.
fn driven_nodes(grid: &Grid, sheared: bool) -> Vec<u32> {
    let columns = grid.xs.len();
    (0..(columns * grid.ys.len()) as u32)
        .filter(|n| {
            let (i, j) = grid.place(*n);
            let long_edge = j == 0 || j + 1 == grid.ys.len();
            i < CLAMPED || i + CLAMPED >= columns || (sheared && long_edge)
        })
        .collect()
}

fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    check(p)?;
    let (x, y) = (
        ("curvature", Dimension::Curvature),
        ("moment", Dimension::Force),
    );
    let reference = Curve::given(p.reference.as_ref(), x, y)?;
    p.common.allow(p.length * p.width)?;
    let (h, half, grid) = grid(p);
    let columns = grid.xs.len();
    let driven = driven_nodes(&grid, p.shear_angle != 0.0);
    let axis = axis_of_family(p.family);
    let rotates = strip::rotates(host, &p.common)?;
    let mut mesh = grid.mesh();
    let clamp = |n: usize| {
        let (i, _) = grid.place(n as u32);
        i < CLAMPED || i + CLAMPED >= columns
    };
    distortion::scatter(&mut mesh, p.common.distortion, clamp)?;
    let mut specimen = Specimen::new(host, &p.common, mesh, axis, Pressed::No)?;
    let shape = Shape { h, half };
    let history = history(p);
    let roll = Roll {
        shape,
        history: history.clone(),
        nodes: (driven.iter())
            .map(|n| {
                let (i, j) = grid.place(*n);
                (i, grid.ys[j])
            })
            .collect(),
    };
    specimen.model.set_driven(driven.clone(), Box::new(roll));
    let mut test = PureBending {
        grid,
        driven,
        shape,
        history,
        family: p.family,
        rotates,
        sum: [0.0; 4],
        work: 0.0,
        curvature: Vec::new(),
        moment: Vec::new(),
        end_moment: Vec::new(),
        fibre_strain: 0.0,
        curvature_error: 0.0,
    };
    let outcome = run(host, &p.common, &mut specimen, &mut test)?;
    let done = Finished {
        p,
        specimen: &specimen,
        test: &test,
        outcome: &outcome,
    };
    write(host, &done, reference.as_ref())
}

/// What is done to the strip over time.
fn history(p: &Parameters) -> History {
    History {
        // Seen from family 2 along X, family 1 lies along -Y: the same shear leans the other way.
        shear: if p.family == 2 {
            -p.shear_angle
        } else {
            p.shear_angle
        },
        shear_time: if p.shear_angle != 0.0 {
            p.shear_time
        } else {
            0.0
        },
        curvatures: std::iter::once(0.0).chain(p.path.iter().copied()).collect(),
        leg: p.leg_time,
    }
}

/// The mesh, with the distance of its columns (m) and their number on either side of the middle.
fn grid(p: &Parameters) -> (f64, usize, Grid) {
    // An even number of elements along the strip: a column of nodes lies in its middle.
    let half = (0.5 * p.length / p.common.element_size)
        .round()
        .max((CLAMPED + 1) as f64) as usize;
    let h = 0.5 * p.length / half as f64;
    let grid = Grid {
        xs: (0..=2 * half)
            .map(|i| h * (i as f64 - half as f64))
            .collect(),
        ys: rows(p.width, p.common.element_size),
    };
    (h, half, grid)
}

fn check(p: &Parameters) -> Result<(), StepError> {
    check_family(p.family)?;
    if p.path.is_empty() {
        return Err("path: is empty; expected at least one curvature, e.g. [0.05 1/mm]".into());
    }
    let limit = 60f64.to_radians();
    if p.shear_angle.abs() > limit {
        let given = p.shear_angle.to_degrees();
        return Err(format!("shear_angle: given {given:.1} deg; expected -60 to 60 deg").into());
    }
    // The strip may close to a ring, not more.
    let most = 6.0 * p.shear_angle.fixed_cos() / p.length;
    if let Some(k) = p.path.iter().find(|k| k.abs() > most) {
        return Err(format!(
            "path: given {:.4} 1/mm; a strip of {:.1} mm at this shear is closed to a ring at {:.4} 1/mm. \
             Expected a smaller curvature or a shorter strip",
            1e-3 * k,
            1e3 * p.length,
            1e-3 * most
        )
        .into());
    }
    if p.path
        .iter()
        .any(|k| (k * p.common.element_size).abs() > 0.7)
    {
        return Err(
            "element_size: elements turn by more than 40 deg against each other at the largest \
                    curvature of the path; expected smaller elements"
                .into(),
        );
    }
    Ok(())
}

/// Error measures against the reference: relative root mean square, and the largest difference over the
/// reference's value where the curvature is at least a tenth of its largest.
fn errors(reference: &Curve, curvature: &[f64], moment: &[f64]) -> Option<[f64; 2]> {
    let (k, m) = rising(curvature.iter().copied().zip(moment.iter().copied()));
    let rms = reference.relative_rms(&k, &m)?;
    let most = k.iter().map(|k| k.abs()).fold(0.0, f64::max);
    let largest = k
        .iter()
        .zip(&m)
        .filter(|(k, _)| k.abs() >= 0.1 * most)
        .map(|(k, m)| (m / reference.at(*k) - 1.0).abs())
        .fold(0.0, f64::max);
    Some([rms, largest])
}

fn write(
    host: &Host,
    done: &Finished<'_, Parameters, PureBending>,
    reference: Option<&Curve>,
) -> Result<(), StepError> {
    let (p, test) = (done.p, done.test);
    let mut out = Output::new(host);
    let k = out.curve("run/curvature", "1/m", &test.curvature)?;
    let m = out.curve("run/moment", "N", &test.moment)?;
    let end = if p.shear_angle == 0.0 {
        Some(out.curve("run/end_moment", "N", &test.end_moment)?)
    } else {
        None
    };
    let law = match reference {
        Some(c) => Some((
            out.curve("reference/curvature", "1/m", &c.x)?,
            out.curve("reference/moment", "N", &c.y)?,
        )),
        None => None,
    };
    let axes = (("curvature", "1/mm"), ("moment per width", "N"));
    let known = law.as_ref().map(|(x, y)| (&**x, &**y));
    let end_moment = end.as_ref().map(|end| (&*k, &**end));
    out.plot("moment", "Pure bending: moment per width", axes.0, axes.1)
        .series("this run, virtual work", &k, &m, Style::Line)
        .also("this run, moment at an end", end_moment, Style::Dashed)
        .also("law that was put in", known, Style::Dashed)
        .done();
    if let Some(c) = reference {
        let missing =
            || "reference: fewer than two points of the run lie in its range of curvatures";
        let [rms, largest] = errors(c, &test.curvature, &test.moment).ok_or_else(missing)?;
        host.result("moment_error", rms, "1")?;
        host.result("moment_error_largest", largest, "1")?;
        if end.is_some() {
            let [rms, _] = errors(c, &test.curvature, &test.end_moment).ok_or_else(missing)?;
            host.result("end_moment_error", rms, "1")?;
        }
    }
    let most = |v: &[f64]| v.iter().map(|x| x.abs()).fold(0.0, f64::max);
    host.result("moment_largest", most(&test.moment), "N")?;
    let path = most(&p.path);
    host.result("curvature_error", test.curvature_error / path, "1")?;
    host.result("fibre_strain_largest", test.fibre_strain, "1")?;
    if let Some(expected) = p.dissipation {
        host.result("work_density", test.work, "N/m")?;
        host.result("dissipation_error", (test.work / expected - 1.0).abs(), "1")?;
    }
    distortion::tell(host, &done.specimen.mesh, p.common.distortion)?;
    out.about.family = Some(p.family);
    out.about.shear_angle = Some(p.shear_angle);
    out.about.rotations = Some(test.rotates);
    out.finish(&p.common, done.specimen, done.outcome)
}
