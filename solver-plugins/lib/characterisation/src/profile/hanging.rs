//! The law of a strip from its whole profile at once: the elastica under its own weight, whose law is changed until it
//! hangs through the points.
//!
//! A polynomial tells the curvature at each place for itself, and where it is too stiff or too loose the law is wrong by
//! more than its scatter tells. A strip of some law has one shape: three numbers are fitted to all points, so what is left over is
//! the noise of the points, and the errors that follow from it hold.

use super::angle::{Curve, Foot, misfit, squares};
use super::terms::{Profile, overhang_reaches};
use crate::confidence::autocorrelation;
use crate::linear::least_squares;
use crate::voce::{Saturation, Voce, VoceFit};
use nalgebra::{DMatrix, DVector};
use plyflow_fixed::FixedBits;

/// Steps along the strip.
const STEPS: usize = 240;
/// How near the angle at the clamp comes to 0 (rad).
const CLAMPED: f64 = 1e-12;
const SHOTS: usize = 80;
const ITERATIONS: usize = 60;
/// Of a parameter, for the derivative of the shape.
const SMALL: f64 = 1e-4;

/// A strip that hangs as its points do.
#[derive(Debug, Clone)]
pub struct Hanging {
    /// Its law.
    pub law: Voce,
    /// Length from clamp to tip (m).
    pub length: f64,
    /// Curvature (1/m) evenly along the arc, from the clamp.
    pub curvature: Vec<f64>,
    /// Root mean square distance of the points from it (m).
    pub rms: f64,
    /// Independent changes of `linear`, `asymptote` and `scale`, each one standard error large: from the residuals, as far as they are
    /// independent of their neighbours, and from the place of the tip.
    pub spread: Vec<[f64; 3]>,
    /// Degrees of freedom of the deviation that they are told with.
    pub freedom: usize,
    /// Whether `linear`, `asymptote` and `scale` were free, and none of them ended at a bound.
    pub free: [bool; 3],
}

/// The strip of a law, and the angle at its tip (rad); `None` where the law does not carry it.
fn hang(law: &Voce, weight: f64, length: f64, near: f64) -> Option<(Curve, f64)> {
    let shot = |tip: f64| integrate(law, weight, length, tip);
    let clamp = |states: &[[f64; 4]]| {
        states
            .last()
            .map_or(f64::NAN, |s| if s[0].is_finite() { s[0] } else { -1e3 })
    };
    // The straighter it hangs the less it is bent: the angle at the clamp grows with that at the tip.
    let (mut low, mut high) = (0.0, std::f64::consts::FRAC_PI_2);
    let (mut a, mut b) = (near.clamp(1e-3, high - 1e-3), 0.0);
    let mut found = shot(a);
    let (mut fa, mut fb) = (clamp(&found), f64::NAN);
    for _ in 0..SHOTS {
        if fa.abs() < CLAMPED || high - low < 1e-15 {
            break;
        }
        if fa < 0.0 {
            low = a
        } else {
            high = a
        }
        let next = if fb.is_nan() {
            a - fa
        } else {
            a - fa * (a - b) / (fa - fb)
        };
        let inside = next > low && next < high && fa > -1e2;
        (b, fb) = (a, fa);
        a = if inside { next } else { 0.5 * (low + high) };
        found = shot(a);
        fa = clamp(&found);
    }
    if fa.abs() > 1e-9 {
        return None;
    }
    found.reverse();
    let [_, x, y, _] = found[0];
    let curve = Curve {
        length,
        angle: found.iter().map(|s| s[0]).collect(),
        curvature: found.iter().map(|s| s[3]).collect(),
        place: found.iter().map(|s| [s[1] - x, s[2] - y]).collect(),
        change: Vec::new(),
    };
    Some((curve, a))
}

/// States `[theta, x, y, k]` from the tip, where the strip is straight, to the clamp: `k' = w s cos(theta) / M'(k)`, `s` from the tip.
fn integrate(law: &Voce, weight: f64, length: f64, tip: f64) -> Vec<[f64; 4]> {
    let h = length / STEPS as f64;
    let rate = |s: f64, v: [f64; 4]| {
        let stiffness = law.linear + law.asymptote / law.scale * (-v[3] / law.scale).fixed_exp();
        let (sin, cos) = v[0].fixed_sin_cos();
        [-v[3], -cos, -sin, weight * s * cos / stiffness]
    };
    let shifted = |v: [f64; 4], r: [f64; 4], by: f64| std::array::from_fn(|i| v[i] + by * r[i]);
    let mut states = Vec::with_capacity(STEPS + 1);
    states.push([tip, 0.0, 0.0, 0.0]);
    for i in 0..STEPS {
        let (s, v) = (i as f64 * h, states[i]);
        let a = rate(s, v);
        let b = rate(s + 0.5 * h, shifted(v, a, 0.5 * h));
        let c = rate(s + 0.5 * h, shifted(v, b, 0.5 * h));
        let d = rate(s + h, shifted(v, c, h));
        states.push(std::array::from_fn(|i| {
            v[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])
        }));
    }
    states
}

