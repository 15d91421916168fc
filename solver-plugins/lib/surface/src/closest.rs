//! Exact closest point and signed distance to a triangulated surface.

use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub, unit};
use plyflow_geometry::{Feature, TriangleTree};

/// The closest point of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// The point (m).
    pub point: Vec3,
    /// Distance (m), positive on the side that the normal points to.
    pub signed_distance: f64,
    /// Index of a triangle that holds the point.
    pub triangle: usize,
    /// Where on the triangle.
    pub feature: Feature,
    /// Pseudo-normal of the feature (unit): that of the face, the sum of the two faces' at an edge, the
    /// angle-weighted sum at a vertex. Its side is the point's side for every closed or open surface,
    /// except past a free edge, where a surface has no side (J. A. Baerentzen, H. Aanaes, IEEE TVCG 11, 2005).
    pub normal: Vec3,
    /// Whether the point lies on a free edge of the surface.
    pub on_free_edge: bool,
}

/// A triangulated surface with a tree of boxes over its triangles. Corners at bit-equal places count as
/// one node, so that a triangle soup (STL) gets its edges back.
#[derive(Debug, Clone)]
pub struct Surface {
    tree: TriangleTree,
    face_normals: Vec<Vec3>,
    edge_normals: Vec<[Vec3; 3]>,
    vertex_normals: Vec<Vec3>,
    free_edges: Vec<[bool; 3]>,
    free_vertices: Vec<bool>,
}

impl Surface {
    /// Builds the tree and the pseudo-normals; `None` when no triangle has an area.
    ///
    /// # Panics
    /// When a triangle names a point that is not there.
    pub fn new(points: &[Vec3], triangles: &[[u32; 3]]) -> Option<Self> {
        let merged = merge_equal(points);
        let triangles: Vec<[u32; 3]> = triangles
            .iter()
            .map(|t| t.map(|i| merged[i as usize]))
            .filter(|t| norm(twice_area(points, t)) > 0.0)
            .collect();
        let face_normals: Vec<Vec3> = triangles
            .iter()
            .map(|t| unit(twice_area(points, t)))
            .collect();
        let count = triangles.len();
        let mut surface = Self {
            tree: TriangleTree::new(points.to_vec(), triangles)?,
            edge_normals: vec![[[0.0; 3]; 3]; count],
            vertex_normals: vec![[0.0; 3]; points.len()],
            free_edges: vec![[false; 3]; count],
            free_vertices: vec![false; points.len()],
            face_normals,
        };
        surface.set_edge_normals();
        surface.set_vertex_normals();
        Some(surface)
    }

    /// The points as given (m).
    pub fn points(&self) -> &[Vec3] {
        self.tree.points()
    }

    /// Triangles that have an area, after merging equal points.
    pub fn triangles(&self) -> &[[u32; 3]] {
        self.tree.triangles()
    }

