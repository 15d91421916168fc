//! Decides what happens next: (state, event) -> (state, effects). No I/O, no clock, no processes.

pub use super::terms::{Effect, Event, Id, Limits, Output, State};

use crate::plan::{Extent, Graph, Key, Walk, instance_key, walk};
use plyflow_model::text::one_line;
use plyflow_workflow::resolved::FailurePolicy;
use std::collections::{BTreeSet, HashMap, VecDeque};

/// One step for one item.
#[derive(Debug)]
pub struct Instance {
    /// Index of its step.
    pub step: usize,
    /// Index path.
    pub item: Vec<u64>,
    /// Where it stands.
    pub state: State,
    /// Its key, once known.
    pub key: Option<Key>,
    /// Wires and the instances that arrive on them, in order, once known.
    pub inputs: Vec<(usize, Id)>,
    /// Labels of its artifact's items, once done, when it is a collection.
    pub labels: Option<Vec<String>>,
    /// Attempts begun.
    pub attempts: u32,
    /// Threads that it was told last that it may use, while it runs.
    told: u32,
    pending: usize,
    on_key: Vec<Id>,
    on_done: Vec<Id>,
}

/// The instances of a step by their items. Most steps have no fan-out and so one instance: it needs no map.
#[derive(Debug, Default, Clone)]
struct ByItem {
    only: Option<Id>,
    items: HashMap<Vec<u64>, Id>,
}

impl ByItem {
    fn get(&self, item: &[u64]) -> Option<Id> {
        match item {
            [] => self.only,
            item => self.items.get(item).copied(),
        }
    }

    /// That of an item that has been discovered.
    fn find(&self, item: &[u64]) -> Id {
        self.get(item).expect("discovered before it is asked for")
    }

    fn insert(&mut self, item: &[u64], id: Id) {
        match item {
            [] => self.only = Some(id),
            item => drop(self.items.insert(item.to_vec(), id)),
        }
    }
}

/// The state of a run.
pub struct Core<'g> {
    graph: &'g Graph,
    limits: Limits,
    instances: Vec<Instance>,
    by_item: Vec<ByItem>,
    ready: BTreeSet<(usize, Vec<u64>, Id)>,
    running: usize,
    looking: usize,
    open: usize,
    free_cores: u32,
    used_memory: u64,
    stopping: bool,
    failed_points: BTreeSet<u32>,
    agenda: VecDeque<Id>,
    effects: Vec<Effect>,
}

impl<'g> Core<'g> {
    /// A run that has not begun.
    pub fn new(graph: &'g Graph, limits: Limits) -> Self {
        Self {
            graph,
            limits,
            instances: Vec::new(),
            by_item: vec![ByItem::default(); graph.steps.len()],
            ready: BTreeSet::new(),
            running: 0,
            looking: 0,
            open: 0,
            free_cores: limits.cores.max(1),
            used_memory: 0,
            stopping: false,
            failed_points: BTreeSet::new(),
            agenda: VecDeque::new(),
            effects: Vec::new(),
        }
    }

    /// Begins: the instances that are known from the workflow alone.
    pub fn start(&mut self) -> Vec<Effect> {
        for step in 0..self.graph.steps.len() {
            self.discover(step, None);
        }
        self.settle()
    }

    /// Takes one event.
    pub fn handle(&mut self, event: Event) -> Vec<Effect> {
        match event {
            Event::Looked { id, found } => {
                self.looking -= 1;
                match found {
                    Some(output) => self.done(id, output, true),
                    None => self.missing(id),
                }
            }
            Event::Finished { id, output } => {
                self.release(id);
                self.done(id, output, false);
            }
            Event::Failed { id } => {
                self.release(id);
                self.failed(id);
            }
            Event::Cancelled { id } => {
                self.release(id);
                self.finish(id, State::Stopped);
            }
            Event::Lost { reader, ids } => self.lost(reader, &ids),
            Event::Interrupt => self.stop(),
        }
        self.settle()
    }

    /// Whether nothing is running or can run any more.
    pub fn is_finished(&self) -> bool {
        self.running == 0 && (self.stopping || self.open == 0)
    }

