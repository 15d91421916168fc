//! The tool as the sheets of a model see it.

use plyflow_mechanics::contact::RigidSurface;
use plyflow_mechanics::model::Model;
use plyflow_mechanics::vec3::{V, cross, dot, norm, sub};
use plyflow_model::material::MaterialEntry;
use plyflow_model::scene::{Process, Scene, Sheet, StlTool, Tool};
use plyflow_tooling::{FieldError, SignedDistanceGrid, SurfaceTree, ToolMesh};
use std::sync::Arc;

/// A tool as it is given, and as contacts see it.
pub struct Built {
    /// Its triangles.
    pub mesh: ToolMesh,
    /// Its distance field.
    pub grid: SignedDistanceGrid,
    /// By how much they differ.
    pub error: FieldError,
}

/// Tool mesh and its distance field.
///
/// # Errors
/// When the tool cannot be built.
pub fn build(scene: &Scene, spacing: f64) -> Result<Built, String> {
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
    check_unit(scene, &mesh, spacing)?;
    check_size(scene, &mesh, spacing, reach)?;
    let grid = SignedDistanceGrid::build(&mesh, spacing, reach);
    if let Tool::Stl(_) = &scene.tool {
        check_walls(&mesh, &grid)?;
    }
    let error = grid.error_against(&mesh, stack, |_| true);
    Ok(Built { mesh, grid, error })
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

/// Whether a tool of a file is more than a speck: a wrong `unit` would leave a run without any.
fn check_unit(scene: &Scene, mesh: &ToolMesh, spacing: f64) -> Result<(), String> {
    let [low, high] = mesh.bounds();
    let size: V = std::array::from_fn(|k| high[k] - low[k]);
    let largest = size.into_iter().fold(0.0, f64::max);
    let (Tool::Stl(stl), true) = (&scene.tool, largest < 4.0 * spacing) else {
        return Ok(());
    };
    Err(format!(
        "scene.tool.stl: {} spans {:.3} x {:.3} x {:.3} mm, less than four spacings of its distance field (`tool_grid`, {:.3} mm); expected a \
         tool: is `unit` ({} m) the length of one unit of the file?",
        stl.file,
        1e3 * size[0],
        1e3 * size[1],
        1e3 * size[2],
        1e3 * spacing,
        stl.unit.si()
    ))
}

/// Whether walls of a tool are in its distance field, which knows nothing between two of its points: of one thinner than the spacing it may have
/// nothing, and sheets go through it.
fn check_walls(mesh: &ToolMesh, grid: &SignedDistanceGrid) -> Result<(), String> {
    let tree = SurfaceTree::new(mesh);
    let spacing = grid.spacing();
    let depth = 0.75 * spacing;
    let corners = |t: usize| mesh.triangles[t].map(|i| mesh.points[i as usize]);
    let vector = |[a, b, c]: [V; 3]| cross(sub(b, a), sub(c, a));
    let foot = mesh.bounds()[0][2] + depth;
    let (mut area, mut worst) = (0.0, None::<(f64, V)>);
    for t in 0..mesh.triangles.len() {
        let facet = corners(t);
        let twice = vector(facet);
        let size = norm(twice);
        let middle: V = std::array::from_fn(|k| (0..3).map(|i| facet[i][k]).sum::<f64>() / 3.0);
        if size == 0.0 || middle[2] < foot {
            continue;
        }
        let normal = twice.map(|c| c / size);
        let inside = |d: f64| -> V { std::array::from_fn(|k| middle[k] - d * normal[k]) };
        let found = tree.closest(inside(depth));
        let other = vector(corners(found.triangle as usize));
        let faces_away = dot(other, normal) < -0.5 * norm(other);
        if !faces_away || found.signed_distance.abs() > 0.99 * depth {
            continue;
        }
        // The middle of the wall lies half of its thickness inside: at the least half of that has to be seen.
        let thickness = depth - found.signed_distance;
        let seen = -grid.distance_and_gradient(inside(0.5 * thickness)).0;
        if seen < 0.25 * thickness {
            area += 0.5 * size;
            if worst.is_none_or(|(w, _)| thickness < w) {
                worst = Some((thickness, middle));
            }
        }
    }
    match worst {
        Some((thickness, at)) if area > 4.0 * spacing * spacing => {
            let [x, y, z] = at.map(|c| 1e3 * c);
            Err(format!(
                "scene.tool.stl: walls {:.2} mm thin and more, such as at ({x:.1}, {y:.1}, {z:.1}) mm, are lost between the points of the tool's \
                 distance field, {:.2} mm apart: sheets would go through {:.0} mm2 of them. Expected at least two spacings in a wall: \
                 `tool_grid: {:.2} mm`, or leave such walls out of the file",
                1e3 * thickness,
                1e3 * spacing,
                1e6 * area,
                1e3 * 0.5 * thickness
            ))
        }
        _ => Ok(()),
    }
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
