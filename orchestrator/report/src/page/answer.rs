//! The first screen: is the part good, where is it not, what would help, and can this be trusted.

mod bad;
mod help;

use crate::input::ReportInput;
use crate::judged::{Judged, Kept};
use crate::page::content::Content;
use crate::page::verdict::{self, Tone};
use crate::page::warned;
use crate::plain::id_of;
use crate::read::Study;
use crate::told::{allowed_text, found_text, in_short, reasons};
use crate::units::plural;
use bad::{Bad, places};
use maud::{Markup, html};
use plyflow_model::artifact::{Attributes, ComparedDefect, Measurement};

/// Limits and places that the first screen tells; the rest is below.
const SHOWN: usize = 6;

/// The first screen of a page that is no study.
pub(super) fn section(content: &Content<'_>) -> Markup {
    let (input, material) = (content.input, &content.material);
    let bad = places(content);
    let (trust, told) = verdict::trust(material);
    let (tone, headline) = headline(input, trust);
    let help = help::leads(input, &bad);
    let warnings = warned::counts(input, material);
    html! {
        section id="answer" class=(class(tone)) {
            p class={ "verdict " (class(tone)) } { (headline) }
            div class="answers" {
                div id="good" {
                    h2 { "Is the part good?" }
                    (limits(input))
                }
                div id="bad-places" {
                    h2 { @if input.judged.is_empty() { "What was found?" } @else { "Where is it not?" } }
                    (listed(&bad, content))
                    @for text in verdict::found(material) { p class="note" { (text) } }
                }
                div id="help" {
                    h2 { "What would help?" }
                    @if help.is_empty() { p class="note" { "Nothing that the fields of this run speak for." } }
                    @for lead in help.iter().take(help::SHOWN) { p { b { (lead.advice) } " " span class="note" { (with_code(&lead.because)) } } }
                    @if !help.is_empty() { p class="note" { "These are leads read from the fields, no proof: run the change and compare." } }
                }
                div id="trust" {
                    h2 { "Can this be trusted?" }
                    p class={ "state " (class(trust)) } { @match trust {
                        Tone::Good => "Nothing speaks against it.",
                        Tone::Found => "With care.",
                        Tone::Bad => "Not as it is.",
                    } }
                    @for text in &told { p { (with_code(text)) } }
                    @if !warnings.is_empty() { p { a href="#warnings" { (warnings) } } }
                }
            }
        }
    }
}

fn class(tone: Tone) -> &'static str {
    match tone {
        Tone::Good => "good",
        Tone::Found => "found",
        Tone::Bad => "bad",
    }
}

/// The verdict on the part. A run that is not to be trusted has no good part.
fn headline(input: &ReportInput, trust: Tone) -> (Tone, String) {
    let doubt = match trust {
        Tone::Bad => "; but this run is not to be trusted as it is",
        _ => "",
    };
    match in_short(&input.judged) {
        Some((kept, text)) => {
            let tone = match (kept, trust) {
                (Kept::Beyond, _) => Tone::Bad,
                (Kept::NotJudged, _) | (_, Tone::Bad) => Tone::Found,
                _ => Tone::Good,
            };
            (tone, format!("The part {text}{doubt}."))
        }
        None if input.limits.is_some() => {
            (Tone::Found, format!("No limit could be judged{doubt}."))
        }
        None => (
            Tone::Found,
            format!("No limits were given, so nothing is judged{doubt}."),
        ),
    }
}

/// Limits with what was found.
fn limits(input: &ReportInput) -> Markup {
    let all = &input.judged;
    if all.is_empty() {
        return html! {
            p { "The workflow states no limits. Give them beside its steps, and this page says whether the part keeps them:" }
            pre { code { "limits:\n  wrinkle_height: 1 mm\n  bridging_gap: 2 mm\n  shear: 45 deg" } }
        };
    }
    let mut order: Vec<&Judged> = all.iter().collect();
    // What is beyond its limit first, then what is not judged.
    order.sort_by_key(|j| match j.verdict {
        Kept::Beyond => 0,
        Kept::NotJudged => 1,
        Kept::Within => 2,
    });
    html! {
        (table(order.iter().take(SHOWN).copied(), false))
        @if order.len() > SHOWN { p class="note" { a href="#limits" { "All " (order.len()) " limits" } } }
        @else { p class="note" { a href="#limits" { "Who has looked, and what is not judged" } } }
    }
}

