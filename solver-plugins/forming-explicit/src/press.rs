//! Press forming: a rising punch, a die above the plies, a blank holder below them.
//!
//! The tool of the scene is the punch, described where it ends. It starts one stroke below, where it touches the
//! lowest ply, and pushes the plies through the opening of the die.

use crate::assembly::{self, Components, StackSheet, ToolSurface};
use crate::global::ply_box;
use crate::parameters::Parameters;
use crate::process::Load;
use crate::run::{Body, Forming, RigidBody};
use plyflow_mechanics::contact::{OpenPlate, RigidContact, RigidItem, RigidMotion, RigidSurface};
use plyflow_mechanics::history::{constant_speed_way, smooth_step};
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::Model;
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_model::scene::{Hold, Press, Towards};
use std::sync::Arc;

/// Free fall (m/s2).
const GRAVITY: f64 = 9.81;
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
    /// Moves punch and holder to where they are at the model's time.
    pub fn apply(&mut self, model: &mut Model) {
        let (t, dt) = (model.time, model.dt);
        let at = |t: f64| -self.stroke.left(t);
        let height = at(t);
        let before = self
            .punch
            .first()
            .map_or(height, |c| model.rigid_contacts[*c].motion.shift[2]);
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
            model.rigid_contacts[*c].motion = moved(height, before);
        }
        let Some(held) = &mut self.held else { return };
        // The sheets' resistance of the last step: a holder many times their mass barely moves in one.
        let resistance: f64 = (self.holder.iter())
            .map(|c| model.rigid_contacts[*c].resultant()[2])
            .sum();
        let force = held.force * smooth_step(t, 0.0, HOLD_RISE * self.stroke.forming);
        let drag = HOLDER_DAMPING * held.mass * held.velocity;
        held.velocity += (force - resistance - drag) / held.mass * dt;
        let before = held.height;
        held.height += held.velocity * dt;
        for c in &self.holder {
            model.rigid_contacts[*c].motion = moved(held.height, before);
        }
    }

    /// Force of the punch on the plies, upwards (N).
    pub fn punch_force(&self, model: &Model) -> f64 {
        let lift = |c: &usize| model.rigid_contacts[*c].resultant()[2];
        self.punch.iter().map(lift).sum()
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
        Some(Hold::Gap(gap)) if gap.si() >= thickness => Some(die - gap.si()),
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
    let mu = assembly::coefficient(scene.friction.tool_fabric, "tool_fabric")?;
    let between = if stack.len() > 1 {
        assembly::coefficient(scene.friction.fabric_fabric, "fabric_fabric")?
    } else {
        0.0
    };
    let (tool, grid) = assembly::tool(scene, p.tool_grid)?;
    let at = levels(press, &stack, tool.bounds()[1][2])?;
    let (mut points, mut specs, mut bodies) = (Vec::new(), Vec::new(), Vec::new());
    for (k, sheet) in stack.iter().enumerate() {
        let b = ply_box(sheet)?;
        let mesh = QuadMesh::grid(
            &even_axis(b[0], b[2], p.element_size),
            &even_axis(b[1], b[3], p.element_size),
        );
        let first = points.len() as u32;
        let z = at.blank + sheet.offset;
        points.extend(mesh.points.iter().map(|q| [q[0], q[1], z]));
        bodies.push(Body::new(sheet, k, mesh.cells.clone()));
        specs.push(SheetSpec {
            name: sheet.scene.name.clone(),
            nodes: (first..points.len() as u32).collect(),
            layers: vec![1.0; mesh.cells.len()],
            pressed: vec![Pressed::No; mesh.cells.len()],
            patches: mesh.patches(),
            least_areal_mass: vec![p.least_areal_mass; mesh.cells.len()],
            cells: mesh.cells,
            axis: assembly::axis(&sheet.scene),
            element: assembly::element(components, sheet, &p.element)?,
        });
    }
    let reference = points.clone();
    let mut model =
        Model::new(points, specs, assembly::step_settings(p)).map_err(|e| e.to_string())?;
    model.body_acceleration[2] = match press.weight {
        None => 0.0,
        Some(Towards::Die) => GRAVITY,
        Some(Towards::Holder) => -GRAVITY,
    };
    let (die, holder) = plates(press, &at);
    let mut parts = vec![
        (
            "tool",
            Arc::new(ToolSurface(grid)) as Arc<dyn RigidSurface>,
            false,
        ),
        ("die", Arc::new(die), true),
    ];
    if let Some(plate) = holder {
        parts.push(("holder", Arc::new(plate), false));
    }
    let contacts = |part: &str, model: &Model| -> Vec<usize> {
        let prefix = format!("{part}/");
        let of = |c: &RigidContact| c.name.starts_with(&prefix);
        (0..model.rigid_contacts.len())
            .filter(|k| of(&model.rigid_contacts[*k]))
            .collect()
    };
    let top: f64 = stack.iter().map(|s| s.thickness).sum();
    for (part, surface, above) in parts {
        for (k, sheet) in stack.iter().enumerate() {
            // Only the ply that faces the part rubs on it; the others just stay outside.
            let faces = if above { k + 1 == stack.len() } else { k == 0 };
            let offset = if above {
                top - sheet.offset
            } else {
                sheet.offset
            };
            let nodes = &model.sheets[k].nodes;
            let contact = RigidContact::new(
                format!("{part}/{}", sheet.scene.name),
                surface.clone(),
                if faces { mu } else { 0.0 },
                &assembly::contact_settings(p),
                nodes.iter().map(|n| RigidItem::new(*n, offset)).collect(),
            );
            model.rigid_contacts.push(contact);
        }
    }
    for k in 1..stack.len() {
        let slaves = model.sheets[k].nodes.clone();
        let on = (k - 1, k - 1);
        assembly::add_sheet_contact(&mut model, &stack, (k, &slaves), on, 1.0, between, p);
    }
    model.set_contact_stiffness(&assembly::contact_settings(p));
    let held = match press.holder.as_ref().map(|h| &h.hold) {
        Some(Hold::Force(force)) => Some(HeldByForce {
            force: force.si(),
            mass: HOLDER_MASS * model.mass.iter().sum::<f64>(),
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
        punch: contacts("tool", &model),
        holder: contacts("holder", &model),
        held,
    };
    load.apply(&mut model);
    let reach = bodies_reach(&reference);
    let mut rigid = vec![RigidBody::plate("die", &die, reach)];
    rigid.extend(holder.map(|h| RigidBody::plate("holder", &h, reach)));
    Ok(Forming {
        model,
        load: Load::Press(load),
        stack,
        bodies,
        reference,
        tool,
        rigid,
        zone: None,
        element_size: p.element_size,
    })
}

/// Largest distance of a point from the axis (m).
fn bodies_reach(points: &[[f64; 3]]) -> f64 {
    points.iter().map(|q| q[0].hypot(q[1])).fold(0.0, f64::max)
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
