//! `results`: the named numbers of what the store has, beside what the workflow expects.

use super::args::{Format, ResultsArgs};
use super::damage::{concluded, recheck, tell_gone};
use super::open::{Opened, open};
use super::plan::nothing_yet;
use super::report::{Found, input};
use super::table::{bytes, number, table};
use crate::engine::core::{Id, State};
use crate::engine::{Depth, Session};
use crate::exit;
use crate::progress::duration_text;
use crate::said::{Done, Stop, print};
use plyflow_model::job::Record;
use plyflow_workflow::resolved::Expectation;
use serde_json::json;

/// Verdicts on what is expected.
pub const OK: &str = "ok";
pub const MISSED: &str = "missed";
const NOT_JUDGED: &str = "not judged";

/// One number, or one expectation without a number.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Step.
    pub step: String,
    /// Labels of its item.
    pub item: Vec<String>,
    /// Name of the number.
    pub name: String,
    /// Value (SI); absent when the step did not report it.
    pub value: Option<f64>,
    /// Unit.
    pub unit: String,
    /// Whether it depends on the machine.
    pub measured: bool,
    /// What is expected of it.
    pub expected: Option<Expectation>,
}

impl Row {
    /// What it is about, in a list.
    fn title(&self) -> String {
        let e = self.expected.as_ref();
        if self.step == super::study::STEP {
            return self.name.clone();
        }
        if e.is_some_and(|e| !e.mean_over.is_empty()) {
            format!("{} ({})", self.name, self.step)
        } else {
            let item = match self.item.is_empty() {
                true => String::new(),
                false => format!("[{}]", self.item.join(",")),
            };
            format!("{}{item}.{}", self.step, self.name)
        }
    }

    /// `ok`, `missed`, or `not judged` without a value; only when something is expected.
    pub fn verdict(&self) -> Option<&'static str> {
        let e = self.expected.as_ref()?;
        let Some(value) = self.value else {
            return Some(NOT_JUDGED);
        };
        let near = e.value.is_none_or(|x| {
            // Without a tolerance the same number is meant, up to rounding in its text.
            (value - x).abs() <= e.tolerance.unwrap_or(1e-9 * x.abs())
        });
        let inside = e.minimum.is_none_or(|m| value >= m) && e.maximum.is_none_or(|m| value <= m);
        Some(if near && inside { OK } else { MISSED })
    }
}

/// What the expectation says, in words.
fn expectation_text(e: &Expectation) -> String {
    let mut parts = Vec::new();
    if let Some(v) = e.value {
        match e.tolerance {
            Some(t) => parts.push(format!("{} +- {}", number(v), number(t))),
            None => parts.push(number(v)),
        }
    }
    if let Some(m) = e.minimum {
        parts.push(format!(">= {}", number(m)));
    }
    if let Some(m) = e.maximum {
        parts.push(format!("<= {}", number(m)));
    }
    parts.join(", ")
}

/// Records of all instances that the store has, in the order of the workflow.
pub fn records(session: &Session<'_>) -> Vec<(Id, Record)> {
    let core = &session.core;
    let mut ids: Vec<Id> = (0..core.instances().len())
        .filter(|id| matches!(core.instances()[*id].state, State::Done { .. }))
        .collect();
    ids.sort_by_key(|id| {
        (
            core.instances()[*id].step,
            core.instances()[*id].item.clone(),
        )
    });
    let read = |id: Id| {
        let key = core.instances()[id].key?;
        Some((id, session.store.read_record(&key).ok()?))
    };
    ids.into_iter().filter_map(read).collect()
}

