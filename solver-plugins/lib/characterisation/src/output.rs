//! The artifact of a characterisation: curves, plots of them, files, results.

use plyflow_model::artifact::{self, CarriedFile, Characterisation, Plot, Series};
use plyflow_sdk::{Host, StepError};

/// Label and unit of an axis; the curves are stored in SI, the unit is what is shown.
pub type Axis<'a> = (&'a str, &'a str);

/// What will be written.
#[derive(Debug, Clone, Default)]
pub struct Output {
    arrays: Vec<(String, String, Vec<f64>)>,
    /// The attributes so far; a step tells here what it was given.
    pub about: Characterisation,
    results: Vec<(String, f64, String)>,
}

impl Output {
    /// A curve's values (SI), rank 1.
    pub fn curve(&mut self, path: &str, unit: &str, values: &[f64]) {
        self.arrays
            .push((path.into(), unit.into(), values.to_vec()));
    }

    /// A plot of curves.
    pub fn plot(&mut self, name: &str, title: &str, x: Axis<'_>, y: Axis<'_>, series: Vec<Series>) {
        self.about.plots.push(Plot {
            name: name.into(),
            title: Some(title.into()),
            note: None,
            x: artifact::Axis::new(x.0, x.1),
            y: artifact::Axis::new(y.0, y.1),
            series,
        });
    }

    /// A text file.
    pub fn file(&mut self, name: &str, text: &str) {
        self.about.files.push(CarriedFile::of_text(name, text));
    }

    /// A named number.
    pub fn result(&mut self, name: &str, value: f64, unit: &str) {
        self.results.push((name.into(), value, unit.into()));
    }

    /// Writes all of it.
    ///
    /// # Errors
    /// When the host refuses something.
    pub fn write(self, host: &Host) -> Result<(), StepError> {
        host.write_attributes(&self.about)?;
        for (path, unit, values) in &self.arrays {
            host.write_f64(path, &[values.len()], unit, values)?;
        }
        for (name, value, unit) in &self.results {
            host.result(name, *value, unit)?;
        }
        Ok(())
    }
}
