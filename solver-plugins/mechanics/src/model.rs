//! Nodes, sheets, contacts and loads; one central-difference step.

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
    pressure_force: Vec<V>,
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
    /// Builds a model from points (m, at their start) and sheets (from the tool upwards).
    ///
    /// # Errors
    /// When a component fails or a mass or step makes no sense.
    pub fn new(
        points: Vec<V>,
        specs: Vec<SheetSpec>,
        settings: StepSettings,
    ) -> Result<Self, MechanicsError> {
        let n = points.len();
        let mut model = Self {
            v: vec![[0.0; 3]; n],
            mass: vec![0.0; n],
            normals: vec![[0.0, 0.0, 1.0]; n],
            area: vec![[0.0; 3]; n],
            sheets: Vec::new(),
            cells: Vec::new(),
            neighbours: Vec::new(),
            sheet_contacts: Vec::new(),
            rigid_contacts: Vec::new(),
            pressures: Pressures::default(),
            time: 0.0,
            cycle: 0,
            dt: settings.target_step,
            ledger: Ledger::default(),
            settings,
            batches: Vec::new(),
            patches: Vec::new(),
            pressed: Vec::new(),
            element_force: Aligned::default(),
            element_energy: Aligned::default(),
            cell_area: Aligned::default(),
            cell_slot: Vec::new(),
            node_slots: Csr::default(),
            patch_slots: Csr::default(),
            force: vec![[0.0; 3]; n],
            pressure_force: vec![[0.0; 3]; n],
            held: vec![Held::Free; n],
            driven: Vec::new(),
            drive: None,
            max_speed: 0.0,
            contact: ContactEnergy::default(),
            work: NodeWork::default(),
            x: points,
        };
        for spec in specs {
            model.add_sheet(spec)?;
        }
        model.finish()?;
        Ok(model)
    }

    fn add_sheet(&mut self, spec: SheetSpec) -> Result<(), MechanicsError> {
        let sheet_index = self.sheets.len() as u32;
        let (cell0, batch0, patch0) = (self.cells.len(), self.batches.len(), self.patches.len());
        let cells: Vec<[u32; 4]> = spec
            .cells
            .iter()
            .map(|c| c.map(|k| spec.nodes[k as usize]))
            .collect();
        let mesh = QuadMesh {
            points: self.x.clone(),
            cells: cells.clone(),
        };
        let shift = |c: u32| {
            if c == crate::mesh::NONE {
                c
            } else {
                c + cell0 as u32
            }
        };
        self.neighbours
            .extend(mesh.neighbours().into_iter().map(|e| e.map(shift)));
        let material = spec.element.material.reference().sizes();
        let s = spec.element.sizes;
        for (b, chunk) in cells.chunks(LANES).enumerate() {
            let lane = |l: usize| b * LANES + l.min(chunk.len() - 1);
            let nodes: [[u32; 4]; LANES] = std::array::from_fn(|l| cells[lane(l)]);
            let layers: [f64; LANES] = std::array::from_fn(|l| spec.layers[lane(l)]);
            for l in 0..LANES {
                let p = spec.pressed[lane(l)];
                let below = if matches!(p, Pressed::Below | Pressed::Both) {
                    1.0
                } else {
                    0.0
                };
                let above = if matches!(p, Pressed::Above | Pressed::Both) {
                    1.0
                } else {
                    0.0
                };
                self.pressed.push([below, above]);
                if l < chunk.len() {
                    self.cell_slot.push(((batch0 + b) * LANES + l) as u32);
                }
            }
            self.batches.push(Batch {
                sheet: sheet_index,
                count: chunk.len() as u32,
                nodes,
                layers,
                layered: layers.iter().any(|k| *k != 1.0),
                mass_factor: [1.0; LANES],
                mass: Aligned::zeros(4 * LANES),
                constants: Aligned::zeros(s.constants * LANES),
                history: Aligned::zeros(s.history * LANES),
                material_history: Aligned::zeros(
                    s.material_points * material.membrane_history * LANES,
                ),
                fields: Aligned::default(),
                status: PF_OK,
            });
        }
        if s.patch_nodes > 0 && material.has_bending {
            self.add_patches(sheet_index, &spec, material.bending_history)?;
        }
        self.cells.extend(cells);
        let mut sheet = Sheet {
            name: spec.name,
            nodes: spec.nodes,
            cell_range: (cell0, self.cells.len()),
            batch_range: (batch0, self.batches.len()),
            patch_range: (patch0, self.patches.len()),
            thickness: material.thickness,
            added_mass: 0.0,
            element: spec.element,
        };
        self.initialise(
            &mut sheet,
            spec.axis,
            &spec.least_areal_mass,
            material.areal_mass,
        )?;
        self.sheets.push(sheet);
        Ok(())
    }

    fn add_patches(
        &mut self,
        sheet: u32,
        spec: &SheetSpec,
        bending_history: usize,
    ) -> Result<(), MechanicsError> {
        let s = spec.element.sizes;
        if let Some(p) = spec.patches.iter().find(|p| p.nodes.len() > s.patch_nodes) {
            return Err(MechanicsError::Input(format!(
                "sheet '{}': node {} has {} nodes around it, its element takes at most {}; \
                 use a more regular mesh or another element",
                spec.name,
                p.nodes[0],
                p.nodes.len() - 1,
                s.patch_nodes - 1
            )));
        }
        for chunk in spec.patches.chunks(LANES) {
            let of = |l: usize| &chunk[l.min(chunk.len() - 1)];
            let nodes = (0..LANES)
                .flat_map(|l| {
                    let p = of(l);
                    (0..s.patch_nodes).map(move |k| *p.nodes.get(k).unwrap_or(&p.nodes[0]))
                })
                .map(|k| spec.nodes[k as usize])
                .collect();
            let mut batch = PatchBatch {
                sheet,
                count: chunk.len() as u32,
                nodes,
                centres: (0..LANES).map(|l| of(l).nodes[0]).collect(),
                constants: Aligned::zeros(s.patch_constants * LANES),
                history: Aligned::zeros((s.patch_history + bending_history) * LANES),
                fields: Aligned::default(),
                force: Aligned::zeros(s.patch_nodes * 3 * LANES),
                energy: Aligned::zeros(LANES),
                status: PF_OK,
            };
            let mut position = Aligned::zeros(s.patch_nodes * 3 * LANES);
            gather_patch(&batch.nodes, s.patch_nodes, &self.x, &mut position);
            let count: Vec<f64> = (0..LANES).map(|l| of(l).nodes.len() as f64).collect();
            let area: Vec<f64> = (0..LANES).map(|l| of(l).area).collect();
            let axis: Vec<f64> = (0..3 * LANES).map(|k| spec.axis[k / LANES]).collect();
            let raw = pf_patch_batch {
                size: size_of::<pf_patch_batch>() as u64,
                lanes: LANES as u32,
                reserved: 0,
                dt: 0.0,
                position: position.as_ptr(),
                count: count.as_ptr(),
                area: area.as_ptr(),
                axis: axis.as_ptr(),
                constants: batch.constants.as_mut_ptr(),
                history: batch.history.as_mut_ptr(),
                force: std::ptr::null_mut(),
                energy: std::ptr::null_mut(),
                fields: std::ptr::null_mut(),
                stiffness: std::ptr::null_mut(),
                material: spec.element.material.reference().raw(),
            };
            component_status(spec.element.patch_initialise(&raw), &spec.name)?;
            self.patches.push(batch);
        }
        Ok(())
    }

    /// Constants and masses of a sheet, with mass scaling to the wanted step and areal mass.
    fn initialise(
        &mut self,
        sheet: &mut Sheet,
        axis: V,
        least: &[f64],
        areal_mass: f64,
    ) -> Result<(), MechanicsError> {
        let axis: Vec<f64> = (0..3 * LANES).map(|k| axis[k / LANES]).collect();
        let mut position = Aligned::zeros(12 * LANES);
        let mut force = Aligned::zeros(12 * LANES);
        let mut energy = Aligned::zeros(PF_ENERGIES * LANES);
        let mut step = Aligned::zeros(LANES);
        let batches = &mut self.batches[sheet.batch_range.0..sheet.batch_range.1];
        for (b, batch) in batches.iter_mut().enumerate() {
            gather(&batch.nodes, &self.x, &mut position);
            let mut raw = empty_element_batch(sheet, 0.0, &position);
            raw.axis = axis.as_ptr();
            raw.constants = batch.constants.as_mut_ptr();
            raw.history = batch.history.as_mut_ptr();
            raw.material_history = batch.material_history.as_mut_ptr();
            raw.mass = batch.mass.as_mut_ptr();
            component_status(sheet.element.initialise(&raw), &sheet.name)?;
            raw.axis = std::ptr::null();
            raw.mass = std::ptr::null_mut();
            raw.force = force.as_mut_ptr();
            raw.energy = energy.as_mut_ptr();
            raw.critical_step = step.as_mut_ptr();
            component_status(sheet.element.forces(&raw), &sheet.name)?;
            for l in 0..batch.count as usize {
                let critical = step[l] * self.settings.safety;
                if !(critical > 0.0 && critical.is_finite()) {
                    return Err(MechanicsError::Input(format!(
                        "sheet '{}': an element has a critical step of {} s; its mesh or \
                         material makes no sense",
                        sheet.name, step[l]
                    )));
                }
                let factor = (self.settings.target_step / critical)
                    .powi(2)
                    .max(least[b * LANES + l] / areal_mass)
                    .max(1.0);
                batch.mass_factor[l] = factor;
                for k in 0..4 {
                    let own = batch.mass[k * LANES + l] * batch.layers[l];
                    self.mass[batch.nodes[l][k] as usize] += own * factor;
                    sheet.added_mass += own * (factor - 1.0);
                }
            }
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), MechanicsError> {
        if let Some(i) = self.mass.iter().position(|m| *m <= 0.0) {
            return Err(MechanicsError::Input(format!(
                "node {i} belongs to no element"
            )));
        }
        let n = self.x.len();
        let nb = self.batches.len();
        self.element_force = Aligned::zeros(nb * 12 * LANES);
        self.element_energy = Aligned::zeros(nb * PF_ENERGIES * LANES);
        self.cell_area = Aligned::zeros(nb * AREA_ROWS * LANES);
        let slots = self
            .cells
            .iter()
            .zip(&self.cell_slot)
            .flat_map(|(nodes, slot)| (0..4u32).map(move |k| (nodes[k as usize], slot * 4 + k)));
        self.node_slots = Csr::build(n, slots);
        let pairs: Vec<(u32, u32)> = self
            .patches
            .iter()
            .enumerate()
            .flat_map(|(b, batch)| {
                let width = batch.nodes.len() / LANES;
                (0..batch.count as usize).flat_map(move |l| {
                    let row = &batch.nodes[l * width..(l + 1) * width];
                    let used = move |k: usize| k == 0 || row[k] != row[0];
                    (0..width)
                        .filter(move |k| used(*k))
                        .map(move |k| (row[k], ((b * LANES + l) as u32) << 5 | k as u32))
                })
            })
            .collect();
        self.patch_slots = Csr::build(n, pairs.into_iter());
        self.internal_forces(false)?;
        self.assemble();
        Ok(())
    }

    /// Sets which nodes are driven and by what. The order of `nodes` is that of [`Drive::position`].
    pub fn set_driven(&mut self, nodes: Vec<u32>, drive: Box<dyn Drive>) {
        self.held.fill(Held::Free);
        for n in &nodes {
            self.held[*n as usize] = Held::Driven;
        }
        self.driven = nodes;
        self.drive = Some(drive);
    }

    /// Sets stiffness and damping of all contacts from the masses that they couple, and bounds the
    /// assembled stiffness of every node: 2 sum(k) dt^2 / m stays below `2 * 0.7`, which leaves the rest of
    /// the stability bound 4 to the elements.
    pub fn set_contact_stiffness(&mut self, c: &ContactSettings) {
        let dt2 = self.settings.target_step.powi(2);
        let mass = &self.mass;
        let mut row = vec![0.0; mass.len()];
        for contact in &mut self.rigid_contacts {
            contact.augmentation = c.augmentation;
            for item in &mut contact.items {
                item.stiffness = c.stiffness_factor * mass[item.node as usize] / dt2;
                row[item.node as usize] += item.stiffness;
            }
        }
        for contact in &mut self.sheet_contacts {
            contact.augmentation = c.augmentation;
            for item in contact
                .items
                .iter_mut()
                .filter(|i| i.cell != crate::mesh::NONE)
            {
                let nodes = self.cells[item.cell as usize];
                let lightest = nodes
                    .iter()
                    .map(|n| mass[*n as usize])
                    .fold(f64::INFINITY, f64::min);
                let reduced = 1.0 / (1.0 / mass[item.node as usize] + 1.0 / lightest);
                item.stiffness = c.stiffness_factor * reduced / dt2;
                row[item.node as usize] += item.stiffness;
                for (k, n) in nodes.iter().enumerate() {
                    row[*n as usize] += item.weights[k] * item.stiffness;
                }
            }
        }
        let limit: Vec<f64> = row
            .iter()
            .zip(mass)
            .map(|(r, m)| (0.7 * m / (dt2 * r.max(1e-300))).min(1.0))
            .collect();
        for item in self.rigid_contacts.iter_mut().flat_map(|c| &mut c.items) {
            let m = mass[item.node as usize];
            item.stiffness *= limit[item.node as usize];
            item.damping = 2.0 * c.damping_ratio * (item.stiffness * m).sqrt();
        }
        for item in self.sheet_contacts.iter_mut().flat_map(|c| &mut c.items) {
            if item.cell == crate::mesh::NONE {
                continue;
            }
            let nodes = self.cells[item.cell as usize];
            let least = nodes.iter().map(|n| limit[*n as usize]).fold(1.0, f64::min);
            item.stiffness *= least.min(limit[item.node as usize]);
            let lightest = nodes
                .iter()
                .map(|n| mass[*n as usize])
                .fold(f64::INFINITY, f64::min);
            let reduced = 1.0 / (1.0 / mass[item.node as usize] + 1.0 / lightest);
            item.damping = 2.0 * c.damping_ratio * (item.stiffness * reduced).sqrt();
        }
    }

    /// Internal forces, energies and cell areas at the present positions. With `fields`, the elements'
    /// fields too.
    fn internal_forces(&mut self, fields: bool) -> Result<(), MechanicsError> {
        let (sheets, x) = (&self.sheets, &self.x);
        let dt = if self.cycle == 0 { 0.0 } else { self.dt };
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
                run_batch(sheet, batch, x, dt, force, energy, area, fields);
            });
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
        self.force
            .par_chunks_mut(NODE_CHUNK)
            .zip_eq(self.pressure_force.par_chunks_mut(NODE_CHUNK))
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
                    force[i] = add(f, q);
                    pressure[i] = q;
                    if with_normals {
                        area[i] = a;
                        normal[i] = crate::vec3::unit(a);
                    }
                }
            });
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
            for item in contact.items.iter().filter(|i| i.normal_force > 0.0) {
                let n = item.node as usize;
                self.force[n] = add(self.force[n], item.force);
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
        let (dt, alpha, time) = (self.dt, self.settings.damping, self.time);
        let targets: Vec<V> = match &self.drive {
            Some(drive) => (0..self.driven.len())
                .map(|k| drive.position(k, time + dt))
                .collect(),
            None => Vec::new(),
        };
        for (n, target) in self.driven.iter().zip(targets) {
            let n = *n as usize;
            let next = scale(sub(target, self.x[n]), 1.0 / dt);
            // What holds the node makes up for the forces on it: its work is external.
            let mean = scale(add(next, self.v[n]), 0.5);
            let inertia = scale(sub(next, self.v[n]), self.mass[n] / dt);
            let held = sub(inertia, sub(self.force[n], self.pressure_force[n]));
            self.ledger.external += dot(held, mean) * dt;
            self.x[n] = target;
            self.v[n] = next;
        }
        let (lo, hi) = (1.0 / dt - 0.5 * alpha, 1.0 / (1.0 / dt + 0.5 * alpha));
        let (force, pressure, mass, held) =
            (&self.force, &self.pressure_force, &self.mass, &self.held);
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
                            v[c] = (lo * old[c] + force[n][c] / mass[n]) * hi;
                            xs[i][c] += v[c] * dt;
                        }
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
        self.max_speed = self.work.speed.sqrt();
        self.ledger.external += self.work.external;
        self.ledger.damping += self.work.damping;
        self.time += dt;
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
        1e-3 / self.dt
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

    /// The ledger at the present step.
    pub fn energies(&self) -> Ledger {
        let mut l = self.ledger;
        l.kinetic = self.work.kinetic;
        l.contact = self.contact.stored;
        for (b, batch) in self.batches.iter().enumerate() {
            let e = &self.element_energy[b * PF_ENERGIES * LANES..];
            for lane in 0..batch.count as usize {
                l.membrane += e[PF_ENERGY_MEMBRANE * LANES + lane];
                l.bending += e[PF_ENERGY_BENDING * LANES + lane];
                l.hourglass += e[PF_ENERGY_HOURGLASS * LANES + lane];
            }
        }
        for batch in &self.patches {
            l.bending += batch.energy[..batch.count as usize].iter().sum::<f64>();
        }
        l
    }

    /// The step that the elements allow at the present positions (s), with mass scaling and bending.
    ///
    /// # Errors
    /// When a component fails.
    pub fn critical_step(&self) -> Result<f64, MechanicsError> {
        let (sheets, x) = (&self.sheets, &self.x);
        let steps: Vec<f64> = self
            .batches
            .par_iter()
            .map(|batch| batch_critical_step(&sheets[batch.sheet as usize], batch, x))
            .collect();
        let membrane = steps.into_iter().fold(f64::INFINITY, f64::min);
        let rows: Vec<Vec<(u32, f64)>> = self
            .patches
            .par_iter()
            .map(|batch| patch_rows(&sheets[batch.sheet as usize], batch, x))
            .collect();
        let mut row = vec![0.0; self.x.len()];
        for (n, r) in rows.into_iter().flatten() {
            row[n as usize] += r;
        }
        let bending = row
            .iter()
            .zip(&self.mass)
            .map(|(r, m)| r / m)
            .fold(0.0, f64::max);
        // omega^2 of a sum of stiffnesses is at most the sum of their own bounds.
        let omega2 = (2.0 / membrane).powi(2) + bending;
        Ok(2.0 / omega2.sqrt())
    }

    /// Row `index` of the element fields of a sheet, per cell. Needs a step with `fields`.
    pub fn cell_field(&self, sheet: usize, index: usize) -> Vec<f64> {
        let (b0, b1) = self.sheets[sheet].batch_range;
        self.batches[b0..b1]
            .iter()
            .flat_map(|b| {
                let row = &b.fields[index * LANES..index * LANES + b.count as usize];
                row.iter().copied()
            })
            .collect()
    }

    /// Row `index` of the patch fields of a sheet, per mesh-local node (0 where there is no patch).
    pub fn patch_field(&self, sheet: usize, index: usize) -> Vec<f64> {
        let (b0, b1) = self.sheets[sheet].patch_range;
        let mut values = vec![0.0; self.sheets[sheet].nodes.len()];
        for b in &self.patches[b0..b1] {
            for l in 0..b.count as usize {
                values[b.centres[l] as usize] = b.fields[index * LANES + l];
            }
        }
        values
    }

    /// Number of elements.
    pub fn element_count(&self) -> usize {
        self.cells.len()
    }

    /// Number of node patches.
    pub fn patch_count(&self) -> usize {
        self.patches.iter().map(|b| b.count as usize).sum()
    }

    /// Volume (m3) under the cells that are pressed from below, over the plane z = 0.
    pub fn volume_below(&self) -> f64 {
        // Partial sums of fixed chunks, added in order: the same for any number of threads.
        let parts: Vec<f64> = self
            .cells
            .par_chunks(NODE_CHUNK)
            .zip_eq(self.cell_slot.par_chunks(NODE_CHUNK))
            .map(|(cells, slots)| {
                let mut volume = 0.0;
                for (cell, slot) in cells.iter().zip(slots) {
                    if self.pressed[*slot as usize][0] > 0.0 {
                        let p = cell.map(|n| self.x[n as usize]);
                        let height = 0.25 * (p[0][2] + p[1][2] + p[2][2] + p[3][2]);
                        volume += area_vector(p)[2] * height;
                    }
                }
                volume
            })
            .collect();
        parts.into_iter().sum()
    }
}

