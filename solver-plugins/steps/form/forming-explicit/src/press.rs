//! Press forming: a rising punch, a die above the plies, a blank holder below them.
//!
//! The tool of the scene is the punch, described where it ends. It starts one stroke below, where it touches the
//! lowest ply, and pushes the plies through the opening of the die.

use crate::assembly::{self, Components, StackSheet};
use crate::cover::{self, Layer, RigidPart};
use crate::friction::{FrictionTable, Touching};
use crate::parameters::Parameters;
use crate::process::Load;
use crate::run::{Forming, RigidBody};
use crate::symmetry;
use crate::tool::ToolSurface;
use plyflow_fixed::FixedBits;
use plyflow_mechanics::archive::{Archive, ArchiveError};
use plyflow_mechanics::contact::{OpenPlate, RigidMotion, RigidSurface};
use plyflow_mechanics::history::{constant_speed_way, smooth_step};
use plyflow_mechanics::mirror::Mirrors;
use plyflow_mechanics::model::Model;
use plyflow_model::STANDARD_GRAVITY;
use plyflow_model::scene::{Hold, Press, Scene, Towards};
use plyflow_tooling::{RigidTool, SignedDistanceGrid, ToolMesh};
use std::sync::Arc;

/// Mass of a holder that a force presses, over that of the plies: heavy enough to follow their contacts stably in
/// explicit steps, light enough to follow the blank as it thickens.
const HOLDER_MASS: f64 = 20.0;
/// Rate (1/s) at which the motion of such a holder dies out.
const HOLDER_DAMPING: f64 = 300.0;
/// Share of the stroke's duration over which the holder's force grows.
const HOLD_RISE: f64 = 0.05;

/// The punch's stroke in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Its length (m).
    pub way: f64,
    /// Its duration (s).
    pub forming: f64,
    /// Time in which it gathers speed, and in which it loses it (s).
    pub ramp: f64,
    /// What follows (s).
    pub settling: f64,
}

impl Stroke {
    /// Way still to go (m) at time t (s).
    pub fn left(&self, t: f64) -> f64 {
        self.way - constant_speed_way(t, self.way, self.forming, self.ramp)
    }
}

/// A blank holder that a force presses towards the die: a mass that moves along z.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldByForce {
    force: f64,
    mass: f64,
    /// Height at which it meets the die (m): nothing else stops it once the plies have left it.
    most: f64,
    height: f64,
    velocity: f64,
}

/// What moves in a press.
#[derive(Debug, Clone, PartialEq)]
pub struct PressLoad {
    /// The punch.
    pub stroke: Stroke,
    /// Numbers of its contacts in [`Model::rigid_contacts`].
    pub punch: Vec<usize>,
    /// Those of the holder.
    pub holder: Vec<usize>,
    /// The holder, when a force presses it.
    pub held: Option<HeldByForce>,
}

impl PressLoad {
    /// Moves punch and holder to where they are at `t` (s).
    pub fn apply(&mut self, model: &mut Model, t: f64) {
        let dt = model.dt();
        let at = |t: f64| -self.stroke.left(t);
        let height = at(t);
        let before = self
            .punch
            .first()
            .map_or(height, |c| model.rigid_contacts()[*c].motion.shift[2]);
        let moved = |height: f64, before: f64| RigidMotion {
            shift: [0.0, 0.0, height],
            velocity: [
                0.0,
                0.0,
                if dt > 0.0 {
                    (height - before) / dt
                } else {
                    0.0
                },
            ],
        };
        for c in &self.punch {
            model.rigid_contacts_mut()[*c].motion = moved(height, before);
        }
        let Some(held) = &mut self.held else { return };
        // The sheets' resistance of the last step: a holder many times their mass barely moves in one.
        let resistance: f64 = (self.holder.iter())
            .map(|c| model.rigid_contacts()[*c].resultant()[2])
            .sum();
        let force = held.force * smooth_step(t, 0.0, HOLD_RISE * self.stroke.forming);
        let drag = HOLDER_DAMPING * held.mass * held.velocity;
        held.velocity += (force - resistance - drag) / held.mass * dt;
        let before = held.height;
        held.height += held.velocity * dt;
        if held.height >= held.most {
            (held.height, held.velocity) = (held.most, 0.0);
        }
        for c in &self.holder {
            model.rigid_contacts_mut()[*c].motion = moved(held.height, before);
        }
    }

