//! Axes: ranges, round ticks and their texts.

use crate::plain::LARGEST;
use crate::units::{fixed, trim};

/// Round numbers between `low` and `high`, about `count` of them.
pub(crate) fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let Some(step) = step(low, high, count) else {
        return vec![low];
    };
    let (first, last) = (
        (low / step - 1e-6).ceil() as i64,
        (high / step + 1e-6).floor() as i64,
    );
    (first..=last).map(|i| i as f64 * step).collect()
}

/// 1, 2, 2.5 or 5 times a power of ten; `None` when the range is empty.
fn step(low: f64, high: f64, count: usize) -> Option<f64> {
    if high <= low || !(high - low).is_finite() {
        return None;
    }
    let raw = (high - low) / count.max(1) as f64;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0]
        .into_iter()
        .find(|s| s * power >= raw * 0.999);
    Some(step.unwrap_or(10.0) * power)
}

/// When an axis begins at zero though no value does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Zero {
    /// Always.
    Always,
    /// When zero is nearer than this part of the largest value.
    Near(f64),
}

/// Smallest and largest of the values, never the same; 0 and 1 when there is none. Infinite values and those that are
/// no number do not count.
pub(crate) fn extent(values: impl Iterator<Item = f64>, zero: Zero) -> [f64; 2] {
    let usual = |v: &f64| v.abs() < LARGEST;
    let [low, high] = values
        .filter(usual)
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| {
            [a.min(v), b.max(v)]
        });
    if low > high {
        return [0.0, 1.0];
    }
    let near = match zero {
        Zero::Always => 1.0,
        Zero::Near(part) => part,
    };
    let low = if low > 0.0 && low <= near * high {
        0.0
    } else {
        low
    };
    let high = if high < 0.0 && high >= near * low {
        0.0
    } else {
        high
    };
    if high > low {
        return [low, high];
    }
    let around = if low == 0.0 { 1.0 } else { 0.05 * low.abs() };
    [low - if low == 0.0 { 0.0 } else { around }, low + around]
}

/// A range of values along a stretch of the page.
#[derive(Debug, Clone)]
pub(crate) struct Axis {
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Where `low` and `high` lie on the page (px).
    page: [f64; 2],
    pub(crate) ticks: Vec<f64>,
    /// The texts of the ticks are in 10^exponent.
    exponent: i32,
    /// Decimal places of the texts.
    places: usize,
}

/// Both axes of a plot.
pub(super) struct Frame {
    pub(super) x: Axis,
    pub(super) y: Axis,
    /// Edges of the field (px).
    pub(super) left: f64,
    pub(super) right: f64,
    pub(super) bottom: f64,
}

impl Axis {
    /// From `low` to `high` (more than `low`) with about `count` ticks.
    pub(crate) fn new([low, high]: [f64; 2], count: usize, page: [f64; 2]) -> Self {
        let ticks = ticks(low, high, count);
        let largest = ticks.iter().fold(0.0f64, |a, t| a.max(t.abs()));
        let size = if largest > 0.0 {
            largest.log10().floor() as i32
        } else {
            0
        };
        // Four digits before the point and three behind it are read at a glance.
        let exponent = if (-2..=4).contains(&size) {
            0
        } else {
            3 * size.div_euclid(3)
        };
        let step = step(low, high, count).unwrap_or(1.0) / 10f64.powi(exponent);
        let places = (0..12)
            .find(|p| {
                let scaled = step * 10f64.powi(*p);
                (scaled - scaled.round()).abs() < 1e-6 * scaled
            })
            .unwrap_or(12);
        Self {
            low,
            high,
            page,
            ticks,
            exponent,
            places: places as usize,
        }
    }

    /// Where a value lies on the page (px).
    pub(crate) fn at(&self, value: f64) -> f64 {
        let [a, b] = self.page;
        a + (value - self.low) / (self.high - self.low) * (b - a)
    }

    /// Text of a tick, in the power of ten of the axis.
    pub(crate) fn text(&self, tick: f64) -> String {
        let value = tick / 10f64.powi(self.exponent);
        trim(fixed(value, self.places))
    }

    /// Length of the longest text (characters).
    pub(crate) fn widest(&self) -> usize {
        let all = self.ticks.iter().map(|t| self.text(*t).chars().count());
        all.max().unwrap_or(1)
    }

    /// The power of ten that the texts leave out: `×10³`.
    pub(crate) fn power(&self) -> Option<String> {
        let digit = |c: char| match c {
            '-' => '⁻',
            c => {
                let n = c.to_digit(10).unwrap_or(0) as usize;
                ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][n]
            }
        };
        let raised: String = self.exponent.to_string().chars().map(digit).collect();
        (self.exponent != 0).then(|| format!("×10{raised}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_lie_inside() {
        let close = |a: Vec<f64>, b: &[f64]| {
            assert_eq!(a.len(), b.len(), "{a:?}");
            assert!(a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-9), "{a:?}");
        };
        close(ticks(0.0, 1.0, 5), &[0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
        close(ticks(-35.0, 35.0, 6), &[-20.0, 0.0, 20.0]);
        close(ticks(3.0, 3.0, 5), &[3.0]);
    }

    fn texts(low: f64, high: f64) -> (Vec<String>, Option<String>) {
        let axis = Axis::new([low, high], 5, [0.0, 100.0]);
        let all = axis.ticks.iter().map(|t| axis.text(*t)).collect();
        (all, axis.power())
    }

    #[test]
    fn texts_of_ticks_differ_and_are_short_at_any_size() {
        assert_eq!(
            texts(0.0, 1.0).0,
            ["0", "0.2", "0.4", "0.6", "0.8", "1"].map(String::from)
        );
        assert_eq!(
            texts(-0.5, 0.5).0,
            ["-0.4", "-0.2", "0", "0.2", "0.4"].map(String::from)
        );
        let (all, power) = texts(0.0, 2.4e-7);
        assert_eq!(power.as_deref(), Some("×10⁻⁹"));
        assert_eq!(all, ["0", "50", "100", "150", "200"].map(String::from));
        let (all, power) = texts(0.0, 3.1e9);
        assert_eq!(power.as_deref(), Some("×10⁹"));
        assert_eq!(all, ["0", "1", "2", "3"].map(String::from));
        // A narrow range far from zero: the digits that differ are shown.
        let (all, _) = texts(1000.02, 1000.06);
        assert!(all.windows(2).all(|w| w[0] != w[1]), "{all:?}");
    }

    #[test]
    fn an_extent_is_never_empty_and_takes_in_a_near_zero() {
        let of = |v: &[f64], z| extent(v.iter().copied(), z);
        assert_eq!(of(&[], Zero::Always), [0.0, 1.0]);
        assert_eq!(
            of(&[f64::NAN, f64::INFINITY, 1e300], Zero::Always),
            [0.0, 1.0]
        );
        assert_eq!(of(&[2.0, 2.0], Zero::Near(0.1)), [1.9, 2.1]);
        assert_eq!(of(&[0.0, 0.0], Zero::Near(0.1)), [0.0, 1.0]);
        assert_eq!(of(&[1.0, 10.0], Zero::Near(0.2)), [0.0, 10.0]);
        assert_eq!(of(&[9.0, 10.0], Zero::Near(0.2)), [9.0, 10.0]);
        assert_eq!(of(&[-10.0, -1.0], Zero::Near(0.2)), [-10.0, 0.0]);
        assert_eq!(of(&[9.0, 10.0], Zero::Always), [0.0, 10.0]);
    }
}
