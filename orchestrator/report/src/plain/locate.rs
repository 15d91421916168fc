//! Where a place of the undeformed ply lies on the formed one.

use crate::plain::ply::Vec3;

/// Finds the cell of a flat quad mesh that a place lies in.
pub(crate) struct Locator<'a> {
    flat: &'a [Vec3],
    cells: &'a [[u32; 4]],
    low: [f64; 2],
    pitch: [f64; 2],
    count: [usize; 2],
    bins: Vec<Vec<u32>>,
}

impl<'a> Locator<'a> {
    /// Of a mesh whose points lie in the x-y plane.
    pub(crate) fn new(flat: &'a [Vec3], cells: &'a [[u32; 4]]) -> Self {
        let [low, high] = bounds(flat);
        let side = (cells.len() as f64).sqrt().ceil().max(1.0) as usize;
        let pitch = [0, 1].map(|d| ((high[d] - low[d]) / side as f64).max(1e-12));
        let mut bins = vec![Vec::new(); side * side];
        let count = [side, side];
        for (c, cell) in cells.iter().enumerate() {
            let corners = cell.map(|i| flat[i as usize]);
            let [from, to] = bounds(&corners);
            let bin = |v: f64, d: usize| (((v - low[d]) / pitch[d]) as usize).min(side - 1);
            for y in bin(from[1], 1)..=bin(to[1], 1) {
                for x in bin(from[0], 0)..=bin(to[0], 0) {
                    bins[y * side + x].push(c as u32);
                }
            }
        }
        Self {
            flat,
            cells,
            low,
            pitch,
            count,
            bins,
        }
    }

    /// Where a place of the flat ply lies on the `formed` one (m), if it lies on the ply.
    pub(crate) fn carried(&self, at: [f64; 2], formed: &[Vec3]) -> Option<Vec3> {
        let (nodes, weights) = self.locate(at)?;
        let part = |k: usize, d: usize| weights[k] * formed[nodes[k] as usize][d];
        Some([0, 1, 2].map(|d| (0..3).map(|k| part(k, d)).sum()))
    }

    /// Nodes and weights of a place (m), if it lies on the ply.
    fn locate(&self, at: [f64; 2]) -> Option<([u32; 3], [f64; 3])> {
        let bin = [0, 1].map(|d| {
            let b = (at[d] - self.low[d]) / self.pitch[d];
            (b.max(0.0) as usize).min(self.count[d] - 1)
        });
        for c in &self.bins[bin[1] * self.count[0] + bin[0]] {
            let q = self.cells[*c as usize];
            for t in [[q[0], q[1], q[2]], [q[0], q[2], q[3]]] {
                if let Some(weights) = barycentric(t.map(|i| self.flat[i as usize]), at) {
                    return Some((t, weights));
                }
            }
        }
        None
    }
}

/// Places along the sides of a rectangle, side by side, about `apart` from each other (m).
pub(crate) fn outline([x0, y0, x1, y1]: [f64; 4], apart: f64) -> Vec<[f64; 2]> {
    let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]];
    let mut all = Vec::new();
    for side in corners.windows(2) {
        let length = (side[1][0] - side[0][0]).hypot(side[1][1] - side[0][1]);
        let steps = (length / apart).ceil().max(1.0) as usize;
        all.extend((0..=steps).map(|i| {
            let t = i as f64 / steps as f64;
            [0, 1].map(|d| side[0][d] + t * (side[1][d] - side[0][d]))
        }));
    }
    all
}

/// Smallest and largest x and y.
pub(crate) fn bounds(points: &[Vec3]) -> [[f64; 2]; 2] {
    let none = [[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]];
    points.iter().fold(none, |[a, b], p| {
        [
            [a[0].min(p[0]), a[1].min(p[1])],
            [b[0].max(p[0]), b[1].max(p[1])],
        ]
    })
}

fn barycentric([a, b, c]: [Vec3; 3], at: [f64; 2]) -> Option<[f64; 3]> {
    let twice = |p: [f64; 2], q: [f64; 2], r: [f64; 2]| {
        (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    };
    let [a, b, c] = [a, b, c].map(|p| [p[0], p[1]]);
    let area = twice(a, b, c);
    if area == 0.0 {
        return None;
    }
    let w = [
        twice(at, b, c) / area,
        twice(a, at, c) / area,
        twice(a, b, at) / area,
    ];
    // Places on an edge belong to both sides; single-precision coordinates leave a little play.
    w.iter().all(|v| *v > -1e-5).then_some(w)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_inside_are_found_with_weights_that_give_them_back() {
        let n = 7u32;
        let flat: Vec<Vec3> = (0..(n + 1) * (n + 1))
            .map(|i| {
                [
                    f64::from(i % (n + 1)) * 0.01,
                    f64::from(i / (n + 1)) * 0.02 - 0.05,
                    0.0,
                ]
            })
            .collect();
        let cells: Vec<[u32; 4]> = (0..n * n)
            .map(|c| {
                let i = c / n * (n + 1) + c % n;
                [i, i + 1, i + n + 2, i + n + 1]
            })
            .collect();
        let locator = Locator::new(&flat, &cells);
        for at in [[0.0, -0.05], [0.07, 0.09], [0.033, 0.0123], [0.01, 0.01]] {
            let (nodes, weights) = locator.locate(at).unwrap();
            for d in 0..2 {
                let back: f64 = (0..3)
                    .map(|k| weights[k] * flat[nodes[k] as usize][d])
                    .sum();
                assert!((back - at[d]).abs() < 1e-9, "{at:?}");
            }
        }
        assert_eq!(locator.locate([0.0701, 0.0]), None);
        assert_eq!(locator.locate([0.02, 0.2]), None);
    }
}
