//! Points that failed: where, of what class, and why.

use crate::family::Fate;
use crate::page::family::shown::{LISTED, Shown};
use crate::units::plural;
use maud::{Markup, html};
use std::collections::BTreeMap;

/// Whole texts of failures that are shown.
const FULL: usize = 50;

/// A row for each failed point.
pub(super) fn section(shown: &Shown<'_>) -> Markup {
    let failed: Vec<(usize, [&str; 3])> = (shown.family.points.iter().enumerate())
        .filter_map(|(i, p)| match &p.fate {
            Fate::Failed { step, class, cause } => {
                Some((i, [step, class, cause].map(String::as_str)))
            }
            _ => None,
        })
        .collect();
    let mut classes: BTreeMap<&str, usize> = BTreeMap::new();
    (failed.iter()).for_each(|(_, [_, class, _])| *classes.entry(class).or_default() += 1);
    let classes: Vec<String> = (classes.iter())
        .map(|(class, n)| format!("{n} of class {class}"))
        .collect();
    html! {
        section id="failed" {
            h2 { "Failed points" }
            p { (plural(failed.len(), "point", "points")) " of " (shown.family.points.len()) " failed: " (classes.join(", "))
                ". They have no value, and are left out of means, maps and sensitivities. The next run tries them again." }
            @if failed.len() > LISTED { p class="note" { "The first " (LISTED) " are listed." } }
            div class="scroll points-scroll" role="region" tabindex="0" aria-label="Failed points" { table {
                thead { tr { th scope="col" { "point" } th scope="col" { "step" } th scope="col" { "class" } th scope="col" { "cause" } } }
                tbody { @for (i, [step, class, cause]) in failed.iter().take(LISTED) {
                    tr { th scope="row" { (shown.link(*i)) } td { code { (step) } } td { (class) } td class="cause" { (cause) } }
                } }
            } }
            (in_full(shown))
        }
    }
}

/// What failed steps said beyond their first line.
fn in_full(shown: &Shown<'_>) -> Markup {
    let long = |f: &&(String, String)| f.1.trim().contains('\n');
    let all: Vec<&(String, String)> = shown.input.failures.iter().filter(long).collect();
    html! {
        @if !all.is_empty() {
            details {
                summary { "What failed steps say in full" }
                @if all.len() > FULL { p class="note" { "The first " (FULL) " of " (all.len()) "." } }
                dl { @for (label, reason) in all.iter().take(FULL) { dt { (label) } dd { (reason) } } }
            }
        }
    }
}
