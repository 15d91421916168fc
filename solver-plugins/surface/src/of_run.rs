//! Surfaces of the bodies of a run.

use crate::{QuadLocator, Surface, triangles};
use plyflow_sdk::{Host, Input, StepError};
use serde::Deserialize;

/// What a run tells of its stack.
#[derive(Deserialize)]
struct Run {
    sheets: Vec<Sheet>,
    /// Whether sheets touch what really lies under them, and not the whole stack everywhere.
    #[serde(default)]
    contact_by_place: bool,
}

#[derive(Deserialize)]
struct Sheet {
    name: String,
    #[serde(default)]
    kind: String,
    #[serde(default)]
    thickness: f64,
}

/// Places on the edge of a mesh lie in it, however they were rounded (m).
const ROUNDING: f64 = 1e-6;

/// By node of a ply, how much (m) of what its offset in the stack counts does not lie under it: the plies below that end beside it, or
/// have a hole there. `None` where there is nothing of it, and for runs that lay every ply on the whole stack below it.
///
/// # Errors
/// When the run's meshes cannot be read.
pub fn missing_below(
    host: &Host,
    input: &Input,
    name: &str,
) -> Result<Option<Vec<f64>>, StepError> {
    let run: Run = host.attributes(input)?;
    if !run.contact_by_place {
        return Ok(None);
    }
    let meshes = host.meshes(input)?;
    let (nodes, _) = host.mesh(input, meshes.body(name)?)?;
    let mut missing = vec![0.0; nodes.len()];
    for below in run.sheets.iter().take_while(|s| s.name != name) {
        if below.kind != "ply" {
            continue;
        }
        let body = meshes.body(&below.name)?;
        let (points, cells) = host.mesh(input, body)?;
        // Plies of one outline have the same mesh, one above the other.
        let same = |(a, b): (&[f64; 3], &[f64; 3])| a[..2] == b[..2];
        if points.len() == nodes.len() && points.iter().zip(&nodes).all(same) {
            continue;
        }
        let Some(locator) = QuadLocator::new(&points, &cells) else {
            continue;
        };
        for (missing, at) in missing.iter_mut().zip(&nodes) {
            if locator.locate(at[0], at[1], ROUNDING).is_none() {
                *missing += below.thickness;
            }
        }
    }
    Ok(missing.iter().any(|m| *m > 0.0).then_some(missing))
}

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
