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
