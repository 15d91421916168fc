//! What is said of the parts of a study, and what its names and values must be.

use crate::diagnostics::{Problems, Source};
use crate::yaml::{Node, Span};
use plyflow_study::{Problem, Value};

/// Reports what a part of a study is not.
pub(crate) fn report(problem: Problem, span: &Span, source: &Source, problems: &mut Problems) {
    let d = problems.add(source, span, problem.message);
    if let Some(expected) = problem.expected {
        d.expected(expected);
    }
    if let Some(help) = problem.help {
        d.help(help);
    }
}

/// The place of a part of a text that stands as a value.
pub(crate) fn within(
    source: &Source,
    node: &Node,
    text: &str,
    at: &std::ops::Range<usize>,
) -> Span {
    let (whole, _, start) = source.origin(&node.span);
    let raw = whole.get(node.span.start - start..node.span.end.max(node.span.start) - start);
    // Not found where quotes hold escapes, or the text goes over several lines.
    match raw.and_then(|raw| raw.find(text)) {
        Some(i) => node.span.start + i + at.start..node.span.start + i + at.end.max(at.start),
        None => node.span.clone(),
    }
}

/// A value in the unit of another, where both are quantities.
pub(crate) fn in_unit_of(value: &Value, other: &Value) -> Result<Value, Problem> {
    match (value, other) {
        (Value::Quantity(value), Value::Quantity(other)) => {
            value.in_unit_of(other).map(Value::Quantity)
        }
        _ => Ok(value.clone()),
    }
}

/// Each value once, quantities in the unit of the first: a method tells values apart, not their spelling.
pub(crate) fn in_one_unit(values: Vec<Value>) -> Result<Vec<Value>, Problem> {
    let mut all: Vec<Value> = Vec::new();
    for value in values {
        let value = match all.first() {
            Some(first) if first.kind() == value.kind() => in_unit_of(&value, first)?,
            // Of another kind: told with both, later.
            _ => value,
        };
        if !all.contains(&value) {
            all.push(value);
        }
    }
    Ok(all)
}

/// Columns of the table that are always there, so that no variable and no response is named so. Beside them are `key_STEP`
/// and, of an optimisation, `excess_1` and so on.
const COLUMNS: [&str; 9] = [
    "asked",
    "feasible",
    "best_so_far",
    "point",
    "status",
    "failed_step",
    "failure_class",
    "cause",
    "seed",
];

/// Whether a name is that of a column that the table of a study has anyway.
pub(crate) fn is_column(name: &str) -> bool {
    COLUMNS.contains(&name) || name.starts_with("key_") || name.starts_with("excess_")
}