fn component_status(code: i32, sheet: &str) -> Result<(), MechanicsError> {
    if code == PF_OK {
        return Ok(());
    }
    let reason = match code {
        PF_PANIC => "it panicked".to_owned(),
        PF_BAD_VALUE => "a value is NaN, infinite or out of range".to_owned(),
        c => format!("it returned status {c}"),
    };
    Err(MechanicsError::Component {
        what: format!("element of sheet '{sheet}'"),
        reason,
    })
}

#[inline(always)]
fn gather(nodes: &[[u32; 4]; LANES], x: &[V], out: &mut [f64]) {
    let out = &mut out[..12 * LANES];
    for (l, cell) in nodes.iter().enumerate() {
        for k in 0..4 {
            let p = x[cell[k] as usize];
            out[3 * k * LANES + l] = p[0];
            out[(3 * k + 1) * LANES + l] = p[1];
            out[(3 * k + 2) * LANES + l] = p[2];
        }
    }
}

#[inline(always)]
fn gather_patch(nodes: &[u32], width: usize, x: &[V], out: &mut [f64]) {
    for l in 0..LANES {
        for k in 0..width {
            let p = x[nodes[l * width + k] as usize];
            for c in 0..3 {
                out[(3 * k + c) * LANES + l] = p[c];
            }
        }
    }
}

