//! What presses and moves over time.

pub mod cycle;
pub mod guide;
pub mod press;
pub mod process;
pub mod stamping;

pub use cycle::Cycle;
pub use guide::Guide;
pub use press::{HeldByForce, PressLoad, Stroke};
pub use process::Load;
pub use stamping::{ForceInTime, Grip, Motion, MovedPart, PressedPart, StampingLoad};
