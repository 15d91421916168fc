//! The artifact of a characterisation: curves, plots of them, files, results.

use plyflow_sdk::{Host, StepError};
use serde_json::{Map, Value, json};

/// Label and unit of an axis; the curves are stored in SI, the unit is what is shown.
pub type Axis<'a> = (&'a str, &'a str);

/// One line of a plot.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Label.
    pub label: String,
    /// Path of the abscissas.
    pub x: String,
    /// Path of the ordinates, as many.
    pub y: String,
    /// `line`, `dashed` or `points`.
    pub style: &'static str,
}

impl Series {
    /// A line of a plot.
    pub fn new(label: &str, x: &str, y: &str, style: &'static str) -> Self {
        Self {
            label: label.into(),
            x: x.into(),
            y: y.into(),
            style,
        }
    }
}

/// What will be written.
#[derive(Debug, Clone, Default)]
pub struct Output {
    arrays: Vec<(String, String, Vec<f64>)>,
    plots: Vec<Value>,
    files: Vec<Value>,
    attributes: Map<String, Value>,
    results: Vec<(String, f64, String)>,
}

impl Output {
    /// A curve's values (SI), rank 1.
    pub fn curve(&mut self, path: &str, unit: &str, values: &[f64]) {
        self.arrays
            .push((path.into(), unit.into(), values.to_vec()));
    }

    /// A plot of curves.
    pub fn plot(&mut self, name: &str, title: &str, x: Axis<'_>, y: Axis<'_>, series: &[Series]) {
        let series: Vec<Value> = series
            .iter()
            .map(|s| json!({"label": s.label, "x": s.x, "y": s.y, "style": s.style}))
            .collect();
        self.plots.push(json!({
            "name": name, "title": title,
            "x": {"label": x.0, "unit": x.1}, "y": {"label": y.0, "unit": y.1}, "series": series,
        }));
    }

    /// A text file.
    pub fn file(&mut self, name: &str, text: &str) {
        self.files.push(json!({"name": name, "text": text}));
    }

    /// A further attribute.
    pub fn attribute(&mut self, name: &str, value: Value) {
        self.attributes.insert(name.into(), value);
    }

    /// A named number.
    pub fn result(&mut self, name: &str, value: f64, unit: &str) {
        self.results.push((name.into(), value, unit.into()));
    }

    /// Writes all of it.
    ///
    /// # Errors
    /// When the host refuses something.
    pub fn write(mut self, host: &Host) -> Result<(), StepError> {
        self.attributes.insert("plots".into(), self.plots.into());
        self.attributes.insert("files".into(), self.files.into());
        host.write_attributes(&Value::Object(self.attributes))?;
        for (path, unit, values) in &self.arrays {
            host.write_f64(path, &[values.len()], unit, values)?;
        }
        for (name, value, unit) in &self.results {
            host.result(name, *value, unit)?;
        }
        Ok(())
    }
}
