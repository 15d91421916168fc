//! Popular benchmarks of geometrically non-linear shells (Sze, Liu, Lo, Finite Elements in Analysis and Design
//! 40 (2004) 1551-1569): static load-displacement curves of thin isotropic shells, by load steps that are each
//! brought to rest with kinetic damping.
//!
//! The numbers of the paper have no units; here they are SI (m, N, Pa).

use crate::distortion;
use crate::drives::Held;
use crate::output::Output;
use crate::specimen::{Common, Specimen};
use crate::statics::{LoadStep, rest};
use plyflow_characterisation::csv::{self, Column};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Fixed, Model, NodalLoad};
use plyflow_mechanics::relax::Tolerance;
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::artifact::{ElementCount, SpecimenBody, Style};
use plyflow_model::units::Dimension;
use plyflow_sdk::{Host, On, Step, StepError};
use serde::Deserialize;
use std::f64::consts::{FRAC_PI_2, PI};
use std::time::Instant;

/// Which benchmark.
#[derive(Debug, Clone, Copy, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
enum Case {
    /// 3.1: cantilever 10 x 1 under end shear.
    CantileverShear,
    /// 3.2: cantilever 12 x 1 under end moment.
    CantileverMoment,
    /// 3.3: slit annular plate, radii 6 and 10, lifted at the slit.
    SlitAnnulus,
    /// 3.4: hemisphere of radius 10 with an 18 deg hole, alternating radial forces (a quarter).
    Hemisphere,
    /// 3.8: semi-cylinder, radius 1.016, length 3.048, pinched at its free end (a half).
    SemiCylinder,
}

/// Parameters.
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    case: Case,
    /// Elements along the longer and the shorter direction.
    elements: [usize; 2],
    /// Load at the end: force (N), or moment (N m).
    load: f64,
    /// Load steps.
    steps: usize,
    /// Forces out of balance over the loads.
    balance: f64,
    /// Most explicit steps for a load step.
    cycles: u64,
    /// CSV: load_ratio and the displacements.
    #[serde(default)]
    reference: Option<String>,
}

