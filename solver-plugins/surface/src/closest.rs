//! Exact closest point and signed distance to a triangulated surface.

use crate::vector::{Vec3, add, cross, dot, norm, scale, sub, unit};
use plyflow_fixed::FixedBits;

/// Where on its triangle a closest point lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Feature {
    /// Inside the triangle.
    Face,
    /// On the side from corner `i` to corner `i + 1`.
    Edge(usize),
    /// On corner `i`.
    Vertex(usize),
}

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

/// Leaves hold at most this many triangles: fewer boxes cost more in the tree than they save.
const LEAF: usize = 4;

#[derive(Debug, Clone, Copy)]
struct Node {
    low: Vec3,
    high: Vec3,
    /// Leaf: first position in `order`. Inner node: index of the second child (the first follows it).
    start: u32,
    /// Leaf: number of triangles; 0: inner node.
    count: u32,
}

/// A triangulated surface with a tree of boxes over its triangles. Corners at bit-equal places count as
/// one node, so that a triangle soup (STL) gets its edges back.
#[derive(Debug, Clone)]
pub struct Surface {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    face_normals: Vec<Vec3>,
    edge_normals: Vec<[Vec3; 3]>,
    vertex_normals: Vec<Vec3>,
    free_edges: Vec<[bool; 3]>,
    free_vertices: Vec<bool>,
    order: Vec<u32>,
    nodes: Vec<Node>,
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
        if triangles.is_empty() {
            return None;
        }
        let face_normals: Vec<Vec3> = triangles
            .iter()
            .map(|t| unit(twice_area(points, t)))
            .collect();
        let mut surface = Self {
            points: points.to_vec(),
            edge_normals: vec![[[0.0; 3]; 3]; triangles.len()],
            vertex_normals: vec![[0.0; 3]; points.len()],
            free_edges: vec![[false; 3]; triangles.len()],
            free_vertices: vec![false; points.len()],
            order: (0..triangles.len() as u32).collect(),
            nodes: Vec::new(),
            triangles,
            face_normals,
        };
        surface.set_edge_normals();
        surface.set_vertex_normals();
        let centres: Vec<Vec3> = surface
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| surface.points[i as usize]);
                add(a, add(b, c))
            })
            .collect();
        surface.build(&centres, 0, surface.triangles.len());
        Some(surface)
    }

    /// The points as given (m).
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }

    /// Triangles that have an area, after merging equal points.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Lowest and highest corner of the box around the surface (m).
    pub fn bounds(&self) -> (Vec3, Vec3) {
        (self.nodes[0].low, self.nodes[0].high)
    }

    /// By triangle, the unit normals of the smooth surface that it stands for, at its three corners: of the triangles at a corner, those count that are turned
    /// against it by less than `crease` (rad), by their angles there. Beyond that lies another face, such as the end of a prism, of which its sides know nothing.
    pub fn corner_normals(&self, crease: f64) -> Vec<[Vec3; 3]> {
        let mut at: Vec<Vec<(u32, f64)>> = vec![Vec::new(); self.points.len()];
        for (t, tri) in self.triangles.iter().enumerate() {
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
        (self.triangles.iter().zip(&self.face_normals))
            .map(|(t, own)| t.map(|corner| smooth(*own, corner)))
            .collect()
    }

    /// Weights of the three corners of a triangle (index into [`Surface::triangles`]) at a place on it (m).
    pub fn weights(&self, triangle: usize, place: Vec3) -> [f64; 3] {
        let [a, b, c] = self.triangles[triangle].map(|i| self.points[i as usize]);
        let normal = cross(sub(b, a), sub(c, a));
        let part = |p: Vec3, q: Vec3| {
            dot(cross(sub(p, place), sub(q, place)), normal) / dot(normal, normal)
        };
        [part(b, c), part(c, a), part(a, b)]
    }

    /// Angle of a triangle at its corner `i` (rad).
    fn corner_angle(&self, tri: &[u32; 3], i: usize) -> f64 {
        let p = self.points[tri[i] as usize];
        let u = unit(sub(self.points[tri[(i + 1) % 3] as usize], p));
        let v = unit(sub(self.points[tri[(i + 2) % 3] as usize], p));
        norm(cross(u, v)).fixed_atan2(dot(u, v))
    }

    fn set_edge_normals(&mut self) {
        let mut sides: Vec<(u32, u32, u32, usize)> = Vec::with_capacity(3 * self.triangles.len());
        for (t, tri) in self.triangles.iter().enumerate() {
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
        for (t, tri) in self.triangles.iter().enumerate() {
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

    fn build(&mut self, centres: &[Vec3], start: usize, end: usize) {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        let (mut clow, mut chigh) = (low, high);
        for &t in &self.order[start..end] {
            for i in self.triangles[t as usize] {
                for d in 0..3 {
                    low[d] = low[d].min(self.points[i as usize][d]);
                    high[d] = high[d].max(self.points[i as usize][d]);
                }
            }
            for d in 0..3 {
                clow[d] = clow[d].min(centres[t as usize][d]);
                chigh[d] = chigh[d].max(centres[t as usize][d]);
            }
        }
        let at = self.nodes.len();
        self.nodes.push(Node {
            low,
            high,
            start: start as u32,
            count: (end - start) as u32,
        });
        if end - start <= LEAF {
            return;
        }
        let extent = sub(chigh, clow);
        let axis = (0..3)
            .max_by(|&a, &b| extent[a].total_cmp(&extent[b]))
            .unwrap_or(0);
        let middle = (end - start) / 2;
        self.order[start..end].select_nth_unstable_by(middle, |&a, &b| {
            centres[a as usize][axis]
                .total_cmp(&centres[b as usize][axis])
                .then(a.cmp(&b))
        });
        self.build(centres, start, start + middle);
        let second = self.nodes.len() as u32;
        self.build(centres, start + middle, end);
        self.nodes[at].start = second;
        self.nodes[at].count = 0;
    }

    /// The point of the surface closest to `p` (m). Of triangles equally near, the one of lowest index.
    pub fn closest(&self, p: Vec3) -> Closest {
        let found = self.closest_within(p, f64::INFINITY);
        found.expect("a surface has a triangle")
    }

    /// The same, if it is nearer than `reach` (m).
    pub fn closest_within(&self, p: Vec3, reach: f64) -> Option<Closest> {
        let mut best = (reach * reach, u32::MAX, [0.0; 3], Feature::Face);
        let mut stack = vec![(0usize, box_distance(&self.nodes[0], p))];
        while let Some((n, bound)) = stack.pop() {
            if bound > best.0 {
                continue;
            }
            let node = &self.nodes[n];
            if node.count == 0 {
                let (a, b) = (n + 1, node.start as usize);
                let (da, db) = (
                    box_distance(&self.nodes[a], p),
                    box_distance(&self.nodes[b], p),
                );
                // The nearer box last: it is looked into first.
                if da <= db {
                    stack.extend([(b, db), (a, da)]);
                } else {
                    stack.extend([(a, da), (b, db)]);
                }
                continue;
            }
            for &t in &self.order[node.start as usize..(node.start + node.count) as usize] {
                let corners = self.triangles[t as usize].map(|i| self.points[i as usize]);
                let (q, feature) = closest_on_triangle(p, corners);
                let d = sub(p, q);
                let squared = dot(d, d);
                if squared < best.0 || (squared == best.0 && t < best.1) {
                    best = (squared, t, q, feature);
                }
            }
        }
        (best.1 != u32::MAX).then(|| self.describe(p, best.1 as usize, best.2, best.3))
    }

    fn describe(&self, p: Vec3, triangle: usize, point: Vec3, feature: Feature) -> Closest {
        let t = self.triangles[triangle];
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

fn box_distance(node: &Node, p: Vec3) -> f64 {
    (0..3)
        .map(|d| {
            let outside = (node.low[d] - p[d]).max(p[d] - node.high[d]).max(0.0);
            outside * outside
        })
        .sum()
}

/// Closest point of a triangle by the regions of its plane (C. Ericson, Real-Time Collision Detection, 5.1.5).
pub(crate) fn closest_on_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> (Vec3, Feature) {
    let (ab, ac, ap) = (sub(b, a), sub(c, a), sub(p, a));
    let (d1, d2) = (dot(ab, ap), dot(ac, ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, Feature::Vertex(0));
    }
    let bp = sub(p, b);
    let (d3, d4) = (dot(ab, bp), dot(ac, bp));
    if d3 >= 0.0 && d4 <= d3 {
        return (b, Feature::Vertex(1));
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return (add(a, scale(ab, d1 / (d1 - d3))), Feature::Edge(0));
    }
    let cp = sub(p, c);
    let (d5, d6) = (dot(ab, cp), dot(ac, cp));
    if d6 >= 0.0 && d5 <= d6 {
        return (c, Feature::Vertex(2));
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return (add(a, scale(ac, d2 / (d2 - d6))), Feature::Edge(2));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (add(b, scale(sub(c, b), w)), Feature::Edge(1));
    }
    let sum = 1.0 / (va + vb + vc);
    (
        add(a, add(scale(ab, vb * sum), scale(ac, vc * sum))),
        Feature::Face,
    )
}
