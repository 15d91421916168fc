//! The verdicts on both runs.

use crate::beside::Sides;
use crate::judged::{Finding, Judged, Kept};
use crate::page::verdict::{self, Tone};
use crate::told::{allowed_text, found_text, in_short};
use crate::units::signed;
use maud::{Markup, html};

/// Whether the part is good, by each run.
pub(super) fn headlines(sides: &Sides<'_>) -> Markup {
    html! { div class="pair" { @for (k, side) in ["A", "B"].iter().enumerate() {
        @let doubt = matches!(verdict::trust(&sides.materials[k]).0, Tone::Bad);
        @let (class, text) = match in_short(&sides.inputs[k].judged) {
            None => ("found", "No limits were given, so nothing is judged".to_owned()),
            Some((Kept::Within, text)) if !doubt => ("good", format!("The part {text}")),
            Some((Kept::Beyond, text)) => ("bad", format!("The part {text}")),
            Some((_, text)) => ("found", format!("The part {text}")),
        };
        p class={ "verdict " (class) } { b { (side) } ": " (text) @if doubt { "; but this run is not to be trusted as it is" } "." }
    } } }
}

/// Each limit of either run, with what both have found.
pub(super) fn section(sides: &Sides<'_>) -> Markup {
    let judged = sides.inputs.map(|i| &i.judged);
    let mut titles: Vec<String> = Vec::new();
    for j in judged.iter().flat_map(|all| all.iter()) {
        let title = j.title();
        if !titles.contains(&title) {
            titles.push(title);
        }
    }
    let of = |k: usize, title: &str| judged[k].iter().find(|j| j.title() == title);
    html! { @if !titles.is_empty() {
        section id="limits" {
            h2 { "Limits" }
            div class="scroll" { table class="limits" {
                thead { tr { th { "limit" } th class="n" { "allowed" } th class="n" { "worst of A" } th class="n" { "worst of B" } th class="n" { "change" } th { "A" } th { "B" } } }
                tbody { @for title in &titles {
                    @let both = [of(0, title), of(1, title)];
                    tr { th { (title) } td class="n" { (allowed(both)) }
                        @for j in both { td class="n" { (j.map_or("–".to_owned(), found_text)) } }
                        td class="n" { (change(both)) }
                        @for j in both { (cell(j)) } }
                } }
            } }
        }
    } }
}

fn allowed(both: [Option<&Judged>; 2]) -> String {
    let mut texts: Vec<String> = both.iter().flatten().map(|j| allowed_text(j)).collect();
    texts.dedup();
    texts.join(", in B ")
}

/// From the worst of A to that of B.
fn change(both: [Option<&Judged>; 2]) -> String {
    let worst = |j: Option<&Judged>| j.and_then(|j| j.worst.as_ref()).map(|f: &Finding| f.value);
    match (worst(both[0]), worst(both[1]), both[0]) {
        (Some(a), Some(b), Some(j)) => signed(b - a, j.on.unit()),
        _ => "–".into(),
    }
}

fn cell(j: Option<&Judged>) -> Markup {
    let (class, text) = match j.map(|j| j.verdict) {
        Some(Kept::Within) => ("met", "✓ within"),
        Some(Kept::Beyond) => ("missed", "✗ beyond"),
        Some(Kept::NotJudged) => ("open", "– not judged"),
        None => ("open", "no such limit"),
    };
    html! { td class=(class) { (text) } }
}
