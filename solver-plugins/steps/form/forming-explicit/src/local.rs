//! The model of one zone, driven at its cut by a coarse run.

use crate::assembly::{self, Components, Placed, StackSheet};
use crate::elements;
use crate::late::{self, Start};
use crate::parameters::Parameters;
use crate::process::{Cycle, Load};
use crate::regions;
use crate::run::{Body, Forming};
use crate::tool::ToolSurfaces;
use plyflow_mechanics::history::{hermite, hermite_rate, locate};
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::mirror::Planes;
use plyflow_mechanics::model::{Drive, Hold, Model};
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_mechanics::vec3::{V, add, cross, dot, norm, scale, sub};
use plyflow_model::artifact::Zone;
use plyflow_model::scene::{Process, Scene, SheetKind};
use plyflow_tooling::RigidTool;

/// A sheet of the zone as the boundary artifact holds it.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalSheet {
    /// Name, as in the scene.
    pub name: String,
    /// `[n]` undeformed points (m).
    pub points: Vec<V>,
    /// `[m]` cells.
    pub cells: Vec<[u32; 4]>,
    /// `[k]` driven nodes.
    pub driven: Vec<u32>,
    /// `[frames][k]` positions (m).
    pub position: Vec<Vec<V>>,
    /// `[frames][k]` velocities (m/s).
    pub velocity: Vec<Vec<V>>,
    /// `[frames][k]` normals of the coarse surface; empty when the artifact has none, and then rotations are free.
    pub normal: Vec<Vec<V>>,
    /// `[frames][k]` their rates (1/s); as `normal`.
    pub normal_rate: Vec<Vec<V>>,
    /// `[frames][k]` forces of the surroundings on them (N); empty when the cut gives no way.
    pub pull: Vec<Vec<V>>,
    /// `[k]` how stiffly they hold (N/m); as `pull`.
    pub stiffness: Vec<f64>,
    /// Where a run that begins late begins; `None` for one that begins with the process.
    pub start: Option<Start>,
}

/// What a boundary artifact gives.
#[derive(Debug, Clone)]
pub struct LocalInput {
    /// Times of the frames (s).
    pub time: Vec<f64>,
    /// Sheets, any order.
    pub sheets: Vec<LocalSheet>,
    /// Cavity pressure (Pa) at the times.
    pub cavity: Vec<f64>,
    /// Bag pressure (Pa).
    pub bag: Vec<f64>,
    /// Frame height (m).
    pub frame: Vec<f64>,
    /// The zone, as its artifact describes it.
    pub zone: Zone,
    /// Element size (m).
    pub element_size: f64,
}

/// Cubic Hermite motion of given nodes through the frames of another run.
struct CutDrive {
    time: Vec<f64>,
    /// `[frames][driven]` (m).
    position: Vec<Vec<V>>,
    /// `[frames][driven]` (m/s).
    velocity: Vec<Vec<V>>,
    /// `[frames][driven]`; `None` where the other run tells no normal.
    normal: Vec<Vec<Option<[V; 2]>>>,
    /// `[frames][driven]` (N); `None` where the cut gives no way.
    pull: Vec<Vec<Option<V>>>,
    /// `[driven]` (N/m).
    stiffness: Vec<f64>,
}

impl CutDrive {
    fn new(time: Vec<f64>) -> Self {
        let none = || vec![Vec::new(); time.len()];
        Self {
            position: none(),
            velocity: none(),
            normal: vec![Vec::new(); time.len()],
            pull: vec![Vec::new(); time.len()],
            stiffness: Vec::new(),
            time,
        }
    }

    /// Adds the driven nodes of a sheet, in their order.
    fn add(&mut self, sheet: &LocalSheet) {
        for f in 0..self.time.len() {
            self.position[f].extend_from_slice(&sheet.position[f]);
            self.velocity[f].extend_from_slice(&sheet.velocity[f]);
            let known = |k: usize| {
                Some([
                    *sheet.normal.get(f)?.get(k)?,
                    *sheet.normal_rate.get(f)?.get(k)?,
                ])
            };
            self.normal[f].extend((0..sheet.driven.len()).map(known));
            let pull = |k: usize| sheet.pull.get(f)?.get(k).copied();
            self.pull[f].extend((0..sheet.driven.len()).map(pull));
        }
        let stiffness = |k: usize| sheet.stiffness.get(k).copied().unwrap_or_default();
        (self.stiffness).extend((0..sheet.driven.len()).map(stiffness));
    }
}

