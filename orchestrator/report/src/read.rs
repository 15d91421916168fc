//! What records and artifacts say, as structs: nothing here draws.

mod carried;
mod comparison;
pub(crate) mod coupon;
mod error;
mod facts;
mod fidelity;
pub(crate) mod frames;
mod history;
mod inputs;
mod links;
pub(crate) mod maps;
mod material;
mod measured;
mod others;
mod places;
mod plies;
pub(crate) mod plots;
pub(crate) mod sheet;
mod study;
pub(crate) mod tables;

pub(crate) use carried::{CARRIED, files};
pub(crate) use comparison::Comparison;
pub(crate) use facts::{Facts, last_frame, open, quads};
pub use fidelity::{COUNTS, Measure, OfClass, TARGETS, Way, Ways, advice, ways};
pub(crate) use history::History;
pub(crate) use inputs::{Inputs, Law, inputs};
pub(crate) use material::Material;
pub(crate) use places::places;
pub(crate) use plies::{judged_plies, shown_sheet};
pub(crate) use sheet::Source;
pub(crate) use study::{Local, Run, Study};
pub(crate) use tables::ROWS;
