//! What an end means: each class of failure has a rule of its own, and every rule has a bound.

use super::folder::{Past, Verdict};
use super::needs::Shape;
use super::slurm::{Limits, Row};
use crate::engine::{Outcome, WANTED_MEMORY};
use plyflow_model::job::FailureKind;

/// Allocations that may end under one piece of work, as long as it leaves checkpoints.
const MOST_CONTINUED: u32 = 1000;
/// Allocations in a row that may end under it without one.
const MOST_BARREN: u32 = 2;
/// Attempts of which nothing may be heard.
const MOST_LOST: u32 = 3;
/// Times that it may get twice the memory.
const MOST_GROWN: u32 = 3;

/// What is done after an attempt has ended.
#[derive(Debug, Clone, PartialEq)]
pub enum Rule {
    /// It is told to the engine: the step's own doing.
    Report(Outcome),
    /// It runs again, in this shape, and the user is told why.
    Again {
        /// What came before.
        past: Past,
        /// Where.
        shape: Shape,
        /// For the user.
        why: String,
    },
}

fn failed(message: String) -> Rule {
    Rule::Report(Outcome::Failed {
        kind: FailureKind::Error,
        message,
    })
}

/// What follows from a verdict. `kept`: there is a checkpoint to go on from; `wished`: the engine had asked for the stop.
pub fn of_verdict(
    verdict: &Verdict,
    past: &Past,
    shape: &Shape,
    limits: &Limits,
    kept: bool,
    wished: bool,
) -> Rule {
    match &verdict.outcome {
        Outcome::Cancelled if wished => Rule::Report(Outcome::Cancelled),
        Outcome::Cancelled if verdict.told => continued(
            past,
            shape,
            kept,
            &format!("its allocation on {} ended", verdict.host),
        ),
        Outcome::Cancelled
        | Outcome::Failed {
            kind: FailureKind::Cancelled,
            ..
        } => lost(
            past,
            shape,
            &format!("somebody stopped it on {}", verdict.host),
        ),
        Outcome::Failed { message, .. } if message.starts_with(WANTED_MEMORY) => grown(
            past,
            shape,
            limits,
            &format!("it wanted more memory than {} MiB", shape.memory),
        ),
        Outcome::Signal(name) if name == "SIGKILL" => {
            let why = format!(
                "it was killed on {}, as it is when memory runs out",
                verdict.host
            );
            grown(past, shape, limits, &why)
        }
        Outcome::NotStarted(text) => lost(
            past,
            &without(shape, &verdict.host),
            &format!("it could not be started on {}: {text}", verdict.host),
        ),
        other => Rule::Report(other.clone()),
    }
}

/// What follows when the allocation of an attempt is gone and there is no verdict. `row`: what Slurm told of it last.
pub fn of_silence(
    row: Option<&Row>,
    past: &Past,
    shape: &Shape,
    limits: &Limits,
    kept: bool,
) -> Rule {
    let Some(row) = row else {
        return lost(past, shape, "its allocation is gone, and nobody tells why");
    };
    let of = format!("allocation {} on {}", row.job, row.nodes);
    match row.state.as_str() {
        "OUT_OF_MEMORY" => grown(past, shape, limits, &format!("{of} ran out of memory")),
        "TIMEOUT" | "DEADLINE" => continued(
            past,
            shape,
            kept,
            &format!("the wall-clock time of {of} is over"),
        ),
        "PREEMPTED" => continued(past, shape, true, &format!("{of} was preempted")),
        "NODE_FAIL" | "BOOT_FAIL" => lost(
            past,
            &without(shape, &row.nodes),
            &format!("the node of {of} failed"),
        ),
        "CANCELLED" => lost(past, shape, &format!("somebody cancelled {of}")),
        state => lost(past, shape, &format!("{of} ended as {state}")),
    }
}

/// What follows when the allocation of an attempt gives no sign of life any more, though Slurm calls it running.
pub fn of_hanging(node: &str, past: &Past, shape: &Shape) -> Rule {
    lost(
        past,
        &without(shape, node),
        &format!("its allocation on {node} gives no sign of life"),
    )
}

/// What follows when an artifact is not seen as it was written, though time enough has passed.
pub fn of_damage(host: &str, past: &Past, shape: &Shape) -> Rule {
    lost(
        past,
        shape,
        &format!("what it made on {host} is not as it was written"),
    )
}

fn without(shape: &Shape, node: &str) -> Shape {
    let mut shape = shape.clone();
    if !node.is_empty() && !shape.without.iter().any(|n| n == node) {
        shape.without.push(node.to_owned());
        shape.without.sort_unstable();
    }
    shape
}

fn continued(past: &Past, shape: &Shape, kept: bool, why: &str) -> Rule {
    let past = Past {
        continued: past.continued + 1,
        barren: if kept { 0 } else { past.barren + 1 },
        ..past.clone()
    };
    if past.barren > MOST_BARREN || past.continued > MOST_CONTINUED {
        return failed(format!(
            "it needs longer than an allocation has ({} s), and leaves no checkpoint to go on from ({} attempts); raise `walltime` for its plugin in the profile",
            shape.walltime,
            past.barren.max(1)
        ));
    }
    let on = if kept {
        "goes on from its checkpoint"
    } else {
        "begins again, as it left no checkpoint"
    };
    Rule::Again {
        past,
        shape: shape.clone(),
        why: format!("{why}; it {on}"),
    }
}

fn lost(past: &Past, shape: &Shape, why: &str) -> Rule {
    let past = Past {
        lost: past.lost + 1,
        ..past.clone()
    };
    if past.lost > MOST_LOST {
        // In these words `FailureClass` knows a failure of the machine.
        return Rule::Report(Outcome::NotStarted(format!(
            "{why}; {MOST_LOST} attempts before it ended so too"
        )));
    }
    Rule::Again {
        past,
        shape: shape.clone(),
        why: format!("{why}; it is queued again"),
    }
}

fn grown(past: &Past, shape: &Shape, limits: &Limits, why: &str) -> Rule {
    let past = Past {
        grown: past.grown + 1,
        ..past.clone()
    };
    match shape.with_more_memory(limits) {
        Some(more) if past.grown <= MOST_GROWN => Rule::Again {
            past,
            why: format!("{why}; it is queued again with {} MiB", more.memory),
            shape: more,
        },
        _ => failed(format!(
            "{why}, and gets no more: give it more with `memory` in the profile or `resources: {{memory: ..}}` of the step, or let it compute less"
        )),
    }
}

#[cfg(test)]
#[path = "judge_tests.rs"]
mod tests;
