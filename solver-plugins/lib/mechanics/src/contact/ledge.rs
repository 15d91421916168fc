//! What a sheet goes on by past its rims, and how it ends there: ours, `docs/decisions/0050-what-slides-off-an-edge.md`.

use super::blend::Pull;
use super::closest::{Closest, RIM, Surface, combine};
use crate::mesh::NONE;
use crate::vec3::{Vec3, add, cross, dot, norm, scale, sub};

/// Whether a closest point lies where what a cell goes on by past a free rim ends.
pub(super) fn at_rim(c: &Closest) -> bool {
    ends_at(c.xi)
}

/// Whether what a cell goes on by past a rim ends at a place in it.
#[inline(always)]
pub(super) fn ends_at(xi: [f64; 2]) -> bool {
    xi.iter().any(|x| x.abs() > 1.0 + 0.999 * RIM)
}

/// Whether a closest point lies past a free rim, on what a cell goes on by there.
#[inline(always)]
pub(super) fn past_rim(c: &Closest) -> bool {
    c.xi.iter().any(|x| x.abs() > 1.0)
}

/// Share by which the distance at which sheets touch is less at the end of what a cell goes on by past a rim, unless that is steeper than [`SLOPE`].
pub(super) const BEVEL: f64 = 0.7;

/// Steepest slope of that. A contact along a slope is stiffer, by 1 + slope squared, which the step must bear.
const SLOPE: f64 = 0.5;

/// Share of the cells at a sheet's rims that are shorter across the rim than what its slope is told from.
const SHORTER: f64 = 0.1;

/// [`super::SheetContact::ledge`] (m) of sheets that touch at the distance `offset` (m), where the cells at the master's rims are `height` (m) long
/// across these ([`rim_height`]).
pub fn ledge(offset: f64, height: f64) -> f64 {
    (BEVEL * offset).min(0.25 * SLOPE * RIM * height)
}

/// How long (m) cells at rims are across these: nine in ten are longer. `cells`, `neighbours`: those of one sheet; `x`: positions of all nodes (m).
/// `None`: the sheet has no rim.
pub fn rim_height(cells: &[[u32; 4]], neighbours: &[[u32; 4]], x: &[Vec3]) -> Option<f64> {
    let heights = cells.iter().zip(neighbours).flat_map(|(cell, near)| {
        let x = cell.map(|n| x[n as usize]);
        let [south, east, north, west] = [0, 1, 2, 3].map(|k| sub(x[(k + 1) % 4], x[k]));
        // Middle lines; sides 0 and 2 run along the first.
        let lines = [sub(south, north), sub(east, west)].map(|l| scale(l, 0.5));
        let area = norm(cross(lines[0], lines[1]));
        let rims = (0..4).filter(|k| near[*k] == NONE);
        rims.map(move |k| area / norm(lines[k % 2]))
    });
    let mut heights: Vec<f64> = heights.collect();
    heights.sort_by(f64::total_cmp);
    heights
        .get((SHORTER * heights.len() as f64) as usize)
        .copied()
}

/// What a cell goes on by past a free rim, at a place on it.
///
/// A node that slides past the rim of a sheet hands what presses on it over to the rim's nodes, which lie below its cells. Held at the whole
/// distance to the last, it would drop onto these with the whole of its load at once. So the sheet grows thinner from its rim outwards, by a
/// parabola, and the rim's nodes take the load while the slave slides.
pub(super) struct Ledge {
    /// By coordinate: 0 at the rim, 1 where the ledge ends.
    past: [f64; 2],
    /// By how much the distance in touch is less there (m).
    most: f64,
}

impl Ledge {
    /// The ledge that a closest point lies on. `most` ([`super::SheetContact::ledge`]) is one for the whole sheet: it is nothing that differs from cell to cell or
    /// changes with them, which would make energy.
    pub(super) fn under(c: &Closest, most: f64) -> Self {
        let past = c.xi.map(|x| ((x.abs() - 1.0) / RIM).max(0.0));
        Self { past, most }
    }

    /// By coordinate, what is left of the sheet there: 1 at the rim, 0 where the ledge ends.
    fn left(&self) -> [f64; 2] {
        self.past.map(|p| 1.0 - p * p)
    }

    /// By how much the distance in touch is less (m).
    pub(super) fn less(&self) -> f64 {
        let [a, b] = self.left();
        self.most * (1.0 - a * b)
    }

    /// Takes that off the distance at which a slave is held, and turns its force accordingly.
    #[inline(never)]
    pub(super) fn bevel(&self, pull: &mut Pull, s: &Surface<'_>, c: &Closest) {
        pull.gap += self.less();
        let x = s.cells[c.cell as usize].map(|n| s.x[n as usize]);
        let (a, b) = (0.25 * (1.0 - c.xi[1]), 0.25 * (1.0 + c.xi[1]));
        let (u, v) = (0.25 * (1.0 - c.xi[0]), 0.25 * (1.0 + c.xi[0]));
        let along = [combine([-a, a, b, -b], &x), combine([-u, -v, v, u], &x)];
        let left = self.left();
        for k in 0..2 {
            let slope = self.most * 2.0 * self.past[k] / RIM * left[1 - k] * c.xi[k].signum();
            // Where the ledge ends, the place is held.
            if slope == 0.0 || !c.free[k] {
                continue;
            }
            // What the place moves by along one side of the cell while it keeps the other coordinate, unless it is held there.
            let (own, other) = (along[k], along[1 - k]);
            let across = if c.free[1 - k] {
                sub(own, scale(other, dot(own, other) / dot(other, other)))
            } else {
                own
            };
            pull.first = add(pull.first, scale(across, slope / dot(across, across)));
        }
    }
}
