//! What is expected over the points of a study, held against its table.

use super::points::Table;
use super::row::{Row, STEP, Verdict};
use super::trace;
use crate::engine::Session;
use crate::engine::core::Id;
use plyflow_model::job::Record;
use plyflow_model::workflow::FamilyOf;
use plyflow_study::{Found, judge, marks};
use plyflow_workflow::resolved::{Expectation, FamilyExpectation, Study, StudyValue};

/// A row of results for each expectation over the points; none without a study.
pub fn rows(session: &Session<'_>, records: &[(Id, Record)]) -> Vec<Row> {
    let Some(study) = &session.workflow.study else {
        return Vec::new();
    };
    // What `--until` leaves out is not expected either.
    let graph = session.core.graph();
    let wanted = |e: &&FamilyExpectation| {
        let step = study.responses[e.response].step();
        let mut points = e.points.iter().map(|p| &study.points[*p as usize]);
        points.all(|p| match step {
            Some(step) => graph.steps[p.steps[step]].wanted,
            None => p.steps.iter().all(|s| graph.steps[*s].wanted),
        })
    };
    let all: Vec<&FamilyExpectation> = study.expectations.iter().filter(wanted).collect();
    if all.is_empty() {
        return Vec::new();
    }
    let table = Table::read(session, records);
    all.into_iter().map(|e| row(&table, e)).collect()
}

/// A name for the number that is held against an expectation.
fn title(study: &Study, e: &FamilyExpectation) -> String {
    let response = &study.responses[e.response].name;
    let over = e
        .over
        .map(|i| study.variables[i].name.as_str())
        .unwrap_or_default();
    let name = match e.of {
        FamilyOf::Each => response.clone(),
        FamilyOf::Mean | FamilyOf::Max | FamilyOf::Min => format!("{} of {response}", e.of.word()),
        FamilyOf::Argmax | FamilyOf::Argmin => {
            format!("{over} at the {} of {response}", &e.of.word()[3..])
        }
        FamilyOf::Best if over.is_empty() => format!("{response} at the best point"),
        FamilyOf::Best => format!("{over} at the best point"),
        FamilyOf::Monotone if e.increasing => format!("fall of {response} along {over}"),
        FamilyOf::Monotone => format!("rise of {response} along {over}"),
        FamilyOf::ZeroWhere => format!("largest size of {response}"),
        FamilyOf::SymmetricAbout => {
            let about = e.about.as_ref().map_or("", |a| a.1.as_str());
            format!("asymmetry of {response} about {over} = {about}")
        }
    };
    match &e.condition {
        Some(condition) => format!("{name} where {condition}"),
        None => name,
    }
}

fn row(table: &Table<'_>, e: &FamilyExpectation) -> Row {
    let found = found(table, e);
    let relative = e.relative_tolerance.map(|t| {
        let all = table.lines.iter().filter_map(|l| l.responses[e.response]);
        t * all.fold(0.0, |a: f64, v| a.max(v.abs()))
    });
    let along = is_size(e.of);
    let expected = Expectation {
        step: STEP.into(),
        mean_over: Vec::new(),
        result: table.study.responses[e.response].name.clone(),
        unit: e.unit.clone(),
        value: e.value,
        tolerance: e.tolerance.filter(|_| !along),
        minimum: e.minimum,
        // What is found along a variable is the size of what should not be.
        maximum: if along {
            Some(relative.or(e.tolerance).unwrap_or(0.0))
        } else {
            e.maximum
        },
        source: e.source.clone(),
    };
    let mut row = Row {
        step: STEP.into(),
        item: Vec::new(),
        name: title(table.study, e),
        value: found.value,
        unit: e.unit.clone(),
        measured: false,
        expected: Some(expected),
    };
    // Points without a result could change what is found, unless it is out of its bounds already and they could only add to it.
    if found.missing > 0 && !(found.stands && row.verdict() == Some(Verdict::Missed)) {
        row.value = None;
    }
    // One part of the study stands for the whole where its largest is not known.
    if e.relative_tolerance.is_some()
        && table
            .lines
            .iter()
            .any(|l| l.responses[e.response].is_none())
    {
        row.value = None;
    }
    row.name += &remarks(table, e, &found);
    row
}

/// Whether what is found is the size of what should not be.
fn is_size(of: FamilyOf) -> bool {
    use FamilyOf::{Monotone, SymmetricAbout, ZeroWhere};
    matches!(of, Monotone | ZeroWhere | SymmetricAbout)
}

/// Where the number comes from, and what it leaves out.
fn remarks(table: &Table<'_>, e: &FamilyExpectation, found: &Found) -> String {
    let mut out = String::new();
    if found.missing > 0 {
        out += &format!(
            " ({} of {} points have no value)",
            found.missing,
            e.points.len()
        );
    } else if !(found.at.is_empty() || is_size(e.of) && found.value == Some(0.0)) {
        let name = |i: &usize| table.study.points[e.points[*i] as usize].name.as_str();
        let names: Vec<&str> = found.at.iter().map(name).collect();
        out += &format!(" (at {})", names.join(" and "));
    }
    if e.of == FamilyOf::Best {
        out += trace::why_not(table.trace.as_ref());
    }
    if found.alone > 0 {
        let what = match e.of {
            FamilyOf::SymmetricAbout => "without a mirror point",
            _ => "without another one beside it",
        };
        out += &format!(" ({} of {} points {what})", found.alone, e.points.len());
    }
    out
}

fn found(table: &Table<'_>, e: &FamilyExpectation) -> Found {
    if e.of == FamilyOf::Best {
        return trace::found(table.trace.as_ref(), table.study, &table.lines, e);
    }
    let mark = |i: &u32| {
        let point = &table.study.points[*i as usize];
        let along = match e.over.map(|v| &point.values[v]) {
            Some(StudyValue::Number { si, .. }) => *si,
            _ => 0.0,
        };
        let values = point.values.iter().enumerate();
        let others = values.filter(|(v, _)| Some(*v) != e.over).map(|(_, x)| x);
        let others = format!("{:?}", others.collect::<Vec<_>>());
        let result = table.lines[*i as usize].responses[e.response];
        (along, others, result)
    };
    let marks = marks(e.points.iter().map(mark));
    let low = [e.minimum, e.value.map(|v| v - e.tolerance.unwrap_or(0.0))];
    let high = [e.maximum, e.value.map(|v| v + e.tolerance.unwrap_or(0.0))];
    let low = low.into_iter().flatten().fold(f64::NEG_INFINITY, f64::max);
    let high = high.into_iter().flatten().fold(f64::INFINITY, f64::min);
    judge(e.claim(), &marks, (low, high))
}
