//! Constants of the elements at the start, and what they weigh on the nodes.

use super::batch::{Rates, component_status};
use super::parts::{Model, State, Topology};
use super::transpose::gather;
use crate::component::ElementInstance;
use crate::sheet::{Aligned, Batch, Kind, Shared, Sheet, empty_element_batch};
use crate::vec3::Vec3;
use crate::{LANES, MechanicsError};
use plyflow_abi::*;

/// What elements say of themselves at the start, and what they need for it: one batch after the other.
struct Found {
    /// `[3][LANES]`
    axis: Aligned,
    position: Aligned,
    rates: Rates,
    force: Aligned,
    moment: Aligned,
    energy: Aligned,
    /// `[LANES]` critical steps (s).
    step: Aligned,
    /// `[4][LANES]` masses (kg) and inertias (kg m2).
    mass: Aligned,
    inertia: Aligned,
}

impl Found {
    fn new() -> Self {
        Self {
            axis: Aligned::zeros(3 * LANES),
            position: Aligned::zeros(12 * LANES),
            rates: Rates::zero(),
            force: Aligned::zeros(12 * LANES),
            moment: Aligned::zeros(12 * LANES),
            energy: Aligned::zeros(PF_ENERGIES * LANES),
            step: Aligned::zeros(LANES),
            mass: Aligned::zeros(4 * LANES),
            inertia: Aligned::zeros(4 * LANES),
        }
    }

    /// Initialises the elements of a batch, whose nodes are at `x` (m), and asks them for their critical steps. Gives their constants.
    /// `axis`: direction of e1 by lane.
    fn ask(
        &mut self,
        element: &ElementInstance,
        batch: &mut Batch,
        x: &[Vec3],
        axis: impl Fn(usize) -> Vec3,
        sheet: &str,
    ) -> Result<Aligned, MechanicsError> {
        for l in 0..LANES {
            let e1 = axis(l);
            for k in 0..3 {
                self.axis[k * LANES + l] = e1[k];
            }
        }
        gather(&batch.nodes, x, &mut self.position);
        let mut constants = Aligned::zeros(element.sizes.constants * LANES);
        let mut raw = empty_element_batch(element, 0.0, &self.position);
        raw.axis = self.axis.as_ptr();
        raw.constants = constants.as_mut_ptr();
        raw.history = batch.history.as_mut_ptr();
        raw.material_history = batch.material_history.as_mut_ptr();
        self.mass.fill(0.0);
        self.inertia.fill(0.0);
        raw.mass = self.mass.as_mut_ptr();
        if element.rotates() {
            raw.inertia = self.inertia.as_mut_ptr();
        }
        // SAFETY: arrays of `self` for 4 nodes and `LANES` lanes, and the batch's own, which were made for this element's sizes; all are
        // aligned, and borrowed by nobody else until the next call has ended.
        let code = unsafe { element.initialise(&raw) };
        component_status(code, sheet)?;
        raw.axis = std::ptr::null();
        raw.mass = std::ptr::null_mut();
        raw.inertia = std::ptr::null_mut();
        if element.rotates() {
            self.rates.attach(&mut raw);
            raw.moment = self.moment.as_mut_ptr();
        }
        raw.force = self.force.as_mut_ptr();
        raw.energy = self.energy.as_mut_ptr();
        raw.critical_step = self.step.as_mut_ptr();
        // SAFETY: as above, with the arrays of this call.
        let code = unsafe { element.forces(&raw) };
        component_status(code, sheet)?;
        Ok(constants)
    }

    /// Puts the masses of a batch on the nodes, scaled for the wanted step and so that each element has `least` times its areal mass.
    /// Adds to `added_mass` what the scaling adds (kg).
    fn add_to(
        &self,
        topology: &mut Topology,
        state: &mut State,
        sheet: &Sheet,
        batch: &mut Batch,
        least: impl Fn(usize) -> f64,
        added_mass: &mut f64,
    ) -> Result<(), MechanicsError> {
        let rotates = sheet.element_of(batch).rotates();
        let layers = |l: usize| batch.layers.get(l).copied().unwrap_or(1.0);
        let mut factors = [1.0; LANES];
        for l in 0..batch.count as usize {
            let critical = self.step[l] * topology.settings.safety;
            if !(critical > 0.0 && critical.is_finite()) {
                return Err(MechanicsError::Input(format!(
                    "sheet '{}': an element has a critical step of {} s; its mesh or \
                     material makes no sense",
                    sheet.name, self.step[l]
                )));
            }
            let factor = (topology.settings.target_step / critical)
                .powi(2)
                .max(least(l))
                .max(1.0);
            factors[l] = factor;
            for k in 0..4 {
                let own = self.mass[k * LANES + l] * layers(l);
                let node = batch.nodes[k][l] as usize;
                topology.mass[node] += own * factor;
                topology.own_mass[node] += own;
                if let Some(r) = state.rotations.as_deref_mut()
                    && rotates
                {
                    r.inertia[node] += self.inertia[k * LANES + l] * layers(l) * factor;
                }
                *added_mass += own * (factor - 1.0);
            }
        }
        if factors != [1.0; LANES] {
            batch.mass_factor = factors.to_vec();
        }
        Ok(())
    }
}

impl Model {
    /// Constants and masses of a sheet, with mass scaling to the wanted step and areal mass. `axis`: direction of e1 by mesh-local cell.
    pub(super) fn initialise(
        &mut self,
        sheet: &mut Sheet,
        axis: impl Fn(u32) -> Vec3,
        orders: &[(Kind, Vec<u32>)],
        least: &[f64],
        areal_mass: f64,
    ) -> Result<(), MechanicsError> {
        let mut found = Found::new();
        let blocks = &mut self.elements.blocks[sheet.block_range.0..sheet.block_range.1];
        let batches = blocks.iter_mut().flat_map(|b| &mut b.batches);
        let mut shared = Shared::default();
        let cells = orders.iter().flat_map(|(_, order)| order.chunks(LANES));
        let mut added_mass = 0.0;
        for (batch, cells) in batches.zip(cells) {
            let element = sheet.element_of(batch);
            // Lanes beyond the last element repeat it.
            let axis = |l: usize| axis(cells[l.min(cells.len() - 1)]);
            let constants = found.ask(element, batch, &self.state.x, axis, &sheet.name)?;
            batch.constants = shared.keep(constants);
            let least = |l: usize| least[cells[l] as usize] / areal_mass;
            let (topology, state) = (&mut self.topology, &mut self.state);
            found.add_to(topology, state, sheet, batch, least, &mut added_mass)?;
        }
        sheet.added_mass = added_mass;
        Ok(())
    }
}
