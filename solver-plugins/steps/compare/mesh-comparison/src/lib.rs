//! Step plugin `mesh-comparison`: shear angles over the element size (thesis 5.5.1, mesh sensitivity); of zones, the distance from the tool.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod advice;
mod column;
mod zones;

pub use advice::{Advice, advise};
use column::measured;
use plyflow_fixed::FixedBits;
use plyflow_model::artifact::{
    Axis, Cell, Column, Forming, MeshStudy, Paths, Plot, Series, Style, Table,
};
use plyflow_sdk::{Host, Input, Log, Step, StepError, export_step};
use plyflow_surface::draped;
use plyflow_surface::{Topology, weighted_quantiles};
use serde::Deserialize;

/// The step.
pub struct MeshComparison;

export_step!(MeshComparison);

#[derive(Deserialize)]
struct Parameters {
    target_error: f64,
    foot_margin: f64,
}

/// What is told of the shear angles: name, title, share of the area that has less.
const TOLD: [(&str, &str, f64); 7] = [
    ("shear_min", "smallest", 0.0),
    ("shear_q01", "1 %", 0.01),
    ("shear_q25", "25 %", 0.25),
    ("shear_q50", "median", 0.5),
    ("shear_q75", "75 %", 0.75),
    ("shear_q99", "99 %", 0.99),
    ("shear_max", "largest", 1.0),
];
const QUARTILES: [usize; 3] = [2, 3, 4];
const EXTREMES: [usize; 2] = [0, 6];

struct Run {
    input: Input,
    element_size: f64,
    elements: u64,
    /// As [`TOLD`] (rad).
    shear: [f64; 7],
}

impl Step for MeshComparison {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let inputs = host.inputs_of("runs")?;
        if zones::given(host, &inputs)? {
            return zones::compare(host, inputs, p.target_error, p.foot_margin);
        }
        let mut runs = Vec::new();
        for input in inputs {
            host.check_cancelled()?;
            runs.push(read(host, input)?);
        }
        runs.sort_by(|a, b| {
            let by_size = b.element_size.total_cmp(&a.element_size);
            by_size.then(a.input.step.cmp(&b.input.step))
        });
        let [.., next, finest] = &runs[..] else {
            let n = runs.len();
            return Err(format!("{n} run is given; a comparison needs two or more").into());
        };
        if next.element_size == finest.element_size {
            return Err(format!(
                "'{}' and '{}' are both the finest, with {} mm; leave one out",
                next.input.step,
                finest.input.step,
                1e3 * finest.element_size
            )
            .into());
        }
        write(host, &runs, finest, p.target_error)
    }
}

fn read(host: &Host, input: Input) -> Result<Run, StepError> {
    let formed: Forming = host.attributes(&input)?;
    let meshes = host.meshes(&input)?;
    let Some(frame) = meshes.times.len().checked_sub(1) else {
        return Err(format!("'{}' has no frame", input.step).into());
    };
    let (mut angles, mut areas) = (Vec::new(), Vec::new());
    for sheet in formed.plies() {
        let body = meshes.body(&sheet.name)?;
        let part = draped::Formed::read(host, &input, body, frame)?;
        let topology = Topology::new(part.flat.len(), body.nodes_per_cell, &part.cells);
        areas.extend(topology.cell_areas(&part.flat));
        angles.extend(part.of_cells(host.frame_field(&input, body, frame, "shear_angle")?));
    }
    if angles.is_empty() {
        return Err(format!("'{}' has no ply", input.step).into());
    }
    let shear = weighted_quantiles(&angles, &areas, &TOLD.map(|t| t.2));
    Ok(Run {
        element_size: formed.element_size,
        elements: formed.elements,
        shear: std::array::from_fn(|k| shear[k]),
        input,
    })
}

/// Shear (rad), 0.1 deg, of which errors are told in parts where the finest run has less: of plies that are hardly sheared every difference would be large.
const LEAST_SHEAR: f64 = 0.1 * std::f64::consts::PI / 180.0;
/// Plies that are sheared by less (rad) everywhere, 1 deg, say little of a mesh.
const LITTLE_SHEAR: f64 = 10.0 * LEAST_SHEAR;

/// Largest difference of some of what is told, over the finest's largest magnitude of them, or [`LEAST_SHEAR`].
fn error(run: &Run, finest: &Run, of: &[usize]) -> f64 {
    let most = |get: &dyn Fn(usize) -> f64| of.iter().map(|&k| get(k).abs()).fold(0.0, f64::max);
    let apart = most(&|k| run.shear[k] - finest.shear[k]);
    apart / most(&|k| finest.shear[k]).max(LEAST_SHEAR)
}

