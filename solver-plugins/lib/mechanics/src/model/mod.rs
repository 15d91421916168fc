//! Nodes, sheets, contacts and loads; one central-difference step.

mod advance;
mod archive;
mod batch;
mod blocks;
mod build;
mod drive;
mod hold;
mod mirror;
mod query;
mod rotation;
mod shape;
mod spent;
mod stiffness;
mod support;
mod transpose;

use batch::*;
pub(crate) use blocks::compact_order;
use blocks::*;
use hold::Anchors;
pub use hold::Hold;
use mirror::Mirroring;
use rotation::Rotations;
pub use shape::ASK_INTERVAL;
pub use spent::{Clock, Spent};
pub use support::{Fixed, NodalLoad};
use support::{Loads, Supports};
use transpose::gather;

use crate::contact::*;
use crate::energy::Ledger;
use crate::mesh::{QuadMesh, area_vector};
use crate::sheet::*;
use crate::team::{self, Sharing};
use crate::vec3::{V, add, dot, norm, scale, sub};
use crate::{LANES, MechanicsError};
use plyflow_abi::*;
use rayon::prelude::*;
use std::sync::Arc;

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

    /// How driven node `k` is held at time `t` (s), if it may go off its position along its sheet; `None`: it may not.
    fn hold(&self, _k: usize, _t: f64) -> Option<Hold> {
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
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
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
    /// `[n]` positions with which it was built (m); shared, so that what needs them keeps no copy of its own.
    start: Arc<[V]>,
    /// `[n]` unit normals of the sheets.
    pub normals: Vec<V>,
    /// Sheets from the tool upwards.
    pub sheets: Vec<Sheet>,
    /// `[cells][4]` model nodes of all sheets' cells.
    pub cells: Vec<[u32; 4]>,
    neighbours: Vec<[u32; 4]>,
    /// Sheet on sheet.
    pub sheet_contacts: Vec<SheetContact>,
    /// Sheets on themselves; added by [`Model::add_self_contact`].
    pub self_contacts: Vec<SelfContact>,
    /// Sheets on rigid surfaces.
    pub rigid_contacts: Vec<RigidContact>,
    /// Pressures, set before each step.
    pub pressures: Pressures,
    /// The pressure above (Pa) in the last step.
    last_above: f64,
    /// Time (s) of the positions.
    pub time: f64,
    /// Steps done.
    pub cycle: u64,
    /// Step (s).
    pub dt: f64,
    /// Accumulated losses and external work, and the stored energies of the last ledger.
    pub ledger: Ledger,
    /// Where the time goes.
    pub spent: Spent,
    settings: StepSettings,
    blocks: Vec<Block<Batch>>,
    patches: Vec<Block<PatchBatch>>,
    /// `[cells]` whether the cavity presses from below.
    pressed_below: Vec<bool>,
    /// `[cells]` where their elements are.
    cell_place: Vec<CellPlace>,
    sums: Sums,
    patch_sums: Sums,
    /// `[n]` masses (kg), 0 for driven nodes; empty when none is.
    free_mass: Vec<f64>,
    /// `[n]` forces on the nodes in the last step (N).
    force: Vec<V>,
    /// `[n]` pressure, weight and nodal loads (N): what does external work on free nodes. Empty when nothing acts.
    external_force: Vec<V>,
    /// `[n]` forces of the contacts (N); zero between steps.
    contact_force: Vec<V>,
    /// `[n]` masses without scaling (kg): what has weight.
    own_mass: Vec<f64>,
    rotations: Option<Box<Rotations>>,
    mirroring: Mirroring,
    supports: Supports,
    /// Acceleration of free fall (m/s2), global axes.
    pub body_acceleration: V,
    /// What the nodal loads are multiplied by.
    pub load_factor: f64,
    loads: Loads,
    last_dt: f64,
    /// Shortest edge of a cell at the start (m).
    shortest_edge: f64,
    /// `[n]` stiffness that self-contacts may add to a node (N/m); empty without them.
    contact_room: Vec<f64>,
    /// 1, or 1/2 in the first step from rest: velocities live at half steps.
    kick: f64,
    held: Vec<Held>,
    driven: Vec<u32>,
    drive: Option<Box<dyn Drive>>,
    anchors: Anchors,
    max_speed: f64,
    /// Largest acceleration in the last step (m/s2).
    max_acceleration: f64,
    contact: ContactEnergy,
    /// By contact, rigid ones, sheets on sheets, sheets on themselves: stored at present, lost so far (J).
    interfaces: Vec<ContactEnergy>,
    /// The same: stored at present, lost in the last step (J).
    step_energies: Vec<ContactEnergy>,
    work: NodeWork,
    scratch: Scratch,
    sharing: Sharing,
}

/// Kept from step to step only for their room: a step allocates nothing.
#[derive(Default)]
struct Scratch {
    /// By chunk of nodes.
    works: Vec<NodeWork>,
    /// By driven node: position and velocity before the step.
    before: Vec<(V, V)>,
    /// By driven node: spin before the step.
    spins: Vec<V>,
    /// Parts of a volume (m3).
    volumes: Vec<f64>,
}

