//! Where everything comes from and how to make it again.

use crate::input::{Instance, ReportInput};
use crate::read::{Facts, Material};
use crate::units::moment;
use maud::{Markup, html};
use serde_json::Value;

/// Instances whose parameters are listed in full.
const LONGEST: usize = 200;

/// Per instance: key, plugin, components, inputs, parameters. `rest`: what is listed; of a large study only what is the same at every point.
pub(super) fn section(input: &ReportInput, rest: &ReportInput, material: &Material) -> Markup {
    html! {
        section id="provenance" {
            h2 { "Provenance" }
            p { "To make these results again:" }
            div class="command" {
                pre { code { (input.command("run")) } }
                button type="button" class="copy with-script" hidden { "Copy" }
            }
            p class="note" { "Workflow file: " code { (input.file) } ". The same key means the same bytes."
                @if let Some(text) = began(&input.instances) { " " (text) } }
            @if rest.instances.len() < input.instances.len() {
                p class="note" { "Listed are the steps that are the same at every point. Those of a point are on its own page; their keys are in its place above and in the table of the study." }
            }
            @if rest.instances.len() > LONGEST {
                p class="note" { "The first " (LONGEST) " of " (rest.instances.len()) " steps." }
            }
            p class="on-paper note" { "What each step was made of (plugin, inputs, parameters) stands in this report on the screen." }
            @for (i, facts) in rest.instances.iter().zip(&material.facts).take(LONGEST) {
                (instance(i, facts.as_ref()))
            }
        }
    }
}

/// When the steps began. It comes from the records: the page is the same whenever it is written.
fn began(instances: &[Instance]) -> Option<String> {
    let times = || instances.iter().map(|i| i.record.started);
    let (first, last) = (times().reduce(f64::min)?, times().reduce(f64::max)?);
    let (first, last) = (moment(first), moment(last));
    Some(if first == last {
        format!("Its steps began at {first}.")
    } else {
        format!("The first of its steps began at {first}, the last at {last}.")
    })
}

fn instance(i: &Instance, facts: Option<&Facts>) -> Markup {
    let none = Value::Null;
    let p = facts.map_or(&none, |f| &f.provenance);
    let plugin = &p["plugin"];
    html! {
        details class="provenance on-screen" {
            summary {
                code { (i.label()) } " "
                span class="note" { (binary(plugin)) " · key " (short(&i.record.key)) }
            }
            dl {
                dt { "key" } dd { code { (i.record.key) } }
                @if let Some(hash) = plugin["hash"].as_str() { dt { "plugin" } dd { (binary(plugin)) " " code { (hash) } } }
                @for c in list(&p["components"]) {
                    dt { "component" } dd { (binary(c)) " " code { (c["hash"].as_str().unwrap_or_default()) } }
                }
                @for input in list(&p["inputs"]) {
                    dt { "input " (input["port"].as_str().unwrap_or_default()) }
                    dd { (input["step"].as_str().unwrap_or_default()) " " code { (input["key"].as_str().unwrap_or_default()) } }
                }
                dt { "ran on" } dd { (i.record.host) ", " (i.record.cost.threads) " threads" }
                @if let Some(f) = facts { @for line in &f.contents { dt { "holds" } dd { (line) } } }
            }
            @if p["parameters"].is_object() {
                details { summary { "parameters (SI)" } pre { code { (format!("{:#}", p["parameters"])) } } }
            }
        }
    }
}

fn list(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().into_iter().flatten()
}

fn binary(value: &Value) -> String {
    let text = |key: &str| value[key].as_str().unwrap_or_default();
    format!("{} {}", text("name"), text("version"))
        .trim()
        .to_owned()
}

/// The beginning of a key, which is enough to tell it from others.
pub(super) fn short(key: &str) -> &str {
    key.get(..12).unwrap_or(key)
}
