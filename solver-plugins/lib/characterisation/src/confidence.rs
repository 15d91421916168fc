//! How far a told error reaches: quantiles at 95 %, of one number and of a curve.
//!
//! Every error that a characterisation tells is one within which the true value lies in 95 of 100 tests (GUM: an
//! expanded uncertainty with a level of confidence of 95 %), not a standard error.

/// Normal quantile of a two-sided level of 95 %, and that of a one-sided one.
const TWO_SIDED: f64 = 1.959_964;
const ONE_SIDED: f64 = 1.644_854;
/// 97.5 % quantiles of Student's distribution for 1 to 30 degrees of freedom.
const STUDENT: [f64; 30] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160,
    2.145, 2.131, 2.120, 2.110, 2.101, 2.093, 2.086, 2.080, 2.074, 2.069, 2.064, 2.060, 2.056,
    2.052, 2.048, 2.045, 2.042,
];

/// Times a standard error estimated with so many degrees of freedom (at least 1), the error at 95 %.
pub fn student(freedom: usize) -> f64 {
    let n = freedom.max(1);
    let tail = || {
        let z = TWO_SIDED;
        let n = n as f64;
        // Cornish-Fisher, to 1e-4 from 30 on.
        z + (z.powi(3) + z) / (4.0 * n)
    };
    STUDENT.get(n - 1).copied().unwrap_or_else(tail)
}

/// 95 % quantile of Fisher's F with `above` degrees of freedom, not a whole number, over `below`.
///
/// Paulson's approximation (Biometrics 1 (1942) 36), within 3 % from `below = 3` on; for 1 and 2 the tables', between them linear
/// over the inverse.
pub fn fisher(above: f64, below: usize) -> f64 {
    match below {
        0 | 1 => return 254.3 - 92.9 / above.max(1.0),
        2 => return 19.50 - 0.99 / above.max(1.0),
        _ => {}
    }
    let (u, v) = (2.0 / (9.0 * above), 2.0 / (9.0 * below as f64));
    let z = ONE_SIDED * ONE_SIDED;
    // ((1 - v) x - (1 - u))^2 = z (u + v x^2), x the cube root.
    let (a, b, c) = (
        (1.0 - v).powi(2) - z * v,
        (1.0 - v) * (1.0 - u),
        (1.0 - u).powi(2) - z * u,
    );
    let x = (b + (b * b - a * c).max(0.0).sqrt()) / a;
    x.powi(3)
}

/// Error at 95 % of a root mean square: of `sqrt(sum z_j^2)`, where each direction `j` of what is uncertain adds `z_j` times a
/// vector, and `directions` are these vectors, of one length, divided by the root of it; `freedom`: of the deviation that they
/// are told with.
///
/// The sum of squares is taken for a multiple of chi-squared with the same mean and variance (Satterthwaite 1946).
pub fn of_curve(directions: &[Vec<f64>], freedom: usize) -> f64 {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    // Sum of the eigenvalues of the covariance, and of their squares, by the Gram matrix.
    let (mut sum, mut squares) = (0.0, 0.0);
    for a in directions {
        sum += dot(a, a);
        squares += directions.iter().map(|b| dot(a, b).powi(2)).sum::<f64>();
    }
    if squares <= 0.0 {
        return 0.0;
    }
    (sum * fisher(sum * sum / squares, freedom)).sqrt()
}

/// Degrees of freedom that stand for many.
const MANY: usize = 100_000;

