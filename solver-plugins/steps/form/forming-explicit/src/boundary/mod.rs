//! What drives nodes.

pub mod beginning;
pub mod cut;
pub mod frame;
