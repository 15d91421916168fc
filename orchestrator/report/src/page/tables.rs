//! Tables: zones, defects, results.

use crate::input::ReportInput;
use crate::page::verdict;
use crate::plain::{Place, id_of};
use crate::read::Study;
use crate::units::{fixed, number, quantity};
use maud::{Markup, html};
use plyflow_model::artifact::{Cause, ComparedDefect, Comparison, Role};
use std::collections::BTreeMap;

/// Tables of steps are shown up to this many rows.
const LONGEST: usize = 400;

/// Zones and what was flagged on each ply.
pub(super) fn zones(study: &Study) -> Markup {
    let mm = |v: f64| number((v * 1e4).round() / 10.0, 5);
    html! {
        @if study.zones.is_some() || study.detection.is_some() {
            section class="zones" {
                h2 { "Where to look" }
                @if let Some(zones) = &study.zones {
                    @if zones.is_empty() {
                        @let text = verdict::nothing_found(study);
                        p { (text[..1].to_uppercase()) (text[1..]) "." }
                    } @else {
                        div class="scroll" { table {
                            thead { tr { th { "zone" } th class="n" { "x (mm)" } th class="n" { "y (mm)" } th class="n" { "size (mm)" }
                                th { "plies" } th class="n" { "flagged (mm²)" } th { "sides on the edge of the blank" } } }
                            tbody { @for z in zones {
                                @let [x0, y0, x1, y1] = z.bounds;
                                tr { th { (z.name) }
                                    td class="n" { (mm(x0)) " … " (mm(x1)) } td class="n" { (mm(y0)) " … " (mm(y1)) }
                                    td class="n" { (mm(x1 - x0)) " × " (mm(y1 - y0)) }
                                    td { (z.plies.join(", ")) } td class="n" { (number(z.flagged_area * 1e6, 4)) }
                                    td { (sides(z.free_sides)) } }
                            } }
                        } }
                    }
                }
                @if let Some(d) = &study.detection {
                    div class="scroll" { table {
                        thead { tr { th { "ply" } th class="n" { "flagged (mm²)" } th class="n" { "over-sheared (mm²)" }
                            th class="n" { "off the tool (mm²)" } th class="n" { "shear (deg)" } th class="n" { "largest distance (mm)" }
                            th class="n" { "judged (%)" } } }
                        tbody { @for p in &d.plies { tr {
                            th { (p.name) }
                            @for area in [Some(p.flagged_area), p.over_shear_area, Some(p.poor_conformity_area)] {
                                td class="n" { (area.map_or_else(|| "not judged".to_owned(), |a| number(a * 1e6, 4))) }
                            }
                            td class="n" { (fixed(p.shear_min.to_degrees(), 1)) " … " (fixed(p.shear_max.to_degrees(), 1)) }
                            td class="n" { (fixed(p.distance_max * 1e3, 2)) }
                            td class="n" { (p.judged_share.map_or_else(|| "–".to_owned(), |s| fixed(100.0 * s, 0))) }
                        } } }
                    } }
                    @if d.plies.iter().any(|p| p.judged_share.is_some_and(|s| s < 1.0)) {
                        p class="note" { "Judged: the share of the ply whose distance from the tool is judged. The rest has no tool to lie on: it lies at the \
                            tool's foot or past an edge of it, or over a hole in it, and is grey on the maps of the distance." }
                    }
                }
            }
        }
    }
}

/// A text as a sentence.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    format!("{}{}.", first.unwrap_or_default(), letters.as_str())
}

fn sides(free: [bool; 4]) -> String {
    let names = ["left", "right", "bottom", "top"];
    let all = names.into_iter().zip(free).filter(|(_, f)| *f);
    let all: Vec<&str> = all.map(|(n, _)| n).collect();
    match all.as_slice() {
        [] => "none".into(),
        all => all.join(", "),
    }
}

/// A defect in all models that have it, in the order of `roles`.
struct Row<'a> {
    first: &'a ComparedDefect,
    models: Vec<Option<&'a ComparedDefect>>,
}

/// Defects by id, wrinkles before bridging in each zone, with one entry per role.
fn defect_rows<'a>(c: &'a Comparison, roles: &[Role]) -> Vec<Row<'a>> {
    let mut rows: BTreeMap<(String, bool, usize, String), Row<'a>> = BTreeMap::new();
    for d in &c.defects {
        let Some(column) = roles.iter().position(|r| c.role(&d.model) == Some(*r)) else {
            continue;
        };
        let digits = d.id.trim_start_matches(|ch: char| !ch.is_ascii_digit());
        let rank = digits.parse().unwrap_or(usize::MAX);
        let row = rows
            .entry((d.zone.clone(), !d.found.is_wrinkle(), rank, d.id.clone()))
            .or_insert_with(|| Row {
                first: d,
                models: vec![None; roles.len()],
            });
        row.models[column] = row.models[column].or(Some(d));
    }
    rows.into_values().collect()
}

