//! The ply whose wrinkles are counted.

use crate::moments;
use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{Forming, Sheet};
use plyflow_sdk::{Host, Input, On, StepError};
use plyflow_surface::draped::{DrapedPart, Formed};
use plyflow_surface::of_run::check_quads;

/// A ply in its last frame.
pub struct Ply {
    pub name: String,
    /// Undeformed and formed points (m).
    pub flat: Vec<Vec3>,
    pub points: Vec<Vec3>,
    pub cells: Vec<u32>,
    pub shear: Vec<f64>,
    /// Distance of its mid-surface from the tool when the stack lies on it, and thickness of the stack (m).
    pub offset: f64,
    pub stack: f64,
    /// What of it is bent how much; `None` when the artifact does not say.
    pub moments: Option<(On, Vec<f64>)>,
    /// What of the run's ply this is; `None`: all.
    pub part: Option<DrapedPart>,
}

/// Number of the last frame of a run.
///
/// # Errors
/// When it has none.
pub fn last_frame(host: &Host, input: &Input) -> Result<usize, StepError> {
    let frames = host.meshes(input)?.times.len();
    let last = frames.checked_sub(1);
    last.ok_or_else(|| format!("'{}' has no frame to measure", input.step).into())
}

/// The ply of that name, or the first.
///
/// # Errors
/// When the run has no such ply, or one that is not of quads.
pub fn read(
    host: &Host,
    input: &Input,
    frame: usize,
    wanted: Option<&str>,
) -> Result<Ply, StepError> {
    let formed: Forming = host.attributes(input)?;
    let plies: Vec<&Sheet> = formed.plies().collect();
    let sheet = match wanted {
        Some(name) => plies.iter().find(|s| s.name == name).ok_or_else(|| {
            let there: Vec<&str> = plies.iter().map(|s| s.name.as_str()).collect();
            format!("ply: given '{name}'; expected one of {}", there.join(", "))
        })?,
        None => plies
            .first()
            .ok_or_else(|| format!("'{}' has no ply", input.step))?,
    };
    let meshes = host.meshes(input)?;
    let body = meshes.body(&sheet.name)?;
    check_quads(&format!("ply '{}'", sheet.name), body)?;
    let part = Formed::read(host, input, body, frame)?;
    let shear = host.frame_field(input, body, frame, "shear_angle")?;
    let moments = moments::read(host, input, body, frame)?;
    Ok(Ply {
        name: sheet.name.clone(),
        shear: part.of_cells(shear),
        moments: moments.map(|(on, values)| match on {
            On::Points => (on, part.at_nodes(values)),
            On::Cells => (on, part.of_cells(values)),
        }),
        offset: sheet.offset,
        stack: formed.sheets.iter().map(|s| s.thickness).sum(),
        points: part.points,
        flat: part.flat,
        cells: part.cells,
        part: part.part,
    })
}
