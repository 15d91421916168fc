//! What of a model changes from step to step.

use super::parts::Model;
use crate::archive::{Archive, ArchiveError};

impl Model {
    /// Writes the state between two steps, or takes it up in a model that was built in the same way: the next steps then
    /// give the same bits. Left out: what every step computes anew, the fields, and what [`super::Drive`]s and callers keep.
    ///
    /// # Errors
    /// When the bytes cannot be written or are not those of such a model; the model is then of no use.
    pub fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        a.numbers(self.state.x.as_flattened_mut())?;
        a.numbers(self.state.v.as_flattened_mut())?;
        a.numbers(self.state.normals.as_flattened_mut())?;
        if let Some(r) = self.state.rotations.as_deref_mut() {
            a.numbers(r.spin.as_flattened_mut())?;
        }
        a.value(&mut self.boundary.pressures)?;
        a.value(&mut self.boundary.last_above)?;
        a.value(&mut self.state.time)?;
        a.value(&mut self.state.cycle)?;
        a.value(&mut self.state.dt)?;
        a.value(&mut self.state.last_dt)?;
        a.value(&mut self.state.kick)?;
        a.value(&mut self.boundary.load_factor)?;
        a.value(&mut self.boundary.body_acceleration)?;
        a.value(&mut self.state.max_speed)?;
        a.value(&mut self.state.max_acceleration)?;
        a.value(&mut self.boundary.anchors)?;
        a.value(&mut self.state.ledger)?;
        a.value(&mut self.contacts.interfaces)?;
        for batch in self.elements.blocks.iter_mut().flat_map(|b| &mut b.batches) {
            a.numbers(&mut batch.history)?;
            a.numbers(&mut batch.material_history)?;
        }
        for batch in self
            .elements
            .patches
            .iter_mut()
            .flat_map(|b| &mut b.batches)
        {
            a.numbers(&mut batch.history)?;
        }
        for contact in &mut self.contacts.rigid {
            contact.archive(a)?;
        }
        for contact in &mut self.contacts.sheets {
            contact.archive(a)?;
        }
        for contact in &mut self.contacts.folds {
            contact.archive(a)?;
        }
        Ok(())
    }
}
