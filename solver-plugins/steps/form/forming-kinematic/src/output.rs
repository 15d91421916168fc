//! The step behind the host: scene, nets, artifact.

use crate::net::{self, Fabric, Generators, Net, Stop};
use crate::ply::{Draped, Ply, Stops, lay, plies, stops};
use crate::root::drop_on;
use crate::surface::SmoothSurface;
use plyflow_geometry::vec3::{Vec3, distance};
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_model::artifact::{
    FieldError, Forming, MeshQuality, RigidBody, Sheet, SheetBody, ToolPlacement,
};
use plyflow_model::budget::{self, Wanted};
use plyflow_model::scene::{Process, Scene};
use plyflow_sdk::{Host, Log, On, Progress, StepError};
use plyflow_tooling::{Built, ToolMesh, given, of_step, other_way_up};
use serde::Deserialize;
use std::time::Instant;

/// Parameters of the step, SI.
#[derive(Debug, Clone, Deserialize)]
struct Parameters {
    #[serde(deserialize_with = "Scene::of_json")]
    scene: Scene,
    element_size: f64,
    net_spacing: Option<f64>,
    start: Option<Vec<f64>>,
    generators: Generators,
    locking_angle: f64,
    crease_angle: f64,
    #[serde(default = "default_grid")]
    tool_grid: f64,
}

fn default_grid() -> f64 {
    given::DEFAULT_SPACING
}

/// A ply with its net.
struct Done {
    ply: Ply,
    mesh: QuadMesh,
    quality: Option<MeshQuality>,
    draped: Draped,
    start: [f64; 2],
    net_nodes: usize,
    fibre_strain: f64,
    stops: Stops,
}

/// Runs the step.
///
/// # Errors
/// Whatever stops it, as a text for the user.
pub(crate) fn run(host: &Host) -> Result<(), StepError> {
    let mut p: Parameters = host.parameters()?;
    report(host, 0.0, "reading the tool");
    of_step::read(host, &mut p.scene)?;
    let plies = plies(&p.scene)?;
    let Built {
        mesh: tool,
        placement,
    } = given::checked(&p.scene, p.tool_grid)?;
    if let Some(placement) = &placement {
        host.log(Log::Info, &given::placement_told(placement));
    }
    let surface = SmoothSurface::new(&tool, p.crease_angle)
        .ok_or("the tool has no facet with an area: give another one")?;
    let started = Instant::now();
    let mut done = Vec::new();
    // In a press the height is free, and the tool stands on what is below it.
    let bed = match p.scene.process {
        Process::DoubleDiaphragm(_) | Process::SingleDiaphragm(_) => 0.0,
        Process::Press(_) | Process::Stamping(_) => tool.bounds()[0][2],
    };
    let over = Over {
        surface: &surface,
        bounds: tool.bounds(),
        bed,
    };
    for (k, ply) in plies.iter().enumerate() {
        let part = |f: f64| 0.95 * (k as f64 + f) / plies.len() as f64;
        done.push(drape(host, &p, &over, ply, part)?);
    }
    let seconds = started.elapsed().as_secs_f64();
    report(host, 0.95, "writing");
    write_bodies(host, &p.scene, &tool, &done)?;
    let (off, at) = surface.smoothed_by();
    let mut texts = Vec::from_iter(given::unlike_sizes(&p.scene, &tool));
    texts.extend(other_way_up(&p.scene, &tool));
    texts.extend(much_smoothed(&p, (off, at)));
    host.result("tool_field_error", off, "m")?;
    let of_tool = OfTool {
        texts,
        field_error: FieldError {
            max: off,
            place: at,
        },
        placement,
    };
    write_summary(host, &p, &done, of_tool, seconds)
}

/// What is told of the tool.
struct OfTool {
    /// What the user should know.
    texts: Vec<String>,
    field_error: FieldError,
    placement: Option<ToolPlacement>,
}

/// What to say of a tool whose facets the net does not lie on.
fn much_smoothed(p: &Parameters, (off, at): (f64, [f64; 3])) -> Option<String> {
    let ply = given::thinnest_ply(&p.scene);
    let [x, y, z] = at.map(|c| 1e3 * c);
    (off > ply).then(|| {
        format!(
            "the net lies on a surface that is smoothed over the tool's facets, {:.2} mm off them at ({x:.1}, {y:.1}, {z:.1}) mm, more than the thinnest \
             ply ({:.2} mm): if these facets stand for something round, give finer ones; if their edges are real, take a smaller `crease_angle` \
             ({:.0} deg)",
            1e3 * off,
            1e3 * ply,
            p.crease_angle.to_degrees()
        )
    })
}