    /// Where the holder is that a force presses.
    pub(crate) fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        if let Some(held) = &mut self.held {
            a.value(&mut held.height)?;
            a.value(&mut held.velocity)?;
        }
        Ok(())
    }

    /// Force of the punch on the plies, upwards (N).
    pub fn punch_force(&self, model: &Model) -> f64 {
        let lift = |c: &usize| model.rigid_contacts()[*c].resultant()[2];
        self.punch.iter().map(lift).sum()
    }

    /// Whether a holder that a force presses has met the die: the plies have left it.
    pub fn holder_is_bare(&self) -> bool {
        self.held.as_ref().is_some_and(|h| h.height >= h.most)
    }

    /// How far the holder has moved towards the die (m).
    pub fn holder_travel(&self) -> f64 {
        self.held.as_ref().map_or(0.0, |h| h.height)
    }
}

/// Heights of the flat parts (m): lower face of the stack at the start, die, holder.
struct Levels {
    blank: f64,
    die: f64,
    holder: Option<f64>,
}

fn levels(press: &Press, stack: &[StackSheet], tool_top: f64) -> Result<Levels, String> {
    let thickness: f64 = stack.iter().map(|s| s.thickness).sum();
    let blank = tool_top - press.stroke.si();
    let die = blank + thickness;
    let holder = match press.holder.as_ref().map(|h| &h.hold) {
        None => None,
        Some(Hold::Force(_)) => Some(blank),
        // As thick as the plies but for rounding of their sum.
        Some(Hold::Gap(gap)) if gap.si() >= thickness * (1.0 - 1e-9) => Some(die - gap.si()),
        Some(Hold::Gap(gap)) => {
            return Err(format!(
                "process.press.holder.hold.gap: given {:.3} mm, the plies are {:.3} mm thick; expected a gap that they \
                 fit into, or `hold: {{force: ..}}` to squeeze them",
                1e3 * gap.si(),
                1e3 * thickness
            ));
        }
    };
    Ok(Levels { blank, die, holder })
}

/// Largest distance (m) from the axis of what of a surface is above a height: of its points there, and of its edges where they cross it.
fn radius_above(tool: &ToolMesh, z: f64) -> f64 {
    let mut radius = 0.0f64;
    for triangle in &tool.triangles {
        for k in 0..3 {
            let [a, b] = [k, (k + 1) % 3].map(|k| tool.points[triangle[k] as usize]);
            if a[2] > z {
                radius = radius.max(a[0].fixed_hypot(a[1]));
            }
            if (a[2] > z) != (b[2] > z) {
                let t = (z - a[2]) / (b[2] - a[2]);
                let at = [0, 1].map(|c| a[c] + t * (b[c] - a[c]));
                radius = radius.max(at[0].fixed_hypot(at[1]));
            }
        }
    }
    radius
}

