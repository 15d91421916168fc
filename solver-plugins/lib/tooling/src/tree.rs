//! Exact closest point and signed distance to a triangulated surface.

use crate::mesh::ToolMesh;
use plyflow_fixed::FixedBits;
use plyflow_geometry::triangle_tree::Nearest;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub, unit};
use plyflow_geometry::{Feature, TriangleTree};

/// Closest point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosestPoint {
    /// The point on the surface (m).
    pub point: Vec3,
    /// Index of a facet that holds it.
    pub triangle: u32,
    /// Distance (m), positive outside.
    pub signed_distance: f64,
}

/// Tree over the facets of a tool that also knows its sides; queries are exact.
///
/// The sign comes from angle-weighted normals of the nearest face, edge or point (Baerentzen and Aanaes,
/// IEEE TVCG 11(3), 2005): right everywhere for a closed surface, and near the surface for an open one.
#[derive(Debug, Clone)]
pub struct SurfaceTree {
    tree: TriangleTree,
    /// By facet the normals of face, three edges, three points.
    normals: Vec<[Vec3; 7]>,
}

impl SurfaceTree {
    /// Builds the tree. Facets without area are never the nearest alone and do no harm.
    ///
    /// # Panics
    /// When the mesh has no facet.
    pub fn new(mesh: &ToolMesh) -> Self {
        let tree = TriangleTree::new(mesh.points.clone(), mesh.triangles.clone());
        Self {
            tree: tree.expect("a tool has a facet"),
            normals: feature_normals(mesh),
        }
    }

    /// The closest point of the surface.
    pub fn closest(&self, p: Vec3) -> ClosestPoint {
        self.closest_from(p, 0)
    }

    /// As [`Self::closest`], starting from a facet that is probably near: that of the last query nearby.
    pub(crate) fn closest_from(&self, p: Vec3, hint: usize) -> ClosestPoint {
        let found = self.tree.search(p, f64::INFINITY, Some(hint));
        let Nearest {
            triangle,
            mut point,
            feature,
            mut squared,
        } = found.expect("a tree has a facet");
        let normals = &self.normals[triangle as usize];
        let normal = match feature {
            Feature::Face => {
                point = on_face(p, self.tree.corners(triangle as usize));
                squared = dot(sub(p, point), sub(p, point));
                normals[0]
            }
            Feature::Edge(k) => normals[1 + k],
            Feature::Vertex(k) => normals[4 + k],
        };
        let distance = squared.sqrt();
        ClosestPoint {
            point,
            triangle,
            signed_distance: if dot(sub(p, point), normal) >= 0.0 {
                distance
            } else {
                -distance
            },
        }
    }
}

/// The foot of `p` on the plane of a triangle that it lies over, as [`plyflow_geometry::closest_on_triangle`] gives it, but with its weights
/// divided, not multiplied by a reciprocal: a last bit of which distance fields, and runs on them, were made.
fn on_face(p: Vec3, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let (ab, ac) = (sub(b, a), sub(c, a));
    let along = |q: Vec3| (dot(ab, sub(p, q)), dot(ac, sub(p, q)));
    let ((d1, d2), (d3, d4), (d5, d6)) = (along(a), along(b), along(c));
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let sum = va + vb + vc;
    add(a, add(scale(ab, vb / sum), scale(ac, vc / sum)))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::hemisphere::hemisphere;
    use plyflow_geometry::closest_on_triangle;

    #[test]
    fn closest_point_equals_the_search_over_all_facets() {
        let mesh = hemisphere(0.05, 0.01).unwrap();
        let tree = SurfaceTree::new(&mesh);
        for i in 0..500 {
            let f = |k: f64| ((i as f64 * k).fract() - 0.5) * 0.16;
            let p = [f(0.618), f(0.414), f(0.732)];
            let all = (0..mesh.triangles.len())
                .map(|t| norm(sub(p, closest_on_triangle(p, mesh.corners(t)).0)))
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
        let mesh = hemisphere(0.05, 0.01).unwrap();
        let tree = SurfaceTree::new(&mesh);
        for i in 0..200 {
            let f = |k: f64| ((i as f64 * k).fract() - 0.5) * 0.16;
            let p = [f(0.618), f(0.414), f(0.732)];
            let d = tree.closest(p).signed_distance;
            assert_eq!(
                d,
                tree.closest_from(p, i % mesh.triangles.len())
                    .signed_distance
            );
        }
    }
}
