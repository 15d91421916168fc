//! The checks of a scene's tool: whether its triangles are a tool in the right place.

use crate::audit::{Piece, Survey};
use crate::build::built;
use crate::mesh::ToolMesh;
use crate::tree::SurfaceTree;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, dot, norm, scale, sub};
use plyflow_model::material::MaterialEntry;
use plyflow_model::scene::{Scene, Sheet, SheetKind, Tool};

/// How far (m) a tool's lowest point may lie from the bed: what single precision leaves of a metre and more.
const FOOT: f64 = 1e-5;

/// Spacing (m) of a distance field where nothing else is asked for.
pub const DEFAULT_SPACING: f64 = 3e-3;

/// The thinnest ply of a scene, or the thinnest sheet of one without plies (m); infinite without any.
pub fn thinnest_ply(scene: &Scene) -> f64 {
    let least =
        |of: &mut dyn Iterator<Item = &Sheet>| of.map(thickness).fold(f64::INFINITY, f64::min);
    let plies = least(&mut scene.sheets.iter().filter(|s| s.kind == SheetKind::Ply));
    if plies.is_finite() {
        plies
    } else {
        least(&mut scene.sheets.iter())
    }
}

pub(crate) fn thickness(sheet: &Sheet) -> f64 {
    match &sheet.material {
        MaterialEntry::Inline(material) => material.thickness.si(),
        // None is left when a scene is built.
        MaterialEntry::File(_) | MaterialEntry::Varied(_) => 0.0,
    }
}

/// The triangles of a scene's tool, if they pass all checks.
///
/// # Errors
/// As [`crate::given::checked`], without advice.
pub(crate) fn checks(scene: &Scene, spacing: f64) -> Result<ToolMesh, String> {
    let mesh = built(&scene.tool).map_err(|e| e.to_string())?.mesh;
    check_placed(scene, &mesh, spacing)?;
    Ok(mesh)
}

/// All checks of triangles that a tool could be built of.
pub(crate) fn check_placed(scene: &Scene, mesh: &ToolMesh, spacing: f64) -> Result<(), String> {
    if mesh.triangles.is_empty() {
        return Err("scene.tool: it has no facet; expected a surface".into());
    }
    check_unit(scene, mesh, spacing)?;
    if let Some(frame) = scene.process.frame() {
        check_foot(scene, mesh.bounds()[0][2])?;
        // Without a bed the frame may end on the tool.
        if !scene.process.is_without_bed() {
            check_frame(scene, mesh, frame)?;
        }
    }
    let shells = mesh.shells();
    check_bodies(scene, mesh, &shells)?;
    check_walls(scene, mesh)
}

/// Length as text in mm, to three figures.
pub(crate) fn mm(metres: f64) -> String {
    let value = 1e3 * metres;
    let digits = (2 - value.abs().max(1e-4).fixed_log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{value:.digits$}");
    let text = if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.')
    } else {
        &text
    };
    format!("{text} mm")
}

pub(crate) fn place(at: Vec3) -> String {
    let [x, y, z] = at.map(|c| 1e3 * c);
    format!("({x:.1}, {y:.1}, {z:.1}) mm")
}

pub(crate) fn size(mesh: &ToolMesh) -> Vec3 {
    let [low, high] = mesh.bounds();
    sub(high, low)
}

/// What to ask about the unit of a file.
pub(crate) fn unit_question(scene: &Scene) -> String {
    match &scene.tool {
        Tool::Stl(stl) => format!(
            ": is `unit` ({} m) the length of one unit of the file?",
            stl.unit.si()
        ),
        Tool::Input(_) => ": are the points of the step's artifact in m?".into(),
        _ => String::new(),
    }
}

/// Where the scene speaks of the tool.
fn named(scene: &Scene) -> String {
    match &scene.tool {
        Tool::Stl(stl) => format!("scene.tool.stl: {}", stl.file),
        Tool::Input(input) => {
            let step = input.given.as_ref().map_or("?", |g| g.step.as_str());
            format!("scene.tool.input: body `{}` of step `{step}`", input.body)
        }
        _ => "scene.tool: the tool".into(),
    }
}

/// How large (m) a tool is at least, beside the spacing of its field.
fn least_size(spacing: f64) -> f64 {
    // A spacing may be as large as it likes where it is made finer by itself.
    4.0 * spacing.min(DEFAULT_SPACING)
}

/// Whether a tool of this size (m) is a speck.
pub(crate) fn speck(size: Vec3, spacing: f64) -> bool {
    size.into_iter().fold(0.0, f64::max) < least_size(spacing)
}