/// Whether the punch ends inside its own height and goes through the openings, with the plies over it.
fn check_passage(press: &Press, at: &Levels, tool: &ToolMesh) -> Result<(), String> {
    let [low, high] = tool.bounds().map(|b| b[2]);
    let mm = |x: f64| 1e3 * x;
    if press.stroke.si() > high - low + 1e-9 {
        return Err(format!(
            "process.press.stroke: given {:.1} mm, the punch is {:.1} mm high; expected at most its height",
            mm(press.stroke.si()),
            mm(high - low)
        ));
    }
    let (die, holder) = plates(press, at);
    let radius_above = |z: f64| radius_above(tool, z);
    // Below the rounding of its edge a plate leaves more room.
    let thickness = at.die - at.blank;
    let in_die = radius_above(die.height + die.edge) + thickness;
    if in_die > die.opening {
        return Err(format!(
            "process.press.die.opening_radius: given {:.2} mm; expected at least {:.2} mm: where the punch with its plies \
             ({:.2} mm) goes through",
            mm(die.opening),
            mm(in_die),
            mm(thickness)
        ));
    }
    // In its rounding a plate is the wider, the nearer to its face.
    let room = |p: &&[f64; 3]| die.distance(**p).0 < thickness - 1e-9;
    let above = tool.points.iter().filter(|p| p[2] > die.height);
    if let Some([x, y, z]) = above.clone().find(room) {
        return Err(format!(
            "process.press: at the end the punch reaches into the die: ({:.1}, {:.1}) mm from the axis it stands {:.2} mm above the die's face, where the opening \
             ({:.2} mm, rounded by {:.2} mm) leaves no room for it and the plies ({:.2} mm). Expected a narrower punch, a wider opening, or a longer `stroke`",
            mm(*x),
            mm(*y),
            mm(z - die.height),
            mm(die.opening),
            mm(die.edge),
            mm(thickness)
        ));
    }
    if let Some(holder) = holder {
        let in_holder = radius_above(holder.height);
        if in_holder > holder.opening {
            return Err(format!(
                "process.press.holder.opening_radius: {:.2} mm (that of the die unless given); expected at least \
                 {:.2} mm: the punch goes through it",
                mm(holder.opening),
                mm(in_holder)
            ));
        }
    }
    Ok(())
}

/// The rigid parts: name, surface, and whether it lies above the plies.
fn rigid_parts(
    press: &Press,
    at: &Levels,
    grid: SignedDistanceGrid,
) -> Vec<(&'static str, Arc<dyn RigidSurface>, bool)> {
    let (die, holder) = plates(press, at);
    let punch: Arc<dyn RigidSurface> = Arc::new(ToolSurface(grid));
    let mut parts = vec![("tool", punch, false)];
    parts.push(("die", Arc::new(die), true));
    if let Some(plate) = holder {
        parts.push(("holder", Arc::new(plate), false));
    }
    parts
}

