//! Tool and plies of a formed run: the same for every step that measures defects.

use crate::{Neighbour, Ply, Shape, Tool};
use plyflow_model::artifact::Forming;
pub use plyflow_model::artifact::Sheet;
use plyflow_sdk::{Host, Input, Meshes, StepError};
use plyflow_surface::draped::Formed;
use plyflow_surface::{Ground, Topology, of_run};

/// The plies next to the one at place `k` of which the run tells the fibre directions, as [`crate::find_causes`] asks for them. `plies`: as many
/// as `sheets`, in the order of the stack.
pub fn neighbours<'a>(sheets: &[Sheet], plies: &'a [Ply], k: usize) -> Vec<Neighbour<'a>> {
    let next = [k.checked_sub(1), Some(k + 1)].into_iter().flatten();
    next.filter_map(|i| {
        let (ply, laid) = (plies.get(i)?, sheets.get(i)?.laid()?);
        Some(Neighbour { ply, laid })
    })
    .collect()
}

/// The tool of a run.
///
/// # Errors
/// When the run has none, or one without a triangle with an area.
pub fn tool(host: &Host, input: &Input) -> Result<Tool, StepError> {
    of_run::rigid(host, input, "tool").map(Tool::new)
}

/// Where there is tool to lie on in a run ([`Ground`]).
pub fn ground(run: &Forming, foot_margin: f64) -> Ground {
    Ground {
        foot_margin,
        bed: !run.without_bed,
    }
}

/// Number of the last frame of a run.
///
/// # Errors
/// When it has none.
pub fn last_frame(input: &Input, meshes: &Meshes) -> Result<usize, StepError> {
    let last = meshes.times.len().checked_sub(1);
    last.ok_or_else(|| format!("'{}' has no frame: there is nothing to measure", input.step).into())
}

/// A frame of a run.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    /// What reads it.
    pub host: &'a Host,
    /// The run.
    pub input: &'a Input,
    /// Number of the frame.
    pub frame: usize,
}

/// A ply in a frame of a run, its distances and curvatures taken; without fields. `offset`: of its mid-surface from the
/// tool (m). Of a net that does not reach everywhere it is the part that is draped ([`plyflow_surface::draped`]).
///
/// # Errors
/// When the run has no such body, or its mesh or frame cannot be read.
pub fn ply(
    of: Frame<'_>,
    (name, offset): (&str, f64),
    tool: &Tool,
    foot_margin: f64,
) -> Result<Ply, StepError> {
    Ok(part_of_ply(of, (name, offset), tool, foot_margin)?.0)
}

fn part_of_ply(
    of: Frame<'_>,
    (name, offset): (&str, f64),
    tool: &Tool,
    foot_margin: f64,
) -> Result<(Ply, Formed), StepError> {
    let Frame { host, input, frame } = of;
    let meshes = host.meshes(input)?;
    let body = meshes.body(name)?;
    let mut formed = Formed::read(host, input, body, frame)?;
    let topology = Topology::new(formed.flat.len(), body.nodes_per_cell, &formed.cells);
    let mut ply = Ply::new(
        name.to_owned(),
        Shape {
            topology,
            undeformed: std::mem::take(&mut formed.flat),
            formed: std::mem::take(&mut formed.points),
        },
        tool,
        offset,
        ground(&host.attributes(input)?, foot_margin),
    );
    if let Some(missing) = of_run::missing_below(host, input, name)? {
        ply.lower(&formed.at_nodes(missing));
    }
    Ok((ply, formed))
}

/// As [`ply`], with its shear angle and, where the run has them, its fibre strains.
///
/// # Errors
/// When the run has no such body or no shear angle, or they cannot be read.
pub fn strained_ply(
    of: Frame<'_>,
    sheet: &Sheet,
    tool: &Tool,
    foot_margin: f64,
) -> Result<Ply, StepError> {
    let Frame { host, input, frame } = of;
    let meshes = host.meshes(input)?;
    let body = meshes.body(&sheet.name)?;
    let place = (sheet.name.as_str(), sheet.offset);
    let (mut ply, part) = part_of_ply(of, place, tool, foot_margin)?;
    let field = |name: &str| -> Result<Vec<f64>, StepError> {
        Ok(part.of_cells(host.frame_field(input, body, frame, name)?))
    };
    ply.shear_angle = field("shear_angle")?;
    // Not every run has them: a pin-jointed net's fibres have no strain.
    let names = ["fibre_strain_1", "fibre_strain_2"];
    let has = |name: &&str| body.fields.iter().any(|f| f.name == **name);
    if names.iter().all(has) {
        let [a, b] = names.map(field);
        let (a, b) = (a?, b?);
        ply.fibre_strain = a.iter().zip(&b).map(|(a, b)| a.min(*b)).collect();
        ply.fibre_strains = [a, b];
    }
    Ok(ply)
}
