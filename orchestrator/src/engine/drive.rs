//! Acts on what the core decides: looks into the store, hands jobs to an executor, commits artifacts,
//! keeps the journal.

#[path = "compare.rs"]
mod compare;
#[path = "opening.rs"]
mod opening;
#[path = "sound.rs"]
mod sound;

pub use compare::Compared;
pub use sound::Depth;

use super::core::{Core, Effect, Event, Id, Limits, Output, State};
use super::executor::{Executor, Outcome, Report, Task};
use super::shown::{Failure, Observer, Summary, Update};
use super::unchanged::Unchanged;
use crate::plan::{ByKey, Graph, InputKey, Key};
use crate::store::{ENDING, Early, Flaw, Journal, Known, RunFolder, Seen, Store};
use camino::Utf8PathBuf;
use opening::{look_at_journal, open_for_writing};
use plyflow_model::job::{
    Checkpoints, Cost, DATA_MODEL_VERSION, JOB_VERSION, Job, JobInput, LibraryRef, Message, Record,
};
use plyflow_workflow::resolved::{PluginId, ResolvedWorkflow};
use std::collections::{HashMap, VecDeque};
use std::io;
use std::time::Duration;

/// How long to wait for reports before looking at the journal and the display again.
const BEAT: Duration = Duration::from_millis(200);

/// What a session works with.
pub struct Options {
    /// Cores, memory, policy.
    pub limits: Limits,
    /// Folders searched for components, without links: those whose libraries are trusted whatever their bytes.
    pub search_path: Vec<Utf8PathBuf>,
    /// Run again even what the store has (for steps named here).
    pub force: Vec<usize>,
    /// Run these again too, but only to compare what they make with what the store has.
    pub compare: Vec<usize>,
    /// Time between checkpoints of a running step (s).
    pub checkpoint_interval: f64,
}

/// A workflow, its store and where its instances stand.
pub struct Session<'a> {
    /// The workflow.
    pub workflow: &'a ResolvedWorkflow,
    /// The store.
    pub store: &'a Store,
    /// The decisions.
    pub core: Core<'a>,
    /// The journal.
    pub journal: Journal,
    folder: RunFolder,
    options: Options,
    writing: bool,
    costs: HashMap<Id, Cost>,
    pending: VecDeque<Effect>,
    jobs: HashMap<Id, (Utf8PathBuf, Utf8PathBuf)>,
    serial: u64,
    unchanged: Unchanged,
    /// Running instances that have been heard of since they started, with what of theirs turned out to have changed.
    heard: HashMap<Id, Option<String>>,
    summary: Summary,
    sound: sound::Sound,
    /// What was found when the files of the run were opened, for the user.
    told: Vec<String>,
    /// What was seen of files before anybody asked.
    ahead: HashMap<Key, Seen, ByKey>,
    compared: Vec<(String, Compared)>,
}

impl<'a> Session<'a> {
    /// A session that looks (`writing` false: another may hold the lock) or runs (`writing`: the caller
    /// holds the run's lock).
    ///
    /// # Errors
    /// When the journal cannot be read or written.
    pub fn new(
        workflow: &'a ResolvedWorkflow,
        graph: &'a Graph,
        store: &'a Store,
        options: Options,
        writing: bool,
    ) -> io::Result<Self> {
        Self::new_after(workflow, graph, store, options, writing, None)
    }

    /// As [`Session::new`], with what was read ahead for a session that writes.
    ///
    /// # Errors
    /// As [`Session::new`].
    pub fn new_after(
        workflow: &'a ResolvedWorkflow,
        graph: &'a Graph,
        store: &'a Store,
        options: Options,
        writing: bool,
        early: Option<Early>,
    ) -> io::Result<Self> {
        let folder = store.run(&workflow.name);
        let early = early.and_then(|early| early.finish(&folder.journal()));
        let (scanned, ahead) = match early {
            Some((scanned, ahead)) => (Some(scanned), ahead),
            None => (None, HashMap::default()),
        };
        let (journal, told) = match writing {
            true => open_for_writing(store, &folder, scanned)?,
            false => look_at_journal(&folder)?,
        };
        Ok(Self {
            workflow,
            store,
            core: Core::new(graph, options.limits),
            journal,
            folder,
            options,
            writing,
            costs: HashMap::new(),
            pending: VecDeque::new(),
            jobs: HashMap::new(),
            serial: 0,
            unchanged: Unchanged::default(),
            heard: HashMap::new(),
            summary: Summary::default(),
            sound: sound::Sound::default(),
            told,
            ahead,
            compared: Vec::new(),
        })
    }

