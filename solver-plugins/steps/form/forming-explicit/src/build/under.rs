//! How much of the plies under a rigid part a zone has.

use crate::build::drawn::Drawn;
use crate::error::{FormingError, Result};
use crate::load::Guide;
use crate::request::{LocalInput, LocalSheet};
use crate::stack::{StackSheet, sheet};
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::mesh::{QuadMesh, area_vector};
use plyflow_tooling::ToolMesh;

/// How far a part may be pushed off the way that it had in the run of the whole until its whole force holds it, over the thickness of the thinnest ply: far
/// more than contacts give way, which is micrometres, and less than anything that counts as a wrinkle.
const SLACK: f64 = 0.5;

/// A zone, and the plies of the whole.
pub struct Under<'a> {
    /// What drives it.
    pub input: &'a LocalInput,
    /// All plies of the scene.
    pub whole: &'a [StackSheet],
}

impl Under<'_> {
    /// How a part of a stamping that is pressed goes in the zone.
    ///
    /// # Errors
    /// When the boundary does not tell its way, or a ply cannot be meshed.
    pub fn guide_of(&self, part: &Drawn) -> Result<Guide> {
        self.guide(part.name.word(), &|p| is_under(&part.mesh, p))
    }

    /// How the part of that name goes, which has the places of the flat plies `under` it.
    ///
    /// # Errors
    /// As [`Under::guide_of`].
    pub fn guide(&self, name: &str, under: &dyn Fn(Vec3) -> bool) -> Result<Guide> {
        let (mut own, mut all) = (0.0, 0.0);
        for ply in self.whole {
            let meshed = sheet::blank(ply)?.mesh(self.input.element_size);
            let (mesh, _) = meshed.map_err(|source| {
                let ply = ply.scene.name.clone();
                FormingError::Mesh { ply, source }
            })?;
            all += areas(&mesh, under).iter().sum::<f64>();
            let of_name = |s: &&LocalSheet| s.name == ply.scene.name;
            if let Some(local) = self.input.sheets.iter().find(of_name) {
                let mesh = QuadMesh {
                    points: local.points.clone(),
                    cells: local.cells.clone(),
                };
                // What is driven does not push back.
                let mut free = areas(&mesh, under);
                local.driven.iter().for_each(|n| free[*n as usize] = 0.0);
                own += free.iter().sum::<f64>();
            }
        }
        let thicknesses = self.whole.iter().map(|s| s.thickness);
        Ok(Guide {
            way: self.input.way_of(name)?,
            share: if all > 0.0 { (own / all).min(1.0) } else { 1.0 },
            slack: SLACK * thicknesses.fold(f64::INFINITY, f64::min),
        })
    }
}

/// By node of a flat mesh, the area (m2) that it stands for if it lies `under` the part.
fn areas(mesh: &QuadMesh, under: &dyn Fn(Vec3) -> bool) -> Vec<f64> {
    let lies: Vec<bool> = mesh.points.iter().map(|p| under(*p)).collect();
    let mut areas = vec![0.0; mesh.points.len()];
    for cell in &mesh.cells {
        let quarter = 0.25 * area_vector(cell.map(|n| mesh.points[n as usize]))[2].abs();
        for n in cell.iter().filter(|n| lies[**n as usize]) {
            areas[*n as usize] += quarter;
        }
    }
    areas
}

/// Whether a place lies over or under a part, seen from above.
fn is_under(part: &ToolMesh, p: Vec3) -> bool {
    part.triangles.iter().any(|t| {
        let [a, b, c] = t.map(|n| part.points[n as usize]);
        let side = |q: Vec3, r: Vec3| (r[0] - q[0]) * (p[1] - q[1]) - (r[1] - q[1]) * (p[0] - q[0]);
        // Walls that stand upright have no area from above.
        let upright = side_of(a, b, c).abs() < 1e-18;
        let sides = [side(a, b), side(b, c), side(c, a)];
        !upright && (sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0))
    })
}

/// Twice the area (m2) of a triangle seen from above.
fn side_of(a: Vec3, b: Vec3, c: Vec3) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}
