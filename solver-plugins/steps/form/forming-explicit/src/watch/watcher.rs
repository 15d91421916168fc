//! A sheet that is watched, and where on it a node's closest point is.

use crate::watch::sheet::{Bent, Near, Seat, SheetMesh, SheetTree};
use plyflow_geometry::vec3::Vec3;
use std::sync::OnceLock;

/// Distance (m) from a sheet's middle surface over which a node may have come through it since the row before.
const LEAP: f64 = 0.01;

/// A sheet that is watched.
pub struct Watcher {
    pub mesh: SheetMesh,
    pub thickness: f64,
    /// By node of the mesh: whether it is moved by the run itself.
    pub free: Vec<bool>,
    /// Size (m) of its elements over the tool.
    pub size: f64,
}

/// Everything at one time.
pub struct Moment<'a> {
    pub x: &'a [Vec3],
    /// By part (m).
    pub shifts: &'a [Vec3],
    /// By sheet, where everything is looked at anew.
    pub trees: Option<&'a [Option<SheetTree>]>,
    /// By sheet, where something seems to have come through it and nothing else is looked at anew.
    pub asked: &'a [OnceLock<Option<SheetTree>>],
    /// By sheet (m).
    pub boxes: &'a [[Vec3; 2]],
    /// By sheet.
    pub bent: &'a [Bent],
    pub first: bool,
    pub last: bool,
}

impl Watcher {
    /// The closest point of this sheet, number `own` of the stack, to a node; `None`, and nothing known of it any more, where there is none or
    /// where it is one of its own nodes.
    pub fn near(
        &self,
        moment: &Moment<'_>,
        own: usize,
        node: u32,
        seat: &mut Seat,
    ) -> Option<Near> {
        let p = moment.x[node as usize];
        if self.mesh.has(node) || is_off(moment.boxes[own], p) {
            *seat = Seat::NOWHERE;
            return None;
        }
        let from = match moment.trees {
            Some(trees) => (trees[own].as_ref()?.cell(p, seat.cell), [0.0; 2]),
            None if seat.cell == u32::MAX => (self.mesh.nearest_middle(moment.x, p), [0.0; 2]),
            None => (seat.cell, seat.xi.map(f64::from)),
        };
        Some(self.mesh.closest(moment.x, p, from))
    }

    /// The same wherever on this sheet it is: a walk from where it was may have ended in a fold, at a place that is nearest only of those around.
    pub fn nearest(&self, moment: &Moment<'_>, own: usize, node: u32, found: Near) -> Near {
        let p = moment.x[node as usize];
        let tree = moment.asked[own].get_or_init(|| self.mesh.tree(moment.x));
        let Some(tree) = tree else { return found };
        let from = (tree.cell(p, found.cell), [0.0; 2]);
        self.mesh.closest(moment.x, p, from)
    }
}

/// Whether a node that is behind a sheet now, by `over` (m, negative), has come through it: it was on the right side shortly before, or has been
/// behind it. Infinite `before`: it was beside, from where it may well have come around the edge.
pub fn has_come_through(before: f64, over: f64) -> bool {
    before.is_finite() && before.max(0.0) - over < LEAP || before < 0.0
}

/// Whether a place is outside of a box by more than what matters.
fn is_off([low, high]: [Vec3; 2], p: Vec3) -> bool {
    (0..3).any(|k| p[k] < low[k] - LEAP || p[k] > high[k] + LEAP)
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_mechanics::mesh::{QuadMesh, even_axis};
    use plyflow_mechanics::mirror::Planes;

    #[test]
    fn what_seems_to_have_come_through_the_far_side_of_a_fold_is_looked_for_on_the_near_side_too() {
        // A sheet folded back on itself over 6 mm: its far half lies below, its near one above.
        let mesh = QuadMesh::grid(&even_axis(-0.1, 0.1, 0.01), &even_axis(0.0, 0.04, 0.01));
        let folded = |p: &Vec3| [p[0].abs(), p[1], 0.003 * f64::signum(p[0])];
        let mut x: Vec<Vec3> = mesh.points.iter().map(folded).collect();
        let start = [mesh.points.clone(), vec![[0.0; 3]]].concat();
        let sheet = Watcher {
            mesh: SheetMesh::new(&mesh.cells, &start, Planes::default()),
            thickness: 1e-3,
            free: vec![true; mesh.points.len()],
            size: 0.01,
        };
        // On the upper side of the near half, which the far half has below it the wrong way round.
        let p = [0.065, 0.02, 0.004];
        x.push(p);
        let node = x.len() as u32 - 1;
        let bent = [Bent::new(&sheet.mesh)];
        let boxes = [sheet.mesh.bounds(&x)];
        let asked = [OnceLock::new()];
        let moment = Moment {
            x: &x,
            shifts: &[],
            trees: None,
            asked: &asked,
            boxes: &boxes,
            bent: &bent,
            first: false,
            last: false,
        };
        let far = (0..mesh.cells.len())
            .find(|c| {
                mesh.cells[*c]
                    .iter()
                    .all(|n| mesh.points[*n as usize][0] < -0.05)
            })
            .unwrap();
        let mut seat = Seat {
            cell: far as u32,
            ..Seat::NOWHERE
        };
        let walked = sheet.near(&moment, 0, node, &mut seat).unwrap();
        assert!((walked.height + 0.007).abs() < 1e-9, "{walked:?}");
        let found = sheet.nearest(&moment, 0, node, walked);
        assert!((found.height - 0.001).abs() < 1e-9, "{found:?}");
    }
}
