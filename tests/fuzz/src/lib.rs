//! Readers under arbitrary bytes.
//!
//! A [`Target`] takes the bytes of a file, has the project's reader read them, and panics when what comes of it is not as it should be:
//! what was read and is written again is read as the same, an error says where and what, and nothing takes more memory than
//! [`memory::BUDGET`]. The driver (`src/bin/driver.rs`, `make fuzz`) mutates inputs towards code that none has reached yet;
//! `tests/corpus.rs` runs what it has found worth keeping through all targets, in every test run.

mod fixture;
pub mod memory;
pub mod mutate;
pub mod patch;
pub mod seeds;
mod targets;
mod tool;
pub mod words;

pub use targets::{TARGETS, Target, target};
pub use tool::tool;
