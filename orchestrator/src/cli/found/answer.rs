//! What became of a point of a study, and whether a method can be told of it.

use crate::engine::FailureClass;
use plyflow_study::optimise::Outcome;
use plyflow_study::{Problem, Value};
use plyflow_workflow::resolved::{Optimisation, Study};

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
        class: FailureClass,
        /// Why, in one line.
        cause: String,
    },
    /// Something of it has not been run yet.
    NotRun,
}

impl Status {
    /// Whether a step of it has failed.
    pub fn is_failed(&self) -> bool {
        matches!(self, Self::Failed { .. })
    }

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

/// Whether a method can be told what became of a point.
pub fn is_answer(line: &Line) -> bool {
    match &line.status {
        Status::Done => true,
        Status::Failed { .. } => no_answer(line).is_none(),
        Status::NotRun => false,
    }
}

/// Whether what happened to a step when it ran last is an answer, so that it is not run again.
pub fn is_answer_of(label: &str, reason: &str) -> bool {
    FailureClass::of(reason) != FailureClass::Machine && label.contains('@')
}

/// Why a failure tells nothing of a point, if it does not.
pub fn no_answer(line: &Line) -> Option<String> {
    match &line.status {
        Status::Failed {
            step,
            class: FailureClass::Machine,
            cause,
        } => Some(format!(
            "{step}: {cause}\na failure of the machine tells nothing of a point, so that the optimisation stopped"
        )),
        // Its name has no values in it: it is the same at every point.
        Status::Failed { step, cause, .. } if !step.contains('@') => Some(format!(
            "{step}: {cause}\nthis step is the same at every point, so that the optimisation stopped"
        )),
        _ => None,
    }
}

/// What a method is told of a point.
///
/// # Errors
/// When the objective or a constraint cannot be computed.
pub fn outcome(
    o: &Optimisation,
    study: &Study,
    point: &[Value],
    line: &Line,
) -> Result<Outcome, Problem> {
    match line.status {
        Status::Done => o
            .outcome(study, point, &line.responses)
            .map_err(|e| e.problem),
        _ => Ok(Outcome::Failed),
    }
}
