//! Where the fibres of a cell lie when it is formed, from its flat and its formed corners.

use crate::vec3::{Vec3, add_scaled, cross, dot, norm, scaled, sub, unit};
use plyflow_fixed::FixedBits;
use std::f64::consts::PI;

/// What the shape of a formed cell tells, at its middle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sheared {
    /// Directions of both families, of length 1. They lie in the plane of the cell's diagonals.
    pub directions: [Vec3; 2],
    /// Angle from the first family to the second (rad), 0 to pi.
    pub angle: f64,
    /// Area over that of the flat cell (1).
    pub area_ratio: f64,
    /// Normal of length 1, from which the corners are counter-clockwise.
    pub normal: Vec3,
}

/// Tangents of a cell at its middle, by its corners: of a quadrilateral those of the bilinear patch, half of them.
fn tangents(corners: &[Vec3]) -> [Vec3; 2] {
    match *corners {
        [a, b, c] => [sub(b, a), sub(c, a)],
        [a, b, c, d] => {
            let (first, second) = (sub(c, a), sub(d, b));
            // x_xi is (c - a) - (d - b), x_eta is (c - a) + (d - b), both over 4.
            let xi = scaled(0.25, sub(first, second));
            [xi, scaled(0.25, add_scaled(first, 1.0, second))]
        }
        _ => unreachable!("cells have 3 or 4 corners"),
    }
}

/// The fibres of a formed cell. `flat` and `formed` are its 3 or 4 corners (m); of `flat`, x and y count. `fibres` are the directions of the
/// families in the flat ply (rad, from x).
///
/// A fibre is carried along by the gradient of the deformation at the cell's middle, `f = F f0`. `None` of a cell without an area, flat
/// or formed, and of one that lies on its back in the flat ply.
#[must_use]
pub fn sheared(flat: &[Vec3], formed: &[Vec3], fibres: [f64; 2]) -> Option<Sheared> {
    let [big_xi, big_eta] = tangents(flat);
    let [xi, eta] = tangents(formed);
    let flat_area = big_xi[0] * big_eta[1] - big_xi[1] * big_eta[0];
    let across = cross(xi, eta);
    let normal = unit(across)?;
    if flat_area <= 0.0 {
        return None;
    }
    let carried = |angle: f64| {
        let (sin, cos) = angle.fixed_sin_cos();
        // The direction in the coordinates of the cell, which the deformation keeps.
        let along_xi = (cos * big_eta[1] - sin * big_eta[0]) / flat_area;
        let along_eta = (sin * big_xi[0] - cos * big_xi[1]) / flat_area;
        unit(add_scaled(scaled(along_xi, xi), along_eta, eta))
    };
    let directions = [carried(fibres[0])?, carried(fibres[1])?];
    let [a, b] = directions;
    Some(Sheared {
        directions,
        angle: norm(cross(a, b)).fixed_atan2(dot(a, b)),
        area_ratio: norm(across) / flat_area,
        normal,
    })
}

/// The least part of the x axis that a formed ply must keep for [`deviations`]: the ply's normal is then at least 30 degrees off that axis.
const LEAST_OF_AXIS: f64 = 0.5;