/// Plies on rigid parts, and on each other.
fn add_contacts(
    model: &mut Model,
    stack: &[StackSheet],
    parts: &[(&'static str, Arc<dyn RigidSurface>, bool)],
    scene: &Scene,
    p: &Parameters,
) -> Result<(), String> {
    let settings = assembly::contact_settings(p);
    let friction = FrictionTable::new(scene)?;
    let all = stack.len();
    let nodes: Vec<Vec<u32>> = (0..all).map(|k| model.sheets()[k].nodes.clone()).collect();
    let mut pair = |k: usize, nodes: &[u32], below: usize| -> Result<(), String> {
        let [lower, upper] = [below, k].map(|k| stack[k].scene.name.as_str());
        let touching = Touching {
            parts: [lower, upper],
            slave: upper,
        };
        let mu = friction.law(model, &touching)?;
        assembly::add_sheet_contact(model, stack, (k, nodes), (below, below), 1.0, mu, p);
        Ok(())
    };
    for k in 1..all {
        pair(k, &nodes[k], k - 1)?;
    }
    let plies: Vec<Layer<'_>> = (0..all).map(|k| (k, k, &nodes[k][..])).collect();
    cover::add_contacts_past(model, stack, &plies, &friction, p)?;
    for (name, surface, above) in parts {
        let part = RigidPart {
            name,
            surface: surface.clone(),
            above: *above,
            film: None,
            moves: *name != "die",
        };
        for (k, ply) in plies.iter().enumerate() {
            let among = if *above { k + 1..all } else { 0..k };
            cover::add_rigid_contacts(model, stack, &part, *ply, among, &friction, p)?;
        }
    }
    for k in 0..stack.len() {
        let slaves = model.sheets()[k].nodes.clone();
        assembly::add_self_contact(model, stack, (k, k), &slaves, p)?;
    }
    model.set_contact_stiffness(&settings);
    Ok(())
}

/// Builds the model of a press.
///
/// # Errors
/// A text for the user: what of the scene or the parameters makes no model.
pub fn build_press(
    p: &Parameters,
    press: &Press,
    components: &dyn Components,
) -> Result<Forming, String> {
    let scene = &p.scene;
    let stack = assembly::stack(scene)?;
    let RigidTool {
        mesh: tool,
        field: grid,
        error,
        warnings: tool_warnings,
    } = plyflow_tooling::given::rigid(scene, p.tool_grid)?;
    let planes = symmetry::planes(scene);
    symmetry::check(scene, planes, &stack, &tool)?;
    let at = levels(press, &stack, tool.bounds()[1][2])?;
    check_passage(press, &at, &tool)?;
    let (mut points, mut specs, mut bodies) = (Vec::new(), Vec::new(), Vec::new());
    let mut mirrors = Mirrors {
        planes,
        ..Mirrors::default()
    };
    for (k, sheet) in stack.iter().enumerate() {
        let z = at.blank + sheet.offset;
        let blank = assembly::blank_part(sheet, planes)?;
        let (spec, body) = assembly::add_ply(
            &mut points,
            &mut mirrors,
            &blank,
            z,
            (k, sheet),
            p,
            components,
        )?;
        bodies.push(body);
        specs.push(spec);
    }
    let mut model = Model::mirrored(points, specs, assembly::step_settings(p), mirrors)
        .map_err(|e| e.to_string())?;
    model.set_body_acceleration([
        0.0,
        0.0,
        match press.weight {
            None => 0.0,
            Some(Towards::Die) => STANDARD_GRAVITY,
            Some(Towards::Holder) => -STANDARD_GRAVITY,
        },
    ]);
    let parts = rigid_parts(press, &at, grid);
    add_contacts(&mut model, &stack, &parts, scene, p)?;
    model.add_plane_contacts(&assembly::contact_settings(p));
    let of_part = |part: &str| -> Vec<usize> {
        let contacts = model.rigid_contacts().iter().enumerate();
        let of = |name: &str| name.strip_prefix(part).is_some_and(|n| n.starts_with('/'));
        contacts
            .filter(|(_, c)| of(&c.name))
            .map(|(k, _)| k)
            .collect()
    };
    let held = match press.holder.as_ref().map(|h| &h.hold) {
        Some(Hold::Force(force)) => Some(HeldByForce {
            // What is given holds the whole.
            force: force.si() / planes.copies() as f64,
            mass: HOLDER_MASS * model.mass().iter().sum::<f64>(),
            most: at.die - at.blank,
            height: 0.0,
            velocity: 0.0,
        }),
        _ => None,
    };
    let mut load = PressLoad {
        stroke: Stroke {
            way: press.stroke.si(),
            forming: press.forming_time.si(),
            ramp: press.ramp_share.0 * press.forming_time.si(),
            settling: press.settling_time.si(),
        },
        punch: of_part("tool"),
        holder: of_part("holder"),
        held,
    };
    let start = model.time();
    load.apply(&mut model, start);
    let reference = model.start().clone();
    let reach = bodies_reach(&reference);
    let (die, holder) = plates(press, &at);
    let (mut rigid, mut field_errors) = (Vec::new(), vec![("tool", error)]);
    for (name, plate) in [("die", Some(die)), ("holder", holder)] {
        if let Some(plate) = plate {
            let body = RigidBody::plate(name, &plate, reach);
            field_errors.push((name, body.error_against(&plate)));
            rigid.push(body);
        }
    }
    Ok(Forming {
        model,
        load: Load::Press(load),
        stack,
        bodies,
        reference,
        tool,
        rigid,
        field_errors,
        tool_warnings,
        zone: None,
        start: None,
        element_size: p.element_size,
    })
}

/// Largest distance of a point from the axis (m).
fn bodies_reach(points: &[[f64; 3]]) -> f64 {
    points
        .iter()
        .map(|q| q[0].fixed_hypot(q[1]))
        .fold(0.0, f64::max)
}

fn plates(press: &Press, at: &Levels) -> (OpenPlate, Option<OpenPlate>) {
    let die = OpenPlate {
        height: at.die,
        side: 1.0,
        opening: press.die.opening_radius.si(),
        edge: press.die.edge_radius.si(),
    };
    let holder = press.holder.as_ref().zip(at.holder);
    let holder = holder.map(|(h, height)| OpenPlate {
        height,
        side: -1.0,
        opening: h.opening_radius.map_or(die.opening, |r| r.si()),
        edge: h.edge_radius.map_or(die.edge, |r| r.si()),
    });
    (die, holder)
}