impl Drive for CutDrive {
    fn position(&self, k: usize, t: f64) -> V {
        let (i, s) = locate(&self.time, t);
        let w = hermite(s, self.time[i + 1] - self.time[i]);
        let (p, q) = (self.position[i][k], self.position[i + 1][k]);
        let (u, v) = (self.velocity[i][k], self.velocity[i + 1][k]);
        [0, 1, 2].map(|c| w[0] * p[c] + w[1] * q[c] + w[2] * u[c] + w[3] * v[c])
    }

    /// Turns the node as the coarse surface's normal n turns, `n x n' / n^2`, and not about it.
    fn spin(&self, k: usize, t: f64) -> Option<V> {
        let (i, s) = locate(&self.time, t);
        let h = self.time[i + 1] - self.time[i];
        if t < self.time[0] || t > self.time[self.time.len() - 1] {
            return self.normal[i][k].map(|_| [0.0; 3]);
        }
        let ([p, u], [q, v]) = (self.normal[i][k]?, self.normal[i + 1][k]?);
        let mix =
            |w: [f64; 4]| [0, 1, 2].map(|c| w[0] * p[c] + w[1] * q[c] + w[2] * u[c] + w[3] * v[c]);
        let (n, rate) = (mix(hermite(s, h)), mix(hermite_rate(s, h)));
        // Normals of neighbouring frames that are opposite tell no way to turn.
        let square = dot(n, n).max(MIN_NORMAL);
        Some(scale(cross(n, rate), 1.0 / square))
    }

    fn hold(&self, k: usize, t: f64) -> Option<Hold> {
        let (i, s) = locate(&self.time, t);
        let between = |a: V, b: V| add(a, scale(sub(b, a), s));
        let ([n, _], [m, _]) = (self.normal[i][k]?, self.normal[i + 1][k]?);
        let normal = between(n, m);
        Some(Hold {
            pull: between(self.pull[i][k]?, self.pull[i + 1][k]?),
            stiffness: self.stiffness[k],
            normal: scale(normal, 1.0 / norm(normal).max(MIN_NORMAL.sqrt())),
        })
    }
}

/// Least square of a normal between two frames.
const MIN_NORMAL: f64 = 0.01;

/// Builds the model of a zone.
///
/// # Errors
/// A text for the user: what of the boundary or the parameters makes no model.
pub fn build_local(
    p: &Parameters,
    input: LocalInput,
    components: &dyn Components,
) -> Result<Forming, String> {
    let scene = &p.scene;
    let Process::DoubleDiaphragm(process) = &scene.process else {
        return Err(format!(
            "scene '{}' is formed by a {}; local runs are built for double_diaphragm only. Run the whole scene with \
             bending elements instead: leave out the boundary",
            scene.name,
            scene.process.word()
        ));
    };
    let stack = stack_of(scene, &input)?;
    if input.time.len() < 2 {
        return Err("the boundary has fewer than two frames".into());
    }
    let frames = input.time.len();
    let Sheets {
        points,
        specs,
        bodies,
        placed,
        driven,
        drive,
    } = sheets_of(p, &input, &stack, components)?;
    let start = late::of_model(&stack, &input.sheets, input.time[0])?;
    let RigidTool {
        mesh: tool,
        field: grid,
        error,
        warnings: tool_warnings,
    } = plyflow_tooling::given::rigid(scene, p.tool_grid)?;
    let cycle = Cycle::new(process, [input.frame[0], input.frame[frames - 1]])?;
    let mut model =
        Model::new(points, specs, assembly::step_settings(p)).map_err(|e| e.to_string())?;
    assembly::add_contacts(
        &mut model,
        &stack,
        &placed,
        scene,
        p,
        &mut ToolSurfaces::new(grid),
    )?;
    model.set_driven(driven, Box::new(drive));
    let reference = model.start().clone();
    Ok(Forming {
        model,
        load: Load::Given {
            time: input.time,
            cavity: input.cavity,
            bag: input.bag,
            frame: input.frame,
            cycle,
        },
        stack,
        bodies,
        reference,
        tool,
        rigid: Vec::new(),
        field_errors: vec![("tool", error)],
        tool_warnings,
        zone: Some(input.zone),
        start,
        element_size: input.element_size,
    })
}

