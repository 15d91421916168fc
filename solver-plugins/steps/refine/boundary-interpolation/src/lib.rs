//! Step plugin `boundary-interpolation`: the fine meshes of a zone, and the motion of their cut edges from a
//! coarse forming run.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod coarse;
mod cut;
mod exchange;
mod grid;
mod histories;
mod late;
mod outlined;
mod part;
mod place;
mod pull;

pub use cut::Placed;
pub use grid::{Grid, film_grid, ply_grid};
pub use part::ply_part;

use coarse::{Pulls, Whole};
use exchange::{Exchange, Part};
use place::Place;

use plyflow_geometry::rectangle;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::spline_slopes;
use plyflow_model::artifact::{
    Boundary, Forming, MeshStudy, PlainBody, Rectangle, Sheet, Zone, Zones,
};
use plyflow_model::budget::{self, Wanted};
use plyflow_sdk::{Host, Input, Log, Meshes, Progress, Step, StepError, export_step};
use serde::Deserialize;

/// The step.
pub struct BoundaryInterpolation;

export_step!(BoundaryInterpolation);

#[derive(Deserialize)]
struct Parameters {
    element_size: f64,
    film_element_size: Option<f64>,
    film_margin: f64,
    finer: f64,
    slower: f64,
    start_time: Option<f64>,
    start_bend: Option<f64>,
    cut_stiffness: Option<f64>,
    exchanged: Vec<Part>,
}

/// A sheet of the zone with its motion.
struct Driven {
    sheet: Sheet,
    fine: Placed,
    /// `[f][k][3]` (m).
    position: Vec<f64>,
    /// `[f][k][3]`; plies only, films do not rotate.
    normal: Option<Vec<f64>>,
    start: Option<late::Start>,
    /// Of plies whose cut gives way.
    pull: Option<Pulls>,
    error: f64,
}

/// First frame and undeformed mesh may differ by this (m) before the step warns.
const START_TOLERANCE: f64 = 1e-4;

impl Step for BoundaryInterpolation {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let zone = own_zone(host)?;
        let p = parameters(host, &zone)?;
        let bounds = zone.bounds;
        let input = host.input("formed")?;
        let run: Forming = host.attributes(&input)?;
        let meshes = host.meshes(&input)?;
        check_frames(&input, meshes.times.len())?;
        let listed = &run.sheets;
        if p.exchanged.contains(&Part::Forces) && p.cut_stiffness.is_none() {
            return Err("`exchanged` names `forces`, and without `cut_stiffness` cuts are placed and nothing pulls at them. Give `cut_stiffness`, or leave `forces` out".into());
        }
        let exchange = Exchange::read(host, &p.exchanged, &meshes.times)?;
        let joint = film_bounds(host, &input, &meshes, listed)?;
        let first = first_frame(host, &input, &meshes, listed, bounds, &p)?;
        let mut sheets = Vec::new();
        for (i, sheet) in listed.iter().enumerate() {
            host.check_cancelled()?;
            host.progress(&Progress {
                fraction: i as f64 / listed.len() as f64,
                phase: "reading the coarse motion",
                ..Default::default()
            });
            let runs = (&input, &meshes, exchange.as_ref());
            sheets.extend(drive(host, runs, sheet, (bounds, joint), first, &p)?);
        }
        if sheets.is_empty() {
            return Err(nothing_in(&input.step, &zone).into());
        }
        if !sheets.iter().any(|s| s.sheet.is_ply()) {
            return Err(too_small(&input.step, &zone, p.element_size).into());
        }
        // The run's own time goes on as much more slowly as it does.
        let own: Vec<f64> = meshes.times.iter().map(|t| p.slower * t).collect();
        write(host, &own, first, &sheets)?;
        let loads = exchange.as_ref().filter(|e| e.has(Part::Loads));
        let loads = loads.map_or(&input, |e| &e.input);
        histories::write(host, loads, &meshes.times[first..])?;
        histories::write_ways(host, loads, &meshes, meshes.times[first], p.slower)?;
        let times = &own[first..];
        let error = sheets.iter().map(|s| s.error).fold(0.0, f64::max);
        host.write_attributes(&Boundary {
            zone,
            scene: run.scene,
            frames: times.len(),
            start_time: times[0],
            slower: Some(p.slower).filter(|s| *s != 1.0),
            element_size: p.element_size,
            film_element_size: p.film_element_size.unwrap_or(p.element_size),
            sheets: sheets.iter().map(|s| s.sheet.clone()).collect(),
            interpolation_error: error,
        })?;
        let count = |get: fn(&Driven) -> usize| sheets.iter().map(get).sum::<usize>() as f64;
        host.result("start_time", times[0], "s")?;
        host.result("interpolation_error", error, "m")?;
        host.result("elements", count(|s| s.fine.grid.cells.len() / 4), "1")?;
        host.result("driven_nodes", count(|s| s.fine.driven_nodes.len()), "1")
    }
}

