//! The page of two runs side by side: what differs in their inputs, their verdicts, their defects in one table, and both in the same views.

mod changes;
mod defects;
mod verdicts;
mod views;

use crate::beside::{Sides, pairs};
use crate::draw::{DrawError, Sharpness};
use crate::page::{STYLE, fingerprint_mark, view3d};
use maud::{DOCTYPE, Markup, PreEscaped, html};

/// The whole page.
///
/// # Errors
/// When a picture cannot be encoded.
pub(crate) fn page(sides: &Sides<'_>, sharp: Sharpness) -> Result<String, DrawError> {
    let studies = sides.studies();
    let mut drawn = Vec::new();
    for (n, pair) in studies.iter().enumerate() {
        drawn.push(views::drawn(*pair, n, 2 * studies.len(), sharp)?);
    }
    let materials = [0, 1].map(|k| &sides.materials[k]);
    let found = pairs(sides.inputs, materials);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                (PreEscaped(fingerprint_mark(&format!("{} {}", sides.inputs[0].fingerprint, sides.inputs[1].fingerprint))))
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (sides.inputs[0].workflow) " – two runs side by side" }
                style { (PreEscaped(STYLE)) }
            }
            body class="beside" {
                header {
                    p class="kind" { "Two runs side by side" }
                    h1 { (sides.inputs[0].workflow) @if sides.inputs[1].workflow != sides.inputs[0].workflow { " and " (sides.inputs[1].workflow) } }
                    dl { @for (side, input) in ["A", "B"].iter().zip(sides.inputs) { dt { (side) } dd { code { (input.given) } } } }
                    (verdicts::headlines(sides))
                }
                main {
                    (changes::section(sides))
                    (verdicts::section(sides))
                    (defects::section(&found))
                    @for one in &drawn { (one) }
                    (warnings(sides))
                }
                footer { "Made by " (sides.inputs[0].program) ". This page is complete in itself: it loads nothing. The page of each run alone tells the rest." }
                (view3d::scripts(!studies.is_empty(), false))
            }
        }
    };
    Ok(page.into_string())
}

/// What could not be read, of either run.
fn warnings(sides: &Sides<'_>) -> Markup {
    let all = ["A", "B"].iter().zip(&sides.materials);
    let all: Vec<(&str, &String)> = all
        .flat_map(|(side, m)| m.problems.iter().map(|p| (*side, p)))
        .collect();
    html! { @if !all.is_empty() {
        section class="warnings" { h2 { "Not shown" } ul { @for (side, text) in &all { li { (side) ": " (text) } } } }
    } }
}
