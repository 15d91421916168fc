//! The words of the domain, typed and without I/O: units, material, scene, workflow and the manifest of
//! a plugin. Everything else in the repository depends on this crate and it depends on nothing of it.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod artifact;
pub mod book;
pub mod budget;
pub mod canonical;
pub mod contour;
pub mod fault;
pub mod friction;
pub mod given;
pub mod job;
pub mod manifest;
pub mod material;
pub mod nearest;
pub mod outline;
pub mod process;
pub mod profile;
pub mod regions;
pub mod rules;
pub mod scene;
pub mod schema;
pub mod stamping;
pub mod steering;
pub mod text;
pub mod tool;
pub mod units;
pub mod workflow;

pub use canonical::canonical;
pub use manifest::Manifest;
pub use units::{Dimension, UnitError, parse_quantity};

/// Standard acceleration of free fall (m/s2), 3rd General Conference on Weights and Measures, 1901.
pub const STANDARD_GRAVITY: f64 = 9.80665;
