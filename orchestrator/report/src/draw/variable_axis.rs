//! Where the values of a variable lie along an axis: numbers by their size, or by their logarithm, texts side by side.

use crate::draw::plot::axis::ticks;
use crate::family::{Levels, Variable};
use crate::units::number;

/// Numbers whose largest is so many times the smallest, and of which most are small, are shown by their logarithm.
const WIDE: f64 = 20.0;
/// Empty part of the axis beyond its outer values.
const AIR: f64 = 0.04;
/// Characters of a text along an axis.
const LONGEST: usize = 14;

/// An axis for a variable.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct VariableAxis {
    /// Name and unit.
    pub(crate) title: String,
    /// For each level its place, 0 to 1.
    pub(crate) at: Vec<f64>,
    /// Place and text of the ticks.
    pub(crate) ticks: Vec<(f64, String)>,
    /// Whether the values have an order, so that lines between them mean something.
    pub(crate) ordered: bool,
}

impl VariableAxis {
    pub(crate) fn new(variable: &Variable, levels: &Levels) -> Self {
        match levels.numbers() {
            Some(values) => Self::of_numbers(variable.titled(), &values),
            None => Self::of_names(variable.titled(), levels),
        }
    }

    fn of_numbers(title: String, values: &[f64]) -> Self {
        let log = is_wide(values);
        let of = |v: f64| if log { v.log10() } else { v };
        let (first, last) = (values.first().copied(), values.last().copied());
        let (low, high) = (of(first.unwrap_or(0.0)), of(last.unwrap_or(1.0)));
        let (low, high) = if high > low {
            (low, high)
        } else {
            (low - 0.5, low + 0.5)
        };
        let place = |v: f64| AIR + (1.0 - 2.0 * AIR) * (v - low) / (high - low);
        let ticks: Vec<(f64, String)> = if log {
            (decades(low, high).into_iter())
                .map(|t| (place(t.log10()), number(t, 4)))
                .collect()
        } else if values.len() == 1 {
            vec![(place(values[0]), number(values[0], 6))]
        } else {
            (ticks(low, high, 6).into_iter())
                .map(|t| (place(t), number(t, 6)))
                .collect()
        };
        Self {
            title,
            at: values.iter().map(|v| place(of(*v))).collect(),
            ticks,
            ordered: true,
        }
    }

    fn of_names(title: String, levels: &Levels) -> Self {
        let n = levels.values.len() as f64;
        let at: Vec<f64> = (0..levels.values.len())
            .map(|i| (i as f64 + 0.5) / n)
            .collect();
        // Of many names those that have room.
        let apart = levels.values.len().div_ceil(8).max(1);
        let text = |i: usize| {
            let text = levels.values[i].text();
            match text.char_indices().nth(LONGEST) {
                Some((end, _)) => format!("{}…", &text[..end]),
                None => text,
            }
        };
        let ticks = (0..at.len()).step_by(apart).map(|i| (at[i], text(i)));
        Self {
            ticks: ticks.collect(),
            title,
            at,
            ordered: false,
        }
    }
}

/// Whether values (ordered) are spread by factors, not by steps.
fn is_wide(values: &[f64]) -> bool {
    let (Some(low), Some(high)) = (values.first(), values.last()) else {
        return false;
    };
    let middle = values[values.len() / 2];
    *low > 0.0 && high / low >= WIDE && middle - low < 0.25 * (high - low)
}

/// Round numbers between two powers of ten.
fn decades(low: f64, high: f64) -> Vec<f64> {
    let steps: &[f64] = match high - low {
        w if w > 6.0 => {
            return ticks(low, high, 6)
                .iter()
                .map(|t| 10f64.powi(t.round() as i32))
                .collect();
        }
        w if w > 2.5 => &[1.0],
        _ => &[1.0, 2.0, 5.0],
    };
    let powers = low.floor() as i32..=high.ceil() as i32;
    let all = powers.flat_map(|p| steps.iter().map(move |s| s * 10f64.powi(p)));
    all.filter(|t| (low - 1e-9..=high + 1e-9).contains(&t.log10()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scale(values: &[f64]) -> VariableAxis {
        VariableAxis::of_numbers("x".into(), values)
    }

    #[test]
    fn values_that_grow_by_factors_lie_evenly_and_those_of_steps_too() {
        for values in [[1.0, 10.0, 100.0, 1000.0], [0.0, 1.0, 2.0, 3.0]] {
            let at = scale(&values).at;
            let steps: Vec<f64> = at.windows(2).map(|w| w[1] - w[0]).collect();
            assert!(steps.iter().all(|s| (s - steps[0]).abs() < 1e-9), "{at:?}");
        }
        let ticks = scale(&[1.0, 10.0, 100.0, 1000.0]).ticks;
        let texts: Vec<&str> = ticks.iter().map(|t| t.1.as_str()).collect();
        assert_eq!(texts, ["1", "10", "100", "1000"]);
        assert_eq!(scale(&[7.0]).at, [0.5]);
    }

    #[test]
    fn ticks_lie_where_their_values_do() {
        let s = scale(&[0.0, 45.0, 90.0]);
        let tick = s.ticks.iter().find(|t| t.1 == "40").unwrap();
        assert!((tick.0 - (s.at[0] + (s.at[2] - s.at[0]) * 40.0 / 90.0)).abs() < 1e-12);
    }
}
