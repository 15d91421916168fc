//! The cut between coarse and fine: the work that passes through it in either run, and how far its influence reaches into a zone.

use crate::models::{Model, bounds_in_whole, bounds_of};
use plyflow_defects::{Ply, distance_at};
use plyflow_geometry::vec3::{Vec3, distance, dot, sub};
use plyflow_geometry::{Location, QuadLocator};
use plyflow_model::artifact::{Cut, Layer, Passage, Rectangle, Role, Strip, Work, Zone};
use plyflow_sdk::{BodyInfo, Host, Meshes, StepError};
use plyflow_surface::traction;

/// How far inside of the cut the material is looked at that pulls at it, over the zone's own element size.
const INSIDE: f64 = 0.01;
/// Fields that hold S11, S22, S12 (N/m).
const FORCES: [&str; 3] = ["membrane_force_1", "membrane_force_2", "membrane_force_12"];

/// A piece of the cut.
struct Piece {
    /// Where, just inside (m).
    at: [f64; 2],
    /// Outward normal in the flat ply.
    normal: [f64; 2],
    /// (m).
    length: f64,
}

/// The cut of a ply that fills `around` (m) in pieces of at most `size` (m). `cuts`: see [`Zone::cuts`].
fn pieces(zone: &Zone, cuts: [bool; 4], around: Rectangle, size: f64) -> Vec<Piece> {
    let mut b = zone.bounds;
    for d in 0..2 {
        b[d] = b[d].max(around[d]);
        b[d + 2] = b[d + 2].min(around[d + 2]);
    }
    let mut list = Vec::new();
    for side in (0..4).filter(|s| cuts[*s]) {
        // Left and right are lines of constant x, bottom and top of constant y.
        let (fixed, along, end) = (side / 2, 1 - side / 2, side % 2);
        let outward = if end == 0 { -1.0 } else { 1.0 };
        let long = b[along + 2] - b[along];
        let count = (long / size).ceil().max(1.0) as usize;
        for k in 0..count {
            let (mut at, mut normal) = ([0.0; 2], [0.0; 2]);
            at[fixed] = b[fixed + 2 * end] - outward * INSIDE * size;
            at[along] = b[along] + long * (k as f64 + 0.5) / count as f64;
            normal[fixed] = outward;
            list.push(Piece {
                at,
                normal,
                length: long / count as f64,
            });
        }
    }
    list
}

/// A ply of a run at one frame, at the pieces of the cut.
struct State {
    place: Vec<Vec3>,
    traction: Vec<Vec3>,
}

fn state(
    host: &Host,
    model: &Model,
    ply: &Ply,
    body: &BodyInfo,
    frame: usize,
    cut: &[(Piece, Location)],
) -> Result<State, StepError> {
    let points = host.frame_points(&model.input, body, frame)?;
    let mut forces = Vec::with_capacity(3);
    for name in FORCES {
        forces.push(host.frame_field(&model.input, body, frame, name)?);
    }
    let laid = &model.laid[&ply.name];
    let pull = |(piece, at): &(Piece, Location)| {
        let then = at.nodes.map(|i| ply.undeformed[i as usize]);
        let now = at.nodes.map(|i| points[i as usize]);
        let s = [0, 1, 2].map(|k| forces[k][at.cell]);
        traction(then, now, s, laid.axis_in_cell(&then), piece.normal).map(|t| t * piece.length)
    };
    Ok(State {
        place: cut.iter().map(|(_, at)| at.interpolate(&points)).collect(),
        traction: cut.iter().map(pull).collect(),
    })
}

