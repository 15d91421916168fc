//! The ruck of a ply that pressure holds to its support: how long it is, what force and how much excess length it takes.
//!
//! A strip that bends lies on a plane under a pressure and is compressed along itself. Where it lifts off, small slopes `w'` obey
//! `D w'''' + P w'' = -q` with `w = w' = w'' = 0` where it leaves the plane (R. E. Hobbs, In-service buckling of heated pipelines, J. Transp. Eng.
//! 110, 1984: `P = 80.76 D / L^2`, `a = 2.408e-3 q L^4 / D`). The stiffness `D` of a law that softens is that of its first harmonic at the
//! crest's curvature.

use plyflow_fixed::FixedBits;
use std::f64::consts::PI;

/// The first positive root of `tan z = z`: half of a ruck's length over `(D / P)^(1/2)`.
const ROOT: f64 = 4.493_409_457_909_064;

/// Places on half a wave over which the first harmonic of a law is taken.
const PHASES: usize = 16;

/// Curvatures per doubling in the table of a law, the first of them (1/m), and how many there are: to 1e5 1/m.
const PER_DOUBLING: f64 = 4.0;
const FIRST_CURVATURE: f64 = 1e-2;
const CURVATURES: usize = 94;

/// What bends in a ruck: the first harmonic of its moment over the amplitude of its curvature.
///
/// For a curvature `k cos(t)` it is `(2 / pi)` times the integral of `M(k cos t) cos t` over half a wave: both signs of curvature count. A law
/// `M = D k` gives `D k` exactly.
#[derive(Debug, Clone, PartialEq)]
pub struct Harmonic {
    /// `[n]` (1/m), rising, from 0 on.
    curvature: Vec<f64>,
    /// `[n]` (N), moment per width.
    moment: Vec<f64>,
}

impl Harmonic {
    /// Of a law that gives the moments (N, per width) at signed curvatures (1/m).
    pub fn of(law: impl Fn(&[f64]) -> Vec<f64>) -> Self {
        let cosines: Vec<f64> = (0..PHASES)
            .map(|i| (PI * (i as f64 + 0.5) / PHASES as f64).fixed_cos())
            .collect();
        let amplitude = |i: usize| FIRST_CURVATURE * (i as f64 / PER_DOUBLING).fixed_exp2();
        let (mut curvature, mut moment) = (vec![0.0], vec![0.0]);
        for k in (0..CURVATURES).map(amplitude) {
            let at: Vec<f64> = cosines.iter().map(|c| k * c).collect();
            let sum: f64 = law(&at).iter().zip(&cosines).map(|(m, c)| m * c).sum();
            curvature.push(k);
            moment.push(2.0 * sum / PHASES as f64);
        }
        Self { curvature, moment }
    }

    /// Two that bend together.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let sum = |(a, b): (&f64, &f64)| a + b;
        Self {
            curvature: self.curvature.clone(),
            moment: self.moment.iter().zip(&other.moment).map(sum).collect(),
        }
    }

    /// Whether it has a stiffness at every curvature: its moment rises.
    pub fn bends(&self) -> bool {
        self.moment.windows(2).all(|m| m[1] > m[0])
    }

    /// The piece of the table, as moment and slope at its first curvature.
    fn piece(&self, i: usize) -> (f64, f64, f64) {
        let [k, next] = [i, i + 1].map(|i| self.curvature[i]);
        let [m, beyond] = [i, i + 1].map(|i| self.moment[i]);
        (k, m, (beyond - m) / (next - k))
    }

    /// Moment over curvature (N m) at a curvature's amplitude (1/m); beyond the table the last piece goes on.
    pub fn stiffness(&self, curvature: f64) -> f64 {
        let after = self.curvature.partition_point(|k| *k < curvature);
        let last = self.curvature.len() - 2;
        let (k, m, slope) = self.piece(after.saturating_sub(1).min(last));
        if curvature > 0.0 {
            (m + slope * (curvature - k)) / curvature
        } else {
            slope
        }
    }

    /// The curvature (1/m) at which curvature times moment is `work` (N/m): it rises with the curvature.
    fn at_work(&self, work: f64) -> f64 {
        let reached = |i: usize| self.curvature[i] * self.moment[i] < work;
        let last = self.curvature.len() - 2;
        let after = (0..=last + 1).take_while(|i| reached(*i)).count();
        let (k, m, slope) = self.piece(after.saturating_sub(1).min(last));
        // slope x^2 + c x = work, without cancellation.
        let c = m - slope * k;
        2.0 * work / (c + (c * c + 4.0 * slope * work).sqrt())
    }
}

/// A ruck of some height.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ruck {
    /// Force per width (N/m) with which it holds itself up.
    pub force: f64,
    /// Length over which the ply is off its support (m).
    pub length: f64,
    /// By how much the ply is longer there than its support (m).
    pub excess: f64,
    /// Amplitude of its curvature (1/m).
    pub curvature: f64,
}

impl Ruck {
    /// Of the height `height` (m) under the pressure `pressure` (Pa), both above 0.
    ///
    /// With `z` the root of `tan z = z` and `c = 1 + (1 + z^2)^(1/2)` the crest has the curvature `c q / P`. There is a first integral: at the crest
    /// `D k^2 / 2 = q a`, which gives the curvature, and with it `P`, `L = 2 z (D / P)^(1/2)` and the excess length, which is half of the
    /// integral of `w'^2`: `5 z^3 q^2 / (6 P^2) (D / P)^(3/2)`.
    pub fn under(bending: &Harmonic, pressure: f64, height: f64) -> Self {
        let crest = 1.0 + (1.0 + ROOT * ROOT).sqrt();
        let curvature = bending.at_work(2.0 * pressure * height);
        let force = crest * pressure / curvature;
        let wave = (bending.stiffness(curvature) / force).sqrt();
        let slope = pressure / force;
        Self {
            force,
            length: 2.0 * ROOT * wave,
            excess: 5.0 / 6.0 * ROOT * ROOT * ROOT * slope * slope * wave * wave * wave,
            curvature,
        }
    }

    /// Of the height `height` (m) over a place of the length `length` (m) that nothing presses and at whose ends the ply is held flat: Euler's strip
    /// between clamps, `w = a (1 + cos(2 pi x / L)) / 2`, `P = 4 pi^2 D / L^2`, excess length `pi^2 a^2 / (4 L)`.
    pub fn clamped(bending: &Harmonic, length: f64, height: f64) -> Self {
        let wave = 2.0 * PI / length;
        let curvature = 0.5 * height * wave * wave;
        Self {
            force: bending.stiffness(curvature) * wave * wave,
            length,
            excess: PI * PI * height * height / (4.0 * length),
            curvature,
        }
    }
}
