//! The table at the end of a run in the terminal.

use crate::family::Family;
use crate::input::{Expectation, Instance, ReportInput, Verdict, label};
use crate::page::expectations::{expected_text, got_text, is_notable};
use crate::page::verdict;
use crate::read::{Comparison, Material, Study};
use crate::told::{in_short, reasons, table as limit_table};
use crate::units::{bytes, duration, fixed, number, quantity};
use camino::Utf8Path;
use plyflow_model::text::one_line;

/// Tables are shown up to this many rows.
const LONGEST: usize = 40;
/// Warnings that are shown.
const WARNINGS: usize = 12;
/// More items of a step than this are shown as one row.
const ITEMS: usize = 3;

/// What the run found, in plain text: verdict, warnings, defects, expected results with verdicts (all results of
/// workflows without expectations), costs, and the path of the report. Ends with a line break.
#[must_use]
pub fn summary(input: &ReportInput, report: Option<&Utf8Path>) -> String {
    let material = Material::read(input, false);
    let mut blocks: Vec<String> = limit_block(input).into_iter().collect();
    let large = input.family.as_ref().is_some_and(Family::is_large);
    // The table of a study tells of its points; one line for each run of each would bury it.
    for study in material.studies.iter().filter(|_| !large) {
        let (_, text) = verdict::of_study(study);
        let title = if study.title.is_empty() {
            &input.workflow
        } else {
            &study.title
        };
        if !text.is_empty() {
            blocks.push(format!("{}: {text}\n", one_line(title)));
        }
        blocks.push(zone_table(study));
        blocks.extend(study.comparison.as_ref().map(|c| defect_table(c, study)));
    }
    blocks.push(warning_lines(&verdict::warnings(input, &material, false)));
    blocks.push(result_table(input));
    blocks.push(cost_table(&input.instances, large));
    blocks.extend(report.map(|path| format!("report: {path}\n")));
    blocks.retain(|b| !b.is_empty());
    blocks.join("\n")
}

/// Whether the part is good: the verdict, each limit with what was found, and why something is not judged.
fn limit_block(input: &ReportInput) -> Option<String> {
    let (_, text) = in_short(&input.judged)?;
    let (head, rows) = limit_table(&input.judged);
    let more = rows.len().saturating_sub(LONGEST);
    let mut out = format!("the part {text}\n");
    out += &table(&head, &rows[..rows.len() - more], &[]);
    if more > 0 {
        out += &format!("{more} more limits are in the report\n");
    }
    for line in reasons(&input.judged) {
        out += &(line + "\n");
    }
    Some(out)
}

fn warning_lines(warnings: &[(String, String)]) -> String {
    let mut out = String::new();
    let kinds = verdict::alike(warnings);
    for kind in kinds.iter().take(WARNINGS) {
        let (label, text) = kind.said[0];
        out += &match kind.said.len() - 1 {
            0 => format!("warning: {label}: {text}\n"),
            more => format!("warning: {label} (and {more} like it): {text}\n"),
        };
    }
    if kinds.len() > WARNINGS {
        let more: usize = kinds[WARNINGS..].iter().map(|k| k.said.len()).sum();
        out += &format!("{more} more warnings are in the report\n");
    }
    out
}

fn zone_table(study: &Study) -> String {
    let mm = |v: f64| fixed(v * 1e3, 0);
    let zones = study.zones.as_deref().unwrap_or_default();
    let rows: Vec<Vec<String>> = (zones.iter())
        .map(|z| {
            let [x0, y0, x1, y1] = z.bounds;
            let place = format!(
                "x {} to {} mm, y {} to {} mm",
                mm(x0),
                mm(x1),
                mm(y0),
                mm(y1)
            );
            vec![z.name.clone(), place, z.plies.join(", ")]
        })
        .collect();
    table(&["zone", "place", "plies"], &rows, &[])
}

fn defect_table(c: &Comparison, study: &Study) -> String {
    let rows: Vec<Vec<String>> = c
        .told
        .local_defects()
        .take(LONGEST)
        .map(|d| {
            let mut row = vec![
                d.id.clone(),
                d.ply.clone(),
                d.found.kind.name().to_owned(),
                if d.found.is_wrinkle() {
                    quantity(d.length, "m", 3)
                } else {
                    String::new()
                },
                quantity(d.found.amplitude, "m", 3),
                quantity(d.found.area, "m2", 3),
            ];
            let confirmed = study.confirmed.as_ref();
            row.extend(
                confirmed.map(|_| study.confirmed_text(&d.id).unwrap_or_default().to_owned()),
            );
            row
        })
        .collect();
    let mut head = vec!["defect", "ply", "type", "length", "amplitude", "area"];
    head.extend(study.confirmed.as_ref().map(|_| "run in other ways"));
    let mut text = table(&head, &rows, &[3, 4, 5]);
    if !text.is_empty() && !c.others.is_empty() {
        let others = c.others.join(", ");
        text += &format!("defects as in {}; not listed: those of {others}\n", c.label);
    }
    text
}

