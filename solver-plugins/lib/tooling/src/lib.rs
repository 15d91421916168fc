//! Rigid tools: parametric generators and STL files give a [`ToolMesh`]; [`SignedDistanceGrid`] answers
//! the contact search with a distance and its exact gradient.
//!
//! Coordinates as in scenes: x along the tool, y across, z up, the machine bed is the plane z = 0.
//! Lengths in metres.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod audit;
mod double_dome;
mod error;
mod facet_budget;
pub mod facets;
pub mod given;
mod hemisphere;
mod mesh;
mod ramp;
pub mod sdf;
mod spar;
mod stl;
mod sweep;
mod tetrahedron;
mod tree;

pub use audit::FieldError;
pub use error::ToolError;
pub use given::RigidTool;
pub use mesh::ToolMesh;
pub use sdf::SignedDistanceGrid;
pub use tree::{ClosestPoint, SurfaceTree};

use plyflow_model::scene::Tool;
use std::path::Path;

/// Largest distance between a facet and the curved surface that it stands for (m). Facets are refined
/// along fillets and ramps to keep it, whatever `facet_size` says.
pub const CHORD_TOLERANCE: f64 = 2e-5;

/// The surface of a scene's tool. STL paths are taken as they stand: absolute, or relative to the working
/// directory (see [`build_from`]).
pub fn build(tool: &Tool) -> Result<ToolMesh, ToolError> {
    build_from(tool, Path::new(""))
}

/// As [`build`], with STL paths relative to `folder`, the one that holds the scene file.
pub fn build_from(tool: &Tool, folder: &Path) -> Result<ToolMesh, ToolError> {
    facet_budget::allow(tool)?;
    match tool {
        Tool::JoggleSpar(spar) => spar::joggle_spar(spar),
        Tool::Flat(flat) => spar::flat(flat),
        Tool::RampedSpar(ramped) => spar::ramped_spar(ramped),
        Tool::Tetrahedron(t) => tetrahedron::tetrahedron(t),
        Tool::DoubleDome(d) => double_dome::double_dome(d),
        Tool::Hemisphere(h) => hemisphere::hemisphere(h.radius.si(), h.facet_size.si()),
        Tool::Stl(s) => {
            let path = folder.join(&s.file);
            stl::read(&path, s.unit.si(), s.translate.map(|t| t.si()))
        }
    }
}
