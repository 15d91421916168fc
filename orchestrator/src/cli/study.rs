//! The table of a study: a row for each of its points, whatever became of it.

use super::args::{Format, ResultsArgs};
use super::results::csv_text;
use super::table::{number, table};
use crate::engine::Session;
use crate::engine::class_of;
use crate::engine::core::{Id, State};
use crate::exit;
use crate::said::{Done, Stop, print};
use plyflow_model::job::Record;
use plyflow_model::units::si_number;
use plyflow_model::workflow::ResponseOf;
use plyflow_workflow::resolved::{ResponseFrom, Study, StudyPoint, StudyResponse, StudyValue};
use serde_json::{Value, json};
use std::collections::{BTreeSet, HashMap};

/// Where the expectations over a study stand in lists of results.
pub const STEP: &str = "study";

/// Points that a summary shows.
const SHOWN: usize = 20;

/// Characters of a cause that a table shows.
const CAUSE: usize = 80;

/// What became of a point.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Status {
    /// All its steps are there.
    Done,
    /// A step of it has failed.
    Failed {
        /// The step.
        step: String,
        /// The class of the failure.
        class: &'static str,
        /// Why, in one line.
        cause: String,
    },
    /// Something of it has not been run yet.
    NotRun,
}

impl Status {
    /// In a word.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed { .. } => "failed",
            Self::NotRun => "not run",
        }
    }
}

/// A row of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// What became of the point.
    pub status: Status,
    /// For each response: its value (SI); `None`: there is none.
    pub responses: Vec<Option<f64>>,
    /// For each step that a response is of: the keys of its artifacts, hex, of several items one behind the other.
    pub keys: Vec<String>,
}

/// The table.
pub struct Table<'s> {
    /// The study.
    pub study: &'s Study,
    /// Steps that responses are of, each once, as positions among the steps of the file.
    pub steps: Vec<usize>,
    /// A row for each point.
    pub lines: Vec<Line>,
    /// Of an optimisation: how far it has come with each point.
    pub trace: Option<super::optimise::Trace>,
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
            trace: super::optimise::Trace::of(session, study, &lines),
            lines,
        }
    }

    /// How many points have this status.
    pub fn count(&self, word: &str) -> usize {
        self.lines
            .iter()
            .filter(|l| l.status.word() == word)
            .count()
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
                    class: class_of(reason),
                    cause: super::run::first_line(reason).to_owned(),
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

/// What a study bears of the failures of a run, in words; `None`: it does not.
pub fn borne(session: &Session<'_>) -> Option<String> {
    let study = session.workflow.study.as_ref()?;
    if study.optimisation.is_some() {
        return Some("what fails at a point is an answer to an optimisation\n".into());
    }
    let most = study.at_most_failures? as usize;
    let core = &session.core;
    let failed: BTreeSet<usize> = (0..core.instances().len())
        .filter(|id| core.instances()[*id].state == State::Failed)
        .map(|id| core.instances()[id].step)
        .collect();
    let is_failed = |p: &&StudyPoint| p.steps.iter().any(|s| failed.contains(s));
    let n = study.points.iter().filter(is_failed).count();
    let points = study.points.len();
    (n <= most).then(|| {
        format!(
            "{n} of {points} points failed; the study bears {most} (`at_most_failures`), so that this run ends well\n"
        )
    })
}

// Expectations over the points.

// How the table is shown.

/// A name with its unit, as in the head of a table: `angle [deg]`.
pub fn head(name: &str, unit: &str) -> String {
    match unit {
        "" | "1" => name.to_owned(),
        unit => format!("{name} [{unit}]"),
    }
}

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
    for word in ["done", "failed", "not run"] {
        match table.count(word) {
            0 => {}
            n => parts.push(format!("{n} {word}")),
        }
    }
    parts.join(", ") + "\n"
}

/// What an optimisation has led to; empty for a study.
fn best(table: &Table<'_>) -> String {
    let trace = table.trace.as_ref();
    trace.map_or_else(String::new, |t| t.in_words(table))
}

/// The begin of a text.
pub fn shortened(text: &str) -> String {
    match text.char_indices().nth(CAUSE) {
        Some((end, _)) => format!("{}…", text[..end].trim_end()),
        None => text.to_owned(),
    }
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
    let failed = found.count("failed") > 0;
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
                cells.extend([step.clone(), (*class).to_owned(), cause.clone()]);
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
                json!({"step": step, "class": class, "cause": cause})
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
        "optimisation": found.trace.as_ref().and_then(|t| t.told(found)),
    })
}
