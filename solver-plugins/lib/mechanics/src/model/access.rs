//! What of a model others may see and change.

use super::boundary::Held;
use super::parts::Model;
use super::spent::{Clock, Spent};
use crate::contact::{RigidContact, SelfContact, SheetContact};
use crate::sheet::{Pressures, Sheet};
use crate::vec3::{Vec3, scale, sub};

/// What is there.
impl Model {
    /// `[n]` positions (m).
    pub fn x(&self) -> &[Vec3] {
        &self.state.x
    }

    /// `[n]` velocities at the half step (m/s).
    pub fn v(&self) -> &[Vec3] {
        &self.state.v
    }

    /// `[n]` masses, scaled (kg).
    pub fn mass(&self) -> &[f64] {
        &self.topology.mass
    }

    /// `[n]` unit normals of the sheets.
    pub fn normals(&self) -> &[Vec3] {
        &self.state.normals
    }

    /// Sheets from the tool upwards.
    pub fn sheets(&self) -> &[Sheet] {
        &self.topology.sheets
    }

    /// `[cells][4]` nodes of all sheets' cells.
    pub fn cells(&self) -> &[[u32; 4]] {
        &self.topology.cells
    }

    /// Sheet on sheet.
    pub fn sheet_contacts(&self) -> &[SheetContact] {
        &self.contacts.sheets
    }

    /// Sheets on themselves.
    pub fn self_contacts(&self) -> &[SelfContact] {
        &self.contacts.folds
    }

    /// Sheets on rigid surfaces.
    pub fn rigid_contacts(&self) -> &[RigidContact] {
        &self.contacts.rigid
    }

    /// Time (s) of the positions.
    pub fn time(&self) -> f64 {
        self.state.time
    }

    /// Steps done.
    pub fn cycle(&self) -> u64 {
        self.state.cycle
    }

    /// The step (s).
    pub fn dt(&self) -> f64 {
        self.state.dt
    }

    /// Pressures of the last step, or those of the next (Pa).
    pub fn pressures(&self) -> Pressures {
        self.boundary.pressures
    }

    /// Where the time goes.
    pub fn spent(&self) -> &Spent {
        &self.workspace.spent
    }
}

/// What is built into it.
impl Model {
    /// Adds a contact between two sheets.
    pub fn add_sheet_contact(&mut self, contact: SheetContact) {
        self.contacts.sheets.push(contact);
    }

    /// Adds a contact of a sheet with something rigid, and gives its number.
    pub fn add_rigid_contact(&mut self, contact: RigidContact) -> usize {
        self.contacts.rigid.push(contact);
        self.contacts.rigid.len() - 1
    }

    /// Contacts between sheets, to set them up or take items out.
    pub fn sheet_contacts_mut(&mut self) -> &mut Vec<SheetContact> {
        &mut self.contacts.sheets
    }

    /// Contacts with rigid surfaces, to set them up or take items out.
    pub fn rigid_contacts_mut(&mut self) -> &mut Vec<RigidContact> {
        &mut self.contacts.rigid
    }

    /// Contacts of sheets with themselves, to set them up.
    pub fn self_contacts_mut(&mut self) -> &mut [SelfContact] {
        &mut self.contacts.folds
    }

    /// Takes driven nodes out of contacts with what does not give way to them: rigid surfaces, the sheets `firm`, whose nodes there are driven
    /// too, and folds of their own sheet.
    pub fn release_driven(&mut self, firm: &[usize]) {
        let held = &self.boundary.held;
        let free = |n: u32| held[n as usize] != Held::Driven;
        let ranges = firm.iter().map(|s| self.topology.sheets[*s].cell_range);
        let ranges: Vec<_> = ranges.collect();
        for contact in &mut self.contacts.sheets {
            let mut cells = contact.items.iter().map(|i| i.cell as usize);
            if cells.any(|c| ranges.iter().any(|(from, to)| (*from..*to).contains(&c))) {
                contact.items.retain(|i| free(i.node));
            }
        }
        for contact in &mut self.contacts.rigid {
            contact.items.retain(|i| free(i.node));
        }
        for contact in &mut self.contacts.folds {
            contact.retain(free);
        }
    }
}

/// What sets it down somewhere: a start that something else has computed.
impl Model {
    /// `[n]` positions (m). Contacts that have looked already do not see a jump: for starts alone.
    pub fn x_mut(&mut self) -> &mut [Vec3] {
        &mut self.state.x
    }

    /// `[n]` velocities at the half step (m/s).
    pub fn v_mut(&mut self) -> &mut [Vec3] {
        &mut self.state.v
    }

    /// Puts nodes that lie inside of rigid surfaces onto them.
    pub fn clear_rigid(&mut self) {
        for contact in &self.contacts.rigid {
            for item in &contact.items {
                let x = &mut self.state.x[item.node as usize];
                let (distance, out) = contact.surface.distance(sub(*x, contact.motion.shift));
                let gap = distance - contact.offset;
                if gap < 0.0 {
                    *x = sub(*x, scale(out, gap));
                }
            }
        }
    }

    /// Counts what the ledger cannot account for at present as work done from outside: that of what has set the model down where it is.
    pub fn count_drift_as_work(&mut self) {
        self.state.ledger.external += self.energies().drift();
    }
}

/// What acts on it, and its step.
impl Model {
    /// Sets the pressures of the next steps (Pa).
    pub fn set_pressures(&mut self, pressures: Pressures) {
        self.boundary.pressures = pressures;
    }

    /// Sets the acceleration of free fall (m/s2), global axes.
    pub fn set_body_acceleration(&mut self, acceleration: Vec3) {
        self.boundary.body_acceleration = acceleration;
    }

    /// Acceleration of free fall (m/s2), global axes.
    pub fn body_acceleration(&self) -> Vec3 {
        self.boundary.body_acceleration
    }

    /// Sets what the nodal loads are multiplied by.
    pub fn set_load_factor(&mut self, factor: f64) {
        self.boundary.load_factor = factor;
    }

    /// Sets the step (s).
    pub fn set_step(&mut self, dt: f64) {
        self.state.dt = dt;
    }

    /// Counts what a clock that was started before the loads has seen.
    pub fn count_loads(&mut self, clock: Clock) {
        self.workspace.spent.count_loads(clock);
    }
}
