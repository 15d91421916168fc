//! Acts on what the core decides: hands jobs to an executor, commits artifacts, keeps the journal.

use super::compare::NotCompared;
use super::core::{Effect, Event, Id, Output, State};
use super::executor::{Executor, Outcome, Report};
use super::session::Session;
use super::shown::{Observer, Summary, Update};
use crate::plan::Key;
use crate::store::Known;
use camino::Utf8PathBuf;
use plyflow_model::job::{Message, Record};
use std::io;
use std::time::Duration;

/// How often an artifact is made again within one run: a disk that damages it each time is beyond help.
const AGAIN: u32 = 2;

/// How long to wait for reports before looking at the journal and the display again.
const BEAT: Duration = Duration::from_millis(200);

/// Why what a worker left does not become visible.
#[derive(Debug, thiserror::Error)]
enum Refused {
    #[error("the instance has no key")]
    NoKey,
    #[error("the instance was not started")]
    NotStarted,
    #[error(
        "malformed artifact: plugin '{plugin}' did not declare its collection, though its manifest promises one"
    )]
    NoCollection { plugin: String },
    #[error("no artifact: {0}")]
    NoArtifact(io::Error),
    #[error("malformed artifact: it has {size} bytes and its record says {told}")]
    Size { size: u64, told: u64 },
    #[error(transparent)]
    NotCompared(#[from] NotCompared),
    #[error("the artifact cannot be put into the store {root}: {source}; {and}")]
    NotPlaced {
        root: Utf8PathBuf,
        source: io::Error,
        and: Aside,
    },
}

/// What became of an artifact that the store does not take.
#[derive(Debug, thiserror::Error)]
enum Aside {
    #[error("it is whole, lies in {0} and is taken from there by the next run")]
    Kept(Utf8PathBuf),
    #[error("nor can it be put aside: {0}")]
    Lost(io::Error),
}

