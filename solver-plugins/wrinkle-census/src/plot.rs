//! Curves of the artifact and the plots that show them.

use crate::spread::Spread;
use plyflow_sdk::{Host, StepError};
use serde_json::{Value, json};

/// The plots so far, and the curves by what they show.
#[derive(Default)]
pub struct Plots {
    /// As in the data model.
    pub plots: Vec<Value>,
    /// `{"plot", "label", "x", "y"}`: which arrays are the curve of that label in that plot.
    pub curves: Vec<Value>,
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
    pub fn curve(&mut self, host: &Host, plot: &str, c: &Curve<'_>) -> Result<Value, StepError> {
        let mut paths = Vec::new();
        for (name, unit, values) in [c.x, c.y] {
            let path = format!("curves/{}/{name}", c.name);
            host.write_f64(&path, &[values.len()], unit, values)?;
            paths.push(path);
        }
        let (x, y) = (&paths[0], &paths[1]);
        self.curves
            .push(json!({"plot": plot, "label": c.label, "x": x, "y": y}));
        Ok(json!({"label": c.label, "x": x, "y": y}))
    }

    /// Heights over an angle (deg) or a distance (mm).
    pub fn heights(&mut self, name: &str, title: &str, x: [&str; 2], series: Vec<Value>) {
        if series.is_empty() {
            return;
        }
        let [label, unit] = x;
        self.plots.push(json!({
            "name": name, "title": title, "x": {"label": label, "unit": unit},
            "y": {"label": "height", "unit": "mm"}, "series": series,
        }));
    }

    /// Writes a probability density and its plot.
    ///
    /// # Errors
    /// When the host refuses.
    pub fn density(
        &mut self,
        host: &Host,
        of: &Spread,
        centres: &[f64],
        density: &[f64],
        inverse: &str,
    ) -> Result<(), StepError> {
        let curve = Curve {
            name: of.name.to_owned(),
            label: "by area".to_owned(),
            x: ("value", of.unit, centres),
            y: ("density", inverse, density),
        };
        let plot = format!("{}_density", of.name);
        let series = self.curve(host, &plot, &curve)?;
        self.plots.push(json!({
            "name": plot, "title": format!("{}, by area", of.title),
            "x": {"label": of.title.to_lowercase(), "unit": of.shown},
            "y": {"label": "probability density", "unit": format!("1/{}", of.shown)},
            "series": [series],
        }));
        Ok(())
    }
}
