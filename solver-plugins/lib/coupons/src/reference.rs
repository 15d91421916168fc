//! Curves to compare with.

use plyflow_characterisation::csv::{self, Column};
use plyflow_mechanics::history::linear;
use plyflow_model::units::Dimension;
use plyflow_sdk::StepError;

/// A curve y(x), x increasing, SI.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Abscissae.
    pub x: Vec<f64>,
    /// Values.
    pub y: Vec<f64>,
}

impl Curve {
    /// Reads two columns of a CSV file; x must increase.
    ///
    /// # Errors
    /// With file and line when a column is missing, has another dimension, is not finite or does not
    /// increase.
    pub fn read(
        path: &str,
        x: (&'static str, Dimension),
        y: (&'static str, Dimension),
    ) -> Result<Self, StepError> {
        let wanted = [Column::required(x.0, x.1), Column::required(y.0, y.1)];
        let table = csv::read(path, &wanted)?;
        table.at_least(2, "a reference curve")?;
        let curve = Self {
            x: table.values(x.0)?.to_vec(),
            y: table.values(y.0)?.to_vec(),
        };
        if let Some(i) = curve.x.windows(2).position(|w| w[1] <= w[0]) {
            let (given, before) = (curve.x[i + 1], curve.x[i]);
            return Err(format!(
                "{}: {} = {given} after {before}; expected increasing values",
                table.place(i + 1),
                x.0
            )
            .into());
        }
        Ok(curve)
    }

    /// As [`Curve::read`], of a file that may be given.
    ///
    /// # Errors
    /// As [`Curve::read`].
    pub fn given(
        path: Option<&String>,
        x: (&'static str, Dimension),
        y: (&'static str, Dimension),
    ) -> Result<Option<Self>, StepError> {
        path.map(|path| Self::read(path, x, y)).transpose()
    }

    /// Value at x, linear between the points; the ends hold beyond them.
    pub fn at(&self, x: f64) -> f64 {
        linear(&self.x, &self.y, x)
    }

    /// Root mean square of `y - self(x)` over the root mean square of `self(x)`, over points inside the
    /// curve's range, weighted by the width of x around each point (so that uneven sampling does not
    /// matter). `x` increases. `None` when fewer than two points lie inside.
    pub fn relative_rms(&self, x: &[f64], y: &[f64]) -> Option<f64> {
        let (error, size, _) = self.squares(x, y)?;
        (size > 0.0).then(|| (error / size).sqrt())
    }

    /// Root mean square of `y - self(x)`, as for [`Curve::relative_rms`] but in the unit of y.
    pub fn rms_difference(&self, x: &[f64], y: &[f64]) -> Option<f64> {
        let (error, _, width) = self.squares(x, y)?;
        (width > 0.0).then(|| (error / width).sqrt())
    }

    /// Integrals over x of `(y - self(x))^2` and `self(x)^2`, each twice, and twice the length of x.
    fn squares(&self, x: &[f64], y: &[f64]) -> Option<(f64, f64, f64)> {
        let (first, last) = (*self.x.first()?, *self.x.last()?);
        let inside: Vec<(f64, f64)> = x
            .iter()
            .zip(y)
            .map(|(x, y)| (*x, *y))
            .filter(|(x, _)| (first..=last).contains(x))
            .collect();
        if inside.len() < 2 {
            return None;
        }
        let (mut error, mut size, mut length) = (0.0, 0.0, 0.0);
        for w in inside.windows(2) {
            let width = (w[1].0 - w[0].0).max(0.0);
            for (x, y) in w {
                let r = self.at(*x);
                error += width * (y - r) * (y - r);
                size += width * r * r;
                length += width;
            }
        }
        Some((error, size, length))
    }
}

/// Points (x, y) in the order of x.
pub fn rising(points: impl Iterator<Item = (f64, f64)>) -> (Vec<f64>, Vec<f64>) {
    let mut points: Vec<(f64, f64)> = points.collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    points.into_iter().unzip()
}

/// Largest of values sampled evenly, also between samples: the top of the parabola through the largest sample and its neighbours; at an end the sample.
pub fn largest_between(samples: &[f64]) -> f64 {
    let highest = samples.iter().copied().fold(0.0, f64::max);
    let Some(i) = samples.iter().position(|v| *v == highest) else {
        return highest;
    };
    let (Some(before), Some(after)) = (i.checked_sub(1).map(|k| samples[k]), samples.get(i + 1))
    else {
        return highest;
    };
    let (slope, bend) = (0.5 * (after - before), before - 2.0 * highest + after);
    if bend < 0.0 {
        highest - 0.5 * slope * slope / bend
    } else {
        highest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_top_between_samples_is_that_of_the_curve() {
        // Samples of a sine that straddle its top.
        let wave: Vec<f64> = (0..20).map(|i| (0.2 * f64::from(i) + 0.07).sin()).collect();
        assert!((largest_between(&wave) - 1.0).abs() < 3e-4);
        let apart: Vec<f64> = (0..8).map(|i| (0.4 * f64::from(i) - 0.63).sin()).collect();
        let highest = apart.iter().copied().fold(0.0, f64::max);
        assert!(highest < 0.985, "{highest}");
        assert!((largest_between(&apart) - 1.0).abs() < 2e-3);
        assert_eq!(largest_between(&[0.0, 1.0, 2.0]), 2.0);
        assert_eq!(largest_between(&[1.0, 1.0, 1.0]), 1.0);
        assert_eq!(largest_between(&[]), 0.0);
    }
}
