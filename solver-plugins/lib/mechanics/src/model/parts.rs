//! The parts of a model.

use super::blocks::{Block, Sums};
use super::boundary::{Boundary, Fixed};
use super::mirror::Mirroring;
use super::spent::Spent;
use crate::contact::{ContactEnergy, RigidContact, SelfContact, SheetContact};
use crate::energy::Ledger;
use crate::sheet::{Batch, PatchBatch, Sheet};
use crate::team::Sharing;
use crate::vec3::{Vec3, dot};
use std::sync::Arc;

/// A model: sheets with their contacts, what acts on them, and where they are. Per-node arrays are in the model's numbering.
pub struct Model {
    /// What changes from step to step.
    pub(super) state: State,
    /// What stays as it was built.
    pub(super) topology: Topology,
    pub(super) elements: Elements,
    pub(super) contacts: Contacts,
    /// What holds, drives and presses.
    pub(super) boundary: Boundary,
    pub(super) workspace: Workspace,
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

/// Where the nodes are and how they move.
pub(super) struct State {
    /// `[n]` positions (m).
    pub x: Vec<Vec3>,
    /// `[n]` velocities at the half step (m/s).
    pub v: Vec<Vec3>,
    /// `[n]` unit normals of the sheets.
    pub normals: Vec<Vec3>,
    /// Spins and moments, where nodes rotate.
    pub rotations: Option<Box<Rotations>>,
    /// `[n]` forces on the nodes in the last step (N).
    pub force: Vec<Vec3>,
    /// Time (s) of the positions.
    pub time: f64,
    /// Steps done.
    pub cycle: u64,
    /// Step (s).
    pub dt: f64,
    /// The step before (s).
    pub last_dt: f64,
    /// 1, or 1/2 in the first step from rest: velocities live at half steps.
    pub kick: f64,
    /// Largest speed in the last step (m/s).
    pub max_speed: f64,
    /// Largest acceleration in the last step (m/s2).
    pub max_acceleration: f64,
    /// Accumulated losses and external work, and the stored energies of the last ledger.
    pub ledger: Ledger,
}

/// Rotational state; per-node arrays in the model's numbering.
pub(super) struct Rotations {
    /// `[n]` spins at the half step (rad/s).
    pub(super) spin: Vec<Vec3>,
    /// `[n]` rotary inertias (kg m2); 0: the node does not rotate.
    pub(super) inertia: Vec<f64>,
    /// The same with 0 for driven nodes; empty when none is.
    pub(super) free_inertia: Vec<f64>,
}

impl Rotations {
    pub(super) fn new(n: usize) -> Self {
        Self {
            spin: vec![[0.0; 3]; n],
            inertia: vec![0.0; n],
            free_inertia: Vec::new(),
        }
    }

    /// Holds components of a node's rotation at zero.
    pub(super) fn fix(&mut self, node: usize, fixed: Fixed) {
        self.spin[node] = fixed.rotation(self.spin[node]);
    }
}

/// Sheets, cells and masses as they were built.
pub(super) struct Topology {
    /// `[n]` positions with which it was built (m); shared, so that what needs them keeps no copy of its own.
    pub start: Arc<[Vec3]>,
    /// Sheets from the tool upwards.
    pub sheets: Vec<Sheet>,
    /// `[cells][4]` model nodes of all sheets' cells.
    pub cells: Vec<[u32; 4]>,
    /// `[cells][4]` cells across the sides.
    pub neighbours: Vec<[u32; 4]>,
    /// `[cells]` where their elements are.
    pub cell_place: Vec<CellPlace>,
    /// `[cells]` whether the cavity presses from below.
    pub pressed_below: Vec<bool>,
    /// `[n]` masses (kg).
    pub mass: Vec<f64>,
    /// `[n]` masses without scaling (kg): what has weight.
    pub own_mass: Vec<f64>,
    /// `[n]` masses (kg), 0 for driven nodes; empty when none is.
    pub free_mass: Vec<f64>,
    /// Shortest edge of a cell at the start (m).
    pub shortest_edge: f64,
    /// Planes and ghosts.
    pub mirroring: Mirroring,
    /// Constants of the time integration.
    pub settings: StepSettings,
}

/// Elements and bending patches in batches, and what they sum on nodes.
#[derive(Default)]
pub(super) struct Elements {
    pub blocks: Vec<Block<Batch>>,
    pub patches: Vec<Block<PatchBatch>>,
    pub sums: Sums,
    pub patch_sums: Sums,
}

/// Everything that touches, and what it costs.
#[derive(Default)]
pub(super) struct Contacts {
    /// Sheet on sheet.
    pub sheets: Vec<SheetContact>,
    /// Sheets on themselves.
    pub folds: Vec<SelfContact>,
    /// Sheets on rigid surfaces.
    pub rigid: Vec<RigidContact>,
    /// `[n]` stiffness that self-contacts may add to a node (N/m); empty without them.
    pub room: Vec<f64>,
    /// `[n]` forces of the contacts (N); zero between steps.
    pub force: Vec<Vec3>,
    /// Of all together in the last step.
    pub energy: ContactEnergy,
    /// By contact, rigid ones, sheets on sheets, sheets on themselves: stored at present, lost so far (J).
    pub interfaces: Vec<ContactEnergy>,
    /// The same: stored at present, lost in the last step (J).
    pub step_energies: Vec<ContactEnergy>,
}

impl Contacts {
    /// Puts the forces of all on the nodes, one after the other. `cells`: the model's.
    pub fn scatter(&mut self, cells: &[[u32; 4]]) {
        for contact in &self.rigid {
            contact.scatter(&mut self.force);
        }
        for contact in &self.sheets {
            contact.scatter(cells, &mut self.force);
        }
        for contact in &self.folds {
            contact.scatter(cells, &mut self.force);
        }
    }
}

/// Kept from step to step only for their room: a step allocates nothing. Nothing here is part of an answer.
#[derive(Default)]
pub(super) struct Workspace {
    /// By chunk of nodes.
    pub works: Vec<NodeWork>,
    /// Their sum.
    pub work: NodeWork,
    /// By driven node: position and velocity before the step.
    pub before: Vec<(Vec3, Vec3)>,
    /// By driven node: spin before the step.
    pub spins: Vec<Vec3>,
    /// Parts of a volume (m3).
    pub volumes: Vec<f64>,
    /// How threads share the work.
    pub sharing: Sharing,
    /// Where the time goes.
    pub spent: Spent,
}

/// Where the element of a cell is.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct CellPlace {
    pub block: u32,
    pub batch: u16,
    pub lane: u16,
}

/// Sums over nodes of one step (J), and the largest speed and change of speed.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct NodeWork {
    pub kinetic: f64,
    pub external: f64,
    pub damping: f64,
    /// Squared (m2/s2).
    pub speed: f64,
    /// Squared (m2/s2).
    pub change: f64,
    pub bad: Option<u32>,
}

impl NodeWork {
    /// Counts a node of mass or rotary inertia `m` with its new velocity or spin.
    #[inline(always)]
    pub fn count(&mut self, m: f64, node: usize, v: Vec3) {
        let v2 = dot(v, v);
        self.kinetic += 0.5 * m * v2;
        if !v2.is_finite() {
            self.bad = self.bad.or(Some(node as u32));
        }
    }

    pub fn add(mut self, o: Self) -> Self {
        self.kinetic += o.kinetic;
        self.external += o.external;
        self.damping += o.damping;
        self.speed = self.speed.max(o.speed);
        self.change = self.change.max(o.change);
        self.bad = self.bad.or(o.bad);
        self
    }
}
