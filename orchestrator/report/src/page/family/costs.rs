//! What the steps of a study cost, all points together.

use crate::family::Family;
use crate::input::{Instance, ReportInput};
use crate::units::{bytes, duration};
use maud::{Markup, html};

/// A row for each step of the file.
pub(in crate::page) fn section(input: &ReportInput, family: &Family) -> Markup {
    let mut steps: Vec<(&str, Vec<&Instance>)> = Vec::new();
    for instance in &input.instances {
        let name = instance.base();
        match steps.iter_mut().find(|(n, _)| *n == name) {
            Some((_, all)) => all.push(instance),
            None => steps.push((name, vec![instance])),
        }
    }
    let all: Vec<&Instance> = input.instances.iter().collect();
    html! {
        section id="costs" {
            h2 { "Costs" }
            div class="scroll" { table {
                thead { tr { th { "step" } th { "kind" }
                    @for head in ["runs", "CPU, one on average", "CPU, the dearest", "CPU, all", "wall, added up", "peak memory", "artifacts"] {
                        th class="n" { (head) }
                    } } }
                tbody { @for (name, all) in &steps { tr {
                    th { (name) } td { (all[0].record.kind) } (cells(all))
                } } }
                @if steps.len() > 1 { tfoot { tr { th { "all steps" } td {} (cells(&all)) } } }
            } }
            p class="note" { "What is the same for several of the " (family.points.len()) " points was run once." }
        }
    }
}

fn cells(all: &[&Instance]) -> Markup {
    let cpu = || all.iter().map(|i| i.record.cost.cpu_seconds);
    let memory = all.iter().map(|i| i.record.cost.peak_memory).max();
    html! {
        td class="n" { (all.len()) }
        td class="n" { (duration(cpu().sum::<f64>() / all.len().max(1) as f64)) }
        td class="n" { (duration(cpu().fold(0.0, f64::max))) } td class="n" { (duration(cpu().sum())) }
        td class="n" { (duration(all.iter().map(|i| i.record.cost.wall_seconds).sum())) }
        td class="n" { (bytes(memory.unwrap_or(0))) } td class="n" { (bytes(all.iter().map(|i| i.record.bytes).sum())) }
    }
}
