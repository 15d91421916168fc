//! Nodes, sheets, contacts and loads; one central-difference step.

mod access;
mod advance;
mod archive;
mod batch;
mod blocks;
mod boundary;
mod build;
#[cfg(test)]
mod critical;
mod drive;
mod masses;
mod mirror;
mod parts;
mod planes;
mod query;
mod rotation;
mod shape;
mod spent;
mod stiffness;
mod support;
mod transpose;

pub use crate::sheet::Pressures;
pub use boundary::{Drive, Fixed, Held, Hold, NodalLoad};
pub use parts::{Model, StepSettings};
pub use shape::ASK_INTERVAL;
pub use spent::{Clock, Spent};

use crate::MechanicsError;
use crate::contact::{Bearing, ContactEnergy, FoldItem, Pace, Surface};
use crate::team;
use crate::vec3::{dot, norm, unit};
use batch::{Motion, Present, component_status};
use blocks::{NODE_CHUNK, run_blocks, run_patch_blocks};
use rayon::prelude::*;

/// What presses on sheets in a bag besides pressure (Pa), as films that are stretched over edges do: so much of their contacts' forces does not
/// grow with the pressure.
const ELSE_PRESSED: f64 = 1e4;

/// How often (steps) the nodes' normals and areas are computed.
const NORMAL_INTERVAL: u64 = 16;

impl Model {
    /// Internal forces, pressure and energies at the present positions, and beside them the forces that contacts have
    /// `computed` put on the nodes, by one thread. With `fields`, the elements' fields too.
    fn internal_forces(&mut self, fields: bool, computed: bool) -> Result<(), MechanicsError> {
        let present = Present {
            sheets: &self.topology.sheets,
            motion: Motion {
                x: &self.state.x,
                v: &self.state.v,
                spin: self.state.rotations.as_deref().map_or(&[], |r| &r.spin),
                dt: self.state.last_dt,
            },
            pressures: self.boundary.pressures,
            areas: self.state.cycle.is_multiple_of(NORMAL_INTERVAL),
            fields,
        };
        let scatter = || {
            if computed {
                self.contacts.scatter(&self.topology.cells);
            }
        };
        let elements = || {
            run_blocks(&mut self.elements.blocks, &mut self.elements.sums, present);
            run_patch_blocks(
                &mut self.elements.patches,
                &mut self.elements.patch_sums,
                present,
            );
        };
        // The first to come takes the first half of the blocks, whose nodes it also moves: they are in its cache.
        team::join(elements, scatter);
        self.topology
            .mirroring
            .hand_over(&mut self.elements.patch_sums.force);
        let failed = self.elements.blocks.iter().map(|b| b.failed);
        let failed = failed.chain(self.elements.patches.iter().map(|b| b.failed));
        match failed.flatten().next() {
            Some((code, sheet)) => {
                component_status(code, &self.topology.sheets[sheet as usize].name)
            }
            None => Ok(()),
        }
    }

    /// The nodes' normals and areas, in the steps in which the blocks have summed areas. Normals only tell the
    /// sides of contacts apart.
    fn compute_normals(&mut self) {
        let sums = &self.elements.sums;
        self.state
            .normals
            .par_chunks_mut(NODE_CHUNK)
            .enumerate()
            .with_min_len(team::least())
            .for_each(|(chunk, normals)| {
                normals.fill([0.0; 3]);
                sums.collect(&sums.area, chunk, normals);
                for normal in normals {
                    *normal = unit(*normal);
                }
            });
        self.topology
            .mirroring
            .level_normals(&mut self.state.normals);
    }

