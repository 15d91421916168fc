//! Steps with plots, maps and tables: coupons, characterisations and whatever else carries some.

use crate::draw::{Drawn, Field, FormedView, Overlay, Sharpness, Side, flat, formed};
use crate::input::{Expectation, Instance, ReportInput};
use crate::page::carried::Shown;
use crate::page::content::Content;
use crate::page::expectations::{expected_text, got_text, verdict_and_source};
use crate::plain::Ply;
use crate::units::{bytes, quantity};
use maud::{Markup, html};
use plyflow_model::artifact::CarriedFile;

/// Width of a picture on the page (px).
const PICTURE: f64 = 430.0;
/// Of a longer file the beginning is shown (characters).
const LONGEST: usize = 20_000;

/// One block per step, in the order of the workflow.
pub(super) fn section(content: &Content<'_>, sharp: Sharpness) -> Drawn {
    if content.shown.is_empty() {
        return Ok(html! {});
    }
    let mut blocks = Vec::new();
    for shown in &content.shown {
        blocks.push(block(content.rest(), shown, sharp)?);
    }
    Ok(html! {
        section id="plots" {
            h2 { (heading(&content.shown)) }
            @for block in &blocks { (block) }
        }
    })
}

/// What the section is called.
pub(super) fn heading(shown: &[Shown]) -> &'static str {
    if shown.iter().any(|s| s.numbers) {
        "Tests and plots"
    } else {
        "Plots"
    }
}

fn block(input: &ReportInput, shown: &Shown, sharp: Sharpness) -> Drawn {
    let instance = &input.instances[shown.instance];
    let pictures = match &shown.sheet {
        Some(sheet) => pictures(sheet, shown.instance, sharp)?,
        None => html! {},
    };
    let mut maps = Vec::new();
    for (k, map) in shown.maps.iter().enumerate() {
        maps.push(map.drawn(&format!("map-{}-{k}", shown.instance), sharp)?);
    }
    let label = instance.label();
    Ok(html! {
        div class="step-block" {
            h3 {
                @if shown.title == label { code { (label) } } @else { (shown.title) " " code { (label) } }
                " " span class="note" { (instance.record.kind) }
            }
            @if shown.numbers { (numbers(input, instance)) }
            @for table in &shown.tables { (table) }
            @for map in &maps { (map) }
            @if !shown.plots.is_empty() { div class="plots" { @for plot in &shown.plots { (plot) } } }
            (pictures)
            @if !shown.files.is_empty() { (files(input, &label, &shown.files)) }
        }
    })
}

/// The results of a step beside what is expected of them.
fn numbers(input: &ReportInput, instance: &Instance) -> Markup {
    let results = &instance.record.results;
    // What no item has reported is told with each; what another item has not, or one that is not known yet, is not of this one.
    let of_all = |e: &&Expectation| {
        e.item.is_empty() && e.got.is_none() && results.iter().all(|r| r.name != e.result)
    };
    let mine: Vec<&Expectation> = (input.expectations.iter())
        .filter(|e| e.step == instance.step && (e.item == instance.item || of_all(e)))
        .collect();
    let of = |name: &str| -> Vec<&Expectation> {
        mine.iter().copied().filter(|e| e.result == name).collect()
    };
    let absent = (mine.iter()).filter(|e| !results.iter().any(|r| r.name == e.result));
    html! {
        @if !results.is_empty() || !mine.is_empty() {
            div class="scroll" { table class="numbers" {
                thead { tr { th { "result" } th class="n" { "value" } @if !mine.is_empty() {
                    th class="n" { "expected" } th { "verdict" } th { "source" } } } }
                tbody {
                    @for r in results {
                        @let all = of(&r.name);
                        @if all.is_empty() {
                            tr { th { (r.name) } td class="n" { (quantity(r.value, &r.unit, 5)) }
                                @if !mine.is_empty() { td {} td {} td {} } }
                        }
                        @for (i, e) in all.iter().enumerate() {
                            tr { th { @if i == 0 { (r.name) } }
                                td class="n" { @if i == 0 { (quantity(r.value, &r.unit, 5)) } } (judged(e)) }
                        }
                    }
                    @for e in absent {
                        tr { th { (e.result) } td class="n" { (got_text(e)) } (judged(e)) }
                    }
                }
            } }
        }
    }
}

fn judged(e: &Expectation) -> Markup {
    html! {
        td class="n" { (expected_text(e)) }
        (verdict_and_source(e))
    }
}

/// The sheet in its last state: shear on the flat sheet, deflection on the flat and on the deformed one.
fn pictures(sheet: &Ply, n: usize, sharp: Sharpness) -> Drawn {
    let overlay = Overlay::default();
    let mut rows = Vec::new();
    for field in [Field::Shear, Field::Deflection] {
        let Some(legend) = field.legend(&[sheet], None).filter(|l| !l.is_flat()) else {
            continue;
        };
        let mut figures = vec![(
            "undeformed",
            flat(sheet, &legend, &overlay, PICTURE, sharp)?,
        )];
        if field == Field::Deflection {
            let how = FormedView {
                side: Side::Front,
                tool: None,
                whole_tool: false,
                width: PICTURE,
            };
            figures.push(("deformed", formed(sheet, &legend, &overlay, how, sharp)?));
        }
        rows.push((legend, figures));
    }
    Ok(html! {
        @if !rows.is_empty() {
            div class="row" {
                @for (legend, figures) in &rows { @for (i, (what, figure)) in figures.iter().enumerate() {
                    figure class="map" {
                        p class="plot-title" { (legend.titled()) }
                        (figure)
                        (legend.bar(&format!("step-{n}-{}-{i}", legend.si_unit())))
                        figcaption { (sheet.name) ", " (what) ", last frame" }
                    }
                } }
            }
        }
    })
}

fn files(input: &ReportInput, label: &str, files: &[CarriedFile]) -> Markup {
    html! {
        p class="note" { "Files of this step, to be written with " code { (input.command("extract")) " '" (label) "'" } ":" }
        @for file in files {
            @if let Some(text) = &file.text {
                @let beginning: String = text.chars().take(LONGEST).collect();
                details {
                    summary { code { (file.name) } " " span class="note" { (bytes(text.len() as u64)) } }
                    pre { code { (beginning) @if beginning.len() < text.len() { "\n…" } } }
                }
            } @else {
                p { code { (file.name) } }
            }
        }
    }
}