/// The parameters, with the element sizes that are taken in a zone.
fn parameters(host: &Host, zone: &Zone) -> Result<Parameters, StepError> {
    let mut p: Parameters = host.parameters()?;
    if let Some(advised) = advised_size(host, zone)? {
        p.element_size = bounded_size(host, zone, advised, p.element_size)?;
    }
    p.element_size /= p.finer;
    p.film_element_size = p.film_element_size.map(|size| size / p.finer);
    Ok(p)
}

/// Why a zone has no ply.
fn too_small(step: &str, zone: &Zone, element_size: f64) -> String {
    let millimetres = |v: f64| (1e6 * v).round() / 1e3;
    let name = &zone.name;
    let [x0, y0, x1, y1] = zone.bounds.map(millimetres);
    let size = millimetres(element_size);
    format!(
        "no ply of '{step}' has a whole element of {size} mm in zone {name} (x {x0} to {x1} mm, y {y0} to {y1} mm); expected a zone that is at least \
         one element wide and lies on a ply. Draw it larger (`boxes` of zone-extraction), or take a smaller `element_size`"
    )
}

/// The frame of the coarse run with which the fine run begins.
fn first_frame(
    host: &Host,
    input: &Input,
    meshes: &Meshes,
    sheets: &[Sheet],
    zone: Rectangle,
    p: &Parameters,
) -> Result<usize, StepError> {
    let first = match (p.start_time, p.start_bend) {
        (Some(_), Some(_)) => return Err(
            "`start_time` and `start_bend` are both given; expected one of them: a time, or the bend by which each zone finds its own"
                .into(),
        ),
        (Some(time), None) => late::frame_at(&meshes.times, time, &input.step)?,
        (None, Some(bend)) => {
            let mut bends = Vec::new();
            for ply in sheets.iter().filter(|s| s.is_ply()) {
                let body = meshes.body(&ply.name)?;
                bends.push(late::sharpest_bends(host, input, body, zone, meshes.times.len())?);
            }
            late::frame_before_bend(&bends, bend)
        }
        (None, None) => 0,
    };
    Ok(late::after_a_late_beginning(
        &meshes.times,
        first,
        &input.step,
    )?)
}

/// The zone at the step's own place in the fan-out over the zones.
fn own_zone(host: &Host) -> Result<Zone, StepError> {
    let (input, formed) = (host.input("zones")?, host.input("formed")?);
    let Zones { zones, .. } = host.attributes(&input)?;
    let item = host.item()?;
    let run: Forming = host.attributes(&formed)?;
    let place = match place::of_zone(&item, &input.item, &formed.item) {
        Place::One(index) => Some(index),
        // The coarse run has all of the places: one of them is the zone's when it is the run of a zone.
        Place::None => item.last().map(|&i| i as usize).filter(|&i| {
            let own = run.zone.as_ref().map(|z| &z.name);
            own.is_some() && zones.get(i).map(|z| &z.name) == own
        }),
        Place::Several if zones.len() == 1 => None,
        Place::Several => {
            return Err(format!(
                "which place of this step's item {item:?} is that of the zone cannot be told: it is fanned out over several collections of which '{}' (item {:?}) has \
                 too few. Fan it out over the zones alone, or take `formed` from a run that is fanned out over all the others, and name the zone last, as in \
                 `for_each: {{pass: feedback, zone: {}}}` with the coarse run of that pass",
                formed.step, formed.item, input.step
            )
            .into());
        }
    };
    let index = match place {
        Some(index) => index,
        None if zones.len() == 1 => 0,
        None => {
            let (step, n) = (&input.step, zones.len());
            let remedy = if item.is_empty() {
                format!("give it `for_each: {{zone: {step}}}`")
            } else {
                let over = &formed.step;
                format!(
                    "all places of its item {item:?} are those of '{over}'. Add `zone: {step}` to its `for_each`, as the last"
                )
            };
            return Err(format!(
                "'{step}' holds {n} zones and this step is not fanned out over them; {remedy}"
            )
            .into());
        }
    };
    zones.get(index).cloned().ok_or_else(|| {
        format!(
            "zone {index} is asked for, but '{}' holds {}",
            input.step,
            zones.len()
        )
        .into()
    })
}

