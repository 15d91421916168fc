//! What the run found, in one line, and what must not be overlooked.

use crate::input::ReportInput;
use crate::study::{Material, Run, Study};
use crate::units::{fixed, plural, quantity};

/// Energy that is not accounted for, over the external work, above which a run is not to be trusted.
const DRIFT_BOUND: f64 = 0.05;

/// How serious the verdict is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Tone {
    /// All is well.
    Good,
    /// Something was found.
    Found,
    /// The run is not to be trusted, or not whole.
    Bad,
}

/// The verdict on a study.
pub(crate) fn of_study(study: &Study) -> (Tone, String) {
    let mut parts = Vec::new();
    let mut tone = Tone::Good;
    match &study.zones {
        Some(zones) if zones.is_empty() => parts.push(nothing_found(study)),
        Some(zones) => {
            tone = Tone::Found;
            parts.push(plural(zones.len(), "zone", "zones"));
        }
        None => {}
    }
    if let Some(c) = study.comparison.as_ref().filter(|_| tone == Tone::Found) {
        let wrinkles: Vec<f64> = c
            .local()
            .filter(|d| d.is_wrinkle())
            .map(|d| d.length)
            .collect();
        let bridging = c.local().filter(|d| !d.is_wrinkle()).count();
        let longest = wrinkles.iter().copied().fold(0.0, f64::max);
        parts.push(match wrinkles.len() {
            0 => "no wrinkles".into(),
            1 => format!("1 wrinkle, {} long", quantity(longest, "m", 3)),
            n => format!("{n} wrinkles, longest {}", quantity(longest, "m", 3)),
        });
        parts.push(match bridging {
            0 => "no bridging".into(),
            n => plural(n, "bridging area", "bridging areas"),
        });
    }
    let runs = || {
        study
            .global
            .iter()
            .chain(study.locals.iter().filter_map(|l| l.run.as_ref()))
    };
    let kept: Vec<bool> = runs()
        .filter_map(|r| r.facts.energy.kinetic_bound_kept)
        .collect();
    if kept.iter().all(|k| *k) && !kept.is_empty() {
        parts.push("kinetic bound kept".into());
    } else if let Some(run) = runs().find(|r| r.facts.energy.kinetic_bound_kept == Some(false)) {
        tone = Tone::Bad;
        let missed = kept.iter().filter(|k| !**k).count();
        parts.push(format!(
            "kinetic bound missed by {} of {} runs (first: {})",
            missed,
            kept.len(),
            run.label
        ));
    }
    let drift = |r: &&Run| r.facts.energy.peak_drift_ratio.unwrap_or(0.0);
    let worst = runs().max_by(|a, b| drift(a).total_cmp(&drift(b)));
    if let Some(run) = worst.filter(|r| drift(r) > DRIFT_BOUND) {
        tone = Tone::Bad;
        let percent = fixed(100.0 * drift(&run), 0);
        parts.push(format!(
            "energy ledger open by up to {percent} % ({})",
            run.label
        ));
    }
    (tone, parts.join("; "))
}

fn nothing_found(study: &Study) -> String {
    let flagged: f64 = study
        .detection
        .iter()
        .flat_map(|d| &d.plies)
        .map(|p| p.flagged_area)
        .sum();
    if flagged > 0.0 {
        let area = quantity(flagged, "m2", 3);
        return format!("no zones, no local runs: {area} are flagged, too little for a zone");
    }
    "no defects found: no zones, no local runs".into()
}

/// Expectations met and missed, failures, in words; empty when there are none.
pub(crate) fn of_run(input: &ReportInput) -> (Tone, String) {
    let mut parts = Vec::new();
    let mut tone = Tone::Good;
    let missed = input.expectations.iter().filter(|e| !e.met).count();
    match (input.expectations.len(), missed) {
        (0, _) => {}
        (n, 0) => parts.push(format!(
            "all {} met",
            plural(n, "expectation", "expectations")
        )),
        (n, m) => {
            tone = Tone::Bad;
            parts.push(format!(
                "{m} of {} missed",
                plural(n, "expectation", "expectations")
            ));
        }
    }
    if !input.failures.is_empty() {
        tone = Tone::Bad;
        parts.push(format!(
            "{} failed",
            plural(input.failures.len(), "step", "steps")
        ));
    }
    if input.not_run > 0 {
        tone = Tone::Bad;
        parts.push(format!(
            "{} did not run",
            plural(input.not_run, "step", "steps")
        ));
    }
    (tone, parts.join("; "))
}

/// Warnings gathered by step, in their order.
pub(crate) fn by_step(warnings: &[(String, String)]) -> Vec<(&str, Vec<&str>)> {
    let mut all: Vec<(&str, Vec<&str>)> = Vec::new();
    for (label, text) in warnings {
        match all.iter_mut().find(|(l, _)| l == label) {
            Some((_, texts)) => texts.push(text),
            None => all.push((label, vec![text])),
        }
    }
    all
}

/// Warnings of all steps and what could not be read, each once, with the step.
pub(crate) fn warnings(input: &ReportInput, material: &Material) -> Vec<(String, String)> {
    let mut all: Vec<(String, String)> = Vec::new();
    let mut add = |label: String, text: &str| {
        let entry = (label, text.to_owned());
        if !all.contains(&entry) {
            all.push(entry);
        }
    };
    for (instance, facts) in input.instances.iter().zip(&material.facts) {
        for text in &instance.record.warnings {
            add(instance.label(), text);
        }
        let told = facts
            .as_ref()
            .and_then(|f| f.attributes["warnings"].as_array());
        for text in told.into_iter().flatten().filter_map(|t| t.as_str()) {
            add(instance.label(), text);
        }
    }
    for text in &material.problems {
        add("report".into(), text);
    }
    all
}
