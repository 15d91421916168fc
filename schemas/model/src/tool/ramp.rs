//! The profile of a joggle: level, arc, straight slope, arc, level.

use plyflow_fixed::FixedBits;

/// A rise over a length with circular fillets of one radius at its foot and head; C1, with curvature 0 or
/// 1/radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ramp {
    length: f64,
    rise: f64,
    radius: f64,
    /// Length of each arc along the base.
    arc: f64,
    /// Slope between the arcs.
    slope: f64,
}

impl Ramp {
    /// `length` counts the fillets. `None` where the arcs do not fit: `length` must be at least
    /// [`Ramp::shortest`].
    pub fn new(length: f64, rise: f64, radius: f64) -> Option<Self> {
        let height = rise.abs();
        if height == 0.0 {
            return Some(Self {
                length,
                rise,
                radius,
                arc: 0.0,
                slope: 0.0,
            });
        }
        // Two arcs of angle t and a tangent line between them span (length, height):
        //   length sin t + (2 radius - height) cos t = 2 radius.
        let amplitude = length.fixed_hypot(2.0 * radius - height);
        if length < Self::shortest(rise, radius) {
            return None;
        }
        let angle = length.fixed_atan2(2.0 * radius - height)
            - (2.0 * radius / amplitude).clamp(-1.0, 1.0).fixed_acos();
        Some(Self {
            length,
            rise,
            radius,
            arc: radius * angle.fixed_sin(),
            slope: angle.fixed_tan(),
        })
    }

    /// Shortest length in which both fillets fit (they meet with no straight part between), and the slope
    /// stays under 45 degrees.
    pub fn shortest(rise: f64, radius: f64) -> f64 {
        let height = rise.abs();
        let half = std::f64::consts::FRAC_PI_4;
        let arcs_at_45 = 2.0 * radius * (1.0 - half.fixed_cos());
        if height > arcs_at_45 {
            2.0 * radius * half.fixed_sin() + (height - arcs_at_45)
        } else {
            (4.0 * height * radius - height * height).max(0.0).sqrt()
        }
    }

    /// Height at distance `s` from the foot; 0 before it and `rise` beyond `length`.
    pub fn height(&self, s: f64) -> f64 {
        let top = self.rise.abs();
        let sign = self.rise.signum();
        let arc = |s: f64| self.radius - (self.radius * self.radius - s * s).max(0.0).sqrt();
        let h = if top == 0.0 || s <= 0.0 {
            0.0
        } else if s < self.arc {
            arc(s)
        } else if s <= self.length - self.arc {
            arc(self.arc) + (s - self.arc) * self.slope
        } else if s < self.length {
            top - arc(self.length - s)
        } else {
            top
        };
        sign * h
    }

    /// Largest slope, without sign.
    pub fn slope(&self) -> f64 {
        self.slope
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profile_is_continuous_in_height_and_slope_and_keeps_its_radius() {
        for (length, rise, radius) in [
            (30e-3, 10e-3, 12e-3),
            (28e-3, -10e-3, 10e-3),
            (40e-3, 4e-3, 15e-3),
        ] {
            let ramp = Ramp::new(length, rise, radius).unwrap();
            assert_eq!(ramp.height(-1.0), 0.0);
            assert_eq!(ramp.height(1.0), rise);
            let d = 1e-5;
            let mut largest: f64 = 0.0;
            for i in -100..3200 {
                let s = i as f64 * d;
                let (a, b, c) = (ramp.height(s - d), ramp.height(s), ramp.height(s + d));
                let slope = (c - a) / (2.0 * d);
                let curvature =
                    ((a - 2.0 * b + c) / (d * d)).abs() / (1.0 + slope * slope).powf(1.5);
                largest = largest.max(curvature);
            }
            assert!(
                (largest * radius - 1.0).abs() < 2e-3,
                "radius {} for {radius}",
                1.0 / largest
            );
        }
    }

    #[test]
    fn shortest_length_is_the_bound_of_what_can_be_built() {
        for (rise, radius) in [(10e-3, 12e-3), (10e-3, 10e-3), (30e-3, 10e-3)] {
            let shortest = Ramp::shortest(rise, radius);
            let ramp = Ramp::new(shortest * (1.0 + 1e-9), rise, radius).unwrap();
            assert!(ramp.slope() <= 1.0 + 1e-3, "slope {}", ramp.slope());
            assert!(Ramp::new(shortest * 0.999, rise, radius).is_none());
            let jump = (ramp.height(shortest / 2.0) - rise / 2.0).abs();
            assert!(
                jump < 1e-9,
                "the profile is not symmetric about its middle: {jump}"
            );
        }
    }
}
