//! Components (element formulations and materials) behind safe traits, and the caller's side of a
//! material. Array shapes, index order and units are those of `plyflow.h`.

pub(crate) mod table;

use crate::aligned::are_aligned;
use plyflow_abi::*;

/// Sizes and properties of a material.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct MaterialSizes {
    /// Doubles of history per membrane point.
    pub membrane_history: usize,
    /// Doubles of history per bending point.
    pub bending_history: usize,
    /// Whether [`Material::bending`] is implemented.
    pub has_bending: bool,
    /// Thickness (m).
    pub thickness: f64,
    /// Areal mass (kg/m2).
    pub areal_mass: f64,
}

/// One membrane call; see `pf_membrane_batch`. Arrays are 64-byte aligned ([`crate::Aligned`]).
pub struct MembraneBatch<'a> {
    /// Lanes per row: a multiple of 8 from 8 to 64.
    pub lanes: usize,
    /// Time since the previous call (s).
    pub dt: f64,
    /// `[3][lanes]` C11, C22, C12.
    pub metric: &'a [f64],
    /// `[membrane_history][lanes]`.
    pub history: &'a mut [f64],
    /// `[3][lanes]` S11, S22, S12 (N/m), out.
    pub stress: &'a mut [f64],
    /// `[lanes]` (J/m2), out.
    pub energy: &'a mut [f64],
    /// `[2][lanes]` (N/m) bound of the tangent and shear tangent, out when asked for.
    pub stiffness: Option<&'a mut [f64]>,
}

/// One bending call; see `pf_bending_batch`. Arrays are 64-byte aligned ([`crate::Aligned`]).
pub struct BendingBatch<'a> {
    /// Lanes per row: a multiple of 8 from 8 to 64.
    pub lanes: usize,
    /// Time since the previous call (s).
    pub dt: f64,
    /// `[3][lanes]` C11, C22, C12.
    pub metric: &'a [f64],
    /// `[3][lanes]` k11, k22, k12 (1/m).
    pub curvature: &'a [f64],
    /// `[bending_history][lanes]`.
    pub history: &'a mut [f64],
    /// `[3][lanes]` M11, M22, M12 (N), out.
    pub moment: &'a mut [f64],
    /// `[lanes]` (J/m2), out.
    pub energy: &'a mut [f64],
    /// `[3][lanes]` (N m) diagonal tangents, out when asked for.
    pub tangent: Option<&'a mut [f64]>,
}

impl BendingBatch<'_> {
    /// No moments, no energy, no tangents.
    fn clear(&mut self) {
        self.moment.fill(0.0);
        self.energy.fill(0.0);
        if let Some(tangent) = self.tangent.as_deref_mut() {
            tangent.fill(0.0);
        }
    }
}

/// Whether a material may be given so many lanes.
#[inline(always)]
fn are_lanes(n: usize) -> bool {
    n.is_multiple_of(8) && (8..=64).contains(&n)
}

/// A material law.
pub trait Material: Sized + Send + Sync {
    /// The manifest (JSON, see `schemas/manifest.md`).
    const MANIFEST: &'static str;
    /// Makes an instance from the resolved parameters (JSON, SI numbers).
    ///
    /// # Errors
    /// A text for the user: which parameter, what was given, what is expected.
    fn create(parameters: &str) -> Result<Self, String>;
    /// Sizes of histories, thickness and mass.
    fn sizes(&self) -> MaterialSizes;
    /// Membrane resultants of a batch.
    fn membrane(&self, batch: &mut MembraneBatch<'_>);
    /// Moments of a batch; asked for only with `has_bending`. Without, there are none.
    fn bending(&self, batch: &mut BendingBatch<'_>) {
        batch.clear();
    }
    /// What a function does to one lane, as a text (`docs/plugins/tape.md`); `None`: only this library can do it.
    ///
    /// # Errors
    /// Why it could not be written down, though it should.
    fn tape(&self, _: MaterialTape) -> Result<Option<String>, String> {
        Ok(None)
    }
}

/// A function of a material that a tape stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MaterialTape {
    /// [`Material::membrane`], with stiffness.
    Membrane,
    /// [`Material::bending`], with tangents.
    Bending,
}

