//! The tool as the sheets of a model see it.

use plyflow_mechanics::contact::RigidSurface;
use plyflow_mechanics::model::Model;
use plyflow_mechanics::vec3::{V, cross, norm, sub};
use plyflow_model::material::MaterialEntry;
use plyflow_model::scene::{Process, Scene, Sheet, StlTool, Tool};
use plyflow_tooling::{SignedDistanceGrid, ToolMesh};
use std::sync::Arc;

/// Tool mesh and its distance field.
///
/// # Errors
/// When the tool cannot be built.
pub fn build(scene: &Scene, spacing: f64) -> Result<(ToolMesh, SignedDistanceGrid), String> {
    let mesh = plyflow_tooling::build(&scene.tool).map_err(|e| e.to_string())?;
    if let (Tool::Stl(stl), Process::DoubleDiaphragm(_)) = (&scene.tool, &scene.process) {
        check_foot(stl, mesh.bounds()[0][2])?;
    }
    // Contact acts at distances of the stack's thickness; a few cells around it are plenty.
    let thickness = |sheet: &Sheet| match &sheet.material {
        MaterialEntry::Inline(material) => material.thickness.si(),
        // None is left when a scene is built.
        MaterialEntry::File(_) | MaterialEntry::Varied(_) => 0.0,
    };
    let stack: f64 = scene.sheets.iter().map(thickness).sum();
    let reach = (4.0 * spacing).max(0.01).max(2.0 * stack);
    check_size(scene, &mesh, spacing, reach)?;
    let grid = SignedDistanceGrid::build(&mesh, spacing, reach);
    Ok((mesh, grid))
}

/// How far (m) a file's lowest point may lie from the bed: what single precision leaves of a metre and more.
const FOOT: f64 = 1e-5;

/// Whether a tool stands on the bed. What is below it would take room from the air that is drawn, and under one that floats the film
/// would be drawn in.
fn check_foot(stl: &StlTool, low: f64) -> Result<(), String> {
    if low.abs() <= FOOT {
        return Ok(());
    }
    let [x, y, z] = stl.translate.map(|l| l.si());
    Err(format!(
        "scene.tool.stl: the lowest point of {} lies at z = {:.3} mm; expected a tool that stands on the bed, z = 0, with its axis at x = y = 0: \
         `translate: [{} mm, {} mm, {} mm]`, and `unit` the length of one unit of the file",
        stl.file,
        1e3 * low,
        1e3 * x,
        1e3 * y,
        1e3 * (z - low)
    ))
}

/// Most values (of four bytes, and eight while they are made) of a tool's distance field.
const MOST_VALUES: f64 = 4e8;

/// Whether a tool's distance field can be kept.
fn check_size(scene: &Scene, mesh: &ToolMesh, spacing: f64, reach: f64) -> Result<(), String> {
    let [low, high] = mesh.bounds();
    let size: V = std::array::from_fn(|k| high[k] - low[k]);
    let values: f64 = size
        .iter()
        .map(|s| (s + 2.0 * reach) / spacing + 6.0)
        .product();
    if values <= MOST_VALUES {
        return Ok(());
    }
    let unit = match &scene.tool {
        Tool::Stl(stl) => format!(
            "; is `unit` ({} m) the length of one unit of the file?",
            stl.unit.si()
        ),
        _ => String::new(),
    };
    Err(format!(
        "the tool spans {:.3} x {:.3} x {:.3} m, and its distance field would have {values:.1e} values {:.3} mm apart; expected at most \
         {MOST_VALUES:.0e}: take a larger `tool_grid`{unit}",
        size[0],
        size[1],
        size[2],
        1e3 * spacing
    ))
}

/// The tool as contacts see it.
pub struct ToolSurface(pub SignedDistanceGrid);

impl RigidSurface for ToolSurface {
    fn distance(&self, point: V) -> (f64, V) {
        self.0.distance_and_gradient(point)
    }

    /// A field of the whole tool is too large for the cache.
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
    pub fn of(&mut self, model: &Model, sheet: usize) -> Arc<dyn RigidSurface> {
        let size = typical_size(model, sheet, self.distance.tool_bounds());
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
fn typical_size(model: &Model, sheet: usize, [low, high]: [V; 2]) -> f64 {
    let (from, to) = model.sheets[sheet].cell_range;
    let corners = |cell: &[u32; 4]| cell.map(|n| model.x[n as usize]);
    let area = |cell: &&[u32; 4]| {
        let [a, b, c, d] = corners(cell);
        0.5 * norm(cross(sub(c, a), sub(d, b)))
    };
    let is_over = |cell: &&[u32; 4]| {
        let corners = corners(cell);
        (0..2).all(|k| {
            let centre = 0.25 * corners.iter().map(|x| x[k]).sum::<f64>();
            low[k] <= centre && centre <= high[k]
        })
    };
    let cells = &model.cells[from..to];
    let mut areas: Vec<f64> = cells.iter().filter(is_over).map(|c| area(&c)).collect();
    if areas.is_empty() {
        areas = cells.iter().map(|c| area(&c)).collect();
    }
    areas.sort_by(f64::total_cmp);
    areas.get(areas.len() / 2).map_or(0.0, |a| a.sqrt())
}