/// A meshed benchmark.
struct Setup {
    mesh: QuadMesh,
    clamped: Vec<u32>,
    fixed: Vec<(u32, Fixed)>,
    loads: Vec<NodalLoad>,
    /// Name, node, direction of the displacements.
    watched: Vec<(&'static str, u32, Vec3)>,
}

fn force(node: u32, force: Vec3) -> NodalLoad {
    NodalLoad {
        node,
        force,
        moment: [0.0; 3],
    }
}

/// A symmetry plane with the normal along axis `n`.
fn symmetry(n: usize) -> Fixed {
    Fixed {
        translations: std::array::from_fn(|k| k == n),
        rotations: std::array::from_fn(|k| k != n),
    }
}

/// Motion in the plane of x and z.
fn plane() -> Fixed {
    Fixed {
        translations: [false, true, false],
        rotations: [true, false, true],
    }
}

/// Shares of a load along an edge of `n` elements: a half at both ends.
fn edge_share(i: usize, n: usize) -> f64 {
    (if i == 0 || i == n { 0.5 } else { 1.0 }) / n as f64
}

/// `guard`: elements behind the clamp, which a shell without rotations needs to feel it.
fn cantilever(p: &Parameters, length: f64, guard: usize) -> Setup {
    let [nx, ny] = [p.elements[0] + guard, p.elements[1]];
    let size = length / p.elements[0] as f64;
    let xs = even_axis(-size * guard as f64, length, size);
    let mesh = QuadMesh::grid(&xs, &even_axis(-0.5, 0.5, 1.0 / ny as f64));
    let node = |i: usize, j: usize| (j * (nx + 1) + i) as u32;
    let moment = p.case == Case::CantileverMoment;
    let loads = (0..=ny)
        .map(|j| {
            let share = edge_share(j, ny);
            NodalLoad {
                node: node(nx, j),
                force: [0.0, 0.0, if moment { 0.0 } else { share }],
                moment: [0.0, if moment { -share } else { 0.0 }, 0.0],
            }
        })
        .collect();
    let tip = node(nx, ny / 2);
    Setup {
        clamped: clamped(guard, ny, node),
        // A moment about a fixed axis is conservative only in the plane; rolled up far, the strip leaves it
        // (tried: beyond 0.85 turns). The answer is plane, nu being 0.
        fixed: (0..mesh.points.len() as u32)
            .filter(|_| moment)
            .map(|n| (n, plane()))
            .collect(),
        loads,
        watched: vec![
            ("shortening", tip, [-1.0, 0.0, 0.0]),
            ("deflection", tip, [0.0, 0.0, 1.0]),
        ],
        mesh,
    }
}

/// A grid of `n[0]` x `n[1]` cells placed by a map of its unit square.
fn mapped(n: [usize; 2], place: impl Fn(f64, f64) -> Vec3) -> QuadMesh {
    let unit = |n: usize| even_axis(0.0, 1.0, 1.0 / n as f64);
    let mut mesh = QuadMesh::grid(&unit(n[0]), &unit(n[1]));
    for p in &mut mesh.points {
        *p = place(p[0], p[1]);
    }
    mesh
}

/// The first column of nodes, and those of the guard elements.
fn clamped(guard: usize, across: usize, node: impl Fn(usize, usize) -> u32) -> Vec<u32> {
    (0..=guard)
        .flat_map(|i| (0..=across).map(move |j| (i, j)))
        .map(|(i, j)| node(i, j))
        .collect()
}

fn annulus(p: &Parameters, guard: usize) -> Setup {
    let [n, m] = [p.elements[0] + guard, p.elements[1]];
    let whole = p.elements[0] as f64;
    // Along the circumference, then from the outer to the inner edge, so that cells turn about +z.
    let mesh = mapped([n, m], |u, v| {
        let turns = (u * n as f64 - guard as f64) / whole;
        let (r, a) = (10.0 - 4.0 * v, 2.0 * PI * turns);
        [r * a.fixed_cos(), r * a.fixed_sin(), 0.0]
    });
    let node = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    Setup {
        mesh,
        clamped: clamped(guard, m, node),
        fixed: Vec::new(),
        loads: (0..=m)
            .map(|j| force(node(n, j), [0.0, 0.0, edge_share(j, m)]))
            .collect(),
        watched: vec![
            ("inner", node(n, m), [0.0, 0.0, 1.0]),
            ("outer", node(n, 0), [0.0, 0.0, 1.0]),
        ],
    }
}

fn hemisphere(p: &Parameters) -> Setup {
    let [n, m] = p.elements;
    let top = 72f64.to_radians();
    let mesh = mapped([n, m], |u, v| {
        let (a, b) = (FRAC_PI_2 * u, top * v);
        [
            10.0 * b.fixed_cos() * a.fixed_cos(),
            10.0 * b.fixed_cos() * a.fixed_sin(),
            10.0 * b.fixed_sin(),
        ]
    });
    let node = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let mut fixed: Vec<(u32, Fixed)> = Vec::new();
    for j in 0..=m {
        fixed.push((node(0, j), symmetry(1)));
        fixed.push((node(n, j), symmetry(0)));
    }
    // One node of the equator holds the height.
    fixed[0].1.translations[2] = true;
    Setup {
        mesh,
        clamped: Vec::new(),
        fixed,
        // Half of each force: the symmetry planes go through them.
        loads: vec![
            force(node(0, 0), [0.5, 0.0, 0.0]),
            force(node(n, 0), [0.0, -0.5, 0.0]),
        ],
        watched: vec![
            ("outwards", node(0, 0), [1.0, 0.0, 0.0]),
            ("inwards", node(n, 0), [0.0, -1.0, 0.0]),
        ],
    }
}

fn semi_cylinder(p: &Parameters) -> Setup {
    let [n, m] = p.elements;
    let (radius, length) = (1.016, 3.048);
    // Half of it: from the edge (angle 0, x = radius) up to the crown (x = 0); y from the free to the fixed end.
    let mesh = mapped([n, m], |u, v| {
        let a = FRAC_PI_2 * v;
        [radius * a.fixed_cos(), length * u, radius * a.fixed_sin()]
    });
    let node = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let mut fixed = Vec::new();
    for i in 0..n {
        // The longitudinal edges cannot move vertically nor turn about the cylinder's axis.
        let edge = Fixed {
            translations: [false, false, true],
            rotations: [false, true, false],
        };
        fixed.push((node(i, 0), edge));
        fixed.push((node(i, m), symmetry(0)));
    }
    Setup {
        mesh,
        clamped: (0..=m).map(|j| node(n, j)).collect(),
        fixed,
        loads: vec![force(node(0, m), [0.0, 0.0, -0.5])],
        watched: vec![("crown", node(0, m), [0.0, 0.0, -1.0])],
    }
}

impl Setup {
    /// How far the watched nodes have moved in their directions (m).
    fn displacements(&self, model: &Model) -> Vec<f64> {
        let moved = |(_, n, d): &(&str, u32, Vec3)| -> f64 {
            let (x, r) = (model.x()[*n as usize], self.mesh.points[*n as usize]);
            (0..3).map(|k| d[k] * (x[k] - r[k])).sum()
        };
        self.watched.iter().map(moved).collect()
    }
}

/// The step plugin `coupon-shell-benchmark`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("shell_benchmark/manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        crate::run::with_threads(host, || benchmark(host, &p))
    }
}

