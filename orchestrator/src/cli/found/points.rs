//! The table of a study: a row for each of its points, whatever became of it.

use super::answer::{Line, Status};
use super::trace::Trace;
use crate::cli::table::first_line;
use crate::engine::core::{Id, State};
use crate::engine::{FailureClass, Session};
use plyflow_model::job::Record;
use plyflow_model::workflow::ResponseOf;
use plyflow_workflow::resolved::{ResponseFrom, Study, StudyResponse};
use std::collections::HashMap;

/// The table.
pub struct Table<'s> {
    /// The study.
    pub study: &'s Study,
    /// Steps that responses are of, each once, as positions among the steps of the file.
    pub steps: Vec<usize>,
    /// A row for each point.
    pub lines: Vec<Line>,
    /// Of an optimisation: how far it has come with each point.
    pub trace: Option<Trace>,
}

impl<'s> Table<'s> {
    /// Reads what the store has of every point. `records`: of all instances that are done.
    ///
    /// # Panics
    /// When the workflow is no study; the caller has asked.
    pub fn read(session: &Session<'s>, records: &[(Id, Record)]) -> Self {
        let study = session.workflow.study.as_ref().expect("a study");
        let mut steps: Vec<usize> = Vec::new();
        for response in &study.responses {
            if let Some(step) = response.step().filter(|s| !steps.contains(s)) {
                steps.push(step);
            }
        }
        let records: HashMap<Id, &Record> = records.iter().map(|(id, r)| (*id, r)).collect();
        let by_step = by_step(session);
        let mut known: HashMap<usize, Fate> = HashMap::new();
        let lines = study.points.iter().enumerate().map(|(at, point)| {
            let fates: Vec<usize> = point.steps.clone();
            for step in &fates {
                known
                    .entry(*step)
                    .or_insert_with(|| Fate::of(session, *step, &by_step[*step]));
            }
            let status = status(fates.iter().map(|s| &known[s]));
            let is_done = matches!(status, Status::Done);
            let value = |r: &StudyResponse| match &r.from {
                ResponseFrom::Step { step, result, of } => {
                    let step = point.steps[*step];
                    let whole = known[&step] == Fate::Done;
                    whole
                        .then(|| response(result, *of, &by_step[step], &records))
                        .flatten()
                }
                // A point that has not run, or has failed, has no row of numbers: nobody is to think that it has.
                ResponseFrom::Variables { values, .. } => is_done.then(|| values[at]),
            };
            // What other steps of a failed point had come to when it failed is chance, and a search does not go on with them.
            let told = study.optimisation.is_none() || !matches!(status, Status::Failed { .. });
            let value = |r: &StudyResponse| told.then(|| value(r)).flatten();
            let keys = |step: &usize| {
                let ids = by_step[point.steps[*step]].iter();
                let keys = ids.filter_map(|id| session.core.instances()[*id].key);
                keys.map(|k| k.hex()).collect::<Vec<_>>().join(" ")
            };
            Line {
                status,
                responses: study.responses.iter().map(value).collect(),
                keys: steps.iter().map(keys).collect(),
            }
        });
        let lines: Vec<Line> = lines.collect();
        Self {
            study,
            steps,
            trace: Trace::of(session, study, &lines),
            lines,
        }
    }

    /// How many points there are of which `is` holds.
    pub fn count(&self, is: impl Fn(&Status) -> bool) -> usize {
        self.lines.iter().filter(|l| is(&l.status)).count()
    }

    /// Seeds of the samples, in words.
    pub fn seeds(&self) -> String {
        let seeds = self.study.samples.iter().map(|s| s.2.to_string());
        seeds.collect::<Vec<_>>().join(" ")
    }
}

/// What became of a step at a point.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Fate {
    Done,
    Failed(String, String),
    NotRun,
}

impl Fate {
    fn of(session: &Session<'_>, step: usize, ids: &[Id]) -> Self {
        let core = &session.core;
        // `--until` may have left it out.
        if !core.graph().steps[step].wanted {
            return Self::NotRun;
        }
        if let Some(failure) = ids.iter().find_map(|id| session.failed_before(*id)) {
            return Self::Failed(failure.label, failure.reason);
        }
        let done = |id: &Id| matches!(core.instances()[*id].state, State::Done { .. });
        match ids.iter().all(done) && core.hidden_by(step).is_empty() {
            true => Self::Done,
            false => Self::NotRun,
        }
    }
}

fn status<'f>(fates: impl Iterator<Item = &'f Fate>) -> Status {
    let mut all = Status::Done;
    for fate in fates {
        match fate {
            Fate::Failed(step, reason) => {
                return Status::Failed {
                    step: step.clone(),
                    class: FailureClass::of(reason),
                    cause: first_line(reason).to_owned(),
                };
            }
            Fate::NotRun => all = Status::NotRun,
            Fate::Done => {}
        }
    }
    all
}

/// `result` of the items of a step, and what is taken `of` them.
fn response(
    result: &str,
    of: Option<ResponseOf>,
    ids: &[Id],
    records: &HashMap<Id, &Record>,
) -> Option<f64> {
    let mut values = Vec::with_capacity(ids.len());
    for id in ids {
        let results = &records.get(id)?.results;
        // What depends on the machine has no place in a table that is the same on every one.
        let found = results.iter().find(|n| n.name == result && !n.measured)?;
        values.push(found.value);
    }
    let sum = || values.iter().sum::<f64>();
    match of {
        None => values.first().copied().filter(|_| values.len() == 1),
        Some(ResponseOf::Sum) => Some(sum()),
        _ if values.is_empty() => None,
        Some(ResponseOf::Mean) => Some(sum() / values.len() as f64),
        Some(ResponseOf::Max) => values.iter().copied().reduce(f64::max),
        Some(ResponseOf::Min) => values.iter().copied().reduce(f64::min),
    }
}

/// The instances of each step, by their items.
fn by_step(session: &Session<'_>) -> Vec<Vec<Id>> {
    let mut by_step: Vec<Vec<Id>> = vec![Vec::new(); session.core.graph().steps.len()];
    for (id, instance) in session.core.instances().iter().enumerate() {
        by_step[instance.step].push(id);
    }
    for ids in &mut by_step {
        ids.sort_by(|a, b| {
            session.core.instances()[*a]
                .item
                .cmp(&session.core.instances()[*b].item)
        });
    }
    by_step
}
