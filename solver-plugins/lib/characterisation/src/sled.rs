//! The friction sled: static peak and dynamic mean of the pulling force over the normal force.

use crate::confidence::{autocorrelation, student};
use crate::csv::Table;
use crate::voce::rms;

/// A test with fewer rows in the window is refused.
const FEWEST_ROWS: usize = 10;

/// What one pull tells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pull {
    /// Largest force before the window, over the normal force; `None` without rows there.
    pub static_coefficient: Option<f64>,
    /// Mean force over the window's displacement, over the normal force.
    pub dynamic_coefficient: f64,
    /// Standard deviation of the force over the window's displacement, over the normal force: stick-slip and
    /// noise.
    pub scatter: f64,
    /// Error of the dynamic coefficient from this pull alone, at a confidence of 95 %: from its scatter over the window, as far as places are independent of
    /// their neighbours.
    pub error: f64,
    /// How much the coefficient changes from the first to the last quarter of the window.
    pub drift: f64,
    /// Force over the normal force where the record begins, before the sled moves; `None` when it begins later.
    pub at_rest: Option<f64>,
}

/// Places of the window at which the force is compared with its mean.
const PLACES: usize = 400;
/// A record that begins within this (m) begins before the sled moves.
const AT_REST: f64 = 1e-3;

/// Rows in the window; the test covers it.
fn rows_inside(table: &Table, s: &[f64], [from, to]: [f64; 2]) -> Result<usize, String> {
    let (first, last) = (
        s.first().copied().unwrap_or(0.0),
        s.last().copied().unwrap_or(0.0),
    );
    if first > from || last < to {
        return Err(format!(
            "{}: the test covers {:.2} mm to {:.2} mm; the mean is taken from {:.2} mm to {:.2} mm",
            table.source,
            1e3 * first,
            1e3 * last,
            1e3 * from,
            1e3 * to
        ));
    }
    let inside = s.iter().filter(|v| (from..=to).contains(*v)).count();
    if inside < FEWEST_ROWS {
        return Err(format!(
            "{}: {inside} rows lie in the window; at least {FEWEST_ROWS} are needed",
            table.source
        ));
    }
    Ok(inside)
}

/// Integrals of the force and of its square over the displacement in the window.
fn integrals(s: &[f64], f: &[f64], [from, to]: [f64; 2]) -> [f64; 2] {
    let (mut sum, mut squares) = (0.0, 0.0);
    for i in 1..s.len() {
        let (a, b) = (s[i - 1].clamp(from, to), s[i].clamp(from, to));
        if a == b {
            continue;
        }
        let at = |v: f64| f[i - 1] + (f[i] - f[i - 1]) * (v - s[i - 1]) / (s[i] - s[i - 1]);
        let (fa, fb) = (at(a), at(b));
        sum += 0.5 * (fa + fb) * (b - a);
        squares += (fa * fa + fa * fb + fb * fb) / 3.0 * (b - a);
    }
    [sum, squares]
}

/// Evaluates the columns `displacement` and `force` of a table; `window`: from, to (m); `normal` force (N).
///
/// The mean is the integral of the force over the displacement (straight between the rows) over the window's
/// length, so it does not depend on how densely the machine recorded.
///
/// # Errors
/// A displacement that goes back, a test that does not cover the window, too few rows in it, a mean force that is not
/// positive.
pub fn evaluate(table: &Table, window: [f64; 2], normal: f64) -> Result<Pull, String> {
    let [from, to] = window;
    if from.is_nan() || to.is_nan() || from < 0.0 || to <= from {
        return Err(format!(
            "the window from {:.3} mm to {:.3} mm is empty",
            1e3 * from,
            1e3 * to
        ));
    }
    if normal.is_nan() || normal <= 0.0 {
        return Err(format!(
            "a normal force of {normal} N is none; it must be positive"
        ));
    }
    let (s, f) = (table.values("displacement")?, table.values("force")?);
    table.goes_forward("displacement", "one file holds one pull")?;
    let inside = rows_inside(table, s, window)?;
    let [sum, squares] = integrals(s, f, window);
    let mean = sum / (to - from);
    let variance = squares / (to - from) - mean * mean;
    if mean <= 0.0 {
        return Err(format!(
            "{}: the mean force from {:.2} mm to {:.2} mm is {mean:.4} N; a sled that is dragged is pulled with a positive \
             one: change the sign of the load cell, or take off its offset",
            table.source,
            1e3 * from,
            1e3 * to
        ));
    }
    let places: Vec<f64> = (0..PLACES)
        .map(|i| {
            let at = from + (to - from) * (i as f64 + 0.5) / PLACES as f64;
            let k = s.partition_point(|v| *v < at).clamp(1, s.len() - 1);
            let part = (at - s[k - 1]) / (s[k] - s[k - 1]).max(f64::MIN_POSITIVE);
            f[k - 1] + part * (f[k] - f[k - 1]) - mean
        })
        .collect();
    let independent = (PLACES.min(inside) as f64 / independent_step(&places, inside)).max(2.0);
    let quarter = |of: &[f64]| of.iter().sum::<f64>() / of.len() as f64;
    let drift = quarter(&places[3 * PLACES / 4..]) - quarter(&places[..PLACES / 4]);
    let before = s.iter().zip(f).filter(|(v, _)| **v < from);
    let peak = before.map(|(_, f)| *f).reduce(f64::max);
    Ok(Pull {
        static_coefficient: peak.map(|p| p / normal),
        dynamic_coefficient: mean / normal,
        scatter: variance.max(0.0).sqrt() / normal,
        error: student(independent as usize - 1) * rms(&places) / independent.sqrt() / normal,
        drift: drift / normal,
        at_rest: (s[0] <= AT_REST).then(|| f[0] / normal),
    })
}