/// A load step at rest.
struct State {
    ratio: f64,
    displacement: Vec<f64>,
    residual: f64,
}

fn benchmark(host: &Host, p: &Parameters) -> Result<(), StepError> {
    if p.elements.contains(&0) || p.steps == 0 {
        return Err(format!(
            "elements {:?}, steps {}: expected at least 1 of each",
            p.elements, p.steps
        )
        .into());
    }
    let guard = usize::from(!crate::strip::rotates(host, &p.common)?);
    let mut setup = match p.case {
        Case::CantileverShear => cantilever(p, 10.0, guard),
        Case::CantileverMoment => cantilever(p, 12.0, guard),
        Case::SlitAnnulus => annulus(p, guard),
        Case::Hemisphere => hemisphere(p),
        Case::SemiCylinder => semi_cylinder(p),
    };
    distort(p, &mut setup)?;
    let mesh = setup.mesh.clone();
    let mut specimen = Specimen::new(host, &p.common, mesh, [1.0, 0.0, 0.0], Pressed::No)?;
    if specimen.model.spins().is_none() {
        refuse_rotations(p, &setup)?;
    }
    let places = (setup.clamped.iter())
        .map(|n| setup.mesh.points[*n as usize])
        .collect();
    let clamp = Box::new(Held { places });
    specimen.model.set_driven(setup.clamped.clone(), clamp);
    for (n, f) in &setup.fixed {
        specimen.model.fix(*n, *f);
    }
    specimen.model.set_loads(setup.loads.clone());
    let started = Instant::now();
    let states = load(host, p, &setup, &mut specimen)?;
    let seconds = started.elapsed().as_secs_f64();
    write(host, p, &setup, &specimen, (&states, seconds))
}

/// Moves nodes within a flat mesh off their places.
fn distort(p: &Parameters, setup: &mut Setup) -> Result<(), StepError> {
    let share = p.common.distortion;
    if share > 0.0 && setup.mesh.points.iter().any(|x| x[2] != 0.0) {
        return Err(format!(
            "distortion: given {share} for a curved shell; expected 0, or a case that is flat at the start: cantilever-shear, cantilever-moment \
             or slit-annulus"
        )
        .into());
    }
    let kept: Vec<u32> = setup.clamped.clone();
    distortion::scatter(&mut setup.mesh, share, |n| kept.contains(&(n as u32)))
}

/// Elements without rotations cannot be given moments, nor symmetry planes that a curved shell bends across.
fn refuse_rotations(p: &Parameters, setup: &Setup) -> Result<(), StepError> {
    let flat = setup.mesh.points.iter().all(|x| x[2] == 0.0);
    let moments = setup.loads.iter().any(|l| l.moment != [0.0; 3]);
    if flat && !moments {
        return Ok(());
    }
    Err(format!(
        "element '{}' has no rotations: expected one with six degrees of freedom per node, such as s4, for a \
         shell that is curved at the start or loaded by moments",
        p.common.element.plugin
    )
    .into())
}

fn load(
    host: &Host,
    p: &Parameters,
    setup: &Setup,
    specimen: &mut Specimen,
) -> Result<Vec<State>, StepError> {
    let cells: Vec<u32> = specimen.mesh.cells.iter().flatten().copied().collect();
    let attributes = SpecimenBody::new(p.common.thickness());
    host.define_mesh("specimen", &specimen.mesh.points, 4, &cells, &attributes)?;
    let tolerance = Tolerance {
        balance: p.balance,
        safety: p.common.step_safety,
        cycles: p.cycles,
    };
    let mut states = vec![State {
        ratio: 0.0,
        displacement: vec![0.0; setup.watched.len()],
        residual: 0.0,
    }];
    frame(host, specimen, 0.0)?;
    let mut shown = Instant::now();
    for step in 1..=p.steps {
        let ratio = step as f64 / p.steps as f64;
        specimen.model.set_load_factor(p.load * ratio);
        let this = LoadStep {
            number: step,
            of: p.steps,
        };
        let relaxed = rest(host, &mut specimen.model, tolerance, this, &mut shown)?;
        let displacement = setup.displacements(&specimen.model);
        states.push(State {
            ratio,
            displacement,
            residual: relaxed.residual,
        });
        specimen.model.step(true).map_err(|e| e.to_string())?;
        frame(host, specimen, ratio)?;
    }
    Ok(states)
}

