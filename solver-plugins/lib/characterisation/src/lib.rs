//! From raw test data of fabrics to laws: what the characterisation plugins share.
//!
//! Each test has a module that takes numbers in SI and gives a law with its residuals and its conditioning
//! ([`cantilever`], [`bending`], [`picture_frame`], [`sled`]); [`csv`] reads raw data with located errors,
//! [`material`] writes material files, [`output`] an artifact of kind `characterisation`. [`synthetic`] makes raw data of known laws, by
//! which a fit is judged.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub use plyflow_model::units::Dimension;

pub mod bending;
pub mod cantilever;
pub mod confidence;
pub mod csv;
pub mod linear;
pub mod material;
pub mod output;
pub mod picture_frame;
pub mod profile;
pub mod sled;
pub mod stitch;
pub mod synthetic;
pub mod voce;
pub mod yarns;
pub mod zero;

/// Acceleration of free fall (m/s2) that weights are computed with.
pub const GRAVITY: f64 = plyflow_model::STANDARD_GRAVITY;
