//! What a model tells of itself: energies, critical step, fields, volume.

use super::batch::{batch_critical_step, cell_critical_steps, patch_rows};
use super::blocks::NODE_CHUNK;
use super::parts::{CellPlace, Model};
use crate::contact::ContactEnergy;
use crate::energy::{Ledger, SheetEnergy};
use crate::mesh::area_vector;
use crate::sheet::Batch;
use crate::vec3::{Vec3, add, dot, scale};
use crate::{LANES, MechanicsError};
use plyflow_abi::{PF_ENERGY_BENDING, PF_ENERGY_HOURGLASS, PF_ENERGY_MEMBRANE};
use rayon::prelude::*;
use std::sync::Arc;

impl Model {
    /// Largest share of the penalty force that contacts hand to their multipliers in a step, once
    /// [`Model::set_contact_stiffness`] has set it.
    pub fn contact_augmentation(&self) -> f64 {
        let rigid = self.contacts.rigid.iter().map(|c| c.augmentation);
        let sheets = self.contacts.sheets.iter().map(|c| c.augmentation);
        rigid.chain(sheets).fold(0.0, f64::max)
    }

    /// `[n]` positions with which it was built (m).
    pub fn start(&self) -> &Arc<[Vec3]> {
        &self.topology.start
    }

    /// `[cells][4]` what lies across each edge of a cell: a cell, [`crate::mesh::NONE`] at a rim, or one of
    /// [`crate::mirror::MIRRORED`].
    pub fn neighbours(&self) -> &[[u32; 4]] {
        &self.topology.neighbours
    }

    /// The ledger at the present step.
    pub fn energies(&self) -> Ledger {
        let mut l = self.state.ledger;
        l.kinetic = self.workspace.work.kinetic;
        l.contact = self.contacts.energy.stored;
        for batch in self.elements.blocks.iter().flat_map(|b| &b.batches) {
            l.membrane += batch.energy[PF_ENERGY_MEMBRANE];
            l.bending += batch.energy[PF_ENERGY_BENDING];
            l.hourglass += batch.energy[PF_ENERGY_HOURGLASS];
        }
        for batch in self.elements.patches.iter().flat_map(|b| &b.batches) {
            l.bending += batch.energy;
        }
        l
    }

    /// Energies by sheet at the present step.
    pub fn sheet_energies(&self) -> Vec<SheetEnergy> {
        let mut of = vec![SheetEnergy::default(); self.topology.sheets.len()];
        for batch in self.elements.blocks.iter().flat_map(|b| &b.batches) {
            let e = &mut of[batch.sheet as usize];
            e.membrane += batch.energy[PF_ENERGY_MEMBRANE];
            e.bending += batch.energy[PF_ENERGY_BENDING];
            e.hourglass += batch.energy[PF_ENERGY_HOURGLASS];
        }
        for batch in self.elements.patches.iter().flat_map(|b| &b.batches) {
            of[batch.sheet as usize].bending += batch.energy;
        }
        let spin = self.state.rotations.as_deref();
        let mut counted = vec![false; self.state.x.len()];
        for (sheet, e) in self.topology.sheets.iter().zip(&mut of) {
            for n in sheet.nodes.iter().map(|n| *n as usize) {
                if std::mem::replace(&mut counted[n], true) {
                    continue;
                }
                e.kinetic += 0.5 * self.topology.mass[n] * dot(self.state.v[n], self.state.v[n]);
                if let Some(r) = spin {
                    e.kinetic += 0.5 * r.inertia[n] * dot(r.spin[n], r.spin[n]);
                }
            }
        }
        of
    }

    /// By node of a sheet: sum of a quarter of the area vectors of its cells around it (m2).
    pub fn node_areas(&self, sheet: usize) -> Vec<Vec3> {
        let sheet = &self.topology.sheets[sheet];
        let mut areas = vec![[0.0; 3]; self.state.x.len()];
        for cell in &self.topology.cells[sheet.cell_range.0..sheet.cell_range.1] {
            let quarter = scale(area_vector(cell.map(|n| self.state.x[n as usize])), 0.25);
            for n in cell {
                areas[*n as usize] = add(areas[*n as usize], quarter);
            }
        }
        self.topology.mirroring.level(&mut areas);
        sheet.nodes.iter().map(|n| areas[*n as usize]).collect()
    }

    /// By contact: its name, and what it stores and has lost so far (J).
    pub fn interface_energies(&self) -> impl Iterator<Item = (&str, ContactEnergy)> {
        let rigid = self.contacts.rigid.iter().map(|c| c.name.as_str());
        let sheets = self.contacts.sheets.iter().map(|c| c.name.as_str());
        let selves = self.contacts.folds.iter().map(|c| c.name.as_str());
        rigid
            .chain(sheets)
            .chain(selves)
            .zip(self.contacts.interfaces.iter().copied())
    }

