//! One line per event, for files and pipes.

use super::pace::{Pace, duration_text, progress_text};
use super::told::main_results;
use crate::engine::core::{Core, Id};
use crate::engine::{Observer, Update};
use plyflow_model::job::{LogLevel, Progress};
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// Progress of a step is told at most this often.
const PACE: Duration = Duration::from_secs(10);

/// Writes to standard error.
#[derive(Default)]
pub struct Lines {
    running: HashMap<Id, (Pace, Instant)>,
}

fn say(text: &str) {
    // A closed standard error must not stop a run.
    crate::said::warn(&format!("{text}\n"));
}

impl Lines {
    fn progress(&mut self, core: &Core<'_>, id: Id, p: &Progress) {
        let Some((pace, told)) = self.running.get_mut(&id) else {
            return;
        };
        let now = Instant::now();
        let left = pace.left(p.fraction, now);
        if told.elapsed() >= PACE {
            *told = now;
            let text = progress_text(p, left);
            let percent = 100.0 * p.fraction;
            say(&format!(
                "         {} {percent:.0} %: {text}",
                core.label(id)
            ));
        }
    }
}

impl Observer for Lines {
    fn update(&mut self, core: &Core<'_>, id: Id, update: &Update<'_>) {
        match update {
            Update::Cached => {}
            Update::Damaged { what } => say(&format!("damaged  {}: {what}", core.label(id))),
            Update::Started { threads, attempt } => {
                let now = Instant::now();
                self.running.insert(id, (Pace::default(), now));
                let s = if *threads == 1 { "" } else { "s" };
                let again = if *attempt > 1 {
                    format!(", attempt {attempt}")
                } else {
                    String::new()
                };
                say(&format!(
                    "start    {} ({threads} thread{s}{again})",
                    core.label(id)
                ));
            }
            Update::Progress(p) => self.progress(core, id, p),
            Update::Log { level, text } if *level <= LogLevel::Warn => {
                let word = if *level == LogLevel::Error {
                    "error   "
                } else {
                    "warning "
                };
                say(&format!("{word} {}: {text}", core.label(id)));
            }
            Update::Log { .. } => {}
            Update::Finished(record) => {
                self.running.remove(&id);
                let wall = duration_text(record.cost.wall_seconds);
                let told = main_results(record);
                say(&format!("finish   {} in {wall}{told}", core.label(id)));
            }
            Update::Failed { reason, again } => {
                let next = if *again { " (trying again)" } else { "" };
                say(&format!("FAILED   {}: {reason}{next}", core.label(id)));
            }
            Update::Stopped => say(&format!("stopped  {}", core.label(id))),
            Update::Skipped { cause } => {
                say(&format!(
                    "skip     {} because {} failed",
                    core.label(id),
                    core.label(*cause)
                ));
            }
        }
    }
}