/// All numbers and expectations.
pub fn rows(session: &Session<'_>, records: &[(Id, Record)]) -> Vec<Row> {
    let core = &session.core;
    let expectations = &session.workflow.expectations;
    let mut met = vec![false; expectations.len()];
    let mut rows = Vec::new();
    for (id, record) in records {
        let step = &core.graph().steps[core.instances()[*id].step].name;
        for result in &record.results {
            let row = Row {
                step: step.clone(),
                item: core.item_labels(*id),
                name: result.name.clone(),
                value: Some(result.value),
                unit: result.unit.clone(),
                measured: result.measured,
                expected: None,
            };
            let before = rows.len();
            // A number may be held against several sources: one row each.
            for (at, e) in expectations.iter().enumerate() {
                let each = e.mean_over.is_empty();
                if each && e.step == *step && e.result == result.name {
                    met[at] = true;
                    rows.push(Row {
                        expected: Some(e.clone()),
                        ..row.clone()
                    });
                }
            }
            if rows.len() == before {
                rows.push(row);
            }
        }
    }
    // What `--until` leaves out is not expected either.
    let left_out =
        |name: &String| (core.graph().steps.iter()).any(|s| s.name == *name && !s.wanted);
    for (e, met) in expectations.iter().zip(met) {
        if left_out(&e.step) || e.mean_over.iter().any(left_out) {
            continue;
        }
        if !e.mean_over.is_empty() {
            let progress = e.mean_over.iter().map(|s| Progress::of(session, s));
            rows.extend(mean(e, &rows, &progress.collect::<Vec<_>>()));
            continue;
        }
        let progress = Progress::of(session, &e.step);
        let unfinished = progress.unfinished.iter().map(|item| Row {
            item: item.clone(),
            ..absent(e)
        });
        rows.extend(unfinished);
        let told = met || !progress.unfinished.is_empty();
        if progress.hidden || (!told && !progress.is_nothing()) {
            rows.push(absent(e));
        }
    }
    rows.extend(super::study_expect::rows(session, records));
    rows
}

/// How far the instances of a step are.
struct Progress {
    /// Number of its instances that are known.
    count: usize,
    /// Labels of the items that have no artifact.
    unfinished: Vec<Vec<String>>,
    /// Whether a collection that is not there yet may bring more.
    hidden: bool,
}

impl Progress {
    fn of(session: &Session<'_>, name: &str) -> Self {
        let core = &session.core;
        let is_of = |id: &Id| core.graph().steps[core.instances()[*id].step].name == name;
        let ids: Vec<Id> = (0..core.instances().len()).filter(is_of).collect();
        let done = |id: &Id| matches!(core.instances()[*id].state, State::Done { .. });
        let at = core.graph().steps.iter().position(|s| s.name == name);
        Self {
            count: ids.len(),
            unfinished: (ids.iter().filter(|id| !done(id)))
                .map(|id| core.item_labels(*id))
                .collect(),
            hidden: at.is_some_and(|at| !core.hidden_by(at).is_empty()),
        }
    }

    /// Whether its collection is there and empty: no zone, or passes that have come to rest. Then there is nothing to expect.
    fn is_nothing(&self) -> bool {
        self.count == 0 && !self.hidden
    }

    fn is_finished(&self) -> bool {
        self.unfinished.is_empty() && !self.hidden
    }
}

/// An expectation whose number is not there.
fn absent(e: &Expectation) -> Row {
    Row {
        step: e.step.clone(),
        item: vec![],
        name: e.result.clone(),
        value: None,
        unit: e.unit.clone(),
        measured: false,
        expected: Some(e.clone()),
    }
}

/// The mean over steps and their items of what `e` is about; without a value unless every item of every step is finished and every step
/// that has any has reported. `None`: none of the steps has an item. `progress`: of the steps, in their order.
fn mean(e: &Expectation, rows: &[Row], progress: &[Progress]) -> Option<Row> {
    if progress.iter().all(Progress::is_nothing) {
        return None;
    }
    let mut seen: Vec<(&str, &[String])> = Vec::new();
    let mut row = Row {
        step: e.mean_over.join(", "),
        name: format!("mean of {}", e.result),
        ..absent(e)
    };
    let mut sum = 0.0;
    for r in rows.iter().filter(|r| r.name == e.result) {
        let Some(value) = r.value.filter(|_| e.mean_over.contains(&r.step)) else {
            continue;
        };
        // A number that is held against several sources has several rows.
        if !seen.contains(&(&r.step, &r.item)) {
            seen.push((&r.step, &r.item));
            sum += value;
            (row.unit, row.measured) = (r.unit.clone(), row.measured || r.measured);
        }
    }
    let is_whole = |(step, progress): (&String, &Progress)| {
        progress.is_nothing() || (progress.is_finished() && seen.iter().any(|(s, _)| s == step))
    };
    if e.mean_over.iter().zip(progress).all(is_whole) {
        row.value = Some(sum / seen.len() as f64);
    }
    Some(row)
}

