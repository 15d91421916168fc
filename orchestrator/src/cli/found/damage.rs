//! What commands say and end with when something in the store is not what was written.

use super::change::{Difference, difference};
use crate::cli::args::Workflow;
use crate::cli::typed::command;
use crate::engine::core::{Id, State};
use crate::engine::{Depth, Session};
use crate::exit;
use crate::progress::Quiet;
use crate::said::{Done, Stop, warn};
use crate::store::Flaw;

/// Reads what is about to be printed of the instances `of`; what is not as it was written is set aside and told. Gives all that was found
/// damaged.
pub fn recheck(session: &mut Session<'_>, of: &dyn Fn(Id) -> bool, depth: Depth) -> Vec<String> {
    for text in session.told() {
        warn(&format!("plyflow: {text}\n"));
    }
    session.recheck(of, depth, &mut Quiet);
    session.damages()
}

/// Tells which instances ran as they are now and are not shown because somebody has removed their artifacts.
pub fn tell_gone(session: &Session<'_>) {
    let core = &session.core;
    let is_gone = |id: &Id| {
        let done = matches!(core.instances()[*id].state, State::Done { .. });
        let flawed = !matches!(session.flaw(*id), None | Some(Flaw::Gone));
        let ran = matches!(difference(session, *id), Difference::Gone);
        !done && !flawed && ran && session.failed_before(*id).is_none()
    };
    let all = (0..core.instances().len()).filter(is_gone);
    let labels: Vec<String> = all.map(|id| core.label(id)).collect();
    if !labels.is_empty() {
        let labels = labels.join(", ");
        warn(&format!(
            "plyflow: not shown, because the artifact is not in the store any more: {labels}\n"
        ));
    }
}

/// What a command ends with that has left out what is damaged.
///
/// # Errors
/// [`exit::DAMAGED`] when something is; else what the command ended with.
pub fn concluded(told: Done, damages: &[String], given: &Workflow) -> Done {
    match damages {
        [] => told,
        all => Err(damaged(all, &command(given))),
    }
}

/// The end of a command that cannot show what it should.
pub fn damaged(all: &[String], again: &str) -> Stop {
    let text = format!(
        "{}\nWhat is damaged is not shown. It is made again by: {again}",
        all.join("\n")
    );
    Stop::new(exit::DAMAGED, text)
}
