//! Tension off the fibres: a strip with its fibres at any angle to the pull, without grips.
//!
//! Grips keep the ends of such a strip from slanting, and then no closed form holds. Here both ends are pulled by dead loads, equal along
//! their lines, and are free to slant: the strip is strained evenly, and its stress is uniaxial along it whatever the law. The states
//! are static: each load step is brought to rest with kinetic damping.

use crate::output::Output;
use crate::specimen::{Common, Specimen};
use crate::statics::{LoadStep, rest};
use plyflow_characterisation::csv::{self, Column, Table};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, norm, sub};
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Fixed, NodalLoad};
use plyflow_mechanics::relax::Tolerance;
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::artifact::{ElementCount, SpecimenBody, Style};
use plyflow_model::units::Dimension;
use plyflow_sdk::{Host, On, Step, StepError};
use serde::Deserialize;
use std::time::Instant;

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    /// Between the loaded ends (m).
    length: f64,
    /// Across (m).
    width: f64,
    /// From the pull to fibre family 1, counter-clockwise (rad).
    fibre_angle: f64,
    /// Force over the undeformed width at the end (N/m).
    force: f64,
    /// Load steps.
    steps: usize,
    /// Forces out of balance over the loads.
    balance: f64,
    /// Most explicit steps for a load step.
    cycles: u64,
    /// CSV: force, strain, shear_angle.
    #[serde(default)]
    closed_form: Option<String>,
}

/// What is measured of a state at rest.
#[derive(Debug, Clone, Copy, Default)]
struct State {
    /// Force over the undeformed width (N/m).
    force: f64,
    /// Along the pull.
    strain: f64,
    /// Across it.
    contraction: f64,
    /// By how much the corners of the strip are off a right angle (rad).
    slant: f64,
    /// Of the fibres, the mean (rad).
    shear: f64,
    /// Largest less smallest shear angle (rad).
    shear_spread: f64,
    /// Mean strains of the families.
    fibres: [f64; 2],
    residual: f64,
}

/// The step plugin `coupon-off-axis`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("off_axis/manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let mut p: Parameters = host.parameters()?;
        p.common.any_crossing = true;
        crate::run::with_threads(host, || test(host, &p))
    }
}

/// The mesh of the strip, about its middle, and how many cells it has along and across: even numbers, so that a node lies in the middle.
fn strip(p: &Parameters) -> (QuadMesh, [usize; 2]) {
    let size = p.common.element_size;
    let axis = |length: f64| {
        let half = even_axis(0.0, 0.5 * length, size);
        let below = half.iter().skip(1).rev().map(|x| -x);
        below.chain(half.iter().copied()).collect::<Vec<f64>>()
    };
    let (xs, ys) = (axis(p.length), axis(p.width));
    (QuadMesh::grid(&xs, &ys), [xs.len() - 1, ys.len() - 1])
}

/// Forces on both ends that make 1 N together on each.
fn pull([nx, ny]: [usize; 2]) -> Vec<NodalLoad> {
    let share = |j: usize| (if j == 0 || j == ny { 0.5 } else { 1.0 }) / ny as f64;
    let load = |i: usize, j: usize, sign: f64| NodalLoad {
        node: (j * (nx + 1) + i) as u32,
        force: [sign * share(j), 0.0, 0.0],
        moment: [0.0; 3],
    };
    (0..=ny)
        .flat_map(|j| [load(0, j, -1.0), load(nx, j, 1.0)])
        .collect()
}

fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    p.common.allow(p.length * p.width)?;
    let closed_form = p.closed_form.as_deref().map(closed_form).transpose()?;
    let (mesh, cells) = strip(p);
    let along = [p.fibre_angle.fixed_cos(), p.fibre_angle.fixed_sin(), 0.0];
    let mut specimen = Specimen::new(host, &p.common, mesh, along, Pressed::No)?;
    specimen.keep_flat();
    // The loads are balanced: what holds the middle carries nothing.
    let middle = (cells[1] / 2 * (cells[0] + 1) + cells[0] / 2) as u32;
    specimen.model.fix(
        middle,
        Fixed {
            translations: [true; 3],
            ..Fixed::default()
        },
    );
    specimen.model.set_loads(pull(cells));
    let started = Instant::now();
    let states = load(host, p, cells, &mut specimen)?;
    let seconds = started.elapsed().as_secs_f64();
    write(
        host,
        p,
        cells,
        &specimen,
        (&states, closed_form.as_ref(), seconds),
    )
}