/// Independent changes of the mean over several specimens, each one standard error large, and the degrees of freedom that they are told with.
///
/// `own`: what each specimen tells by itself; `noise`: changes of the mean by the scatter within the specimens; `freedom`: of that; `sizes`: what the first numbers, which
/// decide, are large against. The spread of the specimens has the scatter within them in it already, so it takes its place, and is not added: where it is more than that
/// scatter makes by chance in 95 of 100 tests.
pub fn of_mean(
    own: &[Vec<f64>],
    noise: Vec<Vec<f64>>,
    freedom: usize,
    sizes: &[f64],
) -> (Vec<Vec<f64>>, usize) {
    if own.len() < 2 {
        return (noise, freedom);
    }
    let count = own.len() as f64;
    let mean: Vec<f64> = (0..own[0].len())
        .map(|i| own.iter().map(|o| o[i]).sum::<f64>() / count)
        .collect();
    let root = (count * (count - 1.0)).sqrt();
    let between: Vec<Vec<f64>> = (own.iter())
        .map(|o| o.iter().zip(&mean).map(|(a, m)| (a - m) / root).collect())
        .collect();
    let variance = |changes: &[Vec<f64>]| -> f64 {
        let at =
            |(i, size): (usize, &f64)| changes.iter().map(|c| (c[i] / size).powi(2)).sum::<f64>();
        sizes.iter().enumerate().map(at).sum()
    };
    let ratio = variance(&between) / variance(&noise).max(f64::MIN_POSITIVE);
    if ratio > fisher(count - 1.0, MANY) {
        return (between, own.len() - 1);
    }
    let by = ratio.max(1.0).sqrt();
    let larger = |c: Vec<f64>| c.into_iter().map(|v| v * by).collect();
    (noise.into_iter().map(larger).collect(), freedom)
}

/// Integrated autocorrelation of residuals in their order, at least 1: so many of them tell as much as one that is
/// independent of all others. Summed up to the first that is not positive (Geyer 1992).
pub fn autocorrelation(residuals: &[f64]) -> f64 {
    let n = residuals.len();
    let mean = residuals.iter().sum::<f64>() / n.max(1) as f64;
    let at = |lag: usize| -> f64 {
        (residuals.iter().zip(&residuals[lag..]))
            .map(|(a, b)| (a - mean) * (b - mean))
            .sum()
    };
    if n < 8 {
        return 1.0;
    }
    let variance = at(0);
    if variance <= 0.0 {
        return 1.0;
    }
    let mut time = 1.0;
    for lag in 1..n / 2 {
        let r = at(lag) / variance;
        if r <= 0.0 {
            break;
        }
        time += 2.0 * r;
    }
    time
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (n, t) in [(1, 12.706), (4, 2.776), (40, 2.021), (100, 1.984)] {
            assert!((student(n) / t - 1.0).abs() < 1e-3, "{n}: {}", student(n));
        }
        for (above, below, f) in [
            (1.0, 1, 161.4),
            (3.0, 1, 215.7),
            (2.0, 2, 19.0),
            (1.0, 3, 10.13),
            (3.0, 4, 6.59),
            (3.0, 10, 3.71),
            (2.0, 500, 3.01),
            (1.0, 500, 3.86),
        ] {
            let got = fisher(above, below);
            assert!((got / f - 1.0).abs() < 0.05, "{above} {below}: {got}");
        }
    }

    #[test]
    fn one_direction_is_one_number_and_many_alike_are_nearly_certain() {
        let one = of_curve(&[vec![3.0, 4.0]], 100_000);
        assert!((one / (5.0 * 1.96) - 1.0).abs() < 0.03, "{one}");
        let many: Vec<Vec<f64>> = (0..100)
            .map(|i| (0..100).map(|j| f64::from(u8::from(i == j))).collect())
            .collect();
        // Chi-squared with 100 degrees of freedom: 124.3.
        let got = of_curve(&many, 100_000);
        assert!((got / 124.3f64.sqrt() - 1.0).abs() < 0.01, "{got}");
        assert_eq!(of_curve(&[], 3), 0.0);
    }

    #[test]
    fn a_wave_is_few_independent_residuals() {
        let wave: Vec<f64> = (0..1000).map(|i| (0.02 * f64::from(i)).sin()).collect();
        assert!(autocorrelation(&wave) > 50.0);
        let apart: Vec<f64> = (0..1000)
            .map(|i| if i % 2 == 0 { 1.0 } else { -1.0 })
            .collect();
        assert_eq!(autocorrelation(&apart), 1.0);
    }
}
