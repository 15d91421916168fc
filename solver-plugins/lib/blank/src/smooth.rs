//! Moves nodes to where the cells around them are best.
//!
//! A corner of a cell with sides e1, e2 and det = e1 x e2 costs K^4 + 0.2 (det/a + a/det), K = (|e1|^2 + |e2|^2) / (2 det) the
//! condition number of its Jacobian (Knupp 2003: 1 for a square's corner, infinite for a flat one) and a the wanted area. Folded
//! corners cost far more, the more the more they are folded, so that they come out. Nodes go one after the other
//! to the best of eight places around them (on the edge: two), at steps that shrink when nothing improves.

use crate::edge::Curve;
use plyflow_model::outline::Point;

/// How a node may move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// Not at all.
    Fixed,
    /// Anywhere.
    Free,
    /// Along a contour (its number); the way along it (m).
    OnEdge(usize, f64),
}

/// Steps over the root of the wanted area, and how many rounds each is tried.
const STEPS: [f64; 8] = [0.2, 0.1, 0.05, 0.1, 0.05, 0.02, 0.01, 0.005];
const ROUNDS: usize = 12;
/// Weight of the cells' sizes.
const SIZE_WEIGHT: f64 = 0.2;
/// A corner is taken as folded below this share of the wanted area.
const FLAT: f64 = 0.02;

const D: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Where a free node may step.
const WAYS: [[f64; 2]; 8] = [
    [1.0, 0.0],
    [D, D],
    [0.0, 1.0],
    [-D, D],
    [-1.0, 0.0],
    [-D, -D],
    [0.0, -1.0],
    [D, -D],
];

/// Cost of a cell.
fn cost(p: [Point; 4], area: f64) -> f64 {
    let mut sum = 0.0;
    for k in 0..4 {
        let (a, b, c) = (p[k], p[(k + 1) % 4], p[(k + 3) % 4]);
        let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let det = (u[0] * v[1] - u[1] * v[0]) / area;
        let squares = (u[0] * u[0] + u[1] * u[1] + v[0] * v[0] + v[1] * v[1]) / area;
        let sound = det.max(FLAT);
        let condition = squares / (2.0 * sound);
        let square = condition * condition;
        sum += square * square + SIZE_WEIGHT * (sound + 1.0 / sound) + 1e9 * (sound - det);
    }
    sum
}

/// A mesh whose nodes move.
pub struct Moving<'a> {
    /// Of every node (m).
    pub points: &'a mut [Point],
    /// How each may move.
    pub places: &'a mut [Place],
    /// Nodes of every cell.
    pub cells: &'a [[u32; 4]],
    /// Contours that nodes move along.
    pub curves: &'a [Curve],
    /// That of a good cell (m2).
    pub area: f64,
}

impl Moving<'_> {
    /// Moves the nodes.
    pub fn smooth(&mut self) {
        let mut around: Vec<Vec<u32>> = vec![Vec::new(); self.points.len()];
        for (c, cell) in self.cells.iter().enumerate() {
            for n in cell {
                around[*n as usize].push(c as u32);
            }
        }
        let moving: Vec<usize> = (0..self.points.len())
            .filter(|n| self.places[*n] != Place::Fixed)
            .collect();
        for share in STEPS {
            let step = share * self.area.sqrt();
            // A node is tried again only after one of its cells has changed.
            let mut waiting = vec![true; self.points.len()];
            for _ in 0..ROUNDS {
                for n in &moving {
                    if std::mem::take(&mut waiting[*n]) && self.improve(*n, &around[*n], step) {
                        for m in around[*n].iter().flat_map(|c| self.cells[*c as usize]) {
                            waiting[m as usize] = true;
                        }
                    }
                }
            }
        }
    }

    /// Tries the places a `step` (m) around a node of the cells `around`; whether one is better.
    fn improve(&mut self, n: usize, around: &[u32], step: f64) -> bool {
        let Self {
            points,
            places,
            cells,
            curves,
            area,
        } = self;
        let at = points[n];
        let total = |at: Point| -> f64 {
            around
                .iter()
                .map(|c| {
                    let cell = cells[*c as usize];
                    cost(
                        cell.map(|m| {
                            if m as usize == n {
                                at
                            } else {
                                points[m as usize]
                            }
                        }),
                        *area,
                    )
                })
                .sum()
        };
        let mut best = (total(at) * (1.0 - 1e-9), None);
        let mut consider = |point: Point, place: Place| {
            let cost = total(point);
            if cost < best.0 {
                best = (cost, Some((point, place)));
            }
        };
        match places[n] {
            Place::Fixed => return false,
            Place::Free => {
                for w in WAYS {
                    consider([at[0] + step * w[0], at[1] + step * w[1]], Place::Free);
                }
            }
            Place::OnEdge(contour, way) => {
                for w in [-1.0, 1.0] {
                    let way = curves[contour].wrapped(way + w * step);
                    consider(curves[contour].point(way), Place::OnEdge(contour, way));
                }
            }
        }
        let Some((point, place)) = best.1 else {
            return false;
        };
        points[n] = point;
        places[n] = place;
        true
    }
}
