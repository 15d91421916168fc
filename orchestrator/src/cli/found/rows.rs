//! The numbers of what the store has of a workflow, beside what is expected of them.

use super::family;
use super::row::Row;
use crate::engine::Session;
use crate::engine::core::{Id, State};
use plyflow_model::job::Record;
use plyflow_workflow::resolved::Expectation;

/// What the store has of a workflow.
pub struct Found {
    /// Instances and their records, in the order of the workflow.
    pub records: Vec<(Id, Record)>,
    /// Their numbers.
    pub rows: Vec<Row>,
}

impl Found {
    /// Reads all records.
    pub fn read(session: &Session<'_>) -> Self {
        let records = records(session);
        let rows = rows(session, &records);
        Self { records, rows }
    }
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
    rows.extend(family::rows(session, records));
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
pub fn absent(e: &Expectation) -> Row {
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

#[cfg(test)]
#[path = "rows_tests.rs"]
pub(crate) mod tests;
