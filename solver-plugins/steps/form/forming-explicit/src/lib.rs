//! Step plugin `forming-explicit`: explicit dynamic forming of a stack of sheets over a rigid tool, between
//! diaphragms or in a press. A
//! global run meshes the scene itself; with a `boundary` input it is a local run of one zone; with `zones` plies bend in these
//! alone.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod absurd;
pub mod assembly;
mod checkpoint;
mod course;
mod cover;
mod diagnosis;
pub mod draw_in;
pub mod elements;
pub mod friction;
mod global;
mod inputs;
mod late;
mod local;
mod output;
pub mod parameters;
pub mod penetration;
pub mod press;
pub mod process;
pub mod regions;
pub mod run;
mod strain;
pub mod symmetry;
mod tool;
pub mod watch;
mod writer;

pub use global::build_global;
pub use late::Start;
pub use local::{Feedback, LocalInput, LocalSheet, build_local, feed_back};

use plyflow_sdk::{Host, Step, StepError};

/// The step.
pub struct FormingExplicit;

impl Step for FormingExplicit {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        output::run(host)
    }
}

plyflow_sdk::export_step!(FormingExplicit);
