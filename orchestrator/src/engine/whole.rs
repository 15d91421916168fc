//! Whether the files of a session's instances are what was written: read once for each state of them, and noted when they are not.

use super::compare::{Compared, NotCompared, first_difference};
use super::core::{Id, State};
use super::session::Session;
use super::shown::{Observer, Update};
use crate::store::{ENDING, Expected, Flaw, Known};
use camino::Utf8Path;
use plyflow_model::job::Record;
use std::io;

impl Session<'_> {
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

    /// It was counted as found and is not.
    pub(super) fn forget(&mut self, id: Id) {
        self.costs.remove(&id);
        if self.core.instances()[id].state == (State::Done { cached: true }) {
            self.summary.cached = self.summary.cached.saturating_sub(1);
        }
    }

    /// Compares what was made again with what the store has; `None` when that is nothing whole, and the new one is to take its place.
    pub(super) fn compare(
        &mut self,
        id: Id,
        artifact: &Utf8Path,
        record: &Utf8Path,
    ) -> Result<Option<Known>, NotCompared> {
        let label = self.core.label(id);
        let Some(key) = self.core.instances()[id].key else {
            return Ok(None);
        };
        let stored = match self.read_whole(id) {
            Ok(stored) => stored,
            Err(flaw) => {
                if let Flaw::Damaged(text) = flaw {
                    let place = self.store.set_key_aside(&key);
                    self.told.push(format!("{label}: {text}; {place}"));
                    self.summary.damaged += 1;
                }
                self.compared.push((label, Compared::New));
                return Ok(None);
            }
        };
        let there = self.store.artifact(&key);
        let cannot = |source: io::Error| NotCompared {
            new: artifact.to_owned(),
            stored: there.clone(),
            source,
        };
        let how = match first_difference(&there, artifact).map_err(cannot)? {
            None => Compared::Same {
                bytes: stored.bytes,
            },
            Some(at) => {
                let size = std::fs::metadata(artifact).map_err(cannot)?.len();
                let named = artifact.with_file_name(format!("{}-again{ENDING}", key.hex()));
                std::fs::rename(artifact, &named).map_err(cannot)?;
                let kept = self.store.set_aside(&named).map_err(cannot)?;
                let kept = kept.unwrap_or(named);
                Compared::Other {
                    at,
                    sizes: [stored.bytes, size],
                    kept,
                }
            }
        };
        self.compared.push((label, how));
        let _ = (std::fs::remove_file(artifact), std::fs::remove_file(record));
        Ok(Some(Known {
            bytes: stored.bytes,
            labels: stored.collection,
            stamp: self.store.look(&key).ok().map(|seen| seen.stamp),
        }))
    }
}
