//! `responses`: what is read from every point; and expectations on results of steps, at every point.

use crate::diagnostics::{Problems, Source};
use crate::draft::Draft;
use crate::resolved::{Expectation, ResolvedStep, ResponseFrom, Study, StudyResponse};
use crate::results::declared;
use crate::study::space::Family;
use crate::study::told::{is_column, report, within};
use crate::wires::Wiring;
use crate::yaml::{Entry, Kind, Node};
use plyflow_model::text::{WORD, is_word};
use plyflow_model::workflow::ResponseOf;
use plyflow_study::{Expression, ExpressionError, Kind as ValueKind, Names, Value};

/// Reads the responses; everything wrong is reported.
pub(super) fn responses(
    root: &Node,
    family: &Family,
    (drafts, wiring): (&[Draft<'_>], &Wiring),
    source: &Source,
    problems: &mut Problems,
) -> Vec<StudyResponse> {
    let entries = root.get("responses").map_or(&[][..], Node::entries);
    let mut all: Vec<StudyResponse> = Vec::new();
    for entry in entries.iter() {
        if !is_word(&entry.key) {
            let message = format!("`{}` cannot name a response", entry.key);
            let d = problems.add(source, &entry.key_span, message);
            d.given(entry.key.clone()).expected(WORD);
        }
        let taken = match is_column(&entry.key) {
            true => Some("a column that every table of a study has"),
            false => family
                .names
                .contains(&entry.key)
                .then_some("a variable of the study"),
        };
        if let Some(what) = taken {
            let message = format!("the response `{}` has the name of {what}", entry.key);
            let d = problems.add(source, &entry.key_span, message);
            d.expected("another name: the table has a column for each");
        }
        all.extend(match origin(entry, source, problems) {
            Some(Origin::Step) => response(entry, drafts, wiring, source, problems),
            Some(Origin::Variables) => of_variables(entry, family, source, problems),
            None => None,
        });
    }
    all
}

enum Origin {
    Step,
    Variables,
}

/// Where a response is said to come from; `None`: from nowhere, or from two places (and reported).
fn origin(entry: &Entry, source: &Source, problems: &mut Problems) -> Option<Origin> {
    let has = |key: &str| {
        let given = entry.value.entry(key);
        given.is_some_and(|e| e.value.kind != Kind::Null)
    };
    let message = match (has("value"), has("step"), has("result")) {
        (false, true, true) => return Some(Origin::Step),
        (true, false, false) if !has("of") => return Some(Origin::Variables),
        (true, ..) => "`value` beside what is read from a step",
        (false, true, false) => "no `result` of that step",
        (false, false, true) => "no `step` that has that result",
        (false, false, false) => "it comes from nowhere",
    };
    let message = format!("the response `{}`: {message}", entry.key);
    let d = problems.add(source, &entry.key_span, message);
    d.expected("`step` and `result`, or `value` alone, such as `value: length * width`");
    None
}

/// A number of every point that is computed from the point's variables.
fn of_variables(
    entry: &Entry,
    family: &Family,
    source: &Source,
    problems: &mut Problems,
) -> Option<StudyResponse> {
    let node = entry.value.get("value")?;
    let text = node.text()?;
    let names = Names {
        all: &family.names,
        bare: true,
    };
    let failed = |e: ExpressionError, point: Option<&str>, problems: &mut Problems| {
        let mut problem = e.problem;
        if let Some(point) = point {
            problem.message = format!("at the point {point}: {}", problem.message);
        }
        report(
            problem,
            &within(source, node, text, &e.at),
            source,
            problems,
        );
    };
    let expression = match Expression::read(text, names) {
        Ok(expression) => expression,
        Err(e) => {
            failed(e, None, problems);
            return None;
        }
    };
    let (mut values, mut unit) = (Vec::with_capacity(family.points.all.len()), None);
    for point in &family.points.all {
        match expression.value(&point.values) {
            Ok(Value::Quantity(q)) => {
                unit.get_or_insert_with(|| ValueKind::Quantity(q.exponents()).si_unit());
                values.push(q.si());
            }
            Ok(_) => {
                let message = format!("the response `{}` is no number", entry.key);
                let d = problems.add(source, &node.span, message);
                d.given(text).expected("a number, such as `length * width`");
                return None;
            }
            Err(e) => {
                failed(e, Some(&point.name), problems);
                return None;
            }
        }
    }
    let unit = unit.filter(|u| !u.is_empty()).unwrap_or_else(|| "1".into());
    Some(StudyResponse {
        name: entry.key.clone(),
        unit,
        from: ResponseFrom::Variables {
            expression: text.to_owned(),
            values,
        },
    })
}

fn response(
    entry: &Entry,
    drafts: &[Draft<'_>],
    wiring: &Wiring,
    source: &Source,
    problems: &mut Problems,
) -> Option<StudyResponse> {
    let (step, result) = (entry.value.get("step")?, entry.value.get("result")?);
    let (name, unit, measured) = declared(step, result, drafts, source, problems)?;
    if measured {
        let message = format!("`{name}` depends on the machine");
        let d = problems.add(source, &result.span, message);
        d.expected("a result that is the same on every machine: a table of a study has no other");
        return None;
    }
    let at = drafts.iter().position(|d| step.text() == Some(d.name()))?;
    let of = match entry.value.get("of").and_then(Node::text) {
        Some("max") => Some(ResponseOf::Max),
        Some("min") => Some(ResponseOf::Min),
        Some("mean") => Some(ResponseOf::Mean),
        Some("sum") => Some(ResponseOf::Sum),
        _ => None,
    };
    if of.is_none() && wiring.dimensions.get(at).is_some_and(|d| !d.is_empty()) {
        let message = format!(
            "step `{}` has an item for each of a collection",
            drafts[at].name()
        );
        let d = problems.add(source, &entry.key_span, message);
        d.expected("`of: max`, `min`, `mean` or `sum`: what is taken of the items");
        return None;
    }
    Some(StudyResponse {
        name: entry.key.clone(),
        unit,
        from: ResponseFrom::Step {
            step: wiring.order.iter().position(|i| *i == at)?,
            result: name,
            of,
        },
    })
}

/// Expectations on steps of the file, on what they are at every point.
pub(crate) fn at_all_points(
    expectations: Vec<Expectation>,
    study: &Study,
    steps: &[ResolvedStep],
) -> Vec<Expectation> {
    let all = |base: &str| -> Vec<String> {
        let Some(at) = study.steps.iter().position(|s| s == base) else {
            return Vec::new();
        };
        let mut there: Vec<usize> = study.points.iter().map(|p| p.steps[at]).collect();
        there.sort_unstable();
        there.dedup();
        there.into_iter().map(|i| steps[i].name.clone()).collect()
    };
    let mut found = Vec::new();
    for e in expectations {
        if e.mean_over.is_empty() {
            let at = |step: String| Expectation { step, ..e.clone() };
            found.extend(all(&e.step).into_iter().map(at));
        } else {
            let mean_over: Vec<String> = e.mean_over.iter().flat_map(|s| all(s)).collect();
            let step = mean_over.first().cloned().unwrap_or_default();
            found.push(Expectation {
                step,
                mean_over,
                ..e
            });
        }
    }
    found
}