/// A function of an element that a tape stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ElementTape {
    /// [`Element::forces`].
    Forces,
    /// [`Element::patch_forces`] of a patch with so many nodes in use.
    PatchForces(usize),
}

/// Sizes of an element formulation; see `pf_element_sizes`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ElementSizes {
    /// Nodes of the element part: 3 or 4.
    pub nodes: usize,
    /// 3, or 6 with rotations.
    pub dofs_per_node: usize,
    /// Doubles per element written by initialise.
    pub constants: usize,
    /// Doubles of the element's own history.
    pub history: usize,
    /// Membrane points per element.
    pub material_points: usize,
    /// Fields per element.
    pub fields: usize,
    /// Most nodes of a patch, centre first; 0: no patch part.
    pub patch_nodes: usize,
    /// Doubles per patch written by patch_initialise.
    pub patch_constants: usize,
    /// Doubles of patch history besides the material's.
    pub patch_history: usize,
    /// Fields per patch.
    pub patch_fields: usize,
    /// Whether `velocity` may be empty in every call, which saves gathering it.
    pub ignores_velocity: bool,
}

/// Rows of constants. Writing to them outside of an initialise call panics: batches with the same constants share
/// them.
pub enum Constants<'a> {
    /// In the initialise calls.
    Open(&'a mut [f64]),
    /// Afterwards.
    Fixed(&'a [f64]),
}

impl std::ops::Deref for Constants<'_> {
    type Target = [f64];
    #[inline]
    fn deref(&self) -> &[f64] {
        match self {
            Self::Open(rows) => rows,
            Self::Fixed(rows) => rows,
        }
    }
}

impl std::ops::DerefMut for Constants<'_> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [f64] {
        match self {
            Self::Open(rows) => rows,
            Self::Fixed(_) => panic!("constants are written by initialise only; use the history"),
        }
    }
}

/// One element call; see `pf_element_batch`.
pub struct ElementBatch<'a> {
    /// Lanes per row.
    pub lanes: usize,
    /// Step just done (s).
    pub dt: f64,
    /// `[nodes][3][lanes]` (m).
    pub position: &'a [f64],
    /// `[nodes][3][lanes]` (m/s); empty in initialise, with 3 degrees of freedom per node, and with `ignores_velocity`.
    pub velocity: &'a [f64],
    /// `[nodes][3][lanes]` (rad/s); empty without rotations.
    pub spin: &'a [f64],
    /// `[3][lanes]`; empty outside initialise.
    pub axis: &'a [f64],
    /// `[constants][lanes]`; written by initialise only.
    pub constants: Constants<'a>,
    /// `[history][lanes]`.
    pub history: &'a mut [f64],
    /// `[material_points * membrane_history][lanes]`.
    pub material_history: &'a mut [f64],
    /// `[nodes][3][lanes]` (N), out; empty in initialise.
    pub force: &'a mut [f64],
    /// `[nodes][3][lanes]` (N m), out; empty without rotations.
    pub moment: &'a mut [f64],
    /// `[3][lanes]` (J) membrane, bending, hourglass, out; empty in initialise.
    pub energy: &'a mut [f64],
    /// `[fields][lanes]`, out when asked for.
    pub fields: Option<&'a mut [f64]>,
    /// `[nodes][lanes]` (kg), out in initialise; else empty.
    pub mass: &'a mut [f64],
    /// `[nodes][lanes]` (kg m2), out in initialise with rotations; else empty.
    pub inertia: &'a mut [f64],
    /// `[lanes]` (s), out when asked for.
    pub critical_step: Option<&'a mut [f64]>,
}

