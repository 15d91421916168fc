//! The `expect` list: stated values and bounds of results, in SI.

use crate::diagnostics::{Problems, Source};
use crate::load::Draft;
use crate::resolved::Expectation;
use crate::yaml::{Entry, Kind, Node};
use plyflow_model::units::{Dimension, parse_quantity_in, parse_unit};

/// Reads the list; everything wrong is reported.
pub(crate) fn expectations(
    root: &Node,
    drafts: &[Draft<'_>],
    source: &Source,
    problems: &mut Problems,
) -> Vec<Expectation> {
    let items = root.get("expect").map_or(&[][..], Node::items);
    items
        .iter()
        .filter_map(|item| expectation(item, drafts, source, problems))
        .collect()
}

fn expectation(
    item: &Node,
    drafts: &[Draft<'_>],
    source: &Source,
    problems: &mut Problems,
) -> Option<Expectation> {
    let step = item.get("step")?;
    let name = step.text()?;
    let Some(draft) = drafts.iter().find(|d| d.name() == name) else {
        let d = problems.add(source, &step.span, format!("there is no step `{name}`"));
        d.given(name).suggest(name, drafts.iter().map(Draft::name));
        return None;
    };
    let result = item.get("result")?;
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
    let mut number = |key: &str| {
        let entry = item.entry(key).filter(|e| e.value.kind != Kind::Null)?;
        value(entry, &declared.unit, result_name, source, problems)
    };
    let (value, tolerance) = (number("value"), number("tolerance"));
    let (minimum, maximum) = (number("minimum"), number("maximum"));
    let given = |key: &str| item.get(key).is_some();
    if !["value", "minimum", "maximum"].into_iter().any(given) {
        let d = problems.add(source, &result.span, "this expectation states nothing");
        d.expected("`value` (with `tolerance`), `minimum` or `maximum`");
    }
    if let Some(t) = item.get("tolerance") {
        if !given("value") {
            let d = problems.add(source, &t.span, "`tolerance` without `value`");
            d.expected("`value: ..` beside it")
                .help("for a bound use `minimum` or `maximum`");
        } else if tolerance.is_some_and(|v| v < 0.0) {
            problems
                .add(source, &t.span, "`tolerance` is negative")
                .given(t.describe());
        }
    }
    if let (Some(low), Some(high)) = (minimum, maximum)
        && low > high
    {
        let span = &item.get("minimum")?.span;
        let d = problems.add(source, span, "`minimum` is greater than `maximum`");
        d.given(item.get("minimum")?.describe());
        d.expected(format!("at most {}", item.get("maximum")?.describe()));
    }
    Some(Expectation {
        step: name.to_owned(),
        result: result_name.to_owned(),
        value,
        tolerance,
        minimum,
        maximum,
        source: item.get("source").and_then(Node::text).map(str::to_owned),
    })
}

/// A value with the unit of the result, in SI.
fn value(
    entry: &Entry,
    unit: &str,
    result: &str,
    source: &Source,
    problems: &mut Problems,
) -> Option<f64> {
    let node = &entry.value;
    let exponents = parse_unit(unit).ok()?.exponents;
    let plain = exponents == Dimension::Dimensionless.exponents();
    let text = match &node.kind {
        Kind::Number(n) if plain => return n.as_f64(),
        Kind::Number(n) => n.to_string(),
        Kind::Text(text) => text.clone(),
        // The schema check has spoken.
        _ => return None,
    };
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
