//! `results`: the named numbers of what the store has, beside what the workflow expects.

use super::args::{Format, ResultsArgs};
use super::found::change::nothing_yet;
use super::found::damage::{concluded, recheck, tell_gone};
use super::found::row::{Row, Verdict};
use super::found::rows::{Found, records, rows};
use super::open::{Opened, open};
use super::report::{beside, input};
use super::table::{bytes, csv_text, table};
use crate::engine::core::Id;
use crate::engine::{Depth, Session};
use crate::exit;
use crate::progress::duration_text;
use crate::said::{Done, Stop, print};
use plyflow_model::job::Record;
use plyflow_model::workflow::LimitOn;
use plyflow_report::{
    Finding, Judged, ReportInput, failing, in_short, in_users_units, limit_table, reasons,
};
use plyflow_workflow::resolved::Expectation;
use serde_json::json;

/// Digits of numbers in tables.
const DIGITS: i32 = 6;

/// What the expectation says, in words: its numbers in the unit in which the result is told.
fn expectation_text(e: &Expectation, unit: &str) -> String {
    let number = |v: f64| in_users_units(v, unit, DIGITS).0;
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

/// A table of numbers, in the units in which forming is talked about, as at the end of a run.
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
        let shown = r.value.map(|v| in_users_units(v, &r.unit, DIGITS));
        let (_, unit) = in_users_units(0.0, &r.unit, DIGITS);
        vec![
            place,
            name,
            shown.map_or("(absent)".into(), |(number, _)| number),
            unit,
            r.expected
                .as_ref()
                .map(|e| expectation_text(e, &r.unit))
                .unwrap_or_default(),
            r.verdict().map_or("", Verdict::word).to_owned(),
        ]
    };
    let lines: Vec<Vec<String>> = rows.iter().map(line).collect();
    table(
        &["step", "result", "value", "unit", "expected", "verdict"],
        &lines,
        &[2],
    )
}