#[repr(align(64))]
struct Buffer<const N: usize>([f64; N]);

/// Rows of the cell areas: three vectors per cell.
const AREA_ROWS: usize = 9;

/// Signs of the local coordinates of a cell's nodes.
const SIGNS: [(f64, f64); 4] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];

/// The integral of N_I x,xi x x,eta over a bilinear cell is u + xi_I v + eta_I w with u = c1 x c2,
/// v = c1 x c3 / 3, w = c3 x c2 / 3, where x = c0 + c1 xi + c2 eta + c3 xi eta. Pressure by these weights is the
/// exact gradient of the enclosed volume; by a quarter of the area each it is not, and under 1 bar the
/// difference drives the hourglass modes into flutter.
#[inline(always)]
fn cell_areas(p: &[f64; 12 * LANES], area: &mut [f64]) {
    let area = &mut area[..AREA_ROWS * LANES];
    let row = |k: usize, c: usize| &p[(3 * k + c) * LANES..(3 * k + c + 1) * LANES];
    let mut c = [[[0.0; LANES]; 3]; 3];
    for k in 0..3 {
        let (x0, x1, x2, x3) = (row(0, k), row(1, k), row(2, k), row(3, k));
        for l in 0..LANES {
            let (d, e) = (0.25 * (x2[l] - x0[l]), 0.25 * (x3[l] - x1[l]));
            c[0][k][l] = d - e;
            c[1][k][l] = d + e;
            c[2][k][l] = 0.25 * (x0[l] - x1[l] + x2[l] - x3[l]);
        }
    }
    for (r, (i, j, share)) in [(0, 1, 1.0), (0, 2, 1.0 / 3.0), (2, 1, 1.0 / 3.0)]
        .into_iter()
        .enumerate()
    {
        let (a, b) = (&c[i], &c[j]);
        for k in 0..3 {
            let (m, n) = ((k + 1) % 3, (k + 2) % 3);
            let out = &mut area[(3 * r + k) * LANES..(3 * r + k + 1) * LANES];
            for l in 0..LANES {
                out[l] = share * (a[m][l] * b[n][l] - a[n][l] * b[m][l]);
            }
        }
    }
}

