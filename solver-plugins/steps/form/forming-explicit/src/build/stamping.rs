//! Stamping: plies between any rigid parts.
//!
//! The scene's tool is one of the parts, below the plies. Each part is described where it is drawn, and its contacts shift it by its way.

use crate::build::apart::{Apart, Reach, check_apart, check_reach};
use crate::build::drawn::{Drawn, drawn};
use crate::build::grips::grips;
use crate::build::press::{add_contacts, of_all_nodes};
use crate::build::travel::{Stop, stop};
use crate::build::under::Under;
use crate::error::{FormingError, Result};
use crate::forming::Forming;
use crate::load::{ForceInTime, Load, Motion, MovedPart, PressedPart, StampingLoad};
use crate::request::Parameters;
use crate::stack::{
    Components, Elements, PartSurface, Parts, RigidBody, RigidName, RigidPart, RigidShape,
    StackSheet, sheet, symmetry, tool,
};
use plyflow_mechanics::history::MonotoneCubic;
use plyflow_mechanics::mirror::Planes;
use plyflow_mechanics::model::Model;
use plyflow_model::STANDARD_GRAVITY;
use plyflow_model::scene::{ForceCourse, PartMotion, Pressed, Side, Stamping, Vertical};
use std::sync::Arc;

/// Mass of all parts that are pressed, over that of the plies, and the least that each of them has. A part is moved by what the contacts gave in
/// the step before, as a node is, so that it is stable from a mass like that of the nodes it touches on.
const PRESSED_MASS: f64 = 5.0;

/// Builds the model of a stamping.
///
/// # Errors
/// What of the scene or the parameters makes no model.
pub fn build_stamping(
    p: &Parameters,
    stamping: &Stamping,
    components: &dyn Components,
) -> Result<Forming> {
    let scene = &p.scene;
    let stack = sheet::stack(scene)?;
    let planes = symmetry::planes(scene);
    let tool = tool::rigid(p)?;
    let drawn = drawn(p, stamping, (&tool.mesh, tool.field, tool.error))?;
    check_mirrored(&drawn, planes)?;
    let blank = laid(stamping, &drawn, &stack)?;
    let elements = Elements { p, components };
    let mut parts = Parts::default();
    parts.mirrors.planes = planes;
    for sheet in &stack {
        let part = sheet::blank_part(sheet, planes)?;
        parts.add_ply(sheet, &part, blank + sheet.offset, &elements)?;
    }
    let mut model = Model::mirrored(parts.points, parts.specs, p.step_settings(), parts.mirrors)?;
    model.set_body_acceleration([0.0, 0.0, fall(stamping.weight)]);
    let rigid: Vec<RigidPart> = drawn.iter().map(contact_part).collect();
    let end = stamping.forming_time.si();
    let stops = stops(&drawn, end);
    let placed = of_all_nodes(parts.placed, &model);
    add_contacts(&mut model, &stack, &placed, &rigid, p)?;
    model.add_plane_contacts(&p.contact_settings());
    let mut load = StampingLoad {
        begin: 0.0,
        forming: end,
        settling: stamping.settling_time.si(),
        parts: moved(&drawn, &stops, &model, None)?,
        grips: grips(stamping, &model, p.time_step, None)?,
        stops: told_stops(&drawn, &stops),
    };
    put(&load, &mut model);
    load.apply(&mut model, 0.0);
    // Plies lie on parts, not in them: a micrometre that a part's field is off would throw a ply up that only rests there.
    model.clear_rigid();
    let reference = model.start().clone();
    let field_errors = drawn.iter().map(|d| (d.name.clone(), d.error)).collect();
    let mut tool_warnings = tool.warnings;
    tool_warnings.extend(without_partner(&drawn, &stops));
    Ok(Forming {
        model,
        load: Load::Stamping(load),
        stack,
        bodies: parts.bodies,
        reference,
        tool: tool.mesh,
        rigid: drawn.into_iter().filter_map(body).collect(),
        field_errors,
        placement: tool.placement,
        tool_warnings,
        zone: None,
        slower: 1.0,
        start: None,
        element_size: p.element_size,
    })
}

/// Whether every part is its own mirror image.
fn check_mirrored(parts: &[Drawn], planes: Planes) -> Result<()> {
    for part in parts {
        symmetry::check_tool(planes, &part.mesh).map_err(|e| match e {
            FormingError::Symmetry(text) => {
                FormingError::Symmetry(format!("part `{}`: {text}", part.name.word()))
            }
            other => other,
        })?;
    }
    Ok(())
}

/// Height (m) of the lower face of the lowest ply at the start, between parts that can do what they are to do.
fn laid(stamping: &Stamping, parts: &[Drawn], stack: &[StackSheet]) -> Result<f64> {
    let (reach, end) = (Reach::new(stack)?, stamping.forming_time.si());
    let blank = blank_height(stamping, parts, &reach)?;
    check_reach(parts, &reach, blank, end)?;
    check_apart(&Apart {
        parts,
        reach: &reach,
        end,
    })?;
    Ok(blank)
}

/// Acceleration of free fall along z (m/s2).
pub fn fall(weight: Option<Vertical>) -> f64 {
    match weight {
        None => 0.0,
        Some(Vertical::Up) => STANDARD_GRAVITY,
        Some(Vertical::Down) => -STANDARD_GRAVITY,
    }
}

/// The part as the sheets meet it.
pub fn contact_part(part: &Drawn) -> RigidPart {
    RigidPart {
        name: part.name.clone(),
        surface: Arc::new(PartSurface(part.field.clone())),
        above: part.side == Side::Above,
        film: None,
        moves: part.words.as_ref().is_some_and(|w| w.motion.is_some()),
    }
}

