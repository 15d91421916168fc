//! Building a model: sheets, batches, masses.

use super::batch::component_status;
use super::blocks::{BLOCK, Block, Sums};
use super::boundary::{Anchors, Boundary, Drive, Held, Loads, Supports};
use super::mirror::Mirroring;
use super::parts::{
    CellPlace, Contacts, Elements, Model, Rotations, State, StepSettings, Topology, Workspace,
};
use super::transpose::gather;
use crate::component::ElementInstance;
use crate::energy::Ledger;
use crate::mesh::{NONE, Patch, QuadMesh, compact_order};
use crate::mirror::{Mirrors, mirrored_in};
use crate::sheet::{
    Aligned, Batch, Kind, PatchBatch, Pressed, Pressures, Shared, Sheet, SheetSpec,
};
use crate::vec3::{Vec3, add, norm, scale, sub};
use crate::{LANES, MechanicsError};
use plyflow_abi::*;
use std::sync::Arc;

impl Model {
    /// Builds a model from points (m, at their start) and sheets (from the tool upwards).
    ///
    /// # Errors
    /// When a component fails or a mass or step makes no sense.
    pub fn new(
        points: Vec<Vec3>,
        specs: Vec<SheetSpec>,
        settings: StepSettings,
    ) -> Result<Self, MechanicsError> {
        Self::mirrored(points, specs, settings, Mirrors::default())
    }

    /// The same for the part of a model that mirror planes bound, with its ghosts among the points. Long, as it names each field of a model.
    ///
    /// # Errors
    /// As [`Model::new`].
    pub fn mirrored(
        points: Vec<Vec3>,
        specs: Vec<SheetSpec>,
        settings: StepSettings,
        mirrors: Mirrors,
    ) -> Result<Self, MechanicsError> {
        let n = points.len();
        let mut model = Self {
            topology: Topology {
                start: points.as_slice().into(),
                sheets: Vec::new(),
                cells: Vec::new(),
                neighbours: Vec::new(),
                cell_place: Vec::new(),
                pressed_below: Vec::new(),
                mass: vec![0.0; n],
                own_mass: vec![0.0; n],
                free_mass: Vec::new(),
                shortest_edge: 0.0,
                mirroring: Mirroring::new(mirrors, &points),
                settings,
            },
            state: State {
                x: points,
                v: vec![[0.0; 3]; n],
                normals: vec![[0.0, 0.0, 1.0]; n],
                rotations: None,
                force: vec![[0.0; 3]; n],
                time: 0.0,
                cycle: 0,
                dt: settings.target_step,
                last_dt: 0.0,
                kick: 1.0,
                max_speed: 0.0,
                max_acceleration: 0.0,
                ledger: Ledger::default(),
            },
            elements: Elements::default(),
            contacts: Contacts {
                force: vec![[0.0; 3]; n],
                ..Contacts::default()
            },
            boundary: Boundary {
                pressures: Pressures::default(),
                last_above: 0.0,
                body_acceleration: [0.0; 3],
                load_factor: 1.0,
                loads: Loads::default(),
                supports: Supports::default(),
                held: vec![Held::Free; n],
                driven: Vec::new(),
                drive: None,
                anchors: Anchors::default(),
                external_force: Vec::new(),
            },
            workspace: Workspace::default(),
        };
        for spec in specs {
            model.add_sheet(spec)?;
        }
        model.finish()?;
        Ok(model)
    }

