//! Every point in its place: its picture, its numbers, what is to be known of it, and the way to its own page.

use crate::family::Fate;
use crate::page::family::shown::{LISTED, Shown, parted, pictures_note};
use crate::page::provenance::short;
use crate::units::{plural, quantity};
use maud::{Markup, html};

/// Warnings of a point that are written out.
const WARNINGS: usize = 20;

pub(super) fn section(shown: &Shown<'_>) -> Markup {
    let family = shown.family;
    html! {
        section id="places" {
            h2 { "Point by point" }
            @if let Some(p) = shown.pictures {
                p { "The pictures show the " (p.title) ", all from the same side, in the same scale and in the same colours, shaded by the light. They stand in the order of the table." }
                (p.bar)
                @if let Some(text) = pictures_note(shown) { p class="note" { (text) } }
            }
            p { "The whole page of a point, with its maps and its plies in 3D, is written by this command and the name of the point; this page leads to it when it is written the next time:" }
            div class="command" {
                pre { code { (shown.input.command("report")) " --point " (family.points.first().map_or("NAME", |p| p.word.as_str())) } }
                button type="button" class="copy with-script" hidden { "Copy" }
            }
            div class="places" {
                @for i in 0..family.points.len().min(LISTED) { (place(shown, i)) }
            }
        }
    }
}

fn place(shown: &Shown<'_>, i: usize) -> Markup {
    let point = &shown.family.points[i];
    let picture = shown
        .pictures
        .and_then(|p| Some((p.of[i].as_ref()?, p.size)));
    let responses = shown.family.responses.iter().zip(&point.responses);
    let warnings = &shown.warnings[i];
    html! {
        article class={ "point" @if point.fate.is_failed() { " failed" } } id=(point.place()) tabindex="-1" {
            h3 { (parted(&point.name)) }
            @match (picture, &point.fate) {
                (Some((data, [w, h])), _) => img src=(data) width=(w) height=(h) alt={ "Formed ply at " (point.name) } decoding="async";,
                (None, Fate::Failed { .. }) => div class="no-picture" { svg viewBox="-8 -8 16 16" width="32" height="32" role="img" aria-label="failed" { path class="cross" d="m-5-5l10 10m0-10l-10 10" {} } },
                (None, Fate::NotRun) => div class="no-picture" { "not run" },
                (None, Fate::Done) => {}
            }
            dl {
                @for (response, value) in responses {
                    dt { (response.name) } dd { @match value { Some(v) => (quantity(*v, &response.unit, 5)), None => "–" } }
                }
            }
            @if let Fate::Failed { step, class, cause } = &point.fate {
                p class="why" { b { (class) } " in " code { (step) } ": " (cause) }
            }
            @if !warnings.is_empty() {
                details { summary { (plural(warnings.len(), "warning", "warnings")) }
                    ul { @for (label, text) in warnings.iter().take(WARNINGS) { li { code { (label) } ": " (text) } } } }
            }
            details { summary { "steps" }
                ul class="keys-of" { @for k in &point.instances {
                    @let instance = &shown.input.instances[*k];
                    li { (instance.base()) @if !instance.item.is_empty() { "[" (instance.item.join(",")) "]" } " " code { (short(&instance.record.key)) } }
                } }
            }
            @if let Some(address) = &point.report { p { a href=(address) { "Its own page" } } }
        }
    }
}
