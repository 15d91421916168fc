//! A workflow, its store and where its instances stand: what a session knows, whatever it does with it.

use super::compare::Compared;
use super::core::{Core, Effect, Id, Limits, State};
use super::opening::{look_at_journal, open_for_writing};
use super::shown::{Failure, Summary};
use super::sound::Sound;
use super::unchanged::Unchanged;
use crate::plan::{ByKey, Graph, Key};
use crate::store::{Early, Flaw, Journal, RunFolder, Seen, Store};
use camino::Utf8PathBuf;
use plyflow_model::job::Cost;
use plyflow_workflow::resolved::ResolvedWorkflow;
use std::collections::{HashMap, VecDeque};
use std::io;

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

/// What a session is of.
#[derive(Clone, Copy)]
pub struct Of<'a> {
    /// The workflow.
    pub workflow: &'a ResolvedWorkflow,
    /// Its steps as a graph.
    pub graph: &'a Graph,
    /// Its store.
    pub store: &'a Store,
}

/// What a session is for.
pub enum Purpose {
    /// It only looks: another may hold the lock.
    Look,
    /// It runs, and the caller holds the run's lock; with what was read ahead, if something was.
    Run(Option<Early>),
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
    pub(super) folder: RunFolder,
    pub(super) options: Options,
    pub(super) writing: bool,
    pub(super) costs: HashMap<Id, Cost>,
    pub(super) pending: VecDeque<Effect>,
    pub(super) jobs: HashMap<Id, (Utf8PathBuf, Utf8PathBuf)>,
    pub(super) serial: u64,
    pub(super) unchanged: Unchanged,
    /// Running instances that have been heard of since they started, with what of theirs turned out to have changed.
    pub(super) heard: HashMap<Id, Option<String>>,
    pub(super) summary: Summary,
    pub(super) sound: Sound,
    /// What was found when the files of the run were opened, for the user.
    pub(super) told: Vec<String>,
    /// What was seen of files before anybody asked.
    pub(super) ahead: HashMap<Key, Seen, ByKey>,
    pub(super) compared: Vec<(String, Compared)>,
}

impl<'a> Session<'a> {
    /// A session of a workflow.
    ///
    /// # Errors
    /// When the journal cannot be read or written.
    pub fn new(of: Of<'a>, options: Options, purpose: Purpose) -> io::Result<Self> {
        let Of {
            workflow,
            graph,
            store,
        } = of;
        let (writing, early) = match purpose {
            Purpose::Look => (false, None),
            Purpose::Run(early) => (true, early),
        };
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
            sound: Sound::default(),
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

    /// The folder of this run.
    pub fn folder(&self) -> &RunFolder {
        &self.folder
    }

    /// What of an instance's artifact is not as it was written, where that is why it is not taken for done.
    pub fn flaw(&self, id: Id) -> Option<&Flaw> {
        self.sound.flaws.get(&id)
    }

    /// All that was found damaged, in words, in the order of discovery.
    pub fn damages(&self) -> Vec<String> {
        let all = 0..self.core.instances().len();
        all.filter_map(|id| self.damage(id)).collect()
    }

    /// What of an instance was found damaged, with its label.
    pub fn damage(&self, id: Id) -> Option<String> {
        match self.flaw(id)? {
            Flaw::Damaged(text) => Some(format!("{}: {text}", self.core.label(id))),
            Flaw::Gone | Flaw::Unsealed => None,
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

    pub(super) fn failure(&self, id: Id, reason: &str) -> Failure {
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