    fn add_sheet(&mut self, spec: SheetSpec) -> Result<(), MechanicsError> {
        let sheet_index = self.topology.sheets.len() as u32;
        let (cell0, block0, patch0) = (
            self.topology.cells.len(),
            self.elements.blocks.len(),
            self.elements.patches.len(),
        );
        let cells: Vec<[u32; 4]> = spec
            .cells
            .iter()
            .map(|c| c.map(|k| spec.nodes[k as usize]))
            .collect();
        self.add_neighbours(&cells);
        let material = spec.element.material.reference().sizes();
        let s = spec.element.sizes;
        let rotates = spec.element.rotates();
        check_elsewhere(&spec)?;
        check_steered(&spec)?;
        let orders = orders(&spec, &self.centres(&cells));
        self.topology
            .cell_place
            .resize(cell0 + cells.len(), CellPlace::default());
        let pressed = |c: usize| matches!(spec.pressed[c], Pressed::Below | Pressed::Both);
        self.topology
            .pressed_below
            .extend((0..cells.len()).map(pressed));
        self.add_blocks(sheet_index, &spec, &cells, &orders);
        if rotates && self.state.rotations.is_none() {
            self.state.rotations = Some(Box::new(Rotations::new(self.state.x.len())));
        }
        if s.patch_nodes > 0 && material.has_bending {
            self.add_patches(sheet_index, &spec, material.bending_history)?;
        }
        self.topology.cells.extend(cells);
        let (straight, steered) = (spec.axis, spec.steered);
        let axis = |c: u32| steered.as_ref().map_or(straight, |s| s.cells[c as usize]);
        let mut sheet = Sheet {
            name: spec.name,
            nodes: self.topology.mirroring.own(spec.nodes),
            cell_range: (cell0, self.topology.cells.len()),
            block_range: (block0, self.elements.blocks.len()),
            patch_range: (patch0, self.elements.patches.len()),
            thickness: material.thickness,
            added_mass: 0.0,
            element: spec.element,
            elsewhere: spec.elsewhere.map(|e| e.element),
            other_material: spec.other_material.map(|o| [Some(o.element), o.elsewhere]),
        };
        self.initialise(
            &mut sheet,
            axis,
            &orders,
            &spec.least_areal_mass,
            material.areal_mass,
        )?;
        self.topology.sheets.push(sheet);
        Ok(())
    }

    fn centres(&self, cells: &[[u32; 4]]) -> Vec<Vec3> {
        let sum = |c: &[u32; 4]| {
            c.iter()
                .fold([0.0; 3], |m, n| add(m, self.state.x[*n as usize]))
        };
        cells.iter().map(|c| scale(sum(c), 0.25)).collect()
    }

    /// Cells across the sides of the `cells` that a new sheet adds.
    fn add_neighbours(&mut self, cells: &[[u32; 4]]) {
        let cell0 = self.topology.cells.len() as u32;
        let mesh = QuadMesh {
            points: self.state.x.clone(),
            cells: cells.to_vec(),
        };
        let shift = |c: u32| {
            if c == NONE || mirrored_in(c).is_some() {
                c
            } else {
                c + cell0
            }
        };
        let mut neighbours = mesh.neighbours();
        self.topology
            .mirroring
            .mark(cells, &self.state.x, &mut neighbours);
        self.topology
            .neighbours
            .extend(neighbours.into_iter().map(|e| e.map(shift)));
    }

    /// Elements of the `cells` of a new sheet, in the order in which they shall stand in memory.
    fn add_blocks(
        &mut self,
        sheet: u32,
        spec: &SheetSpec,
        cells: &[[u32; 4]],
        orders: &[(Kind, Vec<u32>)],
    ) {
        let cell0 = self.topology.cells.len();
        let groups = (orders.iter()).flat_map(|(e, o)| o.chunks(BLOCK * LANES).map(|g| (*e, g)));
        for (kind, group) in groups {
            let used = group.iter().flat_map(|c| cells[*c as usize]);
            let mut block = Block::new(used);
            for (b, chunk) in group.chunks(LANES).enumerate() {
                for (l, c) in chunk.iter().enumerate() {
                    self.topology.cell_place[cell0 + *c as usize] = CellPlace {
                        block: self.elements.blocks.len() as u32,
                        batch: b as u16,
                        lane: l as u16,
                    };
                }
                let of = (sheet, kind);
                let batch = element_batch(of, spec, cells, chunk, &block);
                block.batches.push(batch);
            }
            self.elements.blocks.push(block);
        }
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
        let centres: Vec<Vec3> = spec
            .patches
            .iter()
            .map(|p| self.state.x[spec.nodes[p.nodes[0] as usize] as usize])
            .collect();
        let order = compact_order(&centres, BLOCK * LANES);
        let mut shared = Shared::default();
        for group in order.chunks(BLOCK * LANES) {
            let patch = |k: u32| &spec.patches[k as usize];
            let used = group.iter().flat_map(|k| &patch(*k).nodes);
            let mut block = Block::new(used.map(|k| spec.nodes[*k as usize]));
            for chunk in group.chunks(LANES) {
                let of = |l: usize| patch(chunk[l.min(chunk.len() - 1)]);
                let count = chunk.len();
                let batch =
                    self.patch_batch(sheet, spec, count, of, &block, bending_history, &mut shared);
                block.batches.push(batch?);
            }
            self.elements.patches.push(block);
        }
        Ok(())
    }

