//! Contacts of the sheets of a stack: of two that lie on each other, and of a ply with itself.

use crate::error::Result;
use crate::request::Parameters;
use crate::stack::friction::{FrictionTable, Touching};
use crate::stack::locate::locate;
use crate::stack::place::{Layer, StackPlace};
use crate::stack::rim::crooked_rim;
use crate::stack::sheet::StackSheet;
use plyflow_mechanics::contact::{FoldSpec, FrictionLaw, SheetContact, SlaveItem, Tie, Ties};
use plyflow_mechanics::mesh::NONE;
use plyflow_mechanics::model::Model;
use plyflow_model::scene::{Sheet, SheetKind};

/// Least distance of the mid-surfaces of two bare films in contact (m). They are 0.08 mm thick; at so small a
/// distance the direction from one film's facets to the other's nodes turns by a large angle over a few
/// micrometres in every fold, which explicit steps cannot follow. Where no ply lies between the films, 0.2 mm
/// more or less between them changes nothing.
pub const LEAST_FILM_DISTANCE: f64 = 3e-4;

/// What makes the contacts of a stack. Models are asked while they are as they start, with the sheets flat.
pub struct StackContacts<'a> {
    /// From the tool upwards.
    pub stack: &'a [StackSheet],
    /// The scene's.
    pub friction: FrictionTable<'a>,
    /// What else is given.
    pub p: &'a Parameters,
}

impl<'a> StackContacts<'a> {
    /// For a stack of the scene.
    pub fn new(stack: &'a [StackSheet], p: &'a Parameters) -> Self {
        let friction = FrictionTable { scene: &p.scene };
        Self { stack, friction, p }
    }

    /// The sheet at a place.
    pub fn sheet(&self, place: StackPlace) -> &'a StackSheet {
        &self.stack[place.0]
    }

    /// Its name.
    pub fn name(&self, place: StackPlace) -> &'a str {
        &self.sheet(place).scene.name
    }

    /// Whether it is a ply.
    pub fn is_ply(&self, place: StackPlace) -> bool {
        self.sheet(place).scene.kind == SheetKind::Ply
    }

    /// The contact of slaves on a master. `side` 1: the slaves lie above; -1: below.
    pub fn on_sheet(
        &self,
        model: &Model,
        slave: Layer<'_>,
        master: Layer<'_>,
        side: f64,
        friction: FrictionLaw,
    ) -> SheetContact {
        let touching =
            0.5 * (self.sheet(slave.place).thickness + self.sheet(master.place).thickness);
        let films = !self.is_ply(slave.place) && !self.is_ply(master.place);
        let offset = if films {
            touching.max(LEAST_FILM_DISTANCE)
        } else {
            touching
        };
        let items = locate(model, master.sheet, slave.slaves);
        let name = format!("{}/{}", self.name(master.place), self.name(slave.place));
        let settings = self.p.contact_settings();
        let mut contact = SheetContact::new(name, side, offset, friction, &settings, items);
        contact.rim = crooked_rim(model, master.sheet);
        contact
    }

    /// Adds the contact of slaves on a master that they rub on by the scene's own law. `side`: as [`StackContacts::on_sheet`].
    ///
    /// # Errors
    /// When the scene gives none.
    pub fn add_pair(
        &self,
        model: &mut Model,
        slave: Layer<'_>,
        master: Layer<'_>,
        side: f64,
    ) -> Result<()> {
        let touching = Touching {
            parts: [slave.place.min(master.place), slave.place.max(master.place)]
                .map(|k| self.name(k)),
            slave: self.name(slave.place),
        };
        let friction = self.friction.law(model, &touching)?;
        let mut contact = self.on_sheet(model, slave, master, side, friction);
        if self.is_tied(slave.place, master.place) {
            let laid = contact.items.iter().filter(|item| lies_on(model, item));
            contact.ties = Ties::new(laid.map(|i| Tie::new(i.node, i.cell, i.xi)).collect());
        }
        model.add_sheet_contact(contact);
        Ok(())
    }

    /// Whether a sheet is tied to another. A zone may lack the one below it in the scene.
    fn is_tied(&self, upper: StackPlace, lower: StackPlace) -> bool {
        Sheet::ties(&self.p.scene.sheets).any(|two| two == (self.name(upper), self.name(lower)))
    }

    /// Adds the contact of a ply with itself, unless `self_contact` is off. Where the scene has no coefficient for fabric on fabric it
    /// is without friction: few plies fold, and a scene of one ply need not give it.
    ///
    /// # Errors
    /// When the law of friction makes no sense.
    pub fn add_folds(&self, model: &mut Model, ply: Layer<'_>) -> Result<()> {
        let cells = ply.sheet.cell_range(model);
        if !self.p.self_contact || cells.is_empty() {
            return Ok(());
        }
        let mut slaves = ply.slaves.to_vec();
        slaves.sort_unstable();
        let name = self.name(ply.place);
        let friction = if self.p.scene.friction.fabric_fabric.is_some() {
            let touching = Touching {
                parts: [name, name],
                slave: name,
            };
            self.friction.law(model, &touching)?
        } else {
            0.0.into()
        };
        let spec = FoldSpec {
            name: format!("{name}/{name}"),
            slaves,
            cell_range: (cells.start, cells.end),
            thickness: self.sheet(ply.place).thickness,
            friction,
            undeformed: model.start().clone(),
        };
        model.add_self_contact(spec, &self.p.contact_settings());
        Ok(())
    }
}

/// Whether a node lies over the place in its cell that it has been given, in plan: one beyond the master's rim has been given the nearest cell.
fn lies_on(model: &Model, item: &SlaveItem) -> bool {
    // Of a ply without cells, as a zone may have.
    if item.cell == NONE {
        return false;
    }
    let x = model.x();
    let corners = model.cells()[item.cell as usize].map(|n| x[n as usize]);
    let off = |d: usize| {
        let place: f64 = item
            .weights()
            .iter()
            .zip(corners)
            .map(|(w, p)| w * p[d])
            .sum();
        (x[item.node as usize][d] - place).abs()
    };
    off(0) + off(1) < 1e-9
}
