//! An element under test: every call goes through guarded buffers.

mod patch;

use crate::breaches::{Ask, Breaches, DT, Refusal};
use crate::buffer::Guarded;
use crate::meeting::{Counter, same};
use crate::shapes::Elements;
use plyflow_sdk::abi::*;
use std::ffi::c_void;

pub(crate) use patch::{PatchAnswer, PatchState};

/// An element formulation made for a material.
pub(crate) struct Subject {
    functions: *const pf_element_functions,
    instance: *mut c_void,
    pub(crate) sizes: pf_element_sizes,
    pub(crate) of_material: pf_material_sizes,
    material: pf_material,
}

// The contract: several threads call one instance at once. That is what is tested.
unsafe impl Sync for Subject {}
unsafe impl Send for Subject {}

impl Drop for Subject {
    fn drop(&mut self) {
        unsafe { ((*self.functions).destroy)(self.instance) };
    }
}

/// The buffers of a batch of elements that live from call to call.
#[derive(Clone)]
pub(crate) struct State {
    pub(crate) lanes: usize,
    pub(crate) constants: Guarded,
    pub(crate) history: Guarded,
    pub(crate) material_history: Guarded,
}

/// What initialise gave.
pub(crate) struct Masses {
    pub(crate) mass: Vec<f64>,
    /// Empty without rotations.
    pub(crate) inertia: Vec<f64>,
    pub(crate) breaches: Breaches,
}

/// What a call of `forces` gave.
#[derive(Clone, Debug)]
pub(crate) struct Answer {
    /// `[nodes][3][lanes]`
    pub(crate) force: Vec<f64>,
    /// `[nodes][3][lanes]`; empty without rotations.
    pub(crate) moment: Vec<f64>,
    /// `[3][lanes]`
    pub(crate) energy: Vec<f64>,
    /// Empty when not asked for.
    pub(crate) fields: Vec<f64>,
    /// Empty when not asked for.
    pub(crate) step: Vec<f64>,
    pub(crate) breaches: Breaches,
}

impl Answer {
    /// Sum of the energies of a lane (J).
    pub(crate) fn total(&self, l: usize) -> f64 {
        let lanes = self.energy.len() / PF_ENERGIES;
        (0..PF_ENERGIES).map(|r| self.energy[r * lanes + l]).sum()
    }

    /// Largest force component of a lane (N).
    pub(crate) fn largest(&self, l: usize) -> f64 {
        let lanes = self.energy.len() / PF_ENERGIES;
        let rows = self.force.chunks_exact(lanes);
        rows.fold(0.0f64, |m, row| m.max(row[l].abs()))
    }
}

/// A step that the nodes do.
#[derive(Clone, Copy, Default)]
pub(crate) struct Motion<'a> {
    /// Positions before; `None`: at rest.
    pub(crate) from: Option<&'a [f64]>,
    /// Rotation vectors of the nodes during the step (rad); `None`: none.
    pub(crate) spin: Option<&'a [f64]>,
}

impl Subject {
    /// Makes an instance and reads its sizes.
    ///
    /// # Safety
    /// `functions` and `material` must be valid as long as the subject lives.
    pub(crate) unsafe fn create(
        functions: *const pf_element_functions,
        parameters: &str,
        material: &pf_material,
    ) -> Result<Self, Refusal> {
        let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
        let text = pf_str::new(parameters);
        let code =
            unsafe { ((*functions).create)(text, material, &raw mut instance, &raw mut error) };
        if code != PF_OK {
            let text = error.get();
            return Err(match code {
                PF_ERROR if !text.is_empty() => Refusal::Said(text),
                _ => Refusal::Broken(format!("create returned {code} with the text '{text}'")),
            });
        }
        if instance.is_null() {
            let text = "create returned 0 (PF_OK) but left the instance NULL";
            return Err(Refusal::Broken(text.into()));
        }
        let mut of_material = pf_material_sizes::default();
        unsafe { ((*material.functions).sizes)(material.instance, &raw mut of_material) };
        let mut new = Self {
            functions,
            instance,
            sizes: pf_element_sizes::default(),
            of_material,
            material: *material,
        };
        let code = unsafe { ((*functions).sizes)(instance, &raw mut new.sizes) };
        if code != PF_OK {
            return Err(Refusal::Broken(format!("sizes returned {code}")));
        }
        Ok(new)
    }