/// A frame; its time is the load ratio.
fn frame(host: &Host, specimen: &Specimen, time: f64) -> Result<(), StepError> {
    host.begin_frame(time)?;
    host.write_points("specimen", specimen.model.x())?;
    let moved: Vec<f64> = specimen
        .model
        .x()
        .iter()
        .zip(&specimen.mesh.points)
        .flat_map(|(x, r)| (0..3).map(move |k| x[k] - r[k]))
        .collect();
    host.write_field("specimen", On::Points, "displacement", 3, "m", &moved)?;
    host.end_frame()
}

fn write(
    host: &Host,
    p: &Parameters,
    setup: &Setup,
    specimen: &Specimen,
    (states, seconds): (&[State], f64),
) -> Result<(), StepError> {
    let mut out = Output::new(host);
    let ratios: Vec<f64> = states.iter().map(|s| s.ratio).collect();
    let x = out.curve("run/load_ratio", "1", &ratios)?;
    let mut series = Vec::new();
    for (k, (name, ..)) in setup.watched.iter().enumerate() {
        let values: Vec<f64> = states.iter().map(|s| s.displacement[k]).collect();
        let path = out.curve(&format!("run/{name}"), "m", &values)?;
        series.push((format!("{name}, this run"), path, x.clone(), Style::Line));
    }
    if let Some(path) = &p.reference {
        let worst = compare(&mut out, path, setup, states, &mut series)?;
        host.result("error", worst, "1")?;
    }
    let mut plot = out.plot(
        "load",
        "Load against displacement",
        ("displacement", "m"),
        ("load over the largest load", "1"),
    );
    for (label, path, ratio, style) in &series {
        plot = plot.series(label, path, ratio, *style);
    }
    plot.done();
    for (k, (name, ..)) in setup.watched.iter().enumerate() {
        let last = states.last().map_or(0.0, |s| s.displacement[k]);
        host.result(&format!("displacement.{name}"), last, "m")?;
    }
    let ledger = specimen.model.energies();
    let hourglass = ledger.hourglass / ledger.internal().max(1e-300);
    let residual = states.iter().map(|s| s.residual).fold(0.0, f64::max);
    host.result("hourglass_ratio", hourglass, "1")?;
    host.result("residual", residual, "1")?;
    distortion::tell(host, &specimen.mesh, p.common.distortion)?;
    host.result("elements", specimen.model.element_count() as f64, "1")?;
    host.result("cycles", specimen.model.cycle() as f64, "1")?;
    let work = specimen.model.element_count() as f64 * specimen.model.cycle() as f64;
    host.measured("element_cycle_rate", work / seconds.max(1e-9), "1/s")?;
    out.about.element = Some(p.common.element.plugin.clone());
    out.about.elements = Some(ElementCount::Along(p.elements.map(|n| n as u64)));
    out.attributes_only()
}

/// Adds the published curves and gives the deviation from them: the largest difference over the largest published
/// displacement, at the published loads that are load steps.
fn compare(
    out: &mut Output<'_>,
    path: &str,
    setup: &Setup,
    states: &[State],
    series: &mut Vec<(String, String, String, Style)>,
) -> Result<f64, StepError> {
    let mut wanted = vec![Column::required("load_ratio", Dimension::Dimensionless)];
    wanted.extend(
        setup
            .watched
            .iter()
            .map(|w| Column::required(w.0, Dimension::Length)),
    );
    let table = csv::read(path, &wanted)?;
    let loads = table.values("load_ratio")?;
    let x = out.curve("published/load_ratio", "1", loads)?;
    let mut worst = 0.0f64;
    for (k, (name, ..)) in setup.watched.iter().enumerate() {
        let values = table.values(name)?;
        let largest = values.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let y = out.curve(&format!("published/{name}"), "m", values)?;
        series.push((format!("{name}, published"), y, x.clone(), Style::Points));
        let mut common = 0;
        for (load, value) in loads.iter().zip(values) {
            let Some(state) = states.iter().find(|s| (s.ratio - load).abs() < 1e-6) else {
                continue;
            };
            common += 1;
            let error = (state.displacement[k] - value).abs() / largest.max(1e-300);
            worst = worst.max(error);
        }
        if common == 0 {
            return Err(format!(
                "reference: no load ratio of its {} is one of the {} load steps; choose steps that meet some of \
                 them",
                loads.len(),
                states.len() - 1
            )
            .into());
        }
    }
    Ok(worst)
}