fn load(
    host: &Host,
    p: &Parameters,
    cells: [usize; 2],
    specimen: &mut Specimen,
) -> Result<Vec<State>, StepError> {
    let corners: Vec<u32> = specimen.mesh.cells.iter().flatten().copied().collect();
    let attributes = SpecimenBody::new(p.common.thickness());
    host.define_mesh("specimen", &specimen.mesh.points, 4, &corners, &attributes)?;
    let tolerance = Tolerance {
        balance: p.balance,
        safety: p.common.step_safety,
        cycles: p.cycles,
    };
    specimen.model.set_load_factor(0.0);
    let critical = specimen.model.critical_step().map_err(|e| e.to_string())?;
    specimen.model.set_step(p.common.step_safety * critical);
    specimen.model.step(true).map_err(|e| e.to_string())?;
    frame(host, specimen, 0.0)?;
    let mut states = vec![State::default()];
    let mut shown = Instant::now();
    for number in 1..=p.steps {
        let ratio = number as f64 / p.steps as f64;
        specimen.model.set_load_factor(p.force * p.width * ratio);
        let step = LoadStep {
            number,
            of: p.steps,
        };
        let relaxed = rest(host, &mut specimen.model, tolerance, step, &mut shown)?;
        specimen.model.step(true).map_err(|e| e.to_string())?;
        let state = measure(specimen, cells);
        states.push(State {
            force: p.force * ratio,
            residual: relaxed.residual,
            ..state
        });
        frame(host, specimen, ratio)?;
    }
    Ok(states)
}

/// A frame; its time is the share of the load.
fn frame(host: &Host, specimen: &Specimen, time: f64) -> Result<(), StepError> {
    host.begin_frame(time)?;
    host.write_points("specimen", specimen.model.x())?;
    for f in &specimen.fields {
        let on = if f.patch { On::Points } else { On::Cells };
        host.write_field("specimen", on, &f.name, 1, &f.unit, &specimen.values(f))?;
    }
    host.end_frame()
}

/// Middle of a line of nodes.
fn middle(points: &[Vec3], nodes: impl Iterator<Item = usize>) -> Vec3 {
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for n in nodes {
        (0..3).for_each(|k| sum[k] += points[n][k]);
        count += 1.0;
    }
    sum.map(|s| s / count)
}

fn measure(specimen: &Specimen, [nx, ny]: [usize; 2]) -> State {
    let node = |i: usize, j: usize| j * (nx + 1) + i;
    let lines = |points: &[Vec3]| {
        let end = |i: usize| middle(points, (0..=ny).map(move |j| node(i, j)));
        let side = |j: usize| middle(points, (0..=nx).map(move |i| node(i, j)));
        [sub(end(nx), end(0)), sub(side(ny), side(0))]
    };
    let (now, before) = (lines(specimen.model.x()), lines(&specimen.mesh.points));
    let [along, across] = now;
    let dot: f64 = (0..3).map(|k| along[k] * across[k]).sum();
    let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
    let field = |name: &str| specimen.field(name).unwrap_or_default();
    let shear = field("shear_angle");
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for g in &shear {
        (low, high) = (low.min(*g), high.max(*g));
    }
    State {
        strain: norm(along) / norm(before[0]) - 1.0,
        contraction: norm(across) / norm(before[1]) - 1.0,
        slant: (dot / (norm(along) * norm(across))).fixed_asin(),
        shear: mean(&shear),
        shear_spread: high - low,
        fibres: ["fibre_strain_1", "fibre_strain_2"].map(|name| mean(&field(name))),
        ..State::default()
    }
}

/// The closed form of the law; its first line is the unloaded strip.
fn closed_form(path: &str) -> Result<Table, StepError> {
    let table = csv::read(
        path,
        &[
            Column::required("force", Dimension::ForcePerLength),
            Column::required("strain", Dimension::Dimensionless),
            Column::required("shear_angle", Dimension::Angle),
        ],
    )?;
    table.at_least(2, "a closed form")?;
    Ok(table)
}

