//! Exact closest point and signed distance to a triangulated surface.

use crate::mesh::ToolMesh;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub, unit};

/// Closest point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPoint {
    /// The point on the surface (m).
    pub point: [f64; 3],
    /// Index of a facet that holds it.
    pub triangle: u32,
    /// Distance (m), positive outside.
    pub signed_distance: f64,
}

/// Bounding-volume tree over the facets of a tool; queries are exact.
///
/// The sign comes from angle-weighted normals of the nearest face, edge or point (Baerentzen and Aanaes,
/// IEEE TVCG 11(3), 2005): right everywhere for a closed surface, and near the surface for an open one.
#[derive(Debug, Clone)]
pub struct SurfaceTree {
    triangles: Vec<[Vec3; 3]>,
    /// Facet in the mesh, by place in the tree.
    origin: Vec<u32>,
    /// Normals of face, three edges, three points.
    normals: Vec<[Vec3; 7]>,
    nodes: Vec<Node>,
}

/// Leaf: facets `first .. first + count`. Inner (`count` 0): the left child follows, the right is `first`.
#[derive(Debug, Clone, Copy)]
struct Node {
    low: Vec3,
    high: Vec3,
    first: u32,
    count: u32,
}

const LEAF: usize = 4;

impl Node {
    #[inline]
    fn distance_squared(&self, p: Vec3) -> f64 {
        let mut sum = 0.0;
        for k in 0..3 {
            let d = (self.low[k] - p[k]).max(p[k] - self.high[k]).max(0.0);
            sum += d * d;
        }
        sum
    }
}

impl SurfaceTree {
    /// Builds the tree. The mesh must have at least one facet; facets without area are never the nearest
    /// alone and do no harm.
    pub fn new(mesh: &ToolMesh) -> Self {
        let count = mesh.triangles.len();
        let centres: Vec<Vec3> = (0..count)
            .map(|t| {
                let [a, b, c] = mesh.corners(t);
                scale(add(add(a, b), c), 1.0 / 3.0)
            })
            .collect();
        let mut order: Vec<u32> = (0..count as u32).collect();
        let mut nodes = Vec::with_capacity(2 * count / LEAF + 1);
        grow(mesh, &centres, &mut order, 0, &mut nodes);
        let normals = feature_normals(mesh);
        Self {
            triangles: order.iter().map(|&t| mesh.corners(t as usize)).collect(),
            normals: order.iter().map(|&t| normals[t as usize]).collect(),
            origin: order,
            nodes,
        }
    }

    /// The closest point of the surface.
    pub fn closest(&self, p: [f64; 3]) -> ClosestPoint {
        self.closest_from(p, 0).0
    }

    /// As [`Self::closest`], starting from a place in the tree that is probably near; also gives the place
    /// found, for the next query nearby.
    pub(crate) fn closest_from(&self, p: Vec3, hint: usize) -> (ClosestPoint, usize) {
        let mut place = hint;
        let (mut point, mut feature) = closest_on_triangle(p, &self.triangles[hint]);
        let mut best = norm_squared(sub(p, point));
        let mut stack = [(0u32, 0.0f64); 40];
        stack[0] = (0, self.nodes[0].distance_squared(p));
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (index, near) = stack[depth];
            if near >= best {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                for t in node.first as usize..(node.first + node.count) as usize {
                    let (q, f) = closest_on_triangle(p, &self.triangles[t]);
                    let d = norm_squared(sub(p, q));
                    if d < best {
                        (best, place, point, feature) = (d, t, q, f);
                    }
                }
                continue;
            }
            let child = |c: u32| (c, self.nodes[c as usize].distance_squared(p));
            let children = [child(index + 1), child(node.first)];
            let swap = children[0].1 <= children[1].1;
            let [far, near] = if swap {
                [children[1], children[0]]
            } else {
                children
            };
            for child in [far, near] {
                if child.1 < best {
                    stack[depth] = child;
                    depth += 1;
                }
            }
        }
        let outside = dot(sub(p, point), self.normals[place][feature]) >= 0.0;
        let distance = best.sqrt();
        let closest = ClosestPoint {
            point,
            triangle: self.origin[place],
            signed_distance: if outside { distance } else { -distance },
        };
        (closest, place)
    }
}

