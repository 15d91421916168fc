//! Bars on a terminal: one per running step, one for the run.

use super::pace::{Pace, duration_text, progress_text};
use super::told::main_results;
use crate::engine::core::{Core, Id, State};
use crate::engine::{Observer, Update};
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use plyflow_model::job::LogLevel;
use plyflow_model::text::{one_line, safe};
use std::collections::HashMap;
use std::time::{Duration, Instant};

/// A step shorter than this never gets a bar: a thousand short steps must not cost a thousand bars.
const PATIENCE: Duration = Duration::from_millis(300);

/// Bars on standard error.
pub struct Bars {
    all: MultiProgress,
    total: ProgressBar,
    running: HashMap<Id, Running>,
    told: Instant,
    done: u64,
    known: u64,
}

struct Running {
    label: String,
    begun: Instant,
    pace: Pace,
    bar: Option<ProgressBar>,
}

fn style(template: &str) -> ProgressStyle {
    // The templates are constants; a wrong one falls back to the plain style.
    ProgressStyle::with_template(template)
        .unwrap_or_else(|_| ProgressStyle::default_bar())
        .progress_chars("=> ")
}

impl Default for Bars {
    fn default() -> Self {
        let all = MultiProgress::new();
        let total = all.add(ProgressBar::new(1));
        total.set_style(style("{prefix:>16} [{bar:12}] {pos}/{len} {msg}"));
        total.set_prefix("steps");
        let running = HashMap::new();
        Self {
            all,
            total,
            running,
            told: Instant::now(),
            done: 0,
            known: 0,
        }
    }
}

impl Bars {
    fn line(&self, text: &str) {
        let _ = self.all.println(safe(text));
    }

    fn close(&mut self, id: Id) {
        if let Some(Running { bar: Some(bar), .. }) = self.running.remove(&id) {
            bar.finish_and_clear();
            self.all.remove(&bar);
        }
    }

    fn show_total(&mut self) {
        self.total.set_length(self.known);
        self.total.set_position(self.done);
        self.told = Instant::now();
    }

    fn count(&mut self, core: &Core<'_>) {
        if self.told.elapsed() < Duration::from_millis(100) {
            return;
        }
        self.known = core.instances().len() as u64;
        let final_ = core
            .instances()
            .iter()
            .filter(|i| i.state.is_final())
            .count();
        self.done = final_ as u64;
        let waits = core.instances().iter().any(|i| i.state == State::Unkeyed);
        self.total
            .set_message(if waits { "known so far" } else { "" });
        self.show_total();
    }
}

impl Observer for Bars {
    fn update(&mut self, core: &Core<'_>, id: Id, update: &Update<'_>) {
        match update {
            Update::Cached => {}
            Update::Damaged { what } => {
                self.line(&format!("{:>16} DAMAGED: {what}", core.label(id)));
            }
            Update::Started { .. } => {
                let label = one_line(&core.label(id)).into_owned();
                self.running.insert(
                    id,
                    Running {
                        label,
                        begun: Instant::now(),
                        pace: Pace::default(),
                        bar: None,
                    },
                );
            }
            Update::Progress(p) => {
                if let Some(running) = self.running.get_mut(&id) {
                    let left = running.pace.left(p.fraction, Instant::now());
                    if let Some(bar) = &running.bar {
                        bar.set_position((1000.0 * p.fraction.clamp(0.0, 1.0)) as u64);
                        bar.set_message(one_line(&progress_text(p, left)).into_owned());
                    }
                }
            }
            Update::Log { level, text } if *level <= LogLevel::Warn => {
                self.line(&format!("{}: {text}", core.label(id)));
            }
            Update::Log { .. } => {}
            Update::Finished(record) => {
                let shown = self.running.get(&id).is_some_and(|r| r.bar.is_some());
                self.close(id);
                if shown {
                    let told = main_results(record);
                    let wall = duration_text(record.cost.wall_seconds);
                    self.line(&format!("{:>16} done in {wall}{told}", core.label(id)));
                }
            }
            Update::Failed { reason, again } => {
                self.close(id);
                let next = if *again { " (trying again)" } else { "" };
                self.line(&format!("{:>16} FAILED: {reason}{next}", core.label(id)));
            }
            Update::Stopped => self.close(id),
            Update::Skipped { .. } => {}
        }
        self.count(core);
    }

    fn tick(&mut self) {
        for running in self.running.values_mut() {
            if running.bar.is_none() && running.begun.elapsed() > PATIENCE {
                let bar = self.all.insert_before(&self.total, ProgressBar::new(1000));
                bar.set_style(style("{prefix:>16} [{bar:12}] {percent:>3} % {wide_msg}"));
                bar.set_prefix(running.label.clone());
                bar.tick();
                running.bar = Some(bar);
            }
        }
    }

    fn end(&mut self) {
        let ids: Vec<Id> = self.running.keys().copied().collect();
        for id in ids {
            self.close(id);
        }
        self.total.finish_and_clear();
    }
}