type Measure = (&'static str, fn(&ComparedDefect) -> String);

const MEASURES: [Measure; 8] = [
    ("likely cause", |d| {
        d.found.cause.map_or("–", Cause::name).to_owned()
    }),
    ("length (mm)", |d| {
        if d.found.is_wrinkle() {
            fixed(d.length * 1e3, 1)
        } else {
            "–".into()
        }
    }),
    ("amplitude (mm)", |d| fixed(d.found.amplitude * 1e3, 2)),
    ("area (mm²)", |d| fixed(d.found.area * 1e6, 0)),
    ("least radius (mm)", |d| {
        told(d.found.radius, |r| fixed(r * 1e3, 1))
    }),
    ("direction (deg)", |d| {
        told(d.found.direction, |a| fixed(a.to_degrees(), 0))
    }),
    ("shear (deg)", |d| {
        let degrees = |v: f64| fixed(v.to_degrees(), 1);
        match (d.shear_min, d.shear_max) {
            (Some(min), Some(max)) => format!("{} … {}", degrees(min), degrees(max)),
            _ => "–".into(),
        }
    }),
    ("shear along the crest (deg): mean (from … to)", |d| {
        let degrees = |v: f64| fixed(v.to_degrees(), 1);
        let f = &d.found;
        match (f.ridge_shear, f.ridge_shear_min, f.ridge_shear_max) {
            (Some(mean), Some(min), Some(max)) => {
                format!("{} ({} … {})", degrees(mean), degrees(min), degrees(max))
            }
            _ => "–".into(),
        }
    }),
];

/// A dash for what is not known.
fn told(value: Option<f64>, write: fn(f64) -> String) -> String {
    value.map_or("–".to_owned(), write)
}

/// Defects, local and global side by side.
pub(super) fn defects(study: &Study, n: usize, places: &[Place]) -> Markup {
    let Some(c) = &study.comparison else {
        return html! {};
    };
    let mut roles = vec![Role::Local, Role::Global];
    if c.told.models.iter().any(|m| m.role == Role::Reference) {
        roles.push(Role::Reference);
    }
    let rows = defect_rows(&c.told, &roles);
    let no_zones = study.zones.as_deref().unwrap_or_default().is_empty();
    html! {
        section id={ "defects-" (n) } {
            h2 { "Defects" }
            p { "Step " code { (c.label) } "."
                @if !c.others.is_empty() { " Other comparisons of the same zones are not drawn:"
                    @for (i, other) in c.others.iter().enumerate() { @if i > 0 { "," } " " code { (other) } }
                    ". What they found is under " a href="#results" { "All results" } ", how sound their local runs are under " a href="#energy" { "Energy and contact" } "." } }
            // The table looks into zones alone: it says nothing of what lies outside of them.
            @if no_zones {
                p { "Nothing was compared: there are no zones." }
            } @else if rows.is_empty() {
                p { "No wrinkle and no bridging was found in the zones, in any model." }
            } @else {
                p class="note" { "Fine local runs beside the coarse global run at the same places; a dash: that model does not show it, or bridging, which has no crest. Directions are those of crests in the flat ply, from x. A likely cause is a reading of the fields after the fact. A defect that reaches the cut needs a larger zone."
                    @if !places.is_empty() { span class="with-script" hidden { " A click on a row, or Enter, shows the defect in the 3D view and on the maps; Escape ends that." } } }
                @if let Some(c) = &study.confirmed { p class="confirmed" { (sentence(&c.verdict.text)) } }
                div class="scroll" { table class="defects" {
                    thead {
                        tr { th rowspan="2" { "id" } th rowspan="2" { "zone" } th rowspan="2" { "ply" } th rowspan="2" { "type" }
                            @for (name, _) in MEASURES { th class="group" colspan=(roles.len()) { (name) } } th rowspan="2" { "remark" }
                            @if study.confirmed.is_some() { th rowspan="2" { "run in other ways" } } }
                        tr { @for _ in MEASURES { @for role in &roles { th class="n" { (role.name()) } } } }
                    }
                    tbody { @for row in &rows {
                        @let id = id_of(n, &row.first.id);
                        tr data-defect=[places.iter().any(|p| p.id == id).then_some(&id)] {
                            th { (row.first.id) } td { (row.first.zone) } td { (row.first.ply) } td { (row.first.found.kind.name()) }
                            @for (_, measure) in MEASURES { @for (i, d) in row.models.iter().enumerate() {
                                td class=(if i == 0 { "n first" } else { "n" }) { (d.map_or("–".to_owned(), measure)) }
                            } }
                            td { @if row.models.iter().flatten().any(|d| d.touches_cut) { "reaches the cut" } }
                            @if study.confirmed.is_some() { td { (study.confirmed_text(&row.first.id).unwrap_or("–")) } }
                        }
                    } }
                } }
            }
            @if let Some(missed) = c.missed_text() {
                p { (missed) " of the reference " strong { "missed" } ": no local run has them. Of these, what lies outside of the zones is not listed." }
            }
        }
    }
}

/// All named numbers, by step.
pub(super) fn results(input: &ReportInput, open: bool) -> Markup {
    let with = input.instances.iter();
    let with: Vec<_> = with.filter(|i| !i.record.results.is_empty()).collect();
    html! {
        section id="results" {
            h2 { "All results" }
            p class="on-paper note" { "The numbers of all steps stand in this report on the screen. " code { "plyflow results" } " prints them too." }
            @if with.is_empty() { p { "No step reported a result." } }
            @if with.len() > LONGEST { p class="note" { "The first " (LONGEST) " of " (with.len()) " steps with results." } }
            @for i in with.iter().take(LONGEST) {
                details class="on-screen" open[open && with.len() <= 12] {
                    summary { code { (i.label()) } " " span class="note" { (i.record.results.len()) " numbers" } }
                    table { tbody { @for r in &i.record.results {
                        tr { td { (r.name) @if r.measured { span class="note" { " (measured)" } } } td class="n" { (quantity(r.value, &r.unit, 6)) } }
                    } } }
                }
            }
        }
    }
}
