//! The tool as the sheets of a model see it.

use crate::error::{FormingError, Result};
use crate::request::Parameters;
use crate::stack::place::SheetIndex;
use plyflow_geometry::vec3::{Vec3, cross, norm, sub};
use plyflow_mechanics::contact::RigidSurface;
use plyflow_mechanics::model::Model;
use plyflow_tooling::{PartField, RigidTool, SignedDistanceGrid, given};
use std::sync::Arc;

/// The tool of the scene, with its distance field.
///
/// # Errors
/// When it has no surface, or the field cannot follow it.
pub fn rigid(p: &Parameters) -> Result<RigidTool> {
    given::rigid(&p.scene, p.tool_grid).map_err(FormingError::Tool)
}

/// The tool as contacts see it.
pub struct ToolSurface(pub SignedDistanceGrid);

impl RigidSurface for ToolSurface {
    fn distance(&self, point: Vec3) -> (f64, Vec3) {
        self.0.distance_and_gradient(point)
    }

    /// A field of the whole tool is too large for the cache.
    fn is_costly(&self) -> bool {
        true
    }
}

/// A part of a stamping as contacts see it.
pub struct PartSurface(pub PartField);

impl RigidSurface for PartSurface {
    fn distance(&self, point: Vec3) -> (f64, Vec3) {
        self.0.distance_and_gradient(point)
    }

    fn is_costly(&self) -> bool {
        true
    }
}

/// A tool as sheets of different elements see it: where nodes lie when the elements are as long as the tool
/// ([`SignedDistanceGrid::of_equal_length`]).
pub struct ToolSurfaces {
    distance: SignedDistanceGrid,
    /// Size of elements (m), and what they see.
    made: Vec<(f64, Arc<ToolSurface>)>,
}

/// Sizes of elements that differ by less than this share see the same surface.
const SAME_SIZE: f64 = 0.05;

impl ToolSurfaces {
    /// Of a tool with this distance field.
    pub fn new(distance: SignedDistanceGrid) -> Self {
        Self {
            distance,
            made: Vec::new(),
        }
    }

    /// What a sheet of the model sees, while it is flat.
    pub fn of(&mut self, model: &Model, sheet: SheetIndex) -> Arc<dyn RigidSurface> {
        let cells = sheet.cells(model).iter();
        self.of_cells(cells.map(|cell| cell.map(|n| model.x()[n as usize])))
    }

    /// What a flat sheet sees whose cells have these corners (m).
    pub fn of_cells(
        &mut self,
        cells: impl Iterator<Item = [Vec3; 4]> + Clone,
    ) -> Arc<dyn RigidSurface> {
        let size = typical_size(cells, self.distance.tool_bounds());
        let same = |(s, _): &&(f64, _)| (s - size).abs() < SAME_SIZE * size;
        if let Some((_, surface)) = self.made.iter().find(same) {
            return surface.clone();
        }
        let surface = Arc::new(ToolSurface(self.distance.of_equal_length(size)));
        self.made.push((size, surface.clone()));
        surface
    }
}

/// The side (m) of a square as large as the median element of a flat sheet over the tool, whose box is given: towards the frame a film's
/// elements grow, and of a large frame most may be large. Of one that lies nowhere over it, of all its elements.
fn typical_size(cells: impl Iterator<Item = [Vec3; 4]> + Clone, [low, high]: [Vec3; 2]) -> f64 {
    let area = |[a, b, c, d]: [Vec3; 4]| 0.5 * norm(cross(sub(c, a), sub(d, b)));
    let is_over = |corners: &[Vec3; 4]| {
        (0..2).all(|k| {
            let centre = 0.25 * corners.iter().map(|x| x[k]).sum::<f64>();
            low[k] <= centre && centre <= high[k]
        })
    };
    let mut areas: Vec<f64> = cells.clone().filter(is_over).map(area).collect();
    if areas.is_empty() {
        areas = cells.map(area).collect();
    }
    areas.sort_by(f64::total_cmp);
    areas.get(areas.len() / 2).map_or(0.0, |a| a.sqrt())
}
