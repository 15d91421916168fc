//! Step plugin `zone-feedback`: the motion of coarse nodes deep inside of zones, as the fine runs there have it.
//!
//! Driven by it, a coarse run feels what a wrinkle does to its surroundings (a ply that buckles draws in more), and its motion
//! drives the cuts of the next fine runs: overlapping Schwarz iterations (Schwarz 1870; Toselli and Widlund, Domain
//! Decomposition Methods, 2005, ch. 1), the overlap being the strip between the cuts and the driven nodes.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

use plyflow_geometry::vec3::{Vec3, add, distance, scale, sub};
use plyflow_geometry::{Location, QuadLocator, rectangle};
use plyflow_mechanics::history::{hermite, locate, spline_slopes};
use plyflow_model::artifact::{Feedback, Forming, PlainBody, Zone, which_count};
use plyflow_sdk::{Host, Input, Log, Meshes, Progress, Step, StepError, export_step};
use plyflow_surface::{SmoothSheet, StandOff, Topology};
use serde::Deserialize;

/// The step.
pub struct ZoneFeedback;

export_step!(ZoneFeedback);

#[derive(Deserialize)]
struct Parameters {
    overlap: Option<f64>,
    tolerance: Option<f64>,
}

/// The one item of the collection when another pass is to be run.
const AGAIN: &str = "again";

/// How many coarse elements the overlap is wide when it is not told.
const OVERLAP: f64 = 2.0;
/// Places nearer than this are the same (m).
const SAME_PLACE: f64 = 1e-6;
/// Share of the coarse run's time in which nodes go over from its motion to that of a zone that begins late.
const LEADING_OVER: f64 = 0.05;

struct Fine {
    input: Input,
    meshes: Meshes,
    zone: Zone,
}

/// The driven nodes of one ply.
#[derive(Default)]
struct Driven {
    /// With their positions by frame (`[f]`, m).
    nodes: Vec<(u32, Vec<Vec3>)>,
    /// By node: distance from where the coarse run has it at the end (m).
    change: Vec<f64>,
}

impl Step for ZoneFeedback {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let formed = host.input("formed")?;
        let coarse: Forming = host.attributes(&formed)?;
        check(&formed, &coarse)?;
        let overlap = p.overlap.unwrap_or(OVERLAP * coarse.element_size);
        if overlap <= 0.0 {
            let step = &formed.step;
            return Err(format!("'{step}' does not tell its element size; give `overlap`").into());
        }
        let meshes = host.meshes(&formed)?;
        if meshes.times.len() < 2 {
            let (step, n) = (&formed.step, meshes.times.len());
            return Err(format!("'{step}' has {n} frames; a motion needs at least 2").into());
        }
        let fine = fine_runs(host)?;
        host.write_f64("time", &[meshes.times.len()], "s", &meshes.times)?;
        let mut change = Vec::new();
        for sheet in coarse.plies() {
            host.progress(&Progress {
                phase: "reading the fine motion",
                ..Default::default()
            });
            let driven = drive(host, &formed, &meshes, &sheet.name, &fine, overlap)?;
            write(host, &formed, &meshes, &sheet.name, &driven)?;
            change.extend(driven.change);
        }
        if change.is_empty() {
            // Zones that are too small for the overlap are worth a warning, none at all is not.
            let level = if fine.is_empty() {
                Log::Info
            } else {
                Log::Warn
            };
            host.log(
                level,
                "no coarse node lies deep enough in a zone: nothing is fed back; a smaller `overlap` or larger zones would",
            );
        }
        host.write_attributes(&Feedback {
            zone: None,
            scene: coarse.scene,
            frames: meshes.times.len(),
            element_size: coarse.element_size,
            overlap,
            fed_back: fine.iter().map(|f| f.zone.name.clone()).collect(),
        })?;
        let squares: f64 = change.iter().map(|c| c * c).sum();
        let mean = (squares / change.len().max(1) as f64).sqrt();
        host.result("driven_nodes", change.len() as f64, "1")?;
        host.result("feedback_change", mean, "m")?;
        let largest = change.iter().copied().fold(0.0, f64::max);
        host.result("feedback_change_max", largest, "m")?;
        let at_rest = change.is_empty() || p.tolerance.is_some_and(|t| mean <= t);
        if p.tolerance.is_some() && (!change.is_empty() || fine.is_empty()) {
            host.result("converged", f64::from(u8::from(at_rest)), "1")?;
        }
        let again: Vec<String> = (!at_rest).then(|| AGAIN.to_owned()).into_iter().collect();
        host.collection(&again)
    }
}

