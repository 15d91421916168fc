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
mod terms;
mod write;

use crate::reference::Curve;
use crate::run::{Test, run, with_threads};
use crate::specimen::{Specimen, element};
use crate::strip::{CLAMPED, Grid, check_bends, fibre_strain, rows};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::constant_speed_way;
use plyflow_mechanics::model::{Drive, NodalLoad};
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::units::Dimension;
use plyflow_sdk::{Host, Step, StepError};
use std::f64::consts::{FRAC_1_SQRT_2, SQRT_2};
use terms::Histories;
pub use terms::Parameters;

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
    nodes: Vec<(Vec3, bool)>,
}

impl Drive for Clamps {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let (mut x, moves) = self.nodes[k];
        if moves {
            x[0] += self.pull.at(t);
        }
        x
    }

    fn spin(&self, _k: usize, _t: f64) -> Option<Vec3> {
        Some([0.0; 3])
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
    let x = ("displacement", Dimension::Length);
    let y = ("amplitude", Dimension::Length);
    let amplitude = Curve::given(p.measured_amplitude.as_ref(), x, y)?;
    let y = ("shear_angle", Dimension::Angle);
    let shear = Curve::given(p.measured_shear.as_ref(), x, y)?;
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
    let nodes: Vec<(Vec3, bool)> = (driven.iter())
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
    let mut test = measuring(p, &grid, &specimen, (pull, moving));
    let outcome = run(host, &p.common, &mut specimen, &mut test)?;
    write::Done {
        p,
        histories: &test.histories,
        amplitude,
        shear,
    }
    .write(host, &specimen, &outcome)
}

/// What is measured where; `moving`: driven nodes of the clamp that moves.
fn measuring(
    p: &Parameters,
    grid: &Grid,
    specimen: &Specimen,
    (pull, moving): (Pull, Vec<usize>),
) -> BiasExtension {
    let half_diagonal = [0.5 * (p.length - p.width), 0.5 * p.width];
    let middle = 0.5 * p.length;
    let b = [
        middle + p.point_b.along * half_diagonal[0],
        p.point_b.across * half_diagonal[1],
    ];
    let h = grid.xs[1] - grid.xs[0];
    BiasExtension {
        pull,
        moving,
        gauge_a: gauge(specimen, [middle, 0.0], p.gauge_radius),
        gauge_b: gauge(specimen, b, p.gauge_radius),
        section: (0..specimen.mesh.points.len() as u32)
            .filter(|n| (specimen.mesh.points[*n as usize][0] - middle).abs() < 1.01 * h)
            .collect(),
        sum: (0.0, 0.0),
        histories: Histories::default(),
    }
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
