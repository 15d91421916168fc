//! Edges of the tool against the cells of sheets: between its nodes a sheet may lie on what goes through it.

use crate::watch::deep::{CHUNK, Deep};
use crate::watch::rigid::Triangles;
use crate::watch::sheet::{SheetMesh, SheetTree};
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub};
use plyflow_tooling::ToolMesh;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// Sine of the angle between neighbouring facets from which on an edge is looked at.
const TURNS: f64 = 0.05;
/// Places on edges, by the finest sheet's elements.
const PER_ELEMENT: f64 = 4.0;

/// A place on a convex edge of the tool.
#[derive(Debug, Clone, Copy)]
struct Place {
    at: Vec3,
    /// Out of the tool (unit).
    out: Vec3,
    /// Along the surface, across the edge (unit).
    across: Vec3,
    /// Sine of the angle between the facets.
    turn: f64,
}

/// Convex edges of a rigid part.
pub struct Edges {
    /// Number of the part.
    pub part: usize,
    places: Vec<Place>,
    /// By sheet and place: the sheet's triangle that was found last, near which the next search begins; [`UNKNOWN`] before.
    last: Vec<Vec<u32>>,
}

/// No triangle.
pub const UNKNOWN: u32 = u32::MAX;

/// A sheet at which they are held.
pub struct Look<'a> {
    pub x: &'a [Vec3],
    pub mesh: &'a SheetMesh,
    pub tree: &'a SheetTree,
    pub bounds: [Vec3; 2],
    /// Where the part has moved (m).
    pub shift: Vec3,
    /// Size of the elements (m).
    pub size: f64,
    /// Half of the sheet's thickness (m).
    pub half: f64,
    /// Error of the tool's field (m).
    pub error: f64,
    /// Depth (m) from which on it is told.
    pub floor: f64,
    /// Whether the part lies above the sheet.
    pub above: bool,
}

impl Edges {
    /// Of the part of a number, for sheets with elements of these sizes (m).
    pub fn new(part: usize, tool: &ToolMesh, sizes: &[f64], mirrored: [bool; 2]) -> Self {
        let finest = sizes.iter().copied().fold(f64::INFINITY, f64::min);
        let spacing = finest / PER_ELEMENT;
        // In every box of that size the sharpest one.
        let mut boxes: BTreeMap<[i64; 3], Place> = BTreeMap::new();
        if !(spacing > 0.0 && spacing.is_finite()) {
            return Self {
                part,
                places: Vec::new(),
                last: vec![Vec::new(); sizes.len()],
            };
        }
        // Beyond a mirror plane there is nothing of the sheets that are computed.
        let beyond = |at: &Vec3| (0..2).any(|k| mirrored[k] && at[k] < 0.0);
        for place in edges(tool, spacing) {
            if beyond(&place.at) {
                continue;
            }
            let key = place.at.map(|c| (c / spacing).floor() as i64);
            let kept = boxes.entry(key).or_insert(place);
            if place.turn > kept.turn {
                *kept = place;
            }
        }
        let places: Vec<Place> = boxes.into_values().collect();
        Self {
            part,
            last: vec![vec![UNKNOWN; places.len()]; sizes.len()],
            places,
        }
    }

    /// How deep (m) they are in sheet number `sheet`, and where, less what its elements cannot follow: of all places that `counts` says true
    /// of (m), and of the others.
    pub fn deepest(
        &mut self,
        sheet: usize,
        triangles: &Triangles,
        look: &Look<'_>,
        counts: impl Fn(Vec3) -> bool,
    ) -> [Deep; 2] {
        let depths: Vec<f64> = (self.places.par_iter())
            .zip(&mut self.last[sheet])
            .with_min_len(CHUNK)
            .map(|(place, last)| depth(place, triangles, look, last))
            .collect();
        let mut deepest = [Deep::default(); 2];
        for (place, depth) in self.places.iter().zip(depths) {
            // Neither can be less deep, whichever of them it is of.
            if depth <= deepest[0].depth.min(deepest[1].depth) {
                continue;
            }
            let at = add(place.at, look.shift);
            let of = &mut deepest[usize::from(!counts(at))];
            if depth > of.depth {
                *of = Deep {
                    depth,
                    node: u32::MAX,
                    place: at,
                };
            }
        }
        deepest
    }
}

fn depth(place: &Place, triangles: &Triangles, look: &Look<'_>, last: &mut u32) -> f64 {
    let p = add(place.at, look.shift);
    let [low, high] = look.bounds;
    if (0..3).any(|k| p[k] < low[k] - look.size || p[k] > high[k] + look.size) {
        return 0.0;
    }
    // Most places are far from the sheet, or under it.
    let Some(cell) = look.tree.cell_within(p, look.size, last) else {
        return 0.0;
    };
    let near = look.mesh.closest(look.x, p, (cell, [0.0; 2]));
    // Of a part above, all is the other way round.
    let side = if look.above { -1.0 } else { 1.0 };
    let height = side * near.height;
    let depth = look.half + height;
    if near.is_beside(look.size) || depth <= look.floor || height > look.size {
        return 0.0;
    }
    // A sheet over this edge looks the same way.
    if side * dot(look.mesh.normal_in(look.x, near.cell), place.out) <= 0.0 {
        return 0.0;
    }
    // What an element that bends over the edge cuts off with its diagonal, at most as for one whose diagonal turns by one radian.
    let s = std::f64::consts::FRAC_1_SQRT_2 * look.size;
    let off = |u: f64| triangles.distance(add(place.at, scale(place.across, u * s)), (0, 0));
    let cut = (0.5 * (off(1.0) + off(-1.0))).clamp(0.0, look.size / 4.0);
    let depth = depth - cut - look.error;
    if depth > look.floor { depth } else { 0.0 }
}

/// Places on convex edges, `spacing` (m) apart.
fn edges(tool: &ToolMesh, spacing: f64) -> Vec<Place> {
    let mut sides: HashMap<[u32; 2], (usize, usize)> = HashMap::new();
    let mut found = Vec::new();
    for (t, triangle) in tool.triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
            let key = [a.min(b), a.max(b)];
            if let Some((other, _)) = sides.insert(key, (t, k)) {
                found.extend(edge(tool, [other, t], [a, b], spacing));
            }
        }
    }
    found
}

fn edge(tool: &ToolMesh, [s, t]: [usize; 2], [a, b]: [u32; 2], spacing: f64) -> Vec<Place> {
    let normal = |t: usize| {
        let [p, q, r] = tool.corners(t);
        direction(cross(sub(q, p), sub(r, p)))
    };
    let (m, n) = (normal(s), normal(t));
    let [from, to] = [a, b].map(|k| tool.points[k as usize]);
    let along = sub(to, from);
    // `t` passes the edge from `a` to `b`: of a convex one the normals turn about it from `s` to `t` against that.
    let turn = dot(cross(n, m), direction(along));
    let sharp = dot(m, n) < 0.0;
    if !(turn > TURNS || sharp && turn > 0.0) {
        return Vec::new();
    }
    let out = direction(add(m, n));
    let across = direction(cross(along, out));
    let parts = (norm(along) / spacing).ceil().max(1.0) as usize;
    let place = |k: usize| Place {
        at: add(from, scale(along, k as f64 / parts as f64)),
        out,
        across,
        turn: if sharp { 2.0 - turn } else { turn },
    };
    (0..=parts).map(place).collect()
}

fn direction(v: Vec3) -> Vec3 {
    let n = norm(v);
    if n > 0.0 { scale(v, 1.0 / n) } else { v }
}
