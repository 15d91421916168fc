//! What the steps cost.

use crate::draw::bars;
use crate::input::Instance;
use crate::page::content::Content;
use crate::read::Run;
use crate::units::{bytes, count, duration, fixed};
use maud::{Markup, html};
use std::collections::BTreeMap;

/// Steps are listed up to this many.
const LONGEST: usize = 400;
/// Bars are drawn for at most this many steps, and none below this part of the longest.
const BARS: (usize, f64) = (16, 0.005);

/// Forming runs and coupons by their instance.
fn runs<'a>(content: &'a Content<'_>) -> BTreeMap<usize, &'a Run> {
    let studies = content.material.studies.iter();
    let all = studies.flat_map(|s| s.runs().chain(&s.further));
    let coupons = content.shown.iter().filter_map(|s| s.run.as_ref());
    all.chain(coupons).map(|r| (r.instance, r)).collect()
}

/// Element-steps per second, as the step measured them or else over the whole step; 0 when unknown.
fn rate(i: &Instance, run: &Run) -> f64 {
    let told = (i.record.results.iter()).find(|r| r.name == "element_cycle_rate");
    let wall = i.record.cost.wall_seconds.max(1e-9);
    told.map_or(run.facts.element_cycles.unwrap_or(0.0) / wall, |r| r.value)
}

/// Table and bars; forming runs with their elements and rate.
pub(super) fn section(content: &Content<'_>) -> Markup {
    let runs = runs(content);
    let all = &content.input.instances;
    let sum = |f: fn(&Instance) -> f64| duration(all.iter().map(f).sum());
    let memory = all.iter().map(|i| i.record.cost.peak_memory).max();
    html! {
        section id="costs" {
            h2 { "Costs" }
            div class="scroll" { table {
                thead { tr {
                    th { "step" } th { "kind" }
                    @for head in ["elements", "time steps", "10⁶ element-steps", "wall", "CPU", "threads", "peak memory", "10⁶ element-steps/s", "artifact"] {
                        th class="n" { (head) }
                    }
                } }
                tbody { @for (at, i) in all.iter().enumerate().take(LONGEST) { (row(i, runs.get(&at).copied())) } }
                tfoot { tr {
                    th { "all steps, times added up" }
                    td colspan="4" { @if all.len() > LONGEST { "the first " (LONGEST) " of " (all.len()) " are listed" } }
                    td class="n" { (sum(|i| i.record.cost.wall_seconds)) } td class="n" { (sum(|i| i.record.cost.cpu_seconds)) }
                    td {} td class="n" { (bytes(memory.unwrap_or(0))) } td {} td {}
                } }
            } }
            (longest(all))
        }
    }
}

fn row(i: &Instance, run: Option<&Run>) -> Markup {
    let c = &i.record.cost;
    html! {
        tr {
            th { (i.label()) } td { (i.record.kind) }
            td class="n" { @if let Some(r) = run { (told(r.facts.elements as f64, count)) } }
            td class="n" { @if let Some(r) = run { (told(r.facts.cycles.unwrap_or(0) as f64, count)) } }
            td class="n" { @if let Some(r) = run { (told(r.facts.element_cycles.unwrap_or(0.0) * 1e-6, |v| fixed(v, 1))) } }
            td class="n" { (duration(c.wall_seconds)) } td class="n" { (duration(c.cpu_seconds)) }
            td class="n" { (c.threads) } td class="n" { (bytes(c.peak_memory)) }
            td class="n" { @if let Some(r) = run { (told(rate(i, r) * 1e-6, |v| fixed(v, 2))) } }
            td class="n" { (bytes(i.record.bytes)) }
        }
    }
}

/// A dash for what a run does not have: a drape has no time steps.
fn told(value: f64, write: fn(f64) -> String) -> String {
    if value > 0.0 {
        write(value)
    } else {
        "–".into()
    }
}

fn longest(all: &[Instance]) -> Markup {
    let bar = |i: &Instance| {
        let seconds = i.record.cost.cpu_seconds;
        (i.label(), seconds, duration(seconds))
    };
    let mut rows: Vec<(String, f64, String)> = all.iter().map(bar).collect();
    rows.sort_by(|a, b| b.1.total_cmp(&a.1));
    let top = rows.first().map_or(0.0, |r| r.1);
    rows.truncate(BARS.0);
    rows.retain(|r| r.1 >= BARS.1 * top);
    html! { @if rows.len() > 1 { (bars("CPU time by step", &rows)) } }
}