/// Those sheets of the scene that the zone has, bottom to top, one on the other.
fn stack_of(scene: &Scene, input: &LocalInput) -> Result<Vec<StackSheet>, String> {
    let whole = assembly::stack(scene)?;
    let has = |name: &str| input.sheets.iter().any(|s| s.name == name);
    let mut stack: Vec<_> = whole.into_iter().filter(|s| has(&s.scene.name)).collect();
    // A ply that does not reach into the zone holds nothing off the tool there.
    assembly::lay(&mut stack);
    if stack.len() < 3 {
        let names: Vec<&str> = input.sheets.iter().map(|s| s.name.as_str()).collect();
        return Err(format!(
            "the zone needs both diaphragms and at least one ply of scene '{}'; its boundary has: {}",
            scene.name,
            names.join(", ")
        ));
    }
    Ok(stack)
}

/// The sheets of a zone, bottom to top, and what drives them.
struct Sheets {
    /// `[nodes]` (m), sheet by sheet.
    points: Vec<V>,
    specs: Vec<SheetSpec>,
    bodies: Vec<Body>,
    placed: Vec<Placed>,
    /// Model nodes, in the order of `drive`.
    driven: Vec<u32>,
    drive: CutDrive,
}

fn sheets_of(
    p: &Parameters,
    input: &LocalInput,
    stack: &[StackSheet],
    components: &dyn Components,
) -> Result<Sheets, String> {
    let mut all = Sheets {
        points: Vec::new(),
        specs: Vec::new(),
        bodies: Vec::new(),
        placed: Vec::new(),
        driven: Vec::new(),
        drive: CutDrive::new(input.time.clone()),
    };
    for (index, sheet) in stack.iter().enumerate() {
        let of_name = |s: &&LocalSheet| s.name == sheet.scene.name;
        let local = input.sheets.iter().find(of_name).expect("filtered");
        let first = all.points.len() as u32;
        all.points.extend_from_slice(&local.points);
        let film = sheet.scene.kind == SheetKind::Diaphragm;
        let pressed = match (film, index == 0) {
            (true, true) => Pressed::Below,
            (true, false) => Pressed::Above,
            _ => Pressed::No,
        };
        let element = if film {
            elements::element(components, sheet, &p.diaphragm_element)?
        } else {
            elements::of_ply(components, sheet, &p.element)?
        };
        let mesh = QuadMesh {
            points: local.points.clone(),
            cells: local.cells.clone(),
        };
        let flat = (&mesh.points[..], &mesh.cells[..]);
        let other_material = regions::unstitched(components, sheet, flat, &element, p)?;
        let nodes: Vec<u32> = (first..all.points.len() as u32).collect();
        let mut free = vec![true; local.points.len()];
        for n in &local.driven {
            free[*n as usize] = false;
            all.driven.push(first + n);
        }
        all.drive.add(local);
        // Driven nodes push no one: they stand where the coarse run says, with its penetration.
        let is_free = |n: &u32| free[(n - first) as usize];
        let slaves = nodes.iter().copied().filter(is_free).collect();
        all.placed.push(Placed { index, slaves });
        all.bodies
            .push(Body::new(sheet, index, local.cells.clone()));
        all.specs.push(SheetSpec {
            name: sheet.scene.name.clone(),
            nodes,
            layers: vec![1.0; local.cells.len()],
            pressed: vec![pressed; local.cells.len()],
            patches: mesh.patches(),
            least_areal_mass: vec![p.least_areal_mass; mesh.cells.len()],
            cells: mesh.cells,
            axis: assembly::axis(&sheet.scene),
            element,
            elsewhere: None,
            other_material,
        });
    }
    Ok(all)
}

/// What an artifact feeds back: where nodes of the coarse plies go.
pub struct Feedback {
    /// Times of the frames (s).
    pub time: Vec<f64>,
    /// Plies, any order, with the meshes of the coarse run.
    pub sheets: Vec<LocalSheet>,
}

