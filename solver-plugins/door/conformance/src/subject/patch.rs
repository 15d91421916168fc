//! The patch part of an element under test.

use super::Subject;
use crate::breaches::{Ask, Breaches};
use crate::buffer::Guarded;
use crate::meeting::{CALLS, Counter, same};
use crate::shapes::Patches;
use plyflow_sdk::abi::*;

/// The buffers of a batch of patches that live from call to call.
#[derive(Clone)]
pub(crate) struct PatchState {
    pub(crate) lanes: usize,
    pub(crate) constants: Guarded,
    pub(crate) history: Guarded,
}

/// What a call of `patch_forces` gave.
#[derive(Clone, Debug)]
pub(crate) struct PatchAnswer {
    /// `[slots][3][lanes]`
    pub(crate) force: Vec<f64>,
    /// `[lanes]`
    pub(crate) energy: Vec<f64>,
    pub(crate) fields: Vec<f64>,
    /// `[slots][lanes]`; empty when not asked for.
    pub(crate) stiffness: Vec<f64>,
    pub(crate) breaches: Breaches,
}

impl Subject {
    pub(crate) fn slots(&self) -> usize {
        self.sizes.patch_nodes as usize
    }

    fn patch_batch(
        &self,
        lanes: usize,
        position: *const f64,
        state: &mut PatchState,
    ) -> pf_patch_batch {
        let null = std::ptr::null_mut();
        pf_patch_batch {
            size: size_of::<pf_patch_batch>() as u64,
            lanes: lanes as u32,
            reserved: 0,
            dt: 0.0,
            position,
            count: null,
            area: null,
            axis: null,
            constants: state.constants.pointer(),
            history: state.history.pointer(),
            force: null,
            energy: null,
            fields: null,
            stiffness: null,
            material: &raw const self.material,
        }
    }

    /// Calls patch_initialise.
    pub(crate) fn patch_initialise(&self, patches: &Patches) -> (PatchState, Breaches) {
        let lanes = patches.lanes;
        let s = &self.sizes;
        let rows = s.patch_history as usize + self.of_material.bending_history as usize;
        let mut state = PatchState {
            lanes,
            constants: Guarded::poisoned(s.patch_constants as usize * lanes),
            history: Guarded::zeros(rows * lanes),
        };
        let mut b = Breaches::default();
        let Some(call) = self.functions().patch_initialise else {
            return (state, b);
        };
        let mut position = Guarded::of(&patches.reference);
        let mut count = Guarded::of(&patches.count);
        let mut area = Guarded::of(&patches.area);
        let mut axis = Guarded::of(&patches.axis);
        let mut batch = self.patch_batch(lanes, position.pointer(), &mut state);
        batch.count = count.pointer();
        batch.area = area.pointer();
        batch.axis = axis.pointer();
        // SAFETY: this table's instance, and a batch with the guarded buffers that plyflow.h asks of this call, of the lengths for its sizes.
        let code = unsafe { call(self.instance, &raw const batch) };
        let call = "patch_initialise";
        b.status(call, code);
        b.unchanged(call, "position", &position, &patches.reference);
        b.unchanged(call, "count", &count, &patches.count);
        b.unchanged(call, "area", &area, &patches.area);
        b.unchanged(call, "axis", &axis, &patches.axis);
        b.zones(call, "history", &state.history);
        b.output(call, "constants", &state.constants, lanes);
        (state, b)
    }

    /// Calls patch_forces at `position` (`[slots][3][lanes]`).
    pub(crate) fn patch_forces(
        &self,
        state: &mut PatchState,
        position: &[f64],
        dt: f64,
        ask: Ask,
    ) -> PatchAnswer {
        let (slots, lanes) = (self.slots(), state.lanes);
        let asked =
            |rows: usize, wanted: bool| Guarded::poisoned(if wanted { rows * lanes } else { 0 });
        let mut x = Guarded::of(position);
        let mut force = Guarded::poisoned(3 * slots * lanes);
        let mut energy = Guarded::poisoned(lanes);
        let mut fields = asked(self.sizes.patch_fields as usize, ask.fields);
        let mut stiffness = asked(slots, ask.bound);
        let constants = state.constants.slice().to_vec();
        let mut batch = self.patch_batch(lanes, x.pointer(), state);
        batch.dt = dt;
        batch.force = force.pointer();
        batch.energy = energy.pointer();
        if ask.fields {
            batch.fields = fields.pointer();
        }
        if ask.bound {
            batch.stiffness = stiffness.pointer();
        }
        let mut b = Breaches::default();
        let call = "patch_forces";
        if let Some(f) = self.functions().patch_forces {
            // SAFETY: as in `patch_initialise`, with the buffers of this call.
            b.status(call, unsafe { f(self.instance, &raw const batch) });
        }
        b.unchanged(call, "position", &x, position);
        b.unchanged(call, "constants", &state.constants, &constants);
        b.zones(call, "history", &state.history);
        for (name, buffer) in [
            ("force", &force),
            ("energy", &energy),
            ("fields", &fields),
            ("stiffness", &stiffness),
        ] {
            b.output(call, name, buffer, lanes);
        }
        PatchAnswer {
            force: force.slice().to_vec(),
            energy: energy.slice().to_vec(),
            fields: fields.slice().to_vec(),
            stiffness: stiffness.slice().to_vec(),
            breaches: b,
        }
    }

    /// As [`Subject::hammer`], of patch_forces.
    pub(crate) fn hammer_patches(
        &self,
        (state, position): (&PatchState, &[f64]),
        ask: Ask,
        (after, want): &(PatchState, PatchAnswer),
        counter: &Counter<'_>,
    ) -> usize {
        let Some(call) = self.functions().patch_forces else {
            return 0;
        };
        let lanes = state.lanes;
        let mut now = state.clone();
        let mut x = Guarded::of(position);
        let mut force = Guarded::zeros(position.len());
        let mut energy = Guarded::zeros(lanes);
        let mut fields = Guarded::zeros(want.fields.len());
        let mut stiffness = Guarded::zeros(want.stiffness.len());
        let mut batch = self.patch_batch(lanes, x.pointer(), &mut now);
        batch.force = force.pointer();
        batch.energy = energy.pointer();
        if ask.fields {
            batch.fields = fields.pointer();
        }
        if ask.bound {
            batch.stiffness = stiffness.pointer();
        }
        (0..CALLS)
            .filter(|_| {
                let (to, from) = (&mut now.history, state.history.slice());
                to.slice_mut().copy_from_slice(from);
                // SAFETY: as in `patch_forces`, with buffers of this thread's own.
                let code = counter.during(|| unsafe { call(self.instance, &raw const batch) });
                let outputs = [
                    (&force, &want.force[..]),
                    (&energy, &want.energy),
                    (&fields, &want.fields),
                    (&stiffness, &want.stiffness),
                    (&now.history, after.history.slice()),
                ];
                code != PF_OK || outputs.iter().any(|(got, want)| !same(got.slice(), want))
            })
            .count()
    }
}
