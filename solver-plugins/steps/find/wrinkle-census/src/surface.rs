//! A formed ply met by vertical lines.

use plyflow_geometry::{Bins, Rectangle, Vec3, rectangle};

/// What a vertical line meets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// z (m).
    pub height: f64,
    /// Shear angle of the cell (rad).
    pub shear: f64,
}

/// Cells of a formed ply by their place in the plane.
pub struct Cut<'a> {
    points: &'a [Vec3],
    cells: &'a [u32],
    shear: &'a [f64],
    around: Rectangle,
    bins: Bins,
}

impl<'a> Cut<'a> {
    /// Of a ply with `[n]` points (m), quads (four nodes each) and the `[cells]` shear angles (rad).
    pub fn new(points: &'a [Vec3], cells: &'a [u32], shear: &'a [f64]) -> Self {
        let flat = |p: &Vec3| [p[0], p[1]];
        let [x0, y0, x1, y1] = rectangle::around(points.iter().map(flat));
        // About one cell a bin.
        let size = ((x1 - x0) * (y1 - y0) / (cells.len() / 4).max(1) as f64)
            .sqrt()
            .max(1e-9);
        let count = [x1 - x0, y1 - y0].map(|w| (w / size) as usize + 1);
        let mut bins = Bins::new([x0, y0], [size; 2], count);
        for (cell, nodes) in cells.chunks_exact(4).enumerate() {
            let corners = nodes.iter().map(|n| flat(&points[*n as usize]));
            let [x0, y0, x1, y1] = rectangle::around(corners);
            bins.insert(cell as u32, [x0, y0], [x1, y1]);
        }
        Self {
            points,
            cells,
            shear,
            around: [x0, y0, x1, y1],
            bins,
        }
    }

    /// The place of the ply at `(x, y)` (m) that is seen from above, or `from_below`: of several layers the highest or the lowest.
    /// `None` beside the ply.
    pub fn seen(&self, at: [f64; 2], from_below: bool) -> Option<Hit> {
        let [x0, y0, x1, y1] = self.around;
        if at[0] < x0 || at[0] > x1 || at[1] < y0 || at[1] > y1 {
            return None;
        }
        let mut best: Option<Hit> = None;
        for cell in self.bins.at(at) {
            let nodes = &self.cells[4 * *cell as usize..4 * *cell as usize + 4];
            for corners in [[0, 1, 2], [0, 2, 3]] {
                let triangle = corners.map(|k| self.points[nodes[k] as usize]);
                if let Some(height) = height(triangle, at)
                    && best.is_none_or(|b| (height > b.height) != from_below)
                {
                    let shear = self.shear[*cell as usize];
                    best = Some(Hit { height, shear });
                }
            }
        }
        best
    }
}

/// Height of a triangle over a place inside of it.
fn height([a, b, c]: [Vec3; 3], at: [f64; 2]) -> Option<f64> {
    let twice = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    };
    let flat = |v: Vec3| [v[0], v[1]];
    let whole = twice(flat(a), flat(b), flat(c));
    // A wall has no height over its foot.
    if whole.abs() < 1e-16 {
        return None;
    }
    let weights = [
        twice(at, flat(b), flat(c)),
        twice(flat(a), at, flat(c)),
        twice(flat(a), flat(b), at),
    ]
    .map(|w| w / whole);
    let inside = weights.iter().all(|w| *w >= -1e-9);
    inside.then(|| weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_two_layers_the_one_that_is_seen_is_met_and_nothing_beside_them() {
        // A strip that is folded over: 0..2 at z = 0, back to x = 1 at z = 1.
        let points: Vec<Vec3> = [0.0, 1.0, 2.0]
            .iter()
            .map(|x| [*x, 0.0, 0.0])
            .chain([[2.0, 0.0, 1.0], [1.0, 0.0, 1.0]])
            .flat_map(|p| [p, [p[0], 1.0, p[2]]])
            .collect();
        let cells: Vec<u32> = (0..4u32)
            .flat_map(|i| [2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1])
            .collect();
        let shear = [0.1, 0.2, 0.3, 0.4];
        let cut = Cut::new(&points, &cells, &shear);
        let seen = |x: f64, from_below| {
            let hit = cut.seen([x, 0.4], from_below);
            hit.map(|h| (h.height, h.shear))
        };
        for from_below in [false, true] {
            assert_eq!(seen(0.5, from_below), Some((0.0, 0.1)));
            let beside = [[-0.1, 0.4], [2.1, 0.4], [0.5, 1.2]];
            assert_eq!(beside.map(|at| cut.seen(at, from_below)), [None; 3]);
        }
        assert_eq!(seen(1.5, false), Some((1.0, 0.4)));
        assert_eq!(seen(1.5, true), Some((0.0, 0.2)));
    }
}
