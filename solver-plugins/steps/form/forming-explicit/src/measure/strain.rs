//! Shear angles and fibre strains of the plies, from their cells alone.

use crate::forming::Forming;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, dot, norm, scale, sub};
use plyflow_mechanics::crossed::Crossed;

/// Strains of the plies' elements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlyStrains {
    /// Smallest and largest shear angle (rad).
    pub shear: [f64; 2],
    /// Largest strain of a fibre by size (1).
    pub fibre: f64,
}

/// Strains of all plies, from the stretch of each cell's sides and diagonals in its material axes; 0 without a cell.
pub fn ply_strains(forming: &Forming) -> PlyStrains {
    let (mut low, mut high, mut fibre) = (f64::INFINITY, f64::NEG_INFINITY, 0.0f64);
    for (body, sheet) in forming.plies() {
        let crossed = sheet.crossed();
        let mut count = |cells: &[[u32; 4]], then: &[Vec3], now: &[Vec3]| {
            for cell in cells {
                let of = |points: &[Vec3]| cell.map(|n| points[n as usize]);
                let then = of(then);
                let axis = sheet.axis_in_cell(&then);
                let (g, e) = cell_strain(then, of(now), axis, crossed);
                (low, high) = (low.min(g), high.max(g));
                fibre = fibre.max(e);
            }
        };
        if body.mirrored.is_some() {
            let (now, then) = (forming.points(body), forming.reference_points(body));
            count(&body.cells, &then, &now);
        } else {
            // A large sheet's points are not copied for this: it is where a run's memory would be largest.
            let m = &forming.model;
            count(body.sheet.cells(m), &forming.reference, m.x());
        }
    }
    let shear = if low > high { [0.0; 2] } else { [low, high] };
    PlyStrains { shear, fibre }
}

/// Shear angle (rad) and largest fibre strain by size at the centre of a cell. `crossed`: how the families cross, where they do not at a right
/// angle.
pub fn cell_strain(
    then: [Vec3; 4],
    now: [Vec3; 4],
    axis: Vec3,
    crossed: Option<Crossed>,
) -> (f64, f64) {
    let mid = |p: &[Vec3; 4]| (sub(p[2], p[0]), sub(p[3], p[1]));
    let ((a, b), (d, e)) = (mid(&then), mid(&now));
    let det = a[0] * b[1] - a[1] * b[0];
    let map = |u: Vec3| {
        let s = (u[0] * b[1] - u[1] * b[0]) / det;
        let t = (a[0] * u[1] - a[1] * u[0]) / det;
        add(scale(d, s), scale(e, t))
    };
    let (f1, f2) = (map(axis), map([-axis[1], axis[0], 0.0]));
    let (l1, l2) = (norm(f1), norm(f2));
    let g = (dot(f1, f2) / (l1 * l2)).clamp(-1.0, 1.0).fixed_asin();
    let (g, second) = match crossed {
        Some(crossed) => crossed.families(l1, l2, g),
        None => (g, l2 - 1.0),
    };
    (g, (l1 - 1.0).abs().max(second.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strains_of_a_cell_are_those_of_both_families() {
        let then = [
            [0.0, 0.0, 0.0],
            [0.02, 0.001, 0.0],
            [0.021, 0.015, 0.0],
            [0.0, 0.014, 0.0],
        ];
        let to = |[x, y, z]: Vec3| [1.01 * x + 0.3 * y, 0.9 * y - 0.05 * x, z];
        let direction = |t: f64| [t.cos(), t.sin(), 0.0];
        for (first, second) in [
            (0.2, 1.3),
            (-0.5, 1.6),
            (0.4, 0.4 + std::f64::consts::FRAC_PI_2),
        ] {
            let images = [first, second].map(|t| to(direction(t)));
            let lengths = images.map(norm);
            let now = (dot(images[0], images[1]) / (lengths[0] * lengths[1])).acos();
            let crossed = Crossed::new(second - first);
            let (shear, strain) = cell_strain(then, then.map(to), direction(first), Some(crossed));
            assert!((shear - (second - first - now)).abs() < 1e-12, "{shear}");
            let most = lengths.map(|l| (l - 1.0).abs());
            assert!((strain - most[0].max(most[1])).abs() < 1e-12, "{strain}");
        }
    }
}
