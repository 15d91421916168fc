//! What went wrong with a run, or means nothing.

pub mod absurd;
pub mod diagnosis;
pub mod scale;
