//! Step plugin `forming-explicit`: explicit dynamic forming of a stack of sheets over a rigid tool, between
//! diaphragms or in a press. A
//! global run meshes the scene itself; with a `boundary` input it is a local run of one zone; with `zones` plies bend in these
//! alone.
//!
//! The rooms, each of which knows those above it alone:
//!
//! | room | what |
//! |---|---|
//! | `request` | what is asked for: parameters, what other steps give |
//! | `stack` | sheets, their elements and meshes, and the contacts between them |
//! | `load` | what presses and moves over time: the cycle of a bag, a press |
//! | `boundary` | what drives nodes: the frame, the cut of a zone, a late start |
//! | `forming` | a run, ready to go |
//! | `build` | makes one of a scene: in a bag, in a press, of a zone |
//! | `measure` | what can be read off it at one time: strain, draw-in, penetration, pressure |
//! | `watch` | an independent look at what is in what |
//! | `course` | a run over time: its history, how far it is, who follows it, what came of it |
//! | `judge` | what went wrong, or means nothing |
//! | `advance` | the time loop |
//! | `output` | the artifact |
//! | `step` | from the host's inputs to its artifact |

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod advance;
mod boundary;
mod build;
mod course;
mod error;
mod forming;
mod judge;
mod load;
mod measure;
mod output;
mod request;
mod stack;
mod step;
mod watch;
mod words;

pub use build::{build_global, build_local, feed_back};
pub use course::{Course, HistoryRow, Observer, Outcome};
pub use error::FormingError;
pub use forming::Forming;
pub use judge::absurd;
pub use measure::{MANY, Penetration, untied};
pub use output::at_the_start;
pub use request::{Feedback, LocalInput, LocalSheet, Parameters, RecordedWay, Start};
pub use stack::{Components, RigidName, inverse_bilinear};
pub use watch::{PairDepth, Watch, Watched, depth_attributes, depth_warnings};

use plyflow_sdk::{Host, Step, StepError};

/// The step.
pub struct FormingExplicit;

impl Step for FormingExplicit {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        step::run(host).map_err(FormingError::at_the_door)
    }
}

plyflow_sdk::export_step!(FormingExplicit);
