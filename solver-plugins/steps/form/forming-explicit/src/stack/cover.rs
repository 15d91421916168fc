//! What sheets of a stack touch besides their neighbours: past the edges of what lies between.
//!
//! A ply reaches out over the one below it, lies over a hole of it or beside it, or slides past its edge (plies of one outline whose
//! fibres lie at different angles do): there it touches what comes next, at the distance of what is really between. How far plies slide
//! nobody knows before. So any two sheets of a stack have a contact, with all of their nodes; where something lies between they are too
//! far apart to touch, and nodes that are far from touching sleep.

use crate::error::Result;
use crate::stack::contact::StackContacts;
use crate::stack::place::{Layer, StackPlace};
use crate::stack::rigid::RigidName;
use crate::stack::sheet::StackSheet;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::contact::{RigidContact, RigidItem, RigidSurface, SheetContact, SlaveItem};
use plyflow_mechanics::model::Model;
use std::collections::HashSet;
use std::sync::Arc;

/// Where on its cell a slave is nearest to.
fn place(item: &SlaveItem, cells: &[[u32; 4]], x: &[Vec3]) -> Vec3 {
    let corners = cells[item.cell as usize].map(|n| x[n as usize]);
    let add = |sum: Vec3, (w, p): (f64, Vec3)| [0, 1, 2].map(|c| sum[c] + w * p[c]);
    item.weights().into_iter().zip(corners).fold([0.0; 3], add)
}

/// Share of the distance of two plies by which nodes of the lower one may reach into cells of the upper one before these are held off, besides what
/// the straight cells of both cut off where they are curved.
///
/// The nodes of the upper one, which lie on the lower one, carry what presses the two together. Held at the same distance the nodes of the lower
/// one would share in it, in shares that no physics gives, and where nodes lie on nodes a bag at rest trembles.
const LET_IN: f64 = 0.05;
/// The same share for films: these are only to be kept from crossing. How deep one is in the other beside the plies matters to nobody, and what catches
/// there puts work in (`docs/decisions/0050-what-slides-off-an-edge.md`).
const FILMS_LET_IN: f64 = 0.25;
/// A sheet that others keep away from a rigid part is held by the part itself once those are squeezed by this share of their
/// thickness. Held at their full thickness it would share their load with them, in shares that no physics gives, and past the
/// surfaces on which they slide (`docs/decisions/0025-loads-go-through-the-stack.md`).
pub const SHARE_SQUEEZED: f64 = 0.05;

/// Slack (m) of a sheet that a rigid part holds through the sheets `between`.
fn slack_through(between: &[&StackSheet]) -> f64 {
    SHARE_SQUEEZED * between.iter().map(|s| s.thickness).sum::<f64>()
}

/// Distance (m) of a sheet's mid-plane from what is under (or over) all the sheets `between`.
fn offset_over(between: &[&StackSheet], sheet: &StackSheet) -> f64 {
    // Summed from the tool upwards, as the stack's own offsets are.
    let under = between.iter().fold(0.0, |sum, s| sum + s.thickness);
    under + 0.5 * sheet.thickness
}

/// What the name of a contact ends with that holds a ply where plies (their places in the stack) do not lie between.
fn beside(missing: &[&str]) -> String {
    // Also a part of the path of its energies in the artifact.
    format!("/beside_{}", missing.join("_"))
}

/// A rigid part as the sheets of a stack meet it.
pub struct RigidPart {
    /// Which it is.
    pub name: RigidName,
    /// Its surface.
    pub surface: Arc<dyn RigidSurface>,
    /// Whether it lies above the stack.
    pub above: bool,
    /// The film that lies between it and all plies everywhere.
    pub film: Option<StackPlace>,
    /// Whether it moves.
    pub moves: bool,
}

