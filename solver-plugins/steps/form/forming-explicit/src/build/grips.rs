//! Grippers: which nodes of a ply each holds, and what share of its force they have.

use crate::error::{FormingError, Result};
use crate::load::Grip;
use crate::request::LocalInput;
use crate::stack::{StackSheet, sheet};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::mesh::{QuadMesh, area_vector};
use plyflow_mechanics::model::Model;
use plyflow_model::scene::{Gripper, Stamping};

/// Share of what keeps a node stable that the spring of a gripper may take.
const MOST_SPRING: f64 = 0.1;
/// Nodes this near (m) to the side of a gripper's place lie in it, however they were rounded.
const ROUNDING: f64 = 1e-9;

/// A zone of a stamping: what its boundary gives, and the plies of it.
pub struct Cut<'a> {
    /// The boundary.
    pub input: &'a LocalInput,
    /// The plies that the zone has.
    pub stack: &'a [StackSheet],
}

/// The nodes of grippers, with their shares of the force by mass. Of a zone only those that lie in it: the cut goes as what lies outside lets it.
///
/// # Errors
/// When one holds no node of its ply, or its spring is too stiff for the step `dt` (s).
pub fn grips(
    stamping: &Stamping,
    model: &Model,
    dt: f64,
    zone: Option<&Cut<'_>>,
) -> Result<Vec<Grip>> {
    let all = stamping.grippers.iter().enumerate();
    all.map(|(k, words)| grip(k, words, model, dt, zone))
        .collect()
}

/// The rectangle of a ply that a gripper holds (m).
struct Place {
    centre: [f64; 2],
    half: [f64; 2],
}

impl Place {
    fn new(words: &Gripper) -> Self {
        Self {
            centre: words.centre.map(|c| c.si()),
            half: [0.5 * words.length.si(), 0.5 * words.width.si()],
        }
    }

    fn holds(&self, p: Vec3) -> bool {
        (0..2).all(|d| (p[d] - self.centre[d]).abs() <= self.half[d] + ROUNDING)
    }

    /// Area (m2) of a flat mesh that its nodes in this place stand for.
    fn area(&self, mesh: &QuadMesh) -> f64 {
        let cells = mesh.cells.iter();
        let share = |cell: &[u32; 4]| {
            let [a, b, c, d] = cell.map(|n| mesh.points[n as usize]);
            let held = [a, b, c, d].iter().filter(|p| self.holds(**p)).count();
            0.25 * held as f64 * area_vector([a, b, c, d])[2].abs()
        };
        cells.map(share).sum()
    }
}

fn grip(k: usize, words: &Gripper, model: &Model, dt: f64, zone: Option<&Cut<'_>>) -> Result<Grip> {
    let at = format!("process.stamping.grippers[{k}]");
    let place = Place::new(words);
    let found = model.sheets().iter().find(|s| s.name == words.ply);
    if found.is_none() && zone.is_none() {
        let text = format!("{at}.ply: no ply is called `{}`", words.ply);
        return Err(FormingError::Scene(text));
    }
    let start = model.start();
    let inside = |n: &&u32| place.holds(start[**n as usize]);
    let nodes = found.map_or(&[][..], |s| &s.nodes[..]);
    let nodes: Vec<u32> = nodes.iter().filter(inside).copied().collect();
    if nodes.is_empty() && zone.is_none() {
        return Err(FormingError::Scene(format!(
            "{at}: no node of `{}` lies in its rectangle of {:.1} x {:.1} mm about ({:.1}, {:.1}) mm; expected one as large as an element, on the ply",
            words.ply,
            2e3 * place.half[0],
            2e3 * place.half[1],
            1e3 * place.centre[0],
            1e3 * place.centre[1]
        )));
    }
    let mass = |n: &u32| model.mass()[*n as usize];
    let own: f64 = nodes.iter().map(mass).sum();
    let whole = match zone {
        Some(cut) if !nodes.is_empty() => own * over_own(&place, words, cut)?,
        _ => own,
    };
    let spring = words.spring.map_or(0.0, |s| s.si());
    let most = MOST_SPRING * whole / (dt * dt);
    if spring > most && !nodes.is_empty() {
        return Err(FormingError::Scene(format!(
            "{at}.spring: given {spring:.3e} N/m; expected at most {most:.3e} N/m, which the {} nodes that it holds can follow in steps of {dt:.2e} s: \
             take a larger place, or a smaller `time_step`",
            nodes.len()
        )));
    }
    let (s, c) = words.pull.si().fixed_sin_cos();
    let of = |n: u32| (n, mass(&n) / whole, start[n as usize]);
    Ok(Grip {
        nodes: nodes.into_iter().map(of).collect(),
        pull: [c, s, 0.0],
        force: words.force.si(),
        spring,
    })
}

/// How many times as much of the whole ply a gripper holds as of a zone's, by area; the whole is meshed in the zone's elements.
fn over_own(place: &Place, words: &Gripper, cut: &Cut<'_>) -> Result<f64> {
    let sheet = cut.stack.iter().find(|s| s.scene.name == words.ply);
    let local = cut.input.sheets.iter().find(|s| s.name == words.ply);
    let (Some(sheet), Some(local)) = (sheet, local) else {
        return Ok(1.0);
    };
    let own = place.area(&QuadMesh {
        points: local.points.clone(),
        cells: local.cells.clone(),
    });
    let (mesh, _) = (sheet::blank(sheet)?.mesh(cut.input.element_size)).map_err(|source| {
        let ply = words.ply.clone();
        FormingError::Mesh { ply, source }
    })?;
    Ok((place.area(&mesh) / own).max(1.0))
}