fn write(
    host: &Host,
    p: &Parameters,
    cells: [usize; 2],
    specimen: &Specimen,
    (states, closed_form, seconds): (&[State], Option<&Table>, f64),
) -> Result<(), StepError> {
    let mut out = Output::new(host);
    let column = |of: fn(&State) -> f64| states.iter().map(of).collect::<Vec<f64>>();
    let force = out.curve("run/force", "N/m", &column(|s| s.force))?;
    let strain = out.curve("run/strain", "1", &column(|s| s.strain))?;
    let shear = out.curve("run/shear_angle", "rad", &column(|s| s.shear))?;
    out.curve("run/slant", "rad", &column(|s| s.slant))?;
    out.curve("run/contraction", "1", &column(|s| s.contraction))?;
    let expected = closed_form
        .map(|t| compare(&mut out, states, t))
        .transpose()?;
    for (name, title, y, k) in [
        (
            "strain",
            "Tension off the fibres: strain along the pull",
            (&strain, "strain", "1"),
            0,
        ),
        (
            "shear",
            "Tension off the fibres: shear of the fibres",
            (&shear, "shear angle", "deg"),
            1,
        ),
    ] {
        let mut plot = out.plot(name, title, ("force over the width", "N/m"), (y.1, y.2));
        plot = plot.series("this run", &force, y.0, Style::Line);
        if let Some(e) = &expected {
            plot = plot.series("closed form", &e.force, &e.curves[k], Style::Dashed);
        }
        plot.done();
    }
    if let Some(e) = expected {
        host.result("strain_error", e.errors[0], "1")?;
        host.result("shear_error", e.errors[1], "1")?;
    }
    results(host, states)?;
    let ledger = specimen.model.energies();
    let hourglass = ledger.hourglass / ledger.internal().max(1e-300);
    host.result("hourglass_ratio", hourglass, "1")?;
    host.result("elements", specimen.model.element_count() as f64, "1")?;
    host.result("cycles", specimen.model.cycle() as f64, "1")?;
    let work = specimen.model.element_count() as f64 * specimen.model.cycle() as f64;
    host.measured("element_cycle_rate", work / seconds.max(1e-9), "1/s")?;
    out.about.element = Some(p.common.element.plugin.clone());
    out.about.material = Some(p.common.material.name.clone());
    out.about.elements = Some(ElementCount::Along(cells.map(|n| n as u64)));
    out.attributes_only()
}

/// The last state, and how good all of them are.
fn results(host: &Host, states: &[State]) -> Result<(), StepError> {
    let last = states.last().copied().unwrap_or_default();
    host.result("strain", last.strain, "1")?;
    host.result("contraction", last.contraction, "1")?;
    host.result("slant", last.slant, "rad")?;
    host.result("shear_angle", last.shear, "rad")?;
    host.result("fibre_strain_1", last.fibres[0], "1")?;
    host.result("fibre_strain_2", last.fibres[1], "1")?;
    let most = |of: fn(&State) -> f64| states.iter().map(of).fold(0.0, f64::max);
    host.result("shear_spread", most(|s| s.shear_spread), "rad")?;
    host.result("residual", most(|s| s.residual), "1")
}

/// What a run is held against.
struct Expected {
    /// Path of the forces.
    force: String,
    /// Paths of strains and shear angles.
    curves: [String; 2],
    /// Largest differences over the largest value of the closed form.
    errors: [f64; 2],
}

/// Holds each state against the line of the closed form with its force.
fn compare(out: &mut Output<'_>, states: &[State], table: &Table) -> Result<Expected, StepError> {
    let forces = table.values("force")?;
    let columns = [table.values("strain")?, table.values("shear_angle")?];
    let largest = |v: &[f64]| v.iter().fold(0.0f64, |a, b| a.max(b.abs()));
    let most = largest(forces);
    let (mut errors, mut common) = ([0.0f64; 2], 0);
    for (k, force) in forces.iter().enumerate() {
        let same = |s: &&State| (s.force - force).abs() < 1e-6 * most;
        let Some(state) = states.iter().skip(1).find(same) else {
            continue;
        };
        common += 1;
        for (i, value) in [state.strain, state.shear].into_iter().enumerate() {
            let error = (value - columns[i][k]).abs() / largest(columns[i]).max(1e-300);
            errors[i] = errors[i].max(error);
        }
    }
    if common == 0 {
        return Err(format!(
            "closed_form: no force of its {} is one of the {} load steps; choose `force` and `steps` that meet some of them",
            forces.len(),
            states.len() - 1
        )
        .into());
    }
    Ok(Expected {
        force: out.curve("closed_form/force", "N/m", forces)?,
        curves: [
            out.curve("closed_form/strain", "1", columns[0])?,
            out.curve("closed_form/shear_angle", "rad", columns[1])?,
        ],
        errors,
    })
}