/// A table of numbers.
pub fn results_table(rows: &[Row]) -> String {
    let line = |r: &Row| {
        let place = if r.item.is_empty() {
            r.step.clone()
        } else {
            format!("{}[{}]", r.step, r.item.join(","))
        };
        let name = if r.measured {
            format!("{} (measured)", r.name)
        } else {
            r.name.clone()
        };
        vec![
            place,
            name,
            r.value.map_or("(absent)".into(), number),
            if r.unit == "1" {
                String::new()
            } else {
                r.unit.clone()
            },
            r.expected
                .as_ref()
                .map(expectation_text)
                .unwrap_or_default(),
            r.verdict().unwrap_or_default().to_owned(),
        ]
    };
    let lines: Vec<Vec<String>> = rows.iter().map(line).collect();
    table(
        &["step", "result", "value", "unit", "expected", "verdict"],
        &lines,
        &[2],
    )
}

/// A table of what the steps cost.
pub fn cost_table(session: &Session<'_>, records: &[(Id, Record)]) -> String {
    let line = |(id, r): &(Id, Record)| {
        vec![
            session.core.label(*id),
            duration_text(r.cost.wall_seconds),
            duration_text(r.cost.cpu_seconds),
            r.cost.threads.to_string(),
            bytes(r.cost.peak_memory),
            bytes(r.bytes),
        ]
    };
    let lines: Vec<Vec<String>> = records.iter().map(line).collect();
    table(
        &["step", "wall", "cpu", "threads", "memory", "artifact"],
        &lines,
        &[1, 2, 3, 4, 5],
    )
}

fn as_json(session: &Session<'_>, rows: &[Row], records: &[(Id, Record)]) -> serde_json::Value {
    let results: Vec<_> = rows
        .iter()
        .map(|r| {
            let e = r.expected.as_ref();
            json!({
                "step": r.step, "item": r.item, "result": r.name, "value": r.value, "unit": r.unit,
                "measured": r.measured, "verdict": r.verdict(),
                "expected": e.map(|e| json!({"value": e.value, "tolerance": e.tolerance,
                    "minimum": e.minimum, "maximum": e.maximum, "source": e.source})),
            })
        })
        .collect();
    let costs: Vec<_> = records
        .iter()
        .map(|(id, r)| {
            let instance = &session.core.instances()[*id];
            json!({
                "step": session.core.graph().steps[instance.step].name,
                "item": session.core.item_labels(*id), "key": r.key, "kind": r.kind,
                "artifact": instance.key.map(|k| session.store.artifact(&k)),
                "bytes": r.bytes, "cost": r.cost, "host": r.host, "warnings": r.warnings,
            })
        })
        .collect();
    json!({"workflow": session.workflow.name, "results": results, "steps": costs})
}

/// Whether the name of a step in the file, or of one at a point of a study, is among `wanted`.
pub fn is_named(session: &Session<'_>, step: &str, wanted: &[String]) -> bool {
    let is = |name: &str| wanted.iter().any(|w| w == name);
    let of = |name: &str| {
        let steps = &session.core.graph().steps;
        steps
            .iter()
            .find(|s| s.name == name)
            .map(|s| s.base.clone())
    };
    is(step) || of(step).is_some_and(|base| is(&base))
}

/// A text as a cell of CSV.
pub fn csv_text(t: &str) -> String {
    if t.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", t.replace('"', "\"\""))
    } else {
        t.to_owned()
    }
}

fn as_csv(rows: &[Row]) -> String {
    let mut out = String::from(
        "step,item,result,value,unit,measured,expected,tolerance,minimum,maximum,verdict,source\n",
    );
    let value = |v: Option<f64>| v.map(|v| v.to_string()).unwrap_or_default();
    for r in rows {
        let e = r.expected.as_ref();
        let cells = [
            csv_text(&r.step),
            csv_text(&r.item.join("/")),
            csv_text(&r.name),
            value(r.value),
            csv_text(&r.unit),
            r.measured.to_string(),
            value(e.and_then(|e| e.value)),
            value(e.and_then(|e| e.tolerance)),
            value(e.and_then(|e| e.minimum)),
            value(e.and_then(|e| e.maximum)),
            r.verdict().unwrap_or_default().to_owned(),
            csv_text(e.and_then(|e| e.source.as_deref()).unwrap_or_default()),
        ];
        out += &(cells.join(",") + "\n");
    }
    out
}