/// Work through the cut of a ply in one run from the time `begin` (s) on (trapezoids over its frames); `None` when the run does not hold membrane forces or
/// does not cover the cut.
fn work(
    host: &Host,
    model: &Model,
    meshes: &Meshes,
    ply: &Ply,
    (zone, cuts): (&Zone, [bool; 4]),
    size: f64,
    begin: f64,
) -> Result<Option<Work>, StepError> {
    let body = meshes.body(&ply.name)?;
    let known = |name: &&str| body.fields.iter().any(|f| f.name == **name);
    let (_, cells) = ply.topology.connectivity();
    let locator = QuadLocator::new(&ply.undeformed, cells);
    let (true, true, Some(locator)) = (
        FORCES.iter().all(known),
        model.laid.contains_key(&ply.name),
        locator,
    ) else {
        return Ok(None);
    };
    let mut cut = Vec::new();
    for piece in pieces(zone, cuts, bounds_of(ply), size) {
        let Some(place) = locator.locate(piece.at[0], piece.at[1], 1e-6) else {
            return Ok(None);
        };
        cut.push((piece, place));
    }
    let mut sum = Work::default();
    let mut before: Option<State> = None;
    let first = meshes.times.partition_point(|t| *t < begin - 1e-9);
    for frame in first..meshes.times.len() {
        host.check_cancelled()?;
        let now = state(host, model, ply, body, frame, &cut)?;
        if let Some(old) = &before {
            for k in 0..cut.len() {
                let way = sub(now.place[k], old.place[k]);
                let part = 0.5 * (dot(old.traction[k], way) + dot(now.traction[k], way));
                sum.net += part;
                sum.gross += part.abs();
            }
        }
        before = Some(now);
    }
    Ok(Some(sum))
}

/// Work through the cuts of all zones, by zone and ply.
///
/// # Errors
/// When a run cannot be read.
pub fn passages(host: &Host, models: &[Model], zones: &[Zone]) -> Result<Vec<Passage>, StepError> {
    let Some(global) = models.iter().find(|m| m.role == Role::Global) else {
        return Ok(Vec::new());
    };
    let whole = host.meshes(&global.input)?;
    let mut list = Vec::new();
    for local in models.iter().filter(|m| m.role == Role::Local) {
        let Some(zone) = local.zone.map(|z| &zones[z]) else {
            continue;
        };
        let part = host.meshes(&local.input)?;
        // A run that does not tell its element size is cut as finely as the zone is small.
        let [x0, y0, x1, y1] = zone.bounds;
        let size = if local.element_size > 0.0 {
            local.element_size
        } else {
            0.05 * (x1 - x0).min(y1 - y0)
        };
        for ply in &local.plies {
            let Some(other) = global.plies.iter().find(|p| p.name == ply.name) else {
                continue;
            };
            // A local run may begin late; where it goes on more slowly its times are stretched.
            let begin = part.times.first().copied().unwrap_or(0.0);
            let begun = begin / local.slower;
            let cuts = zone.cuts(bounds_in_whole(models, &ply.name), bounds_of(ply));
            let cut = (zone, cuts);
            let fine = work(host, local, &part, ply, cut, size, begin)?;
            let coarse = work(host, global, &whole, other, cut, size, begun)?;
            if let (Some(local), Some(global)) = (fine, coarse) {
                list.push(Passage {
                    zone: zone.name.clone(),
                    ply: ply.name.clone(),
                    global,
                    local,
                });
            }
        }
    }
    Ok(list)
}

/// Writes the works by zone (J), and by how much they differ over what passes either way in the global run.
fn write_works(host: &Host, passages: &[Passage], zones: &[Zone]) -> Result<(), StepError> {
    for zone in zones {
        let of = |get: fn(&Passage) -> f64| -> f64 {
            let own = passages.iter().filter(|p| p.zone == zone.name);
            own.map(get).fold(0.0, |sum, v| sum + v)
        };
        if !passages.iter().any(|p| p.zone == zone.name) {
            continue;
        }
        let (local, global) = (of(|p| p.local.net), of(|p| p.global.net));
        host.result(&format!("cut_work.{}", zone.name), local, "J")?;
        host.result(&format!("cut_work.{}.global", zone.name), global, "J")?;
        let gross = of(|p| p.global.gross);
        if gross > 0.0 {
            let error = (local - global).abs() / gross;
            host.result(&format!("cut_work_error.{}", zone.name), error, "1")?;
        }
    }
    Ok(())
}

/// What is added up for a strip.
#[derive(Clone, Copy, Default)]
struct Sums {
    position: f64,
    nodes: usize,
    standing_off: f64,
    judged: usize,
}

