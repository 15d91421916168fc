//! What is expected of results: stated values and bounds, in SI, from the list `expect` of a workflow or from the
//! JSON file that it names.

use crate::check::{Checker, repeated_keys};
use crate::diagnostics::{Problems, Source};
use crate::load::Draft;
use crate::parameters::{named, unreadable};
use crate::resolved::{Expectation, FamilyExpectation};
use crate::study::Asked;
use crate::yaml::{Entry, Kind, Node};
use plyflow_files::open::{self, MOST_WRITTEN};
use plyflow_model::manifest::one_of;
use plyflow_model::schema;
use plyflow_model::units::{Dimension, parse_quantity_in, parse_unit};
use serde_json::Value;
use std::sync::{Arc, LazyLock};

static EXPECTED: LazyLock<Value> = LazyLock::new(schema::expected);

/// What a workflow expects.
#[derive(Default)]
pub(crate) struct Expected {
    /// On results of steps.
    pub of_results: Vec<Expectation>,
    /// On responses, over the points of a study.
    pub of_responses: Vec<FamilyExpectation>,
}

/// Reads the list, here or in its file; everything wrong is reported where it stands.
pub(crate) fn expectations(
    root: &Node,
    drafts: &[Draft<'_>],
    asked: Option<&Asked<'_>>,
    source: &Source,
    problems: &mut Problems,
) -> Expected {
    let Some(expect) = root.get("expect") else {
        return Expected::default();
    };
    let list = |items: &[Node], source: &Source, problems: &mut Problems| {
        let mut all = Expected::default();
        for item in items {
            match (item.get("response"), asked) {
                (None, _) => all.of_results.extend(entry(item, drafts, source, problems)),
                (Some(_), Some(asked)) => {
                    all.of_responses
                        .extend(asked.expectation(item, source, problems));
                }
                (Some(node), None) => {
                    let message = "`response` in a workflow without a study";
                    let d = problems.add(source, &node.span, message);
                    d.expected("`step` and `result`");
                }
            }
        }
        all
    };
    let Some(given) = expect.text() else {
        return list(expect.items(), source, problems);
    };
    let Some((file, tree)) = read(given, expect, source, problems) else {
        return Expected::default();
    };
    Checker::new(&EXPECTED, &file, problems).check(&tree, "the expectations");
    let items = tree.get("expectations").map_or(&[][..], Node::items);
    let origin = tree.get("source").and_then(Node::text);
    let mut all = list(items, &file, problems);
    let sources = all.of_results.iter_mut().map(|e| &mut e.source);
    for source in sources.chain(all.of_responses.iter_mut().map(|e| &mut e.source)) {
        *source = source.take().or_else(|| origin.map(str::to_owned));
    }
    all
}

/// Reads the JSON file that `expect` names. It is noted as read, so that a change of it is seen.
fn read(given: &str, at: &Node, from: &Source, problems: &mut Problems) -> Option<(Source, Node)> {
    let path = named(problems, &from.folder, given);
    let bytes = match open::read(path.as_std_path(), MOST_WRITTEN) {
        Ok(bytes) => bytes,
        Err(e) => {
            unreadable(problems, from, &at.span, given, &path, &e);
            return None;
        }
    };
    problems.note_file(&path, &crate::evidence::hash(&bytes));
    let text = match crate::scene::written(bytes) {
        Ok(text) => text,
        Err(why) => {
            problems.add_unreadable(&path, why);
            return None;
        }
    };
    let folder = from.folder.clone();
    let source = Source {
        name: path,
        folder,
        text: Arc::new(text),
        set: Vec::new(),
    };
    // JSON is YAML, and the YAML reader knows where everything stands; but it takes more than other programs do.
    if let Err(e) = serde_json::from_str::<serde::de::IgnoredAny>(&source.text) {
        let span = crate::yaml::span_at(&source.text, e.line(), e.column());
        let mut message = e.to_string();
        if let Some(i) = message.rfind(" at line ") {
            message.truncate(i);
        }
        let d = problems.add(&source, &span, format!("this is no valid JSON: {message}"));
        d.help("check brackets, quotes and colons at and above this place; JSON has no comments, and no comma before a closing bracket");
        return None;
    }
    // YAML has its own mind about tabs. In JSON one is never more than a space, and of the same length.
    match crate::yaml::parse(&source.text.replace('\t', " ")) {
        Ok(tree) => {
            repeated_keys(&tree, &source, problems);
            Some((source, tree))
        }
        Err(e) => {
            let message = format!("this JSON cannot be read: {}", e.message);
            problems.add(&source, &e.span, message);
            None
        }
    }
}

/// The expectations of one entry: one for each of its steps, or a single one of their mean.
fn entry(
    item: &Node,
    drafts: &[Draft<'_>],
    source: &Source,
    problems: &mut Problems,
) -> Vec<Expectation> {
    let Some(at) = item.get("step") else {
        return Vec::new();
    };
    let names = match at.text() {
        Some(_) => std::slice::from_ref(at),
        None => at.items(),
    };
    if names.is_empty() {
        let d = problems.add(source, &at.span, "this expectation names no step");
        d.expected("the name of a step, or a list of names");
    }
    let of = |step| expectation(item, step, drafts, source, problems);
    let mut all: Vec<Expectation> = names.iter().filter_map(of).collect();
    if item.get("of").and_then(Node::text) == Some("mean") && !all.is_empty() {
        let mut units = all.iter().map(|e| &e.unit);
        if let Some(first) = units.next()
            && let Some(other) = units.find(|u| *u != first)
        {
            let message = format!("a mean of results in {first} and in {other}");
            let d = problems.add(source, &at.span, message);
            d.expected("steps whose results have the same unit");
        }
        all[0].mean_over = all.iter().map(|e| e.step.clone()).collect();
        all.truncate(1);
    }
    all
}

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

fn expectation(
    item: &Node,
    step: &Node,
    drafts: &[Draft<'_>],
    source: &Source,
    problems: &mut Problems,
) -> Option<Expectation> {
    let name = step.text()?;
    let result = match item.get("result") {
        Some(result) => result,
        None => {
            // So that an unknown step is told all the same.
            if !drafts.iter().any(|d| d.name() == name) {
                let d = problems.add(source, &step.span, format!("there is no step `{name}`"));
                d.given(name).suggest(name, drafts.iter().map(Draft::name));
            }
            return None;
        }
    };
    let (result_name, unit, _) = declared(step, result, drafts, source, problems)?;
    let mut number = |key: &str| {
        let entry = item.entry(key).filter(|e| e.value.kind != Kind::Null)?;
        value(entry, &unit, &result_name, source, problems)
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
        mean_over: Vec::new(),
        result: result_name,
        unit,
        value,
        tolerance,
        minimum,
        maximum,
        source: item.get("source").and_then(Node::text).map(str::to_owned),
    })
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
