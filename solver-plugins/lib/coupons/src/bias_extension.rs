//! Bias extension with wrinkling: a rectangular strip with its fibres at +-45 degrees is pulled along its length.
//!
//! The stitch direction e1 + e2 lies along the pull, so that the shear is positive. The moving end starts and stops
//! smoothly and has a constant speed between. The specimen is not flat: it has a random out-of-plane shape
//! ([`imperfection`]), the same for every mesh and for every run with the same seed. The pull flattens that shape long
//! before a wrinkle starts, so a dead load along z in the same shape can hold it up (`transverse_load`).
//!
//! **Wrinkles** are measured from the out-of-plane places of the nodes: `top` = max z, `bottom` = -min z,
//! `half_height` = (max z - min z) / 2, each over the whole specimen; `section` = max |z| over the central
//! cross-section (the two columns of elements next to the middle). The wrinkle's amplitude is `section`, as in the
//! thesis (section 3.4.3: the amplitude at the central cross-section exceeds 1 mm); its onset is where that first
//! exceeds the onset amplitude.
//!
//! **Shear angles** at point A (the centre) and at point B: mean of the elements whose centres lie within the gauge
//! radius in the undeformed specimen. Theory is the pin-jointed net, `g = pi/2 - 2 acos((D + d) / (sqrt2 D))`, D =
//! length - width.

mod imperfection;
mod write;

use crate::reference::Curve;
use crate::run::{Test, run, with_threads};
use crate::specimen::{Common, Specimen, element};
use crate::strip::{CLAMPED, Grid, check_bends, fibre_strain, rows};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::V;
use plyflow_mechanics::history::{constant_speed_way, linear};
use plyflow_mechanics::model::{Drive, NodalLoad};
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::units::Dimension;
use plyflow_sdk::{Host, Step, StepError};
use serde::Deserialize;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, SQRT_2};

/// Place of point B in the central square zone: from its centre (0) to its corners (1).
#[derive(Debug, Clone, Copy, Deserialize)]
struct PointB {
    /// Along the pull.
    along: f64,
    /// Across it.
    across: f64,
}

/// A range of displacements (m).
#[derive(Debug, Clone, Copy, Deserialize)]
struct Range {
    from: f64,
    to: f64,
}

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    /// Length between the clamps (m).
    length: f64,
    /// Width (m).
    width: f64,
    /// Way of the moving clamp (m).
    displacement: f64,
    /// Time for it (s).
    pull_time: f64,
    /// Share of the time in which it starts, and in which it stops.
    ramp_share: f64,
    /// Largest out-of-plane place of the undeformed specimen (m).
    imperfection: f64,
    /// Largest of the lateral load in the same shape (Pa).
    transverse_load: f64,
    /// Which random shape.
    seed: u64,
    /// Amplitude at which a wrinkle counts (m).
    onset_amplitude: f64,
    /// Point B.
    point_b: PointB,
    /// Radius of the gauges (m).
    gauge_radius: f64,
    /// Shear angle at which the stitches begin to fail (rad).
    #[serde(default)]
    failure_angle: Option<f64>,
    /// Displacements over which the amplitude is to stand.
    #[serde(default)]
    plateau: Option<Range>,
    /// Displacement at which the amplitude is compared with its peak.
    #[serde(default)]
    late: Option<f64>,
    /// Way after the onset at which heights are told.
    after_onset: f64,
    /// CSV with columns displacement, amplitude.
    #[serde(default)]
    measured_amplitude: Option<String>,
    /// CSV with columns displacement, shear_angle.
    #[serde(default)]
    measured_shear: Option<String>,
}

/// Way of the moving clamp: smooth start, constant speed, smooth stop.
#[derive(Debug, Clone, Copy)]
struct Pull {
    way: f64,
    time: f64,
    ramp: f64,
}

impl Pull {
    /// Displacement (m) at time t (s).
    fn at(&self, t: f64) -> f64 {
        constant_speed_way(t, self.way, self.time, self.ramp)
    }
}

struct Clamps {
    pull: Pull,
    /// Place at the start, and whether the clamp moves.
    nodes: Vec<(V, bool)>,
}

impl Drive for Clamps {
    fn position(&self, k: usize, t: f64) -> V {
        let (mut x, moves) = self.nodes[k];
        if moves {
            x[0] += self.pull.at(t);
        }
        x
    }

    fn spin(&self, _k: usize, _t: f64) -> Option<V> {
        Some([0.0; 3])
    }
}

/// Histories, one value per sample.
#[derive(Debug, Default)]
struct Histories {
    displacement: Vec<f64>,
    force: Vec<f64>,
    shear_a: Vec<f64>,
    shear_b: Vec<f64>,
    shear_largest: Vec<f64>,
    top: Vec<f64>,
    bottom: Vec<f64>,
    section: Vec<f64>,
    fibre_strain: f64,
}

impl Histories {
    fn half_height(&self) -> Vec<f64> {
        self.top
            .iter()
            .zip(&self.bottom)
            .map(|(t, b)| 0.5 * (t + b))
            .collect()
    }

