//! A measured profile, what is fitted to it, and what a fit gives.

use crate::linear::Solution;
use plyflow_fixed::FixedBits;
use serde::Deserialize;

/// Points of one measured profile, from the clamp outwards.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// Horizontal distance from the clamp's edge (m).
    pub x: Vec<f64>,
    /// Deflection, downwards (m).
    pub deflection: Vec<f64>,
}

/// A profile with fewer points is refused.
pub const FEWEST_POINTS: usize = 12;

/// Whether points go along the strip from the clamp to the tip. `tolerance` (m): so far a point may lie back. `place(i)`: where it stands.
fn goes_outwards(
    x: &[f64],
    deflection: &[f64],
    tolerance: f64,
    place: &dyn Fn(usize) -> String,
) -> Result<(), String> {
    let n = x.len();
    let half = (n / 20).max(3);
    for i in 1..n {
        // Which way the strip went up to the last point; out of the clamp it goes along x.
        let (a, b) = (i.saturating_sub(half), i - 1);
        let way = [x[b] - x[a], deflection[b] - deflection[a]];
        let length = way[0].fixed_hypot(way[1]);
        let along = if length > tolerance {
            way.map(|w| w / length)
        } else {
            [1.0, 0.0]
        };
        let forward = (x[i] - x[b]) * along[0] + (deflection[i] - deflection[b]) * along[1];
        if forward < -tolerance {
            return Err(format!(
                "{}: the points turn back along the strip here (x = {:.3} mm after {:.3} mm); they must be \
                 ordered from the clamp to the tip",
                place(i),
                1e3 * x[i],
                1e3 * x[i - 1]
            ));
        }
    }
    Ok(())
}

impl Profile {
    /// Checks points `x` (m, outwards) and `z` (m, height, upwards), of which `place(i)` says in messages
    /// where they stand. The first point must lie within `clamp_tolerance` (m) of x = z = 0.
    ///
    /// # Errors
    /// Too few points, a first point away from the clamp, points that turn back along the strip, a
    /// strip that rises.
    pub fn new(
        x: &[f64],
        z: &[f64],
        clamp_tolerance: f64,
        place: &dyn Fn(usize) -> String,
    ) -> Result<Self, String> {
        let n = x.len();
        if n < FEWEST_POINTS || z.len() != n {
            return Err(format!(
                "{}: the profile has {n} points in x and {} in z; at least {FEWEST_POINTS} of each are needed",
                place(0),
                z.len()
            ));
        }
        if let Some(i) = (0..n).find(|&i| !x[i].is_finite() || !z[i].is_finite()) {
            return Err(format!(
                "{}: x = {} m, z = {} m is no point",
                place(i),
                x[i],
                z[i]
            ));
        }
        if x[0].abs() > clamp_tolerance || z[0].abs() > clamp_tolerance {
            return Err(format!(
                "{}: the profile starts at x = {:.3} mm, z = {:.3} mm; it must start at the edge of the clamp, \
                 x = z = 0 within {:.3} mm: move the points so, or raise `clamp_tolerance`",
                place(0),
                1e3 * x[0],
                1e3 * z[0],
                1e3 * clamp_tolerance
            ));
        }
        let deflection: Vec<f64> = z.iter().map(|z| -z).collect();
        goes_outwards(x, &deflection, clamp_tolerance, place)?;
        let mean = deflection.iter().sum::<f64>() / n as f64;
        if mean <= 0.0 {
            return Err(format!(
                "{}: the profile rises from the clamp (mean height {:.3} mm); z is a height, upwards, so a hanging \
                 strip has negative z",
                place(0),
                -1e3 * mean
            ));
        }
        Ok(Self {
            x: x.to_vec(),
            deflection,
        })
    }

    pub(super) fn last(&self) -> usize {
        self.x.len() - 1
    }
}

