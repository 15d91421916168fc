//! How far the rims of plies are drawn in.

use crate::run::Forming;
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::vec3::V;
use plyflow_model::scene::SheetKind;

/// Largest ways in plan (m) of nodes at the rims of plies, holes included, since they lay flat.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DrawIn {
    /// Of all nodes there.
    pub rim: f64,
    /// Of corners, the nodes of a single cell.
    pub corner: f64,
}

impl DrawIn {
    /// Of one mesh, from its points `now` (m).
    pub fn of(mesh: &QuadMesh, now: &[V]) -> Self {
        let around = mesh.cells_of_nodes();
        let mut most = Self::default();
        let ends = mesh.points.iter().zip(now).zip(mesh.on_boundary());
        for (((then, now), _), cells) in ends.zip(&around).filter(|((_, rim), _)| *rim) {
            let way = (now[0] - then[0]).hypot(now[1] - then[1]);
            most.rim = most.rim.max(way);
            if cells.len() == 1 {
                most.corner = most.corner.max(way);
            }
        }
        most
    }
}

impl Forming {
    /// Of all plies.
    pub fn draw_in(&self) -> DrawIn {
        let sheets = self.bodies.iter().zip(&self.stack);
        let plies = sheets.filter(|(_, s)| s.scene.kind == SheetKind::Ply);
        let each = plies.map(|(body, _)| {
            let mesh = QuadMesh {
                points: self.reference_points(body),
                cells: body.cells.clone(),
            };
            DrawIn::of(&mesh, &self.points(body))
        });
        each.fold(DrawIn::default(), |a, b| DrawIn {
            rim: a.rim.max(b.rim),
            corner: a.corner.max(b.corner),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let mut now: Vec<V> = mesh.points.clone();
        for p in &mut now {
            *p = [p[0] + 0.1 * (0.02 - p[0]), p[1], p[2] + p[0]];
        }
        // The middle of a side more than its ends, and a node inside most of all.
        now[5][0] += 0.001;
        now[7][1] += 0.5;
        let found = DrawIn::of(&mesh, &now);
        assert!((found.rim - 0.003).abs() < 1e-12 && (found.corner - 0.002).abs() < 1e-12);
    }
}