/// Where the element of a cell is.
#[derive(Debug, Clone, Copy, Default)]
struct CellPlace {
    block: u32,
    batch: u16,
    lane: u16,
}

/// Sums over nodes of one step (J), and the largest speed and change of speed.
#[derive(Debug, Clone, Copy, Default)]
struct NodeWork {
    kinetic: f64,
    external: f64,
    damping: f64,
    /// Squared (m2/s2).
    speed: f64,
    /// Squared (m2/s2).
    change: f64,
    bad: Option<u32>,
}

/// Adds the forces of all contacts to `force` (N), one after the other.
fn scatter_contacts(
    rigid: &[RigidContact],
    sheets: &[SheetContact],
    folds: &[SelfContact],
    cells: &[[u32; 4]],
    force: &mut [V],
) {
    for contact in rigid {
        contact.scatter(force);
    }
    for contact in sheets {
        contact.scatter(cells, force);
    }
    for contact in folds {
        contact.scatter(cells, force);
    }
}

impl NodeWork {
    /// Counts a node of mass or rotary inertia `m` with its new velocity or spin.
    #[inline(always)]
    fn count(&mut self, m: f64, node: usize, v: V) {
        let v2 = dot(v, v);
        self.kinetic += 0.5 * m * v2;
        if !v2.is_finite() {
            self.bad = self.bad.or(Some(node as u32));
        }
    }

    fn add(mut self, o: Self) -> Self {
        self.kinetic += o.kinetic;
        self.external += o.external;
        self.damping += o.damping;
        self.speed = self.speed.max(o.speed);
        self.change = self.change.max(o.change);
        self.bad = self.bad.or(o.bad);
        self
    }
}