    /// Value of a history at a displacement.
    fn at(&self, values: &[f64], displacement: f64) -> f64 {
        linear(&self.displacement, values, displacement)
    }

    /// Displacement at which a history first exceeds `level`, linear between the samples.
    fn first_above(&self, values: &[f64], level: f64) -> Option<f64> {
        let i = values.iter().position(|v| *v > level)?;
        if i == 0 {
            return Some(self.displacement[0]);
        }
        let share = (level - values[i - 1]) / (values[i] - values[i - 1]);
        Some(self.displacement[i - 1] + share * (self.displacement[i] - self.displacement[i - 1]))
    }
}

struct BiasExtension {
    pull: Pull,
    /// Driven nodes (by their number in the drive) of the moving clamp.
    moving: Vec<usize>,
    gauge_a: Vec<u32>,
    gauge_b: Vec<u32>,
    /// Nodes of the central cross-section.
    section: Vec<u32>,
    sum: (f64, f64),
    histories: Histories,
}

impl Test for BiasExtension {
    fn duration(&self) -> f64 {
        self.pull.time
    }

    fn stepped(&mut self, specimen: &Specimen) {
        let reactions = specimen.model.reactions();
        let force: f64 = self.moving.iter().map(|k| reactions[*k][0]).sum();
        self.sum = (self.sum.0 + force, self.sum.1 + 1.0);
    }

    fn sample(&mut self, specimen: &Specimen, t: f64) {
        let h = &mut self.histories;
        let z = |n: u32| specimen.model.x()[n as usize][2];
        let all = || specimen.model.x().iter().map(|x| x[2]);
        h.displacement.push(self.pull.at(t));
        h.force.push(self.sum.0 / self.sum.1.max(1.0));
        self.sum = (0.0, 0.0);
        h.top.push(all().fold(f64::NEG_INFINITY, f64::max));
        h.bottom.push(-all().fold(f64::INFINITY, f64::min));
        h.section
            .push(self.section.iter().map(|n| z(*n).abs()).fold(0.0, f64::max));
        let shear = specimen.field("shear_angle").unwrap_or_default();
        let mean = |cells: &[u32]| {
            let sum: f64 = cells.iter().filter_map(|c| shear.get(*c as usize)).sum();
            sum / cells.len() as f64
        };
        h.shear_a.push(mean(&self.gauge_a));
        h.shear_b.push(mean(&self.gauge_b));
        h.shear_largest
            .push(shear.iter().copied().fold(0.0, f64::max));
        h.fibre_strain = h.fibre_strain.max(fibre_strain(specimen));
    }

    fn phase(&self) -> &'static str {
        "pulling"
    }
}

/// Shear angle (rad) of the pin-jointed net in the central zone; 90 degrees when it is stretched out.
fn net_angle(length: f64, width: f64, displacement: f64) -> f64 {
    let free = length - width;
    FRAC_PI_2
        - 2.0
            * ((free + displacement) / (SQRT_2 * free))
                .min(1.0)
                .fixed_acos()
}

/// The step plugin `coupon-bias-extension`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("bias_extension/manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        with_threads(host, || test(host, &p))
    }
}

/// Columns with the clamps outside of the length, and rows.
fn grid(p: &Parameters) -> Grid {
    let elements = (p.length / p.common.element_size).round().max(4.0);
    let h = p.length / elements;
    let inside = CLAMPED - 1;
    let columns = elements as usize + 2 * inside;
    Grid {
        xs: (0..=columns)
            .map(|i| h * (i as f64 - inside as f64))
            .collect(),
        ys: rows(p.width, p.common.element_size),
    }
}

fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    p.common.allow(p.length * p.width)?;
    check(p)?;
    let curve = |path: &Option<String>, y| {
        path.as_ref()
            .map(|f| Curve::read(f, ("displacement", Dimension::Length), y))
            .transpose()
    };
    let amplitude = curve(&p.measured_amplitude, ("amplitude", Dimension::Length))?;
    let shear = curve(&p.measured_shear, ("shear_angle", Dimension::Angle))?;
    let grid = grid(p);
    let mut mesh = grid.mesh();
    let shape = imperfection::Shape::new(p.seed, p.length, p.width);
    for x in &mut mesh.points {
        x[2] = p.imperfection * shape.at(x[0], x[1]);
    }
    let axis = [FRAC_1_SQRT_2, -FRAC_1_SQRT_2, 0.0];
    check_bends(&element(host, &p.common)?.0, &p.common)?;
    let mut specimen = Specimen::new(host, &p.common, mesh, axis, Pressed::No)?;
    if p.transverse_load > 0.0 {
        let loads = transverse_loads(p, &grid, &shape, &specimen);
        specimen.model.set_loads(loads);
    }
    let columns = grid.xs.len();
    let mut driven = grid.columns(0..CLAMPED);
    driven.extend(grid.columns(columns - CLAMPED..columns));
    let pull = Pull {
        way: p.displacement,
        time: p.pull_time,
        ramp: p.ramp_share * p.pull_time,
    };
    let nodes: Vec<(V, bool)> = (driven.iter())
        .map(|n| {
            (
                specimen.mesh.points[*n as usize],
                grid.place(*n).0 >= CLAMPED,
            )
        })
        .collect();
    let moving = (0..nodes.len()).filter(|k| nodes[*k].1).collect();
    specimen
        .model
        .set_driven(driven, Box::new(Clamps { pull, nodes }));
    let half_diagonal = [0.5 * (p.length - p.width), 0.5 * p.width];
    let middle = 0.5 * p.length;
    let b = [
        middle + p.point_b.along * half_diagonal[0],
        p.point_b.across * half_diagonal[1],
    ];
    let h = grid.xs[1] - grid.xs[0];
    let mut test = BiasExtension {
        pull,
        moving,
        gauge_a: gauge(&specimen, [middle, 0.0], p.gauge_radius),
        gauge_b: gauge(&specimen, b, p.gauge_radius),
        section: (0..specimen.mesh.points.len() as u32)
            .filter(|n| (specimen.mesh.points[*n as usize][0] - middle).abs() < 1.01 * h)
            .collect(),
        sum: (0.0, 0.0),
        histories: Histories::default(),
    };
    let outcome = run(host, &p.common, &mut specimen, &mut test)?;
    write::Done {
        p,
        histories: &test.histories,
        amplitude,
        shear,
    }
    .write(host, &specimen, &outcome)
}

