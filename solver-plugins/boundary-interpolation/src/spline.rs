//! Velocities of the C2 cubic spline through positions at frames.

/// Slopes at the knots of the cubic spline through `values` at `times` whose first slope is zero (the sheets
/// start at rest) and whose last but one knot is none (its third derivative does not jump there): so any
/// cubic that starts at rest is reproduced. Cubic Hermite pieces with these slopes are C2.
///
/// `times`: `[f]` ascending (s); `values`: `[f][columns]`, the result has the same shape, per second. With
/// two frames the spline is the parabola that starts at rest; with one, slopes are zero.
pub fn spline_slopes(times: &[f64], values: &[f64], columns: usize) -> Vec<f64> {
    let n = times.len();
    let mut slopes = vec![0.0; n * columns];
    if n < 2 {
        return slopes;
    }
    let h: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).collect();
    let chord =
        |i: usize, c: usize| (values[(i + 1) * columns + c] - values[i * columns + c]) / h[i];
    if n == 2 {
        for c in 0..columns {
            slopes[columns + c] = 2.0 * chord(0, c);
        }
        return slopes;
    }
    // Rows 1 .. n - 1 of the tridiagonal system; row 0 says that the first slope is zero.
    let span = h[n - 2] + h[n - 3];
    let mut upper = vec![0.0; n];
    let mut pivot = vec![1.0; n];
    for i in 1..n {
        let (lower, diagonal, above) = match i {
            _ if i == n - 1 => (span, h[n - 3], 0.0),
            _ => (h[i], 2.0 * (h[i - 1] + h[i]), h[i - 1]),
        };
        pivot[i] = diagonal - lower * upper[i - 1];
        upper[i] = above / pivot[i];
    }
    for c in 0..columns {
        for i in 1..n - 1 {
            let right = 3.0 * (h[i] * chord(i - 1, c) + h[i - 1] * chord(i, c));
            slopes[i * columns + c] = (right - h[i] * slopes[(i - 1) * columns + c]) / pivot[i];
        }
        let (a, b) = (h[n - 3], h[n - 2]);
        let right = (b * b * chord(n - 3, c) + (2.0 * span + b) * a * chord(n - 2, c)) / span;
        slopes[(n - 1) * columns + c] =
            (right - span * slopes[(n - 2) * columns + c]) / pivot[n - 1];
        for i in (1..n - 1).rev() {
            slopes[i * columns + c] -= upper[i] * slopes[(i + 1) * columns + c];
        }
    }
    slopes
}

/// The piecewise linear curve through (`times`, `values`) at `at`, constant beyond its ends.
pub fn linear(times: &[f64], values: &[f64], at: f64) -> f64 {
    let i = times.partition_point(|&t| t <= at);
    if i == 0 {
        return values[0];
    }
    if i == times.len() {
        return values[i - 1];
    }
    let s = (at - times[i - 1]) / (times[i] - times[i - 1]);
    values[i - 1] + s * (values[i] - values[i - 1])
}
