//! Which surfaces rub on each other, and by which law.

pub mod check;
pub mod pairs;
pub mod table;
pub mod through;

pub use table::{FrictionTable, Touching};
