//! Shows a run: bars on a terminal, lines elsewhere, JSON for programs, or nothing.

mod bars;
mod json;
mod lines;
mod pace;
mod told;

pub use bars::Bars;
pub use json::JsonLines;
pub use lines::Lines;
pub use pace::duration_text;

use crate::engine::core::{Core, Id};
use crate::engine::{Observer, Update};

/// Shows nothing.
pub struct Quiet;

impl Observer for Quiet {
    fn update(&mut self, _: &Core<'_>, _: Id, _: &Update<'_>) {}
}
