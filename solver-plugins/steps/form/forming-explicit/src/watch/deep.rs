//! What the watch finds, and what it remembers of a run.

use crate::watch::sheet::Seat;
use plyflow_geometry::vec3::Vec3;
use serde::{Deserialize, Serialize};

/// Nodes that are looked at together.
pub const CHUNK: usize = 256;

/// A depth and where it is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Deep {
    /// m; 0: none.
    pub depth: f64,
    /// Node of the model.
    pub node: u32,
    /// Its place (m).
    pub place: Vec3,
}

impl Deep {
    /// The deeper one; of equals this one.
    pub fn or(self, other: Self) -> Self {
        if other.depth > self.depth {
            other
        } else {
            self
        }
    }
}

/// The deepest of a pair so far.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Peak {
    /// It.
    pub deep: Deep,
    /// When (s).
    pub time: f64,
}

/// What the watch remembers of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Watched {
    /// The deepest so far, by pair.
    pub peaks: Vec<Peak>,
    /// The last ones, by pair.
    pub now: Vec<Deep>,
    /// By sheet, node and other sheet.
    pub seats: Vec<Vec<Seat>>,
    /// By sheet and node: thickness (m) of what lies between it and what is below it, and above it.
    pub between: Vec<Vec<[f64; 2]>>,
    /// Cycle of the last look at everything.
    pub anew_at: Option<u64>,
}
