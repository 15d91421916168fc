//! The distribution of a quantity over a ply: quantiles among the results and a density as a plot.

use crate::plot::{Curve, Plots};
use plyflow_model::artifact::{Axis, Plot};
use plyflow_sdk::{Host, On, StepError};
use plyflow_surface::{bin_width, density, weighted_mean, weighted_quantiles};

/// A quantity over a ply.
pub struct Spread {
    /// Its name in results and arrays.
    pub name: &'static str,
    /// What it is, for people.
    pub title: &'static str,
    /// SI unit.
    pub unit: &'static str,
    /// Unit in which it is shown.
    pub shown: &'static str,
    /// On points or cells.
    pub on: On,
    /// Values.
    pub values: Vec<f64>,
    /// Undeformed area that each stands for (m2); 0: it is not counted.
    pub weights: Vec<f64>,
}

impl Spread {
    /// Reports mean, quantiles and largest value, and writes the density with its plot.
    ///
    /// # Errors
    /// When the host refuses.
    pub fn write(&self, host: &Host, plots: &mut Plots) -> Result<(), StepError> {
        let name = self.name;
        let shares = [0.5, 0.9, 0.99, 0.999, 1.0];
        let q = weighted_quantiles(&self.values, &self.weights, &shares);
        let mean = weighted_mean(&self.values, &self.weights);
        host.result(&format!("{name}_mean"), mean, self.unit)?;
        for (what, value) in ["q50", "q90", "q99"].iter().zip(&q) {
            host.result(&format!("{name}_{what}"), *value, self.unit)?;
        }
        host.result(&format!("{name}_largest"), q[4], self.unit)?;
        // A ply at rest everywhere has no distribution to draw.
        if q[3] <= 0.0 {
            return Ok(());
        }
        let width = bin_width(q[3]);
        let count = (q[3] / width) as usize + 1;
        let density = density(&self.values, &self.weights, width, count);
        let centres: Vec<f64> = (0..count).map(|i| (i as f64 + 0.5) * width).collect();
        let inverse = if self.unit == "m" { "1/m" } else { "1/N" };
        let curve = Curve {
            name: name.to_owned(),
            label: "by area".to_owned(),
            x: ("value", self.unit, &centres),
            y: ("density", inverse, &density),
        };
        let plot = format!("{name}_density");
        let series = plots.curve(host, &plot, &curve)?;
        plots.plots.push(Plot {
            name: plot,
            title: Some(format!("{}, by area", self.title)),
            note: None,
            x: Axis::new(self.title.to_lowercase(), self.shown),
            y: Axis::new("probability density", format!("1/{}", self.shown)),
            series: vec![series],
        });
        Ok(())
    }
}