/// Drives nodes of the plies of a whole scene as fine runs have moved them.
///
/// # Errors
/// A text for the user: what was fed back is of other meshes, or has too few frames.
pub fn feed_back(forming: &mut Forming, input: Feedback) -> Result<(), String> {
    if input.time.len() < 2 {
        return Err("the feedback has fewer than two frames".into());
    }
    if forming.model.planes() != Planes::default() {
        return Err("what is fed back is of the whole scene, and this scene is computed beside mirror planes: leave out its `symmetry`".into());
    }
    let mut nodes = Vec::new();
    let mut drive = CutDrive::new(input.time);
    for sheet in &input.sheets {
        let body = (forming.bodies.iter()).find(|b| b.name == sheet.name && is_ply(forming, b));
        let body = body.ok_or_else(|| {
            format!(
                "what is fed back moves '{}', which is no ply of this scene",
                sheet.name
            )
        })?;
        let own = forming.reference_points(body);
        let near = |(a, b): (&V, &V)| norm(sub(*a, *b)) < SAME_PLACE;
        if own.len() != sheet.points.len() || !own.iter().zip(&sheet.points).all(near) {
            return Err(format!(
                "what is fed back was made for another mesh of ply '{}' ({} nodes; this run has {}): give this run the scene and \
                 the `element_size` of the coarse run that it came from",
                sheet.name,
                sheet.points.len(),
                own.len()
            ));
        }
        let all = &forming.model.sheets()[body.sheet].nodes;
        nodes.extend(sheet.driven.iter().map(|n| all[*n as usize]));
        drive.add(sheet);
    }
    forming.model.drive_also(nodes, Box::new(drive));
    let_drive_decide(forming);
    Ok(())
}

/// Takes nodes that are driven out of contacts with what does not give way to them: rigid parts, other plies, whose nodes there are driven too, and
/// folds of their own ply, which are mostly driven as a whole. Where they are has been decided, by runs with finer elements; coarse ones stand
/// elsewhere off tool and plies, and a multiplier that cannot move its node grows for ever. The films give way.
fn let_drive_decide(forming: &mut Forming) {
    let plies = forming.bodies.iter().filter(|b| is_ply(forming, b));
    let plies: Vec<usize> = plies.map(|b| b.sheet).collect();
    forming.model.release_driven(&plies);
}

fn is_ply(forming: &Forming, body: &Body) -> bool {
    forming
        .stack
        .iter()
        .any(|s| s.scene.name == body.name && s.scene.kind == SheetKind::Ply)
}

/// Places nearer than this are the same (m).
const SAME_PLACE: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driven_node_turns_as_the_coarse_surface_does() {
        // The normal turns in the xz plane by a(t), faster and faster, over 1 s and 11 frames.
        let angle = |t: f64| 1.2 * t * t;
        let time: Vec<f64> = (0..11).map(|f| 0.1 * f64::from(f)).collect();
        let at = |t: &f64| {
            let (s, c) = angle(*t).sin_cos();
            let rate = 2.4 * t;
            vec![Some([[s, 0.0, c], [rate * c, 0.0, -rate * s]]), None]
        };
        let drive = CutDrive {
            position: vec![vec![[0.0; 3]; 2]; 11],
            velocity: vec![vec![[0.0; 3]; 2]; 11],
            normal: time.iter().map(at).collect(),
            ..CutDrive::new(time)
        };
        let (mut turned, steps) = (0.0, 1000);
        for k in 0..steps {
            let t = (f64::from(k) + 0.5) / f64::from(steps);
            let [x, y, z] = drive.spin(0, t).unwrap();
            assert!(x.abs() < 1e-12 && z.abs() < 1e-12);
            assert!((y - 2.4 * t).abs() < 2e-3, "{y} rad/s at {t} s");
            turned += y / f64::from(steps);
        }
        assert!((turned - angle(1.0)).abs() < 1e-5, "{turned} rad");
        assert_eq!(
            drive.spin(0, 1.5),
            Some([0.0; 3]),
            "after the last frame it rests"
        );
        assert_eq!(drive.spin(1, 0.5), None, "no normal: free");
    }
}
