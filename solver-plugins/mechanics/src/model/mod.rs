//! Nodes, sheets, contacts and loads; one central-difference step.

mod batch;
mod build;
mod query;
mod rotation;
mod support;

use batch::*;
use rotation::Rotations;
use support::Supports;
pub use support::{Fixed, NodalLoad};

use crate::contact::{ContactEnergy, ContactSettings, RigidContact, SheetContact, Surface};
use crate::energy::Ledger;
use crate::mesh::{QuadMesh, area_vector};
use crate::sheet::*;
use crate::vec3::{V, add, dot, norm, scale, sub};
use crate::{LANES, MechanicsError};
use plyflow_abi::*;
use rayon::prelude::*;

/// How a node is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Held {
    /// Moves freely.
    Free,
    /// Follows the position given by [`Drive`].
    Driven,
}

/// Gives the positions of the driven nodes.
pub trait Drive: Send + Sync {
    /// Writes the position (m) at time `t` (s) of driven node `k`, in the order of
    /// [`Model::set_driven`].
    fn position(&self, k: usize, t: f64) -> V;

    /// Spin (rad/s, global axes) of driven node `k` at time `t` (s), for sheets whose nodes rotate;
    /// `None`: its rotation is free.
    fn spin(&self, _k: usize, _t: f64) -> Option<V> {
        None
    }
}

/// Constants of the time integration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepSettings {
    /// Wanted step (s): elements below it are mass-scaled to reach it.
    pub target_step: f64,
    /// Share of the estimated critical step that is used.
    pub safety: f64,
    /// Mass-proportional damping (1/s).
    pub damping: f64,
}

/// Pressures at the current time (Pa).
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Pressures {
    /// From below on cells pressed below.
    pub below: f64,
    /// From above on cells pressed above.
    pub above: f64,
}

/// A model. Per-node arrays are in the model's numbering.
pub struct Model {
    /// `[n]` positions (m).
    pub x: Vec<V>,
    /// `[n]` velocities at the half step (m/s).
    pub v: Vec<V>,
    /// `[n]` masses (kg).
    pub mass: Vec<f64>,
    /// `[n]` unit normals of the sheets.
    pub normals: Vec<V>,
    /// `[n]` sum of a quarter of the area vectors of the cells around (m2).
    pub area: Vec<V>,
    /// Sheets from the tool upwards.
    pub sheets: Vec<Sheet>,
    /// `[cells][4]` model nodes of all sheets' cells.
    pub cells: Vec<[u32; 4]>,
    neighbours: Vec<[u32; 4]>,
    /// Sheet on sheet.
    pub sheet_contacts: Vec<SheetContact>,
    /// Sheets on rigid surfaces.
    pub rigid_contacts: Vec<RigidContact>,
    /// Pressures, set before each step.
    pub pressures: Pressures,
    /// Time (s) of the positions.
    pub time: f64,
    /// Steps done.
    pub cycle: u64,
    /// Step (s).
    pub dt: f64,
    /// Accumulated losses and external work, and the stored energies of the last ledger.
    pub ledger: Ledger,
    settings: StepSettings,
    batches: Vec<Batch>,
    patches: Vec<PatchBatch>,
    pressed: Vec<[f64; 2]>,
    element_force: Aligned,
    element_energy: Aligned,
    cell_area: Aligned,
    cell_slot: Vec<u32>,
    node_slots: Csr,
    patch_slots: Csr,
    force: Vec<V>,
    /// Pressure, weight and nodal loads (N): what does external work on free nodes.
    external_force: Vec<V>,
    /// `[n]` masses without scaling (kg): what has weight.
    own_mass: Vec<f64>,
    rotations: Option<Box<Rotations>>,
    supports: Supports,
    /// Acceleration of free fall (m/s2), global axes.
    pub body_acceleration: V,
    /// What the nodal loads are multiplied by.
    pub load_factor: f64,
    loads: Vec<NodalLoad>,
    last_dt: f64,
    /// Shortest edge of a cell at the start (m).
    shortest_edge: f64,
    /// 1, or 1/2 in the first step from rest: velocities live at half steps.
    kick: f64,
    held: Vec<Held>,
    driven: Vec<u32>,
    drive: Option<Box<dyn Drive>>,
    max_speed: f64,
    contact: ContactEnergy,
    work: NodeWork,
}

