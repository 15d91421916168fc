//! Meshes with nodes off their places: what elements make of skewed cells.

use crate::rotated_mesh::least_jacobian;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, dot, norm, sub};
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_sdk::{Host, StepError};

/// Least scaled Jacobian that a cell may have.
const LEAST_JACOBIAN: f64 = 0.2;

/// A coin that falls the same way for the same number: the highest of its well-mixed bits (splitmix64).
fn is_even(number: u64) -> bool {
    let mut z = number.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    (z ^ (z >> 31)) >> 63 == 1
}

/// Moves nodes of a flat mesh in its plane: each along x and along y by `share` of the shortest edge at it, in one or the other direction.
/// Nodes at the mesh's edge stay, and those that `stay`. The same mesh is always moved in the same way; 0 leaves it as it is. 0.2 skews some of
/// its squares by 30 degrees and more, and makes corners of 25 to 155 degrees.
///
/// # Errors
/// When a cell comes to have a scaled Jacobian below 0.2.
pub fn scatter(
    mesh: &mut QuadMesh,
    share: f64,
    stay: impl Fn(usize) -> bool,
) -> Result<(), StepError> {
    if share == 0.0 {
        return Ok(());
    }
    let edge = mesh.on_boundary();
    let mut shortest = vec![f64::INFINITY; mesh.points.len()];
    for cell in &mesh.cells {
        for k in 0..4 {
            let ends = [cell[k] as usize, cell[(k + 1) % 4] as usize];
            let length = norm(sub(mesh.points[ends[1]], mesh.points[ends[0]]));
            for n in ends {
                shortest[n] = shortest[n].min(length);
            }
        }
    }
    for n in (0..mesh.points.len()).filter(|n| !edge[*n] && !stay(*n)) {
        for k in 0..2 {
            let way = if is_even(2 * n as u64 + k as u64) {
                1.0
            } else {
                -1.0
            };
            mesh.points[n][k] += way * share * shortest[n];
        }
    }
    let jacobian = least_jacobian(mesh);
    if jacobian < LEAST_JACOBIAN {
        return Err(format!(
            "distortion: given {share}; it leaves a cell with a scaled Jacobian of {jacobian:.2}; expected at least {LEAST_JACOBIAN}. Try a \
             smaller distortion"
        )
        .into());
    }
    Ok(())
}

/// Largest skew of the cells (rad): by how much the angle between the lines through the middles of opposite sides is off a right angle.
pub fn largest_skew(mesh: &QuadMesh) -> f64 {
    let skew = |cell: &[u32; 4]| {
        let p = cell.map(|n| mesh.points[n as usize]);
        let line = |a: usize, b: usize, c: usize, d: usize| -> Vec3 {
            std::array::from_fn(|k| (p[a][k] + p[b][k]) - (p[c][k] + p[d][k]))
        };
        let (u, v) = (line(1, 2, 0, 3), line(2, 3, 0, 1));
        let sine = (dot(u, v) / (norm(u) * norm(v))).abs().min(1.0);
        std::f64::consts::FRAC_PI_2 - sine.fixed_acos()
    };
    mesh.cells.iter().map(skew).fold(0.0, f64::max)
}

/// Tells how skewed a distorted mesh is.
///
/// # Errors
/// When the host refuses.
pub fn tell(host: &Host, mesh: &QuadMesh, share: f64) -> Result<(), StepError> {
    if share == 0.0 {
        return Ok(());
    }
    host.result("skew_largest", largest_skew(mesh), "rad")
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_mechanics::mesh::even_axis;

    #[test]
    fn squares_come_to_be_skewed_by_more_than_30_degrees() {
        let lines = even_axis(0.0, 0.06, 0.01);
        let mut mesh = QuadMesh::grid(&lines, &lines);
        scatter(&mut mesh, 0.2, |_| false).unwrap();
        let skew = largest_skew(&mesh).to_degrees();
        assert!((30.0..45.0).contains(&skew), "{skew}");
    }

    fn grid() -> QuadMesh {
        QuadMesh::grid(&even_axis(0.0, 0.1, 0.01), &even_axis(0.0, 0.1, 0.001))
    }

    #[test]
    fn scattered_nodes_keep_the_outline_and_what_stays() {
        let (regular, mut mesh) = (grid(), grid());
        scatter(&mut mesh, 0.2, |n| n % 11 < 3).unwrap();
        let edge = regular.on_boundary();
        let mut moved = 0;
        for (n, (a, b)) in regular.points.iter().zip(&mesh.points).enumerate() {
            let [x, y] = [0, 1].map(|k| (a[k] - b[k]).abs());
            if edge[n] || n % 11 < 3 {
                assert_eq!(a, b);
            } else {
                let wanted = 0.2 * 0.001;
                assert!((x - wanted).abs() < 1e-12 && (y - wanted).abs() < 1e-12);
                moved += 1;
            }
        }
        assert_eq!(moved, 99 * 7);
        let mut again = grid();
        scatter(&mut again, 0.2, |n| n % 11 < 3).unwrap();
        assert_eq!(again, mesh);
    }

    #[test]
    fn skew_is_that_of_a_sheared_square_and_a_regular_mesh_has_none() {
        let mut mesh = grid();
        assert!(largest_skew(&mesh) < 1e-12);
        let slope = 30f64.to_radians().tan();
        for p in &mut mesh.points {
            p[0] += slope * p[1];
        }
        assert!((largest_skew(&mesh).to_degrees() - 30.0).abs() < 1e-9);
    }

    #[test]
    fn a_distortion_that_turns_cells_over_is_refused() {
        let refused = scatter(&mut grid(), 0.5, |_| false).unwrap_err();
        assert!(
            refused.text().starts_with("distortion: given 0.5"),
            "{refused:?}"
        );
    }
}
