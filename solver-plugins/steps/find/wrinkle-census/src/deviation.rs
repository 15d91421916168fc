//! How far a ply stands off what it rests on.

use crate::ply::Ply;
use plyflow_geometry::vec3::Vec3;
use plyflow_sdk::{Host, Input, StepError};
use plyflow_surface::{Surface, of_run, triangles};

/// What a ply rests on in a press, where the artifact has it.
const USUAL: [&str; 2] = ["tool", "die"];

/// A rigid surface, and how far (m) the mid-surface of the ply is from it where the stack lies on it.
pub struct Rest {
    surface: Surface,
    offset: f64,
    /// By node of the ply, what (m) of that offset is not there; `None` where all of it is everywhere.
    missing: Option<Vec<f64>>,
}

/// The surfaces `wanted` in a frame, those of the usual names that there are when nothing is wanted.
///
/// # Errors
/// When the artifact has no body of a wanted name, or one without an area.
pub fn rests(
    host: &Host,
    input: &Input,
    frame: usize,
    ply: &Ply,
    wanted: Option<&[String]>,
) -> Result<Vec<Rest>, StepError> {
    let meshes = host.meshes(input)?;
    let usual = || USUAL.map(str::to_owned).to_vec();
    let there = |name: &String| meshes.bodies.iter().any(|b| b.name == *name);
    let names: Vec<String> = match wanted {
        Some(names) => names.to_vec(),
        None => usual().into_iter().filter(there).collect(),
    };
    let mut all = Vec::new();
    for name in &names {
        let Some(body) = meshes.bodies.iter().find(|b| b.name == *name) else {
            let bodies: Vec<&str> = meshes.bodies.iter().map(|b| b.name.as_str()).collect();
            return Err(format!(
                "surfaces: given '{name}'; '{}' has no such body, there are: {}",
                input.step,
                bodies.join(", ")
            )
            .into());
        };
        let (_, cells) = host.mesh(input, body)?;
        let points = host.frame_points(input, body, frame)?;
        let surface = Surface::new(&points, &triangles(body.nodes_per_cell, &cells));
        let surface = surface.ok_or_else(|| {
            format!(
                "surfaces: '{name}' of '{}' has no triangle with an area",
                input.step
            )
        })?;
        // The die lies on the other side of the stack.
        let (offset, missing) = if name == "die" {
            let missing = of_run::missing_above(host, input, &ply.name)?;
            (ply.stack - ply.offset, missing)
        } else {
            (ply.offset, of_run::missing_below(host, input, &ply.name)?)
        };
        let of_part = |all: Vec<f64>| match &ply.part {
            Some(part) => part.at_nodes(&all),
            None => all,
        };
        all.push(Rest {
            surface,
            offset,
            missing: missing.map(of_part),
        });
    }
    Ok(all)
}

/// For every point the least distance from any of the surfaces less that of a ply at rest there (m; thesis eq. 4.1), not below
/// 0: what contact lets a ply sink in is no deviation.
pub fn deviations(points: &[Vec3], rests: &[Rest]) -> Vec<f64> {
    let off = |(i, p): (usize, &Vec3)| {
        let from = |r: &Rest| {
            let off = r.surface.closest(*p).signed_distance.abs() - r.offset;
            r.missing.as_ref().map_or(off, |missing| off + missing[i])
        };
        rests
            .iter()
            .map(from)
            .fold(f64::INFINITY, f64::min)
            .max(0.0)
    };
    points.iter().enumerate().map(off).collect()
}
