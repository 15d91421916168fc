//! Turning in the plane.

use plyflow_fixed::FixedBits;
use plyflow_model::outline::Point;
use std::f64::consts::FRAC_PI_2;

/// Sine and cosine of an angle (rad); of whole quarter turns without rounding.
pub fn sin_cos(angle: f64) -> (f64, f64) {
    let quarters = angle / FRAC_PI_2;
    if (quarters - quarters.round()).abs() > 1e-12 {
        return angle.fixed_sin_cos();
    }
    match quarters.round().rem_euclid(4.0) as u8 {
        0 => (0.0, 1.0),
        1 => (1.0, 0.0),
        2 => (0.0, -1.0),
        _ => (-1.0, 0.0),
    }
}

/// A point (m) turned about (0, 0) by an angle (rad), counter-clockwise.
pub fn turned([x, y]: Point, angle: f64) -> Point {
    let (s, c) = sin_cos(angle);
    // Adding 0 makes of -0 a 0.
    [c * x - s * y + 0.0, s * x + c * y + 0.0]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quarter_turns_are_exact_and_others_keep_lengths() {
        for (degrees, want) in [
            (0.0_f64, [0.3, 0.1]),
            (90.0, [-0.1, 0.3]),
            (-90.0, [0.1, -0.3]),
            (180.0, [-0.3, -0.1]),
            (450.0, [-0.1, 0.3]),
        ] {
            assert_eq!(turned([0.3, 0.1], degrees.to_radians()), want, "{degrees}");
        }
        let [x, y] = turned([0.2, 0.0], 30_f64.to_radians());
        assert!(
            (x - 0.03_f64.sqrt()).abs() < 1e-15 && (y - 0.1).abs() < 1e-15,
            "{x} {y}"
        );
    }
}
