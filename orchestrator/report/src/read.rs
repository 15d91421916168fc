//! What records and artifacts say, as structs: nothing here draws.

pub(crate) mod carried;
pub(crate) mod comparison;
pub(crate) mod coupon;
pub(crate) mod error;
pub(crate) mod facts;
pub(crate) mod fidelity;
pub(crate) mod history;
mod links;
pub(crate) mod maps;
pub(crate) mod material;
pub(crate) mod measured;
pub(crate) mod others;
pub(crate) mod places;
pub(crate) mod plies;
pub(crate) mod plots;
pub(crate) mod sheet;
pub(crate) mod study;
pub(crate) mod tables;
