//! Components (element formulations and materials) behind safe traits, and the caller's side of a
//! material. Array shapes, index order and units are those of `plyflow.h`.

use crate::panic_text;
use plyflow_abi::*;
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};

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

/// One membrane call; see `pf_membrane_batch`.
pub struct MembraneBatch<'a> {
    /// Lanes per row.
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

/// One bending call; see `pf_bending_batch`.
pub struct BendingBatch<'a> {
    /// Lanes per row.
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
    /// Moments of a batch; called only when `has_bending`.
    fn bending(&self, _batch: &mut BendingBatch<'_>) {}
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
    /// `[nodes][3][lanes]` (m/s); empty in initialise.
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

/// The caller's side of a material: what an element formulation or the solver holds.
#[derive(Clone, Copy)]
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
        let mut s = pf_material_sizes {
            size: size_of::<pf_material_sizes>() as u64,
            ..Default::default()
        };
        if raw.functions.is_null() || raw.instance.is_null() {
            return Err("the material has no function table or no instance (NULL)".into());
        }
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
        let sizes = MaterialSizes {
            membrane_history: s.membrane_history as usize,
            bending_history: s.bending_history as usize,
            has_bending: s.has_bending != 0 && unsafe { (*raw.functions).bending.is_some() },
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
    /// When a slice is shorter than the contract says: the material would write beyond it.
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
        unsafe { ((*self.raw.functions).membrane)(self.raw.instance, &raw const raw) }
    }

    /// Moments of a batch; zero work when the material has no bending.
    ///
    /// # Panics
    /// When a slice is shorter than the contract says: the material would write beyond it.
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
        match unsafe { (*self.raw.functions).bending } {
            Some(bending) => unsafe { bending(self.raw.instance, &raw const raw) },
            None => {
                b.moment.fill(0.0);
                b.energy.fill(0.0);
                if let Some(t) = b.tangent.as_deref_mut() {
                    t.fill(0.0);
                }
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
}

struct ElementInstance<E> {
    element: E,
    material: MaterialRef,
    sizes: ElementSizes,
}

unsafe fn rows<'a>(p: *const f64, n: usize) -> &'a [f64] {
    if p.is_null() {
        &[]
    } else {
        unsafe { std::slice::from_raw_parts(p, n) }
    }
}

unsafe fn rows_mut<'a>(p: *mut f64, n: usize) -> &'a mut [f64] {
    if p.is_null() {
        &mut []
    } else {
        unsafe { std::slice::from_raw_parts_mut(p, n) }
    }
}

unsafe fn some_mut<'a>(p: *mut f64, n: usize) -> Option<&'a mut [f64]> {
    if p.is_null() {
        None
    } else {
        Some(unsafe { std::slice::from_raw_parts_mut(p, n) })
    }
}

/// Constants as the first call or as a later one sees them.
unsafe fn constants<'a>(p: *mut f64, n: usize, first: bool) -> Constants<'a> {
    if first {
        Constants::Open(unsafe { rows_mut(p, n) })
    } else {
        Constants::Fixed(unsafe { rows(p, n) })
    }
}

unsafe fn element_batch<'a>(
    b: &pf_element_batch,
    s: &ElementSizes,
    m: &MaterialSizes,
    first: bool,
) -> ElementBatch<'a> {
    let lanes = b.lanes as usize;
    let v = s.nodes * 3 * lanes;
    unsafe {
        ElementBatch {
            lanes,
            dt: b.dt,
            position: rows(b.position, v),
            velocity: rows(b.velocity, v),
            spin: rows(b.spin, v),
            axis: rows(b.axis, 3 * lanes),
            constants: constants(b.constants, s.constants * lanes, first),
            history: rows_mut(b.history, s.history * lanes),
            material_history: rows_mut(
                b.material_history,
                s.material_points * m.membrane_history * lanes,
            ),
            force: rows_mut(b.force, v),
            moment: rows_mut(b.moment, v),
            energy: rows_mut(b.energy, PF_ENERGIES * lanes),
            fields: some_mut(b.fields, s.fields * lanes),
            mass: rows_mut(b.mass, s.nodes * lanes),
            inertia: rows_mut(b.inertia, s.nodes * lanes),
            critical_step: some_mut(b.critical_step, lanes),
        }
    }
}