/// Whether a tool is more than a speck: a wrong `unit` would leave a run without any.
pub(crate) fn check_unit(scene: &Scene, mesh: &ToolMesh, spacing: f64) -> Result<(), String> {
    let size = size(mesh);
    if !speck(size, spacing) {
        return Ok(());
    }
    let least = least_size(spacing);
    Err(format!(
        "{} spans {:.3} x {:.3} x {:.3} mm, less than four spacings of its distance field (`tool_grid`, {:.3} mm); expected a tool{}",
        named(scene),
        1e3 * size[0],
        1e3 * size[1],
        1e3 * size[2],
        250.0 * least,
        unit_question(scene)
    ))
}

/// Whether a tool stands on the bed. What is below it would take room from the air that is drawn, and under one that floats the film
/// would be drawn in.
fn check_foot(scene: &Scene, low: f64) -> Result<(), String> {
    if low.abs() <= FOOT {
        return Ok(());
    }
    let (place, and) = match &scene.tool {
        Tool::Stl(stl) => (
            stl.place(),
            ", and `unit` the length of one unit of the file",
        ),
        Tool::Input(input) => (input.place(), ""),
        _ => Default::default(),
    };
    let [x, y, z] = place.translate;
    let put = match place.only_moves() {
        true => format!(
            "`translate: [{} mm, {} mm, {} mm]`",
            1e3 * x,
            1e3 * y,
            1e3 * (z - low)
        ),
        false => "`foot: auto` puts it there".to_owned(),
    };
    let named = named(scene);
    let (at, what) = named.split_once(": ").unwrap_or(("scene.tool", &named));
    Err(format!(
        "{at}: the lowest point of {what} lies at z = {:.3} mm; expected a tool that stands on the bed, z = 0, with its axis at x = y = 0: \
         {put}{and}",
        1e3 * low
    ))
}

/// Whether a tool lies inside of the frame.
fn check_frame(scene: &Scene, mesh: &ToolMesh, frame: [f64; 2]) -> Result<(), String> {
    let [low, high] = mesh.bounds();
    if (0..2).all(|k| low[k] > -0.5 * frame[k] && high[k] < 0.5 * frame[k]) {
        return Ok(());
    }
    Err(format!(
        "{} reaches from ({:.1}, {:.1}) to ({:.1}, {:.1}) mm, the frame (process.{}) from ({:.1}, {:.1}) to ({:.1}, {:.1}) mm; \
         the frame is too small for it: expected a tool inside of the frame, with its axis at x = y = 0{}",
        named(scene),
        1e3 * low[0],
        1e3 * low[1],
        1e3 * high[0],
        1e3 * high[1],
        scene.process.word(),
        -500.0 * frame[0],
        -500.0 * frame[1],
        500.0 * frame[0],
        500.0 * frame[1],
        unit_question(scene)
    ))
}

/// One of a tool's bodies.
struct Body<'a> {
    shell: &'a ToolMesh,
    tree: SurfaceTree,
    bounds: [Vec3; 2],
}

impl<'a> Body<'a> {
    fn new(shell: &'a ToolMesh) -> Self {
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        for p in shell.triangles.iter().flatten() {
            for (d, c) in shell.points[*p as usize].into_iter().enumerate() {
                bounds[0][d] = bounds[0][d].min(c);
                bounds[1][d] = bounds[1][d].max(c);
            }
        }
        Self {
            shell,
            tree: SurfaceTree::new(shell),
            bounds,
        }
    }

    fn corners(&self) -> impl Iterator<Item = Vec3> {
        let points = self.shell.triangles.iter().flatten();
        points.map(|p| self.shell.points[*p as usize])
    }

    /// The smallest of its extents (m).
    fn thickness(&self) -> f64 {
        let along = (0..3).map(|d| self.bounds[1][d] - self.bounds[0][d]);
        along.fold(f64::INFINITY, f64::min)
    }

    fn touches(&self, other: &Self) -> bool {
        let apart = |d: usize| {
            self.bounds[0][d] > other.bounds[1][d] + FOOT
                || other.bounds[0][d] > self.bounds[1][d] + FOOT
        };
        if (0..3).any(apart) {
            return false;
        }
        // Bars that cross have no corner in each other, but places of their sides. No finer than a 200th of the larger one.
        let extent = |b: &Self| norm(sub(b.bounds[1], b.bounds[0]));
        let least = 0.25 * self.thickness().min(other.thickness());
        let spacing = least.max(extent(self).max(extent(other)) / 200.0);
        self.reaches(other, spacing) || other.reaches(self, spacing)
    }

    /// Whether a corner, or a place of the surface of those that are `spacing` (m) apart, lies on or in another body.
    fn reaches(&self, other: &Self, spacing: f64) -> bool {
        let near = |p: Vec3| other.tree.closest(p).signed_distance <= FOOT;
        let mut found = self.corners().any(near);
        for facet in 0..self.shell.triangles.len() {
            if found {
                break;
            }
            Piece::of(self.shell, facet).parts(spacing, &mut |part| {
                found |= part.face().is_some_and(|(on, _)| near(on));
            });
        }
        found
    }
}