fn check(formed: &Input, coarse: &Forming) -> Result<(), StepError> {
    let step = &formed.step;
    if coarse.zone.is_some() {
        return Err(format!(
            "`formed`: '{step}' is the run of a zone; the coarse run of the whole scene is expected"
        )
        .into());
    }
    if coarse.symmetry.as_ref().is_some_and(|s| !s.is_empty()) {
        let text = format!(
            "'{step}' was computed beside mirror planes; feeding back is for scenes without `symmetry`. Leave it out of the scene"
        );
        return Err(text.into());
    }
    Ok(())
}

fn fine_runs(host: &Host) -> Result<Vec<Fine>, StepError> {
    let mut list = Vec::new();
    for input in host.inputs_of("local")? {
        let run: Forming = host.attributes(&input)?;
        let zone = run.zone.ok_or_else(|| {
            let step = &input.step;
            format!("`local`: '{step}' is no run of a zone (its attribute `zone` is null)")
        })?;
        if let Some(slower) = run.slower {
            let step = &input.step;
            return Err(format!(
                "`local`: the process of '{step}' goes on {slower} times more slowly than that of the coarse run; expected the same times, so that its motion can drive \
                 coarse nodes. Leave out `slower` of its boundary-interpolation"
            )
            .into());
        }
        let meshes = host.meshes(&input)?;
        if meshes.times.len() < 2 {
            let (step, n) = (&input.step, meshes.times.len());
            return Err(format!("'{step}' has {n} frames; a motion needs at least 2").into());
        }
        list.push(Fine {
            input,
            meshes,
            zone,
        });
    }
    let (list, left_out) = current(list);
    if !left_out.is_empty() {
        let names = left_out
            .iter()
            .map(|f| format!("'{}' (zone {})", f.input.step, f.zone.name));
        let text = format!(
            "not fed back, since their zones were drawn again or run again: {}",
            names.collect::<Vec<_>>().join(", ")
        );
        host.log(Log::Info, &text);
    }
    Ok(list)
}

/// The runs that count, in the order in which they are given, and the others ([`which_count`]).
fn current(list: Vec<Fine>) -> (Vec<Fine>, Vec<Fine>) {
    let zones: Vec<&Zone> = list.iter().map(|f| &f.zone).collect();
    let mut counts = which_count(&zones).into_iter();
    list.into_iter().partition(|_| counts.next() == Some(true))
}

/// Motion of the nodes of a coarse ply that lie deep in a zone, at the coarse frames.
///
/// They lie off the fine run's surface by as much as coarse elements must that are as long as the material ([`StandOff`]). Until a zone begins
/// they go as they did in the coarse run.
fn drive(
    host: &Host,
    formed: &Input,
    meshes: &Meshes,
    ply: &str,
    fine: &[Fine],
    overlap: f64,
) -> Result<Driven, StepError> {
    let body = meshes.body(ply)?;
    let (points, cells) = host.mesh(formed, body)?;
    let topology = Topology::new(points.len(), 4, &cells);
    let frames = 0..meshes.times.len();
    let own: Vec<Vec<Vec3>> = frames
        .map(|f| host.frame_points(formed, body, f))
        .collect::<Result<_, _>>()?;
    let mut taken = vec![false; points.len()];
    let mut driven = Driven::default();
    for run in fine {
        host.check_cancelled()?;
        // A ply need not reach into every zone.
        let Some(found) = on_fine(host, &points, &meshes.times, ply, run)? else {
            continue;
        };
        let stand_off = StandOff::new(&points, &topology, found.cell_area);
        let deep = |(i, _): &(u32, Vec<Vec3>)| {
            !taken[*i as usize] && run.zone.holds(&points[*i as usize], overlap)
        };
        let mut ways: Vec<(u32, Vec<Vec3>)> =
            found.ways.iter().filter(|w| deep(w)).cloned().collect();
        let begins = run.meshes.times[0];
        let leading = LEADING_OVER * (meshes.times[meshes.times.len() - 1] - meshes.times[0]);
        for (f, &time) in meshes.times.iter().enumerate() {
            let share = if begins > meshes.times[0] {
                let s = ((time - begins) / leading).clamp(0.0, 1.0);
                s * s * (3.0 - 2.0 * s)
            } else {
                1.0
            };
            let mut now = own[f].clone();
            for (i, way) in &found.ways {
                now[*i as usize] = way[f];
            }
            let off = stand_off.to_other(&SmoothSheet::new(now, &cells));
            for (i, way) in &mut ways {
                let (before, fine) = (own[f][*i as usize], sub(way[f], off[*i as usize]));
                way[f] = add(before, scale(sub(fine, before), share));
            }
        }
        for (i, way) in ways {
            taken[i as usize] = true;
            let last = meshes.times.len() - 1;
            driven
                .change
                .push(distance(way[last], own[last][i as usize]));
            driven.nodes.push((i, way));
        }
    }
    driven.nodes.sort_by_key(|(i, _)| *i);
    Ok(driven)
}

