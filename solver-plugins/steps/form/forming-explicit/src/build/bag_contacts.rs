//! The contacts of a stack between two films, or under one.

use crate::error::Result;
use crate::request::Parameters;
use crate::stack::friction::Touching;
use crate::stack::{
    Placed, RigidName, RigidPart, StackContacts, StackPlace, StackSheet, ToolSurfaces, layers,
};
use plyflow_mechanics::contact::{Plane, RigidContact, RigidItem, RigidSurface};
use plyflow_mechanics::model::Model;
use std::sync::Arc;

/// The lower film; it lies between the tool and everything else.
const BOTTOM: StackPlace = StackPlace(0);

/// Sets up all contacts of a stack between two films, of the scene or of those of its sheets that a zone has. `placed` is in stack order (first
/// and last are the films).
///
/// # Errors
/// When a friction coefficient is missing or makes no sense.
pub fn add_contacts(
    model: &mut Model,
    stack: &[StackSheet],
    placed: &[Placed],
    p: &Parameters,
    tool: &mut ToolSurfaces,
) -> Result<()> {
    let contacts = StackContacts::new(stack, p);
    let layers = layers(placed);
    let (bottom, top) = (layers[0], layers[layers.len() - 1]);
    let plies = &layers[1..top.place.0];
    add_bottom(model, &contacts, placed, tool)?;
    for pair in layers[..top.place.0].windows(2) {
        contacts.add_pair(model, pair[1], pair[0], 1.0)?;
    }
    // The plies' nodes are the slaves of both films: the two films have the same mesh, so whatever unevenness
    // node-to-surface contact makes of a uniform pressure is the same above and below, and cancels. With the
    // film above as the slave of the ply it does not, and the evacuated stack waves (tried).
    if let Some(last) = plies.last() {
        contacts.add_pair(model, *last, top, -1.0)?;
    }
    contacts.add_pair(model, top, bottom, 1.0)?;
    contacts.add_past(model, &layers)?;
    let through_film = |surface| RigidPart {
        name: RigidName::Tool,
        surface,
        above: false,
        film: Some(BOTTOM),
        moves: false,
    };
    for (k, ply) in plies.iter().enumerate() {
        let part = through_film(tool.of(model, ply.sheet));
        let among: Vec<StackPlace> = plies[..k].iter().map(|below| below.place).collect();
        contacts.add_rigid(model, &part, *ply, &among)?;
    }
    // The upper film lies on the cells of the lower one, whose chords cut the tool's edges.
    let part = through_film(tool.of(model, top.sheet));
    let name = format!("{}/{}", part.name.word(), contacts.name(top.place));
    let mut contact = contacts.on_rigid(model, &part, top, &[BOTTOM], name)?;
    (contact.share, contact.counted) = (0.5, 0.0);
    model.add_rigid_contact(contact);
    for ply in plies {
        contacts.add_folds(model, *ply)?;
    }
    model.set_contact_stiffness(&p.contact_settings());
    Ok(())
}

/// The same of plies that lie on the tool under one film, the last of `placed`. Every sheet may lie on the tool, and on the `bed` where there is one.
///
/// # Errors
/// When a friction coefficient is missing or makes no sense.
pub fn add_contacts_under_one(
    model: &mut Model,
    stack: &[StackSheet],
    placed: &[Placed],
    p: &Parameters,
    (tool, bed): (&mut ToolSurfaces, bool),
) -> Result<()> {
    let contacts = StackContacts::new(stack, p);
    let layers = layers(placed);
    let film = layers[layers.len() - 1];
    let plies = &layers[..film.place.0];
    for pair in plies.windows(2) {
        contacts.add_pair(model, pair[1], pair[0], 1.0)?;
    }
    // The plies' nodes carry the film, as between two films.
    if let Some(last) = plies.last() {
        contacts.add_pair(model, *last, film, -1.0)?;
    }
    contacts.add_past(model, &layers)?;
    for name in [RigidName::Tool, RigidName::Bed] {
        if name == RigidName::Bed && !bed {
            continue;
        }
        let mut part_for = |model: &Model, sheet| RigidPart {
            name: name.clone(),
            surface: match name {
                RigidName::Bed => Arc::new(Plane { height: 0.0 }),
                _ => tool.of(model, sheet),
            },
            above: false,
            film: None,
            moves: false,
        };
        for (k, ply) in plies.iter().enumerate() {
            let part = part_for(model, ply.sheet);
            let among: Vec<StackPlace> = plies[..k].iter().map(|below| below.place).collect();
            contacts.add_rigid(model, &part, *ply, &among)?;
        }
        // Beyond the plies the film lies on it itself.
        let part = part_for(model, film.sheet);
        let of_both = format!("{}/{}", name.word(), contacts.name(film.place));
        let contact = contacts.on_rigid(model, &part, film, &[], of_both)?;
        model.add_rigid_contact(contact);
    }
    for ply in plies {
        contacts.add_folds(model, *ply)?;
    }
    model.set_contact_stiffness(&p.contact_settings());
    Ok(())
}

/// What the lower film lies on: the tool, and the bed around it.
fn add_bottom(
    model: &mut Model,
    contacts: &StackContacts<'_>,
    placed: &[Placed],
    tool: &mut ToolSurfaces,
) -> Result<()> {
    let (own, film) = (contacts.name(BOTTOM), &placed[BOTTOM.0]);
    let bed: Arc<dyn RigidSurface> = Arc::new(Plane { height: 0.0 });
    let tool = tool.of(model, film.sheet);
    for (part, surface) in [(RigidName::Tool, tool), (RigidName::Bed, bed)] {
        let touching = Touching {
            parts: [part.word(), own],
            slave: own,
        };
        let contact = RigidContact::new(
            format!("{}/{own}", part.word()),
            surface,
            contacts.sheet(BOTTOM).offset,
            contacts.friction.law(model, &touching)?,
            &contacts.p.contact_settings(),
            film.slaves.iter().map(|n| RigidItem::new(*n)).collect(),
        );
        model.add_rigid_contact(contact);
    }
    Ok(())
}
