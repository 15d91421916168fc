//! How the crests of a ply lie: oblique to the tool, how far apart, and as their own mirror image.

use crate::measured::Measured;
use plyflow_defects::{Defect, Kind};
use plyflow_fixed::FixedBits;
use std::f64::consts::{FRAC_PI_2, PI};

/// What is told of the crests of a ply.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crests {
    /// Direction of the longest crest in the flat ply, from the axis that was asked for, in (-pi/2, pi/2] (rad).
    pub direction: f64,
    /// Its angle from that axis or from the line across it, whichever is nearer (rad): 0 to pi/4.
    pub obliquity: f64,
    /// How far the middles of the two longest lie apart in the flat ply, measured along that axis (m); `None` with fewer than two. A middle is the
    /// mean of the places along a crest.
    pub distance: Option<f64>,
    /// Mean distance in the flat ply of a place on a crest from the nearest one on the mirror image of all crests (m): with x turned round, with y,
    /// and with both (half a turn).
    pub image: [f64; 3],
}

impl Crests {
    /// Of the wrinkles of a ply, `axis` from x (rad); `None` without one.
    pub fn of(measured: &Measured, axis: f64) -> Option<Self> {
        let mut wrinkles: Vec<&Defect> = (measured.defects.iter())
            .filter(|d| d.kind == Kind::Wrinkle)
            .collect();
        wrinkles.sort_by(|a, b| b.length.total_cmp(&a.length));
        let direction = turned(wrinkles.first()?.direction - axis);
        let places = |d: &Defect| -> Vec<[f64; 2]> {
            let undeformed = |n: &u32| measured.ply.undeformed[*n as usize];
            let flat = |p: [f64; 3]| [p[0], p[1]];
            (d.ridge_nodes.iter())
                .map(|n| flat(undeformed(n)))
                .collect()
        };
        let crests: Vec<Vec<[f64; 2]>> = wrinkles.iter().map(|d| places(d)).collect();
        let distance = match crests.as_slice() {
            [first, second, ..] => Some(apart(&[first, second].map(|c| middle(c)), axis)),
            _ => None,
        };
        let crests = crests.concat();
        let image = [[-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]].map(|way| from_image(&crests, way));
        Some(Self {
            direction,
            obliquity: direction.abs().min(FRAC_PI_2 - direction.abs()),
            distance,
            image,
        })
    }

    /// Names, units and values of its results.
    pub fn told(&self) -> Vec<(&'static str, &'static str, f64)> {
        let [x, y, turn] = self.image;
        let mut told = vec![
            ("wrinkle_direction", "rad", self.direction),
            ("wrinkle_obliquity", "rad", self.obliquity),
            ("crest_image_x", "m", x),
            ("crest_image_y", "m", y),
            ("crest_image_turn", "m", turn),
        ];
        told.extend(self.distance.map(|d| ("wrinkle_distance", "m", d)));
        told
    }
}

/// Mean of places.
fn middle(places: &[[f64; 2]]) -> [f64; 2] {
    let sum = |k: usize| places.iter().map(|p| p[k]).sum::<f64>();
    [0, 1].map(|k| sum(k) / places.len() as f64)
}

/// How far two places lie apart along an axis (rad).
fn apart([a, b]: &[[f64; 2]; 2], axis: f64) -> f64 {
    let (along, across) = (axis.fixed_cos(), axis.fixed_sin());
    ((b[0] - a[0]) * along + (b[1] - a[1]) * across).abs()
}

/// A direction of a line, in (-pi/2, pi/2].
fn turned(angle: f64) -> f64 {
    let rest = angle % PI;
    if rest > FRAC_PI_2 {
        rest - PI
    } else if rest <= -FRAC_PI_2 {
        rest + PI
    } else {
        rest
    }
}

/// Mean distance of places from the nearest of their images.
fn from_image(places: &[[f64; 2]], way: [f64; 2]) -> f64 {
    let nearest = |p: &[f64; 2]| {
        places
            .iter()
            .map(|q| (p[0] - way[0] * q[0]).fixed_hypot(p[1] - way[1] * q[1]))
            .fold(f64::INFINITY, f64::min)
    };
    let sum: f64 = places.iter().map(nearest).sum();
    sum / places.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oblique_crest_through_the_middle_is_its_image_after_half_a_turn_alone() {
        // From (-60, -30) to (60, 30) mm.
        let places: Vec<[f64; 2]> = (-60..=60)
            .map(|k| [1e-3 * f64::from(k), 0.5e-3 * f64::from(k)])
            .collect();
        assert!(from_image(&places, [-1.0, -1.0]) < 1e-12);
        // A place s from the middle lies s sin(2 phi) beside the other line, nearest to a place that is on it.
        let slope = 0.5f64.atan();
        let mean = places
            .iter()
            .map(|p| p[0].hypot(p[1]) * (2.0 * slope).sin())
            .sum::<f64>()
            / places.len() as f64;
        for way in [[-1.0, 1.0], [1.0, -1.0]] {
            let found = from_image(&places, way);
            assert!((found / mean - 1.0).abs() < 0.02, "{found} {mean}");
        }
    }

    #[test]
    fn directions_are_those_of_lines() {
        let degrees = |a: f64| turned(a.to_radians()).to_degrees();
        for (given, told) in [(100.0, -80.0), (-100.0, 80.0), (90.0, 90.0), (190.0, 10.0)] {
            assert!((degrees(given) - told).abs() < 1e-9, "{given}");
        }
    }
}
