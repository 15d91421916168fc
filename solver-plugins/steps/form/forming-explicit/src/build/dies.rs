//! What the sheets of a zone lie between in a press or a stamping: the rigid parts of the whole, which move as they do there.
//!
//! A part that follows a table or a stroke follows it. One that is pressed has the share of its force that the zone has of the plies under it, about the
//! way that the run of the whole recorded.

use crate::build::drawn::drawn;
use crate::build::grips::{Cut, grips};
use crate::build::plates::Plates;
use crate::build::under::Under;
use crate::build::{press, stamping};
use crate::error::Result;
use crate::load::{Load, PressLoad, StampingLoad};
use crate::request::{LocalInput, Parameters};
use crate::stack::{Placed, RigidBody, RigidName, RigidPart, StackSheet, sheet};
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::model::Model;
use plyflow_model::scene::{Press, Stamping};
use plyflow_tooling::{FieldError, RigidTool};

/// The sheets of a zone as they are in its model.
pub struct Sheets<'a> {
    /// Those that the zone has, from the tool upwards.
    pub stack: &'a [StackSheet],
    /// Their places; slaves are the nodes that are not driven.
    pub placed: &'a [Placed],
    /// What drives them.
    pub input: &'a LocalInput,
}

/// Rigid parts around a zone.
pub struct Dies {
    /// What moves.
    pub load: Load,
    /// What is shown besides the tool.
    pub rigid: Vec<RigidBody>,
    /// By how much contacts see them otherwise.
    pub field_errors: Vec<(RigidName, FieldError)>,
}

/// Puts a zone between punch, die and holder, where they are when it begins.
///
/// # Errors
/// When friction is missing, or the boundary does not tell how a holder moved that a force presses.
pub fn in_press(
    p: &Parameters,
    press: &Press,
    tool: &RigidTool,
    sheets: &Sheets<'_>,
    model: &mut Model,
) -> Result<Dies> {
    let input = sheets.input;
    // Also plies that do not reach into the zone hold the plates apart.
    let whole = sheet::stack(&p.scene)?;
    let plates = Plates::new(press, &whole, tool.mesh.bounds()[1][2]);
    model.set_body_acceleration([0.0, 0.0, press::fall(press.weight)]);
    let rigid = press::rigid_parts(&plates, tool.field.clone());
    press::add_contacts(model, sheets.stack, sheets.placed, &rigid, p)?;
    let mut load = PressLoad {
        begin: input.time[0],
        ..press::press_load(press, &plates, model)
    };
    load.stroke.slow(input.slower);
    if let Some(held) = &mut load.held {
        let under = Under {
            input,
            whole: &whole,
        };
        let inner = plates.holder.map_or(0.0, |h| h.opening + h.edge);
        let guide = under.guide(RigidName::Holder.word(), &|p| press::reach(&[p]) >= inner)?;
        held.height = guide.way.at(load.begin);
        held.guide = Some(guide);
    }
    load.apply(model, load.begin);
    let (rigid, errors) = press::shown(&plates, press::reach(&corners(&whole)?));
    let own = (RigidName::Tool, tool.error);
    Ok(Dies {
        load: Load::Press(load),
        rigid,
        field_errors: std::iter::once(own).chain(errors).collect(),
    })
}

/// Corners of all plies (m).
fn corners(stack: &[StackSheet]) -> Result<Vec<Vec3>> {
    let mut all = Vec::new();
    for sheet in stack {
        let outline = sheet::blank(sheet)?.outline();
        all.extend(outline.into_iter().map(|[x, y]| [x, y, 0.0]));
    }
    Ok(all)
}

/// Puts a zone between the parts of a stamping, where they are when it begins.
///
/// # Errors
/// When a part has no surface, friction is missing, or the boundary does not tell how a part moved that is pressed.
pub fn in_stamping(
    p: &Parameters,
    stamping: &Stamping,
    tool: &RigidTool,
    sheets: &Sheets<'_>,
    model: &mut Model,
) -> Result<Dies> {
    let input = sheets.input;
    let all = drawn(p, stamping, (&tool.mesh, tool.field.clone(), tool.error))?;
    model.set_body_acceleration([0.0, 0.0, stamping::fall(stamping.weight)]);
    let rigid: Vec<RigidPart> = all.iter().map(stamping::contact_part).collect();
    press::add_contacts(model, sheets.stack, sheets.placed, &rigid, p)?;
    let cut = Cut {
        input,
        stack: sheets.stack,
    };
    let whole = sheet::stack(&p.scene)?;
    let under = Under {
        input,
        whole: &whole,
    };
    let stops = stamping::stops(&all, stamping.forming_time.si());
    let mut load = StampingLoad {
        begin: input.time[0],
        forming: input.slower * stamping.forming_time.si(),
        settling: input.slower * stamping.settling_time.si(),
        parts: stamping::moved(&all, &stops, model, Some(&under))?,
        grips: grips(stamping, model, p.time_step, Some(&cut))?,
        // The run of the whole has told them.
        stops: Vec::new(),
    };
    stamping::put(&load, model);
    load.apply(model, load.begin);
    let field_errors = all.iter().map(|d| (d.name.clone(), d.error)).collect();
    Ok(Dies {
        load: Load::Stamping(load),
        rigid: all.into_iter().filter_map(stamping::body).collect(),
        field_errors,
    })
}
