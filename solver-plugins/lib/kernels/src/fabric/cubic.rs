//! Measured curves: a piecewise cubic through every point of a table, with a continuous tangent and
//! no overshoot, with its exact integral, evaluated in lanes.
//!
//! Slopes at the points are those of the parabola through a point and its neighbours (three-point
//! formula at the ends), limited to `0 .. 3 min(chords)` (Fritsch and Carlson 1980, the square of
//! de Boor and Swartz 1977), and 0 where the table turns: between two points the curve is monotone
//! if the points are. The last slope of a curve that flattens goes on as the chords do, by a constant
//! factor over a length: the curve goes on along it, and the parabola's falls to 0 before the last
//! point where the last interval is the longer one (points closer together where the curve bends).

use crate::Lanes;
use plyflow_fixed::FixedBits;

/// Most points of a table.
pub(super) const MAX_POINTS: usize = 64;
/// Least slope at the first point, over the first chord: a law without stiffness at rest has no
/// stable flat state.
const LEAST_START: f64 = 0.25;

/// `[start, c0, c1, c2, c3, integral up to start, 0, 0]` of each piece, one a cache line.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct Pieces([[f64; 8]; MAX_POINTS]);

/// Value, slope and integral from 0 at a place.
#[derive(Clone, Copy)]
pub(super) struct Cut<V> {
    pub value: V,
    pub slope: V,
    pub integral: V,
}

/// The curve over `0 ..= end`.
#[derive(Clone, Debug)]
pub(super) struct Cubic {
    pieces: Box<Pieces>,
    /// Half of the number of pieces, rounded up to a power of two: first stride of the search.
    stride: usize,
    /// Last place, and what the curve is there.
    pub end: f64,
    pub end_value: f64,
    pub end_slope: f64,
}

/// Slopes of the curve at its points.
fn slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    let h: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let chord: Vec<f64> = (0..n - 1).map(|i| (y[i + 1] - y[i]) / h[i]).collect();
    if n == 2 {
        return vec![chord[0]; 2];
    }
    let limited = |m: f64, chord: f64| {
        if m * chord <= 0.0 {
            0.0
        } else {
            m.abs().min(3.0 * chord.abs()).copysign(chord)
        }
    };
    let end = |h0: f64, h1: f64, d0: f64, d1: f64| {
        limited(((2.0 * h0 + h1) * d0 - h0 * d1) / (h0 + h1), d0)
    };
    let mut m = vec![0.0; n];
    m[0] = end(h[0], h[1], chord[0], chord[1]);
    if chord[0] > 0.0 {
        m[0] = m[0].max(LEAST_START * chord[0]);
    }
    let (d0, d1) = (chord[n - 2], chord[n - 3]);
    m[n - 1] = if d0 * d1 > 0.0 && d0.abs() < d1.abs() {
        // From the middle of the last interval to its end, of the way between the middles of the last two.
        d0 * (d0 / d1).fixed_powf(h[n - 2] / (h[n - 2] + h[n - 3]))
    } else {
        end(h[n - 2], h[n - 3], d0, d1)
    };
    for i in 1..n - 1 {
        let (a, b) = (chord[i - 1], chord[i]);
        if a * b > 0.0 {
            let parabola = (h[i] * a + h[i - 1] * b) / (h[i - 1] + h[i]);
            m[i] = limited(limited(parabola, a), b);
        }
    }
    m
}

impl Cubic {
    /// The curve through the points, 2 to [`MAX_POINTS`], finite, `x` increasing from 0.
    pub(super) fn new(x: &[f64], y: &[f64]) -> Self {
        let m = slopes(x, y);
        // Places after the last piece are never reached: the search compares with infinity.
        let mut pieces = Box::new(Pieces([[f64::INFINITY; 8]; MAX_POINTS]));
        let mut integral = 0.0;
        let last = x.len() - 1;
        for i in 0..last {
            let h = x[i + 1] - x[i];
            let chord = (y[i + 1] - y[i]) / h;
            let c2 = (3.0 * chord - 2.0 * m[i] - m[i + 1]) / h;
            let c3 = (m[i] + m[i + 1] - 2.0 * chord) / (h * h);
            pieces.0[i] = [x[i], y[i], m[i], c2, c3, integral, 0.0, 0.0];
            integral += h * (y[i] + h * (m[i] / 2.0 + h * (c2 / 3.0 + h * c3 / 4.0)));
        }
        Self {
            pieces,
            stride: last.next_power_of_two() / 2,
            end: x[last],
            end_value: y[last],
            end_slope: m[last],
        }
    }

    /// The largest slope of all.
    pub(super) fn steepest(&self) -> f64 {
        let starts = |i: usize| self.pieces.0.get(i).map_or(f64::INFINITY, |p| p[0]);
        let pieces = self.pieces.0.iter().enumerate();
        let pieces = pieces.take_while(|(_, p)| p[0].is_finite());
        let within = pieces.map(|(i, p)| {
            let [x, _, c1, c2, c3, ..] = *p;
            let h = starts(i + 1).min(self.end) - x;
            let at = |t: f64| c1 + t * (2.0 * c2 + 3.0 * c3 * t);
            // A slope is a parabola of the place.
            let top = -c2 / (3.0 * c3);
            let top = if top > 0.0 && top < h {
                at(top)
            } else {
                at(0.0)
            };
            at(0.0).max(at(h)).max(top)
        });
        within.fold(self.end_slope, f64::max)
    }