/// Whether each of a tool's bodies stands on what the lowest of them stands on, or on or in another body.
fn check_bodies(scene: &Scene, mesh: &ToolMesh, shells: &[ToolMesh]) -> Result<(), String> {
    if shells.len() < 2 {
        return Ok(());
    }
    let low = mesh.bounds()[0][2];
    let bodies: Vec<Body<'_>> = shells.iter().map(Body::new).collect();
    let mut held: Vec<bool> = (bodies.iter())
        .map(|b| b.bounds[0][2] <= low + FOOT)
        .collect();
    loop {
        let found = (0..shells.len()).find(|&k| {
            !held[k] && (0..shells.len()).any(|o| held[o] && bodies[k].touches(&bodies[o]))
        });
        match found {
            Some(k) => held[k] = true,
            None => break,
        }
    }
    let Some(k) = held.iter().position(|h| !h) else {
        return Ok(());
    };
    let lowest =
        bodies[k].corners().fold(
            [0.0, 0.0, f64::INFINITY],
            |l, p| {
                if p[2] < l[2] { p } else { l }
            },
        );
    Err(format!(
        "{}: one of its {} bodies floats, its lowest point at {}, and touches no other; expected bodies that stand on the tool's foot or on or in \
         each other: move it, or leave it out",
        named(scene),
        shells.len(),
        place(lowest)
    ))
}

/// Whether a tool has walls that would not hold a ply: in them nothing tells on which side a sheet is once it is as deep as they are thick.
pub(crate) fn check_walls(scene: &Scene, mesh: &ToolMesh) -> Result<(), String> {
    let ply = thinnest_ply(scene);
    if !ply.is_finite() {
        return Ok(());
    }
    let survey = Survey::new(mesh, 10.0 * ply);
    let foot = mesh.bounds()[0][2] + 2.0 * ply;
    let thin = survey.thin_walls(DEFAULT_SPACING, ply, |p| p[2] > foot);
    let Some((thickness, at)) = thin else {
        return Ok(());
    };
    Err(format!(
        "{} has a wall {} thin at {}; expected walls not thinner than the thinnest ply ({}), which sheets do not go through: make it thicker, or \
         leave it out{}",
        named(scene),
        mm(thickness),
        place(at),
        mm(ply),
        unit_question(scene)
    ))
}

impl Survey {
    /// The thinnest wall that is thinner than `least` (m), with its place: two faces back to back, nearly parallel.
    fn thin_walls(
        &self,
        spacing: f64,
        least: f64,
        counts: impl Fn(Vec3) -> bool,
    ) -> Option<(f64, Vec3)> {
        let mut worst = None::<(f64, Vec3)>;
        let mut hints = vec![0; self.trees().len()];
        for piece in self.pieces() {
            piece.parts(spacing, &mut |part| {
                let Some((on, out)) = part.face().filter(|(on, _)| counts(*on)) else {
                    return;
                };
                let inside = sub(on, scale(out, least));
                let (found, normal) = self.nearest_of(inside, &part, &mut hints);
                // Beyond the other face, which looks the other way.
                let thickness = least - found.signed_distance;
                let through = found.signed_distance > 1e-9 && thickness > 0.0;
                let back =
                    dot(normal, out) < -0.9 && norm(sub(found.point, on)) < 1.1 * thickness + 1e-9;
                if through && back && worst.is_none_or(|(w, _)| thickness < w) {
                    worst = Some((thickness, on));
                }
            });
        }
        worst
    }
}

/// Times that a ply is as long as the tool beyond which a wrong unit is likely, and the other way round.
const UNLIKE: f64 = 15.0;

/// What to ask where a tool is far smaller than the plies, or far larger.
pub fn unlike_sizes(scene: &Scene, mesh: &ToolMesh) -> Option<String> {
    let size = size(mesh);
    let tool = size[0].max(size[1]);
    let plies = scene.sheets.iter().filter(|s| s.kind == SheetKind::Ply);
    let length = |s: &Sheet| Some(s.length?.si().max(s.width?.si()));
    let ply = plies.filter_map(length).fold(0.0, f64::max);
    let unlike = ply > 0.0 && !(1.0 / UNLIKE..=UNLIKE).contains(&(tool / ply));
    unlike.then(|| {
        format!(
            "{} spans {} x {} in the plane, the plies up to {}{}",
            named(scene),
            mm(size[0]),
            mm(size[1]),
            mm(ply),
            unit_question(scene)
        )
    })
}
