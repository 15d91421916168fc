//! What a mesh is worth.

use plyflow_fixed::FixedBits;
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_model::outline::{Millimetres, Point, Region, cross};
use std::f64::consts::TAU;

/// Below this scaled Jacobian a mesh is called poor.
pub const POOR_JACOBIAN: f64 = 0.3;

/// Measures of a flat mesh of quads.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Least scaled Jacobian: the sine of a corner's angle; 1 for rectangles, at or below 0 for folded cells.
    pub least_scaled_jacobian: f64,
    /// Least angle of a cell's corner (rad).
    pub least_angle: f64,
    /// Largest angle of a cell's corner (rad).
    pub largest_angle: f64,
    /// Largest ratio of the longest to the shortest edge of a cell.
    pub edge_ratio: f64,
    /// Shortest edge over the element size: it bounds the explicit step.
    pub least_edge: f64,
    /// Area of the mesh over that of the region, less 1.
    pub area_error: f64,
    /// Centre of the cell with the least scaled Jacobian (m).
    pub worst_at: Point,
    /// Most cells around a node inside: what the patch of a rotation-free shell must hold.
    pub most_cells_at_inner_node: usize,
}

fn most_inside(mesh: &QuadMesh) -> usize {
    let nodes = mesh.cells_of_nodes().into_iter().zip(mesh.on_boundary());
    nodes.filter(|n| !n.1).map(|n| n.0.len()).max().unwrap_or(0)
}

impl Quality {
    /// Measures a mesh of a region for elements of a size (m).
    pub fn new(mesh: &QuadMesh, region: &Region, size: f64) -> Self {
        let mut q = Self {
            least_scaled_jacobian: f64::INFINITY,
            least_angle: f64::INFINITY,
            largest_angle: 0.0,
            edge_ratio: 1.0,
            least_edge: f64::INFINITY,
            area_error: 0.0,
            worst_at: [0.0; 2],
            most_cells_at_inner_node: most_inside(mesh),
        };
        let mut area = 0.0;
        for cell in &mesh.cells {
            let p = cell.map(|n| [mesh.points[n as usize][0], mesh.points[n as usize][1]]);
            let (mut shortest, mut longest) = (f64::INFINITY, 0.0f64);
            area += 0.5 * (cross(p[0], p[1], p[2]) + cross(p[0], p[2], p[3]));
            for k in 0..4 {
                let (a, b, c) = (p[k], p[(k + 1) % 4], p[(k + 3) % 4]);
                let (u, v) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
                let (lu, lv) = (u[0].fixed_hypot(u[1]), v[0].fixed_hypot(v[1]));
                let twice = u[0] * v[1] - u[1] * v[0];
                let jacobian = twice / (lu * lv);
                if jacobian < q.least_scaled_jacobian {
                    q.least_scaled_jacobian = jacobian;
                    q.worst_at = [0, 1].map(|d| 0.25 * p.iter().map(|x| x[d]).sum::<f64>());
                }
                let angle = twice.fixed_atan2(u[0] * v[0] + u[1] * v[1]).rem_euclid(TAU);
                q.least_angle = q.least_angle.min(angle);
                q.largest_angle = q.largest_angle.max(angle);
                (shortest, longest) = (shortest.min(lu), longest.max(lu));
            }
            q.edge_ratio = q.edge_ratio.max(longest / shortest);
            q.least_edge = q.least_edge.min(shortest / size);
        }
        q.area_error = area / region.area() - 1.0;
        q
    }

    /// What a user should know of a poor mesh.
    pub fn warning(&self) -> Option<String> {
        (self.least_scaled_jacobian < POOR_JACOBIAN).then(|| {
            format!(
                "its mesh is poor: least scaled Jacobian {:.2} (warning below {POOR_JACOBIAN}), angles from {:.0} to {:.0} deg, worst at \
                 {}; round off narrow corners of the outline or take smaller elements",
                self.least_scaled_jacobian,
                self.least_angle.to_degrees(),
                self.largest_angle.to_degrees(),
                Millimetres(self.worst_at)
            )
        })
    }
}
