//! When a fine run begins that need not begin with the process, and where its nodes are then.

use crate::cut::Placed;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, cross, distance, dot, norm, scale, sub};
use plyflow_mechanics::mesh::{NONE, QuadMesh};
use plyflow_model::artifact::Rectangle;
use plyflow_sdk::{BodyInfo, Host, Input, Meshes, StepError};
use plyflow_surface::weighted_quantiles;

/// Where all nodes of a sheet are when the fine run begins late.
pub(crate) struct Start {
    /// States on the way there, the last one included.
    pub(crate) states: usize,
    /// `[states][n][3]` (m).
    pub(crate) path: Vec<f64>,
    /// `[n][3]` (m/s).
    pub(crate) velocity: Vec<f64>,
}

/// Most states on the way to a late start.
const STATES: usize = 20;

/// The last frame that is not later than `start` (s); two at least must be left from there.
pub(crate) fn frame_at(times: &[f64], start: f64, step: &str) -> Result<usize, String> {
    const ROUNDING: f64 = 1e-9;
    let after = times.partition_point(|t| *t <= start + ROUNDING);
    let first = after.saturating_sub(1);
    if first + 2 > times.len() {
        let end = times[times.len() - 1];
        return Err(format!(
            "start_time: {start} s leaves nothing of '{step}', which ends at {end} s; expected an earlier time, before anything stands off the tool"
        ));
    }
    Ok(first)
}

/// The frame `first`, or the second one where that is the first of a run that itself began late: what moves there, and how fast, is known
/// from frames on both sides.
pub(crate) fn after_a_late_beginning(
    times: &[f64],
    first: usize,
    step: &str,
) -> Result<usize, String> {
    if first > 0 || times[0] <= 0.0 {
        return Ok(first);
    }
    if times.len() < 3 {
        let (begin, n) = (times[0], times.len());
        return Err(format!(
            "'{step}' begins at {begin} s, in the middle of the process, and has {n} frames; to drive a zone it needs 3 or more (`frames`)"
        ));
    }
    Ok(1)
}

/// By frame, how sharply (1/m) a coarse ply is bent in the zone where it is bent most ([`QUANTILE`]): the angle between cells that share an
/// edge over the distance of their middles. `zone` in the flat ply.
///
/// # Errors
/// When the frames cannot be read.
pub(crate) fn sharpest_bends(
    host: &Host,
    input: &Input,
    body: &BodyInfo,
    zone: Rectangle,
    frames: usize,
) -> Result<Vec<f64>, StepError> {
    let (flat, cells) = host.mesh(input, body)?;
    let pairs = joined_cells(&flat, &cells, zone);
    let of_frame = |f: usize| Ok(sharpest(&host.frame_points(input, body, f)?, &pairs));
    (0..frames).map(of_frame).collect()
}

/// Pairs of cells with a common edge whose middles lie in the zone.
fn joined_cells(flat: &[Vec3], cells: &[u32], zone: Rectangle) -> Vec<[[u32; 4]; 2]> {
    let mesh = QuadMesh {
        points: flat.to_vec(),
        cells: cells.as_chunks().0.to_vec(),
    };
    let within = |cell: &[u32; 4]| {
        let [x, y, _] = middle(flat, cell);
        zone[0] <= x && x <= zone[2] && zone[1] <= y && y <= zone[3]
    };
    let neighbours = mesh.neighbours();
    let mut pairs = Vec::new();
    for (c, cell) in mesh.cells.iter().enumerate() {
        for &n in neighbours[c]
            .iter()
            .filter(|n| **n != NONE && **n as usize > c)
        {
            let other = mesh.cells[n as usize];
            if within(cell) && within(&other) {
                pairs.push([*cell, other]);
            }
        }
    }
    pairs
}

fn middle(points: &[Vec3], cell: &[u32; 4]) -> Vec3 {
    let sum = cell
        .iter()
        .fold([0.0; 3], |s, n| add(s, points[*n as usize]));
    scale(sum, 0.25)
}

fn sharpest(points: &[Vec3], pairs: &[[[u32; 4]; 2]]) -> f64 {
    let normal = |cell: &[u32; 4]| {
        let [a, b, c, d] = cell.map(|n| points[n as usize]);
        cross(sub(c, a), sub(d, b))
    };
    let bend = |[a, b]: &[[u32; 4]; 2]| {
        let (n, m) = (normal(a), normal(b));
        let angle = norm(cross(n, m)).fixed_atan2(dot(n, m));
        angle / distance(middle(points, a), middle(points, b))
    };
    let bends: Vec<f64> = pairs.iter().map(bend).collect();
    weighted_quantiles(&bends, &vec![1.0; bends.len()], &[QUANTILE])[0]
}

/// Of the bends in a zone. The very sharpest is at an edge of the tool or in one cell of a fold, and the sharper the smaller the cells.
const QUANTILE: f64 = 0.99;

/// Share of the sharpest bend that it comes to at which a ply begins to fold that is never bent by much.
const BEGINNING: f64 = 1.0 / 3.0;