    /// Lowest and highest corner of the box around the surface (m).
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.tree.bounds()
    }

    /// By triangle, the unit normals of the smooth surface that it stands for, at its three corners: of the triangles at a corner, those count that are turned
    /// against it by less than `crease` (rad), by their angles there. Beyond that lies another face, such as the end of a prism, of which its sides know nothing.
    pub fn corner_normals(&self, crease: f64) -> Vec<[Vec3; 3]> {
        let mut at: Vec<Vec<(u32, f64)>> = vec![Vec::new(); self.tree.points().len()];
        for (t, tri) in self.tree.triangles().iter().enumerate() {
            for i in 0..3 {
                at[tri[i] as usize].push((t as u32, self.corner_angle(tri, i)));
            }
        }
        let limit = crease.fixed_cos();
        let smooth = |own: Vec3, corner: u32| {
            let around = at[corner as usize].iter();
            let sum = around.fold([0.0; 3], |sum, &(t, angle)| {
                let normal = self.face_normals[t as usize];
                if dot(normal, own) > limit {
                    add(sum, scale(normal, angle))
                } else {
                    sum
                }
            });
            unit(sum)
        };
        (self.tree.triangles().iter().zip(&self.face_normals))
            .map(|(t, own)| t.map(|corner| smooth(*own, corner)))
            .collect()
    }

    /// Weights of the three corners of a triangle (index into [`Surface::triangles`]) at a place on it (m).
    pub fn weights(&self, triangle: usize, place: Vec3) -> [f64; 3] {
        let [a, b, c] = self.tree.triangles()[triangle].map(|i| self.tree.points()[i as usize]);
        let normal = cross(sub(b, a), sub(c, a));
        let part = |p: Vec3, q: Vec3| {
            dot(cross(sub(p, place), sub(q, place)), normal) / dot(normal, normal)
        };
        [part(b, c), part(c, a), part(a, b)]
    }

    /// Angle of a triangle at its corner `i` (rad).
    fn corner_angle(&self, tri: &[u32; 3], i: usize) -> f64 {
        let p = self.tree.points()[tri[i] as usize];
        let u = unit(sub(self.tree.points()[tri[(i + 1) % 3] as usize], p));
        let v = unit(sub(self.tree.points()[tri[(i + 2) % 3] as usize], p));
        norm(cross(u, v)).fixed_atan2(dot(u, v))
    }

    fn set_edge_normals(&mut self) {
        let mut sides: Vec<(u32, u32, u32, usize)> =
            Vec::with_capacity(3 * self.tree.triangles().len());
        for (t, tri) in self.tree.triangles().iter().enumerate() {
            for i in 0..3 {
                let (a, b) = (tri[i], tri[(i + 1) % 3]);
                sides.push((a.min(b), a.max(b), t as u32, i));
            }
        }
        sides.sort_unstable();
        for group in sides.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            let sum = group
                .iter()
                .fold([0.0; 3], |s, g| add(s, self.face_normals[g.2 as usize]));
            for &(a, b, t, i) in group {
                self.edge_normals[t as usize][i] = unit(sum);
                if group.len() == 1 {
                    self.free_edges[t as usize][i] = true;
                    self.free_vertices[a as usize] = true;
                    self.free_vertices[b as usize] = true;
                }
            }
        }
    }

    fn set_vertex_normals(&mut self) {
        for (t, tri) in self.tree.triangles().iter().enumerate() {
            for i in 0..3 {
                let angle = self.corner_angle(tri, i);
                let n = &mut self.vertex_normals[tri[i] as usize];
                *n = add(*n, scale(self.face_normals[t], angle));
            }
        }
        for n in &mut self.vertex_normals {
            *n = unit(*n);
        }
    }

    /// The point of the surface closest to `p` (m). Of triangles equally near, the one of lowest index.
    pub fn closest(&self, p: Vec3) -> Closest {
        let found = self.search(p, f64::INFINITY, None);
        found.expect("a surface has a triangle")
    }

    /// The same, sooner where `hint` is a triangle that is near: that of the last search nearby.
    ///
    /// # Panics
    /// When there is no triangle `hint`.
    pub fn closest_from(&self, p: Vec3, hint: usize) -> Closest {
        let found = self.search(p, f64::INFINITY, Some(hint));
        found.expect("a surface has a triangle")
    }

    /// The closest point, if it is nearer than `reach` (m). `hint`: a triangle that is near, if one is known.
    ///
    /// # Panics
    /// When there is no triangle `hint`.
    pub fn closest_within(&self, p: Vec3, reach: f64, hint: Option<usize>) -> Option<Closest> {
        self.search(p, reach, hint)
    }

    fn search(&self, p: Vec3, reach: f64, hint: Option<usize>) -> Option<Closest> {
        let found = self.tree.search(p, reach, hint)?;
        Some(self.describe(p, found.triangle as usize, found.point, found.feature))
    }

    fn describe(&self, p: Vec3, triangle: usize, point: Vec3, feature: Feature) -> Closest {
        let t = self.tree.triangles()[triangle];
        let (normal, on_free_edge) = match feature {
            Feature::Face => (self.face_normals[triangle], false),
            Feature::Edge(i) => (self.edge_normals[triangle][i], self.free_edges[triangle][i]),
            Feature::Vertex(i) => (
                self.vertex_normals[t[i] as usize],
                self.free_vertices[t[i] as usize],
            ),
        };
        let d = sub(p, point);
        let length = norm(d);
        let signed_distance = if dot(d, normal) < 0.0 {
            -length
        } else {
            length
        };
        Closest {
            point,
            signed_distance,
            triangle,
            feature,
            normal,
            on_free_edge,
        }
    }
}

/// For every point the lowest index of a point at the same place.
fn merge_equal(points: &[Vec3]) -> Vec<u32> {
    // Adding zero turns -0 into 0, which compare equal but have other bits.
    let key = |i: u32| points[i as usize].map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    order.sort_unstable_by_key(|&i| (key(i), i));
    let mut to = vec![0; points.len()];
    for group in order.chunk_by(|&a, &b| key(a) == key(b)) {
        for &i in group {
            to[i as usize] = group[0];
        }
    }
    to
}

fn twice_area(points: &[Vec3], t: &[u32; 3]) -> Vec3 {
    let [a, b, c] = t.map(|i| points[i as usize]);
    cross(sub(b, a), sub(c, a))
}
