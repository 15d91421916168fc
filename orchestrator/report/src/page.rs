//! The page.

mod answer;
pub(crate) mod beside;
mod carried;
mod carried_tables;
pub(crate) mod content;
mod costs;
mod energy;
pub(crate) mod expectations;
mod family;
mod fidelity;
pub(crate) mod inputs;
mod maps;
mod provenance;
mod steps;
mod tables;
pub(crate) mod verdict;
mod view3d;
mod warned;

use crate::draw::{DrawError, Drawn, Sharpness};
use crate::family::Family;
use crate::input::ReportInput;
use crate::judged::Kept;
use crate::page::content::Content;
use crate::page::family::shown::Shown;
use crate::page::verdict::Tone;
use crate::read::{Study, places};
use crate::told::in_short;
use crate::units::bytes;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("style.css");

/// What [`is_current`](crate::is_current) looks for at the beginning of the file.
pub(crate) fn fingerprint_mark(fingerprint: &str) -> String {
    html! { meta name="plyflow-report" content=(fingerprint); }.into_string()
}

/// The whole page. `in_full`: its size with the finest pictures (bytes), when these found no room.
///
/// # Errors
/// When a picture cannot be encoded.
pub(crate) fn page(
    content: &Content<'_>,
    sharp: Sharpness,
    in_full: usize,
) -> Result<String, DrawError> {
    let (input, material, rest) = (content.input, &content.material, content.rest());
    let study = input.family.as_ref().zip(content.study.as_ref());
    let study = study.map(|(family, gathered)| Shown::new(input, family, gathered));
    let large = input.family.as_ref().is_some_and(Family::is_large);
    let points = study.as_ref().map(family::sections).transpose()?;
    let mut studies = Vec::new();
    let drawn = (material.studies.iter())
        .filter(|s| !s.plies.is_empty())
        .count();
    for (n, study) in material.studies.iter().enumerate() {
        studies.push(study_sections(study, n, drawn, sharp)?);
    }
    let inputs = inputs::section(material, sharp)?;
    let steps = steps::section(content, sharp)?;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (html_head(input, study.is_some()))
            body {
                (header(content, study.as_ref(), large))
                @if sharp.is_coarse() { (coarser(in_full)) }
                main {
                    @if let Some(points) = &points { (points) }
                    (answer::all_limits(input))
                    @for study in &studies { (study) }
                    (inputs)
                    (steps)
                    (fidelity::section(rest))
                    (expectations::section(input))
                    @match study.as_ref().filter(|_| large) {
                        Some(s) => (family::costs::section(input, s.family)),
                        None => (costs::section(content)),
                    }
                    (energy::section(content))
                    @if !large || !rest.instances.is_empty() { (tables::results(rest, material.studies.is_empty())) }
                    (provenance::section(input, rest, material))
                }
                footer { "Made by " (input.program) ". This page is complete in itself: it loads nothing." }
                (view3d::scripts(drawn > 0, study.is_some()))
            }
        }
    };
    Ok(page.into_string())
}

fn html_head(input: &ReportInput, is_study: bool) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            (PreEscaped(fingerprint_mark(&input.fingerprint)))
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="color-scheme" content="light dark";
            title { (input.workflow) @if is_study { " – study" } @else { " – forming report" } }
            style { (PreEscaped(STYLE)) }
        }
    }
}