/// [`cell_areas`] with the machine's widest vectors; no fused operations, so the bits are the same on all.
#[inline]
fn cell_areas_dispatch(p: &[f64; 12 * LANES], area: &mut [f64]) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn wide(p: &[f64; 12 * LANES], area: &mut [f64]) {
            cell_areas(p, area);
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // Checked the line above.
            return unsafe { wide(p, area) };
        }
    }
    cell_areas(p, area);
}

fn run_batch(
    sheet: &Sheet,
    batch: &mut Batch,
    x: &[V],
    dt: f64,
    force: &mut [f64],
    energy: &mut [f64],
    area: Option<&mut [f64]>,
    fields: bool,
) {
    let mut position = Buffer([0.0; 12 * LANES]);
    gather(&batch.nodes, x, &mut position.0);
    let p = &position.0;
    if let Some(area) = area {
        cell_areas_dispatch(p, area);
    }
    let mut raw = empty_element_batch(sheet, dt, p);
    raw.constants = batch.constants.as_mut_ptr();
    raw.history = batch.history.as_mut_ptr();
    raw.material_history = batch.material_history.as_mut_ptr();
    raw.force = force.as_mut_ptr();
    raw.energy = energy.as_mut_ptr();
    if fields {
        batch.fields = Aligned::zeros(sheet.element.sizes.fields * LANES);
        raw.fields = batch.fields.as_mut_ptr();
    }
    batch.status = sheet.element.forces(&raw);
    if batch.layered {
        for row in force
            .chunks_exact_mut(LANES)
            .chain(energy.chunks_exact_mut(LANES))
        {
            for (value, layers) in row.iter_mut().zip(&batch.layers) {
                *value *= layers;
            }
        }
    }
}

