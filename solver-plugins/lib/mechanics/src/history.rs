//! Smooth histories.

/// Rises from 0 at `t <= start` to 1 at `t >= start + duration` with zero velocity and acceleration at
/// both ends: 10 s^3 - 15 s^4 + 6 s^5.
pub fn smooth_step(t: f64, start: f64, duration: f64) -> f64 {
    if duration <= 0.0 {
        return if t >= start { 1.0 } else { 0.0 };
    }
    let s = ((t - start) / duration).clamp(0.0, 1.0);
    s * s * s * (10.0 + s * (-15.0 + 6.0 * s))
}

/// Way (m) at time t (s) of what goes `way` in `time`: its speed rises smoothly over `ramp` (s, at most half of the
/// time), is constant, and falls as smoothly. The speed rises by 3 s^2 - 2 s^3, so the acceleration has no jump.
pub fn constant_speed_way(t: f64, way: f64, time: f64, ramp: f64) -> f64 {
    let speed = way / (time - ramp);
    // Integral of the speed's rise over the ramp.
    let risen = |s: f64| s * s * s * (1.0 - 0.5 * s);
    let t = t.clamp(0.0, time);
    if t < ramp {
        speed * ramp * risen(t / ramp)
    } else if t <= time - ramp {
        speed * (t - 0.5 * ramp)
    } else {
        way - speed * ramp * risen((time - t) / ramp)
    }
}

/// Where `t` lies among increasing `times`: index k and local coordinate s in 0..1 of the piece [k, k+1];
/// outside, the nearest end. `times` has at least two entries.
pub fn locate(times: &[f64], t: f64) -> (usize, f64) {
    let k = times
        .partition_point(|x| *x <= t)
        .saturating_sub(1)
        .min(times.len() - 2);
    let s = ((t - times[k]) / (times[k + 1] - times[k])).clamp(0.0, 1.0);
    (k, s)
}

/// Weights of cubic Hermite interpolation on a piece of length `h` (s): of the two values and the two
/// slopes.
pub fn hermite(s: f64, h: f64) -> [f64; 4] {
    let (s2, s3) = (s * s, s * s * s);
    [
        2.0 * s3 - 3.0 * s2 + 1.0,
        -2.0 * s3 + 3.0 * s2,
        h * (s3 - 2.0 * s2 + s),
        h * (s3 - s2),
    ]
}

/// Rates (1/s times the value) of [`hermite`]'s weights: those of the interpolation's slope.
pub fn hermite_rate(s: f64, h: f64) -> [f64; 4] {
    let s2 = s * s;
    [
        6.0 * (s2 - s) / h,
        6.0 * (s - s2) / h,
        3.0 * s2 - 4.0 * s + 1.0,
        3.0 * s2 - 2.0 * s,
    ]
}

/// Slopes at the knots of the cubic spline through `values` at `times` whose first slope is zero (the sheets
/// start at rest) and whose last but one knot is none (its third derivative does not jump there): so any
/// cubic that starts at rest is reproduced. A motion that is known from a later time than 0 on is under way there: then the second
/// knot is none either, and any cubic is reproduced. Cubic Hermite pieces with these slopes are C2.
///
/// `times`: `[f]` ascending (s); `values`: `[f][columns]`, the result has the same shape, per second. With
/// two frames the spline is the parabola that starts at rest, or a line; under way with three a parabola; with one, slopes are zero.
pub fn spline_slopes(times: &[f64], values: &[f64], columns: usize) -> Vec<f64> {
    let n = times.len();
    let mut slopes = vec![0.0; n * columns];
    if n < 2 {
        return slopes;
    }
    let h: Vec<f64> = times.windows(2).map(|t| t[1] - t[0]).collect();
    let chord =
        |i: usize, c: usize| (values[(i + 1) * columns + c] - values[i * columns + c]) / h[i];
    let under_way = times[0] > 0.0;
    if n == 2 || (n == 3 && under_way) {
        for c in 0..columns {
            let few = few_slopes(&h, chord(0, c), chord(n - 2, c), under_way);
            (0..n).for_each(|i| slopes[i * columns + c] = few[i]);
        }
        return slopes;
    }
    // Rows of the tridiagonal system; row 0 says that the first slope is zero, or else what the last row does from the other end.
    let span = h[n - 2] + h[n - 3];
    let first_span = h[0] + h[1];
    let mut upper = vec![0.0; n];
    let mut pivot = vec![1.0; n];
    if under_way {
        pivot[0] = h[1];
        upper[0] = first_span / pivot[0];
    }
    for i in 1..n {
        let (lower, diagonal, above) = match i {
            _ if i == n - 1 => (span, h[n - 3], 0.0),
            _ => (h[i], 2.0 * (h[i - 1] + h[i]), h[i - 1]),
        };
        pivot[i] = diagonal - lower * upper[i - 1];
        upper[i] = above / pivot[i];
    }
    for c in 0..columns {
        if under_way {
            let (b, a) = (h[0], h[1]);
            let right =
                (b * b * chord(1, c) + (2.0 * first_span + b) * a * chord(0, c)) / first_span;
            slopes[c] = right / pivot[0];
        }
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
        if under_way {
            slopes[c] -= upper[0] * slopes[columns + c];
        }
    }
    slopes
}

