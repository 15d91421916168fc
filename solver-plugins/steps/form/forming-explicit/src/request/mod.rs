//! What is asked for.

pub mod cut;
pub mod inputs;
pub mod parameters;