fn report(host: &Host, fraction: f64, phase: &str) {
    host.progress(&Progress {
        fraction,
        phase,
        ..Progress::default()
    });
}

fn millimetres([x, y]: [f64; 2]) -> String {
    format!("({:.1}, {:.1}) mm", 1e3 * x, 1e3 * y)
}

/// The point of the flat ply that touches the tool first.
fn start_of(p: &Parameters, ply: &Ply) -> Result<[f64; 2], String> {
    let [x0, y0, x1, y1] = ply.blank.bounds();
    let start = match p.start.as_deref() {
        None => [0.5 * (x0 + x1), 0.5 * (y0 + y1)],
        Some(&[x, y]) => [x, y],
        Some(other) => {
            return Err(format!(
                "`start` has {} values; expected two lengths, [x, y]",
                other.len()
            ));
        }
    };
    if !(x0..=x1).contains(&start[0]) || !(y0..=y1).contains(&start[1]) {
        return Err(format!(
            "the start at {} lies off ply '{}', which reaches from {} to {}; move `start` onto it",
            millimetres(start),
            ply.scene.name,
            millimetres([x0, y0]),
            millimetres([x1, y1])
        ));
    }
    Ok(start)
}

/// Whether a net is not too large to be made; it has a node at least for each square of its spacing.
fn allow_net(fabric: &Fabric) -> Result<(), String> {
    let [x0, y0, x1, y1] = fabric.blank;
    budget::allow(Wanted {
        what: "its net",
        of: "nodes",
        count: (x1 - x0) * (y1 - y0) / (fabric.spacing * fabric.spacing),
        most: net::MOST_NODES,
        bytes: net::NODE_BYTES,
        parameter: "net_spacing",
        size: fabric.spacing,
    })
}

/// What plies are draped over.
struct Over<'a> {
    surface: &'a SmoothSurface,
    /// The box around it (m).
    bounds: [[f64; 3]; 2],
    /// Height of what the tool stands on (m).
    bed: f64,
}

/// Where the net of a ply begins on the tool, and the normal there.
fn first_node(over: &Over<'_>, ply: &Ply, [x, y]: [f64; 2]) -> Result<(Vec3, Vec3), String> {
    let (surface, [low, high]) = (over.surface, over.bounds);
    let reach = 0.5 * (high[2] - low[2]).max(ply.offset) + 2.0 * ply.offset;
    surface
        .top(x, y)
        .and_then(|(z, face)| drop_on(surface, [x, y, z], face, ply.offset, reach))
        .ok_or_else(|| {
            format!(
                "ply '{}' cannot start at {}: the tool, which reaches from {} to {}, is not below it; give \
                 another `start`",
                ply.scene.name,
                millimetres([x, y]),
                millimetres([low[0], low[1]]),
                millimetres([high[0], high[1]])
            )
        })
}

fn drape(
    host: &Host,
    p: &Parameters,
    over: &Over<'_>,
    ply: &Ply,
    part: impl Fn(f64) -> f64,
) -> Result<Done, StepError> {
    let (surface, bed) = (over.surface, over.bed);
    let name = &ply.scene.name;
    let [x, y] = start_of(p, ply)?;
    let (place, normal) = first_node(over, ply, [x, y])?;
    let spacing = p.net_spacing.unwrap_or(0.25 * p.element_size);
    let fabric = Fabric {
        directions: ply.directions(),
        blank: ply.blank.bounds(),
        start: [x, y],
        spacing,
        locking: p.locking_angle,
        generators: p.generators,
        offset: ply.offset,
        bed,
    };
    allow_net(&fabric).map_err(|e| format!("ply '{name}': {e}"))?;
    let mut net = Net::new(fabric).ok_or_else(|| {
        format!(
            "the net of ply '{name}' at a spacing of {spacing} m has too many nodes; enlarge `net_spacing`"
        )
    })?;
    net.drape(surface, place, normal, |f| {
        report(host, part(f), name);
        host.check_cancelled()
    })?;
    let (mesh, quality) = ply.mesh(p.element_size)?;
    let draped = lay(&net, &mesh, surface, ply.offset).ok_or_else(|| {
        format!(
            "the net of ply '{name}' closes no cell at its start {}: take a smaller `net_spacing` or another \
             `start`",
            millimetres([x, y])
        )
    })?;
    Ok(Done {
        mesh,
        quality,
        draped,
        start: [x, y],
        net_nodes: net.nodes().filter(|n| net.position(n.0).is_some()).count(),
        fibre_strain: fibre_strain(&net),
        stops: stops(&net),
        ply: ply.clone(),
    })
}