/// The part as the artifact shows it; the scene's tool has its own place there.
pub fn body(part: Drawn) -> Option<RigidBody> {
    (part.name != RigidName::Tool).then(|| RigidBody {
        above: part.side == Side::Above,
        shape: RigidShape::Triangles(part.mesh),
        name: part.name,
    })
}

/// Height (m) of the lower face of the lowest ply at the start.
fn blank_height(stamping: &Stamping, parts: &[Drawn], reach: &Reach) -> Result<f64> {
    if let Some(height) = stamping.blank_height {
        return Ok(height.si());
    }
    let below = parts.iter().filter(|p| p.side == Side::Below);
    let tops = below.filter_map(|part| reach.highest(&part.mesh, part.shift(0.0)));
    let top = tops.map(|at| at[2]).fold(f64::NEG_INFINITY, f64::max);
    match top.is_finite() {
        true => Ok(top),
        false => Err(FormingError::Scene(
            "process.stamping: no part is below a ply at the start, on which the plies could lie; expected a part with `side: below` under them, or \
             their height as `blank_height: ..`"
                .into(),
        )),
    }
}

/// Where the parts stop that are pressed; none of others.
pub fn stops(parts: &[Drawn], end: f64) -> Vec<Option<Stop>> {
    let of = |(k, part): (usize, &Drawn)| {
        let travel = part.pressed()?.travel;
        Some(match travel {
            Some(travel) => Stop {
                travel: travel.si(),
                meets: None,
            },
            None => stop(parts, k, end),
        })
    };
    parts.iter().enumerate().map(of).collect()
}

/// What is told of stops that the scene leaves out.
fn told_stops(parts: &[Drawn], stops: &[Option<Stop>]) -> Vec<String> {
    let told = |(part, stop): (&Drawn, &Option<Stop>)| {
        let stop = stop.as_ref()?;
        let meets = stop.meets.as_ref()?;
        Some(format!(
            "process.stamping: the part `{}` is pressed and has no `travel`: it may go {:.3} mm beyond the place where it is drawn, where it meets `{meets}`",
            part.name.word(),
            1e3 * stop.travel
        ))
    };
    parts.iter().zip(stops).filter_map(told).collect()
}

/// What is told of parts without `travel` that no part stops.
fn without_partner(parts: &[Drawn], stops: &[Option<Stop>]) -> Vec<String> {
    let alone = |(part, stop): (&Drawn, &Option<Stop>)| {
        let open = part.pressed()?.travel.is_none();
        (open && stop.as_ref()?.meets.is_none()).then(|| {
            format!(
                "the part `{}` is pressed, and no part is on the other side of the plies to stop it: it goes no further than where it is drawn. Say with \
                 `travel` how far it may go beyond",
                part.name.word()
            )
        })
    };
    parts.iter().zip(stops).filter_map(alone).collect()
}

/// How the parts move; in a `zone`, as the run of the whole recorded it of those that are pressed. `stops`: by part, where it stops if it is pressed.
///
/// # Errors
/// When a zone's boundary does not tell the way of such a part.
pub fn moved(
    parts: &[Drawn],
    stops: &[Option<Stop>],
    model: &Model,
    zone: Option<&Under<'_>>,
) -> Result<Vec<MovedPart>> {
    let (slower, begin) = zone.map_or((1.0, 0.0), |z| (z.input.slower, z.input.time[0]));
    let copies = model.planes().copies() as f64;
    let plies: f64 = model.mass().iter().sum();
    let pressed = parts.iter().filter(|p| p.is_pressed()).count().max(1);
    let usual = plies * (PRESSED_MASS / pressed as f64).max(1.0);
    let motion = |part: &Drawn, stop: &Option<Stop>| -> Result<Motion> {
        let words = part.words.as_ref().and_then(|w| w.motion.as_ref());
        let table = || part.table(slower).map(Motion::Table);
        let Some(PartMotion::Pressed(words)) = words else {
            return Ok(words.and_then(|_| table()).unwrap_or(Motion::Still));
        };
        let guide = zone.map(|z| z.guide_of(part)).transpose()?;
        Ok(Motion::Pressed(PressedPart {
            // What is given holds the whole.
            force: force(words, copies, slower),
            spring: words.spring.map_or(0.0, |s| s.si()) / copies,
            travel: stop.as_ref().map_or(0.0, |s| s.travel),
            mass: words.mass.map_or(usual, |m| m.si() / copies),
            guide,
        }))
    };
    let of = |(part, stop): (&Drawn, &Option<Stop>)| {
        let all = model.rigid_contacts().iter().enumerate();
        let contacts = all.filter(|(_, c)| part.name.is_of(&c.name));
        let contacts = contacts.map(|(k, _)| k).collect();
        let (name, outwards) = (part.name.clone(), part.outwards());
        let motion = motion(part, stop)?;
        Ok(MovedPart::new(name, outwards, contacts, motion, begin))
    };
    parts.iter().zip(stops).map(of).collect()
}

fn force(words: &Pressed, copies: f64, slower: f64) -> ForceInTime {
    match &words.force {
        ForceCourse::Value(force) => ForceInTime::Grown(force.si() / copies),
        ForceCourse::Course(course) => {
            let rows = course
                .table
                .iter()
                .map(|r| (slower * r.time.si(), r.force.si() / copies));
            let (times, forces) = rows.unzip();
            ForceInTime::Course(MonotoneCubic::new(times, forces))
        }
    }
}

/// Puts the parts where they start, at rest.
pub fn put(load: &StampingLoad, model: &mut Model) {
    for part in &load.parts {
        for c in &part.contacts {
            model.rigid_contacts_mut()[*c].motion.shift = part.outwards.map(|o| o * part.way);
        }
    }
}
