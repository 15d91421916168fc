//! A surface as it is seen along z.

use crate::closest::Surface;
use plyflow_geometry::Bins;

/// Places on the side of a triangle lie in it, however they were rounded (m).
const ROUNDING: f64 = 1e-6;
/// Bins along a side at most.
const MOST: usize = 512;

/// What of the plane z = 0 the triangles of a surface cover, seen along z. A hole that goes through the surface is not covered.
#[derive(Debug, Clone)]
pub struct Outline<'a> {
    surface: &'a Surface,
    bins: Bins,
    low: [f64; 2],
    high: [f64; 2],
}

impl<'a> Outline<'a> {
    /// Of a surface.
    pub fn new(surface: &'a Surface) -> Self {
        let (low, high) = surface.bounds();
        let (low, high) = ([low[0], low[1]], [high[0], high[1]]);
        let each = (surface.triangles().len() as f64).sqrt() as usize;
        let count = each.clamp(1, MOST);
        let size = [0, 1].map(|d| ((high[d] - low[d]) / count as f64).max(ROUNDING));
        let mut bins = Bins::new(low, size, [count; 2]);
        for t in 0..surface.triangles().len() {
            let corners = corners(surface, t as u32);
            let of = |d: usize, pick: fn(f64, f64) -> f64| {
                corners.iter().map(|p| p[d]).fold(corners[0][d], pick)
            };
            let (a, b) = (
                [0, 1].map(|d| of(d, f64::min)),
                [0, 1].map(|d| of(d, f64::max)),
            );
            bins.insert(t as u32, a.map(|x| x - ROUNDING), b.map(|x| x + ROUNDING));
        }
        Self {
            surface,
            bins,
            low,
            high,
        }
    }

    /// Whether a line along z through a place (m) meets the surface.
    pub fn holds(&self, at: [f64; 2]) -> bool {
        let outside = |d: usize| at[d] < self.low[d] - ROUNDING || at[d] > self.high[d] + ROUNDING;
        if outside(0) || outside(1) {
            return false;
        }
        let covers = |t: &u32| covers(corners(self.surface, *t), at);
        self.bins.at(at).iter().any(covers)
    }
}

fn corners(surface: &Surface, triangle: u32) -> [[f64; 2]; 3] {
    surface.triangles()[triangle as usize].map(|i| {
        let [x, y, _] = surface.points()[i as usize];
        [x, y]
    })
}

/// Whether a triangle of the plane has a place (m) in it, whichever way it is wound.
fn covers(corners: [[f64; 2]; 3], at: [f64; 2]) -> bool {
    let across = |k: usize| {
        let (a, b) = (corners[k], corners[(k + 1) % 3]);
        let along = [b[0] - a[0], b[1] - a[1]];
        let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
        // Distance (m) from the side, times the side: what a wall seen from above has of it is nothing.
        (
            along[0] * (at[1] - a[1]) - along[1] * (at[0] - a[0]),
            length,
        )
    };
    let sides = [0, 1, 2].map(across);
    let area = {
        let [a, b, c] = corners;
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let longest = sides.iter().map(|s| s.1).fold(0.0, f64::max);
    // A wall along z is a line from above: it covers nothing.
    if area.abs() <= ROUNDING * longest {
        return false;
    }
    let sign = area.signum();
    sides
        .iter()
        .all(|(cross, length)| sign * cross >= -ROUNDING * length)
}
