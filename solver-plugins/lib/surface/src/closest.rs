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

/// Triangles with a tree of boxes over them: which of them is closest, and nothing of sides.
#[derive(Debug, Clone)]
pub struct TriangleTree {
    points: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    order: Vec<u32>,
    nodes: Vec<Node>,
}

/// The closest triangle of a tree.
struct Nearest {
    squared: f64,
    triangle: u32,
    point: Vec3,
    feature: Feature,
}

impl TriangleTree {
    /// Over triangles with an area; `None` when there are none.
    ///
    /// # Panics
    /// When a triangle names a point that is not there.
    pub fn new(points: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Option<Self> {
        if triangles.is_empty() {
            return None;
        }
        let centres: Vec<Vec3> = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| points[i as usize]);
                add(a, add(b, c))
            })
            .collect();
        let count = triangles.len();
        let mut tree = Self {
            points,
            order: (0..count as u32).collect(),
            nodes: Vec::with_capacity(count),
            triangles,
        };
        tree.build(&centres, 0, count);
        tree.nodes.shrink_to_fit();
        Some(tree)
    }

    /// The triangle closest to `p` (m); of those equally near, the one of lowest index. `hint`: a triangle that is near.
    ///
    /// # Panics
    /// When there is no triangle `hint`.
    pub fn closest_from(&self, p: Vec3, hint: usize) -> usize {
        let found = self.search(p, f64::INFINITY, Some(hint));
        found.expect("a tree has a triangle").triangle as usize
    }

    /// The same, if it is nearer than `reach` (m).
    ///
    /// # Panics
    /// When there is no triangle `hint`.
    pub fn closest_within(&self, p: Vec3, reach: f64, hint: Option<usize>) -> Option<usize> {
        Some(self.search(p, reach, hint)?.triangle as usize)
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

    fn search(&self, p: Vec3, reach: f64, hint: Option<usize>) -> Option<Nearest> {
        let mut best = Nearest {
            squared: reach * reach,
            triangle: u32::MAX,
            point: [0.0; 3],
            feature: Feature::Face,
        };
        let look = |best: &mut Nearest, t: u32| {
            let [a, b, c] = self.triangles[t as usize];
            let place = |i: u32| self.points[i as usize];
            let (point, feature) = closest_on_triangle(p, [place(a), place(b), place(c)]);
            let d = sub(p, point);
            let squared = dot(d, d);
            if squared < best.squared || (squared == best.squared && t < best.triangle) {
                *best = Nearest {
                    squared,
                    triangle: t,
                    point,
                    feature,
                };
            }
        };
        if let Some(t) = hint {
            look(&mut best, t as u32);
        }
        // Halved at every level, a tree over as many triangles as have a number is not that deep.
        let mut stack = [(0u32, 0.0f64); 40];
        stack[0] = (0, box_distance(&self.nodes[0], p));
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let (n, bound) = stack[depth];
            if bound > best.squared {
                continue;
            }
            let node = &self.nodes[n as usize];
            if node.count == 0 {
                let (a, b) = (n + 1, node.start);
                let da = box_distance(&self.nodes[a as usize], p);
                let db = box_distance(&self.nodes[b as usize], p);
                // The nearer box last: it is looked into first.
                let both = match da <= db {
                    true => [(b, db), (a, da)],
                    false => [(a, da), (b, db)],
                };
                for child in both {
                    stack[depth] = child;
                    depth += usize::from(child.1 <= best.squared);
                }
                continue;
            }
            for &t in &self.order[node.start as usize..(node.start + node.count) as usize] {
                look(&mut best, t);
            }
        }
        (best.triangle != u32::MAX).then_some(best)
    }
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
        &self.tree.points
    }

    /// Triangles that have an area, after merging equal points.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.tree.triangles
    }

    /// Lowest and highest corner of the box around the surface (m).
    pub fn bounds(&self) -> (Vec3, Vec3) {
        (self.tree.nodes[0].low, self.tree.nodes[0].high)
    }

    /// By triangle, the unit normals of the smooth surface that it stands for, at its three corners: of the triangles at a corner, those count that are turned
    /// against it by less than `crease` (rad), by their angles there. Beyond that lies another face, such as the end of a prism, of which its sides know nothing.
    pub fn corner_normals(&self, crease: f64) -> Vec<[Vec3; 3]> {
        let mut at: Vec<Vec<(u32, f64)>> = vec![Vec::new(); self.tree.points.len()];
        for (t, tri) in self.tree.triangles.iter().enumerate() {
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
        (self.tree.triangles.iter().zip(&self.face_normals))
            .map(|(t, own)| t.map(|corner| smooth(*own, corner)))
            .collect()
    }

    /// Weights of the three corners of a triangle (index into [`Surface::triangles`]) at a place on it (m).
    pub fn weights(&self, triangle: usize, place: Vec3) -> [f64; 3] {
        let [a, b, c] = self.tree.triangles[triangle].map(|i| self.tree.points[i as usize]);
        let normal = cross(sub(b, a), sub(c, a));
        let part = |p: Vec3, q: Vec3| {
            dot(cross(sub(p, place), sub(q, place)), normal) / dot(normal, normal)
        };
        [part(b, c), part(c, a), part(a, b)]
    }

    /// Angle of a triangle at its corner `i` (rad).
    fn corner_angle(&self, tri: &[u32; 3], i: usize) -> f64 {
        let p = self.tree.points[tri[i] as usize];
        let u = unit(sub(self.tree.points[tri[(i + 1) % 3] as usize], p));
        let v = unit(sub(self.tree.points[tri[(i + 2) % 3] as usize], p));
        norm(cross(u, v)).fixed_atan2(dot(u, v))
    }

    fn set_edge_normals(&mut self) {
        let mut sides: Vec<(u32, u32, u32, usize)> =
            Vec::with_capacity(3 * self.tree.triangles.len());
        for (t, tri) in self.tree.triangles.iter().enumerate() {
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
        for (t, tri) in self.tree.triangles.iter().enumerate() {
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
        let t = self.tree.triangles[triangle];
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

#[inline]
fn box_distance(node: &Node, p: Vec3) -> f64 {
    let mut sum = 0.0;
    for d in 0..3 {
        let outside = (node.low[d] - p[d]).max(p[d] - node.high[d]).max(0.0);
        sum += outside * outside;
    }
    sum
}

/// Closest point of a triangle by the regions of its plane (C. Ericson, Real-Time Collision Detection, 5.1.5).
#[inline(always)]
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