/// `plyflow results`.
///
/// # Errors
/// [`exit::EXPECTATION`] with `--check` when one is missed or not judged; [`exit::DAMAGED`] when a number is not shown because its record is
/// damaged.
pub fn results(args: &ResultsArgs) -> Done {
    let opened = open(&args.workflow)?;
    opened.step_indices(&args.step)?;
    let mut session = opened.look()?;
    // Numbers are printed from records; the front reads artifacts.
    let depth = if args.front {
        Depth::Artifacts
    } else {
        Depth::Records
    };
    let damages = recheck(&mut session, &|_| true, depth);
    tell_gone(&session);
    let mut records = records(&session);
    let mut rows = rows(&session, &records);
    if args.study {
        let told = super::study::tell(args, &session, &records);
        return concluded(checked(told, args.check, &rows), &damages, &args.workflow);
    }
    if !args.step.is_empty() {
        let over = |r: &Row| r.expected.as_ref().map_or(vec![], |e| e.mean_over.clone());
        let wanted = |step: &str| is_named(&session, step, &args.step);
        rows.retain(|r| wanted(&r.step) || over(r).iter().any(|s| wanted(s)));
        records.retain(|(id, _)| {
            let step = session.core.instances()[*id].step;
            wanted(&session.core.graph().steps[step].name)
        });
    }
    if args.front {
        let told = front(args, &opened, &session, records);
        return concluded(told, &damages, &args.workflow);
    }
    let told = match args.format {
        Format::Json => print(&format!("{:#}\n", as_json(&session, &rows, &records))),
        Format::Csv => print(&as_csv(&rows)),
        Format::Table if records.is_empty() && !damages.is_empty() => Ok(()),
        Format::Table if records.is_empty() => {
            let text = nothing_yet(&session, &args.step, &args.workflow);
            print(&format!("{text}\n"))
        }
        Format::Table => print(&format!(
            "{}\n{}",
            results_table(&rows),
            cost_table(&session, &records)
        )),
    };
    concluded(checked(told, args.check, &rows), &damages, &args.workflow)
}

/// `plyflow results --front`, of the comparisons among `records`.
fn front(
    args: &ResultsArgs,
    opened: &Opened,
    session: &Session<'_>,
    records: Vec<(Id, Record)>,
) -> Done {
    let found = Found {
        records,
        rows: Vec::new(),
    };
    let page = super::report::beside(&opened.workflow.file, &[]);
    let asked = (&args.workflow, &[][..], page.as_path());
    let ways = plyflow_report::ways(&input(opened, session, &found, &[], asked));
    match args.format {
        Format::Json => print(&format!("{:#}\n", super::front::as_json(&ways))),
        Format::Csv => print(&super::front::as_csv(&ways)),
        Format::Table => print(&super::front::as_table(&ways)),
    }
}

/// What a command ends with that has printed what it found and judges it when asked to. Whoever reads along may have gone (`| head`); the
/// exit code tells the verdict all the same.
///
/// # Errors
/// [`exit::EXPECTATION`], else what printing ended with.
pub fn checked(told: Done, asked: bool, rows: &[Row]) -> Done {
    if asked { check(rows).and(told) } else { told }
}

/// Ends with the code for missed expectations if there are any, or any that could not be judged.
fn check(rows: &[Row]) -> Done {
    let mut parts = Vec::new();
    for (verdict, why) in [(MISSED, ""), (NOT_JUDGED, " (no value)")] {
        let found = rows.iter().filter(|r| r.verdict() == Some(verdict));
        let titles: Vec<String> = found.map(Row::title).collect();
        if let n @ 1.. = titles.len() {
            let s = if n == 1 { "" } else { "s" };
            let titles = titles.join(", ");
            parts.push(format!("{n} expectation{s} {verdict}{why}: {titles}"));
        }
    }
    if parts.is_empty() {
        return Ok(());
    }
    Err(Stop::new(exit::EXPECTATION, parts.join("; ")))
}

#[cfg(test)]
#[path = "results_tests.rs"]
mod tests;
