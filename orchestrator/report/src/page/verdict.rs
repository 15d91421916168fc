//! What the run found, in one line, and what must not be overlooked.

use crate::input::{Expectation, ReportInput, Verdict};
use crate::read::{Comparison, Facts, Material, Run, Study};
use crate::units::{fixed, number, plural, quantity};

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
    if let Some(c) = &study.comparison {
        if tone == Tone::Found {
            parts.extend(defects(c));
        }
        if let Some(missed) = c.missed_text() {
            tone = Tone::Found;
            parts.push(format!("{missed} of the reference missed"));
        }
    }
    if let Some(confirmed) = &study.confirmed {
        if !confirmed.verdict.stays {
            tone = Tone::Bad;
        }
        parts.push(confirmed.verdict.text.clone());
    }
    let runs = runs(study);
    parts.extend(kinetic_text(&runs));
    let bad = [kinetic_missed(&runs), ledger_open(&runs)];
    if bad.iter().any(Option::is_some) {
        tone = Tone::Bad;
    }
    parts.extend(bad.into_iter().flatten());
    (tone, parts.join("; "))
}

/// Wrinkles and bridging of the local runs.
fn defects(c: &Comparison) -> [String; 2] {
    let (wrinkles, bridging): (Vec<_>, Vec<_>) =
        (c.told.local_defects()).partition(|d| d.found.is_wrinkle());
    let longest = wrinkles.iter().map(|d| d.length).fold(0.0, f64::max);
    let wrinkles = match wrinkles.len() {
        0 => "no wrinkles".into(),
        1 => format!("1 wrinkle, {} long", quantity(longest, "m", 3)),
        n => format!("{n} wrinkles, longest {}", quantity(longest, "m", 3)),
    };
    let bridging = match bridging.len() {
        0 => "no bridging".into(),
        n => plural(n, "bridging area", "bridging areas"),
    };
    [wrinkles, bridging]
}

/// Whether a run kept its bound on the kinetic energy; `None` when it had none.
fn kept(run: &Run) -> Option<bool> {
    run.facts.energy?.kinetic_bound_kept
}

/// How many runs missed their bounds on the kinetic energy.
fn kinetic_missed(runs: &[(&str, &Run)]) -> Option<String> {
    let all = runs.iter().filter(|(_, r)| kept(r).is_some()).count();
    let mut missed = runs.iter().filter(|(_, r)| kept(r) == Some(false));
    let (label, _) = missed.next()?;
    let missed = 1 + missed.count();
    Some(format!(
        "kinetic bound missed by {missed} of {all} runs (first: {label})"
    ))
}

/// In which run most of the energy is not accounted for, if that is too much.
fn ledger_open(runs: &[(&str, &Run)]) -> Option<String> {
    let drift = |r: &Run| r.facts.energy.and_then(|e| e.peak_drift_ratio);
    let drifts = (runs.iter()).map(|(label, r)| (label, drift(r).unwrap_or(0.0)));
    let (label, worst) = drifts.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let percent = fixed(100.0 * worst, 0);
    (worst > DRIFT_BOUND).then(|| format!("energy ledger open by up to {percent} % ({label})"))
}

/// How far below their bounds the kinetic energies of runs stayed, if all that had one kept theirs.
fn kinetic_text(runs: &[(&str, &Run)]) -> Option<String> {
    let mut all = runs.iter().filter_map(|(_, r)| kept(r)).peekable();
    all.peek()?;
    if all.any(|kept| !kept) {
        return None;
    }
    let of_bound = |r: &Run| Some((r.facts.energy?.peak_kinetic_ratio?, r.kinetic_bound?));
    let known = runs.iter().filter_map(|(_, r)| of_bound(r));
    let nearest = known.max_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)));
    Some(match nearest {
        Some((ratio, bound)) => format!(
            "kinetic energy at most {} % of internal (bound {} %)",
            fixed(100.0 * ratio, 1),
            number(100.0 * bound, 3)
        ),
        None => "kinetic bound kept".into(),
    })
}

/// All runs of a study, each once, with their names for people: those drawn, those that other comparisons have, and the reference, by
/// which all else is measured.
fn runs(study: &Study) -> Vec<(&str, &Run)> {
    let locals = study.locals.iter().map(|l| &l.run);
    let of_study = study.global.iter().chain(locals).chain(&study.further);
    let mut runs: Vec<(&str, &Run)> = of_study.map(|r| (r.label.as_str(), r)).collect();
    // The run of a zone that covers the blank may be the reference too.
    let is_new = |r: &&Run| runs.iter().all(|(_, known)| known.instance != r.instance);
    if let Some(run) = study.reference.as_ref().filter(is_new) {
        runs.push(("reference", run));
    }
    runs
}

/// What a study without zones found.
pub(crate) fn nothing_found(study: &Study) -> String {
    let looked_at = study.detection.iter().flat_map(|d| &d.plies);
    let flagged: f64 = looked_at.map(|p| p.flagged_area).sum();
    if flagged > 0.0 {
        let area = quantity(flagged, "m2", 3);
        return format!("no zones, no local runs: {area} are flagged, too little for a zone");
    }
    if (study.comparison.iter()).any(|c| c.missed_text().is_some()) {
        return "no zones, no local runs".into();
    }
    "no defects found: no zones, no local runs".into()
}

/// Expectations met, missed and not judged, failures, in words; empty when there are none.
pub(crate) fn of_run(input: &ReportInput) -> (Tone, String) {
    let mut parts = Vec::new();
    let mut tone = Tone::Good;
    let is = |v| move |e: &&Expectation| e.verdict() == v;
    let count = |v| input.expectations.iter().filter(is(v)).count();
    let (missed, open) = (count(Verdict::Missed), count(Verdict::NotJudged));
    let all = plural(input.expectations.len(), "expectation", "expectations");
    if missed + open > 0 {
        tone = Tone::Bad;
    }
    match (missed, open) {
        (0, 0) if input.expectations.is_empty() => {}
        (0, 0) => parts.push(format!("all {all} met")),
        (m, 0) => parts.push(format!("{m} of {all} missed")),
        (0, u) => parts.push(format!("{u} of {all} not judged")),
        (m, u) => parts.push(format!("{m} of {all} missed, {u} not judged")),
    }
    if !input.until.is_empty() {
        parts.push(format!("only up to {}", input.until.join(", ")));
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

/// Warnings of all steps and what could not be read, each once, with the step. `apart`: those of steps are told elsewhere.
pub(crate) fn warnings(
    input: &ReportInput,
    material: &Material,
    apart: bool,
) -> Vec<(String, String)> {
    let mut all: Vec<(String, String)> = Vec::new();
    let mut add = |label: String, text: &str| {
        let entry = (label, text.to_owned());
        if !all.contains(&entry) {
            all.push(entry);
        }
    };
    let steps = input.instances.iter().zip(&material.facts);
    for (instance, facts) in steps.filter(|_| !apart) {
        for text in &instance.record.warnings {
            add(instance.label(), text);
        }
        for text in facts.iter().flat_map(Facts::warnings) {
            add(instance.label(), text);
        }
    }
    for text in &material.problems {
        add("report".into(), text);
    }
    all
}