/// Nodes that are moved together.
const NODE_CHUNK: usize = 256;

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
            sheets: &self.sheets,
            motion: Motion {
                x: &self.x,
                v: &self.v,
                spin: self.rotations.as_deref().map_or(&[], |r| &r.spin),
                dt: self.last_dt,
            },
            pressures: self.pressures,
            areas: self.cycle.is_multiple_of(NORMAL_INTERVAL),
            fields,
        };
        let scatter = || {
            if computed {
                let (rigid, sheets) = (&self.rigid_contacts, &self.sheet_contacts);
                let folds = &self.self_contacts;
                scatter_contacts(rigid, sheets, folds, &self.cells, &mut self.contact_force);
            }
        };
        let elements = || {
            run_blocks(&mut self.blocks, &mut self.sums, present);
            run_patch_blocks(&mut self.patches, &mut self.patch_sums, present);
        };
        // The first to come takes the first half of the blocks, whose nodes it also moves: they are in its cache.
        team::join(elements, scatter);
        self.mirroring.hand_over(&mut self.patch_sums.force);
        let failed = self.blocks.iter().map(|b| b.failed);
        let failed = failed.chain(self.patches.iter().map(|b| b.failed));
        match failed.flatten().next() {
            Some((code, sheet)) => component_status(code, &self.sheets[sheet as usize].name),
            None => Ok(()),
        }
    }

    /// The nodes' normals and areas, in the steps in which the blocks have summed areas. Normals only tell the
    /// sides of contacts apart.
    fn normals(&mut self) {
        let sums = &self.sums;
        self.normals
            .par_chunks_mut(NODE_CHUNK)
            .enumerate()
            .with_min_len(team::least())
            .for_each(|(chunk, normals)| {
                normals.fill([0.0; 3]);
                sums.collect(&sums.area, chunk, normals);
                for normal in normals {
                    *normal = crate::vec3::unit(*normal);
                }
            });
        self.mirroring.level_normals(&mut self.normals);
    }

    /// Forces of all contacts: one piece of parallel work, at whose end alone threads wait for each
    /// other. With one such wait for each contact, a small bag's threads waited for a tenth of the time and more. Gives whether the forces
    /// are on the nodes already, as one thread puts them there while the contacts are in its cache.
    fn compute_contacts(&mut self) -> bool {
        // Both bodies may move so, and speeds and accelerations may grow while a node sleeps. 5 m/s is more than a film
        // picks up under 1 bar over the gaps for which a node sleeps more than a few steps; 10 km/s2 is what 1 bar
        // does to 10 kg/m2.
        let pace = Pace {
            dt: self.dt,
            speed: 2.0 * (2.0 * self.max_speed).max(5.0),
            acceleration: 2.0 * (2.0 * self.max_acceleration).max(1e4),
            growth: self.growth(),
        };
        self.last_above = self.pressures.above;
        let surface = Surface {
            cells: &self.cells,
            neighbours: &self.neighbours,
            x: &self.x,
            normals: &self.normals,
        };
        let bearing = Bearing {
            mass: &self.mass,
            room: &self.contact_room,
            step: self.settings.target_step,
        };
        let stride = self.max_speed * self.last_dt;
        let v = &self.v;
        let (n_rigid, n_sheets) = (self.rigid_contacts.len(), self.sheet_contacts.len());
        let n = n_rigid + n_sheets + self.self_contacts.len();
        self.step_energies.resize_with(n, ContactEnergy::default);
        let (of_rigid, others) = self.step_energies.split_at_mut(n_rigid);
        let (of_sheets, of_folds) = others.split_at_mut(n_sheets);
        let alone = team::is_alone();
        if alone {
            let f = &mut self.contact_force[..];
            for (c, energy) in self.rigid_contacts.iter_mut().zip(of_rigid) {
                *energy = c.compute_onto(&self.x, v, pace, f);
            }
            for (c, energy) in self.sheet_contacts.iter_mut().zip(of_sheets) {
                *energy = c.compute_onto(&surface, v, pace, f);
            }
            for (c, energy) in self.self_contacts.iter_mut().zip(of_folds) {
                *energy = c.compute(&surface, v, pace, stride, bearing, Some(&mut *f));
            }
        } else {
            let rigid = || {
                let contacts = self.rigid_contacts.par_iter_mut().zip_eq(of_rigid);
                let contacts = contacts.with_max_len(1);
                contacts.for_each(|(c, energy)| *energy = c.compute(&self.x, v, pace));
            };
            let sheets = || {
                let contacts = self.sheet_contacts.par_iter_mut().zip_eq(of_sheets);
                let contacts = contacts.with_max_len(1);
                contacts.for_each(|(c, energy)| *energy = c.compute(&surface, v, pace));
            };
            let folds = || {
                let contacts = self.self_contacts.par_iter_mut().zip_eq(of_folds);
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

    /// The pressure on the stack over that of the last step, for [`Pace::growth`]: sheets in a bag press on each other in proportion to it. Both are
    /// taken by [`ELSE_PRESSED`] larger.
    fn growth(&self) -> f64 {
        (self.pressures.above + ELSE_PRESSED) / (self.last_above + ELSE_PRESSED)
    }

    /// Energies of the contacts, by contact and of all.
    fn count_contacts(&mut self) {
        for contact in &self.rigid_contacts {
            // What moves the surface does this work on the sheets.
            let (resultant, velocity) = (contact.resultant(), contact.motion.velocity);
            self.ledger.external += dot(resultant, velocity) * self.dt;
        }
        let n = self.step_energies.len();
        self.interfaces.resize_with(n, ContactEnergy::default);
        let mut total = ContactEnergy::default();
        for (i, e) in self.interfaces.iter_mut().zip(&self.step_energies) {
            total.stored += e.stored;
            total.friction += e.friction;
            total.damping += e.damping;
            i.stored = e.stored;
            i.friction += e.friction;
            i.damping += e.damping;
        }
        self.ledger.friction += total.friction;
        self.ledger.damping += total.damping;
        self.contact = total;
    }

    /// One step. With `fields`, the elements' fields at the positions before the step are kept for
    /// [`Model::cell_field`] and [`Model::patch_field`].
    ///
    /// # Errors
    /// When a component fails, a velocity is not finite, or an element is none any more ([`MechanicsError::Distorted`]), which is looked at
    /// with `fields` and every some steps.
    pub fn step(&mut self, fields: bool) -> Result<(), MechanicsError> {
        let mut sharing = std::mem::take(&mut self.sharing);
        let done = sharing.during(|| self.step_of_team(fields));
        self.sharing = sharing;
        done
    }

    /// The step, by as many threads as [`team::is_alone`] says.
    fn step_of_team(&mut self, fields: bool) -> Result<(), MechanicsError> {
        let clock = Clock::of_step(self.cycle);
        if self.cycle.is_multiple_of(NORMAL_INTERVAL) {
            // Contacts want the normals, and these what the elements sum.
            let part = clock.part();
            self.internal_forces(fields, false)?;
            part.add_to(&mut self.spent.elements);
            let part = clock.part();
            self.normals();
            for contact in &mut self.rigid_contacts {
                contact.look_between(&self.sheet_contacts);
            }
            if !self.compute_contacts() {
                let (rigid, sheets) = (&self.rigid_contacts, &self.sheet_contacts);
                let folds = &self.self_contacts;
                scatter_contacts(rigid, sheets, folds, &self.cells, &mut self.contact_force);
            }
            part.add_to(&mut self.spent.contacts);
        } else {
            let part = clock.part();
            let on_nodes = self.compute_contacts();
            part.add_to(&mut self.spent.contacts);
            let part = clock.part();
            self.internal_forces(fields, !on_nodes)?;
            part.add_to(&mut self.spent.elements);
        }
        let part = clock.part();
        self.advance();
        self.mirroring.follow(&mut self.x);
        part.add_to(&mut self.spent.nodes);
        clock.add_to(&mut self.spent.all);
        let limit = self.speed_limit();
        if self.work.bad.is_some() || self.max_speed > limit {
            return Err(self.unstable(limit));
        }
        if fields || self.cycle.is_multiple_of(shape::LOOK) {
            self.check_shapes()?;
        }
        if self.cycle.is_multiple_of(ASK_INTERVAL) {
            self.check_steps()?;
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
            .chain(self.self_contacts.iter().filter_map(|c| {
                let touches = |i: &FoldItem| i.slave.node == node as u32 && i.slave.active;
                c.items.iter().any(touches).then_some(c.name.as_str())
            }))
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