/// One patch call; see `pf_patch_batch`.
pub struct PatchBatch<'a> {
    /// Lanes per row.
    pub lanes: usize,
    /// Step just done (s).
    pub dt: f64,
    /// `[patch_nodes][3][lanes]` (m), centre first.
    pub position: &'a [f64],
    /// `[lanes]` nodes in use; empty outside patch_initialise.
    pub count: &'a [f64],
    /// `[lanes]` undeformed tributary area (m2); empty outside patch_initialise.
    pub area: &'a [f64],
    /// `[3][lanes]`; empty outside patch_initialise.
    pub axis: &'a [f64],
    /// `[patch_constants][lanes]`; written by patch_initialise only.
    pub constants: Constants<'a>,
    /// `[patch_history + bending_history][lanes]`.
    pub history: &'a mut [f64],
    /// `[patch_nodes][3][lanes]` (N), out; empty in patch_initialise.
    pub force: &'a mut [f64],
    /// `[lanes]` (J), out; empty in patch_initialise.
    pub energy: &'a mut [f64],
    /// `[patch_fields][lanes]`, out when asked for.
    pub fields: Option<&'a mut [f64]>,
    /// `[patch_nodes][lanes]` (N/m), out when asked for.
    pub stiffness: Option<&'a mut [f64]>,
}

/// The caller's side of a material: what an element formulation or the solver holds. It cannot be copied: whoever is lent one must not keep it
/// beyond the material's instance.
pub struct MaterialRef {
    raw: pf_material,
    sizes: MaterialSizes,
}

impl MaterialRef {
    /// Wraps a material and reads its sizes.
    ///
    /// # Errors
    /// When the material cannot tell its sizes or they make no sense.
    ///
    /// # Safety
    /// `raw` must hold a valid function table and instance that outlive the value.
    pub unsafe fn new(raw: pf_material) -> Result<Self, String> {
        let mut s = pf_material_sizes::default();
        if raw.functions.is_null() || raw.instance.is_null() {
            return Err("the material has no function table or no instance (NULL)".into());
        }
        // SAFETY: the caller's table and instance; `s` is a whole struct whose `size` says how much of it may be written.
        let code = unsafe { ((*raw.functions).sizes)(raw.instance, &raw mut s) };
        if code != PF_OK {
            return Err(format!("the material did not tell its sizes (code {code})"));
        }
        if !(s.thickness > 0.0 && s.areal_mass > 0.0) {
            return Err(format!(
                "the material's thickness ({} m) and areal mass ({} kg/m2) must be positive",
                s.thickness, s.areal_mass
            ));
        }
        // SAFETY: the caller's table.
        let bending = unsafe { (*raw.functions).bending };
        if s.has_bending != 0 && bending.is_none() {
            return Err(
                "the material says that it has bending (`has_bending`), and its function `bending` is NULL"
                    .into(),
            );
        }
        let sizes = MaterialSizes {
            membrane_history: s.membrane_history as usize,
            bending_history: s.bending_history as usize,
            has_bending: s.has_bending != 0,
            thickness: s.thickness,
            areal_mass: s.areal_mass,
        };
        Ok(Self { raw, sizes })
    }

    /// Its sizes.
    pub fn sizes(&self) -> MaterialSizes {
        self.sizes
    }

    /// The C view.
    pub fn raw(&self) -> &pf_material {
        &self.raw
    }

    /// Membrane resultants of a batch.
    ///
    /// # Panics
    /// When a slice is shorter than the contract says or not 64-byte aligned, or lanes are not a multiple of 8 from 8 to 64: the material
    /// would write beyond it, or load what it must not.
    #[inline]
    pub fn membrane(&self, b: &mut MembraneBatch<'_>) -> i32 {
        assert!(
            b.metric.len() >= 3 * b.lanes
                && b.history.len() >= self.sizes.membrane_history * b.lanes
                && b.stress.len() >= 3 * b.lanes
                && b.energy.len() >= b.lanes
                && b.stiffness.as_ref().is_none_or(|s| s.len() >= 2 * b.lanes),
            "a membrane batch of {} lanes has a slice that is too short",
            b.lanes
        );
        assert!(
            are_lanes(b.lanes)
                && are_aligned([b.metric, b.history, b.stress, b.energy])
                && b.stiffness.as_ref().is_none_or(|s| are_aligned([s])),
            "a membrane batch of {} lanes: expected a multiple of 8 from 8 to 64, and 64-byte aligned slices",
            b.lanes
        );
        let raw = pf_membrane_batch {
            size: size_of::<pf_membrane_batch>() as u64,
            lanes: b.lanes as u32,
            reserved: 0,
            dt: b.dt,
            metric: b.metric.as_ptr(),
            history: b.history.as_mut_ptr(),
            stress: b.stress.as_mut_ptr(),
            energy: b.energy.as_mut_ptr(),
            stiffness: pointer(&mut b.stiffness),
        };
        // SAFETY: table and instance outlive `self` (`new`). The arrays are borrowed for the call, the written ones alone, and have the
        // lengths and the alignment that plyflow.h says for this law's sizes and these lanes: the assertions above.
        unsafe { ((*self.raw.functions).membrane)(self.raw.instance, &raw const raw) }
    }

