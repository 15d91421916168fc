//! A meshed sheet, cut into batches for its element formulation.

use crate::LANES;
use crate::component::ElementInstance;
use crate::mesh::Patch;
use plyflow_abi::*;
pub use plyflow_sdk::Aligned;
use std::collections::HashMap;
use std::hash::{DefaultHasher, Hasher};
use std::sync::Arc;

/// Arrays that are never written again, each kept once: the elements of a regular mesh have the same constants.
#[derive(Default)]
pub(crate) struct Shared {
    by_hash: HashMap<u64, Vec<Arc<Aligned>>>,
}

impl Shared {
    /// The array with these bits.
    pub(crate) fn keep(&mut self, rows: Aligned) -> Arc<Aligned> {
        let same = |a: &Aligned, b: &Aligned| {
            a.len() == b.len() && a.iter().zip(&**b).all(|(a, b)| a.to_bits() == b.to_bits())
        };
        let mut hash = DefaultHasher::new();
        rows.iter().for_each(|x| hash.write_u64(x.to_bits()));
        let kept = self.by_hash.entry(hash.finish()).or_default();
        if let Some(found) = kept.iter().find(|k| same(k, &rows)) {
            return found.clone();
        }
        let rows = Arc::new(rows);
        kept.push(rows.clone());
        rows
    }
}

/// What presses on a cell from outside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pressed {
    /// Nothing.
    No,
    /// The cavity, from below.
    Below,
    /// The surroundings, from above.
    Above,
    /// Both (films joined into one surface).
    Both,
}

/// Pressures at the current time (Pa).
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Pressures {
    /// From below on cells pressed below.
    pub below: f64,
    /// From above on cells pressed above.
    pub above: f64,
}

/// What a sheet is made of, before it becomes part of a model.
pub struct SheetSpec {
    /// Name of its body.
    pub name: String,
    /// Model node of each mesh node.
    pub nodes: Vec<u32>,
    /// `[m]` cells in mesh-local node numbers.
    pub cells: Vec<[u32; 4]>,
    /// Node patches in mesh-local numbers (used when the element has a patch part).
    pub patches: Vec<Patch>,
    /// Direction of material axis e1 in the undeformed plane.
    pub axis: [f64; 3],
    /// Of a sheet whose axes depend on the place: theirs, instead of `axis`.
    pub steered: Option<SteeredAxes>,
    /// `[m]` how many layers a cell stands for (2 where two films are joined).
    pub layers: Vec<f64>,
    /// `[m]` what presses on it.
    pub pressed: Vec<Pressed>,
    /// `[m]` least areal mass (kg/m2) by explicit mass scaling; 0: none.
    pub least_areal_mass: Vec<f64>,
    /// The element formulation with its material.
    pub element: ElementInstance,
    /// What takes its place in some cells, if anything does.
    pub elsewhere: Option<Elsewhere>,
    /// Another material that some cells have, if any do.
    pub other_material: Option<OtherMaterial>,
}

/// Directions of material axis e1 in the undeformed plane, by place. An axis has no head: neighbours may have opposite ones.
#[derive(Debug, Clone, PartialEq)]
pub struct SteeredAxes {
    /// `[m]` in the middle of each cell.
    pub cells: Vec<[f64; 3]>,
    /// `[nodes]` at each mesh node, for the patch around it.
    pub nodes: Vec<[f64; 3]>,
}

impl SheetSpec {
    /// Direction of e1 of the patch around a mesh-local node.
    pub(crate) fn axis_of_patch(&self, centre: u32) -> [f64; 3] {
        let of = |s: &SteeredAxes| s.nodes[centre as usize];
        self.steered.as_ref().map_or(self.axis, of)
    }
}

/// The same formulation with another material in some cells of a sheet, such as a fabric without its stitch. What bends about nodes is that of the
/// sheet's own material everywhere.
pub struct OtherMaterial {
    /// The sheet's element with that material.
    pub element: ElementInstance,
    /// What takes its place in the cells of [`Elsewhere`], where the sheet has such.
    pub elsewhere: Option<ElementInstance>,
    /// `[m]` whether a cell has it.
    pub cells: Vec<bool>,
}

/// Which of a sheet's formulations a batch has.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Kind {
    /// That of [`Elsewhere`].
    pub elsewhere: bool,
    /// With the material of [`OtherMaterial`].
    pub other: bool,
}

/// A membrane that some cells of a sheet have instead of the sheet's element. Neither patches nor rotations belong to it: the
/// sheet's element ends at its cells as at a free edge, so the line between transmits forces and no moments.
pub struct Elsewhere {
    /// A formulation without patches and with three degrees of freedom per node, for the same material.
    pub element: ElementInstance,
    /// `[m]` whether a cell has it.
    pub cells: Vec<bool>,
}