    /// A batch of the patches `of(lane)`, of which `count` count. Long, as it writes out the table of a call to the element, with a line for each array.
    fn patch_batch<'a>(
        &self,
        sheet: u32,
        spec: &SheetSpec,
        count: usize,
        of: impl Fn(usize) -> &'a Patch,
        block: &Block<PatchBatch>,
        bending_history: usize,
        shared: &mut Shared,
    ) -> Result<PatchBatch, MechanicsError> {
        let s = spec.element.sizes;
        let nodes: Vec<[u32; LANES]> = (0..s.patch_nodes)
            .map(|k| {
                std::array::from_fn(|l| {
                    let p = of(l);
                    spec.nodes[*p.nodes.get(k).unwrap_or(&p.nodes[0]) as usize]
                })
            })
            .collect();
        let mut batch = PatchBatch {
            sheet,
            count: count as u32,
            places: nodes.iter().map(|n| n.map(|n| block.place(n))).collect(),
            nodes,
            centres: (0..LANES).map(|l| of(l).nodes[0]).collect(),
            constants: Arc::default(),
            history: Aligned::zeros((s.patch_history + bending_history) * LANES),
            fields: Aligned::default(),
            energy: 0.0,
            status: PF_OK,
        };
        let mut constants = Aligned::zeros(s.patch_constants * LANES);
        let mut position = Aligned::zeros(s.patch_nodes * 3 * LANES);
        gather(&batch.nodes, &self.state.x, &mut position);
        let count: Vec<f64> = (0..LANES).map(|l| of(l).nodes.len() as f64).collect();
        let count = Aligned::from(count.as_slice());
        let area: Vec<f64> = (0..LANES).map(|l| of(l).area).collect();
        let area = Aligned::from(area.as_slice());
        let of_lane = |l: usize| spec.axis_of_patch(of(l).nodes[0]);
        let axis: Vec<f64> = (0..3 * LANES)
            .map(|k| of_lane(k % LANES)[k / LANES])
            .collect();
        let axis = Aligned::from(axis.as_slice());
        let raw = pf_patch_batch {
            size: size_of::<pf_patch_batch>() as u64,
            lanes: LANES as u32,
            reserved: 0,
            dt: 0.0,
            position: position.as_ptr(),
            count: count.as_ptr(),
            area: area.as_ptr(),
            axis: axis.as_ptr(),
            constants: constants.as_mut_ptr(),
            history: batch.history.as_mut_ptr(),
            force: std::ptr::null_mut(),
            energy: std::ptr::null_mut(),
            fields: std::ptr::null_mut(),
            stiffness: std::ptr::null_mut(),
            material: spec.element.material.reference().raw(),
        };
        // SAFETY: arrays of this function and the batch's history, of the lengths for the element's sizes and `LANES` lanes, borrowed by nobody else.
        let code = unsafe { spec.element.patch_initialise(&raw) };
        component_status(code, &spec.name)?;
        batch.constants = shared.keep(constants);
        let used = (0..LANES).map(|l| of(l).nodes.len()).max();
        batch.nodes.truncate(used.unwrap_or(0));
        batch.places.truncate(used.unwrap_or(0));
        Ok(batch)
    }

    fn finish(&mut self) -> Result<(), MechanicsError> {
        let is_ghost = |n: usize| self.topology.mirroring.is_ghost(n as u32);
        let without = |(n, m): (usize, &f64)| *m <= 0.0 && !is_ghost(n);
        if let Some(i) = self.topology.mass.iter().enumerate().position(without) {
            return Err(MechanicsError::Input(format!(
                "node {i} belongs to no element"
            )));
        }
        let n = self.state.x.len();
        let edge = |a: u32, b: u32| norm(sub(self.state.x[a as usize], self.state.x[b as usize]));
        self.topology.shortest_edge = self
            .topology
            .cells
            .iter()
            .flat_map(|c| (0..4).map(move |k| edge(c[k], c[(k + 1) % 4])))
            .fold(f64::INFINITY, f64::min);
        self.elements.sums = Sums::new(n, &self.elements.blocks);
        self.elements.sums.area = self.elements.sums.zeros();
        let pressed = |b: &Block<Batch>| b.batches.iter().any(|b| !b.pressed.is_empty());
        if self.elements.blocks.iter().any(pressed) {
            self.elements.sums.pressure = self.elements.sums.zeros();
        }
        if self.state.rotations.is_some() {
            self.elements.sums.moment = self.elements.sums.zeros();
        }
        self.elements.patch_sums = Sums::new(n, &self.elements.patches);
        self.topology.mirroring.place(&self.elements.patch_sums)?;
        self.set_free_masses();
        self.hold_at_planes();
        self.internal_forces(false, false)?;
        self.compute_normals();
        Ok(())
    }

    /// Sets which nodes are driven and by what. The order of `nodes` is that of [`Drive::position`].
    pub fn set_driven(&mut self, nodes: Vec<u32>, drive: Box<dyn Drive>) {
        self.boundary.held.fill(Held::Free);
        for n in &nodes {
            self.boundary.held[*n as usize] = Held::Driven;
        }
        self.boundary.supports.reaction = vec![[0.0; 3]; nodes.len()];
        self.boundary.supports.reaction_moment = vec![[0.0; 3]; nodes.len()];
        self.boundary.driven = nodes;
        self.boundary.drive = Some(drive);
        self.boundary.anchors = Anchors::default();
        self.set_free_masses();
    }
}

