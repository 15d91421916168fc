//! What of a model changes from step to step.

use super::*;
use crate::archive::{Archive, ArchiveError};

impl Model {
    /// Writes the state between two steps, or takes it up in a model that was built in the same way: the next steps then
    /// give the same bits. Left out: what every step computes anew, the fields, and what [`Drive`]s and callers keep.
    ///
    /// # Errors
    /// When the bytes cannot be written or are not those of such a model; the model is then of no use.
    pub fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        a.numbers(self.x.as_flattened_mut())?;
        a.numbers(self.v.as_flattened_mut())?;
        a.numbers(self.normals.as_flattened_mut())?;
        if let Some(r) = self.rotations.as_deref_mut() {
            a.numbers(r.spin.as_flattened_mut())?;
        }
        a.value(&mut self.pressures)?;
        a.value(&mut self.last_above)?;
        a.value(&mut self.time)?;
        a.value(&mut self.cycle)?;
        a.value(&mut self.dt)?;
        a.value(&mut self.last_dt)?;
        a.value(&mut self.kick)?;
        a.value(&mut self.load_factor)?;
        a.value(&mut self.body_acceleration)?;
        a.value(&mut self.max_speed)?;
        a.value(&mut self.max_acceleration)?;
        a.value(&mut self.anchors)?;
        a.value(&mut self.ledger)?;
        a.value(&mut self.interfaces)?;
        for batch in self.blocks.iter_mut().flat_map(|b| &mut b.batches) {
            a.numbers(&mut batch.history)?;
            a.numbers(&mut batch.material_history)?;
        }
        for batch in self.patches.iter_mut().flat_map(|b| &mut b.batches) {
            a.numbers(&mut batch.history)?;
        }
        for contact in &mut self.rigid_contacts {
            contact.archive(a)?;
        }
        for contact in &mut self.sheet_contacts {
            contact.archive(a)?;
        }
        for contact in &mut self.self_contacts {
            contact.archive(a)?;
        }
        Ok(())
    }
}
