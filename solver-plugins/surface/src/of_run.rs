//! Surfaces of the bodies of a run.

use crate::{Surface, triangles};
use plyflow_sdk::{Host, Input, StepError};

/// The rigid body `name` of a run as a surface.
///
/// # Errors
/// When the run has no such body, or one without a triangle with an area.
pub fn rigid(host: &Host, input: &Input, name: &str) -> Result<Surface, StepError> {
    let meshes = host.meshes(input)?;
    let body = meshes.body(name)?;
    let (points, cells) = host.mesh(input, body)?;
    let surface = Surface::new(&points, &triangles(body.nodes_per_cell, &cells));
    surface.ok_or_else(|| {
        let step = &input.step;
        format!("body '{name}' of '{step}' has no triangle with an area").into()
    })
}