impl Session<'_> {
    /// Runs what [`Session::look`] found missing, and all that follows. `interrupts` counts the user's
    /// wishes to stop: one asks the workers, two kill them.
    ///
    /// # Errors
    /// When the store or the executor is broken; failures of steps are in the summary.
    pub fn execute(
        mut self,
        executor: &mut dyn Executor,
        observer: &mut dyn Observer,
        interrupts: &dyn Fn() -> u32,
    ) -> io::Result<(Self, Summary)> {
        if !self.pending.is_empty() {
            self.journal.started();
            std::fs::create_dir_all(self.folder.tmp())?;
        }
        let (mut reports, mut heard) = (Vec::new(), 0);
        loop {
            while let Some(effect) = self.pending.pop_front() {
                match effect {
                    Effect::Start {
                        id,
                        threads,
                        attempt,
                    } => {
                        if !self.inputs_are_whole(id, observer) {
                            continue;
                        }
                        observer.update(&self.core, id, &Update::Started { threads, attempt });
                        self.heard.remove(&id);
                        if let Some(reason) = self.changed(id) {
                            self.fail(id, &reason, observer);
                            continue;
                        }
                        let task = self.task(id, threads);
                        executor.submit(task);
                    }
                    Effect::Lend { id, threads } => executor.lend(id, threads),
                    Effect::Cancel(id) => executor.cancel(id, false),
                    Effect::Look(_) | Effect::Skip { .. } => {}
                }
            }
            // A full disk is no reason to stop steps that run: the artifacts need no journal, and it is tried again until the end.
            let _ = self.journal.tick();
            if self.core.is_finished() {
                break;
            }
            executor.wait(Some(BEAT), &mut reports)?;
            for report in reports.drain(..) {
                if let Report::Ended { id, .. } = &report
                    && let Some(files) = executor.files(*id)
                {
                    self.jobs.insert(*id, files);
                }
                self.heed(report, observer);
            }
            observer.tick();
            let wishes = interrupts();
            if wishes > heard {
                self.interrupt(heard == 0, executor, observer);
                heard = wishes;
            }
        }
        self.finish(observer)
    }

    fn finish(mut self, observer: &mut dyn Observer) -> io::Result<(Self, Summary)> {
        observer.end();
        let mut summary = std::mem::take(&mut self.summary);
        summary.skipped = self
            .core
            .instances()
            .iter()
            .filter(|i| !matches!(i.state, State::Done { .. } | State::Failed))
            .count();
        if summary.executed + summary.failures.len() > 0 {
            self.journal
                .ended(summary.executed as u64, summary.failures.len() as u64);
        }
        self.journal.flush()?;
        // Left empty by all workers that ended well; what a killed one left is worthless.
        let _ = std::fs::remove_dir_all(self.folder.tmp());
        Ok((self, summary))
    }

    fn interrupt(&mut self, first: bool, executor: &mut dyn Executor, observer: &mut dyn Observer) {
        self.summary.interrupted = true;
        if first {
            let effects = self.core.handle(Event::Interrupt);
            return self.take(effects, observer);
        }
        for (id, instance) in self.core.instances().iter().enumerate() {
            if matches!(instance.state, State::Running(_)) {
                executor.cancel(id, true);
            }
        }
    }

    /// What of an instance is no longer as it was when the run began.
    fn changed(&mut self, id: Id) -> Option<String> {
        let step = self.core.instances()[id].step;
        let changed = self.unchanged.first_changed(&self.workflow.steps[step])?;
        // A library may have rotted without a trace for who looks at dates alone: the next run reads it.
        let _ = std::fs::remove_file(self.store.plugins());
        Some(changed)
    }

    /// When an instance is first heard of it has loaded its libraries and read its files: if they have changed since it was started, nobody
    /// knows which it has. It is stopped now, when nothing is lost yet.
    fn look_again(&mut self, id: Id) {
        if !self.heard.contains_key(&id) {
            let changed = self.changed(id);
            if changed.is_some() {
                self.pending.push_back(Effect::Cancel(id));
            }
            self.heard.insert(id, changed);
        }
    }

    /// Why an instance that has ended says nothing for its key: what it was to load was exchanged before it was heard of, which for one
    /// that has nothing to say is now; or what it had loaded was written over, and it crashed.
    fn changed_under(&mut self, id: Id, outcome: &Outcome) -> Option<String> {
        let crashed = matches!(outcome, Outcome::Signal(_) | Outcome::Silent(_));
        let changed = match self.heard.remove(&id) {
            Some(Some(reason)) => Some(reason),
            Some(None) if !crashed => None,
            _ => self.changed(id),
        }?;
        match outcome {
            Outcome::Done(_) | Outcome::Cancelled => Some(changed),
            Outcome::Failed { .. } | Outcome::Signal(_) | Outcome::Silent(_) => {
                Some(format!("{changed} (it ended so: {})", outcome.reason()))
            }
            // Neither has to do with what it loaded.
            Outcome::TimedOut(_) | Outcome::NotStarted(_) => None,
        }
    }

    fn heed(&mut self, report: Report, observer: &mut dyn Observer) {
        if let Report::Message { id, .. } = &report {
            self.look_again(*id);
        }
        if let Report::Ended { id, outcome } = &report
            && let Some(reason) = self.changed_under(*id, outcome)
        {
            return self.fail(*id, &reason, observer);
        }
        match report {
            Report::Message { id, message } => match &message {
                Message::Progress(p) => observer.update(&self.core, id, &Update::Progress(p)),
                Message::Log { level, text } => {
                    observer.update(
                        &self.core,
                        id,
                        &Update::Log {
                            level: *level,
                            text,
                        },
                    );
                }
                Message::Done { .. } | Message::Failed { .. } => {}
            },
            Report::Ended {
                id,
                outcome: Outcome::Done(record),
            } => match self.accept(id, &record) {
                Ok(known) => self.succeed(id, &record, known, observer),
                Err(refused) => self.fail(id, &refused.to_string(), observer),
            },
            Report::Ended {
                id,
                outcome: Outcome::Cancelled,
            } => {
                let effects = self.core.handle(Event::Cancelled { id });
                observer.update(&self.core, id, &Update::Stopped);
                self.take(effects, observer);
            }
            Report::Ended { id, outcome } => self.fail(id, &outcome.reason(), observer),
        }
    }

    /// Checks what the worker left and makes it visible.
    fn accept(&mut self, id: Id, record: &Record) -> Result<Known, Refused> {
        let instance = &self.core.instances()[id];
        let key: Key = instance.key.ok_or(Refused::NoKey)?;
        let (artifact, beside) = self.jobs.remove(&id).ok_or(Refused::NotStarted)?;
        let step = &self.core.graph().steps[instance.step];
        if step.collection && record.collection.is_none() {
            let plugin = self.workflow.steps[instance.step].plugin.name.clone();
            return Err(Refused::NoCollection { plugin });
        }
        let size = std::fs::metadata(&artifact)
            .map_err(Refused::NoArtifact)?
            .len();
        if size != record.bytes {
            let told = record.bytes;
            return Err(Refused::Size { size, told });
        }
        if self.options.compare.contains(&instance.step)
            && let Some(known) = self.compare(id, &artifact, &beside)?
        {
            return Ok(known);
        }
        let lasting = record.is_lasting();
        if let Err(source) = self.store.commit(&key, &artifact, &beside, lasting) {
            let kept = self
                .store
                .keep_unplaced(&self.folder, &key, &artifact, &beside);
            return Err(Refused::NotPlaced {
                root: self.store.root().to_owned(),
                source,
                and: match kept {
                    Ok(()) => Aside::Kept(self.folder.unplaced()),
                    Err(e) => Aside::Lost(e),
                },
            });
        }
        // Only now: until here they were all that a killed engine, or a power cut, would have left of the work.
        let label = self.core.label(id);
        let _ = std::fs::remove_dir_all(self.folder.checkpoints(&label, &key));
        let _ = std::fs::remove_file(self.folder.forced(&label, &key));
        Ok(Known {
            bytes: size,
            labels: record.collection.clone(),
            stamp: self.store.look(&key).ok().map(|seen| seen.stamp),
        })
    }

    fn succeed(&mut self, id: Id, record: &Record, known: Known, observer: &mut dyn Observer) {
        self.summary.executed += 1;
        self.sound.made(id);
        self.costs.insert(id, record.cost);
        let output = Output {
            labels: known.labels.clone(),
        };
        self.note(id, known);
        let effects = self.core.handle(Event::Finished { id, output });
        observer.update(&self.core, id, &Update::Finished(record));
        self.take(effects, observer);
    }

    fn fail(&mut self, id: Id, reason: &str, observer: &mut dyn Observer) {
        if let Some((artifact, record)) = self.jobs.remove(&id) {
            let _ = std::fs::remove_file(artifact);
            let _ = std::fs::remove_file(record);
        }
        let effects = self.core.handle(Event::Failed { id });
        let again = self.core.instances()[id].state != State::Failed;
        observer.update(&self.core, id, &Update::Failed { reason, again });
        if !again {
            let instance = &self.core.instances()[id];
            let step = &self.core.graph().steps[instance.step];
            if let (true, Some(key)) = (self.writing, instance.key) {
                // Whoever forces it now wants it from the start.
                let _ = std::fs::remove_file(self.folder.forced(&self.core.label(id), &key));
                let who = (step.name.as_str(), instance.item.as_slice());
                self.journal.failed(who, key, reason);
            }
            let failure = self.failure(id, reason);
            self.summary.failures.push(failure);
        }
        self.take(effects, observer);
    }

    /// Reads the inputs of an instance that is to start. When one is not what was written it is made again, and this instance waits.
    /// True: it may start.
    fn inputs_are_whole(&mut self, id: Id, observer: &mut dyn Observer) -> bool {
        let mut givers: Vec<Id> = (self.core.instances()[id].inputs.iter())
            .map(|(_, giver)| *giver)
            .collect();
        givers.sort_unstable();
        givers.dedup();
        let mut lost = Vec::new();
        for giver in givers {
            if let Err(flaw) = self.read_whole(giver) {
                self.forget(giver);
                let text = flaw.text().to_owned();
                self.lose(giver, flaw, true, observer);
                if self.sound.again.get(&giver).is_some_and(|n| *n > AGAIN) {
                    let reason = format!(
                        "its input cannot be kept: made again {AGAIN} times in this run, and each time {text}; look after the disk and the memory of this machine"
                    );
                    self.fail(id, &reason, observer);
                    return false;
                }
                lost.push(giver);
            }
        }
        if lost.is_empty() {
            return true;
        }
        let effects = self.core.handle(Event::Lost {
            reader: Some(id),
            ids: lost,
        });
        self.take(effects, observer);
        false
    }
}