/// An advised element size, or the least that may be taken (m); tells which.
fn bounded_size(host: &Host, zone: &Zone, advised: f64, least: f64) -> Result<f64, StepError> {
    if advised < least {
        let name = &zone.name;
        let [advised, least] = [advised, least].map(|v| 1e3 * v);
        let text = format!(
            "zone {name}: {advised:.3} mm are advised, finer than `element_size`: {least} mm are taken, and the error will be larger than aimed at"
        );
        host.log(Log::Warn, &text);
    }
    let size = advised.max(least);
    host.result("element_size", size, "m")?;
    Ok(size)
}

/// The element size (m) that a mesh study advises for a zone, if there is one.
fn advised_size(host: &Host, zone: &Zone) -> Result<Option<f64>, StepError> {
    let studies = host.inputs_of("meshes")?;
    let Some(study) = studies.first() else {
        return Ok(None);
    };
    let MeshStudy { zones, .. } = host.attributes(study)?;
    let own = zones.iter().find(|z| z.name == zone.name);
    if let Some(told) = own.map(|z| z.bounds).filter(|b| !zone.has_box(*b)) {
        return Err(format!(
            "'{}' advises an element size for zone {} with the box {told:?} m; here it has the box {:?} m. Take a study of the runs of this list of zones",
            study.step, zone.name, zone.bounds
        )
        .into());
    }
    match own.map(|z| z.element_size) {
        Some(size) if size > 0.0 => Ok(Some(size)),
        _ => Err(format!(
            "'{}' advises no element size for zone {}; it must compare runs of this zone, not of the whole scene",
            study.step, zone.name
        )
        .into()),
    }
}

/// The part of a sheet in the zone and its motion; `None` when the sheet does not reach into it. `runs`: the coarse run, and what another gives
/// in its place.
fn drive(
    host: &Host,
    (input, meshes, exchange): (&Input, &Meshes, Option<&Exchange>),
    sheet: &Sheet,
    (zone, joint): (Rectangle, Rectangle),
    first: usize,
    p: &Parameters,
) -> Result<Option<Driven>, StepError> {
    let whole = Whole::read(host, input, meshes, sheet)?;
    let within = if sheet.is_ply() {
        bounds(&whole.points)
    } else {
        joint
    };
    let Some(grid) = part(sheet, within, zone, p)? else {
        return Ok(None);
    };
    let own = whole.placed(grid)?;
    let other = exchange.map(|e| e.placed(host, &sheet.name, own.fine.grid.clone()));
    let other = other.transpose()?;
    let from = |part| match &other {
        Some(other) if exchange.is_some_and(|e| e.has(part)) => other,
        _ => &own,
    };
    let mut motion = own.follow(host)?;
    if let (Some(exchange), Some(other)) = (exchange, &other) {
        exchange.mix(&mut motion, &other.follow(host)?, &own, first);
    }
    let held = p.cut_stiffness.filter(|_| sheet.is_ply());
    let pull = held
        .map(|s| from(Part::Forces).pulls(host, s))
        .transpose()?;
    let begin = from(Part::Start).start(host, first, p.slower)?;
    if begin.is_none() {
        warn_of_a_jump(host, &sheet.name, motion.start);
    }
    Ok(Some(Driven {
        sheet: sheet.clone(),
        fine: own.fine,
        position: motion.position,
        normal: motion.normal,
        start: begin,
        pull,
        error: motion.error,
    }))
}

/// That the first frame lies `start` (m) from the undeformed mesh, if that is far.
fn warn_of_a_jump(host: &Host, name: &str, start: f64) {
    if start > START_TOLERANCE {
        let text = format!(
            "sheet '{name}': the first frame lies {:.2} mm from the undeformed mesh; the local run starts with a jump",
            1e3 * start
        );
        host.log(Log::Warn, &text);
    }
}

/// Where both films are (m): beyond the line along which they are joined one sheet stands for both, which no film of a zone can.
fn film_bounds(
    host: &Host,
    input: &Input,
    meshes: &Meshes,
    listed: &[Sheet],
) -> Result<Rectangle, StepError> {
    let mut common = [
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
        f64::INFINITY,
        f64::INFINITY,
    ];
    for sheet in listed.iter().filter(|s| !s.is_ply()) {
        let body = meshes.body(&sheet.name)?;
        let of = bounds(&host.mesh(input, body)?.0);
        for k in 0..2 {
            common[k] = common[k].max(of[k]);
            common[k + 2] = common[k + 2].min(of[k + 2]);
        }
    }
    Ok(common)
}

