//! Results of steps: what plugins declare of them, and values with their units.

use crate::diagnostics::{Problems, Source};
use crate::draft::Draft;
use crate::yaml::{Entry, Kind, Node};
use plyflow_model::manifest::one_of;
use plyflow_model::units::{Dimension, parse_quantity_in, parse_unit};

/// The steps that are wired to one, as they are written.
fn wired<'n>(draft: &Draft<'n>) -> Vec<&'n str> {
    fn texts<'n>(node: &'n Node, all: &mut Vec<&'n str>) {
        match &node.kind {
            Kind::List(items) => items.iter().for_each(|n| texts(n, all)),
            Kind::Map(entries) => entries.iter().for_each(|e| texts(&e.value, all)),
            _ => all.extend(node.text()),
        }
    }
    let mut all = Vec::new();
    if let Some(from) = draft.entry.value.get("from") {
        texts(from, &mut all);
    }
    all
}

/// Whether this is how a step, or an item of one that is fanned out (`census_0`), is called in the name of a result.
fn is_run_of(name: &str, step: &str) -> bool {
    let index = |part: &str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    match name.strip_prefix(step).map(|rest| rest.strip_prefix('_')) {
        Some(None) => name == step,
        Some(Some(items)) => items.split('_').all(index),
        None => false,
    }
}

/// What the plugin of a step declares of one of its results: its name, its unit, and whether it depends on the machine. `None` when there is
/// no such step or result (and that is reported).
pub(crate) fn declared(
    step: &Node,
    result: &Node,
    drafts: &[Draft<'_>],
    source: &Source,
    problems: &mut Problems,
) -> Option<(String, String, bool)> {
    let name = step.text()?;
    let Some(draft) = drafts.iter().find(|d| d.name() == name) else {
        let d = problems.add(source, &step.span, format!("there is no step `{name}`"));
        d.given(name).suggest(name, drafts.iter().map(Draft::name));
        return None;
    };
    let result_name = result.text()?;
    let manifest = &draft.plugin.as_ref()?.manifest;
    let Some(declared) = manifest.result(result_name) else {
        let message = format!("`{}` reports no result `{result_name}`", manifest.name);
        let stem = result_name.split('.').next().unwrap_or(result_name);
        let d = problems.add(source, &result.span, message);
        d.given(result_name)
            .suggest(stem, manifest.results.keys().map(String::as_str));
        return None;
    };
    if declared.by_step {
        let wired = wired(draft);
        let of = result_name.split('.').nth(1);
        if of.is_none_or(|of| !wired.iter().any(|w| is_run_of(of, w))) {
            let message = format!(
                "`{result_name}` is none of the results of `{name}`, which go on with the name of a step that is wired to it"
            );
            let stem = result_name.split('.').next().unwrap_or(result_name);
            let names: Vec<String> = wired.iter().map(|w| format!("{stem}.{w}")).collect();
            let d = problems.add(source, &result.span, message);
            d.given(result_name)
                .expected(one_of(names.iter().map(String::as_str)));
            return None;
        }
    }
    Some((
        result_name.to_owned(),
        declared.unit.clone(),
        declared.measured,
    ))
}

/// Whether a quantity is in a unit whose scale does not begin at zero (`degC`): 5 degC are no difference of 5 degrees.
fn is_on_a_scale(text: &str) -> bool {
    let number = plyflow_model::units::digits(text.trim());
    number.is_some_and(|(_, unit)| parse_unit(unit.trim()).is_ok_and(|u| u.has_offset()))
}

/// A value with the unit of the result, in SI.
pub(crate) fn value(
    entry: &Entry,
    unit: &str,
    result: &str,
    source: &Source,
    problems: &mut Problems,
) -> Option<f64> {
    let node = &entry.value;
    let exponents = match parse_unit(unit) {
        Ok(unit) => unit.exponents,
        // Whoever fills a catalog checks manifests first; an expectation is not dropped in silence all the same.
        Err(e) => {
            let message = format!(
                "the unit that its plugin declares for `{result}` cannot be read: {}",
                e.reason()
            );
            let d = problems.add(source, &node.span, message);
            d.help("the plugin's author must put it right; `plyflow check-plugin` says where");
            return None;
        }
    };
    let plain = exponents == Dimension::Dimensionless.exponents();
    let text = match &node.kind {
        Kind::Number(n) if plain => return n.as_f64(),
        Kind::Number(n) => n.to_string(),
        Kind::Text(text) => text.clone(),
        // The schema check has spoken.
        _ => return None,
    };
    if entry.key == "tolerance" && is_on_a_scale(&text) {
        let message = format!("`tolerance` of `{result}` is a temperature, `{text}`");
        let d = problems.add(source, &node.span, message);
        d.given(text)
            .expected("a difference of temperatures, such as `5 K`");
        return None;
    }
    match parse_quantity_in(&text, unit) {
        Ok(value) => Some(value),
        Err(e) => {
            let message = format!("`{}` of `{result}`: {}", entry.key, e.reason());
            let d = problems.add(source, &node.span, message);
            d.given(text).help(e.help());
            match Dimension::of(exponents) {
                Some(d0) => {
                    d.expected(format!("{} such as `{}`", d0.with_article(), d0.example()));
                }
                None => {
                    d.expected(format!("a quantity in {unit}"));
                }
            }
            None
        }
    }
}

/// Reports bounds between which there is nothing, and a value that is outside of them with its tolerance: no result could be as expected. In the unit that they are
/// compared in: value, tolerance, minimum, maximum.
pub(crate) fn bounds_meet(
    item: &Node,
    [value, tolerance, minimum, maximum]: [Option<f64>; 4],
    source: &Source,
    problems: &mut Problems,
) {
    let outside = |bound: &str, by: Option<f64>| {
        let given = item.get("value").zip(item.get(bound));
        given.filter(|_| by.is_some_and(|b| b > tolerance.unwrap_or(0.0).max(0.0) * (1.0 + 1e-9)))
    };
    let below = minimum.zip(value).map(|(low, v)| low - v);
    let above = maximum.zip(value).map(|(high, v)| v - high);
    for (bound, by) in [("minimum", below), ("maximum", above)] {
        if let Some((given, other)) = outside(bound, by) {
            let message = format!(
                "`value` lies beyond `{bound}` by more than its tolerance: nothing can be as expected"
            );
            let d = problems.add(source, &given.span, message);
            d.given(given.describe()).expected(match bound {
                "minimum" => format!("at least {}", other.describe()),
                _ => format!("at most {}", other.describe()),
            });
        }
    }
    if let (Some(low), Some(high)) = (minimum, maximum)
        && low > high
        && let (Some(least), Some(most)) = (item.get("minimum"), item.get("maximum"))
    {
        let message = "`minimum` is greater than `maximum`";
        let d = problems.add(source, &least.span, message);
        d.given(least.describe());
        d.expected(format!("at most {}", most.describe()));
    }
}