    /// Moments of a batch; all zero when the material has no bending.
    ///
    /// # Panics
    /// As [`Self::membrane`].
    #[inline]
    pub fn bending(&self, b: &mut BendingBatch<'_>) -> i32 {
        assert!(
            b.metric.len() >= 3 * b.lanes
                && b.curvature.len() >= 3 * b.lanes
                && b.history.len() >= self.sizes.bending_history * b.lanes
                && b.moment.len() >= 3 * b.lanes
                && b.energy.len() >= b.lanes
                && b.tangent.as_ref().is_none_or(|t| t.len() >= 3 * b.lanes),
            "a bending batch of {} lanes has a slice that is too short",
            b.lanes
        );
        assert!(
            are_lanes(b.lanes)
                && are_aligned([b.metric, b.curvature, b.history, b.moment, b.energy])
                && b.tangent.as_ref().is_none_or(|t| are_aligned([t])),
            "a bending batch of {} lanes: expected a multiple of 8 from 8 to 64, and 64-byte aligned slices",
            b.lanes
        );
        let raw = pf_bending_batch {
            size: size_of::<pf_bending_batch>() as u64,
            lanes: b.lanes as u32,
            reserved: 0,
            dt: b.dt,
            metric: b.metric.as_ptr(),
            curvature: b.curvature.as_ptr(),
            history: b.history.as_mut_ptr(),
            moment: b.moment.as_mut_ptr(),
            energy: b.energy.as_mut_ptr(),
            tangent: pointer(&mut b.tangent),
        };
        // SAFETY: the table outlives `self` (`new`).
        match unsafe { (*self.raw.functions).bending } {
            // SAFETY: as in `membrane`, with the assertions above.
            Some(bending) if self.sizes.has_bending => unsafe {
                bending(self.raw.instance, &raw const raw)
            },
            // A function that is there all the same, such as that of every material in Rust, need not write anything.
            _ => {
                b.clear();
                PF_OK
            }
        }
    }
}

fn pointer(slice: &mut Option<&mut [f64]>) -> *mut f64 {
    slice
        .as_deref_mut()
        .map_or(std::ptr::null_mut(), <[f64]>::as_mut_ptr)
}

/// An element formulation.
pub trait Element: Sized + Send + Sync {
    /// The manifest (JSON, see `schemas/manifest.md`).
    const MANIFEST: &'static str;
    /// Makes an instance from the resolved parameters (JSON, SI numbers) for a material.
    ///
    /// # Errors
    /// A text for the user.
    fn create(parameters: &str, material: &MaterialRef) -> Result<Self, String>;
    /// Sizes.
    fn sizes(&self) -> ElementSizes;
    /// Writes constants and masses from the reference positions.
    fn initialise(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef);
    /// Internal forces and energies; returns a status (`PF_OK` or the material's).
    fn forces(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32;
    /// Writes patch constants; called only with `patch_nodes > 0`.
    fn patch_initialise(&self, _batch: &mut PatchBatch<'_>, _material: &MaterialRef) {}
    /// Patch forces and energies; called only with `patch_nodes > 0`.
    fn patch_forces(&self, _batch: &mut PatchBatch<'_>, _material: &MaterialRef) -> i32 {
        PF_OK
    }
    /// What a function does to one lane over a material of these sizes, as a text (`docs/plugins/tape.md`); `None`: only this library can do it.
    ///
    /// # Errors
    /// Why it could not be written down, though it should.
    fn tape(&self, _: ElementTape, _: &MaterialSizes) -> Result<Option<String>, String> {
        Ok(None)
    }
}
