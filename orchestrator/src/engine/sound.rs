//! What a session knows of the soundness of what it found: looked at when it is found, read when it is consumed or printed.

use super::core::Id;
use crate::plan::Key;
use crate::store::{Flaw, Seen};
use plyflow_model::job::Record;
use std::collections::HashMap;

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
    pub(super) read: HashMap<Key, (Seen, Record)>,
    /// What was wrong with instances that are not taken for done.
    pub(super) flaws: HashMap<Id, Flaw>,
    /// How often artifacts of an instance were found damaged.
    pub(super) again: HashMap<Id, u32>,
}

impl Sound {
    /// The artifact of an instance was made in this run.
    pub(super) fn made(&mut self, id: Id) {
        self.flaws.remove(&id);
    }
}
