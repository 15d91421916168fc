//! How sharply a tool itself is crested.

use crate::closest::Surface;
use crate::curvature::{Curvature, curvatures};
use crate::topology::Topology;
use plyflow_fixed::FixedBits;
use plyflow_geometry::closest_on_triangle;
use plyflow_geometry::vec3::{Vec3, add, cross, distance, dot, norm, scale, sub, unit};
use std::collections::BTreeMap;

/// Facets of parametric tools have no longer sides (m): what is known at their corners goes for all of them.
const LARGE: f64 = 0.010;
/// On larger ones a crest goes no further (m) than this from the side or corner at which it is.
const REACH: f64 = 0.005;
/// A facet whose corners or sides are so curved that the surface would turn by more than this (rad) over its longest side does not stand for one curvature: it lies
/// beside a crest, or along one.
const BESIDE: f64 = 0.5;
/// Triangles turned against each other by less than this (rad) lie in one plane.
const LEVEL: f64 = 1e-3;

/// How sharply the tool itself is crested at each of its triangles (1/m, zero or negative): the most negative
/// principal curvature of its corners. What lies on a fillet of radius r is curved by -1/r without being
/// a wrinkle.
pub fn tool_crests(tool: &Surface) -> Vec<f64> {
    worst(tool, &at_nodes(tool))
}

fn at_nodes(tool: &Surface) -> Vec<Curvature> {
    let topology = Topology::new(tool.points().len(), 3, tool.triangles().as_flattened());
    curvatures(&topology, tool.points())
}

fn crest(found: &Curvature) -> f64 {
    found.max.min(found.min).min(0.0)
}

fn worst(tool: &Surface, found: &[Curvature]) -> Vec<f64> {
    let at = |i: &u32| crest(&found[*i as usize]);
    tool.triangles()
        .iter()
        .map(|t| t.iter().map(at).fold(0.0, f64::min))
        .collect()
}

/// The crests of a tool, by place: those of [`tool_crests`], but on large facets beside a crest, as files have them on flat faces between fillets, of which only
/// the rim is crested; and on strips of a fillet from end to end, at whose corners its curvature cannot be told. There the angles to the next facets tell it.
#[derive(Debug, Clone)]
pub struct Crests {
    by_triangle: Vec<f64>,
    /// Of those facets, by triangle.
    beside: BTreeMap<usize, Rim>,
}

/// Where a large facet is crested.
#[derive(Debug, Clone)]
struct Rim {
    /// (m)
    corners: [Vec3; 3],
    /// At the corners (1/m, zero or negative).
    at_corners: [f64; 3],
    /// Over its sides, and over those of the triangles that lie in one plane with it: ends (m) and crest (1/m, negative).
    over_sides: Vec<([Vec3; 2], f64)>,
}

impl Crests {
    /// Takes the curvatures of a tool.
    pub fn new(tool: &Surface) -> Self {
        let found = at_nodes(tool);
        let by_triangle = worst(tool, &found);
        let bends = bends(tool);
        let bend = |s: [u32; 2]| bends.get(&s).copied();
        let mut beside = BTreeMap::new();
        for (k, t) in tool.triangles().iter().enumerate() {
            let longest = sides(t).map(|s| length(tool.points(), s));
            let longest = longest.into_iter().fold(0.0, f64::max);
            let over = sides(t).into_iter().filter_map(bend);
            let sharpest = over.map(|b| b.angle.abs() / b.width);
            let sharpest = sharpest.fold(-by_triangle[k], f64::max);
            if longest <= LARGE || sharpest * longest <= BESIDE {
                continue;
            }
            // The two halves of a strip are one.
            let level = sides(t).into_iter().filter_map(bend);
            let level = level.filter(|b| b.angle.abs() < LEVEL);
            let all = level.flat_map(|b| b.triangles).chain([k]);
            let mut around: Vec<[u32; 2]> = all.flat_map(|u| sides(&tool.triangles()[u])).collect();
            around.sort_unstable();
            around.dedup();
            let crested = |s: [u32; 2]| {
                let b = bend(s).filter(|b| b.angle < 0.0)?;
                let ends = s.map(|i| tool.points()[i as usize]);
                Some((ends, b.angle / b.width.min(REACH)))
            };
            let rim = Rim {
                corners: t.map(|i| tool.points()[i as usize]),
                at_corners: t.map(|i| crest(&found[i as usize])),
                over_sides: around.into_iter().filter_map(crested).collect(),
            };
            beside.insert(k, rim);
        }
        Self {
            by_triangle,
            beside,
        }
    }

    /// The crest (1/m, zero or negative) below `p` (m), to which a place on the tool's triangle `triangle` is closest.
    pub fn at(&self, p: Vec3, triangle: usize) -> f64 {
        match self.beside.get(&triangle) {
            Some(rim) => rim.at(closest_on_triangle(p, rim.corners).0),
            None => self.by_triangle[triangle],
        }
    }
}

impl Rim {
    fn at(&self, q: Vec3) -> f64 {
        let corners = self.corners.iter().zip(self.at_corners);
        let corners = corners.map(|(p, crest)| (distance(q, *p), crest));
        let sides = self.over_sides.iter();
        let all = corners.chain(sides.map(|(ends, crest)| (from_side(q, *ends), *crest)));
        let near = all.filter(|(far, _)| *far <= REACH);
        near.map(|(_, crest)| crest).fold(0.0, f64::min)
    }
}

/// How the surface bends over a side.
#[derive(Debug, Clone, Copy)]
struct Bend {
    /// Between its two triangles (rad), negative over a crest.
    angle: f64,
    /// Of the narrower one, across the side (m).
    width: f64,
    triangles: [usize; 2],
}

fn bends(tool: &Surface) -> BTreeMap<[u32; 2], Bend> {
    let corners = |t: usize| tool.triangles()[t].map(|i| tool.points()[i as usize]);
    let twice_area = |t: usize| {
        let [a, b, c] = corners(t);
        cross(sub(b, a), sub(c, a))
    };
    let mut first: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    let mut bends = BTreeMap::new();
    for (t, triangle) in tool.triangles().iter().enumerate() {
        for side in sides(triangle) {
            let other = *first.entry(side).or_insert(t);
            if other == t {
                continue;
            }
            let [own, next] = [t, other].map(twice_area);
            let [a, b] = [unit(own), unit(next)];
            let size = norm(cross(a, b)).fixed_atan2(dot(a, b));
            // Over a crest the rest of the other one lies below.
            let beyond = corners(other)
                .map(|p| dot(sub(p, corners(t)[0]), a))
                .into_iter()
                .fold(0.0, |far: f64, h| if h.abs() > far.abs() { h } else { far });
            bends.insert(
                side,
                Bend {
                    angle: if beyond < 0.0 { -size } else { size },
                    width: norm(own).min(norm(next)) / length(tool.points(), side),
                    triangles: [t, other],
                },
            );
        }
    }
    bends
}

fn sides(t: &[u32; 3]) -> [[u32; 2]; 3] {
    [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]].map(|[a, b]| [a.min(b), a.max(b)])
}

fn length(points: &[Vec3], [a, b]: [u32; 2]) -> f64 {
    distance(points[a as usize], points[b as usize])
}

/// Distance of a place from a side (m).
fn from_side(q: Vec3, [a, b]: [Vec3; 2]) -> f64 {
    let along = sub(b, a);
    let part = (dot(sub(q, a), along) / dot(along, along)).clamp(0.0, 1.0);
    distance(q, add(a, scale(along, part)))
}
