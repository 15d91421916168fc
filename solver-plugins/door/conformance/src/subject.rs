//! An element under test: every call goes through guarded buffers.

pub(crate) mod patch;

use crate::breaches::{Ask, Breaches, DT, Refusal};
use crate::buffer::Guarded;
use crate::meeting::{CALLS, Counter, same};
use crate::shapes::Elements;
use plyflow_sdk::abi::*;
use std::ffi::c_void;

/// Strain of the deformed states.
pub(crate) const STRAIN: f64 = 0.02;

/// An element formulation made for a material.
pub(crate) struct Subject {
    functions: *const pf_element_functions,
    instance: *mut c_void,
    pub(crate) sizes: pf_element_sizes,
    pub(crate) of_material: pf_material_sizes,
    material: pf_material,
}

// SAFETY: plyflow.h asks of an instance that several threads may call it at once. That is what is tested: one that breaks it may break the process,
// which is there for the plugin under test.
unsafe impl Sync for Subject {}
// SAFETY: as for `Sync`.
unsafe impl Send for Subject {}

impl Drop for Subject {
    fn drop(&mut self) {
        // SAFETY: made by this table's `create`, ended once; the table is valid as long as the subject lives (`create`).
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

/// What a call of `forces` reads and writes beside the state, between guard zones.
struct Buffers {
    position: Guarded,
    velocity: Guarded,
    spin: Guarded,
    force: Guarded,
    moment: Guarded,
    energy: Guarded,
    fields: Guarded,
    step: Guarded,
}

/// Outputs of `forces` as `plyflow.h` calls them.
const OUTPUTS: [&str; 5] = ["force", "moment", "energy", "fields", "critical_step"];

impl Buffers {
    /// In the order of [`OUTPUTS`].
    fn outputs(&self) -> [&Guarded; 5] {
        [
            &self.force,
            &self.moment,
            &self.energy,
            &self.fields,
            &self.step,
        ]
    }
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
    /// `functions` must be a whole table, and `material` a whole material, valid as long as the subject lives. What their functions do with what they
    /// are given is under test: it may be more than plyflow.h allows, within the guard zones of [`Guarded`].
    pub(crate) unsafe fn create(
        functions: *const pf_element_functions,
        parameters: &str,
        material: &pf_material,
    ) -> Result<Self, Refusal> {
        let text = pf_str::new(parameters);
        // SAFETY: a valid table and material (the caller's promise), a text, and room for the instance and the error that `or_instance` has.
        let create = |new, error| unsafe { ((*functions).create)(text, material, new, error) };
        let instance = Refusal::or_instance(create)?;
        let mut of_material = pf_material_sizes::default();
        // SAFETY: a valid material (the caller's promise); a whole struct, as its `size` says.
        unsafe { ((*material.functions).sizes)(material.instance, &raw mut of_material) };
        let mut new = Self {
            functions,
            instance,
            sizes: pf_element_sizes::default(),
            of_material,
            material: *material,
        };
        // SAFETY: the instance that the table has just made; a whole struct, as its `size` says.
        let code = unsafe { ((*functions).sizes)(instance, &raw mut new.sizes) };
        if code != PF_OK {
            return Err(Refusal::Broken(format!("sizes returned {code}")));
        }
        Ok(new)
    }

    pub(crate) fn functions(&self) -> &pf_element_functions {
        // SAFETY: valid as long as the subject lives (`create`).
        unsafe { &*self.functions }
    }

    pub(crate) fn instance(&self) -> *const c_void {
        self.instance
    }

    pub(crate) fn material(&self) -> &pf_material {
        &self.material
    }

    pub(crate) fn has_patch_functions(&self) -> bool {
        let f = self.functions();
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
        // SAFETY: this table's instance, and a batch with the guarded buffers that plyflow.h asks of this call, of the lengths for its sizes.
        let code = unsafe { (self.functions().initialise)(self.instance, &raw const batch) };
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

    /// Initialise and one call of forces on a set, deformed by `strain`.
    pub(crate) fn once(
        &self,
        elements: &Elements,
        strain: f64,
        ask: Ask,
    ) -> (State, Masses, Answer) {
        let (mut state, masses) = self.initialise(elements);
        let x = elements.deformed(strain, 7);
        // The first call is at rest, as the solver makes it.
        let first = self.forces(&mut state, &elements.reference, Motion::default(), ask);
        let motion = Motion {
            from: Some(&elements.reference),
            spin: None,
        };
        let mut answer = self.forces(&mut state, &x, motion, ask);
        let mut breaches = masses.breaches.clone();
        breaches.add(first.breaches);
        breaches.add(std::mem::take(&mut answer.breaches));
        answer.breaches = breaches;
        (state, masses, answer)
    }

    /// Calls forces at `position` (`[nodes][3][lanes]`); histories advance.
    pub(crate) fn forces(
        &self,
        state: &mut State,
        position: &[f64],
        motion: Motion<'_>,
        ask: Ask,
    ) -> Answer {
        let lanes = state.lanes;
        let velocity: Vec<f64> = match motion.from {
            Some(from) => position
                .iter()
                .zip(from)
                .map(|(b, a)| (b - a) / DT)
                .collect(),
            None => vec![0.0; position.len()],
        };
        let spin: Vec<f64> = match motion.spin {
            Some(angle) => angle.iter().map(|a| a / DT).collect(),
            None => vec![0.0; position.len()],
        };
        let constants = state.constants.slice().to_vec();
        let mut buffers = self.buffers([position, &velocity, &spin], ask, Guarded::poisoned);
        let mut batch = self.forces_batch(state, &mut buffers, ask);
        batch.dt = if motion.from.is_some() { DT } else { 0.0 };
        // SAFETY: as in `initialise`, with the buffers of this call.
        let code = unsafe { (self.functions().forces)(self.instance, &raw const batch) };
        let mut b = Breaches::default();
        let call = "forces";
        b.status(call, code);
        b.unchanged(call, "position", &buffers.position, position);
        b.unchanged(call, "velocity", &buffers.velocity, &velocity);
        b.unchanged(call, "spin", &buffers.spin, &spin);
        b.unchanged(call, "constants", &state.constants, &constants);
        b.zones(call, "history", &state.history);
        b.zones(call, "material_history", &state.material_history);
        let outputs = buffers.outputs();
        for (name, buffer) in OUTPUTS.iter().zip(outputs) {
            b.output(call, name, buffer, lanes);
        }
        let [force, moment, energy, fields, step] = outputs.map(|o| o.slice().to_vec());
        Answer {
            force,
            moment,
            energy,
            fields,
            step,
            breaches: b,
        }
    }
}

impl Subject {
    /// Calls forces [`CALLS`] times on the same state with as little around the calls as can be, so that calls of
    /// several threads meet, through the `counter` of all; how many differ from the state and the answer that one thread got.
    pub(crate) fn hammer(
        &self,
        (state, position): (&State, &[f64]),
        ask: Ask,
        (after, want): &(State, Answer),
        counter: &Counter<'_>,
    ) -> usize {
        let still = vec![0.0; position.len()];
        let mut buffers = self.buffers([position, &still, &still], ask, Guarded::zeros);
        let mut now = state.clone();
        let batch = self.forces_batch(&mut now, &mut buffers, ask);
        (0..CALLS)
            .filter(|_| {
                let (to, from) = (&mut now.history, state.history.slice());
                to.slice_mut().copy_from_slice(from);
                let (to, from) = (&mut now.material_history, state.material_history.slice());
                to.slice_mut().copy_from_slice(from);
                // SAFETY: as in `forces`, with buffers of this thread's own.
                let call = || unsafe { (self.functions().forces)(self.instance, &raw const batch) };
                let code = counter.during(call);
                let gave = [
                    &want.force,
                    &want.moment,
                    &want.energy,
                    &want.fields,
                    &want.step,
                ];
                code != PF_OK
                    || !same(now.history.slice(), after.history.slice())
                    || !same(now.material_history.slice(), after.material_history.slice())
                    || !(buffers.outputs().iter().zip(gave))
                        .all(|(got, want)| same(got.slice(), want))
            })
            .count()
    }

    /// Buffers for a call of `forces` with position, velocity and spin (`[nodes][3][lanes]`); `output` makes those of a length
    /// that it writes.
    fn buffers(&self, inputs: [&[f64]; 3], ask: Ask, output: fn(usize) -> Guarded) -> Buffers {
        let [position, velocity, spin] = inputs.map(Guarded::of);
        let vectors = inputs[0].len();
        let lanes = vectors / (3 * self.nodes());
        let fields = self.sizes.fields as usize * lanes;
        Buffers {
            position,
            velocity,
            spin,
            force: output(vectors),
            moment: output(if self.rotates() { vectors } else { 0 }),
            energy: output(PF_ENERGIES * lanes),
            fields: output(if ask.fields { fields } else { 0 }),
            step: output(if ask.bound { lanes } else { 0 }),
        }
    }

    /// A batch with everything that `forces` gets to see.
    fn forces_batch(&self, state: &mut State, to: &mut Buffers, ask: Ask) -> pf_element_batch {
        let mut batch = self.batch(state.lanes, to.position.pointer(), state);
        batch.force = to.force.pointer();
        batch.energy = to.energy.pointer();
        if self.sees_velocity() {
            batch.velocity = to.velocity.pointer();
        }
        if self.rotates() {
            batch.spin = to.spin.pointer();
            batch.moment = to.moment.pointer();
        }
        if ask.fields {
            batch.fields = to.fields.pointer();
        }
        if ask.bound {
            batch.critical_step = to.step.pointer();
        }
        batch
    }
}