/// The cells of a sheet by formulation, each group of them in an order of its own: a block has elements of one kind, and membranes cost what
/// membranes cost.
fn orders(spec: &SheetSpec, centres: &[Vec3]) -> Vec<(Kind, Vec<u32>)> {
    let both = |there: bool| if there { &[false, true][..] } else { &[false] };
    let kind = |c: usize| Kind {
        elsewhere: spec.elsewhere.as_ref().is_some_and(|e| e.cells[c]),
        other: spec.other_material.as_ref().is_some_and(|o| o.cells[c]),
    };
    let others = both(spec.other_material.is_some()).iter();
    let kinds = others.flat_map(|o| {
        let of = |e: &bool| Kind {
            elsewhere: *e,
            other: *o,
        };
        both(spec.elsewhere.is_some()).iter().map(of)
    });
    let order = |wanted: Kind| {
        let own: Vec<u32> = (0..centres.len() as u32)
            .filter(|c| kind(*c as usize) == wanted)
            .collect();
        let places: Vec<Vec3> = own.iter().map(|c| centres[*c as usize]).collect();
        let order = compact_order(&places, BLOCK * LANES);
        (wanted, order.iter().map(|k| own[*k as usize]).collect())
    };
    kinds.map(order).collect()
}

/// Whether axes that depend on the place are told for every cell and node.
fn check_steered(spec: &SheetSpec) -> Result<(), MechanicsError> {
    let Some(steered) = &spec.steered else {
        return Ok(());
    };
    let (cells, nodes) = (steered.cells.len(), steered.nodes.len());
    let around = spec.patches.iter().map(|p| p.nodes[0] as usize + 1);
    if cells == spec.cells.len() && nodes >= around.max().unwrap_or(0) {
        return Ok(());
    }
    Err(MechanicsError::Input(format!(
        "sheet '{}': its material axes are told for {cells} cells and {nodes} nodes; it has {} cells and {} nodes",
        spec.name,
        spec.cells.len(),
        spec.nodes.len()
    )))
}

