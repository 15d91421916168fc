//! Press forming: a rising punch, a die above the plies, a blank holder below them.
//!
//! The tool of the scene is the punch, described where it ends. It starts one stroke below, where it touches the
//! lowest ply, and pushes the plies through the opening of the die.

use crate::build::plates::Plates;
use crate::error::Result;
use crate::forming::Forming;
use crate::load::{HeldByForce, Load, PressLoad, Stroke};
use crate::request::Parameters;
use crate::stack::{
    Components, Elements, Parts, Placed, PlateMesh, RigidBody, RigidName, RigidPart, RigidShape,
    StackContacts, StackPlace, StackSheet, ToolSurface, layers, sheet, symmetry, tool,
};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::contact::{OpenPlate, RigidSurface};
use plyflow_mechanics::model::Model;
use plyflow_model::STANDARD_GRAVITY;
use plyflow_model::scene::{Hold, Press, Towards};
use plyflow_tooling::{FieldError, SignedDistanceGrid};
use std::sync::Arc;

/// Mass of a holder that a force presses, over that of the plies: heavy enough to follow their contacts stably in
/// explicit steps, light enough to follow the blank as it thickens.
const HOLDER_MASS: f64 = 20.0;

/// Builds the model of a press.
///
/// # Errors
/// What of the scene or the parameters makes no model.
pub fn build_press(p: &Parameters, press: &Press, components: &dyn Components) -> Result<Forming> {
    let scene = &p.scene;
    let stack = sheet::stack(scene)?;
    let tool = tool::rigid(p)?;
    let planes = symmetry::planes(scene);
    symmetry::check_tool(planes, &tool.mesh)?;
    let plates = Plates::new(press, &stack, tool.mesh.bounds()[1][2]);
    plates.check_passage(press, &tool.mesh)?;
    let elements = Elements { p, components };
    let mut parts = Parts::default();
    parts.mirrors.planes = planes;
    for sheet in &stack {
        let blank = sheet::blank_part(sheet, planes)?;
        parts.add_ply(sheet, &blank, plates.blank + sheet.offset, &elements)?;
    }
    let settings = p.step_settings();
    let mut model = Model::mirrored(parts.points, parts.specs, settings, parts.mirrors)?;
    model.set_body_acceleration([0.0, 0.0, fall(press.weight)]);
    let rigid = rigid_parts(&plates, tool.field);
    let placed = of_all_nodes(parts.placed, &model);
    add_contacts(&mut model, &stack, &placed, &rigid, p)?;
    model.add_plane_contacts(&p.contact_settings());
    let mut load = press_load(press, &plates, &model);
    load.apply(&mut model, 0.0);
    let reference = model.start().clone();
    let (rigid, errors) = shown(&plates, reach(&reference));
    let field_errors = [(RigidName::Tool, tool.error)]
        .into_iter()
        .chain(errors)
        .collect();
    Ok(Forming {
        model,
        load: Load::Press(load),
        stack,
        bodies: parts.bodies,
        reference,
        tool: tool.mesh,
        rigid,
        field_errors,
        placement: tool.placement,
        tool_warnings: tool.warnings,
        zone: None,
        slower: 1.0,
        start: None,
        element_size: p.element_size,
    })
}

/// Acceleration of free fall along z (m/s2).
pub fn fall(weight: Option<Towards>) -> f64 {
    match weight {
        None => 0.0,
        Some(Towards::Die) => STANDARD_GRAVITY,
        Some(Towards::Holder) => -STANDARD_GRAVITY,
    }
}

/// Largest distance of a point from the axis (m).
pub fn reach(points: &[Vec3]) -> f64 {
    let from_axis = |q: &Vec3| q[0].fixed_hypot(q[1]);
    points.iter().map(from_axis).fold(0.0, f64::max)
}

/// The plates as they are shown, out to a radius that covers `reach` (m), and by how much that is off.
pub fn shown(plates: &Plates, reach: f64) -> (Vec<RigidBody>, Vec<(RigidName, FieldError)>) {
    let of = |(name, plate): (RigidName, OpenPlate)| {
        let mesh = PlateMesh::new(&plate, reach);
        let error = (name.clone(), mesh.error_against(&plate));
        let body = RigidBody {
            name,
            above: plate.side > 0.0,
            shape: RigidShape::Plate(mesh),
        };
        (body, error)
    };
    plates.named().map(of).unzip()
}

/// What moves in the press, as it starts.
pub fn press_load(press: &Press, plates: &Plates, model: &Model) -> PressLoad {
    let contacts_of = |part: RigidName| -> Vec<usize> {
        let all = model.rigid_contacts().iter().enumerate();
        all.filter(|(_, c)| part.is_of(&c.name))
            .map(|(k, _)| k)
            .collect()
    };
    let held = match press.holder.as_ref().map(|h| &h.hold) {
        Some(Hold::Force(force)) => Some(HeldByForce {
            // What is given holds the whole.
            force: force.si() / model.planes().copies() as f64,
            mass: HOLDER_MASS * model.mass().iter().sum::<f64>(),
            most: plates.thickness(),
            guide: None,
            height: 0.0,
            velocity: 0.0,
        }),
        _ => None,
    };
    PressLoad {
        begin: 0.0,
        stroke: Stroke {
            way: press.stroke.si(),
            forming: press.forming_time.si(),
            ramp: press.ramp_share.0 * press.forming_time.si(),
            settling: press.settling_time.si(),
        },
        punch: contacts_of(RigidName::Tool),
        holder: contacts_of(RigidName::Holder),
        held,
    }
}

/// Plies of which all nodes may be slaves: also those that stand for mirror images.
pub fn of_all_nodes(mut placed: Vec<Placed>, model: &Model) -> Vec<Placed> {
    for ply in &mut placed {
        ply.slaves = ply.sheet.nodes(model).to_vec();
    }
    placed
}

/// Plies on each other, and on the rigid parts of a press: of a whole scene, or those that a zone has.
///
/// # Errors
/// When a friction coefficient is missing or makes no sense.
pub fn add_contacts(
    model: &mut Model,
    stack: &[StackSheet],
    placed: &[Placed],
    rigid: &[RigidPart],
    p: &Parameters,
) -> Result<()> {
    let contacts = StackContacts::new(stack, p);
    let plies = layers(placed);
    for pair in plies.windows(2) {
        contacts.add_pair(model, pair[1], pair[0], 1.0)?;
    }
    contacts.add_past(model, &plies)?;
    for part in rigid {
        for ply in &plies {
            let k = ply.place.0;
            let among = if part.above { k + 1..plies.len() } else { 0..k };
            let among: Vec<StackPlace> = among.map(StackPlace).collect();
            contacts.add_rigid(model, part, *ply, &among)?;
        }
    }
    for ply in &plies {
        contacts.add_folds(model, *ply)?;
    }
    model.set_contact_stiffness(&p.contact_settings());
    Ok(())
}

/// Punch, die, and holder if there is one.
pub fn rigid_parts(plates: &Plates, punch: SignedDistanceGrid) -> Vec<RigidPart> {
    let part = |name: RigidName, surface: Arc<dyn RigidSurface>| RigidPart {
        surface,
        above: name == RigidName::Die,
        film: None,
        moves: name != RigidName::Die,
        name,
    };
    let mut parts = vec![part(RigidName::Tool, Arc::new(ToolSurface(punch)))];
    parts.extend(
        plates
            .named()
            .map(|(name, plate)| part(name, Arc::new(plate))),
    );
    parts
}