/// Slopes of the one piece that goes through two or three knots, of the spacings `h`: from the first chord `a` and the last one `b`.
fn few_slopes(h: &[f64], a: f64, b: f64, under_way: bool) -> [f64; 3] {
    match h.len() {
        1 if under_way => [a, a, 0.0],
        1 => [0.0, 2.0 * a, 0.0],
        // The parabola through all three.
        _ => {
            let bend = (b - a) / (h[0] + h[1]);
            [a - bend * h[0], a + bend * h[0], b + bend * h[1]]
        }
    }
}

/// A monotone cubic through given values: cubic Hermite pieces that lie between the values at their ends, with a continuous slope that
/// is zero at the first and last of them, beyond which it is constant. The slopes are those of Fritsch and Butland (1984): zero where the
/// values turn, else a harmonic mean of the slopes of the chords on both sides, weighted by their lengths.
#[derive(Debug, Clone, PartialEq)]
pub struct MonotoneCubic {
    times: Vec<f64>,
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl MonotoneCubic {
    /// Through `values` at `times`, of which there are as many, two or more, ascending.
    pub fn new(times: Vec<f64>, values: Vec<f64>) -> Self {
        let n = times.len();
        let h = |k: usize| times[k + 1] - times[k];
        let chord = |k: usize| (values[k + 1] - values[k]) / h(k);
        let mut slopes = vec![0.0; n];
        for k in 1..n.saturating_sub(1) {
            let (a, b) = (chord(k - 1), chord(k));
            if a * b > 0.0 {
                let (u, v) = (h(k - 1) + 2.0 * h(k), 2.0 * h(k - 1) + h(k));
                slopes[k] = (u + v) / (u / a + v / b);
            }
        }
        Self {
            times,
            values,
            slopes,
        }
    }

    /// Its value at `t`.
    pub fn at(&self, t: f64) -> f64 {
        let (k, s) = locate(&self.times, t);
        let w = hermite(s, self.times[k + 1] - self.times[k]);
        w[0] * self.values[k]
            + w[1] * self.values[k + 1]
            + w[2] * self.slopes[k]
            + w[3] * self.slopes[k + 1]
    }
}

/// Linear interpolation of `values` at `times`.
pub fn linear(times: &[f64], values: &[f64], t: f64) -> f64 {
    if times.len() < 2 {
        return values.first().copied().unwrap_or(0.0);
    }
    let (k, s) = locate(times, t);
    values[k] + (values[k + 1] - values[k]) * s
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn smooth_step_has_no_velocity_or_acceleration_at_its_ends() {
        let f = |t| smooth_step(t, 1.0, 2.0);
        let h = 1e-4;
        for t in [1.0, 3.0] {
            assert!((f(t + h) - f(t - h)).abs() / (2.0 * h) < 1e-6);
            assert!((f(t + h) - 2.0 * f(t) + f(t - h)).abs() / (h * h) < 1e-2);
        }
        assert_eq!((f(0.0), f(2.0), f(4.0)), (0.0, 0.5, 1.0));
    }

    #[test]
    fn a_monotone_cubic_meets_its_values_and_has_neither_overshoot_nor_kink() {
        let (times, values) = (
            [0.0, 0.1, 0.15, 0.6, 0.8, 1.0],
            [0.0, 0.2, 3.0, 3.1, 1.0, 1.0],
        );
        let curve = MonotoneCubic::new(times.to_vec(), values.to_vec());
        for (t, v) in times.iter().zip(values) {
            assert!((curve.at(*t) - v).abs() < 1e-14);
        }
        assert_eq!((curve.at(-1.0), curve.at(2.0)), (0.0, 1.0));
        let d = 1e-7;
        let slope = |t: f64| (curve.at(t + d) - curve.at(t - d)) / (2.0 * d);
        let mut before = curve.at(0.0);
        for i in 1..=10_000 {
            let t = 1e-4 * f64::from(i);
            let (k, _) = locate(&times, t - 1e-12);
            let (low, high) = (values[k].min(values[k + 1]), values[k].max(values[k + 1]));
            let now = curve.at(t);
            assert!(now > low - 1e-12 && now < high + 1e-12, "{t}: {now}");
            assert!(
                (now - before) * (values[k + 1] - values[k]) >= -1e-12,
                "{t}"
            );
            // Steepest between 0.1 and 0.15, where the second derivative is 6 chords over the length at most.
            assert!(
                (slope(t) - slope(t - 1e-4)).abs() < 1e-4 * 6.0 * 56.0 / 0.05,
                "{t}"
            );
            before = now;
        }
        assert!(slope(1e-6).abs() < 1e-2 && slope(1.0 - 1e-6).abs() < 1e-2);
        // Two values: 3 s^2 - 2 s^3.
        let two = MonotoneCubic::new(vec![1.0, 3.0], vec![0.0, 4.0]);
        assert!((two.at(1.5) - 4.0 * (3.0 / 16.0 - 2.0 / 64.0)).abs() < 1e-14);
    }

    #[test]
    fn hermite_rate_is_the_slope_of_hermite() {
        let (h, d) = (0.3, 1e-6);
        for s in [0.0, 0.2, 0.7, 1.0] {
            let (a, b) = (hermite(s - d / h, h), hermite(s + d / h, h));
            for (rate, k) in hermite_rate(s, h).into_iter().zip(0..) {
                assert!((rate - (b[k] - a[k]) / (2.0 * d)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn constant_speed_way_starts_and_stops_smoothly_and_arrives() {
        for ramp in [0.02, 0.1] {
            let at = |t: f64| constant_speed_way(t, 0.04, 0.2, ramp);
            assert_eq!((at(0.0), at(0.2), at(1.0)), (0.0, 0.04, 0.04));
            let d = 1e-6;
            let speed = |t: f64| (at(t + d) - at(t - d)) / (2.0 * d);
            let most = 0.04 / (0.2 - ramp);
            for i in 1..1000 {
                let t = 0.2 * f64::from(i) / 1000.0;
                assert!(speed(t) >= 0.0 && speed(t) <= most * (1.0 + 1e-6));
                assert!((speed(t + 1e-4) - speed(t)).abs() <= 1.6 * most * 1e-4 / ramp);
            }
        }
    }

    #[test]
    fn hermite_reproduces_a_cubic_exactly() {
        let f = |t: f64| 1.0 - 2.0 * t + 0.5 * t * t + 3.0 * t * t * t;
        let d = |t: f64| -2.0 + t + 9.0 * t * t;
        let times = [0.0, 0.4, 1.0];
        for t in [0.0, 0.1, 0.39, 0.41, 0.77, 1.0] {
            let (k, s) = locate(&times, t);
            let w = hermite(s, times[k + 1] - times[k]);
            let v = w[0] * f(times[k])
                + w[1] * f(times[k + 1])
                + w[2] * d(times[k])
                + w[3] * d(times[k + 1]);
            assert!((v - f(t)).abs() < 1e-12);
        }
    }
}
