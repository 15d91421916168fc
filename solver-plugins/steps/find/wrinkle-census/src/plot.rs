//! Curves of the artifact and the plots that show them.

use plyflow_model::artifact::{Axis, CensusCurve, Plot, Series};
use plyflow_sdk::{Host, StepError};

/// The plots so far, and the curves by what they show.
#[derive(Default)]
pub struct Plots {
    /// As in the data model.
    pub plots: Vec<Plot>,
    /// Which arrays are the curve of a label in a plot.
    pub curves: Vec<CensusCurve>,
}

/// A curve: labels and units of the two arrays, and their values.
pub struct Curve<'a> {
    /// Folder below `curves`.
    pub name: String,
    /// For the legend.
    pub label: String,
    /// Name, unit and values of x.
    pub x: (&'a str, &'a str, &'a [f64]),
    /// The same of y.
    pub y: (&'a str, &'a str, &'a [f64]),
}

impl Plots {
    /// Writes the arrays of a curve of the plot `plot`; the series that shows it.
    ///
    /// # Errors
    /// When the host refuses.
    pub fn curve(&mut self, host: &Host, plot: &str, c: &Curve<'_>) -> Result<Series, StepError> {
        let write = |(name, unit, values): (&str, &str, &[f64])| -> Result<String, StepError> {
            let path = format!("curves/{}/{name}", c.name);
            host.write_f64(&path, &[values.len()], unit, values)?;
            Ok(path)
        };
        let (x, y) = (write(c.x)?, write(c.y)?);
        let series = Series::new(&c.label, &x, &y);
        self.curves.push(CensusCurve {
            plot: plot.into(),
            label: c.label.clone(),
            x,
            y,
        });
        Ok(series)
    }

    /// Heights over an angle (deg) or a distance (mm).
    pub fn heights(&mut self, name: &str, title: &str, x: [&str; 2], series: Vec<Series>) {
        if series.is_empty() {
            return;
        }
        let [label, unit] = x;
        self.plots.push(Plot {
            name: name.into(),
            title: Some(title.into()),
            note: None,
            x: Axis::new(label, unit),
            y: Axis::new("height", "mm"),
            series,
        });
    }
}
