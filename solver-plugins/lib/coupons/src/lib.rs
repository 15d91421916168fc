//! Coupon tests: small specimens with simple loads whose answers are known from closed forms, from other
//! methods or from measurements. Every test is a step plugin of the role `coupon` (thin crates beside this
//! one); what they share is here:
//!
//! - [`specimen`]: material, element and mesh become a [`plyflow_mechanics::model::Model`];
//! - [`run`]: the time loop of a [`run::Test`]: steps, samples, frames, energy ledger, health;
//! - [`output`]: curves, plots, results and attributes of the artifact;
//! - [`mod@reference`]: curves to compare with, from CSV files;
//! - one module for each test.
//!
//! All quantities are SI. Results are the same for any number of threads.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod bias_extension;
pub mod bias_plane;
pub mod buckling;
pub mod cantilever;
pub mod distortion;
mod drives;
pub mod film;
pub mod friction;
pub mod inflation;
pub mod off_axis;
pub mod output;
pub mod picture_frame;
pub mod pure_bending;
pub mod reference;
pub mod rotated_mesh;
pub mod run;
pub mod shell_benchmark;
pub mod specimen;
mod statics;
pub mod strip;