/// Largest strain of a side of a whole cell, by size.
fn fibre_strain(net: &Net) -> f64 {
    let mut most = 0.0f64;
    for (at, _) in net.nodes() {
        if net.shear(at).is_some() {
            let x = crate::net::corners(at).map(|c| net.position(c).unwrap_or_default());
            for k in 0..4 {
                most = most.max((distance(x[k], x[(k + 1) % 4]) / net.fabric.spacing - 1.0).abs());
            }
        }
    }
    most
}

fn write_bodies(
    host: &Host,
    scene: &Scene,
    tool: &ToolMesh,
    done: &[Done],
) -> Result<(), StepError> {
    let above = tool.bounds()[1][2] + scene.process.clearance();
    for d in done {
        let z = above + d.ply.offset;
        let flat: Vec<[f64; 3]> = d.mesh.points.iter().map(|q| [q[0], q[1], z]).collect();
        let cells = d.mesh.cells.as_flattened();
        let about = SheetBody {
            kind: d.ply.scene.kind,
            thickness: d.ply.material.thickness.si(),
            offset: d.ply.offset,
        };
        host.define_mesh(&d.ply.scene.name, &flat, 4, cells, &about)?;
    }
    let facets = tool.triangles.as_flattened();
    host.define_mesh("tool", &tool.points, 3, facets, &RigidBody::ATTRIBUTES)?;
    host.begin_frame(0.0)?;
    for d in done {
        let name = &d.ply.scene.name;
        host.write_points(name, &d.draped.points)?;
        let none = vec![0.0; d.mesh.cells.len()];
        let reached = d.draped.reached.iter().map(|r| f64::from(u8::from(*r)));
        let reached: Vec<f64> = reached.collect();
        let on = On::Cells;
        host.write_field(name, on, "shear_angle", 1, "rad", &d.draped.shear)?;
        host.write_field(name, on, "fibre_strain_1", 1, "1", &none)?;
        host.write_field(name, on, "fibre_strain_2", 1, "1", &none)?;
        host.write_field(name, on, "draped", 1, "1", &reached)?;
        if d.draped.reached.iter().any(|r| !r) {
            let why = d.draped.stopped.iter().map(|s| s.map_or(0.0, number));
            let why: Vec<f64> = why.collect();
            host.write_field(name, on, "drape_stop", 1, "1", &why)?;
        }
    }
    host.end_frame()
}

/// A reason in the field `drape_stop`; 0 is none.
fn number(why: Stop) -> f64 {
    match why {
        Stop::Locked => 1.0,
        Stop::Edge => 2.0,
        Stop::Bed => 3.0,
    }
}

fn sheet(d: &Done) -> Sheet {
    let (s, material) = (&d.ply.scene, &d.ply.material);
    let [first, second] = d.ply.fibres;
    Sheet {
        material: Some(material.name.clone()),
        areal_mass: Some(material.areal_mass.si()),
        over_shear: material.over_shear.map(Into::into),
        added_mass: Some(0.0),
        fibre_1: Some(first),
        fibre_2: Some(second),
        outline: Some(d.ply.blank.outline().to_vec()),
        holes: d.ply.blank.holes().to_vec(),
        start: Some(d.start),
        net_nodes: Some(d.net_nodes),
        ..Sheet::new(&s.name, s.kind, material.thickness.si(), d.ply.offset)
    }
}