/// The lateral load at the nodes: its value there times the area that a node stands for.
fn transverse_loads(
    p: &Parameters,
    grid: &Grid,
    shape: &imperfection::Shape,
    specimen: &Specimen,
) -> Vec<NodalLoad> {
    // Half of the gaps to both neighbours; the gaps outside are none.
    let share = |at: &[f64], i: usize| {
        let (last, first) = (at[(i + 1).min(at.len() - 1)], at[i.saturating_sub(1)]);
        0.5 * (last - first)
    };
    (0..specimen.mesh.points.len() as u32)
        .filter_map(|node| {
            let (i, j) = grid.place(node);
            let value = p.transverse_load * shape.at(grid.xs[i], grid.ys[j]);
            (value != 0.0).then(|| NodalLoad {
                node,
                force: [0.0, 0.0, value * share(&grid.xs, i) * share(&grid.ys, j)],
                moment: [0.0; 3],
            })
        })
        .collect()
}

/// Elements whose centres lie within `radius` of a point, or the nearest one.
fn gauge(specimen: &Specimen, point: [f64; 2], radius: f64) -> Vec<u32> {
    let distance = |c: &u32| {
        let nodes = specimen.mesh.cells[*c as usize];
        let mean = |k: usize| {
            0.25 * nodes
                .iter()
                .map(|n| specimen.mesh.points[*n as usize][k])
                .sum::<f64>()
        };
        (mean(0) - point[0]).fixed_hypot(mean(1) - point[1])
    };
    let cells = 0..specimen.mesh.cells.len() as u32;
    let near: Vec<u32> = cells.clone().filter(|c| distance(c) <= radius).collect();
    if near.is_empty() {
        return cells
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .into_iter()
            .collect();
    }
    near
}

fn check(p: &Parameters) -> Result<(), StepError> {
    if p.length < 2.0 * p.width {
        return Err(format!(
            "length: given {:.1} mm at a width of {:.1} mm; expected at least twice the width, or no fibre of the \
             central zone is free at both ends",
            1e3 * p.length,
            1e3 * p.width
        )
        .into());
    }
    let most = (SQRT_2 - 1.0) * (p.length - p.width);
    if p.displacement >= most {
        return Err(format!(
            "displacement: given {:.1} mm; the net of the central zone is stretched out at {:.1} mm. Expected less",
            1e3 * p.displacement,
            1e3 * most
        )
        .into());
    }
    if p.ramp_share > 0.5 {
        return Err(format!(
            "ramp_share: given {}; expected 0.5 at most: start and stop take it each",
            p.ramp_share
        )
        .into());
    }
    let inside = |v: f64| (0.0..=p.displacement).contains(&v);
    if let Some(r) = p
        .plateau
        .filter(|r| !(inside(r.from) && inside(r.to) && r.from < r.to))
    {
        return Err(format!(
            "plateau: given {:.1} to {:.1} mm; expected an increasing range within the displacement of {:.1} mm",
            1e3 * r.from,
            1e3 * r.to,
            1e3 * p.displacement
        )
        .into());
    }
    if let Some(late) = p.late.filter(|v| !inside(*v)) {
        return Err(format!(
            "late: given {:.1} mm; expected a place within the displacement of {:.1} mm",
            1e3 * late,
            1e3 * p.displacement
        )
        .into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_net_has_the_angles_that_the_thesis_gives() {
        assert!((net_angle(0.3, 0.15, 0.045).to_degrees() - 43.6).abs() < 0.05);
        assert!(net_angle(0.2, 0.1, 0.0).abs() < 1e-12);
        assert!((net_angle(0.2, 0.1, 0.05) - FRAC_PI_2).abs() < 1e-12);
    }
}