/// A sheet inside a model.
pub struct Sheet {
    /// Name of its body.
    pub name: String,
    /// Model node of each mesh node.
    pub nodes: Vec<u32>,
    /// Its cells in the model's numbering: first and one past the last.
    pub cell_range: (usize, usize),
    /// Its blocks of batches: first and one past the last.
    pub block_range: (usize, usize),
    /// Its blocks of patch batches.
    pub patch_range: (usize, usize),
    /// The element formulation.
    pub element: ElementInstance,
    /// That of the batches that are marked so ([`Elsewhere`]).
    pub elsewhere: Option<ElementInstance>,
    /// Both with another material, of the batches that are marked so ([`OtherMaterial`]).
    pub other_material: Option<[Option<ElementInstance>; 2]>,
    /// Thickness (m).
    pub thickness: f64,
    /// Mass by mass scaling (kg).
    pub added_mass: f64,
}

impl Sheet {
    /// The formulation of a batch.
    #[inline]
    pub fn element_of(&self, batch: &Batch) -> &ElementInstance {
        if batch.other
            && let Some([own, elsewhere]) = &self.other_material
        {
            let element = if batch.elsewhere { elsewhere } else { own };
            if let Some(element) = element {
                return element;
            }
        }
        match &self.elsewhere {
            Some(element) if batch.elsewhere => element,
            _ => &self.element,
        }
    }
}

/// [`LANES`] elements of one sheet.
pub struct Batch {
    /// Index of the sheet.
    pub sheet: u32,
    /// Whether they have the sheet's other formulation ([`Elsewhere`]).
    pub elsewhere: bool,
    /// Whether they have the sheet's other material ([`OtherMaterial`]).
    pub other: bool,
    /// Elements that count; the rest repeat the last.
    pub count: u32,
    /// Model nodes by corner and lane.
    pub nodes: [[u32; LANES]; 4],
    /// Places of the nodes in the sums of the block.
    pub places: [[u16; LANES]; 4],
    /// Shares of the pressure from below and from above, by lane; empty when nothing presses on any.
    pub pressed: Vec<[f64; 2]>,
    /// Layers by lane; empty when all stand for one.
    pub layers: Vec<f64>,
    /// Mass scaling factor by lane; empty when no mass is added.
    pub mass_factor: Vec<f64>,
    /// Energies of the elements that count, in the last call (J).
    pub energy: [f64; PF_ENERGIES],
    /// `[constants][LANES]`; batches of the same constants share them.
    pub constants: Arc<Aligned>,
    /// `[history][LANES]`.
    pub history: Aligned,
    /// `[points * membrane_history][LANES]`.
    pub material_history: Aligned,
    /// `[fields][LANES]`; empty unless fields were asked for.
    pub fields: Aligned,
    /// Status of the last call.
    pub status: i32,
}

/// [`LANES`] node patches of one sheet.
pub struct PatchBatch {
    /// Index of the sheet.
    pub sheet: u32,
    /// Patches that count.
    pub count: u32,
    /// `[used][LANES]` model nodes, as many as the largest patch has; unused slots of a smaller one repeat its centre.
    pub nodes: Vec<[u32; LANES]>,
    /// Places of the nodes in the sums of the block.
    pub places: Vec<[u16; LANES]>,
    /// Mesh-local centre nodes of the lanes.
    pub centres: Vec<u32>,
    /// `[patch_constants][LANES]`; batches of the same constants share them.
    pub constants: Arc<Aligned>,
    /// `[patch_history + bending_history][LANES]`.
    pub history: Aligned,
    /// `[patch_fields][LANES]`; empty unless asked for.
    pub fields: Aligned,
    /// Of the patches that count, in the last call (J).
    pub energy: f64,
    /// Status of the last call.
    pub status: i32,
}

/// A batch view with everything null.
pub(crate) fn empty_element_batch(
    element: &ElementInstance,
    dt: f64,
    position: &[f64],
) -> pf_element_batch {
    let null = std::ptr::null_mut();
    pf_element_batch {
        size: size_of::<pf_element_batch>() as u64,
        lanes: LANES as u32,
        reserved: 0,
        dt,
        position: position.as_ptr(),
        velocity: null,
        spin: null,
        axis: null,
        constants: null,
        history: null,
        material_history: null,
        force: null,
        moment: null,
        energy: null,
        fields: null,
        mass: null,
        inertia: null,
        critical_step: null,
        material: element.material.reference().raw(),
    }
}

/// A patch batch view with everything null.
pub(crate) fn empty_patch_batch(sheet: &Sheet, dt: f64, position: &[f64]) -> pf_patch_batch {
    let null = std::ptr::null_mut();
    pf_patch_batch {
        size: size_of::<pf_patch_batch>() as u64,
        lanes: LANES as u32,
        reserved: 0,
        dt,
        position: position.as_ptr(),
        count: null,
        area: null,
        axis: null,
        constants: null,
        history: null,
        force: null,
        energy: null,
        fields: null,
        stiffness: null,
        material: sheet.element.material.reference().raw(),
    }
}
