//! What a run does with an instance: how it differs from what the last run knew of it, and what it cost then.

use crate::cli::args::Workflow;
use crate::cli::typed::command;
use crate::engine::core::{Id, State};
use crate::engine::{Session, input_keys};
use crate::plan::{Change, Ingredients, Key, changes};
use plyflow_model::job::Cost;

/// What a run does with an instance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fate {
    /// It is in the store.
    Cached,
    /// It runs.
    Run,
    /// Earlier steps decide.
    Unknown,
}

impl Fate {
    /// That of an instance by where it stands.
    pub fn of(state: State) -> Self {
        match state {
            State::Done { .. } => Self::Cached,
            State::Unkeyed => Self::Unknown,
            _ => Self::Run,
        }
    }

    /// In a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Cached => "cached",
            Self::Run => "run",
            Self::Unknown => "unknown",
        }
    }
}

/// How an instance differs from the last run.
pub enum Difference {
    /// The journal knows no earlier key.
    Never,
    /// The key is the same; only the artifact is missing.
    Gone,
    /// These parts of the key.
    Changed(Vec<Change>),
}

/// Compares an instance with what the last run knew of it.
pub fn difference(session: &Session<'_>, id: Id) -> Difference {
    let core = &session.core;
    let instance = &core.instances()[id];
    let step = &core.graph().steps[instance.step];
    let Some(last) = session.journal.last(&step.name, &instance.item) else {
        return Difference::Never;
    };
    if Some(last) == instance.key {
        return Difference::Gone;
    }
    let Some((ingredients, inputs)) = session.journal.detail(&last) else {
        return Difference::Never;
    };
    let now = input_keys(core, id);
    Difference::Changed(changes(
        (&ingredients, &inputs),
        (
            &Ingredients::of(&session.workflow.steps[instance.step]),
            &now,
        ),
    ))
}

/// What the artifact of a key cost, if the store has its record.
pub fn cost_of(session: &Session<'_>, key: &Key) -> Option<Cost> {
    session.store.read_record(key).ok().map(|r| r.cost)
}

/// What the items of a step that fans out over the collections of `givers` cost when they ran last, added up.
pub fn cost_of_items(session: &Session<'_>, step: &str, givers: &[Id]) -> Option<Cost> {
    let mut sum: Option<Cost> = None;
    for giver in givers {
        let mut item = session.core.instances()[*giver].item.clone();
        item.push(0);
        while let Some(cost) = session
            .journal
            .last(step, &item)
            .and_then(|key| cost_of(session, &key))
        {
            let sum = sum.get_or_insert_default();
            sum.wall_seconds += cost.wall_seconds;
            sum.cpu_seconds += cost.cpu_seconds;
            if let Some(index) = item.last_mut() {
                *index += 1;
            }
        }
    }
    sum
}

/// What to say when the store has nothing of a workflow as it is now, `given` by the user, or nothing of some of its `steps` (of all if there are none).
pub fn nothing_yet(session: &Session<'_>, steps: &[String], given: &Workflow) -> String {
    let core = &session.core;
    let again = command(given);
    let named: Vec<usize> = steps.iter().flat_map(|s| core.graph().named(s)).collect();
    let wanted = |id: &Id| steps.is_empty() || named.contains(&core.instances()[*id].step);
    let of_these = || (0..core.instances().len()).filter(wanted);
    if let Some(f) = of_these().find_map(|id| session.failed_before(id)) {
        let (label, reason) = (f.label, f.reason.replace('\n', "\n  "));
        return format!(
            "nothing of it is in the store: {label} failed last time:\n  {reason}\nrun it again with: {again}"
        );
    }
    if let Some((id, flaw)) = of_these().find_map(|id| Some((id, session.flaw(id)?))) {
        return format!(
            "nothing of it can be shown: {}: {}; make it again with: {again}",
            core.label(id),
            flaw.text()
        );
    }
    if of_these().all(|id| matches!(difference(session, id), Difference::Never)) {
        let what = if steps.is_empty() {
            "nothing has been run yet; start with"
        } else {
            "nothing of these steps is in the store; run them with"
        };
        return format!("{what}: {again}");
    }
    format!(
        "nothing of what was run is of this workflow as it is now: parameters, files or plugins have changed since, or artifacts are gone. \
         What changed: {}; run it again: {again}",
        again.replacen("plyflow run", "plyflow plan", 1)
    )
}