    /// Labels of what was made again to be compared, and how it compares.
    pub fn compared(&self) -> &[(String, Compared)] {
        &self.compared
    }

    /// What was found damaged when the files of the run were opened, in words.
    pub fn told(&self) -> &[String] {
        &self.told
    }

    /// Looks up all that can be keyed without running anything.
    pub fn look(&mut self, observer: &mut dyn Observer) {
        let effects = if self.ahead.is_empty() {
            let keys = self.journal.last_keys();
            let (core, store) = (&mut self.core, self.store);
            let (ahead, effects) = store.look_ahead(&keys, || core.start());
            self.ahead = ahead;
            effects
        } else {
            self.core.start()
        };
        self.take(effects, observer);
        self.ahead = HashMap::default();
    }

    /// The folder of this run.
    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

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

    /// Answers lookups at once; leaves the other effects for [`Session::execute`].
    fn take(&mut self, effects: Vec<Effect>, observer: &mut dyn Observer) {
        let mut queue = VecDeque::from(effects);
        while let Some(effect) = queue.pop_front() {
            match effect {
                Effect::Look(id) => {
                    let found = self.find(id, observer);
                    let cached = found.is_some();
                    queue.extend(self.core.handle(Event::Looked { id, found }));
                    if cached {
                        self.summary.cached += 1;
                        observer.update(&self.core, id, &Update::Cached);
                    }
                }
                Effect::Skip { id, cause } => {
                    observer.update(&self.core, id, &Update::Skipped { cause });
                }
                other => self.pending.push_back(other),
            }
        }
    }

    /// Whether the store has the artifact of an instance, whole: as long as nothing has written to its files since they were known to be
    /// so, they are taken for it; else they are read.
    fn find(&mut self, id: Id, observer: &mut dyn Observer) -> Option<Output> {
        let instance = &self.core.instances()[id];
        let (key, step) = (instance.key?, instance.step);
        if self.options.force.contains(&step) || self.options.compare.contains(&step) {
            return None;
        }
        let seen = match self.ahead.remove(&key) {
            Some(seen) => Ok(seen),
            None => self.store.look(&key),
        };
        let known = self.journal.known(&key);
        let known = match (&seen, known) {
            (Ok(seen), Some(k)) if k.stamp == Some(seen.stamp) && k.bytes == seen.bytes => {
                Ok(k.clone())
            }
            (Err(flaw), _) => Err(flaw.clone()),
            (Ok(seen), _) => self.read_whole(id).map(|record| Known {
                bytes: record.bytes,
                labels: record.collection,
                stamp: Some(seen.stamp),
            }),
        };
        let known = match known {
            Ok(known) => known,
            Err(Flaw::Gone) if self.store.has_earlier(&key) => {
                self.lose(id, Flaw::Unsealed, false, observer);
                return None;
            }
            Err(Flaw::Gone) => return None,
            Err(flaw) => {
                self.lose(id, flaw, self.writing, observer);
                return None;
            }
        };
        if self.core.graph().steps[step].collection && known.labels.is_none() {
            return None;
        }
        let labels = known.labels.clone();
        self.note(id, known);
        Some(Output { labels })
    }

    fn note(&mut self, id: Id, artifact: Known) {
        if !self.writing {
            return;
        }
        let instance = &self.core.instances()[id];
        let step = &self.core.graph().steps[instance.step];
        if let Some(key) = instance.key {
            let who = (step.name.as_str(), instance.item.as_slice());
            self.journal.used(who, key, &step.recipe, artifact, || {
                input_keys(&self.core, id)
            });
        }
    }

