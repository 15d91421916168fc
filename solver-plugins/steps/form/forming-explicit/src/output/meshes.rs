//! The meshes of an artifact.

use crate::error::FormingError;
use crate::forming::Forming;
use crate::stack::{Body, RigidName, StackSheet};
use plyflow_model::artifact::{RigidBody, SheetBody};
use plyflow_sdk::Host;

/// Tells the meshes of the tool and of a press's parts.
///
/// # Errors
/// The host's.
pub fn define_rigid(host: &Host, forming: &Forming) -> Result<(), FormingError> {
    let about = RigidBody::ATTRIBUTES;
    let tool = &forming.tool;
    let triangles: Vec<u32> = tool.triangles.iter().flatten().copied().collect();
    host.define_mesh(RigidName::Tool.word(), &tool.points, 3, &triangles, &about)?;
    for part in &forming.rigid {
        let cells = part.cells.as_flattened();
        host.define_mesh(part.name.word(), &part.points, 4, cells, &about)?;
    }
    Ok(())
}

/// Tells the mesh of a sheet.
///
/// # Errors
/// The host's.
pub fn define(
    host: &Host,
    forming: &Forming,
    body: &Body,
    sheet: &StackSheet,
) -> Result<(), FormingError> {
    let cells: Vec<u32> = body.cells.iter().flatten().copied().collect();
    let attributes = SheetBody {
        kind: sheet.scene.kind,
        thickness: sheet.thickness,
        offset: sheet.offset,
    };
    let points = forming.reference_points(body);
    Ok(host.define_mesh(&body.name, &points, 4, &cells, &attributes)?)
}
