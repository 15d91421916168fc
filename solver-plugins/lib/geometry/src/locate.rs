//! Location of points in an undeformed quad mesh, seen from above.

use crate::bins::Bins;
use crate::rectangle;
use crate::vec3::Vec3;
use plyflow_fixed::FixedBits;

/// A place in a quad mesh: a cell and the bilinear weights of its nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Location {
    /// The cell.
    pub cell: usize,
    /// Its nodes.
    pub nodes: [u32; 4],
    /// Their weights; the sum is 1.
    pub weights: [f64; 4],
}

impl Location {
    /// The weighted sum of the nodes' values.
    pub fn interpolate(&self, values: &[Vec3]) -> Vec3 {
        let mut sum = [0.0; 3];
        for (&node, &w) in self.nodes.iter().zip(&self.weights) {
            for d in 0..3 {
                sum[d] += w * values[node as usize][d];
            }
        }
        sum
    }
}

/// Finds cells of a quad mesh by x and y. Cells may be of any convex shape and of very different sizes
/// (graded films).
#[derive(Debug, Clone)]
pub struct QuadLocator {
    corners: Vec<[[f64; 2]; 4]>,
    nodes: Vec<[u32; 4]>,
    bins: Bins,
}

impl QuadLocator {
    /// `points`: `[n]` (m, z is not looked at); `cells`: `[m * 4]`. `None` when there is no cell.
    ///
    /// # Panics
    /// When a cell names a point that is not there.
    pub fn new(points: &[Vec3], cells: &[u32]) -> Option<Self> {
        let nodes: Vec<[u32; 4]> = cells
            .chunks_exact(4)
            .map(|c| [c[0], c[1], c[2], c[3]])
            .collect();
        if nodes.is_empty() {
            return None;
        }
        let xy = |i: u32| [points[i as usize][0], points[i as usize][1]];
        let corners: Vec<[[f64; 2]; 4]> = nodes.iter().map(|c| c.map(xy)).collect();
        let [x0, y0, x1, y1] = rectangle::around(corners.iter().flatten().copied());
        let side = (corners.len() as f64).sqrt().ceil() as usize;
        let size = [x1 - x0, y1 - y0].map(|w| (w / side as f64).max(f64::MIN_POSITIVE));
        let mut bins = Bins::new([x0, y0], size, [side, side]);
        for (c, quad) in corners.iter().enumerate() {
            let [x0, y0, x1, y1] = rectangle::around(quad.iter().copied());
            bins.insert(c as u32, [x0, y0], [x1, y1]);
        }
        Some(Self {
            corners,
            nodes,
            bins,
        })
    }

    /// The cell that holds (x, y), or holds it up to `tolerance` (m) outside of its sides; then the weights
    /// are those of the nearest place inside. `None` when there is no such cell.
    pub fn locate(&self, x: f64, y: f64, tolerance: f64) -> Option<Location> {
        let from = self.bins.place([x - tolerance, y - tolerance]);
        let to = self.bins.place([x + tolerance, y + tolerance]);
        let mut best: Option<(f64, Location)> = None;
        for c in self.bins.between(from, to) {
            let (miss, location) = self.within(c as usize, [x, y]);
            if miss <= tolerance && best.as_ref().is_none_or(|(m, _)| miss < *m) {
                best = Some((miss, location));
            }
        }
        best.map(|(_, location)| location)
    }

    /// As [`QuadLocator::locate`], but the weights go on beyond the sides of the nearest cell, so that they are those of (x, y) itself: for places
    /// between an edge that is curved and the chords of a mesh along it.
    pub fn locate_beyond(&self, x: f64, y: f64, tolerance: f64) -> Option<Location> {
        let near = self.locate(x, y, tolerance)?;
        let weights = weights(self.inverse(near.cell, [x, y]));
        Some(Location { weights, ..near })
    }

    /// Where the bilinear map of a cell has a point, by Newton's method.
    fn inverse(&self, cell: usize, p: [f64; 2]) -> [f64; 2] {
        let q = &self.corners[cell];
        let (mut s, mut t) = (0.5, 0.5);
        for _ in 0..25 {
            let w = weights([s, t]);
            let mut r = p;
            let (mut ds, mut dt) = ([0.0; 2], [0.0; 2]);
            for d in 0..2 {
                r[d] -= (0..4).map(|i| w[i] * q[i][d]).sum::<f64>();
                ds[d] = (1.0 - t) * (q[1][d] - q[0][d]) + t * (q[2][d] - q[3][d]);
                dt[d] = (1.0 - s) * (q[3][d] - q[0][d]) + s * (q[2][d] - q[1][d]);
            }
            let determinant = ds[0] * dt[1] - ds[1] * dt[0];
            if determinant == 0.0 {
                break;
            }
            let step = [
                (r[0] * dt[1] - r[1] * dt[0]) / determinant,
                (ds[0] * r[1] - ds[1] * r[0]) / determinant,
            ];
            // Far outside the map folds over; there the point only has to be seen as outside.
            s = (s + step[0]).clamp(-10.0, 11.0);
            t = (t + step[1]).clamp(-10.0, 11.0);
            if step[0].abs() + step[1].abs() < 1e-14 {
                break;
            }
        }
        [s, t]
    }

    /// The place of a cell that is nearest to a point, and how far outside of the cell that lies (m).
    fn within(&self, cell: usize, p: [f64; 2]) -> (f64, Location) {
        let q = &self.corners[cell];
        let w = weights(self.inverse(cell, p).map(|s| s.clamp(0.0, 1.0)));
        let inside = [0, 1].map(|d| (0..4).map(|i| w[i] * q[i][d]).sum::<f64>());
        let miss = (p[0] - inside[0]).fixed_hypot(p[1] - inside[1]);
        (
            miss,
            Location {
                cell,
                nodes: self.nodes[cell],
                weights: w,
            },
        )
    }
}

fn weights([s, t]: [f64; 2]) -> [f64; 4] {
    [(1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t]
}
