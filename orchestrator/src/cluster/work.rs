//! An instance that the engine has submitted, as the head of a run on a cluster knows it.

use super::folder::Order;
use camino::Utf8PathBuf;
use std::time::Instant;

/// An instance that was submitted.
pub(super) struct Work {
    /// Its present attempt.
    pub order: Order,
    /// When an allocation was first seen to have it.
    pub taken: Option<Instant>,
    /// Which.
    pub pilot: Option<String>,
    /// The engine has asked for its end.
    pub wished: bool,
    /// Since when there is a verdict whose files cannot be seen whole.
    pub late: Option<Instant>,
    /// Attempts that were given up and may still come to an end.
    pub older: Vec<(String, String)>,
    /// Where the engine wants the log.
    pub log: Utf8PathBuf,
    /// What its attempts have taken of the cores of their allocations (s).
    pub spent: f64,
}

impl Work {
    /// Whether there is a checkpoint to go on from.
    pub fn is_kept(&self) -> bool {
        let folder = self.order.job.checkpoints.as_ref().map(|c| &c.folder);
        folder
            .is_some_and(|f| std::fs::read_dir(f).is_ok_and(|mut entries| entries.next().is_some()))
    }
}
