//! The time loop, and what comes before it.

pub mod late;
pub mod run;
