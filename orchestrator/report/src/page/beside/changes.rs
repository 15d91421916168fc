//! What differs between the inputs of two runs.

use crate::beside::Sides;
use crate::units::{number, quantity};
use maud::{Markup, html};
use serde_json::Value;
use std::collections::BTreeMap;

/// Rows of the table.
const LONGEST: usize = 200;
/// Longer texts of values are cut.
const WIDEST: usize = 160;

/// A difference: where, and what either run has; absent where it has nothing.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Change {
    path: String,
    of: [Option<String>; 2],
}

pub(super) fn section(sides: &Sides<'_>) -> Markup {
    let (rows, alone) = all(sides);
    html! {
        section id="changes" {
            h2 { "What differs in the inputs" }
            @if rows.is_empty() && alone.iter().all(Vec::is_empty) {
                p { "Nothing: both runs had the same parameters, scenes and materials in all steps." }
            }
            @if !rows.is_empty() {
                @if rows.len() > LONGEST { p class="note" { "The first " (LONGEST) " of " (rows.len()) "." } }
                div class="scroll" { table { thead { tr { th { "parameter" } th { "A" } th { "B" } th { "of the steps" } } }
                    tbody { @for (change, steps) in rows.iter().take(LONGEST) { tr {
                        th { code { (change.path) } } @for side in &change.of { td { (side.as_deref().unwrap_or("–")) } } td { (steps.join(", ")) }
                    } } } } }
            }
            @for (side, steps) in ["A", "B"].iter().zip(&alone) { @if !steps.is_empty() {
                p { "Only " (side) " has " (steps.join(", ")) "." }
            } }
        }
    }
}

type Rows = Vec<(Change, Vec<String>)>;

/// Each difference once with the steps that have it, and the steps of one run alone.
fn all(sides: &Sides<'_>) -> (Rows, [Vec<String>; 2]) {
    let of = |k: usize| -> BTreeMap<String, &Value> {
        let instances = sides.inputs[k]
            .instances
            .iter()
            .zip(&sides.materials[k].facts);
        let told = instances
            .filter_map(|(i, f)| Some((i.step.clone(), &f.as_ref()?.provenance["parameters"])));
        told.collect()
    };
    let [a, b] = [of(0), of(1)];
    let mut by_change: BTreeMap<Change, Vec<String>> = BTreeMap::new();
    for (step, first) in &a {
        if let Some(second) = b.get(step) {
            let mut found = Vec::new();
            differences(Some(first), Some(second), "", &mut found);
            for change in found {
                by_change.entry(change).or_default().push(step.clone());
            }
        }
    }
    let alone = |own: &BTreeMap<String, &Value>, other: &BTreeMap<String, &Value>| {
        own.keys()
            .filter(|s| !other.contains_key(*s))
            .cloned()
            .collect()
    };
    (
        by_change.into_iter().collect(),
        [alone(&a, &b), alone(&b, &a)],
    )
}

/// All values that differ, with their paths; those of a list by the names of what it lists, where they have some.
fn differences(a: Option<&Value>, b: Option<&Value>, path: &str, all: &mut Vec<Change>) {
    if a == b {
        return;
    }
    let deeper = |key: &str| match path {
        "" => key.to_owned(),
        path => format!("{path}.{key}"),
    };
    match (a, b) {
        (Some(Value::Object(x)), Some(Value::Object(y))) => {
            let keys: std::collections::BTreeSet<&String> = x.keys().chain(y.keys()).collect();
            for key in keys {
                differences(x.get(key), y.get(key), &deeper(key), all);
            }
        }
        (Some(Value::Array(x)), Some(Value::Array(y)))
            if x.iter().chain(y).all(|v| v["name"].is_string()) =>
        {
            let names: std::collections::BTreeSet<&str> = x
                .iter()
                .chain(y)
                .filter_map(|v| v["name"].as_str())
                .collect();
            for name in names {
                let find = |list: &'_ [Value]| list.iter().position(|v| v["name"] == name);
                let (i, j) = (find(x), find(y));
                differences(i.map(|i| &x[i]), j.map(|j| &y[j]), &deeper(name), all);
            }
        }
        _ => all.push(Change {
            path: path.to_owned(),
            of: [a, b].map(|v| v.map(told)),
        }),
    }
}

/// A value in the units of the trade, no longer than a cell is wide.
fn told(value: &Value) -> String {
    let text = match value {
        Value::Number(n) => n.as_f64().map_or_else(|| n.to_string(), |v| number(v, 6)),
        Value::String(s) => {
            let parts = s
                .split_once(' ')
                .and_then(|(n, unit)| Some((n.parse::<f64>().ok()?, unit)));
            parts.map_or_else(|| s.clone(), |(n, unit)| quantity(n, unit, 6))
        }
        other => other.to_string(),
    };
    match text.char_indices().nth(WIDEST) {
        Some((at, _)) => format!("{}…", &text[..at]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_that_differ_are_told_with_their_paths_in_the_units_of_the_trade() {
        let a = json!({"friction": {"fabric_fabric": 0.35}, "sheets": [{"name": "ply_1", "fibre_1": "0.7853981633974483 rad"}, {"name": "ply_2"}], "same": 1});
        let b = json!({"friction": {"fabric_fabric": 0.2}, "sheets": [{"name": "ply_1", "fibre_1": "0 rad"}], "same": 1, "more": "0.01 m"});
        let mut all = Vec::new();
        differences(Some(&a), Some(&b), "scene", &mut all);
        let told: Vec<(&str, [&str; 2])> = all
            .iter()
            .map(|c| {
                (
                    c.path.as_str(),
                    c.of.each_ref().map(|v| v.as_deref().unwrap_or("–")),
                )
            })
            .collect();
        assert_eq!(
            told,
            [
                ("scene.friction.fabric_fabric", ["0.35", "0.2"]),
                ("scene.more", ["–", "10 mm"]),
                ("scene.sheets.ply_1.fibre_1", ["45 deg", "0 deg"]),
                ("scene.sheets.ply_2", ["{\"name\":\"ply_2\"}", "–"]),
            ]
        );
    }
}
