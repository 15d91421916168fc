//! Rigid tools: parametric generators and STL files give a [`ToolMesh`]; [`SignedDistanceGrid`] answers
//! the contact search with a distance and its exact gradient.
//!
//! Coordinates as in scenes: x along the tool, y across, z up, the machine bed is the plane z = 0.
//! Lengths in metres.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod audit;
mod build;
mod chord;
mod double_dome;
mod error;
pub mod facets;
pub mod given;
mod hemisphere;
mod mesh;
pub mod sdf;
mod stl;
mod sweep;
mod tetrahedron;
mod tree;

pub use audit::FieldError;
pub use build::{build, build_from};
pub use chord::CHORD_TOLERANCE;
pub use error::ToolError;
pub use given::RigidTool;
pub use mesh::ToolMesh;
pub use sdf::SignedDistanceGrid;
pub use tree::{ClosestPoint, SurfaceTree};