/// Strips one element of the global run wide, by zone; none without a reference.
pub fn layers(models: &[Model], zones: &[Zone]) -> Vec<Layer> {
    let find = |role| models.iter().find(|m| m.role == role);
    let (Some(global), Some(reference)) = (find(Role::Global), find(Role::Reference)) else {
        return Vec::new();
    };
    let width = global.element_size;
    let locals = models
        .iter()
        .filter(|m| m.role == Role::Local && width > 0.0);
    locals
        .filter_map(|m| {
            let zone = &zones[m.zone?];
            let cuts = |ply: &Ply| zone.cuts(bounds_in_whole(models, &ply.name), bounds_of(ply));
            let strips = strips(m, reference, zone, cuts, width);
            (!strips.is_empty()).then(|| Layer {
                zone: zone.name.clone(),
                strips,
            })
        })
        .collect()
}

/// Writes the results of both accounts.
///
/// # Errors
/// When the host refuses a result.
pub fn write(host: &Host, cut: &Cut, zones: &[Zone]) -> Result<(), StepError> {
    write_works(host, &cut.work, zones)?;
    for layer in &cut.layers {
        let (at, inside) = layer.strips.split_at(1);
        let zone = &layer.zone;
        for (name, strips) in [("cut_error", at), ("inner_error", inside)] {
            if let Some(error) = over(strips) {
                host.result(&format!("{name}.{zone}"), error, "m")?;
            }
        }
    }
    Ok(())
}

/// Strips of the width `width` (m) from the cut of a zone inwards, over the plies of a local run; empty when nothing is cut.
/// `cuts`: [`Zone::cuts`] of a ply.
fn strips(
    local: &Model,
    reference: &Model,
    zone: &Zone,
    cuts: impl Fn(&Ply) -> [bool; 4],
    width: f64,
) -> Vec<Strip> {
    let mut sums: Vec<Sums> = Vec::new();
    for ply in &local.plies {
        let Some(other) = reference.plies.iter().find(|r| r.name == ply.name) else {
            continue;
        };
        let (_, cells) = other.topology.connectivity();
        let Some(locator) = QuadLocator::new(&other.undeformed, cells) else {
            continue;
        };
        let cuts = cuts(ply);
        for (i, at) in ply.undeformed.iter().enumerate() {
            let Some(deep) = depth(zone, cuts, *at) else {
                continue;
            };
            let Some(place) = locator.locate(at[0], at[1], 1e-6) else {
                continue;
            };
            // A node on the line between two strips belongs to the inner one, however it was rounded.
            let k = (deep / width + 1e-6) as usize;
            if sums.len() <= k {
                sums.resize(k + 1, Sums::default());
            }
            let sum = &mut sums[k];
            sum.position += distance(ply.formed[i], place.interpolate(&other.formed)).powi(2);
            sum.nodes += 1;
            let judged = ply.distance[i].judged;
            if let Some(theirs) = distance_at(other, &place).filter(|_| judged) {
                sum.standing_off += (ply.distance[i].value - theirs).powi(2);
                sum.judged += 1;
            }
        }
    }
    let mean = |sum: f64, n: usize| {
        if n == 0 { 0.0 } else { (sum / n as f64).sqrt() }
    };
    let strip = |(k, s): (usize, &Sums)| Strip {
        from: k as f64 * width,
        to: (k + 1) as f64 * width,
        position: mean(s.position, s.nodes),
        standing_off: mean(s.standing_off, s.judged),
        nodes: s.nodes,
    };
    sums.iter().enumerate().map(strip).collect()
}

/// Distance of a place in the flat ply from the nearest cut side of its zone (m); `None` when no side is cut.
fn depth(zone: &Zone, cuts: [bool; 4], at: Vec3) -> Option<f64> {
    let sides = (0..4).filter(|s| cuts[*s]);
    let deep = sides.map(|s| (at[s / 2] - zone.bounds[s / 2 + 2 * (s % 2)]).abs());
    deep.reduce(f64::min)
}

/// Root mean square distance of the nodes of several strips from the reference (m); `None` where there is no node.
fn over(strips: &[Strip]) -> Option<f64> {
    let nodes: usize = strips.iter().map(|s| s.nodes).sum();
    let part = |s: &Strip| s.position.powi(2) * s.nodes as f64;
    let sum: f64 = strips.iter().map(part).sum();
    (nodes > 0).then(|| (sum / nodes as f64).sqrt())
}
