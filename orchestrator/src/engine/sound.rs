//! Whether what the session found in the store is what was written: looked at when it is found, read when it is consumed or printed.

use super::{Event, Id, Observer, Session, State, Update};
use crate::plan::Key;
use crate::store::{Expected, Flaw, Seen};
use plyflow_model::job::Record;
use std::collections::HashMap;

/// How often an artifact is made again within one run: a disk that damages it each time is beyond help.
const AGAIN: u32 = 2;

/// How deep the session looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// Records: what their numbers are printed of.
    Records,
    /// Artifacts too.
    Artifacts,
}

/// What a session knows of the soundness of what it found.
#[derive(Debug, Default)]
pub(super) struct Sound {
    /// Of keys of which the artifact was read and was what was written: what was seen of its files before, and the record.
    read: HashMap<Key, (Seen, Record)>,
    /// What was wrong with instances that are not taken for done.
    flaws: HashMap<Id, Flaw>,
    /// How often artifacts of an instance were found damaged.
    again: HashMap<Id, u32>,
}

impl Sound {
    /// The artifact of an instance was made in this run.
    pub(super) fn made(&mut self, id: Id) {
        self.flaws.remove(&id);
    }
}

impl Session<'_> {
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

    /// The record of an instance whose artifact and record are what was written; both are read, once for each state of their files.
    pub(super) fn read_whole(&mut self, id: Id) -> Result<Record, Flaw> {
        let key = self.core.instances()[id].key.ok_or(Flaw::Gone)?;
        let now = self.store.look(&key)?;
        if let Some((seen, record)) = self.sound.read.get(&key)
            && *seen == now
        {
            return Ok(record.clone());
        }
        let instance = &self.core.instances()[id];
        let record = self.store.check(
            &key,
            Some(Expected {
                step: self.workflow.steps[instance.step].in_file(),
                item: &instance.item,
                kind: &self.workflow.steps[instance.step].output_kind,
            }),
        )?;
        self.sound.read.insert(key, (now, record.clone()));
        Ok(record)
    }

    /// Notes what is wrong with the artifact of an instance. A session that writes moves what is damaged aside; so does one that only
    /// looks when it has just read it (`move_it`), for what is damaged is damaged for all.
    pub(super) fn lose(&mut self, id: Id, flaw: Flaw, move_it: bool, observer: &mut dyn Observer) {
        if let (Flaw::Damaged(text), Some(key)) = (&flaw, self.core.instances()[id].key) {
            self.sound.read.remove(&key);
            let mut what = text.clone();
            if move_it {
                what += &format!("; {}", self.store.set_key_aside(&key));
            }
            self.summary.damaged += 1;
            *self.sound.again.entry(id).or_default() += 1;
            observer.update(&self.core, id, &Update::Damaged { what: &what });
            self.sound.flaws.insert(id, Flaw::Damaged(what));
        } else {
            self.sound.flaws.insert(id, flaw);
        }
    }

    /// Reads the inputs of an instance that is to start. When one is not what was written it is made again, and this instance waits.
    /// True: it may start.
    pub(super) fn inputs_are_whole(&mut self, id: Id, observer: &mut dyn Observer) -> bool {
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

    /// It was counted as found and is not.
    fn forget(&mut self, id: Id) {
        self.costs.remove(&id);
        if self.core.instances()[id].state == (State::Done { cached: true }) {
            self.summary.cached = self.summary.cached.saturating_sub(1);
        }
    }
}
