//! What is expected of results: stated values and bounds, in SI, from the list `expect` of a workflow or from the
//! JSON file that it names.

use crate::check::{Checker, repeated_keys};
use crate::diagnostics::{Mention, Problems, Source};
use crate::draft::Draft;
use crate::named::{named, unreadable};
use crate::resolved::{Expectation, FamilyExpectation};
use crate::results::{bounds_meet, declared, value};
use crate::study::Asked;
use crate::yaml::{Kind, Node};
use plyflow_files::open::{self, MOST_WRITTEN};
use plyflow_model::schema;
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
            let given = Mention::new(from, &at.span, given);
            unreadable(problems, &given, &path, &e);
            return None;
        }
    };
    problems.note_file(&path, &crate::evidence::hash(&bytes));
    let text = match crate::text::written(bytes) {
        Ok(text) => text,
        Err(why) => {
            problems.add_unreadable(&path, why.to_string());
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
        for (k, step) in names.iter().enumerate() {
            if names[..k].iter().any(|n| n.text() == step.text()) {
                let message = format!(
                    "`{}` counts twice in the mean",
                    step.text().unwrap_or_default()
                );
                let d = problems.add(source, &step.span, message);
                d.expected("each step once");
            }
        }
        all[0].mean_over = all.iter().map(|e| e.step.clone()).collect();
        all.truncate(1);
    }
    all
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
    let numbers = [value, tolerance, minimum, maximum];
    consistent(item, result, numbers, source, problems);
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

/// Whether an expectation of `result` states something, and nothing that contradicts itself.
fn consistent(
    item: &Node,
    result: &Node,
    [value, tolerance, minimum, maximum]: [Option<f64>; 4],
    source: &Source,
    problems: &mut Problems,
) {
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
    bounds_meet(item, [value, tolerance, minimum, maximum], source, problems);
}
