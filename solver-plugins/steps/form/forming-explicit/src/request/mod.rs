//! What is asked for.

pub mod cut;
pub mod inputs;
pub mod parameters;

pub use cut::{Feedback, LocalInput, LocalSheet, RecordedWay, Start};
pub use inputs::{advised_size, bending_zones, read_boundary, read_motion};
pub use parameters::{ComponentChoice, Control, Parameters};