fn run_patch(sheet: &Sheet, batch: &mut PatchBatch, x: &[V], dt: f64, fields: bool) {
    let width = sheet.element.sizes.patch_nodes;
    let mut position = Buffer([0.0; 32 * 3 * LANES]);
    gather_patch(&batch.nodes, width, x, &mut position.0);
    let mut raw = empty_patch_batch(sheet, dt, &position.0);
    raw.constants = batch.constants.as_mut_ptr();
    raw.history = batch.history.as_mut_ptr();
    raw.force = batch.force.as_mut_ptr();
    raw.energy = batch.energy.as_mut_ptr();
    if fields {
        batch.fields = Aligned::zeros(sheet.element.sizes.patch_fields * LANES);
        raw.fields = batch.fields.as_mut_ptr();
    }
    batch.status = sheet.element.patch_forces(&raw);
}

/// The smallest critical step of a batch (s). Works on copies of the histories: asking changes nothing.
fn batch_critical_step(sheet: &Sheet, batch: &Batch, x: &[V]) -> f64 {
    let mut position = Buffer([0.0; 12 * LANES]);
    gather(&batch.nodes, x, &mut position.0);
    let mut constants = batch.constants.clone();
    let mut history = batch.history.clone();
    let mut material_history = batch.material_history.clone();
    let mut force = Aligned::zeros(12 * LANES);
    let mut energy = Aligned::zeros(PF_ENERGIES * LANES);
    let mut step = Aligned::zeros(LANES);
    let mut raw = empty_element_batch(sheet, 0.0, &position.0);
    raw.constants = constants.as_mut_ptr();
    raw.history = history.as_mut_ptr();
    raw.material_history = material_history.as_mut_ptr();
    raw.force = force.as_mut_ptr();
    raw.energy = energy.as_mut_ptr();
    raw.critical_step = step.as_mut_ptr();
    if sheet.element.forces(&raw) != PF_OK {
        return 0.0;
    }
    (0..batch.count as usize)
        .map(|l| step[l] * batch.mass_factor[l].sqrt())
        .fold(f64::INFINITY, f64::min)
}