/// What is searched: the parameters that are free, as they are changed.
#[derive(Clone, Copy)]
struct Search {
    weight: f64,
    free: [bool; 3],
    /// Of the scale (1/m).
    bounds: [f64; 2],
}

impl Search {
    /// The law with free parameters changed by `step`; moments by parts of `unit` ([linear, asymptote]), the scale by its logarithm.
    fn moved(&self, law: &Voce, unit: [f64; 2], step: &[f64]) -> Voce {
        let mut steps = step.iter();
        let mut next = |free: bool| {
            if free {
                *steps.next().unwrap_or(&0.0)
            } else {
                0.0
            }
        };
        let [linear, asymptote, scale] = self.free.map(&mut next);
        Voce {
            linear: (law.linear + unit[0] * linear).max(0.0),
            asymptote: (law.asymptote + unit[1] * asymptote).max(0.0),
            scale: (law.scale * scale.clamp(-1.0, 1.0).fixed_exp())
                .clamp(self.bounds[0], self.bounds[1]),
        }
    }

    fn count(&self) -> usize {
        self.free.iter().filter(|f| **f).count()
    }
}

/// One state of the search.
struct State {
    law: Voce,
    length: f64,
    curve: Curve,
    tip: f64,
    feet: Vec<Foot>,
    /// Arc at the last point (m).
    reach: f64,
}

impl State {
    fn new(law: Voce, weight: f64, length: f64, tip: f64, profile: &Profile) -> Option<Self> {
        let (curve, tip) = hang(&law, weight, length, tip)?;
        let (feet, reach) = misfit(&curve, profile);
        Some(Self {
            law,
            length,
            curve,
            tip,
            feet,
            reach,
        })
    }

    fn squares(&self) -> f64 {
        squares(&self.feet)
    }

    /// Moment at the clamp over the curvature there, and that moment: what parameters are changed by parts of.
    fn unit(&self) -> [f64; 2] {
        let k = self.curve.curvature[0].max(f64::MIN_POSITIVE);
        let m = self.law.moment(k);
        [m / k, m]
    }

    /// Derivatives of the distances by the free parameters and, last, by the length, `[points][..]`.
    fn slopes(&self, search: &Search) -> Option<DMatrix<f64>> {
        let n = search.count();
        let mut columns = Vec::new();
        for j in 0..=n {
            let (law, length) = if j < n {
                let mut step = vec![0.0; n];
                step[j] = SMALL;
                (search.moved(&self.law, self.unit(), &step), self.length)
            } else {
                (self.law, self.length * (1.0 + SMALL))
            };
            let (other, _) = hang(&law, search.weight, length, self.tip)?;
            let change: Vec<[f64; 2]> = (self.curve.place.iter().zip(&other.place))
                .map(|(a, b)| [0, 1].map(|d| (b[d] - a[d]) / SMALL))
                .collect();
            let column: Vec<f64> = self.feet.iter().map(|f| f.normal_part(&change)).collect();
            columns.push(column);
        }
        Some(DMatrix::from_fn(self.feet.len(), n + 1, |i, j| {
            columns[j][i]
        }))
    }
}

/// Finds the law whose strip hangs through the points, from a first guess; `weight` per area (N/m2), `overhang`: the length, where it is
/// given; else it is the arc at the last point, from `length` (m) on.
///
/// # Errors
/// When no strip of such a law hangs so.
pub fn identify(
    profile: &Profile,
    weight: f64,
    start: &VoceFit,
    length: f64,
    overhang: Option<f64>,
) -> Result<Hanging, String> {
    let failed = || "no strip of Voce's law hangs through the points".to_owned();
    let scale = start.law.scale;
    let mut search = Search {
        weight,
        free: [
            true,
            start.law.asymptote > 0.0,
            start.saturation == Saturation::Determined,
        ],
        bounds: [1e-2 * scale, 1e2 * scale],
    };
    let length = overhang.unwrap_or(length);
    let secant = |p: &Profile| {
        let last = p.last();
        p.deflection[last].fixed_atan2(p.x[last])
    };
    // A start without `linear` cannot carry more than its asymptote.
    let mut law = start.law;
    law.linear = law.linear.max(1e-3 * law.initial_stiffness());
    let mut now = State::new(law, weight, length, secant(profile), profile).ok_or_else(failed)?;
    loop {
        now = settle(now, &search, profile, overhang).ok_or_else(failed)?;
        match finish(&now, &search, overhang) {
            Ok(found) => {
                if let Some(overhang) = overhang {
                    overhang_reaches(overhang, now.reach)?;
                }
                return Ok(found);
            }
            // The points do not determine the scale, or not even a saturation.
            Err(_) if search.free[2] => search.free[2] = false,
            Err(_) if search.free[1] => search.free[1] = false,
            Err(e) => return Err(e),
        }
    }
}

