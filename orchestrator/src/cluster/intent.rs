//! What is meant by a submission.

use super::needs::Shape;
use serde::{Deserialize, Serialize};

/// What an allocation must know, written before Slurm hears of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Intent {
    /// Name of the job.
    pub name: String,
    /// Shape of each allocation.
    pub shape: Shape,
    /// How many allocations.
    pub size: u32,
    /// Most steps in one.
    pub most_steps: u32,
    /// How long before the end steps are told (s).
    pub grace: f64,
    /// How long one without a step waits (s).
    pub idle: f64,
}

/// Name of an allocation of a submission.
pub fn pilot_name(submission: &str, index: u32) -> String {
    format!("{submission}_{index}")
}