    /// What an instance cost, when it is done.
    pub fn cost(&mut self, id: Id) -> Cost {
        if let Some(cost) = self.costs.get(&id) {
            return *cost;
        }
        let key = self.core.instances()[id].key;
        let cost = key
            .and_then(|k| self.store.read_record(&k).ok())
            .map(|r| r.cost)
            .unwrap_or_default();
        self.costs.insert(id, cost);
        cost
    }

    fn task(&mut self, id: Id, threads: u32) -> Task {
        let givers = self.core.instances()[id].inputs.clone();
        let step = &self.workflow.steps[self.core.instances()[id].step];
        let mut inputs = Vec::with_capacity(givers.len());
        for (wire, giver) in givers {
            let cost = self.cost(giver);
            let given = &self.core.instances()[giver];
            let from = &self.workflow.steps[given.step];
            inputs.push(JobInput {
                port: step.inputs[wire].port.clone(),
                step: from.in_file().to_owned(),
                kind: from.output_kind.clone(),
                item: given.item.clone(),
                artifact: given
                    .key
                    .map(|k| self.store.artifact(&k))
                    .unwrap_or_default(),
                cost,
            });
        }
        self.serial += 1;
        let tmp = self
            .folder
            .tmp()
            .join(format!("{}-{}", std::process::id(), self.serial));
        let place = |end: &str| Utf8PathBuf::from(format!("{tmp}{end}"));
        let (artifact, record) = (place(ENDING), place(".record.json"));
        self.jobs.insert(id, (artifact.clone(), record.clone()));
        let instance = &self.core.instances()[id];
        let label = self.core.label(id);
        let compared = self.options.compare.contains(&instance.step);
        if let Some(key) = instance.key
            && self.options.force.contains(&instance.step)
        {
            // To run again means from the start: but a forced run that was stopped goes on where it was.
            let forced = self.folder.forced(&label, &key);
            if !forced.exists() {
                let checkpoints = self.folder.checkpoints(&label, &key);
                let _ = std::fs::remove_dir_all(&checkpoints);
                let _ = (
                    forced.parent().map(std::fs::create_dir_all),
                    std::fs::write(&forced, ""),
                );
            }
        }
        let library = |p: &PluginId| library(p, &self.options.search_path);
        let job = Job {
            version: JOB_VERSION,
            step: step.in_file().to_owned(),
            item: instance.item.clone(),
            key: instance.key.map(|k| k.hex()).unwrap_or_default(),
            plugin: library(&step.plugin),
            components: step.components.iter().map(library).collect(),
            search_path: self.options.search_path.clone(),
            parameters: step.parameters.clone(),
            inputs,
            output_kind: step.output_kind.clone(),
            collection: step.collection,
            threads,
            memory_limit: match step.resources.memory {
                0 => self.options.limits.memory_of(threads),
                stated => stated,
            },
            artifact,
            record,
            scratch: place(".scratch"),
            // What is compared is made from the start.
            checkpoints: (instance.key).filter(|_| !compared).map(|key| Checkpoints {
                folder: self.folder.checkpoints(&label, &key),
                interval: self.options.checkpoint_interval,
            }),
            provenance: self.provenance(id),
        };
        let log = self.folder.log(&label);
        // A log of an earlier attempt must not pass for this one's.
        let _ = std::fs::remove_file(&log);
        Task {
            id,
            job,
            time_limit: step.resources.time_limit,
            log,
        }
    }