/// How many places, or rows where these are fewer, tell as much as one that is independent of all others.
fn independent_step(places: &[f64], rows: usize) -> f64 {
    let along_places = autocorrelation(places);
    // Between rows the force is straight: places within one say the same.
    (along_places * rows.min(PLACES) as f64 / PLACES as f64).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::csv::{Column, parse};
    use plyflow_model::units::Dimension;

    fn table(rows: impl Iterator<Item = (f64, f64)>) -> Table {
        let wanted = [
            Column::required("displacement", Dimension::Length),
            Column::required("force", Dimension::Force),
        ];
        let rows: Vec<String> = rows.map(|(s, f)| format!("{s},{f}\n")).collect();
        parse(
            &format!("displacement [mm],force [N]\n{}", rows.concat()),
            "t.csv",
            &wanted,
        )
        .unwrap()
    }

    #[test]
    fn mean_peak_and_scatter_of_a_known_pull() {
        // 3 N at 20 mm, then 2 N + 0.5 N sin with whole periods in the window, recorded unevenly.
        let force = |s: f64| match s {
            s if s < 20.0 => 3.0 * s / 20.0,
            s => 2.0 + 0.5 * (std::f64::consts::TAU * s / 10.0).sin(),
        };
        let places = (0..=4000).map(|i| 250.0 * (i as f64 / 4000.0).powf(1.3));
        let pull = evaluate(&table(places.map(|s| (s, force(s)))), [0.1, 0.2], 5.0).unwrap();
        assert!((pull.dynamic_coefficient - 0.4).abs() < 1e-5, "{pull:?}");
        assert!(
            (pull.static_coefficient.unwrap() - 0.6).abs() < 0.01,
            "{pull:?}"
        );
        assert!(
            (pull.scatter - 0.5 / 2f64.sqrt() / 5.0).abs() < 1e-4,
            "{pull:?}"
        );
    }

    #[test]
    fn a_drift_and_a_force_before_the_sled_moves_are_told() {
        let rising = |tare: f64| {
            let line = (0..=250).map(|i| (f64::from(i), f64::from(i)));
            table(line.map(move |(s, f)| (s, 1.0 + tare + 0.01 * f)))
        };
        let pull = evaluate(&rising(0.5), [0.1, 0.2], 1.0).unwrap();
        assert!((pull.drift - 0.75).abs() < 1e-3, "{pull:?}");
        assert!((pull.at_rest.unwrap() - 1.5).abs() < 1e-12, "{pull:?}");
        // A trend is one number, not a hundred: the mean is not told by them.
        assert!(pull.error > 0.2, "{pull:?}");
    }

    #[test]
    fn the_mean_does_not_depend_on_how_densely_parts_are_recorded() {
        let force = |s: f64| 1.0 + s / 100.0;
        let even = table(
            (0..=200)
                .map(|i| f64::from(i) * 1.25)
                .map(|s| (s, force(s))),
        );
        let crowded = table(
            (0..=1000)
                .map(|i| {
                    if i < 900 {
                        0.13 * f64::from(i)
                    } else {
                        117.0 + 1.33 * f64::from(i - 900)
                    }
                })
                .map(|s| (s, force(s))),
        );
        let mean = |t: &Table| evaluate(t, [0.1, 0.2], 1.0).unwrap().dynamic_coefficient;
        assert!((mean(&even) - 2.5).abs() < 1e-12 && (mean(&crowded) - 2.5).abs() < 1e-12);
    }

    #[test]
    fn without_rows_before_the_window_there_is_no_static_coefficient() {
        let line = table((0..=250).map(|i| (f64::from(i), 2.0)));
        let coefficient = |from| {
            evaluate(&line, [from, 0.2], 5.0)
                .unwrap()
                .static_coefficient
        };
        assert_eq!(coefficient(0.0), None);
        assert_eq!(coefficient(0.1), Some(0.4));
    }

    #[test]
    fn what_is_no_pull_through_the_window_is_refused() {
        let line = |to: u32| table((0..=to).map(|i| (f64::from(i), 2.0)));
        let error = |t: &Table, window| evaluate(t, window, 5.0).unwrap_err();
        assert!(error(&line(150), [0.1, 0.2]).contains("covers 0.00 mm to 150.00 mm"));
        assert!(error(&line(250), [0.2, 0.1]).contains("is empty"));
        let back = table((0..=250).map(|i| (f64::from(if i == 120 { 80 } else { i }), 2.0)));
        assert!(error(&back, [0.1, 0.2]).starts_with("t.csv:122: the displacement goes back"));
        assert!(evaluate(&line(250), [0.1, 0.2], 0.0).is_err());
        let push = table((0..=250).map(|i| (f64::from(i), -2.0)));
        let e = error(&push, [0.1, 0.2]);
        assert!(
            e.contains("is -2.0000 N") && e.contains("sign of the load cell"),
            "{e}"
        );
        let thin = table((0..=5).map(|i| (f64::from(i) * 50.0, 2.0)));
        assert!(error(&thin, [0.1, 0.2]).contains("3 rows"));
    }
}