/// A table of limits; `whole` also with where and who has looked.
fn table<'j>(all: impl Iterator<Item = &'j Judged>, whole: bool) -> Markup {
    html! {
        div class="scroll" { table class="limits" {
            thead { tr { th { "limit" } th class="n" { "allowed" } th class="n" { "worst found" } th { "verdict" }
                @if whole { th { "where" } th { "who has looked" } } } }
            tbody { @for j in all { tr {
                th { (j.title()) } td class="n" { (allowed_text(j)) } td class="n" { (found_text(j)) } (verdict_cell(j))
                @if whole {
                    td { @if let Some(f) = &j.worst { (f.place()) } }
                    td { (j.by) }
                }
            } } }
        } }
    }
}

fn verdict_cell(j: &Judged) -> Markup {
    let (class, text) = match j.verdict {
        Kept::Within => ("met", "✓ within"),
        Kept::Beyond => ("missed", "✗ beyond"),
        Kept::NotJudged => ("open", "– not judged"),
    };
    html! { td class=(class) { (text) } }
}

/// All limits, who has looked, and what is not judged and why.
pub(super) fn all_limits(input: &ReportInput) -> Markup {
    /// Rows of the table.
    const LONGEST: usize = 400;
    let all = &input.judged;
    html! {
        @if !all.is_empty() {
            section id="limits" {
                h2 { "Limits" }
                p { "A limit is judged where the finest model has looked: in the zones by their fine runs, elsewhere by the run of the whole part."
                    @if let Some(source) = input.limits.as_ref().and_then(|l| l.source.as_ref()) { " The limits come from: " (source) "." } }
                @if all.len() > LONGEST { p class="note" { "The first " (LONGEST) " of " (all.len()) "." } }
                (table(all.iter().take(LONGEST), true))
                @let told = reasons(all);
                @if !told.is_empty() { ul { @for line in told.iter().take(LONGEST) { li { (with_code(line)) } } } }
            }
        }
    }
}

fn listed(bad: &[Bad], content: &Content<'_>) -> Markup {
    let input = content.input;
    html! {
        @if bad.is_empty() {
            @if !input.judged.is_empty() { p { "Nothing that was found is beyond its limit." } }
            @else if measured(content) { p { "No wrinkle and no bridging was measured." } }
            @else if verdict::found(&content.material).is_empty() { p { "No step has measured defects." } }
        } @else {
            ol class="places-bad" { @for b in bad.iter().take(SHOWN) {
                li data-defect=[defect_id(content, b)] { b { (b.title()) } ": " (b.text.join(", ")) }
            } }
            p class="note" { "Places are those of the flat ply, as on the maps." }
            @if bad.len() > SHOWN { p class="note" { (plural(bad.len() - SHOWN, "more place is", "more places are")) " in the tables below." } }
        }
    }
}

/// Whether a step has measured the defects of a whole run.
fn measured(content: &Content<'_>) -> bool {
    let facts = content.material.facts.iter().flatten();
    facts.into_iter().any(|f| f.kind == Measurement::KIND)
}

/// The name on the page of the defect of a place, by which it is found on the maps and in the tables.
fn defect_id(content: &Content<'_>, bad: &Bad) -> Option<String> {
    let found = &bad.found[0].1;
    let name = found.name.as_ref()?;
    let is = |d: &ComparedDefect| {
        d.id == *name && d.ply == found.ply && Some(&d.zone) == found.zone.as_ref()
    };
    let has = |s: &Study| {
        let mut defects = s.comparison.iter().flat_map(|c| &c.told.defects);
        defects.any(is)
    };
    let n = content.material.studies.iter().position(has)?;
    Some(id_of(n, name))
}

/// A text whose words between grave accents are code.
fn with_code(text: &str) -> Markup {
    html! {
        @for (i, part) in text.split('`').enumerate() {
            @if i % 2 == 1 { code { (part) } } @else { (part) }
        }
    }
}