/// Appends the subtree over `order`, whose first facet has the place `first`.
fn grow(mesh: &ToolMesh, centres: &[Vec3], order: &mut [u32], first: usize, nodes: &mut Vec<Node>) {
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let (mut first_centre, mut last_centre) = (low, high);
    for &t in order.iter() {
        for k in 0..3 {
            for p in mesh.corners(t as usize) {
                low[k] = low[k].min(p[k]);
                high[k] = high[k].max(p[k]);
            }
            first_centre[k] = first_centre[k].min(centres[t as usize][k]);
            last_centre[k] = last_centre[k].max(centres[t as usize][k]);
        }
    }
    let here = nodes.len();
    nodes.push(Node {
        low,
        high,
        first: first as u32,
        count: order.len() as u32,
    });
    if order.len() <= LEAF {
        return;
    }
    let spread = sub(last_centre, first_centre);
    let axis = (0..3).fold(0, |a, k| if spread[k] > spread[a] { k } else { a });
    let middle = order.len() / 2;
    // The index breaks ties, so that the tree does not depend on the sorting algorithm.
    order.select_nth_unstable_by(middle, |&a, &b| {
        centres[a as usize][axis]
            .total_cmp(&centres[b as usize][axis])
            .then(a.cmp(&b))
    });
    let (left, right) = order.split_at_mut(middle);
    left.sort_unstable();
    right.sort_unstable();
    grow(mesh, centres, left, first, nodes);
    nodes[here].first = nodes.len() as u32;
    nodes[here].count = 0;
    grow(mesh, centres, right, first + middle, nodes);
}

/// For each facet the normals that decide the sign: face, edges, points. Not unit, directions only.
fn feature_normals(mesh: &ToolMesh) -> Vec<[Vec3; 7]> {
    let faces: Vec<Vec3> = (0..mesh.triangles.len())
        .map(|t| unit(mesh.area_normal(t)))
        .collect();
    let adjacency = mesh.adjacency();
    let mut points = vec![[0.0; 3]; mesh.points.len()];
    for (t, tri) in mesh.triangles.iter().enumerate() {
        let c = mesh.corners(t);
        for k in 0..3 {
            let (u, v) = (sub(c[(k + 1) % 3], c[k]), sub(c[(k + 2) % 3], c[k]));
            let angle = norm(cross(u, v)).fixed_atan2(dot(u, v));
            let sum = &mut points[tri[k] as usize];
            *sum = add(*sum, scale(faces[t], angle));
        }
    }
    mesh.triangles
        .iter()
        .enumerate()
        .map(|(t, tri)| {
            let edge = |k: usize| match adjacency.neighbour[t][k] {
                Some(n) => add(faces[t], faces[n as usize]),
                None => faces[t],
            };
            let point = |k: usize| points[tri[k] as usize];
            [
                faces[t],
                edge(0),
                edge(1),
                edge(2),
                point(0),
                point(1),
                point(2),
            ]
        })
        .collect()
}

#[inline]
fn norm_squared(a: Vec3) -> f64 {
    dot(a, a)
}

/// Closest point of a triangle and where it lies: 0 face, 1 + k edge k, 4 + k corner k
/// (Ericson, Real-Time Collision Detection, 5.1.5).
#[inline]
fn closest_on_triangle(p: Vec3, &[a, b, c]: &[Vec3; 3]) -> (Vec3, usize) {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, 4);
    }
    let bp = sub(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (b, 5);
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (add(a, scale(ab, d1 / (d1 - d3))), 1);
    }
    let cp = sub(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (c, 6);
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (add(a, scale(ac, d2 / (d2 - d6))), 3);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (add(b, scale(sub(c, b), w)), 2);
    }
    let sum = va + vb + vc;
    (add(a, add(scale(ab, vb / sum), scale(ac, vc / sum))), 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hemisphere::hemisphere;

    #[test]
    fn closest_point_equals_the_search_over_all_facets() {
        let mesh = hemisphere(0.05, 0.01);
        let tree = SurfaceTree::new(&mesh);
        for i in 0..500 {
            let f = |k: f64| ((i as f64 * k).fract() - 0.5) * 0.16;
            let p = [f(0.618), f(0.414), f(0.732)];
            let all = (0..mesh.triangles.len())
                .map(|t| norm(sub(p, closest_on_triangle(p, &mesh.corners(t)).0)))
                .fold(f64::INFINITY, f64::min);
            let found = tree.closest(p);
            assert!((found.signed_distance.abs() - all).abs() < 1e-15);
            assert!((norm(sub(p, found.point)) - all).abs() < 1e-15);
            let inside = p[2] > 0.0 && norm(p) < 0.0495;
            let outside = p[2] < 0.0 || norm(p) > 0.0505;
            assert!(!inside || found.signed_distance < 0.0, "{p:?} {found:?}");
            assert!(!outside || found.signed_distance > 0.0, "{p:?} {found:?}");
        }
    }

    #[test]
    fn distance_does_not_depend_on_the_hint() {
        let mesh = hemisphere(0.05, 0.01);
        let tree = SurfaceTree::new(&mesh);
        for i in 0..200 {
            let f = |k: f64| ((i as f64 * k).fract() - 0.5) * 0.16;
            let p = [f(0.618), f(0.414), f(0.732)];
            let d = tree.closest(p).signed_distance;
            assert_eq!(
                d,
                tree.closest_from(p, i % mesh.triangles.len())
                    .0
                    .signed_distance
            );
        }
    }
}
