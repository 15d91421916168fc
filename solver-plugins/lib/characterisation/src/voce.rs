//! Voce's law of a moment over a curvature (thesis eq. 3.4) and its fit to measured points.

use crate::linear::condition;
use nalgebra::DMatrix;
use plyflow_fixed::FixedBits;

/// `M(k) = linear k + asymptote (1 - exp(-k / scale))` for `k >= 0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Voce {
    /// Slope at large curvature (N m2/m = N m).
    pub linear: f64,
    /// Saturated part of the moment per width (N).
    pub asymptote: f64,
    /// Curvature at which that part has reached 63 % (1/m).
    pub scale: f64,
}

impl Voce {
    /// Moment per width (N) at a curvature (1/m).
    pub fn moment(&self, k: f64) -> f64 {
        self.linear * k - self.asymptote * (-k / self.scale).fixed_exp_m1()
    }

    /// How its moment (N) at a curvature (1/m) follows changes of `linear`, `asymptote` and `scale`, linearly.
    pub fn moment_change(&self, k: f64, change: [f64; 3]) -> f64 {
        let part = -(-k / self.scale).fixed_exp_m1();
        let by_scale = -self.asymptote * k / self.scale.powi(2) * (-k / self.scale).fixed_exp();
        change[0] * k + change[1] * part + change[2] * by_scale
    }

    /// Its slope at no curvature: the initial bending stiffness (N m).
    pub fn initial_stiffness(&self) -> f64 {
        self.linear + self.asymptote / self.scale
    }
}

/// A fitted law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoceFit {
    /// The law.
    pub law: Voce,
    /// Root mean square of measured less fitted moment (N).
    pub rms: f64,
    /// The same over the root mean square of the measured moments.
    pub relative_rms: f64,
    /// Condition of the three parameters: how much larger their relative errors may be than those of the
    /// moments, in the worst direction. Parameters at a bound are left out.
    pub condition: f64,
    /// What the curvatures tell of the saturation.
    pub saturation: Saturation,
}

/// What the curvatures tell of the saturation of the moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Saturation {
    /// Its parameters.
    Determined,
    /// They end before it: the law is linear over them, or `scale` lies at the upper end of what was searched.
    NotReached,
    /// It is over before the least of them that counts: `scale` lies at the lower end of what was searched.
    AlreadyThere,
}

/// `scale` is searched from the largest curvature over this ..
const SMALLEST_SCALE: f64 = 500.0;
/// .. to the largest curvature times this.
const LARGEST_SCALE: f64 = 10.0;
/// Points of the first search, evenly over the logarithm.
const SEARCH: usize = 80;

/// Fits the law to moments (N) over curvatures (1/m, `>= 0`) by least squares of the moment. The two linear
/// parameters are solved for exactly for each `scale` (never negative), `scale` is searched; so there is no
/// starting value and no local minimum between the points of the search.
///
/// # Errors
/// With fewer than four points, or without positive curvatures and moments.
pub fn fit_voce(curvature: &[f64], moment: &[f64]) -> Result<VoceFit, String> {
    let largest = curvature.iter().fold(0.0f64, |m, k| m.max(*k));
    let size = rms(moment);
    if curvature.len() < 4 || largest <= 0.0 || size <= 0.0 {
        return Err(
            "a moment-curvature law needs at least four points with positive curvature and moment"
                .into(),
        );
    }
    let (low, high) = (
        (largest / SMALLEST_SCALE).fixed_ln(),
        (largest * LARGEST_SCALE).fixed_ln(),
    );
    let at = |i: f64| low + (high - low) * i / SEARCH as f64;
    let misfit = |log_scale: f64| best_linear(curvature, moment, log_scale.fixed_exp()).1;
    let (mut best, mut least) = (0, f64::INFINITY);
    for i in 0..=SEARCH {
        let now = misfit(at(i as f64));
        if now < least {
            (best, least) = (i, now);
        }
    }
    let log_scale = golden(
        at((best as f64 - 1.0).max(0.0)),
        at((best as f64 + 1.0).min(SEARCH as f64)),
        &misfit,
    );
    let (law, squares) = best_linear(curvature, moment, log_scale.fixed_exp());
    // Without an asymptote every scale fits alike, and the search ends at its first.
    let saturation = if law.asymptote <= 0.0 || best == SEARCH {
        Saturation::NotReached
    } else if best == 0 {
        Saturation::AlreadyThere
    } else {
        Saturation::Determined
    };
    let residual = (squares / moment.len() as f64).sqrt();
    Ok(VoceFit {
        law,
        rms: residual,
        relative_rms: residual / size,
        condition: parameter_condition(&law, curvature),
        saturation,
    })
}