    /// Forces of all contacts: one piece of parallel work, at whose end alone threads wait for each
    /// other. With one such wait for each contact, a small bag's threads waited for a tenth of the time and more. Gives whether the forces
    /// are on the nodes already, as one thread puts them there while the contacts are in its cache.
    fn compute_contacts(&mut self) -> bool {
        let pace = self.pace();
        self.boundary.last_above = self.boundary.pressures.above;
        let surface = Surface {
            cells: &self.topology.cells,
            neighbours: &self.topology.neighbours,
            x: &self.state.x,
            normals: &self.state.normals,
        };
        let bearing = Bearing {
            mass: &self.topology.mass,
            room: &self.contacts.room,
            step: self.topology.settings.target_step,
        };
        let stride = self.state.max_speed * self.state.last_dt;
        let v = &self.state.v;
        let (n_rigid, n_sheets) = (self.contacts.rigid.len(), self.contacts.sheets.len());
        let n = n_rigid + n_sheets + self.contacts.folds.len();
        self.contacts
            .step_energies
            .resize_with(n, ContactEnergy::default);
        let (of_rigid, others) = self.contacts.step_energies.split_at_mut(n_rigid);
        let (of_sheets, of_folds) = others.split_at_mut(n_sheets);
        let alone = team::is_alone();
        if alone {
            let f = &mut self.contacts.force[..];
            for (c, energy) in self.contacts.rigid.iter_mut().zip(of_rigid) {
                *energy = c.compute_onto(&self.state.x, v, pace, f);
            }
            for (c, energy) in self.contacts.sheets.iter_mut().zip(of_sheets) {
                *energy = c.compute_onto(&surface, v, pace, f);
            }
            for (c, energy) in self.contacts.folds.iter_mut().zip(of_folds) {
                *energy = c.compute(&surface, v, pace, stride, bearing, Some(&mut *f));
            }
        } else {
            let rigid = || {
                let contacts = self.contacts.rigid.par_iter_mut().zip_eq(of_rigid);
                let contacts = contacts.with_max_len(1);
                contacts.for_each(|(c, energy)| *energy = c.compute(&self.state.x, v, pace));
            };
            let sheets = || {
                let contacts = self.contacts.sheets.par_iter_mut().zip_eq(of_sheets);
                let contacts = contacts.with_max_len(1);
                contacts.for_each(|(c, energy)| *energy = c.compute(&surface, v, pace));
            };
            let folds = || {
                let contacts = self.contacts.folds.par_iter_mut().zip_eq(of_folds);
                let contacts = contacts.with_max_len(1);
                contacts.for_each(|(c, energy)| {
                    *energy = c.compute(&surface, v, pace, stride, bearing, None);
                });
            };
            rayon::join(sheets, || rayon::join(rigid, folds));
        }
        self.count_contacts();
        alone
    }

    /// How fast bodies may come to each other. Both may move so, and speeds and accelerations may grow while a node sleeps. 5 m/s is more
    /// than a film picks up under 1 bar over the gaps for which a node sleeps more than a few steps; 10 km/s2 is what 1 bar does to
    /// 10 kg/m2.
    fn pace(&self) -> Pace {
        Pace {
            dt: self.state.dt,
            speed: 2.0 * (2.0 * self.state.max_speed).max(5.0),
            acceleration: 2.0 * (2.0 * self.state.max_acceleration).max(1e4),
            growth: self.growth(),
        }
    }

    /// The pressure on the stack over that of the last step, for [`Pace::growth`]: sheets in a bag press on each other in proportion to it. Both are
    /// taken by [`ELSE_PRESSED`] larger.
    fn growth(&self) -> f64 {
        (self.boundary.pressures.above + ELSE_PRESSED) / (self.boundary.last_above + ELSE_PRESSED)
    }

    /// Energies of the contacts, by contact and of all.
    fn count_contacts(&mut self) {
        for contact in &self.contacts.rigid {
            // What moves the surface does this work on the sheets.
            let (resultant, velocity) = (contact.resultant(), contact.motion.velocity);
            self.state.ledger.external += dot(resultant, velocity) * self.state.dt;
        }
        let n = self.contacts.step_energies.len();
        self.contacts
            .interfaces
            .resize_with(n, ContactEnergy::default);
        let mut total = ContactEnergy::default();
        for (i, e) in self
            .contacts
            .interfaces
            .iter_mut()
            .zip(&self.contacts.step_energies)
        {
            total.stored += e.stored;
            total.friction += e.friction;
            total.damping += e.damping;
            i.stored = e.stored;
            i.friction += e.friction;
            i.damping += e.damping;
            i.work += e.work;
        }
        self.state.ledger.friction += total.friction;
        self.state.ledger.damping += total.damping;
        self.contacts.energy = total;
    }

    /// One step that begins at `time` (s): the one way to set the clock. As [`Model::step`] otherwise.
    ///
    /// # Errors
    /// As [`Model::step`].
    pub fn step_from(&mut self, time: f64, fields: bool) -> Result<(), MechanicsError> {
        self.state.time = time;
        self.step(fields)
    }