/// Where coarse nodes lie on a ply of a fine run.
struct OnFine {
    /// Nodes of the coarse ply in the zone, with their places on the fine ply's smooth surface by coarse frame (`[f]`, m); before the fine run
    /// begins where it begins.
    ways: Vec<(u32, Vec<Vec3>)>,
    /// Of the fine mesh, in the mean (m2).
    cell_area: f64,
}

/// Coarse nodes at `points` (`[n]` m, flat) on a fine run's `ply`, at `times` (s); `None` without that ply.
fn on_fine(
    host: &Host,
    points: &[Vec3],
    times: &[f64],
    ply: &str,
    run: &Fine,
) -> Result<Option<OnFine>, StepError> {
    let Ok(body) = run.meshes.body(ply) else {
        return Ok(None);
    };
    let (flat, cells) = host.mesh(&run.input, body)?;
    let Some(locator) = QuadLocator::new(&flat, &cells) else {
        return Ok(None);
    };
    let within = |(i, at): (usize, &Vec3)| {
        let inside = run.zone.holds(at, 0.0);
        let place = inside.then(|| locator.locate(at[0], at[1], SAME_PLACE))?;
        Some((i as u32, place?))
    };
    let places: Vec<(u32, Location)> = points.iter().enumerate().filter_map(within).collect();
    let mut values = Vec::new();
    for frame in 0..run.meshes.times.len() {
        let now = host.frame_points(&run.input, body, frame)?;
        let sheet = SmoothSheet::new(now, &cells);
        values.extend(places.iter().flat_map(|(_, at)| sheet.at(at)));
    }
    let motion = resampled(&run.meshes.times, &values, times, 3 * places.len());
    let way = |(k, (i, _)): (usize, &(u32, Location))| {
        let at = |f: usize| [0, 1, 2].map(|d| motion[(f * places.len() + k) * 3 + d]);
        (*i, (0..times.len()).map(at).collect())
    };
    let [x0, y0, x1, y1] = rectangle::around(flat.iter().map(|p| [p[0], p[1]]));
    Ok(Some(OnFine {
        ways: places.iter().enumerate().map(way).collect(),
        cell_area: (x1 - x0) * (y1 - y0) / (cells.len() / 4) as f64,
    }))
}

/// Values (`[f][columns]`) known at `times` by their C2 spline at other times; beyond the ends those of the ends.
fn resampled(times: &[f64], values: &[f64], at: &[f64], columns: usize) -> Vec<f64> {
    let slopes = spline_slopes(times, values, columns);
    let mut out = Vec::with_capacity(at.len() * columns);
    for &t in at {
        let (i, s) = locate(times, t);
        let w = hermite(s, times[i + 1] - times[i]);
        let row = |list: &[f64], i: usize, c: usize| list[i * columns + c];
        out.extend((0..columns).map(|c| {
            w[0] * row(values, i, c)
                + w[1] * row(values, i + 1, c)
                + w[2] * row(&slopes, i, c)
                + w[3] * row(&slopes, i + 1, c)
        }));
    }
    out
}

/// Writes one ply as boundary artifacts hold it.
fn write(
    host: &Host,
    formed: &Input,
    meshes: &Meshes,
    ply: &str,
    driven: &Driven,
) -> Result<(), StepError> {
    let (points, cells) = host.mesh(formed, meshes.body(ply)?)?;
    host.define_mesh(ply, &points, 4, &cells, &PlainBody {})?;
    let (f, k) = (meshes.times.len(), driven.nodes.len());
    let nodes: Vec<u32> = driven.nodes.iter().map(|(i, _)| *i).collect();
    host.write_u32(&format!("{ply}/driven_nodes"), &[k], &nodes)?;
    let frames = 0..f;
    let position: Vec<f64> = frames
        .flat_map(|frame| driven.nodes.iter().flat_map(move |(_, way)| way[frame]))
        .collect();
    let velocity = spline_slopes(&meshes.times, &position, 3 * k);
    host.write_f64(&format!("{ply}/position"), &[f, k, 3], "m", &position)?;
    host.write_f64(&format!("{ply}/velocity"), &[f, k, 3], "m/s", &velocity)
}
