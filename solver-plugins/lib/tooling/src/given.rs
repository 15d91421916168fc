//! Whether the tool that is computed is the tool that was given: the checks of all steps that form over a scene's tool.

use crate::advise::{advice, other_way_up};
use crate::audit::FieldError;
use crate::build::{Built, built};
use crate::checks::{check_placed, mm, place, size, thickness, unit_question};
use crate::error::ToolError;
use crate::mesh::ToolMesh;
use crate::sdf::SignedDistanceGrid;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::ToolPlacement;
use plyflow_model::scene::{Process, Scene};

pub use crate::checks::{DEFAULT_SPACING, thinnest_ply, unlike_sizes};

/// Share of the thinnest ply that a tool's field may be off by where a sheet can touch it.
const SHARE: f64 = 0.1;

/// Most values (of four bytes, and eight while they are made) of a tool's distance field.
const MOST_VALUES: f64 = 4e8;

/// Most values of a field that is tried out to see whether it would do.
const MOST_TRIED: f64 = 3e7;

/// A tool that passed all checks, and its distance field.
pub struct RigidTool {
    /// Its triangles.
    pub mesh: ToolMesh,
    /// What contacts see.
    pub field: SignedDistanceGrid,
    /// By how much both differ at most, wherever it is.
    pub error: FieldError,
    /// How it has been put in its place, by more than `translate`.
    pub placement: Option<ToolPlacement>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// The triangles of a scene's tool, once they are known to be a tool in the right place: its file can be read and has one outside
/// ([`crate::build`]), it is no speck beside `spacing` (m), stands on the bed with all of its bodies, fits into the frame and has no walls
/// thinner than a ply.
///
/// # Errors
/// A text for the user: what was given, what is expected, what to do; of a file's or a step's tool that would pass if it were put another way,
/// the words that put it so.
pub fn checked(scene: &Scene, spacing: f64) -> Result<Built, String> {
    let built = match built(&scene.tool) {
        Ok(built) => built,
        Err(e @ (ToolError::Surface { .. } | ToolError::Input { .. })) => {
            let advice = advice(scene, spacing).unwrap_or_default();
            return Err(format!("{e}{advice}"));
        }
        Err(e) => return Err(e.to_string()),
    };
    match check_placed(scene, &built.mesh, spacing) {
        Ok(()) => Ok(built),
        Err(e) => Err(e + &advice(scene, spacing).unwrap_or_default()),
    }
}

/// What to say of how a tool has been put in its place.
pub fn placement_told(placement: &ToolPlacement) -> String {
    let row = |k: usize| {
        let row = placement.matrix[k].map(|v| format!("{v}"));
        format!("[{}]", row.join(", "))
    };
    format!(
        "the tool is put in its place by the matrix [{}, {}, {}], which takes (x, y, z, 1) of its file, in m, to the scene",
        row(0),
        row(1),
        row(2)
    )
}

/// A scene's tool, [`checked`], and its distance field with points `spacing` (m) apart and more where the tool is sharper.
///
/// # Errors
/// As [`checked`]; and where sheets can touch the tool and the field is off by more than a tenth of the thinnest ply, with the spacing
/// that would do.
pub fn rigid(scene: &Scene, spacing: f64) -> Result<RigidTool, String> {
    let Built { mesh, placement } = checked(scene, spacing)?;
    let ply = thinnest_ply(scene);
    let tolerance = SHARE * ply;
    let touched = touched(scene, &mesh);
    let (field, error) = field_of(scene, &mesh, spacing, &touched, |at| at)?;
    // Elsewhere is only what of a press's punch does not go through the blank.
    let elsewhere = match scene.process {
        Process::DoubleDiaphragm(_) | Process::SingleDiaphragm(_) | Process::Stamping(_) => {
            FieldError::default()
        }
        Process::Press(_) => field.error_against(&mesh, 0.0, |p| !touched(p)),
    };
    let mut warnings = Vec::new();
    if elsewhere.largest > tolerance {
        warnings.push(format!(
            "scene.tool: its distance field (`tool_grid`, {}) is {} off the tool's triangles at {}, more than a tenth of the thinnest ply \
             ({}); no sheet is expected to touch it there",
            mm(spacing),
            mm(elsewhere.largest),
            place(elsewhere.at),
            mm(ply)
        ));
    }
    warnings.extend(unlike_sizes(scene, &mesh));
    warnings.extend(other_way_up(scene, &mesh));
    Ok(RigidTool {
        error: error.or(elsewhere),
        mesh,
        field,
        placement,
        warnings,
    })
}

/// The distance field of triangles with points `spacing` (m) apart, and its error where `counts` is true. `in_scene`: from where the triangles
/// are to where the scene has them, for who is told of a place.
///
/// # Errors
/// When it would be too large, or is off by more than a tenth of the thinnest ply, with the spacing that would do.
pub(crate) fn field_of(
    scene: &Scene,
    mesh: &ToolMesh,
    spacing: f64,
    counts: &(dyn Fn(Vec3) -> bool + Sync),
    in_scene: impl Fn(Vec3) -> Vec3,
) -> Result<(SignedDistanceGrid, FieldError), String> {
    check_size(scene, mesh, spacing)?;
    let ply = thinnest_ply(scene);
    let tolerance = SHARE * ply;
    let build = |spacing: f64| {
        let stack = stack(scene);
        let space = [spacing, reach(spacing, stack)];
        SignedDistanceGrid::build_within(mesh, space, [tolerance, stack], counts)
    };
    let (field, mut error) = build(spacing);
    if error.largest > tolerance {
        let would_do = spacing_that_does(mesh, stack(scene), spacing, |s| {
            let (field, error) = build(s);
            (error.largest <= tolerance).then(|| field.memory())
        });
        error.at = in_scene(error.at);
        return Err(off(spacing, error, ply, would_do));
    }
    error.at = in_scene(error.at);
    Ok((field, error))
}

/// Thickness of all sheets (m).
fn stack(scene: &Scene) -> f64 {
    scene.sheets.iter().map(thickness).sum()
}

/// How far out of a tool its field reaches (m). Contact acts at distances of the stack's thickness; a few cells around it are plenty.
fn reach(spacing: f64, stack: f64) -> f64 {
    (4.0 * spacing).max(0.01).max(2.0 * stack)
}

/// Whether a sheet can touch a place of the tool: between diaphragms all of it; of a punch, which ends where it is described, what has gone
/// through the blank.
fn touched(scene: &Scene, mesh: &ToolMesh) -> impl Fn(Vec3) -> bool + Sync + use<> {
    let from = match &scene.process {
        Process::DoubleDiaphragm(_) | Process::SingleDiaphragm(_) | Process::Stamping(_) => {
            f64::NEG_INFINITY
        }
        Process::Press(press) => mesh.bounds()[1][2] - press.stroke.si() - stack(scene),
    };
    move |p: Vec3| p[2] >= from
}

/// A spacing of which it is known that it does, with its memory (bytes), below one of which it is known that it does not.
fn spacing_that_does(
    mesh: &ToolMesh,
    stack: f64,
    from: f64,
    does: impl Fn(f64) -> Option<usize>,
) -> Option<(f64, usize)> {
    // Not larger than where nothing is asked for: what elements stand off in fillets is taken from the grid's own level.
    let mut spacing = (0.5 * from).min(DEFAULT_SPACING);
    loop {
        // Two figures, so that it can be written down.
        let unit = 10f64.fixed_powf(spacing.fixed_log10().floor() - 1.0);
        let rounded = (spacing / unit * (1.0 + 1e-9)).floor() * unit;
        if values(mesh, rounded, reach(rounded, stack)) > MOST_TRIED {
            return None;
        }
        if let Some(memory) = does(rounded) {
            return Some((rounded, memory));
        }
        spacing *= 0.5;
    }
}

/// What to say of a field that is off its tool where a sheet can touch it.
fn off(spacing: f64, error: FieldError, ply: f64, would_do: Option<(f64, usize)>) -> String {
    let remedy = match would_do {
        Some((spacing, memory)) => format!(
            "`tool_grid: {}` would do, in {:.0} MB of memory",
            mm(spacing),
            (memory as f64 / 1e6).max(1.0)
        ),
        None => format!(
            "no `tool_grid` of up to {MOST_TRIED:.0e} values does: round the tool's edges there, or leave out what no sheet touches"
        ),
    };
    format!(
        "scene.tool: its distance field (`tool_grid`, {}) is {} off the tool's triangles at {}, where a sheet can touch it; expected at most {}, a \
         tenth of the thinnest ply ({}): {remedy}",
        mm(spacing),
        mm(error.largest),
        place(error.at),
        mm(SHARE * ply),
        mm(ply)
    )
}

/// Values of a distance field.
fn values(mesh: &ToolMesh, spacing: f64, reach: f64) -> f64 {
    let along = size(mesh).map(|s| (s + 2.0 * reach) / spacing + 6.0);
    along.into_iter().product()
}

/// Whether a tool's distance field can be kept.
fn check_size(scene: &Scene, mesh: &ToolMesh, spacing: f64) -> Result<(), String> {
    let values = values(mesh, spacing, reach(spacing, stack(scene)));
    if values <= MOST_VALUES {
        return Ok(());
    }
    let size = size(mesh);
    Err(format!(
        "the tool spans {:.3} x {:.3} x {:.3} m, and its distance field would have {values:.1e} values {:.3} mm apart; expected at most \
         {MOST_VALUES:.0e}: take a larger `tool_grid`{}",
        size[0],
        size[1],
        size[2],
        1e3 * spacing,
        unit_question(scene).replacen(':', ";", 1)
    ))
}
