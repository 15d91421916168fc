//! The sound study of the other tests with a block `study` or `optimise`.
#![allow(dead_code)] // Not every test file uses all of it.

use super::common;
use common::Study;
use plyflow_workflow::resolved::{ResolvedStep, ResolvedWorkflow};

pub const W: &str = "workflow.yaml";

/// The sound study of the other tests, with this block, and with changes in the workflow.
pub fn with(block: &str, changes: &[(&str, &str)]) -> Study {
    let study = Study::sound();
    study.mutate(W, "on_failure: keep-going\n", &format!("study:\n{block}\n"));
    for (from, to) in changes {
        assert!(study.mutate(W, from, to) > 0, "{from}");
    }
    study
}

pub const ANGLES: &str = "  vary:\n    limit: {from: 4 deg, to: 8 deg, by: 2 deg}";
pub const LIMIT: (&str, &str) = (
    "over_shear_positive: 8 deg",
    "over_shear_positive: ${limit}",
);

pub fn load(study: &Study) -> ResolvedWorkflow {
    study
        .load()
        .unwrap_or_else(|found| panic!("{}", found.render(false)))
}

pub fn told(study: &Study) -> String {
    study
        .load()
        .map(|_| String::new())
        .unwrap_or_else(|found| found.to_string())
}

pub fn names(w: &ResolvedWorkflow) -> Vec<&str> {
    w.steps.iter().map(|s| s.name.as_str()).collect()
}

pub fn step<'w>(w: &'w ResolvedWorkflow, name: &str) -> &'w ResolvedStep {
    w.steps
        .iter()
        .find(|s| s.name == name)
        .unwrap_or_else(|| panic!("{name}: {:?}", names(w)))
}
