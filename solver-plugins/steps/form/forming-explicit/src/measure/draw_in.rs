//! How far the rims of plies are drawn in.

use crate::forming::Forming;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::mesh::NONE;

/// Largest ways in plan (m) of nodes at the rims of plies, holes included, since they lay flat.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DrawIn {
    /// Of all nodes there.
    pub rim: f64,
    /// Of corners, between two free sides of one cell.
    pub corner: f64,
}

impl DrawIn {
    /// Counts a sheet: `cells` and what lies across their edges (`[cells][4]`), its points `then` and `now` (m).
    fn count(&mut self, cells: &[[u32; 4]], neighbours: &[[u32; 4]], then: &[Vec3], now: &[Vec3]) {
        for (cell, near) in cells.iter().zip(neighbours) {
            // Edge e goes from node e to the next one.
            for (e, node) in cell.iter().enumerate() {
                let (before, after) = (near[(e + 3) % 4] == NONE, near[e] == NONE);
                if !before && !after {
                    continue;
                }
                let (then, now) = (then[*node as usize], now[*node as usize]);
                let way = (now[0] - then[0]).fixed_hypot(now[1] - then[1]);
                self.rim = self.rim.max(way);
                if before && after {
                    self.corner = self.corner.max(way);
                }
            }
        }
    }
}

impl Forming {
    /// Of all plies. Beside mirror planes the part that is computed tells it of all.
    pub fn draw_in(&self) -> DrawIn {
        let m = &self.model;
        let mut most = DrawIn::default();
        for (body, _) in self.plies() {
            let near = &m.neighbours()[body.sheet.cell_range(m)];
            most.count(body.sheet.cells(m), near, &self.reference, m.x());
        }
        most
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_mechanics::mesh::QuadMesh;
    use plyflow_mechanics::mirror::MIRRORED;

    #[test]
    fn rims_and_corners_are_told_by_their_ways_in_plan() {
        // 4 x 2 cells of 10 mm, drawn in towards x = 20 mm by a tenth, corners up besides.
        let point = |i: u32| [0.01 * f64::from(i % 5), 0.01 * f64::from(i / 5), 0.0];
        let cell = |c: u32| {
            let first = c % 4 + 5 * (c / 4);
            [first, first + 1, first + 6, first + 5]
        };
        let mesh = QuadMesh {
            points: (0..15).map(point).collect(),
            cells: (0..8).map(cell).collect(),
        };
        let mut now: Vec<Vec3> = mesh.points.clone();
        for p in &mut now {
            *p = [p[0] + 0.1 * (0.02 - p[0]), p[1], p[2] + p[0]];
        }
        // The middle of a side more than its ends, and a node inside most of all.
        now[5][0] += 0.001;
        now[7][1] += 0.5;
        let mut found = DrawIn::default();
        found.count(&mesh.cells, &mesh.neighbours(), &mesh.points, &now);
        assert!((found.rim - 0.003).abs() < 1e-12 && (found.corner - 0.002).abs() < 1e-12);
        // Where a mirror plane bounds what is computed, the sheet goes on: no rim on its left and right, and no corner.
        let mut near = mesh.neighbours();
        for cell in [0, 4] {
            near[cell][3] = MIRRORED[0];
            near[cell + 3][1] = MIRRORED[0];
        }
        let mut part = DrawIn::default();
        part.count(&mesh.cells, &near, &mesh.points, &now);
        assert!((part.rim - 0.002).abs() < 1e-12, "{part:?}");
        assert_eq!(part.corner, 0.0);
    }
}