    /// The cell whose element allows the smallest step, and that step (s).
    pub fn weakest_cell(&self) -> Option<(usize, f64)> {
        let steps: Vec<Vec<f64>> = (self.elements.blocks.par_iter())
            .map(|block| {
                let of = |b: &Batch| {
                    cell_critical_steps(&self.topology.sheets[b.sheet as usize], b, &self.state.x)
                };
                block.batches.iter().flat_map(of).collect()
            })
            .collect();
        let at = |place: &CellPlace| {
            let block = &self.elements.blocks[place.block as usize];
            let before = &block.batches[..usize::from(place.batch)];
            let first: usize = before.iter().map(|b| b.count as usize).sum();
            steps[place.block as usize]
                .get(first + usize::from(place.lane))
                .copied()
        };
        self.topology
            .cell_place
            .iter()
            .map(|p| at(p).unwrap_or(0.0))
            .enumerate()
            .min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The step that the elements allow at the present positions (s), with mass scaling and bending.
    ///
    /// # Errors
    /// When a component fails, or an element of a model that has made steps gives none.
    pub fn critical_step(&self) -> Result<f64, MechanicsError> {
        let (sheets, x) = (&self.topology.sheets, &self.state.x);
        let steps: Vec<f64> = self
            .elements
            .blocks
            .par_iter()
            .flat_map_iter(|block| &block.batches)
            .map(|batch| batch_critical_step(&sheets[batch.sheet as usize], batch, x))
            .collect();
        let membrane = steps.into_iter().fold(f64::INFINITY, f64::min);
        if membrane <= 0.0 && self.state.cycle > 0 {
            self.check_steps()?;
        }
        let rows: Vec<Vec<(u32, f64)>> = self
            .elements
            .patches
            .par_iter()
            .flat_map_iter(|block| &block.batches)
            .map(|batch| patch_rows(&sheets[batch.sheet as usize], batch, x))
            .collect();
        let mut row = vec![0.0; self.state.x.len()];
        for (n, r) in rows.into_iter().flatten() {
            row[n as usize] += r;
        }
        self.topology.mirroring.fold(&mut row);
        let bending = row
            .iter()
            .zip(&self.topology.mass)
            .filter(|(r, _)| **r > 0.0)
            .map(|(r, m)| r / m)
            .fold(0.0, f64::max);
        // omega^2 of a sum of stiffnesses is at most the sum of their own bounds.
        let omega2 = (2.0 / membrane).powi(2) + bending;
        Ok(2.0 / omega2.sqrt())
    }

    /// Row `index` of the element fields of a sheet, per cell. Needs a step with `fields`.
    pub fn cell_field(&self, sheet: usize, index: usize) -> Vec<f64> {
        self.mixed_cell_field(sheet, index, Some(index))
    }

    /// The same of a sheet with two elements, in one of which ([`crate::sheet::Elsewhere`]) the field has another row, or none: then
    /// it is 0 there.
    pub fn mixed_cell_field(
        &self,
        sheet: usize,
        index: usize,
        elsewhere: Option<usize>,
    ) -> Vec<f64> {
        let (c0, c1) = self.topology.sheets[sheet].cell_range;
        let of = |at: &CellPlace| {
            let batch = &self.elements.blocks[at.block as usize].batches[usize::from(at.batch)];
            let row = if batch.elsewhere {
                elsewhere
            } else {
                Some(index)
            };
            row.map_or(0.0, |r| batch.fields[r * LANES + usize::from(at.lane)])
        };
        self.topology.cell_place[c0..c1].iter().map(of).collect()
    }

    /// Row `index` of the patch fields of a sheet, per mesh-local node (0 where there is no patch: at its edge and within
    /// [`crate::sheet::Elsewhere`]).
    pub fn patch_field(&self, sheet: usize, index: usize) -> Vec<f64> {
        let (b0, b1) = self.topology.sheets[sheet].patch_range;
        let mut values = vec![0.0; self.topology.sheets[sheet].nodes.len()];
        for b in self.elements.patches[b0..b1]
            .iter()
            .flat_map(|b| &b.batches)
        {
            for l in 0..b.count as usize {
                values[b.centres[l] as usize] = b.fields[index * LANES + l];
            }
        }
        values
    }

    /// Of a sheet with two elements: how many cells have its own one, and how many there are.
    pub fn bending_cells(&self, sheet: usize) -> Option<[usize; 2]> {
        let sheet = &self.topology.sheets[sheet];
        sheet.elsewhere.as_ref()?;
        let blocks = &self.elements.blocks[sheet.block_range.0..sheet.block_range.1];
        let batches = blocks.iter().flat_map(|b| &b.batches);
        let own = batches.filter(|b| !b.elsewhere).map(|b| b.count as usize);
        Some([own.sum(), sheet.cell_range.1 - sheet.cell_range.0])
    }

    /// Number of elements.
    pub fn element_count(&self) -> usize {
        self.topology.cells.len()
    }

    /// Number of node patches.
    pub fn patch_count(&self) -> usize {
        let batches = self.elements.patches.iter().flat_map(|b| &b.batches);
        batches.map(|b| b.count as usize).sum()
    }

    /// Volume (m3) under the cells that are pressed from below, over the plane z = 0: of a warped cell by its mean height, which is that under the
    /// bilinear surface (whose gradient the pressure is) to second order in the cell's size.
    pub fn volume_below(&mut self) -> f64 {
        // Partial sums of fixed chunks, added in order: the same for any number of threads.
        self.topology
            .cells
            .par_chunks(NODE_CHUNK)
            .zip_eq(self.topology.pressed_below.par_chunks(NODE_CHUNK))
            .map(|(cells, pressed)| {
                let mut volume = 0.0;
                for (cell, pressed) in cells.iter().zip(pressed) {
                    if *pressed {
                        let p = cell.map(|n| self.state.x[n as usize]);
                        let height = 0.25 * (p[0][2] + p[1][2] + p[2][2] + p[3][2]);
                        volume += area_vector(p)[2] * height;
                    }
                }
                volume
            })
            .collect_into_vec(&mut self.workspace.volumes);
        self.workspace.volumes.iter().sum()
    }
}
