//! A triangulated surface and what can be said about it.

use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub};

/// The surface of a rigid tool. Facets are counter-clockwise seen from outside, so that normals point away
/// from the tool's body, towards the sheets.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ToolMesh {
    /// Positions (m), one row per point: x, y, z.
    pub points: Vec<[f64; 3]>,
    /// Indices into `points`, one row per facet.
    pub triangles: Vec<[u32; 3]>,
}

/// How the facets hang together.
#[derive(Debug, Clone, Default)]
pub(crate) struct Adjacency {
    /// For each facet its three edges' neighbours (edge k runs from corner k to corner k + 1).
    pub neighbour: Vec<[Option<u32>; 3]>,
    /// First edge shared by more than two facets: its points.
    pub crowded: Option<[u32; 2]>,
    /// First edge that two facets pass in the same direction: its points.
    pub flipped: Option<[u32; 2]>,
    /// Edges with one facet only: their points.
    pub open: Vec<[u32; 2]>,
}

impl ToolMesh {
    /// Corners of one facet.
    #[inline]
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        self.triangles[triangle].map(|p| self.points[p as usize])
    }

    /// Twice the facet's area times its unit normal.
    #[inline]
    pub(crate) fn area_normal(&self, triangle: usize) -> Vec3 {
        let [a, b, c] = self.corners(triangle);
        cross(sub(b, a), sub(c, a))
    }

    /// Area of all facets (m2).
    pub fn area(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| 0.5 * norm(self.area_normal(t)))
            .sum()
    }

    /// Enclosed volume (m3), negative when the facets point inwards. Meaningful for closed surfaces. What lies in several bodies counts once, to
    /// within some thousandths of it.
    pub fn volume(&self) -> f64 {
        let of = |t| dot(self.corners(t)[0], self.area_normal(t)) / 6.0;
        let sum: f64 = (0..self.triangles.len()).map(of).sum();
        let [low, high] = self.bounds();
        let [_, again] = self.counted_again([low[0], low[1], high[0], high[1]], low[2]);
        sum - again
    }

    /// Lowest and highest coordinates. Both zero for an empty mesh.
    pub fn bounds(&self) -> [Vec3; 2] {
        let Some(&first) = self.points.first() else {
            return [[0.0; 3]; 2];
        };
        self.points
            .iter()
            .fold([first, first], |[mut lo, mut hi], p| {
                for k in 0..3 {
                    lo[k] = lo[k].min(p[k]);
                    hi[k] = hi[k].max(p[k]);
                }
                [lo, hi]
            })
    }

    /// Whether every edge has exactly two facets, which pass it in opposite directions.
    pub fn is_watertight(&self) -> bool {
        let a = self.adjacency();
        a.crowded.is_none() && a.flipped.is_none() && a.open.is_empty()
    }

    /// Longest edge (m).
    pub fn longest_edge(&self) -> f64 {
        (0..self.triangles.len())
            .map(|t| {
                let c = self.corners(t);
                (0..3)
                    .map(|k| norm(sub(c[(k + 1) % 3], c[k])))
                    .fold(0.0, f64::max)
            })
            .fold(0.0, f64::max)
    }

    pub(crate) fn adjacency(&self) -> Adjacency {
        // (low point, high point, facet, edge, runs from low to high), sorted: deterministic.
        let mut edges: Vec<(u32, u32, u32, u8, bool)> =
            Vec::with_capacity(3 * self.triangles.len());
        for (t, tri) in self.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (tri[k], tri[(k + 1) % 3]);
                edges.push((a.min(b), a.max(b), t as u32, k as u8, a < b));
            }
        }
        edges.sort_unstable();
        let mut found = Adjacency {
            neighbour: vec![[None; 3]; self.triangles.len()],
            ..Adjacency::default()
        };
        for group in edges.chunk_by(|p, q| (p.0, p.1) == (q.0, q.1)) {
            match group {
                [p] => found.open.push([p.0, p.1]),
                [p, q] => {
                    if p.4 == q.4 {
                        found.flipped.get_or_insert([p.0, p.1]);
                    }
                    found.neighbour[p.2 as usize][p.3 as usize] = Some(q.2);
                    found.neighbour[q.2 as usize][q.3 as usize] = Some(p.2);
                }
                _ => {
                    found.crowded.get_or_insert([group[0].0, group[0].1]);
                }
            }
        }
        found
    }

    /// Which body each facet is of: facets that share edges are of one. Numbered in the order of their first facets.
    pub(crate) fn bodies(&self) -> Vec<u32> {
        let adjacency = self.adjacency();
        let mut of = vec![u32::MAX; self.triangles.len()];
        let mut count = 0;
        for first in 0..self.triangles.len() {
            if of[first] != u32::MAX {
                continue;
            }
            let mut open = vec![first];
            of[first] = count;
            while let Some(t) = open.pop() {
                for next in adjacency.neighbour[t].into_iter().flatten() {
                    if of[next as usize] == u32::MAX {
                        of[next as usize] = count;
                        open.push(next as usize);
                    }
                }
            }
            count += 1;
        }
        of
    }

    /// The bodies of which it consists, each with all points: facets that share edges. The order is that of their first facets.
    pub(crate) fn shells(&self) -> Vec<ToolMesh> {
        let of = self.bodies();
        let count = of.iter().max().map_or(0, |m| *m as usize + 1);
        let empty = || ToolMesh {
            points: self.points.clone(),
            triangles: Vec::new(),
        };
        let mut shells: Vec<ToolMesh> = (0..count).map(|_| empty()).collect();
        for (t, shell) in of.iter().enumerate() {
            shells[*shell as usize].triangles.push(self.triangles[t]);
        }
        shells
    }

    /// Adds a point and returns its index.
    pub(crate) fn push(&mut self, p: Vec3) -> u32 {
        self.points.push(p);
        (self.points.len() - 1) as u32
    }

    /// Adds the quadrilateral a, b, c, d (counter-clockwise from outside), split along its shorter diagonal.
    pub(crate) fn quad(&mut self, a: u32, b: u32, c: u32, d: u32) {
        let length = |p: u32, q: u32| norm(sub(self.points[p as usize], self.points[q as usize]));
        if length(a, c) <= length(b, d) {
            self.triangles.extend([[a, b, c], [a, c, d]]);
        } else {
            self.triangles.extend([[a, b, d], [b, c, d]]);
        }
    }

    /// The surface that contact may see: facets lying on the bed are left out and the walls go on below it
    /// by `depth`, in the direction in which they arrive. Near the bed the distance is then that to the
    /// wall, from both sides; with the closed body a point just inside the wall would be pushed down,
    /// through the bottom.
    pub(crate) fn without_bottom(&self, depth: f64) -> ToolMesh {
        // Of a punch the foot may lie anywhere; single precision leaves 10 um of a file's metre.
        let [lo, hi] = self.bounds();
        let near = (1e-6 * (hi[2] - lo[2])).max(1e-5);
        let on_bed = |p: u32| self.points[p as usize][2] - lo[2] <= near;
        let mut mesh = ToolMesh {
            points: self.points.clone(),
            triangles: Vec::new(),
        };
        let is_bottom =
            |t: usize| self.triangles[t].iter().all(|&p| on_bed(p)) && self.area_normal(t)[2] < 0.0;
        mesh.triangles = (0..self.triangles.len())
            .filter(|t| !is_bottom(*t))
            .map(|t| self.triangles[t])
            .collect();
        let adjacency = mesh.adjacency();
        let mut sums = vec![[0.0; 3]; mesh.points.len()];
        let mut rim = Vec::new();
        for (t, tri) in mesh.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (tri[k], tri[(k + 1) % 3]);
                if adjacency.neighbour[t][k].is_some() || !on_bed(a) || !on_bed(b) {
                    continue;
                }
                // In the facet, square to the edge, away from the facet.
                let along = sub(mesh.points[b as usize], mesh.points[a as usize]);
                let down = cross(along, mesh.area_normal(t));
                if down[2] < -0.05 * norm(down) {
                    let step = scale(down, 1.0 / -down[2]);
                    for p in [a, b] {
                        sums[p as usize] = add(sums[p as usize], step);
                    }
                    rim.push([a, b]);
                }
            }
        }
        let mut below = vec![u32::MAX; mesh.points.len()];
        for p in rim.iter().flatten().copied() {
            if below[p as usize] == u32::MAX {
                let sum = sums[p as usize];
                let step = scale(sum, -depth / sum[2]);
                below[p as usize] = mesh.push(add(self.points[p as usize], step));
            }
        }
        for [a, b] in rim {
            mesh.quad(b, a, below[a as usize], below[b as usize]);
        }
        mesh
    }
}