/// The last frame before one of the plies is bent more sharply than `limit` (1/m), or than [`BEGINNING`] of the sharpest that it comes to, if
/// that is less. `bends`: by ply and frame.
pub(crate) fn frame_before_bend(bends: &[Vec<f64>], limit: f64) -> usize {
    let of_ply = |bends: &Vec<f64>| {
        let sharpest = bends.iter().fold(0.0, |m: f64, b| m.max(*b));
        let limit = limit.min(BEGINNING * sharpest);
        bends.iter().position(|b| *b > limit)
    };
    let first = bends.iter().filter_map(of_ply).min();
    first.map_or(0, |f| f.saturating_sub(1))
}

/// Where all nodes are at the frame `first`, and were before; `None` at the beginning. `slower`: how many times slower than in the coarse run they move.
pub(crate) fn start(
    host: &Host,
    input: &Input,
    meshes: &Meshes,
    body: &BodyInfo,
    fine: &Placed,
    first: usize,
    slower: f64,
) -> Result<Option<Start>, StepError> {
    if first == 0 {
        return Ok(None);
    }
    let at = |frame: usize| -> Result<Vec<f64>, StepError> {
        let coarse = fine.surface(host.frame_points(input, body, frame)?);
        Ok(fine.everywhere(&coarse).into_flattened())
    };
    let every = first.div_ceil(STATES);
    let (mut states, mut path) = (0, Vec::new());
    for frame in (1..=first).filter(|f| (first - f).is_multiple_of(every)) {
        path.extend(at(frame)?);
        states += 1;
    }
    let (before, after) = (at(first - 1)?, at(first + 1)?);
    let span = slower * (meshes.times[first + 1] - meshes.times[first - 1]);
    let pairs = before.iter().zip(&after);
    Ok(Some(Start {
        states,
        path,
        velocity: pairs.map(|(a, b)| (b - a) / span).collect(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sharpest_bend_is_that_of_the_tightest_place_within_the_zone() {
        // Bent to a cylinder of 20 mm, and beyond x = 24 mm to one of 5 mm.
        let (size, n) = (0.002, 20);
        let turned = |x: f64| x.min(0.024) / 0.020 + (x - 0.024).max(0.0) / 0.005;
        let (mut flat, mut formed) = (Vec::new(), Vec::new());
        for j in 0..=n {
            let y = size * j as f64;
            let (mut at, mut before) = ([0.0, y, 0.0], 0.0);
            for i in 0..=n {
                let x = size * i as f64;
                if i > 0 {
                    let slope = 0.5 * (turned(x) + turned(before));
                    at = add(at, [size * slope.cos(), 0.0, size * slope.sin()]);
                }
                before = x;
                flat.push([x, y, 0.0]);
                formed.push(at);
            }
        }
        let mesh = QuadMesh::grid(
            &(0..=n).map(|i| size * i as f64).collect::<Vec<_>>(),
            &(0..=n).map(|j| size * j as f64).collect::<Vec<_>>(),
        );
        assert_eq!(mesh.points.len(), flat.len());
        let cells = mesh.cells.as_flattened();
        let bend = |zone| sharpest(&formed, &joined_cells(&flat, cells, zone));
        let left = bend([0.0, 0.0, 0.022, 0.04]);
        assert!((left * 0.020 - 1.0).abs() < 2e-3, "{left}");
        let all = bend([0.0, 0.0, 0.04, 0.04]);
        // Middles of chords that turn by 0.4 are nearer to each other than the arc is long.
        let expected = 200.0 / 0.2f64.cos();
        assert!((all / expected - 1.0).abs() < 1e-6, "{all}");
        assert_eq!(bend([0.05, 0.0, 0.06, 0.04]), 0.0);
    }

    #[test]
    fn a_run_begins_before_the_first_of_its_plies_is_bent() {
        let bends = [
            vec![1.0, 2.0, 3.0, 9.0, 30.0],
            vec![0.0, 1.0, 30.0, 90.0, 100.0],
        ];
        assert_eq!(frame_before_bend(&bends, 8.0), 1);
        assert_eq!(frame_before_bend(&bends[..1], 8.0), 2);
        // One that comes to less than three times of that: at a third of the sharpest.
        assert_eq!(frame_before_bend(&bends[..1], 25.0), 3);
        assert_eq!(frame_before_bend(&bends, 80.0), 2);
        // What is bent from the beginning, or never, is computed from the beginning.
        assert_eq!(frame_before_bend(&[vec![50.0, 50.0]], 40.0), 0);
        assert_eq!(frame_before_bend(&[vec![0.0, 0.0]], 40.0), 0);
        assert_eq!(frame_before_bend(&[], 40.0), 0);
    }

    #[test]
    fn a_run_that_began_late_drives_from_its_second_frame_on() {
        let from = |times: &[f64], first| after_a_late_beginning(times, first, "whole");
        assert_eq!(from(&[0.0, 0.1, 0.2], 0), Ok(0));
        assert_eq!(from(&[0.6, 0.7, 0.8], 0), Ok(1));
        assert_eq!(from(&[0.6, 0.7, 0.8], 2), Ok(2));
        let refused = from(&[0.6, 0.8], 0).unwrap_err();
        assert!(refused.contains("begins at 0.6 s"), "{refused}");
    }
}