#[derive(Default)]
struct Csr {
    start: Vec<u32>,
    entry: Vec<u32>,
}

impl Csr {
    fn build(n: usize, pairs: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut start = vec![0u32; n + 1];
        for (node, _) in pairs.clone() {
            start[node as usize + 1] += 1;
        }
        for i in 0..n {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut entry = vec![0u32; start[n] as usize];
        for (node, value) in pairs {
            entry[next[node as usize] as usize] = value;
            next[node as usize] += 1;
        }
        Self { start, entry }
    }

    #[inline(always)]
    fn of(&self, node: usize) -> &[u32] {
        &self.entry[self.start[node] as usize..self.start[node + 1] as usize]
    }
}

/// Sums over nodes of one step (J), and the largest speed (m/s).
#[derive(Debug, Clone, Copy, Default)]
struct NodeWork {
    kinetic: f64,
    external: f64,
    damping: f64,
    speed: f64,
    bad: Option<u32>,
}

impl NodeWork {
    fn add(mut self, o: Self) -> Self {
        self.kinetic += o.kinetic;
        self.external += o.external;
        self.damping += o.damping;
        self.speed = self.speed.max(o.speed);
        self.bad = self.bad.or(o.bad);
        self
    }
}

const NODE_CHUNK: usize = 1024;

/// How often (steps) the nodes' normals and areas are computed.
const NORMAL_INTERVAL: u64 = 16;

impl Model {
    /// Internal forces, energies and cell areas at the present positions. With `fields`, the elements'
    /// fields too.
    fn internal_forces(&mut self, fields: bool) -> Result<(), MechanicsError> {
        let sheets = &self.sheets;
        let motion = Motion {
            x: &self.x,
            v: &self.v,
            spin: self.rotations.as_deref().map_or(&[], |r| &r.spin),
            dt: self.last_dt,
        };
        let (pressed, all) = (&self.pressed, self.cycle.is_multiple_of(NORMAL_INTERVAL));
        self.element_force
            .par_chunks_exact_mut(12 * LANES)
            .zip_eq(
                self.element_energy
                    .par_chunks_exact_mut(PF_ENERGIES * LANES),
            )
            .zip_eq(self.cell_area.par_chunks_exact_mut(AREA_ROWS * LANES))
            .zip_eq(self.batches.par_iter_mut())
            .enumerate()
            .with_min_len(8)
            .for_each(|(b, (((force, energy), area), batch))| {
                let sheet = &sheets[batch.sheet as usize];
                let slots = &pressed[b * LANES..(b + 1) * LANES];
                let area = (all || slots.iter().any(|w| *w != [0.0; 2])).then_some(area);
                let out = Output {
                    force,
                    energy,
                    area,
                };
                run_batch(sheet, batch, motion, out, fields);
            });
        let (x, dt) = (motion.x, motion.dt);
        self.patches
            .par_iter_mut()
            .with_min_len(8)
            .for_each(|batch| {
                let sheet = &sheets[batch.sheet as usize];
                run_patch(sheet, batch, x, dt, fields);
            });
        let failed = self
            .batches
            .iter()
            .map(|b| (b.status, b.sheet))
            .chain(self.patches.iter().map(|b| (b.status, b.sheet)))
            .find(|(s, _)| *s != PF_OK);
        match failed {
            Some((code, sheet)) => component_status(code, &self.sheets[sheet as usize].name),
            None => Ok(()),
        }
    }