impl StackContacts<'_> {
    /// Adds the contacts of plies with all sheets that are not their neighbours in the stack, and those in which nodes of a lower ply or
    /// film hold cells of an upper one. `layers`: the whole stack, from the tool upwards.
    ///
    /// # Errors
    /// When a friction coefficient is missing or makes no sense.
    pub fn add_past(&self, model: &mut Model, layers: &[Layer<'_>]) -> Result<()> {
        let pairs = || {
            let below = |upper: usize| layers[..upper].iter().map(move |low| (low, &layers[upper]));
            (0..layers.len()).flat_map(below)
        };
        let is_ply = |of: &Layer<'_>| self.is_ply(of.place);
        // Neighbours have theirs.
        for (low, high) in pairs().filter(|(low, high)| high.place.0 - low.place.0 > 1) {
            let contact = match (is_ply(low), is_ply(high)) {
                (_, true) => self.past(model, *high, *low, 1.0)?,
                (true, false) => self.past(model, *low, *high, -1.0)?,
                (false, false) => continue,
            };
            model.add_sheet_contact(contact);
        }
        for (low, high) in pairs().filter(|(low, high)| is_ply(low) == is_ply(high)) {
            let mut contact = self.past(model, *low, *high, -1.0)?;
            contact.let_in = Some(if is_ply(low) { LET_IN } else { FILMS_LET_IN });
            if !is_ply(low) {
                // Where the films are joined they have the same nodes, which lie on cells of their own.
                let of_both: HashSet<u32> =
                    high.sheet.cells(model).iter().flatten().copied().collect();
                let (cells, x) = (model.cells(), model.x());
                let lies_over = |i: &SlaveItem| {
                    let [at, p] = [place(i, cells, x), x[i.node as usize]];
                    (at[0] - p[0]).abs().max((at[1] - p[1]).abs()) < 1e-6
                };
                (contact.items).retain(|i| !of_both.contains(&i.node) && lies_over(i));
            }
            model.add_sheet_contact(contact);
        }
        Ok(())
    }

    /// The contact of two sheets with others between them.
    fn past(
        &self,
        model: &Model,
        slave: Layer<'_>,
        master: Layer<'_>,
        side: f64,
    ) -> Result<SheetContact> {
        let (from, to) = (slave.place.min(master.place), slave.place.max(master.place));
        let chain: Vec<&str> = (from.0..=to.0).map(|k| self.name(StackPlace(k))).collect();
        let friction = self.friction.past(model, &chain, self.name(slave.place))?;
        let mut contact = self.on_sheet(model, slave, master, side, friction);
        // What lies between holds them apart but at its edges, where all may touch for a moment.
        (contact.share, contact.counted) = (0.5, 0.0);
        Ok(contact)
    }

    /// The contact of a sheet with a rigid part through the sheets `between`, from the part on.
    ///
    /// # Errors
    /// When a friction coefficient is missing or makes no sense.
    pub fn on_rigid(
        &self,
        model: &Model,
        part: &RigidPart,
        slave: Layer<'_>,
        between: &[StackPlace],
        name: String,
    ) -> Result<RigidContact> {
        let own = self.name(slave.place);
        let mut chain: Vec<&str> = std::iter::once(part.name.word())
            .chain(between.iter().map(|k| self.name(*k)))
            .chain([own])
            .collect();
        let between: Vec<&StackSheet> = between.iter().map(|k| self.sheet(*k)).collect();
        if part.above {
            chain.reverse();
        }
        let mut contact = RigidContact::new(
            name,
            part.surface.clone(),
            offset_over(&between, self.sheet(slave.place)),
            self.friction.through(model, &chain, own)?,
            &self.p.contact_settings(),
            slave.slaves.iter().map(|n| RigidItem::new(*n)).collect(),
        )
        .with_slack(slack_through(&between));
        contact.moves = part.moves;
        Ok(contact)
    }

    /// Adds the contacts of a ply with a rigid part: of what faces the part it rubs on it; elsewhere its nodes stay outside of the part
    /// where the chords of other sheets' elements cut through its fillets. `among`: the plies between the two, from the tool upwards.
    /// Nodes that lie on all of these are held at the distance of their thicknesses; all nodes, at that of what lies there in any case.
    /// To be called when the contacts of the plies with each other are there.
    ///
    /// # Errors
    /// When a friction coefficient is missing or makes no sense.
    pub fn add_rigid(
        &self,
        model: &mut Model,
        part: &RigidPart,
        ply: Layer<'_>,
        among: &[StackPlace],
    ) -> Result<()> {
        let own = self.name(ply.place);
        let film: Vec<StackPlace> = part.film.into_iter().collect();
        let mut all = [&film[..], among].concat();
        if part.above {
            all.reverse();
        }
        let name = format!("{}/{own}", part.name.word());
        let mut contact = self.on_rigid(model, part, ply, &all, name.clone())?;
        let side = if part.above { -1.0 } else { 1.0 };
        let among: Vec<&str> = among.iter().map(|k| self.name(*k)).collect();
        for other in &among {
            let other = format!("{other}/{own}");
            let of_both = |c: &SheetContact| {
                c.name == other && c.side == side && c.items.len() == ply.slaves.len()
            };
            let found = model.sheet_contacts().iter().position(of_both);
            contact.through.extend(found);
        }
        debug_assert!(contact.through.len() == among.len());
        model.add_rigid_contact(contact);
        if !among.is_empty() {
            let name = name + &beside(&among);
            let mut contact = self.on_rigid(model, part, ply, &film, name)?;
            (contact.share, contact.counted) = (0.5, 0.0);
            model.add_rigid_contact(contact);
        }
        Ok(())
    }
}
