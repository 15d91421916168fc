//! What presses and moves over time.

pub mod cycle;
pub mod press;
pub mod process;

pub use cycle::Cycle;
pub use press::{HeldByForce, PressLoad, Stroke};
pub use process::Load;