/// Law and sum of squared residuals for a given scale, with both factors non-negative.
fn best_linear(curvature: &[f64], moment: &[f64], scale: f64) -> (Voce, f64) {
    let (mut aa, mut ab, mut bb, mut am, mut bm) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let part: Vec<f64> = curvature
        .iter()
        .map(|k| -(-k / scale).fixed_exp_m1())
        .collect();
    for ((&k, &m), &e) in curvature.iter().zip(moment).zip(&part) {
        aa += k * k;
        ab += k * e;
        bb += e * e;
        am += k * m;
        bm += e * m;
    }
    let determinant = aa * bb - ab * ab;
    let mut candidates = vec![[(am / aa).max(0.0), 0.0], [0.0, (bm / bb).max(0.0)]];
    if determinant > 1e-14 * aa * bb {
        let both = [
            (am * bb - bm * ab) / determinant,
            (bm * aa - am * ab) / determinant,
        ];
        if both[0] >= 0.0 && both[1] >= 0.0 {
            candidates.push(both);
        }
    }
    let mut found = (
        Voce {
            linear: 0.0,
            asymptote: 0.0,
            scale,
        },
        f64::INFINITY,
    );
    for [linear, asymptote] in candidates {
        let misfit = |i: usize| moment[i] - linear * curvature[i] - asymptote * part[i];
        let squares = (0..moment.len()).map(|i| misfit(i).powi(2)).sum();
        if squares < found.1 {
            found = (
                Voce {
                    linear,
                    asymptote,
                    scale,
                },
                squares,
            );
        }
    }
    found
}

/// Least of a function that falls, then rises.
fn golden(mut a: f64, mut b: f64, f: &impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5f64.sqrt() - 1.0);
    let (mut c, mut d) = (b - ratio * (b - a), a + ratio * (b - a));
    let (mut fc, mut fd) = (f(c), f(d));
    for _ in 0..60 {
        if fc < fd {
            (b, d, fd) = (d, c, fc);
            c = b - ratio * (b - a);
            fc = f(c);
        } else {
            (a, c, fc) = (c, d, fd);
            d = a + ratio * (b - a);
            fd = f(d);
        }
    }
    0.5 * (a + b)
}

/// Condition of the matrix of `dM / d ln p` over the parameters p that are not at a bound.
fn parameter_condition(law: &Voce, curvature: &[f64]) -> f64 {
    let mut columns: Vec<Vec<f64>> = Vec::new();
    if law.linear > 0.0 {
        columns.push(curvature.iter().map(|k| law.linear * k).collect());
    }
    if law.asymptote > 0.0 {
        let part = |k: &f64| -law.asymptote * (-k / law.scale).fixed_exp_m1();
        columns.push(curvature.iter().map(part).collect());
        let part = |k: &f64| -law.asymptote * k / law.scale * (-k / law.scale).fixed_exp();
        columns.push(curvature.iter().map(part).collect());
    }
    if columns.is_empty() {
        return 1.0;
    }
    condition(&DMatrix::from_fn(curvature.len(), columns.len(), |i, j| {
        columns[j][i]
    }))
}