/// Row sums of the bending stiffness (N/m) by model node.
fn patch_rows(sheet: &Sheet, batch: &PatchBatch, x: &[V]) -> Vec<(u32, f64)> {
    let width = sheet.element.sizes.patch_nodes;
    let mut position = Buffer([0.0; 32 * 3 * LANES]);
    gather_patch(&batch.nodes, width, x, &mut position.0);
    let mut constants = batch.constants.clone();
    let mut history = batch.history.clone();
    let mut force = Aligned::zeros(3 * width * LANES);
    let mut energy = Aligned::zeros(LANES);
    let mut stiffness = Aligned::zeros(width * LANES);
    let mut raw = empty_patch_batch(sheet, 0.0, &position.0);
    raw.constants = constants.as_mut_ptr();
    raw.history = history.as_mut_ptr();
    raw.force = force.as_mut_ptr();
    raw.energy = energy.as_mut_ptr();
    raw.stiffness = stiffness.as_mut_ptr();
    if sheet.element.patch_forces(&raw) != PF_OK {
        return Vec::new();
    }
    (0..batch.count as usize)
        .flat_map(|l| {
            let nodes = &batch.nodes[l * width..(l + 1) * width];
            let stiffness = &stiffness;
            (0..width)
                .filter(move |k| *k == 0 || nodes[*k] != nodes[0])
                .map(move |k| (nodes[k], stiffness[k * LANES + l]))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume enclosed by bilinear cells: a third of the flux of x, by 2 x 2 Gauss points (exact).
    fn volume(points: &[V], cells: &[[u32; 4]]) -> f64 {
        let g = 1.0 / 3.0f64.sqrt();
        let mut sum = 0.0;
        for cell in cells {
            let p = cell.map(|n| points[n as usize]);
            for (a, b) in [(-g, -g), (g, -g), (g, g), (-g, g)] {
                let at = |w: [f64; 4]| -> V {
                    std::array::from_fn(|c| (0..4).map(|k| w[k] * p[k][c]).sum())
                };
                let w = crate::contact::shape([a, b]);
                let (wa, wb) = ((1.0 - b, 1.0 + b), (1.0 - a, 1.0 + a));
                let tx = at([-wa.0, wa.0, wa.1, -wa.1].map(|w| 0.25 * w));
                let ty = at([-wb.0, -wb.1, wb.1, wb.0].map(|w| 0.25 * w));
                sum += dot(at(w), crate::vec3::cross(tx, ty)) / 3.0;
            }
        }
        sum
    }

    #[test]
    fn pressure_weights_are_the_gradient_of_the_enclosed_volume() {
        // A cube of six warped quads.
        let mut points: Vec<V> = (0..8)
            .map(|i| [(i & 1) as f64, ((i >> 1) & 1) as f64, (i >> 2) as f64])
            .collect();
        for (i, p) in points.iter_mut().enumerate() {
            for (c, v) in p.iter_mut().enumerate() {
                *v += 0.2 * (((i * 5 + c * 3) % 7) as f64 / 7.0 - 0.5);
            }
        }
        let cells: [[u32; 4]; 6] = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let mut gradient = [[0.0; 3]; 8];
        let mut nodes = [[0u32; 4]; LANES];
        nodes[..6].copy_from_slice(&cells);
        let mut position = [0.0; 12 * LANES];
        gather(&nodes, &points, &mut position);
        let mut area = vec![0.0; AREA_ROWS * LANES];
        cell_areas(&position, &mut area);
        for (l, cell) in cells.iter().enumerate() {
            for k in 0..4 {
                let (sx, sy) = SIGNS[k];
                for c in 0..3 {
                    let row = |r: usize| area[(3 * r + c) * LANES + l];
                    gradient[cell[k] as usize][c] += row(0) + sx * row(1) + sy * row(2);
                }
            }
        }
        let h = 1e-6;
        for n in 0..8 {
            for c in 0..3 {
                let at = |d: f64| {
                    let mut q = points.clone();
                    q[n][c] += d;
                    volume(&q, &cells)
                };
                let slope = (at(h) - at(-h)) / (2.0 * h);
                assert!((slope - gradient[n][c]).abs() < 1e-8, "node {n}, {c}");
            }
        }
    }
}