unsafe fn patch_batch<'a>(
    b: &pf_patch_batch,
    s: &ElementSizes,
    m: &MaterialSizes,
    first: bool,
) -> PatchBatch<'a> {
    let lanes = b.lanes as usize;
    let v = s.patch_nodes * 3 * lanes;
    unsafe {
        PatchBatch {
            lanes,
            dt: b.dt,
            position: rows(b.position, v),
            count: rows(b.count, lanes),
            area: rows(b.area, lanes),
            axis: rows(b.axis, 3 * lanes),
            constants: constants(b.constants, s.patch_constants * lanes, first),
            history: rows_mut(b.history, (s.patch_history + m.bending_history) * lanes),
            force: rows_mut(b.force, v),
            energy: rows_mut(b.energy, lanes),
            fields: some_mut(b.fields, s.patch_fields * lanes),
            stiffness: some_mut(b.stiffness, s.patch_nodes * lanes),
        }
    }
}

fn guarded(f: impl FnOnce() -> i32) -> i32 {
    catch_unwind(AssertUnwindSafe(f)).unwrap_or(PF_PANIC)
}

unsafe fn create_guarded<T>(
    out: *mut *mut c_void,
    error: *mut pf_error,
    f: impl FnOnce() -> Result<T, String>,
) -> i32 {
    let (code, text) = match catch_unwind(AssertUnwindSafe(f)) {
        Ok(Ok(value)) => {
            unsafe { *out = Box::into_raw(Box::new(value)).cast() };
            return PF_OK;
        }
        Ok(Err(text)) => (PF_ERROR, text),
        Err(p) => (
            PF_PANIC,
            format!("the component panicked: {}", panic_text(p.as_ref())),
        ),
    };
    if !error.is_null() {
        unsafe { (*error).set(&text) };
    }
    code
}

/// The function table of an [`Element`].
pub const fn element_table<E: Element>() -> pf_element_functions {
    unsafe extern "C" fn create<E: Element>(
        parameters: pf_str,
        material: *const pf_material,
        out: *mut *mut c_void,
        error: *mut pf_error,
    ) -> i32 {
        unsafe {
            create_guarded(out, error, || {
                if material.is_null() {
                    return Err("the element was given no material (NULL)".into());
                }
                let material = MaterialRef::new(*material)?;
                let text = parameters.as_str().map_err(|e| e.to_string())?;
                let element = E::create(text, &material)?;
                let sizes = element.sizes();
                Ok(ElementInstance {
                    element,
                    material,
                    sizes,
                })
            })
        }
    }
    unsafe extern "C" fn destroy<E: Element>(instance: *mut c_void) {
        guarded(|| {
            if !instance.is_null() {
                drop(unsafe { Box::from_raw(instance.cast::<ElementInstance<E>>()) });
            }
            PF_OK
        });
    }
    unsafe extern "C" fn sizes<E: Element>(
        instance: *const c_void,
        out: *mut pf_element_sizes,
    ) -> i32 {
        let s = unsafe { &(*instance.cast::<ElementInstance<E>>()).sizes };
        unsafe {
            *out = pf_element_sizes {
                size: size_of::<pf_element_sizes>() as u64,
                nodes: s.nodes as u32,
                dofs_per_node: s.dofs_per_node as u32,
                constants: s.constants as u32,
                history: s.history as u32,
                material_points: s.material_points as u32,
                fields: s.fields as u32,
                patch_nodes: s.patch_nodes as u32,
                patch_constants: s.patch_constants as u32,
                patch_history: s.patch_history as u32,
                patch_fields: s.patch_fields as u32,
                ignores_velocity: u32::from(s.ignores_velocity),
                reserved: 0,
            };
        }
        PF_OK
    }
    unsafe extern "C" fn initialise<E: Element>(
        instance: *const c_void,
        batch: *const pf_element_batch,
    ) -> i32 {
        guarded(|| unsafe {
            let i = &*instance.cast::<ElementInstance<E>>();
            i.element.initialise(
                &mut element_batch(&*batch, &i.sizes, &i.material.sizes, true),
                &i.material,
            );
            PF_OK
        })
    }
    unsafe extern "C" fn forces<E: Element>(
        instance: *const c_void,
        batch: *const pf_element_batch,
    ) -> i32 {
        guarded(|| unsafe {
            let i = &*instance.cast::<ElementInstance<E>>();
            i.element.forces(
                &mut element_batch(&*batch, &i.sizes, &i.material.sizes, false),
                &i.material,
            )
        })
    }
    unsafe extern "C" fn patch_initialise<E: Element>(
        instance: *const c_void,
        batch: *const pf_patch_batch,
    ) -> i32 {
        guarded(|| unsafe {
            let i = &*instance.cast::<ElementInstance<E>>();
            i.element.patch_initialise(
                &mut patch_batch(&*batch, &i.sizes, &i.material.sizes, true),
                &i.material,
            );
            PF_OK
        })
    }
    unsafe extern "C" fn patch_forces<E: Element>(
        instance: *const c_void,
        batch: *const pf_patch_batch,
    ) -> i32 {
        guarded(|| unsafe {
            let i = &*instance.cast::<ElementInstance<E>>();
            i.element.patch_forces(
                &mut patch_batch(&*batch, &i.sizes, &i.material.sizes, false),
                &i.material,
            )
        })
    }
    pf_element_functions {
        size: size_of::<pf_element_functions>() as u64,
        create: create::<E>,
        destroy: destroy::<E>,
        sizes: sizes::<E>,
        initialise: initialise::<E>,
        forces: forces::<E>,
        patch_initialise: Some(patch_initialise::<E>),
        patch_forces: Some(patch_forces::<E>),
    }
}