    pub(crate) fn has_patch_functions(&self) -> bool {
        let f = unsafe { &*self.functions };
        f.patch_initialise.is_some() && f.patch_forces.is_some()
    }

    pub(crate) fn nodes(&self) -> usize {
        self.sizes.nodes as usize
    }

    pub(crate) fn rotates(&self) -> bool {
        self.sizes.dofs_per_node == 6
    }

    /// Whether `forces` gets velocities: never where the element says that it does not read them.
    fn sees_velocity(&self) -> bool {
        self.rotates() && self.sizes.ignores_velocity == 0
    }

    /// Whether forces depend on what was before.
    pub(crate) fn remembers(&self) -> bool {
        self.sizes.history > 0
            || (self.sizes.material_points > 0 && self.of_material.membrane_history > 0)
    }

    fn batch(&self, lanes: usize, position: *const f64, state: &mut State) -> pf_element_batch {
        let null = std::ptr::null_mut();
        pf_element_batch {
            size: size_of::<pf_element_batch>() as u64,
            lanes: lanes as u32,
            reserved: 0,
            dt: 0.0,
            position,
            velocity: null,
            spin: null,
            axis: null,
            constants: state.constants.pointer(),
            history: state.history.pointer(),
            material_history: state.material_history.pointer(),
            force: null,
            moment: null,
            energy: null,
            fields: null,
            mass: null,
            inertia: null,
            critical_step: null,
            material: &raw const self.material,
        }
    }

    /// Calls initialise.
    pub(crate) fn initialise(&self, elements: &Elements) -> (State, Masses) {
        let (n, lanes) = (self.nodes(), elements.lanes);
        let s = &self.sizes;
        let rows = s.material_points as usize * self.of_material.membrane_history as usize;
        let mut state = State {
            lanes,
            constants: Guarded::poisoned(s.constants as usize * lanes),
            history: Guarded::zeros(s.history as usize * lanes),
            material_history: Guarded::zeros(rows * lanes),
        };
        let mut position = Guarded::of(&elements.reference);
        let mut axis = Guarded::of(&elements.axis);
        let mut mass = Guarded::poisoned(n * lanes);
        let mut inertia = Guarded::poisoned(if self.rotates() { n * lanes } else { 0 });
        let mut batch = self.batch(lanes, position.pointer(), &mut state);
        batch.axis = axis.pointer();
        batch.mass = mass.pointer();
        if self.rotates() {
            batch.inertia = inertia.pointer();
        }
        let code = unsafe { ((*self.functions).initialise)(self.instance, &raw const batch) };
        let mut b = Breaches::default();
        let call = "initialise";
        b.status(call, code);
        b.unchanged(call, "position", &position, &elements.reference);
        b.unchanged(call, "axis", &axis, &elements.axis);
        b.zones(call, "history", &state.history);
        b.zones(call, "material_history", &state.material_history);
        b.output(call, "constants", &state.constants, lanes);
        b.output(call, "mass", &mass, lanes);
        b.output(call, "inertia", &inertia, lanes);
        let masses = Masses {
            mass: mass.slice().to_vec(),
            inertia: inertia.slice().to_vec(),
            breaches: b,
        };
        (state, masses)
    }

