//! What a mesh is worth.

use plyflow_fixed::FixedBits;
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_model::artifact::MeshQuality;
use plyflow_model::outline::{Region, cross};
use std::f64::consts::TAU;

/// Most cells around a node inside of a mesh: what the patch of a rotation-free shell must hold.
pub fn most_cells_at_inner_node(mesh: &QuadMesh) -> usize {
    let nodes = mesh.cells_of_nodes().into_iter().zip(mesh.on_boundary());
    nodes.filter(|n| !n.1).map(|n| n.0.len()).max().unwrap_or(0)
}

/// Measures a mesh of a region for elements of a size (m).
pub fn of(mesh: &QuadMesh, region: &Region, size: f64) -> MeshQuality {
    let mut q = MeshQuality {
        least_scaled_jacobian: f64::INFINITY,
        least_angle: f64::INFINITY,
        largest_angle: 0.0,
        edge_ratio: 1.0,
        least_edge: f64::INFINITY,
        area_error: 0.0,
        worst_at: [0.0; 2],
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