/// Whether the element of [`Elsewhere`] is a membrane, and told for every cell.
fn check_elsewhere(spec: &SheetSpec) -> Result<(), MechanicsError> {
    check_other_material(spec)?;
    let Some(e) = &spec.elsewhere else {
        return Ok(());
    };
    if e.cells.len() != spec.cells.len() {
        return Err(MechanicsError::Input(format!(
            "sheet '{}': which of its two elements a cell has is told for {} cells; it has {}",
            spec.name,
            e.cells.len(),
            spec.cells.len()
        )));
    }
    if e.element.rotates() || e.element.sizes.patch_nodes > 0 {
        return Err(MechanicsError::Input(format!(
            "sheet '{}': the element beside its own must be a membrane (three degrees of freedom per node, no patches), such as m4",
            spec.name
        )));
    }
    Ok(())
}

/// Whether another material is told for every cell, and its elements are like the sheet's own.
fn check_other_material(spec: &SheetSpec) -> Result<(), MechanicsError> {
    let Some(other) = &spec.other_material else {
        return Ok(());
    };
    let pairs = [
        (Some(&spec.element), Some(&other.element)),
        (
            spec.elsewhere.as_ref().map(|e| &e.element),
            other.elsewhere.as_ref(),
        ),
    ];
    let shape = |e: &ElementInstance| (e.sizes.dofs_per_node, e.sizes.fields, e.sizes.patch_nodes);
    let alike = pairs.iter().all(|(a, b)| a.map(shape) == b.map(shape));
    if other.cells.len() == spec.cells.len() && alike {
        return Ok(());
    }
    Err(MechanicsError::Input(format!(
        "sheet '{}': its other material is told for {} of {} cells, with elements that must be like its own",
        spec.name,
        other.cells.len(),
        spec.cells.len()
    )))
}

/// A batch of the cells `chunk` of a sheet, all of one kind; `cells` in model nodes.
fn element_batch(
    (sheet, kind): (u32, Kind),
    spec: &SheetSpec,
    cells: &[[u32; 4]],
    chunk: &[u32],
    block: &Block<Batch>,
) -> Batch {
    let other = spec.other_material.as_ref().filter(|_| kind.other);
    let element = match (&spec.elsewhere, other) {
        (Some(e), None) if kind.elsewhere => &e.element,
        (Some(e), Some(o)) if kind.elsewhere => o.elsewhere.as_ref().unwrap_or(&e.element),
        (_, Some(o)) => &o.element,
        _ => &spec.element,
    };
    let s = element.sizes;
    let membrane_history = element.material.reference().sizes().membrane_history;
    // Lanes beyond the last element repeat it.
    let cell = |l: usize| chunk[l.min(chunk.len() - 1)] as usize;
    let nodes: [[u32; LANES]; 4] =
        std::array::from_fn(|k| std::array::from_fn(|l| cells[cell(l)][k]));
    let layers: Vec<f64> = (0..LANES).map(|l| spec.layers[cell(l)]).collect();
    let layered = layers.iter().any(|k| *k != 1.0);
    let shares = |l: usize| match spec.pressed[cell(l)] {
        Pressed::No => [0.0, 0.0],
        Pressed::Below => [1.0, 0.0],
        Pressed::Above => [0.0, 1.0],
        Pressed::Both => [1.0, 1.0],
    };
    let is_pressed = (0..LANES).any(|l| shares(l) != [0.0; 2]);
    Batch {
        sheet,
        elsewhere: kind.elsewhere,
        other: kind.other,
        count: chunk.len() as u32,
        places: nodes.map(|n| n.map(|n| block.place(n))),
        nodes,
        pressed: (0..LANES).filter(|_| is_pressed).map(shares).collect(),
        layers: if layered { layers } else { Vec::new() },
        mass_factor: Vec::new(),
        energy: [0.0; PF_ENERGIES],
        constants: Arc::default(),
        history: Aligned::zeros(s.history * LANES),
        material_history: Aligned::zeros(s.material_points * membrane_history * LANES),
        fields: Aligned::default(),
        status: PF_OK,
    }
}