    /// Calls forces at `position` (`[nodes][3][lanes]`); histories advance.
    pub(crate) fn forces(
        &self,
        state: &mut State,
        position: &[f64],
        motion: Motion<'_>,
        ask: Ask,
    ) -> Answer {
        let (n, lanes) = (self.nodes(), state.lanes);
        let vectors = 3 * n * lanes;
        let turning = if self.rotates() { vectors } else { 0 };
        let mut x = Guarded::of(position);
        let velocity: Vec<f64> = match motion.from {
            Some(from) => position
                .iter()
                .zip(from)
                .map(|(b, a)| (b - a) / DT)
                .collect(),
            None => vec![0.0; vectors],
        };
        let spin: Vec<f64> = match motion.spin {
            Some(angle) => angle.iter().map(|a| a / DT).collect(),
            None => vec![0.0; vectors],
        };
        let (mut v, mut w) = (Guarded::of(&velocity), Guarded::of(&spin));
        let mut force = Guarded::poisoned(vectors);
        let mut moment = Guarded::poisoned(turning);
        let mut energy = Guarded::poisoned(PF_ENERGIES * lanes);
        let rows = if ask.fields {
            self.sizes.fields as usize
        } else {
            0
        };
        let mut fields = Guarded::poisoned(rows * lanes);
        let mut step = Guarded::poisoned(if ask.bound { lanes } else { 0 });
        let constants = state.constants.slice().to_vec();
        let mut batch = self.batch(lanes, x.pointer(), state);
        batch.dt = if motion.from.is_some() { DT } else { 0.0 };
        batch.force = force.pointer();
        batch.energy = energy.pointer();
        if self.sees_velocity() {
            batch.velocity = v.pointer();
        }
        if self.rotates() {
            batch.spin = w.pointer();
            batch.moment = moment.pointer();
        }
        if ask.fields {
            batch.fields = fields.pointer();
        }
        if ask.bound {
            batch.critical_step = step.pointer();
        }
        let code = unsafe { ((*self.functions).forces)(self.instance, &raw const batch) };
        let mut b = Breaches::default();
        let call = "forces";
        b.status(call, code);
        b.unchanged(call, "position", &x, position);
        b.unchanged(call, "velocity", &v, &velocity);
        b.unchanged(call, "spin", &w, &spin);
        b.unchanged(call, "constants", &state.constants, &constants);
        b.zones(call, "history", &state.history);
        b.zones(call, "material_history", &state.material_history);
        for (name, buffer) in [
            ("force", &force),
            ("moment", &moment),
            ("energy", &energy),
            ("fields", &fields),
            ("critical_step", &step),
        ] {
            b.output(call, name, buffer, lanes);
        }
        Answer {
            force: force.slice().to_vec(),
            moment: moment.slice().to_vec(),
            energy: energy.slice().to_vec(),
            fields: fields.slice().to_vec(),
            step: step.slice().to_vec(),
            breaches: b,
        }
    }
}

impl Subject {
    /// Calls forces `times` times on the same state with as little around the calls as can be, so that calls of
    /// several threads meet, through the `counter` of all; how many differ from the state and the answer that one thread got.
    pub(crate) fn hammer(
        &self,
        (state, position): (&State, &[f64]),
        ask: Ask,
        (after, want): (&State, &Answer),
        times: usize,
        counter: &Counter<'_>,
    ) -> usize {
        let (vectors, lanes) = (position.len(), state.lanes);
        let turning = if self.rotates() { vectors } else { 0 };
        let mut now = state.clone();
        let mut x = Guarded::of(position);
        let (mut v, mut w) = (Guarded::zeros(turning), Guarded::zeros(turning));
        let mut force = Guarded::zeros(vectors);
        let mut moment = Guarded::zeros(turning);
        let mut energy = Guarded::zeros(PF_ENERGIES * lanes);
        let mut fields = Guarded::zeros(want.fields.len());
        let mut step = Guarded::zeros(want.step.len());
        let mut batch = self.batch(lanes, x.pointer(), &mut now);
        batch.force = force.pointer();
        batch.energy = energy.pointer();
        if self.sees_velocity() {
            batch.velocity = v.pointer();
        }
        if self.rotates() {
            batch.spin = w.pointer();
            batch.moment = moment.pointer();
        }
        if ask.fields {
            batch.fields = fields.pointer();
        }
        if ask.bound {
            batch.critical_step = step.pointer();
        }
        (0..times)
            .filter(|_| {
                let (to, from) = (&mut now.history, state.history.slice());
                to.slice_mut().copy_from_slice(from);
                let (to, from) = (&mut now.material_history, state.material_history.slice());
                to.slice_mut().copy_from_slice(from);
                let call =
                    || unsafe { ((*self.functions).forces)(self.instance, &raw const batch) };
                let code = counter.during(call);
                let outputs = [
                    (&force, &want.force[..]),
                    (&moment, &want.moment),
                    (&energy, &want.energy),
                    (&fields, &want.fields),
                    (&step, &want.step),
                    (&now.history, after.history.slice()),
                    (&now.material_history, after.material_history.slice()),
                ];
                code != PF_OK || outputs.iter().any(|(got, want)| !same(got.slice(), want))
            })
            .count()
    }
}