    /// One step. With `fields`, the elements' fields at the positions before the step are kept for
    /// [`Model::cell_field`] and [`Model::patch_field`].
    ///
    /// # Errors
    /// When a component fails, a velocity is not finite, or an element is none any more ([`MechanicsError::Distorted`]), which is looked at
    /// with `fields` and every some steps.
    pub fn step(&mut self, fields: bool) -> Result<(), MechanicsError> {
        let mut sharing = std::mem::take(&mut self.workspace.sharing);
        let done = sharing.during(|| self.step_of_team(fields));
        self.workspace.sharing = sharing;
        done
    }

    /// The step, by as many threads as [`team::is_alone`] says.
    fn step_of_team(&mut self, fields: bool) -> Result<(), MechanicsError> {
        let clock = Clock::of_step(self.state.cycle);
        if self.state.cycle.is_multiple_of(NORMAL_INTERVAL) {
            // Contacts want the normals, and these what the elements sum.
            let part = clock.part();
            self.internal_forces(fields, false)?;
            part.add_to(&mut self.workspace.spent.elements);
            let part = clock.part();
            self.compute_normals();
            for contact in &mut self.contacts.rigid {
                contact.look_between(&self.contacts.sheets);
            }
            if !self.compute_contacts() {
                self.contacts.scatter(&self.topology.cells);
            }
            part.add_to(&mut self.workspace.spent.contacts);
        } else {
            let part = clock.part();
            let on_nodes = self.compute_contacts();
            part.add_to(&mut self.workspace.spent.contacts);
            let part = clock.part();
            self.internal_forces(fields, !on_nodes)?;
            part.add_to(&mut self.workspace.spent.elements);
        }
        let part = clock.part();
        self.advance();
        self.topology.mirroring.follow(&mut self.state.x);
        part.add_to(&mut self.workspace.spent.nodes);
        clock.add_to(&mut self.workspace.spent.all);
        let limit = self.speed_limit();
        if self.workspace.work.bad.is_some() || self.state.max_speed > limit {
            return Err(self.unstable(limit));
        }
        if fields || self.state.cycle.is_multiple_of(shape::LOOK) {
            self.check_shapes()?;
        }
        if self.state.cycle.is_multiple_of(ASK_INTERVAL) {
            self.check_steps()?;
        }
        Ok(())
    }

    /// A speed (m/s) at which a node crosses a cell in a few steps: no forming motion.
    fn speed_limit(&self) -> f64 {
        0.2 * self.topology.shortest_edge / self.state.dt
    }

    fn unstable(&self, limit: f64) -> MechanicsError {
        let worst = (0..self.state.v.len())
            .max_by(|a, b| norm(self.state.v[*a]).total_cmp(&norm(self.state.v[*b])))
            .unwrap_or(0);
        let node = self.workspace.work.bad.map_or(worst, |n| n as usize);
        let sheet = self
            .topology
            .sheets
            .iter()
            .find(|s| s.nodes.contains(&(node as u32)))
            .map_or("?", |s| s.name.as_str());
        let touching = self
            .contacts
            .sheets
            .iter()
            .filter(|c| c.items.iter().any(|i| i.node == node as u32 && i.active))
            .map(|c| c.name.as_str())
            .chain(self.contacts.folds.iter().filter_map(|c| {
                let touches = |i: &FoldItem| i.slave.node == node as u32 && i.slave.active;
                c.items.iter().any(touches).then_some(c.name.as_str())
            }))
            .chain(
                self.contacts
                    .rigid
                    .iter()
                    .filter(|c| {
                        c.items
                            .iter()
                            .any(|i| i.node == node as u32 && i.normal_force > 0.0)
                    })
                    .map(|c| c.name.as_str()),
            )
            .collect::<Vec<_>>()
            .join(", ");
        let x = self.state.x[node];
        MechanicsError::Unstable {
            time: self.state.time,
            cycle: self.state.cycle,
            what: format!(
                "node {node} of '{sheet}' at ({:.4}, {:.4}, {:.4}) m moves at {:.3e} m/s \
                 (limit {limit:.0} m/s); in contact: {}",
                x[0],
                x[1],
                x[2],
                norm(self.state.v[node]),
                if touching.is_empty() {
                    "nothing"
                } else {
                    &touching
                }
            ),
            cause: "a step above the critical one, an element turned inside out, or a sheet that \
                    passed through its neighbour"
                .into(),
            remedy: "a smaller time_step or step_safety, a longer process time, more damping"
                .into(),
        }
    }
}
