//! Curves, plots and results of a bias extension.

use super::terms::{Histories, Parameters, net_angle};
use crate::output::Output;
use crate::reference::Curve;
use crate::run::Outcome;
use crate::specimen::Specimen;
use plyflow_model::artifact::Style;
use plyflow_sdk::{Host, StepError};

/// A finished test.
pub(super) struct Done<'a> {
    pub p: &'a Parameters,
    pub histories: &'a Histories,
    pub amplitude: Option<Curve>,
    pub shear: Option<Curve>,
}

impl Done<'_> {
    pub fn write(
        &self,
        host: &Host,
        specimen: &Specimen,
        outcome: &Outcome,
    ) -> Result<(), StepError> {
        let h = self.histories;
        let mut out = Output::new(host);
        let d = out.curve("run/displacement", "m", &h.displacement)?;
        self.amplitudes(&mut out, &d)?;
        self.shears(&mut out, &d)?;
        let force = out.curve("run/crosshead_force", "N", &h.force)?;
        let x = ("cross-head displacement", "mm");
        out.plot(
            "force",
            "Bias extension: cross-head force",
            x,
            ("force", "N"),
        )
        .series("this run", &d, &force, Style::Line)
        .done();
        self.results(host, &mut out)?;
        let p = self.p;
        out.about.length = Some(p.length);
        out.about.width = Some(p.width);
        out.about.pull_time = Some(p.pull_time);
        out.about.imperfection = Some(p.imperfection);
        out.about.seed = Some(p.seed);
        out.finish(&p.common, specimen, outcome)
    }

    fn amplitudes(&self, out: &mut Output<'_>, d: &str) -> Result<(), StepError> {
        let h = self.histories;
        let section = out.curve("run/amplitude", "m", &h.section)?;
        let half = out.curve("run/half_height", "m", &h.half_height())?;
        let top = out.curve("run/top", "m", &h.top)?;
        let bottom = out.curve("run/bottom", "m", &h.bottom)?;
        let measured = self.measured(out, "amplitude", "m", self.amplitude.as_ref())?;
        let axes = (("cross-head displacement", "mm"), ("height", "mm"));
        let mut plot = out
            .plot(
                "amplitude",
                "Bias extension: wrinkle amplitude",
                axes.0,
                axes.1,
            )
            .series("central section, max |z|", d, &section, Style::Line)
            .series("specimen, max z", d, &top, Style::Dashed)
            .series("specimen, -min z", d, &bottom, Style::Dashed)
            .series("specimen, half peak to valley", d, &half, Style::Dashed);
        if let Some((x, y)) = &measured {
            plot = plot.series("measured", x, y, Style::Points);
        }
        plot.done();
        Ok(())
    }

    fn shears(&self, out: &mut Output<'_>, d: &str) -> Result<(), StepError> {
        let (p, h) = (self.p, self.histories);
        let a = out.curve("run/shear_a", "rad", &h.shear_a)?;
        let b = out.curve("run/shear_b", "rad", &h.shear_b)?;
        let net: Vec<f64> = h
            .displacement
            .iter()
            .map(|d| net_angle(p.length, p.width, *d))
            .collect();
        let net = out.curve("theory/shear", "rad", &net)?;
        let measured = self.measured(out, "shear", "rad", self.shear.as_ref())?;
        let axes = (("cross-head displacement", "mm"), ("shear angle", "deg"));
        let mut plot = out
            .plot("shear", "Bias extension: shear angle", axes.0, axes.1)
            .series("point A", d, &a, Style::Line)
            .series("point B", d, &b, Style::Line)
            .series("pin-jointed net", d, &net, Style::Dashed);
        if let Some((x, y)) = &measured {
            plot = plot.series("measured", x, y, Style::Points);
        }
        plot.done();
        Ok(())
    }

    fn measured(
        &self,
        out: &mut Output<'_>,
        name: &str,
        unit: &str,
        curve: Option<&Curve>,
    ) -> Result<Option<(String, String)>, StepError> {
        let Some(c) = curve else { return Ok(None) };
        let x = out.curve(&format!("measured/{name}_displacement"), "m", &c.x)?;
        let y = out.curve(&format!("measured/{name}"), unit, &c.y)?;
        Ok(Some((x, y)))
    }

    fn results(&self, host: &Host, out: &mut Output<'_>) -> Result<(), StepError> {
        let (p, h) = (self.p, self.histories);
        match h.first_above(&h.section, p.onset_amplitude) {
            Some(onset) => self.onset(host, out, onset)?,
            None => out.warn(format!(
                "no wrinkle: the amplitude stays below {:.2} mm; there is no onset",
                1e3 * p.onset_amplitude
            )),
        }
        let peak = h.section.iter().copied().fold(0.0, f64::max);
        let at = h.section.iter().position(|v| *v == peak).unwrap_or(0);
        host.result("amplitude_peak", peak, "m")?;
        host.result("amplitude_peak_displacement", h.displacement[at], "m")?;
        if let Some(r) = p.plateau {
            let inside = || {
                h.displacement
                    .iter()
                    .zip(&h.section)
                    .filter(|(d, _)| (r.from..=r.to).contains(*d))
                    .map(|(_, v)| *v)
            };
            host.result("plateau_least", inside().fold(f64::INFINITY, f64::min), "m")?;
            host.result("plateau_largest", inside().fold(0.0, f64::max), "m")?;
        }
        if let Some(late) = p.late {
            let value = h.at(&h.section, late);
            host.result("late_amplitude", value, "m")?;
            host.result("late_share", value / peak, "1")?;
        }
        if let Some(angle) = p.failure_angle {
            if let Some(d) = h.first_above(&h.shear_largest, angle) {
                host.result("failure_displacement", d, "m")?;
            }
            if let Some(d) = h.first_above(&h.shear_a, angle) {
                host.result("failure_displacement_a", d, "m")?;
            }
        }
        let gap = (h.shear_a.iter().zip(&h.shear_b)).map(|(a, b)| (a - b).abs());
        let before = gap
            .zip(&h.displacement)
            .filter(|(_, d)| **d <= 0.02)
            .map(|(g, _)| g);
        host.result("shear_gap_before_20mm", before.fold(0.0, f64::max), "rad")?;
        let force = crate::reference::largest_between(&h.force);
        host.result("force_peak", force, "N")?;
        host.result(
            "shear_largest",
            h.shear_largest.iter().copied().fold(0.0, f64::max),
            "rad",
        )?;
        host.result("fibre_strain_largest", h.fibre_strain, "1")
    }

    fn onset(&self, host: &Host, out: &mut Output<'_>, onset: f64) -> Result<(), StepError> {
        let (p, h) = (self.p, self.histories);
        host.result("onset_displacement", onset, "m")?;
        host.result("onset_shear_a", h.at(&h.shear_a, onset), "rad")?;
        host.result("onset_shear_b", h.at(&h.shear_b, onset), "rad")?;
        host.result(
            "onset_shear_net",
            net_angle(p.length, p.width, onset),
            "rad",
        )?;
        let later = onset + p.after_onset;
        if later > h.displacement[h.displacement.len() - 1] {
            out.warn(format!(
                "the test ends before {:.1} mm after the onset: no heights are told there",
                1e3 * p.after_onset
            ));
            return Ok(());
        }
        let (top, bottom) = (h.at(&h.top, later), h.at(&h.bottom, later));
        // Which side is the higher one is a matter of the imperfection.
        host.result("after_onset_higher", top.max(bottom), "m")?;
        host.result("after_onset_lower", top.min(bottom), "m")
    }
}
