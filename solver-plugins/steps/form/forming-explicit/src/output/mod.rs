//! The artifact of a run.

pub mod checkpoint;
pub mod history;
pub mod meshes;
pub mod summary;
pub mod warnings;
pub mod writer;

pub use history::{write_energies, write_history};
pub use meshes::{define, define_rigid, fields_of};
pub use summary::write_summary;
pub use warnings::{at_the_start, slower_multipliers};
pub use writer::Writer;