/// What to say of plies that are hardly sheared.
fn little_shear(finest: &Run) -> Option<String> {
    let most = EXTREMES.map(|k| finest.shear[k].abs());
    let most = most.into_iter().fold(0.0, f64::max);
    (most < LITTLE_SHEAR).then(|| {
        format!(
            "the plies of '{}' are sheared by {:.2} deg at most: their shear says little of the mesh, and the advised size is a guess. Take one from zones, whose \
             runs are compared by the distance from the tool",
            finest.input.step,
            most.to_degrees()
        )
    })
}

/// Slope of log y over log x by least squares; `None` for fewer than two places.
fn slope(places: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = places
        .iter()
        .map(|(x, y)| (x.fixed_ln(), y.fixed_ln()))
        .collect();
    let n = logs.len() as f64;
    let mean = |get: fn(&(f64, f64)) -> f64| logs.iter().map(get).sum::<f64>() / n;
    let (mx, my) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = logs.iter().map(|p| (p.0 - mx).powi(2)).sum();
    let both: f64 = logs.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum();
    (logs.len() > 1 && spread > 0.0).then(|| both / spread)
}

fn write(host: &Host, runs: &[Run], finest: &Run, target: f64) -> Result<(), StepError> {
    let mut rows = Vec::new();
    let mut falling = Vec::new();
    for run in runs {
        let step = &run.input.step;
        for ((name, _, _), value) in TOLD.iter().zip(run.shear) {
            host.result(&format!("{name}.{step}"), value, "rad")?;
        }
        let quartiles = error(run, finest, &QUARTILES);
        let extremes = error(run, finest, &EXTREMES);
        host.result(&format!("quartile_error.{step}"), quartiles, "1")?;
        host.result(&format!("extreme_error.{step}"), extremes, "1")?;
        let cost = &run.input.cost;
        host.measured(&format!("cost.{step}.cpu_seconds"), cost.cpu_seconds, "s")?;
        host.measured(&format!("cost.{step}.wall_seconds"), cost.wall_seconds, "s")?;
        if extremes > 0.0 {
            falling.push((run.element_size, extremes));
        }
        let mut row: Vec<Cell> = vec![step.into(), run.element_size.into(), run.elements.into()];
        // What was measured is in no artifact: these cells are told from the results.
        row.extend([Cell::Empty, Cell::Empty]);
        row.extend(run.shear.map(Cell::from));
        row.extend([quartiles, extremes].map(Cell::from));
        rows.push(row);
    }
    if let Some(order) = slope(&falling) {
        host.result("extreme_order", order, "1")?;
    }
    let sizes: Vec<f64> = runs.iter().map(|r| r.element_size).collect();
    let measured: Vec<(f64, f64)> = (runs.iter().rev())
        .map(|r| (r.element_size, error(r, finest, &QUARTILES)))
        .collect();
    let advice = advise(&measured, target);
    host.result("finest_error", advice.finest_error, "1")?;
    host.result("advised_element_size", advice.size, "m")?;
    for text in advice.doubt.into_iter().chain(little_shear(finest)) {
        host.log(Log::Warn, &text);
    }
    host.write_f64("study/element_size", &[runs.len()], "m", &sizes)?;
    for (k, (name, _, _)) in TOLD.iter().enumerate() {
        let values: Vec<f64> = runs.iter().map(|r| r.shear[k]).collect();
        host.write_f64(&path(name), &[runs.len()], "rad", &values)?;
    }
    host.write_attributes(&MeshStudy {
        target_error: target,
        finest: Some(finest.input.step.clone()),
        finest_error: Some(advice.finest_error),
        advised_element_size: Some(advice.size),
        zones: Vec::new(),
        tables: vec![Table {
            name: "meshes".into(),
            title: Some("Shear angles over the element size".into()),
            columns: columns(),
            rows,
        }],
        plots: vec![plot()],
    })
}

/// Path of the array of one of [`TOLD`].
fn path(name: &str) -> String {
    format!("study/{name}")
}

/// Columns of the table of the runs.
fn columns() -> Vec<Column> {
    let mut columns = vec![
        Column::new("run", ""),
        Column::new("element size", "m"),
        Column::new("elements", ""),
        measured("CPU", "cost.{0}.cpu_seconds"),
        measured("wall", "cost.{0}.wall_seconds"),
    ];
    columns.extend(TOLD.map(|t| Column::new(t.1, "rad")));
    columns.extend(["quartiles' error", "extremes' error"].map(|label| Column::new(label, "")));
    columns
}

/// Box plots of the shear angles over the element size.
fn plot() -> Plot {
    let note = "By undeformed area of all plies. Box: 25 to 75 %; bar: median; whiskers: 1 and 99 %; points: smallest and largest.";
    let spread = Paths::Spread(TOLD.map(|t| path(t.0)));
    let series = Series::new("", path("element_size"), spread);
    Plot {
        name: "shear".into(),
        title: Some("Shear angles over the element size".into()),
        note: Some(note.into()),
        x: Axis::new("element size", "mm"),
        y: Axis::new("shear angle", "deg"),
        series: vec![series.drawn(Style::Box)],
    }
}
