//! What a coupon test writes besides its frames.

use crate::run::Outcome;
use crate::specimen::{Common, Specimen};
use plyflow_mechanics::energy::Ledger;
use plyflow_model::artifact::{self, Axis, Coupon, ElementCount, Energy, Series, Style};
use plyflow_sdk::{Host, Log, StepError};

/// Collects curves and plots and writes the attributes at the end.
pub struct Output<'a> {
    host: &'a Host,
    /// The attributes so far; a test tells here what it was given.
    pub about: Coupon,
}

/// A plot under construction.
pub struct Plot<'o, 'a> {
    output: &'o mut Output<'a>,
    plot: artifact::Plot,
}

impl<'a> Output<'a> {
    /// For one step.
    pub fn new(host: &'a Host) -> Self {
        Self {
            host,
            about: Coupon::default(),
        }
    }

    /// Writes the array `curves/<path>` (SI unit) and returns its whole path.
    ///
    /// # Errors
    /// When a value is not finite or the path exists.
    pub fn curve(&mut self, path: &str, unit: &str, values: &[f64]) -> Result<String, StepError> {
        let path = format!("curves/{path}");
        self.host.write_f64(&path, &[values.len()], unit, values)?;
        Ok(path)
    }

    /// Begins a plot; `x` and `y` are label and unit of an axis.
    pub fn plot<'o>(
        &'o mut self,
        name: &str,
        title: &str,
        x: (&str, &str),
        y: (&str, &str),
    ) -> Plot<'o, 'a> {
        let plot = artifact::Plot {
            name: name.into(),
            title: Some(title.into()),
            note: None,
            x: Axis::new(x.0, x.1),
            y: Axis::new(y.0, y.1),
            series: Vec::new(),
        };
        Plot { output: self, plot }
    }

    /// Something that the user should know.
    pub fn warn(&mut self, text: String) {
        self.host.log(Log::Warn, &text);
        self.about.warnings.push(text);
    }

    fn warn_of_energies(&mut self, p: &Common, outcome: &Outcome) {
        let h = &outcome.health;
        if h.peak_kinetic_ratio > p.kinetic_bound {
            self.warn(format!(
                "kinetic energy reached {:.1} % of internal energy (bound {:.1} %): the test is not \
                 quasi-static. Give it a longer duration or less mass scaling",
                100.0 * h.peak_kinetic_ratio,
                100.0 * p.kinetic_bound
            ));
        }
        if h.peak_drift_ratio > 0.01 {
            self.warn(format!(
                "{:.1} % of the external work is unaccounted for: reduce step_safety",
                100.0 * h.peak_drift_ratio
            ));
        }
        if outcome.hourglass_ratio > 0.02 {
            self.warn(format!(
                "hourglass energy reached {:.1} % of internal energy: refine the mesh",
                100.0 * outcome.hourglass_ratio
            ));
        }
    }

    /// Writes the attributes, with plots and warnings, and nothing else: for tests with results of their own.
    ///
    /// # Errors
    /// When the host refuses.
    pub fn attributes_only(self) -> Result<(), StepError> {
        self.host.write_attributes(&self.about)
    }

    /// Writes the energy history, the results that every test has, and the attributes. Declares nothing
    /// that depends on the machine except `element_cycle_rate`.
    ///
    /// # Errors
    /// When the host refuses.
    pub fn finish(
        mut self,
        p: &Common,
        specimen: &Specimen,
        outcome: &Outcome,
    ) -> Result<(), StepError> {
        type Column = (&'static str, fn(&Ledger) -> f64);
        let columns: [Column; 9] = [
            ("kinetic", |l| l.kinetic),
            ("membrane", |l| l.membrane),
            ("bending", |l| l.bending),
            ("hourglass", |l| l.hourglass),
            ("contact", |l| l.contact),
            ("friction", |l| l.friction),
            ("damping", |l| l.damping),
            ("external", |l| l.external),
            ("drift", Ledger::drift),
        ];
        let n = outcome.time.len();
        self.host
            .write_f64("history/time", &[n], "s", &outcome.time)?;
        for (name, value) in columns {
            let data: Vec<f64> = outcome.ledger.iter().map(value).collect();
            self.host
                .write_f64(&format!("history/{name}"), &[n], "J", &data)?;
        }
        let h = &outcome.health;
        self.warn_of_energies(p, outcome);
        let elements = specimen.model.element_count();
        let element_cycles = elements as f64 * outcome.cycles as f64;
        self.about = Coupon {
            element: Some(p.element.plugin.clone()),
            material: Some(p.material.name.clone()),
            element_size: Some(p.element_size),
            elements: Some(ElementCount::All(elements as u64)),
            cycles: Some(outcome.cycles),
            time_step: Some(outcome.smallest_step),
            energy: Some(Energy {
                peak_drift_ratio: Some(h.peak_drift_ratio),
                peak_kinetic_ratio: Some(h.peak_kinetic_ratio),
                kinetic_bound_kept: Some(h.peak_kinetic_ratio <= p.kinetic_bound),
                hourglass_ratio: Some(outcome.hourglass_ratio),
            }),
            ..self.about
        };
        let host = self.host;
        self.attributes_only()?;
        let added: f64 = specimen.model.sheets().iter().map(|s| s.added_mass).sum();
        host.result("kinetic_ratio", h.peak_kinetic_ratio, "1")?;
        host.result("drift_ratio", h.peak_drift_ratio, "1")?;
        host.result("hourglass_ratio", outcome.hourglass_ratio, "1")?;
        host.result("elements", elements as f64, "1")?;
        host.result("cycles", outcome.cycles as f64, "1")?;
        host.result("time_step", outcome.smallest_step, "s")?;
        host.result("added_mass", added, "kg")?;
        let rate = element_cycles / outcome.seconds.max(1e-9);
        host.measured("element_cycle_rate", rate, "1/s")
    }
}

impl Plot<'_, '_> {
    /// Adds a series; `x` and `y` are whole paths of arrays.
    #[must_use]
    pub fn series(mut self, label: &str, x: &str, y: &str, style: Style) -> Self {
        self.plot.series.push(Series::new(label, x, y).drawn(style));
        self
    }

    /// Adds a series where there is one.
    #[must_use]
    pub fn also(self, label: &str, curve: Option<(&str, &str)>, style: Style) -> Self {
        match curve {
            Some((x, y)) => self.series(label, x, y, style),
            None => self,
        }
    }

    /// Puts it into the artifact.
    pub fn done(self) {
        self.output.about.plots.push(self.plot);
    }
}
