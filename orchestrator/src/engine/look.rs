//! What a session finds in the store, and reads again of it.

use super::core::{Effect, Event, Id, Output, State};
use super::session::Session;
use super::shown::{Observer, Update};
use super::sound::Depth;
use super::task::input_keys;
use crate::plan::Ingredients;
use crate::store::{Flaw, Known};
use std::collections::{HashMap, VecDeque};

impl Session<'_> {
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

    /// Answers lookups at once; leaves the other effects for [`Session::execute`].
    pub(super) fn take(&mut self, effects: Vec<Effect>, observer: &mut dyn Observer) {
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

    pub(super) fn note(&mut self, id: Id, artifact: Known) {
        if !self.writing {
            return;
        }
        let instance = &self.core.instances()[id];
        let step = &self.core.graph().steps[instance.step];
        if let Some(key) = instance.key {
            let who = (step.name.as_str(), instance.item.as_slice());
            let made_by = || Ingredients::of(&self.workflow.steps[instance.step]);
            let inputs = || input_keys(&self.core, id);
            self.journal
                .used(who, key, (step.recipe, made_by), artifact, inputs);
        }
    }

    /// Reads the records, or also the artifacts, of all that is done. What is not as it was written is set aside and not done any more;
    /// a run makes it again. Gives how many these are.
    pub fn recheck(
        &mut self,
        of: &dyn Fn(Id) -> bool,
        depth: Depth,
        observer: &mut dyn Observer,
    ) -> usize {
        let done = |id: &Id| matches!(self.core.instances()[*id].state, State::Done { .. });
        let all: Vec<Id> = (0..self.core.instances().len())
            .filter(|id| done(id) && of(*id))
            .collect();
        let mut lost = Vec::new();
        for id in all {
            let found = match (depth, self.core.instances()[id].key) {
                (Depth::Artifacts, _) => self.read_whole(id).map(drop),
                (Depth::Records, Some(key)) => self.store.read_record(&key).map(drop),
                (Depth::Records, None) => Ok(()),
            };
            if let Err(flaw) = found {
                self.forget(id);
                self.lose(id, flaw, true, observer);
                lost.push(id);
            }
        }
        let n = lost.len();
        if n > 0 {
            let effects = self.core.handle(Event::Lost {
                reader: None,
                ids: lost,
            });
            self.take(effects, observer);
        }
        n
    }
}