    /// Sums element forces and pressure at the nodes, and the nodes' normals.
    fn assemble(&mut self) {
        // Normals only tell the sides of contacts apart.
        let with_normals = self.cycle.is_multiple_of(NORMAL_INTERVAL);
        let (p, slots, patch_slots) = (self.pressures, &self.node_slots, &self.patch_slots);
        let (element_force, cell_area, pressed) =
            (&*self.element_force, &*self.cell_area, &self.pressed);
        let patches = &self.patches;
        let (weight, own_mass) = (self.body_acceleration, &self.own_mass);
        self.force
            .par_chunks_mut(NODE_CHUNK)
            .zip_eq(self.external_force.par_chunks_mut(NODE_CHUNK))
            .zip_eq(self.area.par_chunks_mut(NODE_CHUNK))
            .zip_eq(self.normals.par_chunks_mut(NODE_CHUNK))
            .enumerate()
            .for_each(|(chunk, (((force, pressure), area), normal))| {
                for i in 0..force.len() {
                    let node = chunk * NODE_CHUNK + i;
                    let (mut f, mut q, mut a) = ([0.0; 3], [0.0; 3], [0.0; 3]);
                    for entry in slots.of(node) {
                        let (slot, k) = ((entry / 4) as usize, (entry % 4) as usize);
                        let (b, l) = (slot / LANES, slot % LANES);
                        let at = b * 12 * LANES + k * 3 * LANES + l;
                        let pa = b * AREA_ROWS * LANES + l;
                        let w = pressed[slot];
                        let load = w[0] * p.below - w[1] * p.above;
                        let (sx, sy) = SIGNS[k];
                        for c in 0..3 {
                            f[c] -= element_force[at + c * LANES];
                        }
                        if load != 0.0 || with_normals {
                            for c in 0..3 {
                                let row = |r: usize| cell_area[pa + (3 * r + c) * LANES];
                                a[c] += row(0);
                                q[c] += load * (row(0) + sx * row(1) + sy * row(2));
                            }
                        }
                    }
                    for entry in patch_slots.of(node) {
                        let (slot, k) = ((entry >> 5) as usize, (entry & 31) as usize);
                        let batch = &patches[slot / LANES];
                        let at = k * 3 * LANES + slot % LANES;
                        for c in 0..3 {
                            f[c] -= batch.force[at + c * LANES];
                        }
                    }
                    q = add(q, scale(weight, own_mass[node]));
                    force[i] = add(f, q);
                    pressure[i] = q;
                    if with_normals {
                        area[i] = a;
                        normal[i] = crate::vec3::unit(a);
                    }
                }
            });
        self.apply_loads();
        self.assemble_moments();
    }

    /// Forces of all contacts, added to the nodal forces.
    fn contacts(&mut self) {
        // Speeds may grow while a node sleeps: 5 m/s is more than a film picks up under 1 bar over the
        // gaps for which a node sleeps more than a few steps.
        let reach = 2.0 * (2.0 * self.max_speed).max(5.0) * self.dt;
        let mut total = ContactEnergy::default();
        let mut count = |e: ContactEnergy| {
            total.stored += e.stored;
            total.friction += e.friction;
            total.damping += e.damping;
        };
        for contact in &mut self.rigid_contacts {
            count(contact.compute(&self.x, &self.v, self.dt, reach));
            let velocity = contact.motion.velocity;
            for item in contact.items.iter().filter(|i| i.normal_force > 0.0) {
                let n = item.node as usize;
                self.force[n] = add(self.force[n], item.force);
                // What moves the surface does this work on the sheets.
                self.ledger.external += dot(item.force, velocity) * self.dt;
            }
        }
        let surface = Surface {
            cells: &self.cells,
            neighbours: &self.neighbours,
            x: &self.x,
            normals: &self.normals,
        };
        for contact in &mut self.sheet_contacts {
            count(contact.compute(&surface, &self.v, self.dt, reach));
            contact.scatter(&self.cells, &mut self.force);
        }
        self.ledger.friction += total.friction;
        self.ledger.damping += total.damping;
        self.contact = total;
    }