/// Root mean square (N) of moments over curvatures less those of a law, and the same over the root mean square of the moments.
pub fn relative_misfit<'a>(law: &Voce, points: impl Iterator<Item = &'a [f64; 2]>) -> [f64; 2] {
    let (rest, size): (Vec<f64>, Vec<f64>) = points.map(|[k, m]| (m - law.moment(*k), *m)).unzip();
    let rest = rms(&rest);
    [rest, rest / rms(&size)]
}

/// Root mean square.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const NCF: Voce = Voce {
        linear: 0.19457e-3,
        asymptote: 0.03139,
        scale: 4.0,
    };

    fn points(law: &Voce, largest: f64) -> (Vec<f64>, Vec<f64>) {
        let k: Vec<f64> = (0..=100).map(|i| largest * i as f64 / 100.0).collect();
        let m = k.iter().map(|k| law.moment(*k)).collect();
        (k, m)
    }

    #[test]
    fn exact_points_give_the_parameters_back_with_their_conditioning() {
        let (k, m) = points(&NCF, 50.0);
        let fit = fit_voce(&k, &m).unwrap();
        assert!((fit.law.linear / NCF.linear - 1.0).abs() < 1e-5, "{fit:?}");
        assert!(
            (fit.law.asymptote / NCF.asymptote - 1.0).abs() < 1e-6,
            "{fit:?}"
        );
        assert!((fit.law.scale / NCF.scale - 1.0).abs() < 1e-6, "{fit:?}");
        assert!(
            fit.relative_rms < 1e-7 && fit.saturation == Saturation::Determined,
            "{fit:?}"
        );
        // Over a small range the same law is much worse determined.
        let (k, m) = points(&NCF, 2.0);
        assert!(fit_voce(&k, &m).unwrap().condition > 10.0 * fit.condition);
    }

    #[test]
    fn the_change_of_a_moment_is_that_of_finite_differences() {
        let change = [2e-6, -3e-4, 0.05];
        let moved = |h: f64| Voce {
            linear: NCF.linear + h * change[0],
            asymptote: NCF.asymptote + h * change[1],
            scale: NCF.scale + h * change[2],
        };
        for k in [0.3, 4.0, 40.0] {
            let expected = (moved(1e-3).moment(k) - moved(-1e-3).moment(k)) / 2e-3;
            let got = NCF.moment_change(k, change);
            assert!((got / expected - 1.0).abs() < 1e-6, "{got} {expected}");
        }
    }

    #[test]
    fn a_straight_line_is_said_to_tell_no_saturation() {
        let (k, m) = points(
            &Voce {
                linear: 0.004,
                asymptote: 0.0,
                scale: 1.0,
            },
            20.0,
        );
        let fit = fit_voce(&k, &m).unwrap();
        assert_eq!(fit.saturation, Saturation::NotReached, "{fit:?}");
        assert!((fit.law.moment(10.0) / 0.04 - 1.0).abs() < 1e-6);
    }

    #[test]
    fn a_moment_that_has_saturated_before_the_first_curvature_is_told_from_one_that_does_not_saturate()
     {
        let law = Voce {
            linear: 0.0,
            asymptote: 0.03,
            scale: 0.001,
        };
        let (k, m) = points(&law, 20.0);
        let fit = fit_voce(&k, &m).unwrap();
        assert_eq!(fit.saturation, Saturation::AlreadyThere, "{fit:?}");
        assert!((fit.law.moment(10.0) / 0.03 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_falling_curve_gives_no_negative_parameter() {
        let k: Vec<f64> = (0..50).map(f64::from).collect();
        let m: Vec<f64> = k
            .iter()
            .map(|k| 0.03 * (1.0 - (-k / 4.0f64).exp()) - 1e-4 * k)
            .collect();
        let law = fit_voce(&k, &m).unwrap().law;
        assert!(law.linear >= 0.0 && law.asymptote > 0.0);
        assert!(fit_voce(&k[..3], &m[..3]).is_err());
        assert!(fit_voce(&k, &vec![0.0; 50]).is_err());
    }
}
