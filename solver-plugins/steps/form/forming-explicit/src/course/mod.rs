//! A run over time.

pub mod history;
pub mod observer;
pub mod outcome;
pub mod progress;