/// Levenberg-Marquardt in the free parameters; the length follows the last point.
fn settle(
    mut now: State,
    search: &Search,
    profile: &Profile,
    overhang: Option<f64>,
) -> Option<State> {
    let n = search.count();
    let mut damping = 1e-4;
    for _ in 0..ITERATIONS {
        let slopes = now.slopes(search)?;
        let left = now.squares();
        let distance = DVector::from_iterator(now.feet.len(), now.feet.iter().map(|f| f.distance));
        let mut matrix = slopes.columns(0, n).into_owned();
        let lengths: Vec<f64> = (0..n)
            .map(|j| matrix.column(j).norm().max(f64::MIN_POSITIVE))
            .collect();
        for (j, l) in lengths.iter().enumerate() {
            matrix.column_mut(j).unscale_mut(*l);
        }
        let (gram, right) = (matrix.tr_mul(&matrix), matrix.tr_mul(&distance));
        let mut moved = false;
        while damping < 1e8 {
            let damped = &gram + DMatrix::identity(n, n) * damping;
            let step = damped.cholesky()?.solve(&right);
            let step: Vec<f64> = (0..n).map(|j| step[j] / lengths[j]).collect();
            let law = search.moved(&now.law, now.unit(), &step);
            let tried = State::new(law, search.weight, now.length, now.tip, profile);
            if let Some(tried) = tried.filter(|t| t.squares() < left) {
                (now, moved) = (tried, true);
                damping = (damping * 0.1).max(1e-12);
                break;
            }
            damping *= 10.0;
        }
        let better = left - now.squares() > 1e-9 * left;
        let longer = overhang.unwrap_or(now.reach);
        let stretched = (longer / now.length - 1.0).abs();
        if stretched > 1e-10 {
            now = State::new(now.law, search.weight, longer, now.tip, profile)?;
            damping = damping.min(1e-4);
        } else if !moved || !better {
            break;
        }
        if !moved && stretched < 1e-7 {
            break;
        }
    }
    Some(now)
}

/// The strip found, with what is uncertain of it.
fn finish(now: &State, search: &Search, overhang: Option<f64>) -> Result<Hanging, String> {
    let failed = || "no strip of Voce's law hangs through the points".to_owned();
    let n = search.count();
    let slopes = now.slopes(search).ok_or_else(failed)?;
    let distances: Vec<f64> = now.feet.iter().map(|f| f.distance).collect();
    let matrix = slopes.columns(0, n).into_owned();
    let solution = least_squares(&matrix, &distances)?;
    let points = distances.len();
    let freedom = (points - n).max(1) as f64;
    let variance = now.squares() / freedom;
    let time = autocorrelation(&distances);
    let deviation = (variance * time).sqrt();
    let mut steps: Vec<Vec<f64>> = (solution.spread.iter())
        .map(|v| v.iter().map(|c| c * deviation).collect())
        .collect();
    if overhang.is_none() {
        // As the length moves with the last point, so do the others.
        let by_length: Vec<f64> = slopes.column(n).iter().copied().collect();
        let follows = least_squares(&matrix, &by_length)?.unknowns;
        let part = variance.sqrt() / now.length;
        steps.push(follows.iter().map(|f| -f * part).collect());
    }
    let unit = now.unit();
    let law = now.law;
    let spread = (steps.iter())
        .map(|step| {
            let mut given = step.iter();
            let mut next = |free: bool| {
                if free {
                    *given.next().unwrap_or(&0.0)
                } else {
                    0.0
                }
            };
            let [linear, asymptote, scale] = search.free.map(&mut next);
            [linear * unit[0], asymptote * unit[1], scale * law.scale]
        })
        .collect();
    let [low, high] = search.bounds;
    Ok(Hanging {
        length: now.length,
        curvature: now.curve.curvature.clone(),
        rms: (now.squares() / points as f64).sqrt(),
        spread,
        freedom: (freedom / time).max(1.0) as usize,
        free: [
            law.linear > 0.0,
            search.free[1] && law.asymptote > 0.0,
            search.free[2] && law.scale > low && law.scale < high,
        ],
        law,
    })
}
