//! The time loop, and what comes before it.

pub mod crew;
pub mod late;
pub mod run;