/// How far the fibres of a formed cell have turned from the directions as laid (rad, -pi/2 to pi/2, counter-clockwise about the cell's normal).
///
/// A direction as laid counts on the formed ply as it does on the flat one: from the x axis, which is projected onto the cell, about the cell's
/// normal. `laid` are the directions of the families in the flat ply (rad, from x). `None` where the cell stands so steeply across the x axis that
/// its projection has no direction to speak of.
#[must_use]
pub fn deviations(cell: &Sheared, laid: [f64; 2]) -> Option<[f64; 2]> {
    let n = cell.normal;
    let axis = add_scaled([1.0, 0.0, 0.0], -n[0], n);
    if norm(axis) < LEAST_OF_AXIS {
        return None;
    }
    let across = cross(n, axis);
    let of = |family: usize| {
        let f = cell.directions[family];
        let turned = dot(f, across).fixed_atan2(dot(f, axis)) - laid[family];
        // A fibre has no head: directions that differ by half a turn are one.
        turned - (turned / PI).round() * PI
    };
    Some([of(0), of(1)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    const FLAT: [Vec3; 4] = [
        [0.0, 0.0, 9.0],
        [0.1, 0.0, 9.0],
        [0.1, 0.2, 9.0],
        [0.0, 0.2, 9.0],
    ];

    /// Simple shear by `gamma`, then stretched along x, then turned about x by a right angle.
    fn moved(p: Vec3, gamma: f64, stretch: f64) -> Vec3 {
        [stretch * (p[0] + gamma.tan() * p[1]), 0.0, p[1]]
    }

    #[test]
    fn a_sheared_and_stretched_cell_has_the_fibres_of_the_closed_form() {
        let (gamma, stretch) = (0.3f64, 1.25);
        let formed = FLAT.map(|p| moved(p, gamma, stretch));
        let found = sheared(&FLAT, &formed, [0.0, FRAC_PI_2]).unwrap();
        let second = [stretch * gamma.tan(), 0.0, 1.0];
        let length = norm(second);
        for k in 0..3 {
            assert!((found.directions[0][k] - [1.0, 0.0, 0.0][k]).abs() < 1e-15);
            assert!((found.directions[1][k] - second[k] / length).abs() < 1e-15);
        }
        assert!((found.angle - (1.0f64).atan2(stretch * gamma.tan())).abs() < 1e-15);
        assert!((found.area_ratio - stretch).abs() < 1e-14);
        assert!((found.normal[1] + 1.0).abs() < 1e-15, "{:?}", found.normal);
    }

    #[test]
    fn triangles_and_distorted_quads_of_one_deformation_agree() {
        let (gamma, stretch) = (-0.4, 0.9);
        let odd = [
            [0.01, -0.02, 0.0],
            [0.13, 0.01, 0.0],
            [0.1, 0.2, 0.0],
            [-0.03, 0.17, 0.0],
        ];
        let fibres = [FRAC_PI_4, -FRAC_PI_4];
        let of = |flat: &[Vec3]| {
            let formed: Vec<Vec3> = flat.iter().map(|p| moved(*p, gamma, stretch)).collect();
            sheared(flat, &formed, fibres).unwrap()
        };
        let (quad, triangle) = (of(&odd), of(&odd[..3]));
        for family in 0..2 {
            for k in 0..3 {
                let d = quad.directions[family][k] - triangle.directions[family][k];
                assert!(d.abs() < 1e-14);
            }
        }
        assert!((quad.area_ratio - stretch).abs() < 1e-14);
        assert!((triangle.area_ratio - stretch).abs() < 1e-14);
        assert!((quad.angle - triangle.angle).abs() < 1e-14);
    }

    #[test]
    fn cells_without_area_have_no_fibres() {
        assert_eq!(sheared(&FLAT, &[[0.0; 3]; 4], [0.0, 1.0]), None);
        let line = FLAT.map(|p| [p[0], 0.0, 0.0]);
        assert_eq!(sheared(&FLAT, &line, [0.0, 1.0]), None);
        let back = [FLAT[3], FLAT[2], FLAT[1], FLAT[0]];
        assert_eq!(sheared(&back, &FLAT, [0.0, 1.0]), None);
    }

    /// The deviations (deg) of a flat square of a ply at +-45 deg after `to`.
    fn deviation_after(to: impl Fn(Vec3) -> Vec3) -> Option<[f64; 2]> {
        let laid = [-FRAC_PI_4, FRAC_PI_4];
        let cell = sheared(&FLAT, &FLAT.map(|p| to([p[0], p[1], 0.0])), laid).unwrap();
        deviations(&cell, laid).map(|d| d.map(f64::to_degrees))
    }

    fn near(found: Option<[f64; 2]>, expected: [f64; 2]) {
        let found = found.unwrap();
        let off = (0..2).map(|k| (found[k] - expected[k]).abs());
        assert!(off.fold(0.0, f64::max) < 1e-9, "{found:?} {expected:?}");
    }

    #[test]
    fn a_ply_that_is_folded_over_an_edge_along_or_across_x_has_no_deviation() {
        for fold in [0.3, 1.2, 1.5, -1.2] {
            let (s, c) = f64::sin_cos(fold);
            near(deviation_after(|p| [p[0], c * p[1], s * p[1]]), [0.0; 2]);
        }
        // About y up to 60 deg; a wall that stands more steeply across the axis is not judged.
        let about_y = |fold: f64| {
            let (s, c) = fold.sin_cos();
            deviation_after(move |p| [c * p[0], p[1], s * p[0]])
        };
        near(about_y(1.0), [0.0; 2]);
        assert_eq!(about_y(1.1), None);
    }

    #[test]
    fn shear_turns_one_family_or_both_and_a_turn_of_the_ply_counts_too() {
        let (s, c) = 0.1f64.sin_cos();
        let turned = deviation_after(|p| [c * p[0] - s * p[1], s * p[0] + c * p[1], 0.0]);
        near(turned, [0.1f64.to_degrees(); 2]);
        // Pulled along x: both families turn towards it, by half of the shear angle each.
        let k = 10f64.to_radians();
        let stretched = (FRAC_PI_4 - k).tan();
        near(
            deviation_after(|p| [p[0], stretched * p[1], 0.0]),
            [10.0, -10.0],
        );
        // On a wall along x, and seen from its outer side, the same.
        near(
            deviation_after(|p| [p[0], 0.0, -stretched * p[1]]),
            [10.0, -10.0],
        );
    }

    #[test]
    fn a_wrinkle_whose_crest_runs_down_a_wall_is_no_deviation() {
        // A wall that stands on x, and on it the flank of a wrinkle: turned about z by 30 deg.
        let (s, c) = 30f64.to_radians().sin_cos();
        near(deviation_after(|p| [c * p[0], s * p[0], -p[1]]), [0.0; 2]);
    }
}