struct MaterialInstance<M> {
    material: M,
    sizes: MaterialSizes,
}

/// The function table of a [`Material`].
pub const fn material_table<M: Material>() -> pf_material_functions {
    unsafe extern "C" fn create<M: Material>(
        parameters: pf_str,
        out: *mut *mut c_void,
        error: *mut pf_error,
    ) -> i32 {
        unsafe {
            create_guarded(out, error, || {
                let material = M::create(parameters.as_str().map_err(|e| e.to_string())?)?;
                let sizes = material.sizes();
                Ok(MaterialInstance { material, sizes })
            })
        }
    }
    unsafe extern "C" fn destroy<M: Material>(instance: *mut c_void) {
        guarded(|| {
            if !instance.is_null() {
                drop(unsafe { Box::from_raw(instance.cast::<MaterialInstance<M>>()) });
            }
            PF_OK
        });
    }
    unsafe extern "C" fn sizes<M: Material>(
        instance: *const c_void,
        out: *mut pf_material_sizes,
    ) -> i32 {
        let s = unsafe { &(*instance.cast::<MaterialInstance<M>>()).sizes };
        unsafe {
            *out = pf_material_sizes {
                size: size_of::<pf_material_sizes>() as u64,
                membrane_history: s.membrane_history as u32,
                bending_history: s.bending_history as u32,
                has_bending: u32::from(s.has_bending),
                reserved: 0,
                thickness: s.thickness,
                areal_mass: s.areal_mass,
            };
        }
        PF_OK
    }
    unsafe extern "C" fn membrane<M: Material>(
        instance: *const c_void,
        b: *const pf_membrane_batch,
    ) -> i32 {
        guarded(|| unsafe {
            let i = &*instance.cast::<MaterialInstance<M>>();
            let b = &*b;
            let lanes = b.lanes as usize;
            i.material.membrane(&mut MembraneBatch {
                lanes,
                dt: b.dt,
                metric: rows(b.metric, 3 * lanes),
                history: rows_mut(b.history, i.sizes.membrane_history * lanes),
                stress: rows_mut(b.stress, 3 * lanes),
                energy: rows_mut(b.energy, lanes),
                stiffness: some_mut(b.stiffness, 2 * lanes),
            });
            PF_OK
        })
    }
    unsafe extern "C" fn bending<M: Material>(
        instance: *const c_void,
        b: *const pf_bending_batch,
    ) -> i32 {
        guarded(|| unsafe {
            let i = &*instance.cast::<MaterialInstance<M>>();
            let b = &*b;
            let lanes = b.lanes as usize;
            i.material.bending(&mut BendingBatch {
                lanes,
                dt: b.dt,
                metric: rows(b.metric, 3 * lanes),
                curvature: rows(b.curvature, 3 * lanes),
                history: rows_mut(b.history, i.sizes.bending_history * lanes),
                moment: rows_mut(b.moment, 3 * lanes),
                energy: rows_mut(b.energy, lanes),
                tangent: some_mut(b.tangent, 3 * lanes),
            });
            PF_OK
        })
    }
    pf_material_functions {
        size: size_of::<pf_material_functions>() as u64,
        create: create::<M>,
        destroy: destroy::<M>,
        sizes: sizes::<M>,
        membrane: membrane::<M>,
        bending: Some(bending::<M>),
    }
}
