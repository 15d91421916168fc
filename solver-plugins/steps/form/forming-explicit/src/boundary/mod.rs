//! What drives nodes.

pub mod beginning;
pub mod cut;
pub mod frame;

pub use beginning::Beginning;
pub use cut::CutDrive;
pub use frame::FrameDrive;
