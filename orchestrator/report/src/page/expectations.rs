//! What was expected, and how it fared.

use crate::input::{Expectation, ReportInput, Verdict, label};
use crate::units::{join, number, quantity, shown};
use maud::{Markup, html};

/// A table is shown up to this many rows.
const LONGEST: usize = 400;
/// More expectations of a study than this are told apart by whether they are met.
const MANY: usize = 40;

/// What was expected, in words.
pub(crate) fn expected_text(e: &Expectation) -> String {
    let (factor, unit) = shown(&e.unit);
    let value = |v: f64| number(v * factor, 5);
    let mut parts = Vec::new();
    if let Some(v) = e.value {
        match e.tolerance {
            Some(t) => parts.push(format!("{} ± {}", value(v), value(t))),
            None => parts.push(value(v)),
        }
    }
    parts.extend(e.minimum.map(|m| format!("≥ {}", value(m))));
    parts.extend(e.maximum.map(|m| format!("≤ {}", value(m))));
    join(parts.join(", "), unit)
}

/// What was found, in words.
pub(crate) fn got_text(e: &Expectation) -> String {
    e.got
        .map_or("not reported".into(), |v| quantity(v, &e.unit, 5))
}

/// Cells of the verdict on an expectation and of where it comes from.
pub(super) fn verdict_and_source(e: &Expectation) -> Markup {
    let (class, text) = match e.verdict() {
        Verdict::Met => ("met", "✓ met"),
        Verdict::Missed => ("missed", "✗ missed"),
        Verdict::NotJudged => ("open", "– not judged"),
    };
    html! { td class=(class) { (text) } td { (e.source.as_deref().unwrap_or_default()) } }
}

/// Expectations with what was found. Of a study with many, those that are met at single points stand apart.
pub(super) fn section(input: &ReportInput) -> Markup {
    let all = &input.expectations;
    let many = input.family.is_some() && all.len() > MANY;
    let is_first = |e: &&Expectation| !many || is_notable(e);
    let first: Vec<&Expectation> = all.iter().filter(is_first).collect();
    let met: Vec<&Expectation> = all.iter().filter(|e| !is_first(e)).collect();
    html! {
        @if !all.is_empty() {
            section id="expectations" {
                h2 { "Expectations" }
                @if !first.is_empty() { (expectation_table(&first)) }
                @if !met.is_empty() {
                    details { summary { (met.len()) " more are met, at single points" } (expectation_table(&met)) }
                }
            }
        }
    }
}

/// Whether an expectation of a study is told before all others: it is about the points together, or is not met.
pub(crate) fn is_notable(e: &Expectation) -> bool {
    e.step == "study" || e.verdict() != Verdict::Met
}

fn expectation_table(all: &[&Expectation]) -> Markup {
    html! {
        @if all.len() > LONGEST { p class="note" { "The first " (LONGEST) " of " (all.len()) "." } }
        div class="scroll" { table {
            thead { tr { th { "step" } th { "result" } th class="n" { "expected" } th class="n" { "got" } th { "verdict" } th { "source" } } }
            tbody { @for e in all.iter().take(LONGEST) { tr {
                td { (label(&e.step, &e.item)) } td { (e.result) }
                td class="n" { (expected_text(e)) } td class="n" { (got_text(e)) }
                (verdict_and_source(e))
            } } }
        } }
    }
}