/// How the limits fared, and why some are not judged; empty without limits.
fn limits_text(judged: &[Judged]) -> String {
    let Some((_, text)) = in_short(judged) else {
        return String::new();
    };
    let (head, lines) = limit_table(judged);
    let mut out = format!("the part {text}\n{}", table(&head, &lines, &[]));
    for line in reasons(judged) {
        out += &(line + "\n");
    }
    out + "\n"
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

/// A finding as JSON, in SI.
fn finding_json(f: &Finding) -> serde_json::Value {
    json!({"defect": f.name, "ply": f.ply, "zone": f.zone, "at": f.at, "value": f.value, "by": f.by})
}

fn limit_json(j: &Judged) -> serde_json::Value {
    json!({
        "of": j.of, "place": j.place, "limit": j.on.name(), "value": j.limit, "unit": j.on.unit(), "verdict": j.verdict.word(),
        "worst": j.worst.as_ref().map(finding_json), "beyond": j.beyond.iter().map(finding_json).collect::<Vec<_>>(),
        "by": j.by, "notes": j.notes,
    })
}

fn as_json(
    session: &Session<'_>,
    rows: &[Row],
    records: &[(Id, Record)],
    judged: &[Judged],
) -> serde_json::Value {
    let results: Vec<_> = rows
        .iter()
        .map(|r| {
            let e = r.expected.as_ref();
            json!({
                "step": r.step, "item": r.item, "result": r.name, "value": r.value, "unit": r.unit,
                "measured": r.measured, "verdict": r.verdict().map(Verdict::word),
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
    let limits: Vec<_> = judged.iter().map(limit_json).collect();
    json!({"workflow": session.workflow.name, "results": results, "steps": costs, "limits": limits})
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

fn as_csv(rows: &[Row], judged: &[Judged]) -> String {
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
            r.verdict().map_or("", Verdict::word).to_owned(),
            csv_text(e.and_then(|e| e.source.as_deref()).unwrap_or_default()),
        ];
        out += &(cells.join(",") + "\n");
    }
    for j in judged {
        out += &(limit_cells(j).join(",") + "\n");
    }
    out
}

/// A limit as a row of the table for programs: its step is `limits`, its item the place for which it holds.
fn limit_cells(j: &Judged) -> [String; 12] {
    let of = [
        Some(j.of.as_str()).filter(|of| !of.is_empty()),
        j.place.as_deref(),
    ];
    let of: Vec<&str> = of.into_iter().flatten().collect();
    let bound = |is_least| match (j.on == LimitOn::ShearNegative) == is_least {
        true => j.limit.to_string(),
        false => String::new(),
    };
    let worst = j.worst.as_ref();
    [
        "limits".into(),
        csv_text(&of.join("/")),
        j.on.name().into(),
        worst.map(|f| f.value.to_string()).unwrap_or_default(),
        csv_text(j.on.unit()),
        "false".into(),
        String::new(),
        String::new(),
        bound(true),
        bound(false),
        j.verdict.word().into(),
        csv_text(&worst.map(Finding::place).unwrap_or_default()),
    ]
}

/// `plyflow results`.
///
/// # Errors
/// [`exit::EXPECTATION`] with `--check` when an expectation or a limit is missed or not judged; [`exit::DAMAGED`] when a number is not shown because its record is
/// damaged.
pub fn results(args: &ResultsArgs) -> Done {
    let opened = open(&args.workflow)?;
    opened.step_indices(&args.step)?;
    let mut session = opened.look()?;
    // Numbers are printed from records; the front and the limits read artifacts.
    let limited = opened.workflow.limits.is_some() && args.step.is_empty();
    let depth = if args.front || limited {
        Depth::Artifacts
    } else {
        Depth::Records
    };
    let damages = recheck(&mut session, &|_| true, depth);
    tell_gone(&session);
    let mut records = records(&session);
    let mut rows = rows(&session, &records);
    let judged = match limited {
        true => told_by(args, &opened, &session, records.clone()).judged,
        false => Vec::new(),
    };
    if args.study {
        let told = super::study::tell(args, &session, &records);
        let told = checked(told, args.check, &rows, &judged);
        return concluded(told, &damages, &args.workflow);
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
        Format::Json => print(&format!(
            "{:#}\n",
            as_json(&session, &rows, &records, &judged)
        )),
        Format::Csv => print(&as_csv(&rows, &judged)),
        Format::Table if records.is_empty() && !damages.is_empty() => Ok(()),
        Format::Table if records.is_empty() => {
            let text = nothing_yet(&session, &args.step, &args.workflow);
            print(&format!("{text}\n"))
        }
        Format::Table => print(&format!(
            "{}{}\n{}",
            limits_text(&judged),
            results_table(&rows),
            cost_table(&session, &records)
        )),
    };
    let told = checked(told, args.check, &rows, &judged);
    concluded(told, &damages, &args.workflow)
}

/// What a report would be made of.
fn told_by(
    args: &ResultsArgs,
    opened: &Opened,
    session: &Session<'_>,
    records: Vec<(Id, Record)>,
) -> ReportInput {
    let found = Found {
        records,
        rows: Vec::new(),
    };
    let page = beside(&opened.workflow.file, &[]);
    input(
        opened,
        session,
        &found,
        &[],
        (&args.workflow, &[][..], page.as_path()),
    )
}

/// `plyflow results --front`, of the comparisons among `records`.
fn front(
    args: &ResultsArgs,
    opened: &Opened,
    session: &Session<'_>,
    records: Vec<(Id, Record)>,
) -> Done {
    let ways = plyflow_report::ways(&told_by(args, opened, session, records));
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
pub fn checked(told: Done, asked: bool, rows: &[Row], judged: &[Judged]) -> Done {
    if asked {
        check(rows, judged).and(told)
    } else {
        told
    }
}

/// Ends with the code for missed expectations if an expectation is missed or a limit exceeded, or could not be judged.
fn check(rows: &[Row], judged: &[Judged]) -> Done {
    let mut parts = Vec::new();
    for (verdict, why) in [(Verdict::Missed, ""), (Verdict::NotJudged, " (no value)")] {
        let found = rows.iter().filter(|r| r.verdict() == Some(verdict));
        let titles: Vec<String> = found.map(Row::title).collect();
        if let n @ 1.. = titles.len() {
            let s = if n == 1 { "" } else { "s" };
            let titles = titles.join(", ");
            parts.push(format!(
                "{n} expectation{s} {}{why}: {titles}",
                verdict.word()
            ));
        }
    }
    parts.extend(failing(judged));
    if parts.is_empty() {
        return Ok(());
    }
    Err(Stop::new(exit::EXPECTATION, parts.join("; ")))
}

#[cfg(test)]
#[path = "results_tests.rs"]
mod tests;
