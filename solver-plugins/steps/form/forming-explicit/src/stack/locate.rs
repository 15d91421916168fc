//! Where in the undeformed plane nodes lie on the cells of a sheet.

use crate::stack::place::SheetIndex;
use plyflow_geometry::vec3::Vec3;
use plyflow_geometry::{Bins, rectangle};
use plyflow_mechanics::contact::SlaveItem;
use plyflow_mechanics::mesh::NONE;
use plyflow_mechanics::model::Model;

/// Places slaves on the master in the undeformed plane. A slave beyond the master's edge gets the nearest
/// cell: it is in touch once it slides onto it.
pub fn locate(model: &Model, master: SheetIndex, slaves: &[u32]) -> Vec<SlaveItem> {
    let (cells, x) = (master.cells(model), model.x());
    if cells.is_empty() {
        return slaves
            .iter()
            .map(|n| SlaveItem::new(*n, NONE, [0.0; 2]))
            .collect();
    }
    let first = master.cell_range(model).start as u32;
    let corners: Vec<[Vec3; 4]> = (cells.iter().map(|c| c.map(|n| x[n as usize]))).collect();
    let placed = Cells::new(&corners);
    slaves
        .iter()
        .map(|n| {
            let p = x[*n as usize];
            let inside = placed.near(p).iter().find_map(|c| {
                let xi = inverse_bilinear(corners[*c as usize], p)?;
                (xi[0].abs() <= 1.0 + 1e-9 && xi[1].abs() <= 1.0 + 1e-9).then_some((*c, xi))
            });
            let (cell, xi) = inside.unwrap_or_else(|| (placed.nearest(p), [0.0; 2]));
            SlaveItem::new(*n, cell + first, xi)
        })
        .collect()
}

/// Local coordinates of a point in the plane of a quad seen from above.
pub fn inverse_bilinear(q: [Vec3; 4], p: Vec3) -> Option<[f64; 2]> {
    let mut xi = [0.0f64; 2];
    for _ in 0..20 {
        let w = plyflow_mechanics::contact::shape(xi);
        let (a, b) = (0.25 * (1.0 - xi[1]), 0.25 * (1.0 + xi[1]));
        let (c, d) = (0.25 * (1.0 - xi[0]), 0.25 * (1.0 + xi[0]));
        let (wx, wy) = ([-a, a, b, -b], [-c, -d, d, c]);
        let sum = |w: [f64; 4], k: usize| (0..4).map(|i| w[i] * q[i][k]).sum::<f64>();
        let r = [p[0] - sum(w, 0), p[1] - sum(w, 1)];
        let (j11, j12, j21, j22) = (sum(wx, 0), sum(wy, 0), sum(wx, 1), sum(wy, 1));
        let det = j11 * j22 - j12 * j21;
        if det.abs() < 1e-300 {
            return None;
        }
        let step = [
            (r[0] * j22 - r[1] * j12) / det,
            (j11 * r[1] - j21 * r[0]) / det,
        ];
        xi = [xi[0] + step[0], xi[1] + step[1]];
        if step[0].abs() + step[1].abs() < 1e-13 {
            return Some(xi);
        }
    }
    Some(xi)
}

/// Cells of a sheet by their centres.
struct Cells {
    centres: Vec<[f64; 2]>,
    bins: Bins,
}

impl Cells {
    /// Of quads seen from above, of which there is one at least.
    fn new(corners: &[[Vec3; 4]]) -> Self {
        let centre = |p: &[Vec3; 4]| [0, 1].map(|k| 0.25 * (p[0][k] + p[1][k] + p[2][k] + p[3][k]));
        let centres: Vec<[f64; 2]> = corners.iter().map(centre).collect();
        let [x0, y0, x1, y1] = rectangle::around(centres.iter().copied());
        let area = ((x1 - x0) * (y1 - y0)).max(1e-12);
        // About four cells a bin.
        let size = 2.0 * (area / centres.len() as f64).sqrt();
        let count = [x1 - x0, y1 - y0].map(|w| (w / size) as usize + 1);
        let mut bins = Bins::new([x0, y0], [size; 2], count);
        for (c, centre) in centres.iter().enumerate() {
            bins.insert(c as u32, *centre, *centre);
        }
        Self { centres, bins }
    }

    /// Cells around a place.
    fn near(&self, p: Vec3) -> Vec<u32> {
        let [i, j] = self.bins.place([p[0], p[1]]);
        let [last_i, last_j] = self.bins.count().map(|n| n - 1);
        let from = [i.saturating_sub(1), j.saturating_sub(1)];
        let to = [last_i.min(i + 1), last_j.min(j + 1)];
        let found: Vec<u32> = self.bins.between(from, to).collect();
        // A graded mesh has cells larger than a bin: then look at all.
        if found.is_empty() {
            (0..self.centres.len() as u32).collect()
        } else {
            found
        }
    }

    fn nearest(&self, p: Vec3) -> u32 {
        let d = |c: u32| {
            let q = self.centres[c as usize];
            (q[0] - p[0]).powi(2) + (q[1] - p[1]).powi(2)
        };
        (0..self.centres.len() as u32)
            .min_by(|a, b| d(*a).total_cmp(&d(*b)))
            .unwrap_or(NONE)
    }
}
