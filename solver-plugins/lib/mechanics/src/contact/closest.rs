//! Closest points of one of a sheet's bilinear cells.

use crate::mesh::NONE;
use crate::mirror::Image;
use crate::vec3::{Vec3, cross, dot, sub, unit};

/// Bilinear shape functions at `xi`.
#[inline(always)]
pub fn shape(xi: [f64; 2]) -> [f64; 4] {
    let (a, b) = (0.25 * (1.0 - xi[0]), 0.25 * (1.0 + xi[0]));
    let (c, d) = (1.0 - xi[1], 1.0 + xi[1]);
    [a * c, b * c, b * d, a * d]
}

#[inline(always)]
pub(super) fn combine(w: [f64; 4], p: &[Vec3; 4]) -> Vec3 {
    let mut s = [0.0; 3];
    for (w, p) in w.iter().zip(p) {
        for c in 0..3 {
            s[c] += w * p[c];
        }
    }
    s
}

/// Surface of all sheets as the contact sees it.
#[derive(Clone, Copy)]
pub struct Surface<'a> {
    /// `[cells][4]` model nodes.
    pub cells: &'a [[u32; 4]],
    /// `[cells][4]` cell across each edge, [`NONE`], or one of [`crate::mirror::MIRRORED`].
    pub neighbours: &'a [[u32; 4]],
    /// `[nodes]` positions (m).
    pub x: &'a [Vec3],
    /// `[nodes]` unit normals.
    pub normals: &'a [Vec3],
}

/// Closest point of a cell to a slave.
#[derive(Clone, Copy)]
pub(super) struct Closest {
    pub(super) cell: u32,
    pub(super) xi: [f64; 2],
    pub(super) weights: [f64; 4],
    /// From the closest point to the slave (m).
    pub(super) arm: Vec3,
    pub(super) distance2: f64,
    /// Half the cell's shorter middle line (m).
    pub(super) half: f64,
    /// By coordinate, whether the place is not held at a side of the cell: in both, the way to it is a perpendicular.
    pub(super) free: [bool; 2],
    /// Whether it lies on the cell's mirror image.
    pub(super) image: Image,
}

/// Cells around a corner besides the one that is closest.
pub(super) const FACES: usize = 3;

/// The closest point of the surface, and in a concave fold or corner those of the cells across it.
pub(super) struct Found {
    pub(super) first: Closest,
    /// Of the cells across the sides along xi and along eta that the slave is near, and of the one between these two across
    /// the corner, as far as the foot on them is a perpendicular's.
    pub(super) others: [Option<Closest>; FACES],
}

/// How far a cell goes on past a free rim, in half cells: a node that sits on the rim would else balance on an
/// edge, slide off and get under the sheet.
pub(super) const RIM: f64 = 0.5;

/// Closest point of one cell to `p` by Newton steps from `xi`, kept inside the cell.
/// Long, as it is the innermost loop of contacts: pieces of it would share most of its values, and its speed would hang on how they are inlined.
#[inline(always)]
pub(super) fn closest(
    s: &Surface<'_>,
    cell: u32,
    mut xi: [f64; 2],
    p: Vec3,
    iterations: u32,
) -> Closest {
    let x = s.cells[cell as usize].map(|n| s.x[n as usize]);
    let (mut half, mut free) = (0.0, [true; 2]);
    let [south, east, north, west] = s.neighbours[cell as usize];
    let end = |near: u32| if near == NONE { 1.0 + RIM } else { 1.0 };
    let (low, high) = ([-end(west), -end(south)], [end(east), end(north)]);
    for _ in 0..iterations {
        let (a, b) = (0.25 * (1.0 - xi[1]), 0.25 * (1.0 + xi[1]));
        let (c, d) = (0.25 * (1.0 - xi[0]), 0.25 * (1.0 + xi[0]));
        let t1 = combine([-a, a, b, -b], &x);
        let t2 = combine([-c, -d, d, c], &x);
        let r = sub(p, combine(shape(xi), &x));
        let (g11, g22, g12) = (dot(t1, t1), dot(t2, t2), dot(t1, t2));
        let (r1, r2) = (dot(r, t1), dot(r, t2));
        let det = (g11 * g22 - g12 * g12).max(1e-12 * g11 * g22);
        let next = [
            xi[0] + (r1 * g22 - r2 * g12) / det,
            xi[1] + (r2 * g11 - r1 * g12) / det,
        ];
        let held = [
            next[0].clamp(low[0], high[0]),
            next[1].clamp(low[1], high[1]),
        ];
        // Held at one side of the cell, the best place along that side is another one.
        let along = |k: usize, other: f64| {
            let (gkk, rk) = if k == 0 { (g11, r1) } else { (g22, r2) };
            (xi[k] + (rk - g12 * other) / gkk).clamp(low[k], high[k])
        };
        let out = [next[0] != held[0], next[1] != held[1]];
        free = out.map(|o| !o);
        xi = match out {
            [false, false] => held,
            [true, false] => [held[0], along(1, held[0] - xi[0])],
            [false, true] => [along(0, held[1] - xi[1]), held[1]],
            [true, true] => {
                // In a corner's range: take the side that is overshot more, slide along it.
                if (next[0] - held[0]).abs() > (next[1] - held[1]).abs() {
                    [held[0], along(1, held[0] - xi[0])]
                } else {
                    [along(0, held[1] - xi[1]), held[1]]
                }
            }
        };
        half = g11.min(g22).sqrt();
    }
    debug_assert!(
        (0..2).all(|k| (low[k]..=high[k]).contains(&xi[k])),
        "{xi:?}"
    );
    let weights = shape(xi);
    let arm = sub(p, combine(weights, &x));
    Closest {
        cell,
        xi,
        weights,
        arm,
        distance2: dot(arm, arm),
        half,
        free,
        image: [false; 2],
    }
}

/// Unit normal of a cell at a place in it.
pub(super) fn cell_normal(s: &Surface<'_>, cell: u32, xi: [f64; 2]) -> Vec3 {
    let x = s.cells[cell as usize].map(|n| s.x[n as usize]);
    let (a, b) = (1.0 - xi[1], 1.0 + xi[1]);
    let (c, d) = (1.0 - xi[0], 1.0 + xi[0]);
    unit(cross(
        combine([-a, a, b, -b], &x),
        combine([-c, -d, d, c], &x),
    ))
}

/// The middle of an edge.
pub(super) fn middle(edge: usize) -> [f64; 2] {
    match edge {
        0 => [0.0, -1.0],
        1 => [1.0, 0.0],
        2 => [0.0, 1.0],
        _ => [-1.0, 0.0],
    }
}
