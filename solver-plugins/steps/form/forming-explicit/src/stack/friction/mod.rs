//! Which surfaces rub on each other, and by which law.

pub mod table;
pub mod through;

pub use table::{FrictionTable, Touching};
