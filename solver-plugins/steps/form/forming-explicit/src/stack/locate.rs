//! Where in the undeformed plane nodes lie on the cells of a sheet.

use crate::stack::place::SheetIndex;
use plyflow_geometry::vec3::V;
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
    let corners: Vec<[V; 4]> = (cells.iter().map(|c| c.map(|n| x[n as usize]))).collect();
    let bins = Bins::of_cells(&corners);
    slaves
        .iter()
        .map(|n| {
            let p = x[*n as usize];
            let inside = bins.near(p).iter().find_map(|c| {
                let xi = inverse_bilinear(corners[*c as usize], p)?;
                (xi[0].abs() <= 1.0 + 1e-9 && xi[1].abs() <= 1.0 + 1e-9).then_some((*c, xi))
            });
            let (cell, xi) = inside.unwrap_or_else(|| (bins.nearest(p), [0.0; 2]));
            SlaveItem::new(*n, cell + first, xi)
        })
        .collect()
}

/// Local coordinates of a point in the plane of a quad seen from above.
pub fn inverse_bilinear(q: [V; 4], p: V) -> Option<[f64; 2]> {
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

/// Cell centres sorted into square bins.
pub struct Bins {
    centres: Vec<[f64; 2]>,
    lo: [f64; 2],
    size: f64,
    shape: [usize; 2],
    cells: Vec<Vec<u32>>,
}

impl Bins {
    /// Of quads seen from above.
    pub fn of_cells(corners: &[[V; 4]]) -> Self {
        let centre = |p: &[V; 4]| [0, 1].map(|k| 0.25 * (p[0][k] + p[1][k] + p[2][k] + p[3][k]));
        Self::new(corners.iter().map(centre).collect())
    }

    fn new(centres: Vec<[f64; 2]>) -> Self {
        let (mut lo, mut hi) = ([f64::MAX; 2], [f64::MIN; 2]);
        for c in &centres {
            for k in 0..2 {
                lo[k] = lo[k].min(c[k]);
                hi[k] = hi[k].max(c[k]);
            }
        }
        let area = ((hi[0] - lo[0]) * (hi[1] - lo[1])).max(1e-12);
        // About four cells a bin.
        let size = 2.0 * (area / centres.len() as f64).sqrt();
        let shape = [0, 1].map(|k| ((hi[k] - lo[k]) / size) as usize + 1);
        let mut bins = Self {
            centres,
            lo,
            size,
            shape,
            cells: vec![Vec::new(); shape[0] * shape[1]],
        };
        for c in 0..bins.centres.len() {
            let [i, j] = bins.bin(bins.centres[c]);
            bins.cells[j * bins.shape[0] + i].push(c as u32);
        }
        bins
    }

    fn bin(&self, p: [f64; 2]) -> [usize; 2] {
        [0, 1].map(|k| {
            let i = ((p[k] - self.lo[k]) / self.size).max(0.0) as usize;
            i.min(self.shape[k] - 1)
        })
    }

    /// Cells around a place.
    pub fn near(&self, p: V) -> Vec<u32> {
        let [i, j] = self.bin([p[0], p[1]]);
        let mut found = Vec::new();
        for b in j.saturating_sub(1)..(j + 2).min(self.shape[1]) {
            for a in i.saturating_sub(1)..(i + 2).min(self.shape[0]) {
                found.extend_from_slice(&self.cells[b * self.shape[0] + a]);
            }
        }
        // A graded mesh has cells larger than a bin: then look at all.
        if found.is_empty() {
            (0..self.centres.len() as u32).collect()
        } else {
            found
        }
    }

    fn nearest(&self, p: V) -> u32 {
        let d = |c: u32| {
            let q = self.centres[c as usize];
            (q[0] - p[0]).powi(2) + (q[1] - p[1]).powi(2)
        };
        (0..self.centres.len() as u32)
            .min_by(|a, b| d(*a).total_cmp(&d(*b)))
            .unwrap_or(NONE)
    }
}
