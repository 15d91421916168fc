//! A row for every point.

use crate::family::{Fate, Point};
use crate::page::family::shown::{LISTED, Shown, cell, parted};
use maud::{Markup, html};
use plyflow_model::units::si_number;

/// The table, and how its points were chosen.
pub(super) fn table(shown: &Shown<'_>) -> Markup {
    let family = shown.family;
    let warned = shown.warnings.iter().any(|w| !w.is_empty());
    let n = family.points.len();
    html! {
        @for s in &family.samples {
            p { "A sample of " (s.count) " points by " code { (s.method) } ", seed " (s.seed) "." }
        }
        p class="note" {
            "A click on a head of a column, or Enter, sorts by it. Values in SI with all digits, and the keys of the artifacts, are in "
            code { (family.table) } "."
            @if n > LISTED { " The first " (LISTED) " of " (n) " points are listed here." }
        }
        p class="visually-hidden" id="sorted" role="status" {}
        div class="scroll points-scroll" role="region" tabindex="0" aria-label="Table of points" {
            table class="points" {
                caption class="visually-hidden" { "Points of the study with the values that were varied and what came out" }
                thead { tr {
                    th scope="col" { "point" }
                    @for v in &family.variables { th scope="col" class=[number_class(shown, v.name.as_str())] { (v.titled()) } }
                    @for r in &family.responses { th scope="col" class="n" { (r.titled()) } }
                    th scope="col" { "status" }
                    @if warned { th scope="col" class="n" { "warnings" } }
                } }
                tbody {
                    @for (i, point) in family.points.iter().enumerate().take(LISTED) {
                        (row(shown, point, warned.then(|| shown.warnings[i].len())))
                    }
                }
            }
        }
    }
}

/// Columns of numbers stand to the right.
fn number_class(shown: &Shown<'_>, name: &str) -> Option<&'static str> {
    let v = shown.family.variables.iter().position(|v| v.name == name)?;
    shown.levels[v].numbers().map(|_| "n")
}

fn row(shown: &Shown<'_>, point: &Point, warnings: Option<usize>) -> Markup {
    let status = match &point.fate {
        Fate::Done => "met",
        Fate::Failed { .. } => "missed",
        Fate::NotRun => "open",
    };
    let responses = shown.family.responses.iter().zip(&point.responses);
    html! {
        tr data-place=(point.place()) {
            th scope="row" { a href={ "#" (point.place()) } { (parted(&point.name)) } }
            @for value in &point.values {
                @match value.number() {
                    Some(v) => td class="n" data-value=(si_number(v)) { (value.text()) },
                    None => td { (value.text()) },
                }
            }
            @for (response, value) in responses {
                @match value {
                    Some(v) => td class="n" data-value=(si_number(*v)) { (cell(*v, &response.unit)) },
                    None => td class="n none" { "–" },
                }
            }
            td class=(status) { (point.fate.word())
                @if let Fate::Failed { class, .. } = &point.fate { ": " (class) } }
            @if let Some(n) = warnings { td class="n" data-value=(n) { @if n > 0 { (n) } } }
        }
    }
}