fn result_table(input: &ReportInput) -> String {
    if !input.expectations.is_empty() {
        let many = input.family.is_some() && input.expectations.len() > LONGEST;
        let told = |e: &&Expectation| !many || is_notable(e);
        let met = input.expectations.iter().filter(|e| !told(e)).count();
        let rows: Vec<Vec<String>> = (input.expectations.iter().filter(told))
            .map(|e| {
                let place = format!("{}.{}", label(&e.step, &e.item), e.result);
                let verdict = match e.verdict() {
                    Verdict::Met => "ok",
                    Verdict::Missed => "missed",
                    Verdict::NotJudged => "not judged",
                };
                vec![place, got_text(e), expected_text(e), verdict.into()]
            })
            .collect();
        let mut text = table(&["result", "value", "expected", "verdict"], &rows, &[1]);
        if met > 0 {
            text += &format!("{met} more expectations are met, at single points\n");
        }
        return text;
    }
    let rows: Vec<Vec<String>> = (input.instances.iter())
        .flat_map(|i| i.record.results.iter().map(move |r| (i, r)))
        .map(|(i, r)| {
            vec![
                format!("{}.{}", i.label(), r.name),
                quantity(r.value, &r.unit, 6),
            ]
        })
        .collect();
    if rows.len() > LONGEST {
        String::new()
    } else {
        table(&["result", "value"], &rows, &[1])
    }
}

/// `together`: all points of a study in one row of a step.
fn cost_table(instances: &[Instance], together: bool) -> String {
    let mut steps: Vec<(&str, Vec<&Instance>)> = Vec::new();
    for i in instances {
        let step = if together { i.base() } else { &i.step };
        match steps.iter_mut().find(|(name, _)| *name == step) {
            Some((_, items)) => items.push(i),
            None => steps.push((step, vec![i])),
        }
    }
    let mut rows = Vec::new();
    for (name, items) in steps.iter().take(LONGEST) {
        if items.len() > ITEMS {
            let name = format!("{name} x {}, times added up", items.len());
            rows.push(cost_row(name, items));
        } else {
            rows.extend(items.iter().map(|i| cost_row(i.label(), &[*i])));
        }
    }
    if instances.len() > 1 {
        rows.push(cost_row(
            "all, times added up".into(),
            &instances.iter().collect::<Vec<_>>(),
        ));
    }
    let head = ["step", "wall", "cpu", "threads", "memory", "element-steps"];
    table(&head, &rows, &[1, 2, 3, 4, 5])
}

/// Times are summed over the items; threads, memory and rate are the largest.
fn cost_row(name: String, items: &[&Instance]) -> Vec<String> {
    let cost = || items.iter().map(|i| i.record.cost);
    let rates = (items.iter())
        .flat_map(|i| &i.record.results)
        .filter(|r| r.name == "element_cycle_rate");
    let rate = rates.map(|r| r.value).fold(0.0, f64::max);
    vec![
        name,
        duration(cost().map(|c| c.wall_seconds).sum()),
        duration(cost().map(|c| c.cpu_seconds).sum()),
        cost().map(|c| c.threads).max().unwrap_or(0).to_string(),
        bytes(cost().map(|c| c.peak_memory).max().unwrap_or(0)),
        if rate > 0.0 {
            format!("{} M/s", number(rate * 1e-6, 3))
        } else {
            String::new()
        },
    ]
}

/// Columns padded to their widest cell; those in `right` are aligned to the right. Empty without rows.
fn table(head: &[&str], rows: &[Vec<String>], right: &[usize]) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let head: Vec<String> = head.iter().map(|h| (*h).to_owned()).collect();
    let lines = || std::iter::once(&head).chain(rows);
    let used: Vec<usize> = (0..head.len())
        .filter(|at| rows.iter().any(|r| !r[*at].is_empty()))
        .collect();
    let mut out = String::new();
    for row in lines() {
        let mut line = String::new();
        for at in &used {
            let width = lines().map(|r| r[*at].chars().count()).max().unwrap_or(0);
            let pad = " ".repeat(width - row[*at].chars().count());
            line += &if right.contains(at) {
                pad + &row[*at]
            } else {
                row[*at].clone() + &pad
            };
            line += "  ";
        }
        out += line.trim_end();
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn empty_columns_are_left_out_and_the_rest_lines_up() {
        let rows = vec![
            vec!["a".to_owned(), String::new(), "1".to_owned()],
            vec!["bcd".to_owned(), String::new(), "22".to_owned()],
        ];
        assert_eq!(
            table(&["x", "y", "n"], &rows, &[2]),
            "x     n\na     1\nbcd  22\n"
        );
        assert_eq!(table(&["x"], &[], &[]), "");
    }
}