    /// Velocities and positions of the next step; works of the step.
    fn integrate(&mut self) {
        let (dt, alpha, time, kick) = (self.dt, self.settings.damping, self.time, self.kick);
        let targets: Vec<V> = match &self.drive {
            Some(drive) => (0..self.driven.len())
                .map(|k| drive.position(k, time + dt))
                .collect(),
            None => Vec::new(),
        };
        for (k, (n, target)) in self.driven.iter().zip(targets).enumerate() {
            let n = *n as usize;
            let next = scale(sub(target, self.x[n]), 1.0 / dt);
            // What holds the node makes up for the forces on it: its work is external.
            let mean = scale(add(next, self.v[n]), 0.5);
            let inertia = scale(sub(next, self.v[n]), self.mass[n] / dt);
            let held = sub(inertia, sub(self.force[n], self.external_force[n]));
            self.ledger.external += dot(held, mean) * dt;
            self.supports.reaction[k] = sub(inertia, self.force[n]);
            self.x[n] = target;
            self.v[n] = next;
        }
        let (lo, hi) = (1.0 / dt - 0.5 * alpha, 1.0 / (1.0 / dt + 0.5 * alpha));
        let (force, pressure, mass, held) =
            (&self.force, &self.external_force, &self.mass, &self.held);
        let fixed = &self.supports.fixed;
        let parts: Vec<NodeWork> = self
            .x
            .par_chunks_mut(NODE_CHUNK)
            .zip_eq(self.v.par_chunks_mut(NODE_CHUNK))
            .enumerate()
            .map(|(chunk, (xs, vs))| {
                let mut work = NodeWork::default();
                for i in 0..xs.len() {
                    let n = chunk * NODE_CHUNK + i;
                    if held[n] == Held::Free {
                        let old = vs[i];
                        let mut v = [0.0; 3];
                        for c in 0..3 {
                            v[c] = (lo * old[c] + kick * force[n][c] / mass[n]) * hi;
                        }
                        if let Some(f) = fixed.get(n) {
                            v = f.translation(v);
                        }
                        xs[i] = add(xs[i], scale(v, dt));
                        let mean = scale(add(v, old), 0.5);
                        work.external += dot(pressure[n], mean) * dt;
                        work.damping += alpha * mass[n] * dot(mean, mean) * dt;
                        vs[i] = v;
                    }
                    let v2 = dot(vs[i], vs[i]);
                    work.kinetic += 0.5 * mass[n] * v2;
                    work.speed = work.speed.max(v2);
                    if !v2.is_finite() {
                        work.bad = work.bad.or(Some(n as u32));
                    }
                }
                work
            })
            .collect();
        self.work = parts.into_iter().fold(NodeWork::default(), NodeWork::add);
        self.rotate();
        self.max_speed = self.work.speed.sqrt();
        self.ledger.external += self.work.external;
        self.ledger.damping += self.work.damping;
        self.time += dt;
        self.last_dt = dt;
        self.kick = 1.0;
        self.cycle += 1;
    }

    /// One step. With `fields`, the elements' fields at the positions before the step are kept for
    /// [`Model::cell_field`] and [`Model::patch_field`].
    ///
    /// # Errors
    /// When a component fails or a velocity is not finite.
    pub fn step(&mut self, fields: bool) -> Result<(), MechanicsError> {
        self.internal_forces(fields)?;
        self.assemble();
        self.contacts();
        self.integrate();
        let limit = self.speed_limit();
        if self.work.bad.is_some() || self.max_speed > limit {
            return Err(self.unstable(limit));
        }
        Ok(())
    }

    /// A speed (m/s) at which a node crosses a cell in a few steps: no forming motion.
    fn speed_limit(&self) -> f64 {
        0.2 * self.shortest_edge / self.dt
    }

    fn unstable(&self, limit: f64) -> MechanicsError {
        let worst = (0..self.v.len())
            .max_by(|a, b| norm(self.v[*a]).total_cmp(&norm(self.v[*b])))
            .unwrap_or(0);
        let node = self.work.bad.map_or(worst, |n| n as usize);
        let sheet = self
            .sheets
            .iter()
            .find(|s| s.nodes.contains(&(node as u32)))
            .map_or("?", |s| s.name.as_str());
        let touching = self
            .sheet_contacts
            .iter()
            .filter(|c| c.items.iter().any(|i| i.node == node as u32 && i.active))
            .map(|c| c.name.as_str())
            .chain(
                self.rigid_contacts
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
        let x = self.x[node];
        MechanicsError::Unstable {
            time: self.time,
            cycle: self.cycle,
            what: format!(
                "node {node} of '{sheet}' at ({:.4}, {:.4}, {:.4}) m moves at {:.3e} m/s \
                 (limit {limit:.0} m/s); in contact: {}",
                x[0],
                x[1],
                x[2],
                norm(self.v[node]),
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