    /// Slope at 0.
    pub(super) fn start_slope(&self) -> f64 {
        self.pieces.0[0][2]
    }

    /// The curve at `x`, from 0 to the end.
    #[inline(always)]
    pub(super) fn at<V: Lanes>(&self, x: V) -> Cut<V> {
        let x = x.min(V::splat(self.end));
        let [start, c0, c1, c2, c3, before] = x.lookup(&self.pieces.0, self.stride);
        let x = x - start;
        let (half, third, quarter) = (V::splat(0.5), V::splat(1.0 / 3.0), V::splat(0.25));
        let (two, three) = (V::splat(2.0), V::splat(3.0));
        Cut {
            value: c0 + x * (c1 + x * (c2 + x * c3)),
            slope: c1 + x * (two * c2 + three * x * c3),
            integral: before + x * (c0 + x * (half * c1 + x * (third * c2 + x * (quarter * c3)))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Portable, WIDTH};

    fn at(c: &Cubic, x: f64) -> (f64, f64, f64) {
        let cut = c.at(Portable::splat(x));
        let get = |v: Portable| {
            let mut out = [0.0; WIDTH];
            v.store(&mut out, 0);
            out[5]
        };
        (get(cut.value), get(cut.slope), get(cut.integral))
    }

    /// Steps, plateaus, and uneven points: what makes an ordinary spline overshoot.
    fn rough(n: usize) -> (Vec<f64>, Vec<f64>) {
        let (mut seed, mut x, mut y) = (7u64, 0.0, 0.0);
        let mut next = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1);
            (seed >> 40) as f64 / (1u64 << 24) as f64
        };
        let (mut xs, mut ys) = (vec![0.0], vec![0.0]);
        for _ in 1..n {
            x += 0.01 + next();
            y += next().powi(8);
            xs.push(x);
            ys.push(y);
        }
        (xs, ys)
    }

    #[test]
    fn curve_passes_through_its_points_and_never_falls_between_rising_ones() {
        for n in [2, 3, 5, 17, 33, 64] {
            let (x, y) = rough(n);
            let c = Cubic::new(&x, &y);
            for i in 0..n {
                let v = at(&c, x[i]).0;
                assert!(
                    (v - y[i]).abs() < 1e-12,
                    "{n}: point {i}: {v}, not {}",
                    y[i]
                );
            }
            for i in 0..n - 1 {
                for j in 0..=50 {
                    let t = x[i] + (x[i + 1] - x[i]) * j as f64 / 50.0;
                    let (v, s, _) = at(&c, t);
                    assert!(s > -1e-12 && v > y[i] - 1e-12 && v < y[i + 1] + 1e-12);
                }
            }
        }
    }

    #[test]
    fn slope_and_integral_belong_to_the_value_and_are_continuous() {
        let (x, y) = rough(20);
        let c = Cubic::new(&x, &y);
        let h = 1e-6;
        for i in 1..2000 {
            let t = c.end * i as f64 / 2000.0;
            let (v, s, _) = at(&c, t);
            let (a, b) = (at(&c, t - h), at(&c, t + h));
            assert!(((b.0 - a.0) / (2.0 * h) - s).abs() < 1e-3 * (1.0 + s.abs()));
            assert!(((b.2 - a.2) / (2.0 * h) - v).abs() < 1e-7 * (1.0 + v));
            // No jump of the slope: its change is of the order of the step.
            assert!((b.1 - a.1).abs() < 1e-2, "slope jumps at {t}");
        }
        let end = at(&c, c.end);
        assert!((end.0 - c.end_value).abs() < 1e-12 && (end.1 - c.end_slope).abs() < 1e-10);
    }

    #[test]
    fn no_slope_is_larger_than_the_steepest_which_is_met() {
        for n in [2, 3, 5, 20, 64] {
            let (x, y) = rough(n);
            let c = Cubic::new(&x, &y);
            let places = (0..=100_000).map(|i| c.end * f64::from(i) / 100_000.0);
            let largest = places.map(|t| at(&c, t).1).fold(0.0, f64::max);
            let steepest = c.steepest();
            assert!(
                largest <= steepest * (1.0 + 1e-12),
                "{n}: {largest} {steepest}"
            );
            assert!(
                largest > steepest * (1.0 - 1e-3),
                "{n}: {largest} {steepest}"
            );
        }
    }

    #[test]
    fn smooth_curves_are_met_with_third_order() {
        let error = |n: usize| {
            let x: Vec<f64> = (0..n).map(|i| i as f64 / (n - 1) as f64).collect();
            let y: Vec<f64> = x.iter().map(|x| (2.0 * x).exp() - 1.0).collect();
            let c = Cubic::new(&x, &y);
            (0..=1000)
                .map(|i| i as f64 / 1000.0)
                .map(|t| (at(&c, t).0 - ((2.0 * t).exp() - 1.0)).abs())
                .fold(0.0, f64::max)
        };
        let order = (error(9) / error(33)).ln() / 4f64.ln();
        assert!(order > 2.8, "order {order}, error {}", error(33));
    }

    #[test]
    fn places_outside_give_finite_values() {
        let (x, y) = rough(9);
        let c = Cubic::new(&x, &y);
        for t in [-1.0, c.end * 2.0, f64::INFINITY] {
            assert!(at(&c, t).0.is_finite());
        }
    }
}
