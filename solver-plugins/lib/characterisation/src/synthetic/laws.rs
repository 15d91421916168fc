//! The laws of the thesis (tables 3.1 and 3.2), and what testing machines would record of them.

use super::elastica::{Elastica, elastica};
use super::noise::Noise;
use plyflow_fixed::FixedBits;
use std::f64::consts::{FRAC_PI_2, SQRT_2};

/// Acceleration of free fall (m/s2).
const G: f64 = 9.80665;

/// A fabric's bending in one direction, as printed: `r0 k + r_inf (1 - exp(-k / k_lim))`, k in 1/mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PublishedBending {
    /// Name.
    pub name: &'static str,
    /// `r0` (N mm), `r_inf` (N), `k_lim` (1/mm).
    pub numbers: [f64; 3],
    /// Mass per area (kg/m2).
    pub areal_mass: f64,
    /// Overhang of the revised test (m).
    pub overhang: f64,
    /// Stiffness by the standard test at 41.5 and at 7.1 degrees (N m).
    pub standard: [f64; 2],
}

/// Woven 38616, NCF FCIM359 positive and negative.
pub const BENDING: [PublishedBending; 3] = [
    PublishedBending {
        name: "woven",
        numbers: [0.01549, 0.00757, 0.02],
        areal_mass: 0.210,
        overhang: 0.130,
        standard: [0.00022, 0.00036],
    },
    PublishedBending {
        name: "ncf-positive",
        numbers: [0.19457, 0.03139, 0.0040],
        areal_mass: 0.440,
        overhang: 0.210,
        standard: [0.0038, 0.0073],
    },
    PublishedBending {
        name: "ncf-negative",
        numbers: [0.10279, 0.03619, 0.0065],
        areal_mass: 0.440,
        overhang: 0.210,
        standard: [0.0032, 0.0057],
    },
];

impl PublishedBending {
    /// Moment per width (N) at a curvature (1/m).
    pub fn moment(&self, k: f64) -> f64 {
        let [r0, r_inf, limit] = self.numbers;
        let per_millimetre = k / 1000.0;
        r0 * per_millimetre + r_inf * (1.0 - (-per_millimetre / limit).fixed_exp())
    }

    /// Moment per width (N) and its slope (N m) at a curvature (1/m).
    pub fn law(&self, k: f64) -> [f64; 2] {
        let [r0, r_inf, limit] = self.numbers;
        let slope = r0 + r_inf / limit * (-k / 1000.0 / limit).fixed_exp();
        [self.moment(k), slope / 1000.0]
    }

    /// Weight per area (N/m2).
    pub fn weight(&self) -> f64 {
        self.areal_mass * G
    }

    /// The strip of the revised test.
    pub fn strip(&self) -> Elastica {
        elastica(&|k| self.law(k), self.weight(), self.overhang, 2000)
    }

    /// What a scanner sees of it: `[x, z]` (m) every `spacing` (m) of the arc, from the clamp to the tip, with
    /// normal noise of deviation `noise` (m) in both.
    pub fn scan(&self, spacing: f64, noise: f64, seed: u64) -> [Vec<f64>; 2] {
        let strip = self.strip();
        let mut random = Noise::new(seed);
        let n = (self.overhang / spacing).round() as usize;
        let mut points = [Vec::new(), Vec::new()];
        for i in 0..=n {
            let [x, y] = strip.at(self.overhang * i as f64 / n as f64);
            points[0].push(x + noise * random.normal());
            points[1].push(-y + noise * random.normal());
        }
        points
    }
}

/// Normalised shear force (N/m) of the woven fabric at a shear angle (rad); odd.
pub fn woven_shear(g: f64) -> f64 {
    let a = g.abs();
    let c = [37.35, -322.61, 1458.51, -3539.56, 4727.84, -3275.20, 930.53];
    let sum: f64 = (1..).zip(c).map(|(n, c)| c * a.powi(n)).sum();
    sum * g.signum()
}

/// Normalised shear force (N/m) of the non-crimp fabric at a shear angle (rad): yarns, odd, and the stitch
/// for positive shear.
pub fn ncf_shear(g: f64) -> f64 {
    let a = g.abs();
    let yarns =
        112.19 * a + 94.73 * a * a + 137.06 * a.powi(3) - 65.56 * a.powi(4) + 29.56 * a.powi(5);
    let stitch = match g {
        g if (0.06..0.5).contains(&g) => 2000.0 * g - 120.0,
        g if (0.5..0.75).contains(&g) => 2640.0 - 3520.0 * g,
        _ => 0.0,
    };
    yarns * g.signum() + stitch
}

/// Cross-head force (N) of a picture frame with hinges `side` (m) apart and a specimen of `specimen` (m), when
/// it has been pulled by `displacement` (m), for a law of the signed shear angle; `sign` of the shear.
///
/// From energy alone: `dW = area F_norm(g) cos(g) dg` over a small pull, divided by the pull.
pub fn frame_force(
    law: &impl Fn(f64) -> f64,
    side: f64,
    specimen: f64,
    displacement: f64,
    sign: f64,
) -> f64 {
    let angle = |d: f64| {
        let along = side / SQRT_2 + 0.5 * d;
        let across = (side * side - along * along).sqrt();
        FRAC_PI_2 - 2.0 * across.fixed_atan2(along)
    };
    let pull = 1e-6;
    let (a, b) = (angle(displacement - pull), angle(displacement + pull));
    let place = |t: f64| {
        let g = 0.5 * (a + b) + 0.5 * (b - a) * t;
        sign * law(sign * g) * g.fixed_cos()
    };
    let t = 0.6f64.sqrt();
    let mean = (5.0 * place(-t) + 8.0 * place(0.0) + 5.0 * place(t)) / 18.0;
    specimen * specimen * mean * (b - a) / (2.0 * pull)
}

/// A sled's force over the normal force at a displacement (m): a rise to `peak` over 5 mm, a fall to the
/// dynamic coefficient over 10 mm more, then stick-slip of `ripple` with a period of 8 mm about it.
pub fn sled_coefficient(peak: f64, dynamic: f64, ripple: f64, displacement: f64) -> f64 {
    let s = 1000.0 * displacement;
    if s < 5.0 {
        return peak * s / 5.0;
    }
    let fall = (-(s - 5.0) / 3.0).fixed_exp();
    dynamic
        + (peak - dynamic) * fall
        + ripple * (1.0 - fall) * (std::f64::consts::TAU * s / 8.0).fixed_sin()
}
