//! Surfaces of the bodies of a run.

use crate::{QuadLocator, Surface, triangles};
use plyflow_model::outline::{Point, Region};
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
    /// Of the whole ply, whatever part of it the run has (m); some runs do not tell it.
    #[serde(default)]
    outline: Vec<Point>,
    #[serde(default)]
    holes: Vec<Vec<Point>>,
}

/// Places on the edge of a ply lie on it, however they were rounded (m).
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
        // By the whole ply's outline: in a run of a zone its mesh may end before the upper one's, where the ply itself goes on.
        let under: Box<dyn Fn(Point) -> bool> =
            match Region::new(below.outline.clone(), below.holes.clone()) {
                Ok(region) => Box::new(move |at| {
                    region.contains(at) || region.distance_to_edge(at) <= ROUNDING
                }),
                Err(_) => {
                    let body = meshes.body(&below.name)?;
                    let (points, cells) = host.mesh(input, body)?;
                    let Some(locator) = QuadLocator::new(&points, &cells) else {
                        continue;
                    };
                    Box::new(move |[x, y]| locator.locate(x, y, ROUNDING).is_some())
                }
            };
        for (missing, at) in missing.iter_mut().zip(&nodes) {
            if !under([at[0], at[1]]) {
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
