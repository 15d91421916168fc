//! Blanks of plies before forming: rectangles, and outlines with holes.
//!
//! A rectangle is a regular grid. Any other outline is meshed with quads alone that follow it ([`mesh_region`]): nodes on
//! its edge, one on each sharp corner, grid lines along x and y inside.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod blank;
mod coarse;
mod cut;
mod edge;
mod error;
mod mesher;
pub mod quality;
mod smooth;

pub use blank::Blank;
pub use edge::{LEAST_FEATURE, SHARP};
pub use error::MeshError;
pub use mesher::mesh_region;