    /// All instances found so far.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// The graph.
    pub fn graph(&self) -> &'g Graph {
        self.graph
    }

    /// Those collections whose size is not known and hide instances of a step.
    pub fn hidden_by(&self, step: usize) -> Vec<Id> {
        let all = vec![None; self.graph.steps[step].dimensions.len()];
        self.walk(step, &all).unknown
    }

    /// Name for people: the step, and the labels of its item: `local[A]`.
    pub fn label(&self, id: Id) -> String {
        let instance = &self.instances[id];
        let step = &self.graph.steps[instance.step];
        if step.dimensions.is_empty() {
            return step.name.clone();
        }
        let label = format!("{}[{}]", step.name, self.item_labels(id).join(","));
        // A plugin writes the labels: no line of its own is to come from them.
        one_line(&label).into_owned()
    }

    /// The labels of the item of an instance, outermost first.
    pub fn item_labels(&self, id: Id) -> Vec<String> {
        let instance = &self.instances[id];
        let step = &self.graph.steps[instance.step];
        let one = |(at, d): (usize, &crate::plan::DimensionPlan)| {
            let owner: Vec<u64> = d.prefix.iter().map(|p| instance.item[*p]).collect();
            let index = instance.item[at];
            let labels = self.by_item[d.over].get(&owner).and_then(|o| {
                self.instances[o]
                    .labels
                    .as_ref()?
                    .get(index as usize)
                    .cloned()
            });
            labels.unwrap_or_else(|| index.to_string())
        };
        step.dimensions.iter().enumerate().map(one).collect()
    }

    fn walk(&self, step: usize, fixed: &[Option<u64>]) -> Walk {
        walk(self.graph, step, fixed, |over, owner| {
            // Outer collections are walked first, so the owner has been discovered.
            let id = self.by_item[over].find(owner);
            let instance = &self.instances[id];
            match (instance.state, &instance.labels) {
                (State::Done { .. }, Some(labels)) => Extent::Items(labels.len() as u64),
                _ => Extent::Unknown(id),
            }
        })
    }

    /// Finds new instances of `step`; only those below `owner` when a collection has just become known.
    fn discover(&mut self, step: usize, owner: Option<Id>) {
        let plan = &self.graph.steps[step];
        if !plan.wanted {
            return;
        }
        let mut fixed = vec![None; plan.dimensions.len()];
        if let Some(owner) = owner {
            let (over, item) = (self.instances[owner].step, &self.instances[owner].item);
            for d in plan.dimensions.iter().filter(|d| d.over == over) {
                for (at, index) in d.prefix.iter().zip(item) {
                    fixed[*at] = Some(*index);
                }
            }
        }
        for item in self.walk(step, &fixed).known {
            let id = self.instances.len();
            if self.by_item[step].get(&item).is_some() {
                continue;
            }
            self.by_item[step].insert(&item, id);
            self.instances.push(Instance {
                step,
                item,
                state: State::Unkeyed,
                key: None,
                inputs: Vec::new(),
                labels: None,
                attempts: 0,
                told: 0,
                pending: 0,
                on_key: Vec::new(),
                on_done: Vec::new(),
            });
            self.open += 1;
            self.agenda.push_back(id);
        }
    }

    /// Works off the agenda, then fills the free cores.
    fn settle(&mut self) -> Vec<Effect> {
        while let Some(id) = self.agenda.pop_front() {
            match self.instances[id].state {
                State::Unkeyed => self.try_key(id),
                State::Waiting => self.try_ready(id),
                _ => {}
            }
        }
        // While lookups are open more may become ready: shares of cores are dealt when all are known.
        if !self.stopping && self.looking == 0 {
            self.schedule();
            self.lend();
        }
        std::mem::take(&mut self.effects)
    }

    /// Computes the key when every input's key is known; else registers what to wait for.
    fn try_key(&mut self, id: Id) {
        let graph = self.graph;
        let plan = &graph.steps[self.instances[id].step];
        let mut inputs = Vec::with_capacity(plan.wires.len());
        let (mut want_done, mut want_key) = (Vec::new(), Vec::new());
        for (at, wire) in plan.wires.iter().enumerate() {
            let item = &self.instances[id].item;
            let fixed: Vec<_> = wire.matched.iter().map(|m| m.map(|p| item[p])).collect();
            let found = self.walk(wire.from, &fixed);
            want_done.extend(found.unknown);
            for path in found.known {
                let giver = self.by_item[wire.from].find(&path);
                if self.instances[giver].key.is_none() {
                    want_key.push(giver);
                }
                inputs.push((at, giver));
            }
        }
        if want_done.is_empty() && want_key.is_empty() {
            let key = instance_key(
                &plan.recipe,
                &self.instances[id].item,
                inputs.iter().filter_map(|(wire, giver)| {
                    let wire = &plan.wires[*wire];
                    let giver = &self.instances[*giver];
                    let step = graph.steps[wire.from].base.as_str();
                    Some((
                        wire.port.as_str(),
                        step,
                        giver.item.as_slice(),
                        giver.key.as_ref()?,
                    ))
                }),
            );
            let instance = &mut self.instances[id];
            instance.key = Some(key);
            instance.inputs = inputs;
            instance.state = State::Looking;
            self.looking += 1;
            self.effects.push(Effect::Look(id));
            let waiters = std::mem::take(&mut self.instances[id].on_key);
            self.wake(&waiters);
        } else {
            self.wait_for(id, &want_done, &want_key);
        }
    }

    fn wait_for(&mut self, id: Id, want_done: &[Id], want_key: &[Id]) {
        self.instances[id].pending = want_done.len() + want_key.len();
        for giver in want_done.iter().chain(want_key) {
            if let Some(cause) = self.cause(*giver) {
                return self.skip(id, cause);
            }
        }
        for giver in want_done {
            self.instances[*giver].on_done.push(id);
        }
        for giver in want_key {
            self.instances[*giver].on_key.push(id);
        }
    }

    /// The failure behind an instance that will never be done.
    fn cause(&self, id: Id) -> Option<Id> {
        match self.instances[id].state {
            State::Failed | State::Stopped => Some(id),
            State::Skipped(cause) => Some(cause),
            _ => None,
        }
    }

    fn wake(&mut self, waiters: &[Id]) {
        for waiter in waiters {
            let w = &mut self.instances[*waiter];
            w.pending = w.pending.saturating_sub(1);
            if w.pending == 0 && !w.state.is_final() {
                self.agenda.push_back(*waiter);
            }
        }
    }

    fn missing(&mut self, id: Id) {
        self.instances[id].state = State::Waiting;
        self.agenda.push_back(id);
    }

    /// Done instances of which the artifact is lost run again; who is about to read one of these waits for it.
    fn lost(&mut self, reader: Option<Id>, ids: &[Id]) {
        for id in ids {
            if matches!(self.instances[*id].state, State::Done { .. }) {
                self.open += 1;
                self.missing(*id);
            }
        }
        if let Some(id) = reader {
            self.release(id);
            self.instances[id].attempts -= 1;
            self.missing(id);
        }
        let is_of = |id: &Id| {
            let mut inputs = self.instances[*id].inputs.iter();
            inputs.any(|(_, giver)| ids.contains(giver))
        };
        let readers: Vec<_> = (self.ready.iter().filter(|e| is_of(&e.2)))
            .cloned()
            .collect();
        for entry in readers {
            self.ready.remove(&entry);
            self.missing(entry.2);
        }
    }

    fn try_ready(&mut self, id: Id) {
        let mut open: Vec<Id> = self.instances[id].inputs.iter().map(|(_, g)| *g).collect();
        open.retain(|g| !matches!(self.instances[*g].state, State::Done { .. }));
        if open.is_empty() {
            self.instances[id].state = State::Ready;
            let instance = &self.instances[id];
            self.ready
                .insert((instance.step, instance.item.clone(), id));
        } else {
            self.wait_for(id, &open, &[]);
        }
    }

    fn done(&mut self, id: Id, output: Output, cached: bool) {
        self.instances[id].labels = output.labels;
        self.finish(id, State::Done { cached });
        let step = self.instances[id].step;
        for fanned in &self.graph.steps[step].fanned_by {
            self.discover(*fanned, Some(id));
        }
        let waiters = std::mem::take(&mut self.instances[id].on_done);
        self.wake(&waiters);
    }

    fn failed(&mut self, id: Id) {
        let allowed = self.graph.steps[self.instances[id].step].retries + 1;
        if self.instances[id].attempts < allowed && !self.stopping {
            return self.missing(id);
        }
        self.finish(id, State::Failed);
        self.skip_waiters(id, id);
        if self.limits.policy == FailurePolicy::FailFast || !self.bears(id) {
            self.stop();
        }
    }

    /// Whether the study bears that this instance has failed too.
    fn bears(&mut self, id: Id) -> bool {
        let Some(bears) = &self.graph.bears else {
            return true;
        };
        let of = &bears.points[self.instances[id].step];
        self.failed_points.extend(of.iter().copied());
        self.failed_points.len() <= bears.failures as usize
    }

    fn skip(&mut self, id: Id, cause: Id) {
        if self.instances[id].state.is_final() {
            return;
        }
        self.finish(id, State::Skipped(cause));
        self.effects.push(Effect::Skip { id, cause });
        self.skip_waiters(id, cause);
    }

    fn skip_waiters(&mut self, from: Id, cause: Id) {
        let mut stack = vec![from];
        while let Some(at) = stack.pop() {
            let instance = &mut self.instances[at];
            let mut waiters = std::mem::take(&mut instance.on_done);
            waiters.append(&mut instance.on_key);
            for waiter in waiters {
                // One that the store has in spite of the failure is done and stays so; one whose lookup
                // is under way comes back when it is missing.
                if matches!(
                    self.instances[waiter].state,
                    State::Unkeyed | State::Waiting
                ) {
                    self.finish(waiter, State::Skipped(cause));
                    self.effects.push(Effect::Skip { id: waiter, cause });
                    stack.push(waiter);
                }
            }
        }
    }

    fn finish(&mut self, id: Id, state: State) {
        debug_assert!(!self.instances[id].state.is_final());
        self.instances[id].state = state;
        self.open -= 1;
    }

    fn stop(&mut self) {
        self.stopping = true;
        self.ready.clear();
        for (id, instance) in self.instances.iter().enumerate() {
            if matches!(instance.state, State::Running(_)) {
                self.effects.push(Effect::Cancel(id));
            }
        }
    }

    fn release(&mut self, id: Id) {
        if let State::Running(threads) = self.instances[id].state {
            self.running -= 1;
            self.free_cores += threads;
            self.used_memory -= self.graph.steps[self.instances[id].step].memory;
        }
    }

    /// Starts what fits, in order of the workflow; a smaller one may overtake one that does not fit.
    fn schedule(&mut self) {
        let mut started = Vec::new();
        for entry in &self.ready {
            if self.free_cores == 0 {
                break;
            }
            let plan = &self.graph.steps[entry.0];
            let rest = (self.ready.len() - started.len()) as u32;
            let threads = match plan.cores {
                0 => (self.free_cores / rest).max(1),
                stated => stated.min(self.limits.cores.max(1)),
            };
            let memory = self.used_memory.saturating_add(plan.memory);
            let fits = self.limits.memory == 0 || memory <= self.limits.memory || self.running == 0;
            if threads > self.free_cores || !fits {
                continue;
            }
            self.free_cores -= threads;
            self.used_memory = memory;
            self.running += 1;
            let instance = &mut self.instances[entry.2];
            instance.state = State::Running(threads);
            instance.attempts += 1;
            instance.told = threads;
            let attempt = instance.attempts;
            self.effects.push(Effect::Start {
                id: entry.2,
                threads,
                attempt,
            });
            started.push(entry.clone());
        }
        for entry in started {
            self.ready.remove(&entry);
        }
    }

    /// Lends the cores that nothing can be started on to what runs, in equal parts, the earlier ones first. They stay free: what becomes
    /// ready takes them back. A step that states its cores keeps to them.
    fn lend(&mut self) {
        let graph = self.graph;
        let takes = |(id, i): (Id, &Instance)| match i.state {
            State::Running(own) if graph.steps[i.step].cores == 0 => Some((id, own)),
            _ => None,
        };
        let takers: Vec<(Id, u32)> = (self.instances.iter().enumerate())
            .filter_map(takes)
            .collect();
        let many = takers.len() as u32;
        for (at, (id, own)) in (0..).zip(takers) {
            let threads = own + self.free_cores / many + u32::from(at < self.free_cores % many);
            let told = &mut self.instances[id].told;
            if std::mem::replace(told, threads) != threads {
                self.effects.push(Effect::Lend { id, threads });
            }
        }
    }
}

#[cfg(test)]
#[path = "core_tests.rs"]
mod tests;
