//! From a resolved workflow to a graph of steps, the keys of their instances, and the reasons why one
//! must run.

mod fanout;
mod graph;
mod keys;
mod reason;

pub use fanout::{Extent, Walk, walk};
pub use graph::{Bears, DimensionPlan, Graph, PlanError, StepPlan, WirePlan, recipes};
pub use keys::{ByKey, Ingredients, InputKey, Key, canonical_json, instance_key};
pub use reason::{Change, KeyPart, changes};

#[cfg(test)]
pub(crate) use graph::tests;
