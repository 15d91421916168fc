//! Which of many triangles is closest.

use crate::vec3::{Vec3, add, dot, scale, sub};

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
    /// Triangle and its corners by place in the tree: what is near in space is near in memory.
    order: Vec<u32>,
    leaves: Vec<[Vec3; 3]>,
    nodes: Vec<Node>,
}

/// The closest triangle of a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Nearest {
    /// Index of the triangle.
    pub triangle: u32,
    /// Its point closest to the place asked for (m).
    pub point: Vec3,
    /// Where on the triangle that lies.
    pub feature: Feature,
    /// Square of the distance (m2).
    pub squared: f64,
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
            leaves: Vec::new(),
            order: (0..count as u32).collect(),
            nodes: Vec::with_capacity(count),
            triangles,
        };
        tree.build(&centres, 0, count);
        tree.nodes.shrink_to_fit();
        tree.leaves = (tree.order.iter())
            .map(|t| tree.corners(*t as usize))
            .collect();
        Some(tree)
    }

    /// The points as given (m).
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }

    /// The triangles as given.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// Corners (m) of a triangle.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|i| self.points[i as usize])
    }

    /// Lowest and highest corner of the box around all triangles (m).
    pub fn bounds(&self) -> (Vec3, Vec3) {
        (self.nodes[0].low, self.nodes[0].high)
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

    /// The closest point of the triangles to `p` (m), if it is nearer than `reach` (m); of triangles equally near, that of the one of lowest index.
    /// `hint`: a triangle that is near, if one is known.
    ///
    /// # Panics
    /// When there is no triangle `hint`.
    pub fn search(&self, p: Vec3, reach: f64, hint: Option<usize>) -> Option<Nearest> {
        let mut best = Nearest {
            squared: reach * reach,
            triangle: u32::MAX,
            point: [0.0; 3],
            feature: Feature::Face,
        };
        let look = |best: &mut Nearest, t: u32, corners: [Vec3; 3]| {
            let (point, feature) = closest_on_triangle(p, corners);
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
            look(&mut best, t as u32, self.corners(t));
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
            let leaf = node.start as usize..(node.start + node.count) as usize;
            for (t, corners) in self.order[leaf.clone()].iter().zip(&self.leaves[leaf]) {
                look(&mut best, *t, *corners);
            }
        }
        (best.triangle != u32::MAX).then_some(best)
    }
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
pub fn closest_on_triangle(p: Vec3, [a, b, c]: [Vec3; 3]) -> (Vec3, Feature) {
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
