//! Rigid tools: parametric generators, STL files and other steps give a [`ToolMesh`]; [`SignedDistanceGrid`] answers
//! the contact search with a distance and its exact gradient.
//!
//! Coordinates as in scenes: x along the tool, y across, z up, the machine bed is the plane z = 0.
//! Lengths in metres.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod advise;
mod audit;
mod build;
mod checks;
mod chord;
mod column;
mod double_dome;
mod error;
pub mod facets;
pub mod given;
mod hemisphere;
mod input;
mod mesh;
#[cfg(feature = "steps")]
pub mod of_step;
mod overlap;
pub mod part;
pub mod sdf;
mod stl;
mod surface;
mod sweep;
mod tetrahedron;
mod tree;

pub use advise::other_way_up;
pub use audit::FieldError;
pub use build::{Built, build, build_from, built};
pub use chord::CHORD_TOLERANCE;
pub use error::ToolError;
pub use given::RigidTool;
pub use mesh::ToolMesh;
pub use part::{PartField, PartTool};
pub use sdf::SignedDistanceGrid;
pub use tree::{ClosestPoint, SurfaceTree};
