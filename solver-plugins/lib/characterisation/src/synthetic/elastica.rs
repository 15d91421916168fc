//! The elastica under its own weight, solved as an ODE.

use plyflow_fixed::FixedBits;

/// A strip that is clamped horizontally at x = 0 and hangs under its own weight.
#[derive(Debug, Clone, PartialEq)]
pub struct Elastica {
    /// Arc length from the clamp (m), evenly spaced.
    pub arc: Vec<f64>,
    /// Horizontal place (m).
    pub x: Vec<f64>,
    /// Deflection, downwards (m).
    pub deflection: Vec<f64>,
    /// Angle of the tangent below the horizontal (rad).
    pub angle: Vec<f64>,
    /// Curvature (1/m).
    pub curvature: Vec<f64>,
    /// Moment per width (N).
    pub moment: Vec<f64>,
}

impl Elastica {
    /// Angle of the secant from the clamp to the tip, below the horizontal (rad).
    pub fn secant_angle(&self) -> f64 {
        let last = self.arc.len() - 1;
        self.deflection[last].fixed_atan2(self.x[last])
    }

    /// Place `[x, deflection]` at an arc length, between the stations by cubic Hermite pieces.
    pub fn at(&self, s: f64) -> [f64; 2] {
        let h = self.arc[1];
        let i = ((s / h) as usize).min(self.arc.len() - 2);
        let t = s / h - i as f64;
        let (t2, t3) = (t * t, t * t * t);
        let hermite = |p: &[f64], d: [f64; 2]| {
            p[i] * (2.0 * t3 - 3.0 * t2 + 1.0)
                + p[i + 1] * (3.0 * t2 - 2.0 * t3)
                + h * (d[0] * (t3 - 2.0 * t2 + t) + d[1] * (t3 - t2))
        };
        let ends = [self.angle[i], self.angle[i + 1]];
        [
            hermite(&self.x, ends.map(FixedBits::fixed_cos)),
            hermite(&self.deflection, ends.map(FixedBits::fixed_sin)),
        ]
    }
}

/// Solves `dtheta/ds = k`, `d M(k)/ds = -weight (length - s) cos theta`, `theta(0) = 0`, `k(length) = 0` by
/// fourth-order Runge-Kutta from the tip and bisection of the tip's angle.
///
/// `law`: moment per width (N) and its slope (N m) at a curvature (1/m), growing and 0 at 0; `weight`: per
/// area (N/m2); `length`: overhang (m); `steps`: intervals of the result. Angles grow downwards.
pub fn elastica(
    law: &impl Fn(f64) -> [f64; 2],
    weight: f64,
    length: f64,
    steps: usize,
) -> Elastica {
    let (mut low, mut high) = (0.0, std::f64::consts::FRAC_PI_2);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if integrate(law, weight, length, steps, middle)
            .last()
            .is_some_and(|s| s[0] > 0.0)
        {
            high = middle;
        } else {
            low = middle;
        }
    }
    let mut states = integrate(law, weight, length, steps, 0.5 * (low + high));
    states.reverse();
    let [_, x0, y0, _] = states[0];
    let h = length / steps as f64;
    Elastica {
        arc: (0..=steps).map(|i| i as f64 * h).collect(),
        x: states.iter().map(|s| s[1] - x0).collect(),
        deflection: states.iter().map(|s| s[2] - y0).collect(),
        angle: states.iter().map(|s| s[0]).collect(),
        curvature: states.iter().map(|s| s[3]).collect(),
        moment: states.iter().map(|s| law(s[3])[0]).collect(),
    }
}

/// States `[theta, x, y, k]` from the tip to the clamp.
fn integrate(
    law: &impl Fn(f64) -> [f64; 2],
    weight: f64,
    length: f64,
    steps: usize,
    tip: f64,
) -> Vec<[f64; 4]> {
    let h = length / steps as f64;
    let rate = |t: f64, s: [f64; 4]| {
        [
            -s[3],
            -s[0].fixed_cos(),
            -s[0].fixed_sin(),
            weight * t * s[0].fixed_cos() / law(s[3])[1],
        ]
    };
    let shifted = |s: [f64; 4], r: [f64; 4], by: f64| std::array::from_fn(|i| s[i] + by * r[i]);
    let mut states = vec![[tip, 0.0, 0.0, 0.0]];
    for i in 0..steps {
        let (t, s) = (i as f64 * h, states[i]);
        let a = rate(t, s);
        let b = rate(t + 0.5 * h, shifted(s, a, 0.5 * h));
        let c = rate(t + 0.5 * h, shifted(s, b, 0.5 * h));
        let d = rate(t + h, shifted(s, c, h));
        states.push(std::array::from_fn(|i| {
            s[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])
        }));
    }
    states
}

/// Overhang (m) at which the secant of the hanging strip has an angle (rad), by bisection.
pub fn overhang_at(law: &impl Fn(f64) -> [f64; 2], weight: f64, angle: f64) -> f64 {
    let at = |length: f64| elastica(law, weight, length, 600).secant_angle();
    let mut high = 0.01;
    while at(high) < angle {
        high *= 1.2;
    }
    let mut low = high / 1.2;
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if at(middle) < angle {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::BENDING;

    #[test]
    fn a_stiff_strip_hangs_as_the_beam_formula_says() {
        // Tip w L^4 / 8 B, moment at the clamp w L^2 / 2.
        let e = elastica(&|k| [0.1 * k, 0.1], 2.0, 0.1, 200);
        let tip = 2.0 * 0.1f64.powi(4) / (8.0 * 0.1);
        assert!(
            (e.deflection[200] / tip - 1.0).abs() < 1e-4,
            "{}",
            e.deflection[200] / tip
        );
        assert!((e.moment[0] / (0.5 * 2.0 * 0.01) - 1.0).abs() < 1e-5);
        assert!(e.moment[200].abs() < 1e-15);
    }

    #[test]
    fn a_soft_strip_converges_with_fourth_order() {
        let law = |k: f64| BENDING[0].law(k);
        let tip = |n: usize| *elastica(&law, 2.06, 0.13, n).deflection.last().unwrap();
        let (a, b, c) = (tip(100), tip(200), tip(400));
        let order = ((a - b) / (b - c)).abs().log2();
        assert!((3.5..4.7).contains(&order), "{order}");
    }
}
