//! The table of a study: a row for each of its points, whatever became of it.

use super::args::{Format, ResultsArgs};
use super::found::answer::{Line, Status};
use super::found::points::Table;
use super::table::{csv_text, head, number, shortened, table};
use crate::engine::Session;
use crate::engine::core::Id;
use crate::exit;
use crate::said::{Done, Stop, print};
use plyflow_model::job::Record;
use plyflow_model::units::si_number;
use plyflow_workflow::resolved::{StudyPoint, StudyValue};
use serde_json::{Value, json};

/// Points that a summary shows.
const SHOWN: usize = 20;

/// A value of a variable, in the unit of its column.
pub fn shown(value: &StudyValue) -> String {
    match value {
        StudyValue::Number { shown, .. } => si_number(*shown),
        StudyValue::Text(t) => t.clone(),
        StudyValue::Bool(b) => b.to_string(),
    }
}

/// `plyflow results --study`.
///
/// # Errors
/// [`exit::USAGE`] when the workflow is no study.
pub fn tell(args: &ResultsArgs, session: &Session<'_>, records: &[(Id, Record)]) -> Done {
    if session.workflow.study.is_none() {
        let text = "this workflow is no study: it has no block `study` or `optimise`";
        return Err(Stop::new(exit::USAGE, text));
    }
    let table = Table::read(session, records);
    match args.format {
        Format::Json => print(&format!("{:#}\n", as_json(session, &table))),
        Format::Csv => print(&as_csv(&table)),
        Format::Table => {
            print(&(as_table(&table, usize::MAX) + "\n" + &sum(&table) + &best(&table)))
        }
    }
}

/// The first rows and how many there are of each kind, for the end of a run.
pub fn in_short(session: &Session<'_>, found: &Table<'_>) -> String {
    let name = plyflow_model::text::one_line(&session.workflow.name);
    let mut out = format!("study {name}: {}", sum(found));
    out += &as_table(found, SHOWN);
    let more = found.lines.len().saturating_sub(SHOWN);
    if more > 0 {
        out += &format!("and {more} more: plyflow results --study\n");
    }
    out + &best(found)
}

/// How many points there are of each kind.
fn sum(table: &Table<'_>) -> String {
    let mut parts = vec![format!("{} points", table.lines.len())];
    for (n, word) in [
        (table.count(|s| *s == Status::Done), "done"),
        (table.count(Status::is_failed), "failed"),
        (table.count(|s| *s == Status::NotRun), "not run"),
    ] {
        if n > 0 {
            parts.push(format!("{n} {word}"));
        }
    }
    parts.join(", ") + "\n"
}

/// What an optimisation has led to; empty for a study.
fn best(table: &Table<'_>) -> String {
    let trace = table.trace.as_ref();
    trace.map_or_else(String::new, |t| t.in_words(table.study))
}

fn as_table(found: &Table<'_>, most: usize) -> String {
    let study = found.study;
    let mut heads: Vec<String> = study
        .variables
        .iter()
        .map(|v| head(&v.name, &v.unit))
        .collect();
    heads.extend(study.responses.iter().map(|r| head(&r.name, &r.unit)));
    let numbers: Vec<usize> = (0..heads.len()).collect();
    let failed = found.count(Status::is_failed) > 0;
    heads.extend(found.trace.iter().flat_map(|t| t.heads(study)));
    heads.push("status".into());
    if failed {
        heads.push("cause".into());
    }
    let line = |(at, (point, line)): (usize, (&StudyPoint, &Line))| {
        let mut cells: Vec<String> = point.values.iter().map(shown).collect();
        let value = |v: &Option<f64>| v.map_or("-".to_owned(), number);
        cells.extend(line.responses.iter().map(value));
        cells.extend(found.trace.iter().flat_map(|t| t.cells(at, number)));
        cells.push(line.status.word().into());
        if let Status::Failed { step, class, cause } = &line.status {
            let text = format!("{step}: {class}: {cause}");
            cells.push(shortened(&text));
        } else if failed {
            cells.push(String::new());
        }
        cells
    };
    let lines = study.points.iter().zip(&found.lines).take(most);
    let lines = lines.enumerate().map(line);
    let lines: Vec<Vec<String>> = lines.collect();
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    table(&heads, &lines, &numbers)
}

