//! Energies, loads and contact over time.

use crate::plot::{Line, Plot};
use crate::study::{Material, Run};
use crate::units::{fixed, number};
use maud::{Markup, html};

/// Energies of a run's history; the internal one is summed.
const ENERGIES: [(&str, &str, usize); 6] = [
    ("external", "external work", 0),
    ("kinetic", "kinetic", 2),
    ("contact", "contact", 3),
    ("friction", "friction loss", 4),
    ("damping", "damping loss", 5),
    ("drift", "drift", 6),
];

/// Energies and contact of all forming runs.
pub(super) fn section(material: &Material) -> Markup {
    let mut runs: Vec<(bool, &Run)> = Vec::new();
    for study in &material.studies {
        runs.extend(
            study
                .global
                .iter()
                .chain(&study.reference)
                .map(|r| (true, r)),
        );
        runs.extend(
            study
                .locals
                .iter()
                .filter_map(|l| l.run.as_ref())
                .map(|r| (false, r)),
        );
    }
    html! {
        @if !runs.is_empty() {
            section id="energy" {
                h2 { "Energy and contact" }
                (health(&runs))
                @for (whole, run) in &runs {
                    @if run.history.get("time").is_some() {
                        h3 { code { (run.label) } }
                        div class="plots" { (plots(run, *whole)) }
                    }
                }
                (penetrations(&runs))
            }
        }
    }
}

fn percent(v: Option<f64>) -> String {
    v.map_or("–".into(), |v| format!("{} %", fixed(100.0 * v, 2)))
}

fn health(runs: &[(bool, &Run)]) -> Markup {
    html! {
        div class="scroll" { table {
            thead { tr { th { "run" } th class="n" { "peak kinetic / internal" } th class="n" { "bound" } th { "kept" }
                th class="n" { "peak drift / external work" } th class="n" { "hourglass / internal" } } }
            tbody { @for (_, r) in runs {
                @let e = &r.facts.energy;
                tr { th { (r.label) } td class="n" { (percent(e.peak_kinetic_ratio)) } td class="n" { (percent(r.kinetic_bound)) }
                    @match e.kinetic_bound_kept {
                        Some(true) => td class="met" { "✓ kept" },
                        Some(false) => td class="missed" { "✗ missed" },
                        None => td { "–" },
                    }
                    td class="n" { (percent(e.peak_drift_ratio)) } td class="n" { (percent(e.hourglass_ratio)) } }
            } }
        } }
    }
}

fn plots(run: &Run, whole: bool) -> Markup {
    let h = &run.history;
    let time = h.get("time").unwrap_or_default();
    let size = [560.0, 300.0];
    let mut lines: Vec<Line<'_>> = Vec::new();
    let internal = h.internal();
    for (name, shown, colour) in ENERGIES {
        if let Some(values) = h.get(name) {
            lines.push(Line {
                name: shown,
                colour,
                values: values.to_vec(),
            });
        }
    }
    if let Some(values) = &internal {
        lines.insert(
            1.min(lines.len()),
            Line {
                name: "internal",
                colour: 1,
                values: values.clone(),
            },
        );
    }
    let blank = Plot {
        title: "",
        label: "",
        time,
        lines: Vec::new(),
        bound: None,
        ceiling: None,
        size,
    };
    let energy = Plot {
        title: "Energies",
        label: "energy (J)",
        lines,
        ..blank.clone()
    };
    let pressures: Vec<Line<'_>> = [("cavity_pressure", "cavity", 0), ("bag_pressure", "bag", 1)]
        .into_iter()
        .filter_map(|(name, shown, colour)| {
            let values = h.get(name)?.iter().map(|p| p * 1e-3).collect();
            Some(Line {
                name: shown,
                colour,
                values,
            })
        })
        .collect();
    let pressure = Plot {
        title: "Pressures",
        label: "pressure (kPa)",
        lines: pressures,
        ..blank.clone()
    };
    let height = h.get("frame_height").map(|z| Plot {
        title: "Frame height",
        label: "height (mm)",
        lines: vec![Line {
            name: "frame",
            colour: 0,
            values: z.iter().map(|v| v * 1e3).collect(),
        }],
        ..blank.clone()
    });
    html! {
        @if !energy.lines.is_empty() { (energy.svg()) }
        @if let (Some(kinetic), Some(internal)) = (h.get("kinetic"), &internal) {
            (ratio_plot(run, kinetic, internal, blank.clone()).svg())
        }
        @if whole && !pressure.lines.is_empty() { (pressure.svg()) }
        @if whole { @if let Some(p) = &height { (p.svg()) } }
    }
}

/// Kinetic over internal energy in per cent; left out while the internal energy is below 5 % of its peak, where
/// the ratio says nothing.
fn ratio_plot<'a>(run: &Run, kinetic: &[f64], internal: &[f64], blank: Plot<'a>) -> Plot<'a> {
    let peak = internal.iter().copied().fold(0.0, f64::max);
    let ratio = |(k, i): (&f64, &f64)| {
        if *i > 0.05 * peak {
            100.0 * k / i
        } else {
            f64::NAN
        }
    };
    let values = kinetic.iter().zip(internal).map(ratio).collect();
    let bound = run.kinetic_bound.map(|b| (100.0 * b, "bound"));
    Plot {
        title: "Kinetic over internal energy",
        label: "ratio (%)",
        lines: vec![Line {
            name: "ratio",
            colour: 2,
            values,
        }],
        ceiling: bound.map(|b| 3.0 * b.0),
        bound,
        ..blank
    }
}

fn penetrations(runs: &[(bool, &Run)]) -> Markup {
    let any = runs.iter().any(|(_, r)| !r.facts.penetration.is_empty());
    html! {
        @if any {
            h3 { "Penetration at the end" }
            div class="scroll" { table {
                thead { tr { th { "run" } th { "pair" } th class="n" { "largest (mm)" } th class="n" { "99.9 % quantile (mm)" } } }
                tbody { @for (_, r) in runs { @for (i, (pair, p)) in r.facts.penetration.iter().enumerate() {
                    tr { th { @if i == 0 { (r.label) } } td { (pair) } td class="n" { (number(p.max * 1e3, 3)) } td class="n" { (number(p.q999 * 1e3, 3)) } }
                } } }
            } }
        }
    }
}
