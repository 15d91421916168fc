//! What presses and moves over time.

pub mod cycle;
pub mod press;
pub mod process;
