//! Step plugin `forming-kinematic`: a pin-jointed net of inextensible fibres draped over a rigid tool. Geometry
//! only: no forces, no time, no friction. The cheapest answer to how a ply shears.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod net;
mod output;
pub mod ply;
mod root;
pub mod surface;

pub use root::{Circle, Miss, drop_on};

use plyflow_sdk::{Host, Step, StepError};

/// The step.
pub struct FormingKinematic;

impl Step for FormingKinematic {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        output::run(host)
    }
}

plyflow_sdk::export_step!(FormingKinematic);
