//! Tool and plies of a formed run.

use crate::{Ply, Tool};
use plyflow_sdk::{Host, Input, Meshes, StepError};
use plyflow_surface::{Topology, of_run};

/// The tool of a run.
///
/// # Errors
/// When the run has none, or one without a triangle with an area.
pub fn tool(host: &Host, input: &Input) -> Result<Tool, StepError> {
    of_run::rigid(host, input, "tool").map(Tool::new)
}

/// Number of the last frame of a run.
///
/// # Errors
/// When it has none.
pub fn last_frame(input: &Input, meshes: &Meshes) -> Result<usize, StepError> {
    let last = meshes.times.len().checked_sub(1);
    last.ok_or_else(|| format!("'{}' has no frame: there is nothing to measure", input.step).into())
}

/// A ply in the frame `frame` of a run, its distances and curvatures taken; without fields. `offset`: of its mid-surface from the
/// tool (m).
///
/// # Errors
/// When the run has no such body, or its mesh or frame cannot be read.
pub fn ply(
    host: &Host,
    input: &Input,
    frame: usize,
    (name, offset): (&str, f64),
    tool: &Tool,
    foot_margin: f64,
) -> Result<Ply, StepError> {
    let meshes = host.meshes(input)?;
    let body = meshes.body(name)?;
    let (undeformed, cells) = host.mesh(input, body)?;
    let topology = Topology::new(undeformed.len(), body.nodes_per_cell, &cells);
    let formed = host.frame_points(input, body, frame)?;
    let name = name.to_owned();
    Ok(Ply::new(
        name,
        topology,
        undeformed,
        formed,
        tool,
        offset,
        foot_margin,
    ))
}
