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

/// The verdict on a study in one line: what was found, then whether it can be trusted.
pub(crate) fn of_study(study: &Study) -> (Tone, String) {
    let (found, parts) = found_in(study);
    let (trusted, told) = trusted(study);
    let tone = match (trusted, found) {
        (Tone::Bad, _) => Tone::Bad,
        (_, true) => Tone::Found,
        (tone, false) => tone,
    };
    (
        tone,
        parts.into_iter().chain(told).collect::<Vec<_>>().join("; "),
    )
}

/// What was found in a study, in parts of a sentence, and whether that is anything.
fn found_in(study: &Study) -> (bool, Vec<String>) {
    let mut parts = Vec::new();
    let mut any = false;
    match &study.zones {
        Some(zones) if zones.is_empty() => parts.push(nothing_found(study)),
        Some(zones) => {
            any = true;
            parts.push(plural(zones.len(), "zone", "zones"));
            parts.extend(study.comparison.iter().flat_map(defects));
        }
        None => {}
    }
    (any, parts)
}

/// Whether what a study found can be trusted, in parts of a sentence.
fn trusted(study: &Study) -> (Tone, Vec<String>) {
    let mut parts = Vec::new();
    let mut tone = Tone::Good;
    if let Some(missed) = study.comparison.iter().find_map(|c| c.missed_text()) {
        tone = Tone::Found;
        parts.push(format!("{missed} of the reference missed"));
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
    (tone, parts)
}

/// What was found in each study, for the first screen: sentences, with the study's name where there are several.
pub(crate) fn found(material: &Material) -> Vec<String> {
    let of = |study: &Study| sentence(study, found_in(study).1);
    material.studies.iter().filter_map(of).collect()
}

/// Whether the answer can be trusted, for the first screen: sentences, and the worst of what they say.
pub(crate) fn trust(material: &Material) -> (Tone, Vec<String>) {
    let rank = |tone: &Tone| match tone {
        Tone::Good => 0,
        Tone::Found => 1,
        Tone::Bad => 2,
    };
    let mut worst = Tone::Good;
    let mut told = Vec::new();
    for study in &material.studies {
        let (tone, parts) = trusted(study);
        if rank(&tone) > rank(&worst) {
            worst = tone;
        }
        told.extend(sentence(study, parts));
    }
    let unsure =
        |s: &Study| s.comparison.is_some() && s.confirmed.is_none() && s.reference.is_none();
    if material.studies.iter().any(unsure) {
        told.push("Not known: whether the defects stay in finer and wider zones. `plyflow run --confirm` tells.".into());
    }
    (worst, told)
}

/// Parts as a sentence about a study; `None` without parts.
fn sentence(study: &Study, parts: Vec<String>) -> Option<String> {
    let text = parts.join("; ");
    let mut letters = text.chars();
    let first = letters.next()?.to_uppercase();
    Some(match study.title.is_empty() {
        true => format!("{first}{}.", letters.as_str()),
        false => format!("{}: {text}.", study.title),
    })
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

/// Warnings that say the same with other numbers and other names in quotes: which steps say so, and their words.
pub(crate) struct Alike<'w> {
    /// Step and text, in their order.
    pub said: Vec<(&'w str, &'w str)>,
}

impl Alike<'_> {
    /// The steps, each once.
    pub(crate) fn steps(&self) -> Vec<&str> {
        let mut steps: Vec<&str> = Vec::new();
        for (step, _) in &self.said {
            if !steps.contains(step) {
                steps.push(step);
            }
        }
        steps
    }
}

/// Warnings gathered by what they say, in the order of the first of each.
pub(crate) fn alike(warnings: &[(String, String)]) -> Vec<Alike<'_>> {
    let mut all: Vec<(String, Alike<'_>)> = Vec::new();
    for (label, text) in warnings {
        let (form, said) = (form_of(text), (label.as_str(), text.as_str()));
        match all.iter_mut().find(|(f, _)| *f == form) {
            Some((_, kind)) => kind.said.push(said),
            None => all.push((form, Alike { said: vec![said] })),
        }
    }
    all.into_iter().map(|(_, kind)| kind).collect()
}

/// A text without its numbers, its names in quotes and words of capitals and digits, as defects and zones are called by.
fn form_of(text: &str) -> String {
    let mut form = String::new();
    for (at, part) in text.split('\'').enumerate() {
        if at % 2 == 1 {
            form.push('\'');
            continue;
        }
        let name = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || "+-.".contains(c);
        for word in part.split_whitespace() {
            let bare = word.trim_matches(|c: char| ",;:()".contains(c));
            let number = bare.parse::<f64>().is_ok();
            let is_name =
                bare.starts_with(|c: char| c.is_ascii_uppercase()) && bare.chars().all(name);
            form.push_str(if number || is_name { "#" } else { word });
            form.push(' ');
        }
    }
    form
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_that_differ_in_numbers_and_names_are_one_kind() {
        let warnings = [
            (
                "local[A]",
                "hourglass energy is 14.8 % of internal energy: refine the mesh",
            ),
            (
                "local[C]",
                "a fibre is strained by 1.5 %, more than 1 %: look for cells",
            ),
            ("comparison", "CB1 reaches the cut of zone C: raise `scale`"),
            (
                "comparison",
                "DW12 reaches the cut of zone D: raise `scale`",
            ),
            (
                "local_finer[A]",
                "hourglass energy is 9.3 % of internal energy: refine the mesh",
            ),
            (
                "local_finer[A]",
                "'tool' and 'upper_film' end 0.079 mm deep at (-118.3, -72.3, 103.4) mm: 98 %",
            ),
            (
                "local_wider[A]",
                "'ply 1' and 'ply 2' end 1e-3 mm deep at (8, 2.3, 3) mm: 14 %",
            ),
            ("local_wider[A]", "'ply 1' ends 0.079 mm deep"),
        ]
        .map(|(step, text)| (step.to_owned(), text.to_owned()));
        let kinds = alike(&warnings);
        let told: Vec<(usize, Vec<&str>)> =
            kinds.iter().map(|k| (k.said.len(), k.steps())).collect();
        assert_eq!(
            told,
            [
                (2, vec!["local[A]", "local_finer[A]"]),
                (1, vec!["local[C]"]),
                (2, vec!["comparison"]),
                (2, vec!["local_finer[A]", "local_wider[A]"]),
                (1, vec!["local_wider[A]"]),
            ]
        );
        assert_eq!(kinds[2].said[1].1, warnings[3].1, "no word is lost");
    }
}