    /// What the artifact says about its own making; only what its key also holds.
    fn provenance(&self, id: Id) -> serde_json::Value {
        let instance = &self.core.instances()[id];
        let made_by = &self.core.graph().steps[instance.step].recipe.ingredients;
        let inputs: Vec<_> = input_keys(&self.core, id)
            .into_iter()
            .map(|i| serde_json::json!({"port": i.port, "step": i.step, "item": i.item, "key": i.key.hex()}))
            .collect();
        serde_json::json!({
            "step": made_by.step,
            "item": instance.item,
            "plugin": made_by.plugin,
            "components": made_by.components,
            "parameters": made_by.parameters,
            "files": made_by.files,
            "inputs": inputs,
            "key": instance.key.map(|k| k.hex()),
            "data_model": DATA_MODEL_VERSION,
        })
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

    fn heed(&mut self, report: Report, observer: &mut dyn Observer) {
        if let Report::Message { id, .. } = &report {
            self.look_again(*id);
        }
        match report {
            Report::Ended { id, outcome }
                if matches!(outcome, Outcome::Done(_) | Outcome::Cancelled)
                    && self.heard.get(&id).is_some_and(Option::is_some) =>
            {
                let reason = self.heard.remove(&id).flatten().unwrap_or_default();
                self.fail(id, &reason, observer);
            }
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
                Err(reason) => self.fail(id, &reason, observer),
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
    fn accept(&mut self, id: Id, record: &Record) -> Result<Known, String> {
        let instance = &self.core.instances()[id];
        let key: Key = instance.key.ok_or("the instance has no key")?;
        let (artifact, beside) = self
            .jobs
            .remove(&id)
            .ok_or("the instance was not started")?;
        let step = &self.core.graph().steps[instance.step];
        if step.collection && record.collection.is_none() {
            return Err(format!(
                "malformed artifact: plugin '{}' did not declare its collection, though its manifest promises one",
                step.recipe.ingredients.plugin.name
            ));
        }
        let size = std::fs::metadata(&artifact)
            .map_err(|e| format!("no artifact: {e}"))?
            .len();
        if size != record.bytes {
            return Err(format!(
                "malformed artifact: it has {size} bytes and its record says {}",
                record.bytes
            ));
        }
        if self.options.compare.contains(&instance.step)
            && let Some(known) = self.compare(id, &artifact, &beside)?
        {
            return Ok(known);
        }
        let lasting = record.is_lasting();
        if let Err(e) = self.store.commit(&key, &artifact, &beside, lasting) {
            let root = self.store.root();
            let kept = self
                .store
                .keep_unplaced(&self.folder, &key, &artifact, &beside);
            let and = match kept {
                Ok(()) => format!(
                    "it is whole, lies in {} and is taken from there by the next run",
                    self.folder.unplaced()
                ),
                Err(e) => format!("nor can it be put aside: {e}"),
            };
            return Err(format!(
                "the artifact cannot be put into the store {root}: {e}; {and}"
            ));
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

    fn failure(&self, id: Id, reason: &str) -> Failure {
        let label = self.core.label(id);
        let log = Some(self.folder.log(&label)).filter(|l| l.exists());
        Failure {
            label,
            reason: reason.to_owned(),
            log,
        }
    }

    /// Why an instance that is not done failed when it ran last as it is now.
    pub fn failed_before(&self, id: Id) -> Option<Failure> {
        let instance = &self.core.instances()[id];
        if matches!(instance.state, State::Done { .. }) {
            return None;
        }
        let step = &self.core.graph().steps[instance.step].name;
        let reason = self
            .journal
            .failure(step, &instance.item, instance.key.as_ref()?)?;
        Some(self.failure(id, reason))
    }
}

/// A library as a worker is told of it: one that lies outside of the trusted folders with the bytes that were consented to.
pub(crate) fn library(id: &PluginId, trusted: &[Utf8PathBuf]) -> LibraryRef {
    let folder = id.path.parent();
    let is_trusted = trusted.iter().any(|f| Some(f.as_path()) == folder);
    LibraryRef {
        name: id.name.clone(),
        path: id.path.clone(),
        hash: (!is_trusted).then(|| id.hash.clone()),
    }
}

/// The inputs of an instance as they are in its key.
pub fn input_keys(core: &Core<'_>, id: Id) -> Vec<InputKey> {
    let instance = &core.instances()[id];
    let wires = &core.graph().steps[instance.step].wires;
    let one = |(wire, giver): &(usize, Id)| {
        let given = &core.instances()[*giver];
        Some(InputKey {
            port: wires[*wire].port.clone(),
            step: core.graph().steps[given.step].base.clone(),
            item: given.item.clone(),
            key: given.key?,
        })
    };
    instance.inputs.iter().filter_map(one).collect()
}
