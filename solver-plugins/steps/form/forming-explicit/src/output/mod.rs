//! The artifact of a run.

pub mod checkpoint;
pub mod fields;
pub mod history;
pub mod meshes;
pub mod summary;
pub mod warnings;
pub mod writer;