/// Whether the elements of a sheet in a zone are not too many to be made.
fn allow(zone: Rectangle, sheet: &str, parameter: &str, size: f64) -> Result<(), String> {
    budget::allow(Wanted {
        what: &format!("the mesh of '{sheet}' in the zone"),
        of: "elements",
        count: (zone[2] - zone[0]) * (zone[3] - zone[1]) / (size * size),
        most: budget::MOST_ELEMENTS,
        bytes: budget::ELEMENT_BYTES,
        parameter,
        size,
    })
}

/// The part of the mesh of a sheet, of these `bounds` (m) when nothing else is told, in a zone; `None` where it does not reach.
fn part(
    sheet: &Sheet,
    bounds: Rectangle,
    zone: Rectangle,
    p: &Parameters,
) -> Result<Option<Grid>, StepError> {
    let (parameter, size) = match p.film_element_size {
        Some(size) if !sheet.is_ply() => ("film_element_size", size),
        _ => ("element_size", p.element_size),
    };
    allow(zone, &sheet.name, parameter, size)?;
    if !sheet.is_ply() {
        return Ok(film_grid(zone, bounds, p.film_margin, size));
    }
    let outline = sheet.outline.clone().unwrap_or_else(|| corners(bounds));
    let grid = ply_part(zone, &outline, &sheet.holes, p.element_size);
    Ok(grid.map_err(|why| {
        format!(
            "the zone at {zone:?} m crosses the edge of ply '{}', which its elements are to follow: {why}. Take a smaller `element_size`, or draw a zone inside of \
             the ply (`boxes` of zone-extraction)",
            sheet.name
        )
    })?)
}

fn bounds(points: &[Vec3]) -> Rectangle {
    rectangle::around(points.iter().map(|p| [p[0], p[1]]))
}

fn corners(b: Rectangle) -> Vec<[f64; 2]> {
    vec![[b[0], b[1]], [b[2], b[1]], [b[2], b[3]], [b[0], b[3]]]
}

/// Writes the motion from the frame `first` on.
fn write(host: &Host, times: &[f64], first: usize, sheets: &[Driven]) -> Result<(), StepError> {
    let f = times.len() - first;
    host.write_f64("time", &[f], "s", &times[first..])?;
    sheets
        .iter()
        .try_for_each(|s| write_sheet(host, times, first, s))
}

fn nothing_in(step: &str, zone: &Zone) -> String {
    let (name, bounds) = (&zone.name, zone.bounds);
    format!("no sheet of '{step}' reaches into zone {name} at {bounds:?} m")
}

/// That there is a motion.
fn check_frames(input: &Input, n: usize) -> Result<(), StepError> {
    if n < 2 {
        return Err(format!(
            "'{}' has {n} frames; a motion needs at least 2. A kinematic drape is one state and cannot drive \
             a local run: take `formed` from a step such as forming-explicit",
            input.step
        )
        .into());
    }
    Ok(())
}

/// Mesh and motion of a sheet.
fn write_sheet(host: &Host, times: &[f64], first: usize, s: &Driven) -> Result<(), StepError> {
    let f = times.len() - first;
    let (k, n) = (s.fine.driven_nodes.len(), s.fine.points.len());
    let at = |what: &str| format!("{}/{what}", s.sheet.name);
    host.define_mesh(
        &s.sheet.name,
        &s.fine.points,
        4,
        &s.fine.grid.cells,
        &PlainBody {},
    )?;
    host.write_u32(&at("driven_nodes"), &[k], &s.fine.driven_nodes)?;
    let motion = [
        ("position", "m", "velocity", "m/s", Some(&s.position)),
        ("normal", "1", "normal_rate", "1/s", s.normal.as_ref()),
    ];
    for (what, unit, rate, rate_unit, values) in motion {
        let Some(values) = values else { continue };
        let slopes = spline_slopes(times, values, 3 * k);
        let [values, slopes] = [values, &slopes].map(|v| &v[3 * k * first..]);
        host.write_f64(&at(what), &[f, k, 3], unit, values)?;
        host.write_f64(&at(rate), &[f, k, 3], rate_unit, slopes)?;
    }
    if let Some(pull) = &s.pull {
        host.write_f64(&at("pull"), &[f, k, 3], "N", &pull.force[3 * k * first..])?;
        host.write_f64(&at("stiffness"), &[k], "N/m", &pull.stiffness)?;
    }
    if let Some(start) = &s.start {
        let shape = [start.states, n, 3];
        host.write_f64(&at("path"), &shape, "m", &start.path)?;
        host.write_f64(&at("start_velocity"), &[n, 3], "m/s", &start.velocity)?;
    }
    Ok(())
}