/// The table as CSV: the same bytes as the file beside the workflow.
pub fn as_csv(found: &Table<'_>) -> String {
    let study = found.study;
    let mut heads = vec!["point".to_owned()];
    heads.extend(study.variables.iter().map(|v| head(&v.name, &v.unit)));
    heads.extend(study.responses.iter().map(|r| head(&r.name, &r.unit)));
    heads.extend(found.trace.iter().flat_map(|t| t.heads(study)));
    heads.extend(["status", "failed_step", "failure_class", "cause"].map(str::to_owned));
    if !study.samples.is_empty() {
        heads.push("seed".into());
    }
    heads.extend(
        found
            .steps
            .iter()
            .map(|s| format!("key_{}", study.steps[*s])),
    );
    let row = |cells: Vec<String>| {
        let cells: Vec<String> = cells.iter().map(|c| csv_text(c)).collect();
        cells.join(",") + "\n"
    };
    let mut out = row(heads);
    for (at, (point, line)) in study.points.iter().zip(&found.lines).enumerate() {
        let mut cells = vec![point.name.clone()];
        cells.extend(point.values.iter().map(shown));
        cells.extend(
            line.responses
                .iter()
                .map(|v| v.map(si_number).unwrap_or_default()),
        );
        cells.extend(found.trace.iter().flat_map(|t| t.cells(at, si_number)));
        cells.push(line.status.word().into());
        match &line.status {
            Status::Failed { step, class, cause } => {
                cells.extend([step.clone(), class.to_string(), cause.clone()]);
            }
            _ => cells.extend([const { String::new() }; 3]),
        }
        if !study.samples.is_empty() {
            cells.push(found.seeds());
        }
        cells.extend(line.keys.iter().cloned());
        out += &row(cells);
    }
    out
}

/// The table for programs.
fn as_json(session: &Session<'_>, found: &Table<'_>) -> Value {
    let study = found.study;
    let points = study.points.iter().zip(&found.lines).map(|(point, line)| {
        let names = study.variables.iter().map(|v| v.name.clone());
        let value = |v: &StudyValue| match v {
            StudyValue::Number { shown, .. } => json!(shown),
            StudyValue::Text(t) => json!(t),
            StudyValue::Bool(b) => json!(b),
        };
        let values: serde_json::Map<String, Value> =
            names.zip(point.values.iter().map(value)).collect();
        let names = study.responses.iter().map(|r| r.name.clone());
        let responses: serde_json::Map<String, Value> =
            names.zip(line.responses.iter().map(|v| json!(v))).collect();
        let names = found.steps.iter().map(|s| study.steps[*s].clone());
        let keys: serde_json::Map<String, Value> =
            names.zip(line.keys.iter().map(|k| json!(k))).collect();
        let failure = match &line.status {
            Status::Failed { step, class, cause } => {
                json!({"step": step, "class": class.to_string(), "cause": cause})
            }
            _ => Value::Null,
        };
        json!({"point": point.name, "values": values, "responses": responses,
            "status": line.status.word(), "failure": failure, "keys": keys})
    });
    let points: Vec<Value> = points.collect();
    let variables = study
        .variables
        .iter()
        .map(|v| json!({"name": v.name, "unit": v.unit, "si_unit": v.si_unit}));
    let responses = (study.responses.iter()).map(|r| r.told(&study.steps));
    let samples = study
        .samples
        .iter()
        .map(|s| json!({"method": s.0, "count": s.1, "seed": s.2}));
    json!({
        "workflow": session.workflow.name,
        "variables": variables.collect::<Vec<_>>(), "responses": responses.collect::<Vec<_>>(),
        "samples": samples.collect::<Vec<_>>(), "points": points,
        "optimisation": found.trace.as_ref().and_then(|t| t.told(found.study)),
    })
}