/// What is fitted to the profile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// A polynomial of the tangent's angle over the arc length, by least squares of the distances normal to
    /// the curve. Clamped (`y(0) = y'(0) = 0`) and with the free tip's conditions: no curvature and no change
    /// of it at the tip.
    TangentAngle,
    /// A polynomial y(x) by least squares of the vertical distances, clamped (`y(0) = y'(0) = 0`): the
    /// thesis' fit with a clamp.
    Deflection,
}

/// What a fit may choose from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// What is fitted.
    pub method: Method,
    /// Degree of the polynomial; `None`: by the rule of [`super::fit`].
    pub degree: Option<usize>,
    /// Highest degree that the rule may take.
    pub maximum_degree: usize,
    /// Part of the length at each end over which the curvature is not judged.
    pub trim: f64,
    /// Length of the overhanging part (m); `None`: up to the last point.
    pub overhang: Option<f64>,
}

/// Stations along the fitted curve, evenly over the arc (tangent angle) or over x (deflection).
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Stations {
    /// Arc length from the clamp (m).
    pub arc: Vec<f64>,
    /// Horizontal distance (m).
    pub x: Vec<f64>,
    /// Deflection, downwards (m).
    pub deflection: Vec<f64>,
    /// Curvature (1/m), positive where the strip bends downwards.
    pub curvature: Vec<f64>,
    /// `integral from s to L of (x(u) - x(s)) du` (m2): times the weight per area, the moment per width.
    pub moment_arm: Vec<f64>,
}

impl Stations {
    /// Indices of the stations that lie at least `trim` times the length from both ends.
    pub fn inner(&self, trim: f64) -> std::ops::Range<usize> {
        let length = self.arc.last().copied().unwrap_or(0.0);
        let start = self.arc.iter().take_while(|s| **s < trim * length).count();
        let after = self
            .arc
            .iter()
            .rev()
            .take_while(|s| **s > (1.0 - trim) * length)
            .count();
        start..self.arc.len() - after
    }

    /// Whether the curvature falls from the clamp to the tip and stays positive over the inner stations, but
    /// for ripples of [`RIPPLE`] of the largest.
    pub fn bends_monotonically(&self, trim: f64) -> bool {
        let inner = &self.curvature[self.inner(trim)];
        let largest = inner.iter().fold(0.0f64, |m, k| m.max(*k));
        let mut least = f64::INFINITY;
        inner.iter().all(|k| {
            least = least.min(*k);
            k - least <= RIPPLE * largest && *k >= -RIPPLE * largest
        })
    }
}

/// A fitted profile.
#[derive(Debug, Clone)]
pub struct ProfileFit {
    /// Degree of the polynomial.
    pub degree: usize,
    /// Coefficients in the fit's own basis.
    pub unknowns: Vec<f64>,
    /// Independent changes of the unknowns, each one standard error large, estimated from the residuals.
    pub spread: Vec<Vec<f64>>,
    /// Root mean square distance of the points from the curve (m).
    pub rms: f64,
    /// Condition of the fit's matrix with columns of length 1.
    pub condition: f64,
    /// Length of the overhanging part (m).
    pub length: f64,
    /// The curve.
    pub stations: Stations,
    /// Whether curvature is positive and falls from the clamp to the tip.
    pub monotone: bool,
}

/// Ripples of the curvature, over the largest, that a fit may have.
pub const RIPPLE: f64 = 0.02;

/// The changes of one standard error, given the deviation of a point.
pub(super) fn spread(solution: &Solution, deviation: f64) -> Vec<Vec<f64>> {
    let scaled = |v: &Vec<f64>| v.iter().map(|c| c * deviation).collect();
    solution.spread.iter().map(scaled).collect()
}

/// Checks a given overhang against the arc that the points reach.
pub(super) fn overhang_reaches(overhang: f64, arc: f64) -> Result<(), String> {
    if overhang >= 0.99 * arc {
        return Ok(());
    }
    Err(format!(
        "the profile is {:.2} mm long, but `overhang` is {:.2} mm; it is the length of the strip from the clamp to \
         the tip",
        1e3 * arc,
        1e3 * overhang
    ))
}