/// `study`: of a study; `large`: what is of one of its points is not told here.
fn header(content: &Content<'_>, study: Option<&Shown<'_>>, large: bool) -> Markup {
    let (input, material) = (content.input, &content.material);
    // What is of single points stands in their places: before the table it would bury what all of them say.
    let apart = study.is_some();
    html! {
        header {
            p class="kind" { @if study.is_some() { "Study" } @else { "Forming report" } }
            h1 { (input.workflow) }
            @if let Some(s) = study {
                @let whole = s.family.count("done") == s.family.points.len();
                p class={ "verdict " (class(if whole { Tone::Good } else { Tone::Bad })) } { (s.family.counts()) }
            }
            @let answered = !apart && (!material.studies.is_empty() || input.limits.is_some());
            @if answered { (answer::section(content)) }
            @if let Some(text) = &input.description { p class="description" { (text) } }
            @let (tone, text) = verdict::of_run(input);
            @if !text.is_empty() { p class={ "verdict run " (class(tone)) } { (text) } }
            @if !answered && text.is_empty() && !apart {
                p class="verdict good" { (input.instances.len()) " steps finished" }
            }
            @if let Some((kept, text)) = in_short(&input.judged).filter(|_| apart) {
                @let tone = match kept { Kept::Within => Tone::Good, Kept::Beyond => Tone::Bad, Kept::NotJudged => Tone::Found };
                p class={ "verdict " (class(tone)) } { "Over all points, the part " (text) "." }
            }
            @if !input.failures.is_empty() && study.is_none() {
                section class="warnings bad" id="failures" {
                    h2 { "Failed" }
                    dl { @for (label, reason) in &input.failures { dt { (label) } dd { (reason) } } }
                }
            }
            (contents(content, large))
            (warned::section(input, material, apart))
            @if let Some(s) = study { (family::warned(s)) }
        }
    }
}

fn coarser(in_full: usize) -> Markup {
    html! {
        p class="note" id="coarser" { "Pictures and meshes are drawn coarser than they are: in full this page would have " (bytes(in_full as u64)) ". "
            code { "plyflow inspect" } " tells where the artifacts lie, which ParaView shows whole." }
    }
}

fn class(tone: Tone) -> &'static str {
    match tone {
        Tone::Good => "good",
        Tone::Found => "found",
        Tone::Bad => "bad",
    }
}

fn contents(content: &Content<'_>, large: bool) -> Markup {
    let (input, material) = (content.input, &content.material);
    let study = material.studies.first();
    let maps = study.is_some_and(|s| !s.plies.is_empty());
    let local = material.studies.iter().any(|s| !s.locals.is_empty());
    let compared = study.is_some_and(|s| s.comparison.is_some());
    let family = input.family.as_ref();
    let failed = family.is_some_and(|f| f.count("failed") > 0);
    let responses = family.is_some_and(|f| !f.responses.is_empty());
    let (plots, steps) = (!content.shown.is_empty(), steps::heading(&content.shown));
    let ways = !large && fidelity::has(input);
    let expected = !input.expectations.is_empty();
    let items = [
        (family.is_some(), "#points", "Table of points"),
        (failed, "#failed", "Failed points"),
        (responses, "#responses", "Responses"),
        (family.is_some(), "#places", "Point by point"),
        (!input.judged.is_empty(), "#limits", "Limits"),
        (maps, "#view-0", "3D view"),
        (maps, "#maps-0", "Maps"),
        (local, "#local-0", "Local runs"),
        (compared, "#defects-0", "Defects"),
        (inputs::has(material), "#inputs", "What went in"),
        (plots, "#plots", steps),
        (ways, "#fidelity", "Speed against error"),
        (expected, "#expectations", "Expectations"),
        (true, "#costs", "Costs"),
        (energy::has(content), "#energy", "Energy and contact"),
        (!large, "#results", "Results"),
        (true, "#provenance", "Provenance"),
    ];
    html! {
        nav { @for (_, at, name) in items.into_iter().filter(|i| i.0) { a href=(at) { (name) } " " } }
    }
}

fn study_sections(study: &Study, n: usize, drawn: usize, sharp: Sharpness) -> Drawn {
    let places = places(study, n);
    let view = view3d::section(study, n, &places, drawn, sharp)?;
    let maps = maps::global(study, n, &places, sharp)?;
    let local = maps::local(study, n, &places, sharp)?;
    Ok(html! {
        @if !study.title.is_empty() { h2 class="study" { (study.title) } }
        (tables::zones(study))
        (view)
        (tables::defects(study, n, &places))
        (maps)
        (local)
    })
}