/// One text per ply and reason.
fn warnings(p: &Parameters, d: &Done, unreached: usize) -> Vec<String> {
    let name = &d.ply.scene.name;
    let mut texts = Vec::new();
    if d.ply.blank.distance(d.start) > 0.0 {
        texts.push(format!(
            "ply '{name}': its net starts at {}, where the ply has no material, and runs across the gap as if it had; \
             give a `start` on the ply",
            millimetres(d.start)
        ));
    }
    if !d.ply.scene.regions.is_empty() {
        texts.push(format!(
            "ply '{name}': its `regions` count for nothing here: a pin-jointed net knows neither friction nor stitches; forming-explicit computes them"
        ));
    }
    if d.ply.scene.tied {
        texts.push(format!(
            "ply '{name}': it is tied to the ply below it, and its net does not know: each ply is draped by itself, so that the two may slide and shear \
             apart; forming-explicit computes ties"
        ));
    }
    let poor = d.quality.and_then(|q| q.warning());
    texts.extend(poor.map(|text| format!("ply '{name}': {text}")));
    if unreached == 0 {
        return texts;
    }
    let all = d.mesh.cells.len();
    let stopped = d
        .stops
        .iter()
        .map(|(why, count, first)| {
            let why = match why {
                Stop::Locked => format!(
                    "a cell could not be closed within the locking angle of {:.1} deg",
                    p.locking_angle.to_degrees()
                ),
                Stop::Edge => "the tool's surface ends".into(),
                Stop::Bed => "the ply reaches the machine bed".into(),
            };
            format!(
                "ply '{}': {why} at {count} nodes of the net, first at {} of the flat ply; the net does not reach \
                 {unreached} of {all} cells (field `draped`), which hang on as a plane",
                name,
                millimetres(*first)
            )
        });
    texts.extend(stopped);
    texts
}

/// What the artifact says of the drape.
fn forming(p: &Parameters, done: &[Done], elements: u64, of_tool: OfTool) -> Forming {
    Forming {
        scene: Some(p.scene.name.clone()),
        sheets: done.iter().map(sheet).collect(),
        contact_by_place: false,
        without_bed: p.scene.process.is_without_bed(),
        symmetry: None,
        element_size: p.element_size,
        net_spacing: Some(p.net_spacing.unwrap_or(0.25 * p.element_size)),
        zone: None,
        slower: None,
        time_step: None,
        cycles: None,
        element_cycles: None,
        elements,
        energy: None,
        penetration: None,
        overlap_bound: None,
        overlap_peak_bound: None,
        tool_field_error: [("tool".to_owned(), of_tool.field_error)].into(),
        depth: None,
        depth_bound: None,
        tool_placement: of_tool.placement,
        warnings: of_tool.texts,
    }
}

fn write_summary(
    host: &Host,
    p: &Parameters,
    done: &[Done],
    mut of_tool: OfTool,
    seconds: f64,
) -> Result<(), StepError> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let (mut area, mut covered, mut unreachable, mut elements) = (0.0, 0.0, 0, 0);
    for d in done {
        let areas = d.mesh.areas();
        let mut missed = 0;
        for (c, reached) in d.draped.reached.iter().enumerate() {
            area += areas[c];
            if *reached {
                covered += areas[c];
                low = low.min(d.draped.shear[c]);
                high = high.max(d.draped.shear[c]);
            } else {
                missed += 1;
            }
        }
        unreachable += missed;
        elements += d.mesh.cells.len();
        of_tool.texts.extend(warnings(p, d, missed));
    }
    if low > high {
        return Err(
            "the net reaches no whole cell of any ply; take a smaller `element_size` or another `start`"
                .into(),
        );
    }
    for w in &of_tool.texts {
        host.log(Log::Warn, w);
    }
    host.write_attributes(&forming(p, done, elements as u64, of_tool))?;
    let strain = done.iter().map(|d| d.fibre_strain).fold(0.0, f64::max);
    let nodes = done.iter().map(|d| d.net_nodes).sum::<usize>() as f64;
    host.result("shear_max", high, "rad")?;
    host.result("shear_min", low, "rad")?;
    host.result("fibre_strain_max", strain, "1")?;
    // A whole drape covers exactly all, however its areas were added.
    let coverage = if unreachable == 0 {
        1.0
    } else {
        covered / area
    };
    host.result("coverage", coverage, "1")?;
    host.result("unreachable_cells", unreachable as f64, "1")?;
    host.result("elements", elements as f64, "1")?;
    host.result("net_nodes", nodes, "1")?;
    host.measured("node_rate", nodes / seconds.max(1e-9), "1/s")
}
