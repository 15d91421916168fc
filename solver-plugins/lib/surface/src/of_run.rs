//! Surfaces of the bodies of a run.

use crate::{Surface, triangles};
use plyflow_geometry::QuadLocator;
use plyflow_model::artifact::{Forming, Sheet};
use plyflow_model::outline::{Point, Region};
use plyflow_sdk::{BodyInfo, Host, Input, Meshes, StepError};

/// Whether a body is of quads.
///
/// # Errors
/// Calls the body `what` and says how many nodes its cells have, when it is not.
pub fn check_quads(what: &str, body: &BodyInfo) -> Result<(), StepError> {
    match body.nodes_per_cell {
        4 => Ok(()),
        n => Err(format!("{what} has cells of {n} nodes; quads are expected").into()),
    }
}

/// Places on the edge of a ply lie on it, however they were rounded (m).
const ROUNDING: f64 = 1e-6;

/// A ply of a stack: where it lies in the flat plane, and how thick it is (m).
struct Lying {
    name: String,
    thickness: f64,
    covers: Box<dyn Fn(Point) -> bool>,
}

impl Lying {
    /// `None` for what is no ply.
    fn read(
        host: &Host,
        input: &Input,
        meshes: &Meshes,
        sheet: &Sheet,
    ) -> Result<Option<Self>, StepError> {
        if !sheet.is_ply() {
            return Ok(None);
        }
        // By the whole ply's outline: in a run of a zone its mesh may end before the upper one's, where the ply itself goes on.
        let covers: Box<dyn Fn(Point) -> bool> = match Region::new(
            sheet.outline.clone().unwrap_or_default(),
            sheet.holes.clone(),
        ) {
            Ok(region) => {
                Box::new(move |at| region.contains(at) || region.distance_to_edge(at) <= ROUNDING)
            }
            Err(_) => {
                let body = meshes.body(&sheet.name)?;
                let (points, cells) = host.mesh(input, body)?;
                let Some(locator) = QuadLocator::new(&points, &cells) else {
                    return Ok(None);
                };
                Box::new(move |[x, y]| locator.locate(x, y, ROUNDING).is_some())
            }
        };
        Ok(Some(Self {
            name: sheet.name.clone(),
            thickness: sheet.thickness,
            covers,
        }))
    }

    /// What of it (m) does not lie at a place of the flat plane.
    fn missing(&self, at: Point) -> f64 {
        if (self.covers)(at) {
            0.0
        } else {
            self.thickness
        }
    }
}

/// Where the plies of a run lie.
pub struct Stack {
    plies: Vec<Lying>,
}

impl Stack {
    /// `None` for runs that lay every ply on the whole stack below it.
    ///
    /// # Errors
    /// When the run's meshes cannot be read.
    pub fn read(host: &Host, input: &Input) -> Result<Option<Self>, StepError> {
        let run: Forming = host.attributes(input)?;
        if !run.contact_by_place {
            return Ok(None);
        }
        let meshes = host.meshes(input)?;
        let plies = run
            .sheets
            .iter()
            .map(|s| Lying::read(host, input, &meshes, s));
        let plies: Vec<Option<Lying>> = plies.collect::<Result<_, _>>()?;
        Ok(Some(Self {
            plies: plies.into_iter().flatten().collect(),
        }))
    }

    /// Leaves out the plies above one.
    pub fn up_to(&mut self, name: &str) {
        if let Some(last) = self.plies.iter().position(|p| p.name == name) {
            self.plies.truncate(last + 1);
        }
    }

    /// Thickness (m) of all plies but the one of that name, that do not lie where that one has the place `at` in the flat plane.
    pub fn missing_beside(&self, name: &str, at: Point) -> f64 {
        let others = self.plies.iter().filter(|p| p.name != name);
        others.map(|p| p.missing(at)).sum()
    }
}

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
    missing(host, input, name, |sheets, own| &sheets[..own])
}

/// As [`missing_below`], of the plies above: by what a ply is nearer to a die that closes the stack.
///
/// # Errors
/// When the run's meshes cannot be read.
pub fn missing_above(
    host: &Host,
    input: &Input,
    name: &str,
) -> Result<Option<Vec<f64>>, StepError> {
    missing(host, input, name, |sheets, own| {
        sheets.get(own + 1..).unwrap_or_default()
    })
}

fn missing(
    host: &Host,
    input: &Input,
    name: &str,
    others: impl Fn(&[Sheet], usize) -> &[Sheet],
) -> Result<Option<Vec<f64>>, StepError> {
    let run: Forming = host.attributes(input)?;
    if !run.contact_by_place {
        return Ok(None);
    }
    let meshes = host.meshes(input)?;
    let (nodes, _) = host.mesh(input, meshes.body(name)?)?;
    let own = run.sheets.iter().position(|s| s.name == name);
    let mut missing = vec![0.0; nodes.len()];
    for sheet in others(&run.sheets, own.unwrap_or(run.sheets.len())) {
        let Some(ply) = Lying::read(host, input, &meshes, sheet)? else {
            continue;
        };
        for (missing, at) in missing.iter_mut().zip(&nodes) {
            *missing += ply.missing([at[0], at[1]]);
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
