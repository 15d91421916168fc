//! The C function tables of components: what a host calls.
//!
//! **What makes it sound.** The functions are reached through the tables alone, which are plugins' side of plyflow.h. Its promises are what every
//! function here asks of its caller (`# Safety` of each in one place): an instance is one that the same table's `create` made and
//! `destroy` has not ended; texts, materials and batches are whole and there for the call; the arrays of a batch are NULL or have the
//! lengths that the instance's sizes and the batch's lanes give them, do not overlap, and nobody else writes what is read or touches
//! what is written. One row is shared by batches: constants, which are written in the initialise calls alone.

use super::{
    BendingBatch, Constants, Element, ElementBatch, ElementSizes, ElementTape, Material,
    MaterialRef, MaterialSizes, MaterialTape, MembraneBatch, PatchBatch,
};
use crate::error::panic_text;
use plyflow_abi::*;
use std::ffi::c_void;
use std::panic::{AssertUnwindSafe, catch_unwind};

struct ElementInstance<E> {
    element: E,
    material: MaterialRef,
    sizes: ElementSizes,
}

/// # Safety
/// `p` is NULL or points to `n` doubles that are there, and not written to, for `'a`.
unsafe fn rows<'a>(p: *const f64, n: usize) -> &'a [f64] {
    if p.is_null() {
        &[]
    } else {
        // SAFETY: not NULL, so `n` doubles as the caller promises.
        unsafe { std::slice::from_raw_parts(p, n) }
    }
}

/// # Safety
/// `p` is NULL or points to `n` doubles that are there, and nobody else's, for `'a`.
unsafe fn rows_mut<'a>(p: *mut f64, n: usize) -> &'a mut [f64] {
    if p.is_null() {
        &mut []
    } else {
        // SAFETY: not NULL, so `n` doubles as the caller promises.
        unsafe { std::slice::from_raw_parts_mut(p, n) }
    }
}

/// [`rows_mut`] of an output that is there when it is wanted.
///
/// # Safety
/// As [`rows_mut`].
unsafe fn some_mut<'a>(p: *mut f64, n: usize) -> Option<&'a mut [f64]> {
    // SAFETY: the caller's promise.
    (!p.is_null()).then(|| unsafe { rows_mut(p, n) })
}

/// Constants as the first call or as a later one sees them.
///
/// # Safety
/// As [`rows_mut`] in the first call, as [`rows`] in a later one: other batches may read them at the same time.
unsafe fn constants<'a>(p: *mut f64, n: usize, first: bool) -> Constants<'a> {
    if first {
        // SAFETY: the caller's promise for a first call.
        Constants::Open(unsafe { rows_mut(p, n) })
    } else {
        // SAFETY: the caller's promise for a later call.
        Constants::Fixed(unsafe { rows(p, n) })
    }
}

/// The slices of a batch of elements.
///
/// # Safety
/// `b` keeps to plyflow.h, with these sizes of the element and of its material, for `'a`; `first`: in an initialise call.
unsafe fn element_batch<'a>(
    b: &pf_element_batch,
    s: &ElementSizes,
    m: &MaterialSizes,
    first: bool,
) -> ElementBatch<'a> {
    let lanes = b.lanes as usize;
    let v = s.nodes * 3 * lanes;
    // SAFETY: every array has the length that plyflow.h gives it (the caller's promise); those that are written are apart from all others.
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

/// The slices of a batch of patches.
///
/// # Safety
/// As [`element_batch`], with a batch of patches.
unsafe fn patch_batch<'a>(
    b: &pf_patch_batch,
    s: &ElementSizes,
    m: &MaterialSizes,
    first: bool,
) -> PatchBatch<'a> {
    let lanes = b.lanes as usize;
    let v = s.patch_nodes * 3 * lanes;
    // SAFETY: as in `element_batch`.
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

/// Fills a struct of sizes that begins with the caller's own `size`: that many bytes of it are there. A caller that was
/// built before a field was added has no room for it.
///
/// # Safety
/// `out` must point to as many bytes as its first u64 says, `T` must be a C struct that begins with that u64.
unsafe fn hand_over<T: Copy>(given: &T, out: *mut T) {
    let head = size_of::<u64>();
    // SAFETY: `out` is there as far as its first u64 says (the caller's promise), `given` as far as `T` goes; what is copied ends at the nearer
    // of both, and the two are different structs. Bytes beyond `given`'s fields are none: sizes are structs of C without gaps.
    unsafe {
        let room = usize::try_from(out.cast::<u64>().read()).unwrap_or(usize::MAX);
        let bytes = size_of::<T>().min(room).saturating_sub(head);
        std::ptr::copy_nonoverlapping(
            std::ptr::from_ref(given).cast::<u8>().add(head),
            out.cast::<u8>().add(head),
            bytes,
        );
    }
}

/// What is told in 32 bits must fit there: the host makes the buffers.
fn fits(sizes: &[usize]) -> Result<(), String> {
    match sizes.iter().find(|s| u32::try_from(**s).is_err()) {
        Some(size) => Err(format!("a size of {size} is more than 32 bits tell")),
        None => Ok(()),
    }
}

fn guarded(f: impl FnOnce() -> i32) -> i32 {
    catch_unwind(AssertUnwindSafe(f)).unwrap_or(PF_PANIC)
}

/// Hands over what `f` makes, or the text of why it did not.
///
/// # Safety
/// `out` has room for a pointer, `error` is NULL or a whole struct; both are the caller's own for the call.
unsafe fn create_guarded<T>(
    out: *mut *mut c_void,
    error: *mut pf_error,
    f: impl FnOnce() -> Result<T, String>,
) -> i32 {
    let (code, text) = match catch_unwind(AssertUnwindSafe(f)) {
        Ok(Ok(value)) => {
            // SAFETY: room for a pointer (the caller's promise).
            unsafe { out.write(Box::into_raw(Box::new(value)).cast()) };
            return PF_OK;
        }
        Ok(Err(text)) => (PF_ERROR, text),
        Err(p) => (
            PF_PANIC,
            format!("the component panicked: {}", panic_text(p.as_ref())),
        ),
    };
    // SAFETY: the caller's promise.
    unsafe { tell(error, &text) };
    code
}

/// # Safety
/// `error` is NULL or a whole struct that is the caller's own.
unsafe fn tell(error: *mut pf_error, text: &str) {
    if !error.is_null() {
        // SAFETY: not NULL, so a whole struct (the caller's promise). Written as a whole first: in C it may begin as it lay in memory.
        unsafe {
            error.write(pf_error::default());
            (*error).set(text);
        }
    }
}

/// Writes the tape that `make` gives, if it gives one.
///
/// # Safety
/// `to` is NULL or a writer of the host, `error` NULL or a whole struct, both the caller's own for the call.
unsafe fn hand_tape(
    to: *const pf_writer,
    error: *mut pf_error,
    make: impl FnOnce() -> Result<Option<String>, String>,
) -> i32 {
    let (code, text) = match catch_unwind(AssertUnwindSafe(make)) {
        Ok(Ok(Some(_))) if to.is_null() => (PF_ERROR, "there is no writer (NULL)".to_owned()),
        Ok(Ok(Some(text))) => {
            // SAFETY: not NULL, so a writer (the caller's promise); the text is there for the call.
            unsafe { ((*to).write)((*to).host, pf_str::new(&text)) };
            return PF_OK;
        }
        Ok(Ok(None)) => return PF_NOT_FOUND,
        Ok(Err(text)) => (PF_ERROR, text),
        Err(p) => (
            PF_PANIC,
            format!("the component panicked: {}", panic_text(p.as_ref())),
        ),
    };
    // SAFETY: the caller's promise.
    unsafe { tell(error, &text) };
    code
}

/// An instance and a batch as a function of a table is given them.
///
/// # Safety
/// `instance` is one of `T` that was made by [`create_guarded`] and not ended, `batch` a whole struct, both for `'a`.
unsafe fn given<'a, T, B>(instance: *const c_void, batch: *const B) -> (&'a T, &'a B) {
    // SAFETY: the caller's promise; an instance does not change, so it may be shared by threads.
    unsafe { (&*instance.cast::<T>(), &*batch) }
}

/// Ends an instance; NULL is none.
///
/// # Safety
/// `instance` is NULL or one of `T` that was made by [`create_guarded`], which nobody uses any more.
unsafe fn end<T>(instance: *mut c_void) {
    guarded(|| {
        if !instance.is_null() {
            // SAFETY: the box that `create_guarded` gave away (the caller's promise).
            drop(unsafe { Box::from_raw(instance.cast::<T>()) });
        }
        PF_OK
    });
}

/// The function table of an [`Element`]. Long, as its entries are written inside, where nothing but the table can reach them.
pub const fn element_table<E: Element>() -> pf_element_functions {
    unsafe extern "C" fn create<E: Element>(
        parameters: pf_str,
        material: *const pf_material,
        out: *mut *mut c_void,
        error: *mut pf_error,
    ) -> i32 {
        let make = || {
            if material.is_null() {
                return Err("the element was given no material (NULL)".into());
            }
            // SAFETY: plyflow.h (see above): a material that outlives the instance, of which functions and instance may be kept.
            let material = unsafe { MaterialRef::new(*material) }?;
            // SAFETY: a text that is there for the call.
            let text = unsafe { parameters.as_str() }.map_err(|e| e.to_string())?;
            let element = E::create(text, &material)?;
            let sizes = element.sizes();
            fits(&[
                sizes.nodes,
                sizes.dofs_per_node,
                sizes.constants,
                sizes.history,
                sizes.material_points,
                sizes.fields,
                sizes.patch_nodes,
                sizes.patch_constants,
                sizes.patch_history,
                sizes.patch_fields,
            ])?;
            Ok(ElementInstance {
                element,
                material,
                sizes,
            })
        };
        // SAFETY: plyflow.h (see above): room for the instance, and for a text or none.
        unsafe { create_guarded(out, error, make) }
    }
    unsafe extern "C" fn destroy<E: Element>(instance: *mut c_void) {
        // SAFETY: plyflow.h (see above): an instance of this table, which the host has done with.
        unsafe { end::<ElementInstance<E>>(instance) }
    }
    unsafe extern "C" fn sizes<E: Element>(
        instance: *const c_void,
        out: *mut pf_element_sizes,
    ) -> i32 {
        // SAFETY: plyflow.h (see above): an instance of this table.
        let s = unsafe { &(*instance.cast::<ElementInstance<E>>()).sizes };
        let given = pf_element_sizes {
            size: 0,
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
        // SAFETY: plyflow.h (see above): a struct of sizes whose `size` says how much of it is there.
        unsafe { hand_over(&given, out) };
        PF_OK
    }
    unsafe extern "C" fn initialise<E: Element>(
        instance: *const c_void,
        batch: *const pf_element_batch,
    ) -> i32 {
        guarded(|| {
            // SAFETY: plyflow.h (see above): an instance of this table and a batch.
            let (i, batch) = unsafe { given::<ElementInstance<E>, _>(instance, batch) };
            // SAFETY: its arrays have the lengths of the instance's sizes; a call in which constants are written.
            let mut batch = unsafe { element_batch(batch, &i.sizes, &i.material.sizes, true) };
            i.element.initialise(&mut batch, &i.material);
            PF_OK
        })
    }
    unsafe extern "C" fn forces<E: Element>(
        instance: *const c_void,
        batch: *const pf_element_batch,
    ) -> i32 {
        guarded(|| {
            // SAFETY: plyflow.h (see above): an instance of this table and a batch.
            let (i, batch) = unsafe { given::<ElementInstance<E>, _>(instance, batch) };
            // SAFETY: its arrays have the lengths of the instance's sizes; a call in which constants are only read.
            let mut batch = unsafe { element_batch(batch, &i.sizes, &i.material.sizes, false) };
            i.element.forces(&mut batch, &i.material)
        })
    }
    unsafe extern "C" fn patch_initialise<E: Element>(
        instance: *const c_void,
        batch: *const pf_patch_batch,
    ) -> i32 {
        guarded(|| {
            // SAFETY: plyflow.h (see above): an instance of this table and a batch.
            let (i, batch) = unsafe { given::<ElementInstance<E>, _>(instance, batch) };
            // SAFETY: its arrays have the lengths of the instance's sizes; a call in which constants are written.
            let mut batch = unsafe { patch_batch(batch, &i.sizes, &i.material.sizes, true) };
            i.element.patch_initialise(&mut batch, &i.material);
            PF_OK
        })
    }
    unsafe extern "C" fn patch_forces<E: Element>(
        instance: *const c_void,
        batch: *const pf_patch_batch,
    ) -> i32 {
        guarded(|| {
            // SAFETY: plyflow.h (see above): an instance of this table and a batch.
            let (i, batch) = unsafe { given::<ElementInstance<E>, _>(instance, batch) };
            // SAFETY: its arrays have the lengths of the instance's sizes; a call in which constants are only read.
            let mut batch = unsafe { patch_batch(batch, &i.sizes, &i.material.sizes, false) };
            i.element.patch_forces(&mut batch, &i.material)
        })
    }
    unsafe extern "C" fn tape<E: Element>(
        instance: *const c_void,
        what: u32,
        count: u32,
        to: *const pf_writer,
        error: *mut pf_error,
    ) -> i32 {
        let make = || {
            // SAFETY: plyflow.h (see above): an instance of this table.
            let i = unsafe { &*instance.cast::<ElementInstance<E>>() };
            let what = match what {
                PF_TAPE_FORCES => ElementTape::Forces,
                PF_TAPE_PATCH_FORCES => ElementTape::PatchForces(count as usize),
                other => return Err(format!("an element has no function {other}")),
            };
            i.element.tape(what, &i.material.sizes)
        };
        // SAFETY: plyflow.h (see above): a writer, and room for a text or none.
        unsafe { hand_tape(to, error, make) }
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
        tape: Some(tape::<E>),
    }
}

struct MaterialInstance<M> {
    material: M,
    sizes: MaterialSizes,
}

/// A material in this process, behind its function table, as elements see it: without a library, for tests and for whoever looks at an element.
pub struct LocalMaterial<M> {
    seen: MaterialRef,
    // Where `seen` points to.
    instance: Box<MaterialInstance<M>>,
}

impl<M: Material> LocalMaterial<M> {
    const TABLE: &'static pf_material_functions = &material_table::<M>();

    /// Takes a material.
    ///
    /// # Errors
    /// When its sizes make no sense.
    pub fn new(material: M) -> Result<Self, String> {
        let sizes = material.sizes();
        fits(&[sizes.membrane_history, sizes.bending_history])?;
        let instance = Box::new(MaterialInstance { material, sizes });
        let raw = pf_material {
            functions: Self::TABLE,
            instance: std::ptr::from_ref(&*instance).cast(),
        };
        // SAFETY: the table of this type is there for ever, and the instance as long as what points to it, which cannot be copied.
        let seen = unsafe { MaterialRef::new(raw)? };
        Ok(Self { seen, instance })
    }

    /// As elements see it.
    pub fn seen(&self) -> &MaterialRef {
        &self.seen
    }

    /// The material.
    pub fn material(&self) -> &M {
        &self.instance.material
    }
}

/// The function table of a [`Material`]. Long, as it is written as [`element_table`].
pub const fn material_table<M: Material>() -> pf_material_functions {
    unsafe extern "C" fn create<M: Material>(
        parameters: pf_str,
        out: *mut *mut c_void,
        error: *mut pf_error,
    ) -> i32 {
        let make = || {
            // SAFETY: plyflow.h (see above): a text that is there for the call.
            let text = unsafe { parameters.as_str() }.map_err(|e| e.to_string())?;
            let material = M::create(text)?;
            let sizes = material.sizes();
            fits(&[sizes.membrane_history, sizes.bending_history])?;
            Ok(MaterialInstance { material, sizes })
        };
        // SAFETY: plyflow.h (see above): room for the instance, and for a text or none.
        unsafe { create_guarded(out, error, make) }
    }
    unsafe extern "C" fn destroy<M: Material>(instance: *mut c_void) {
        // SAFETY: plyflow.h (see above): an instance of this table, which the host has done with.
        unsafe { end::<MaterialInstance<M>>(instance) }
    }
    unsafe extern "C" fn sizes<M: Material>(
        instance: *const c_void,
        out: *mut pf_material_sizes,
    ) -> i32 {
        // SAFETY: plyflow.h (see above): an instance of this table.
        let s = unsafe { &(*instance.cast::<MaterialInstance<M>>()).sizes };
        let given = pf_material_sizes {
            size: 0,
            membrane_history: s.membrane_history as u32,
            bending_history: s.bending_history as u32,
            has_bending: u32::from(s.has_bending),
            reserved: 0,
            thickness: s.thickness,
            areal_mass: s.areal_mass,
        };
        // SAFETY: plyflow.h (see above): a struct of sizes whose `size` says how much of it is there.
        unsafe { hand_over(&given, out) };
        PF_OK
    }
    unsafe extern "C" fn membrane<M: Material>(
        instance: *const c_void,
        b: *const pf_membrane_batch,
    ) -> i32 {
        guarded(|| {
            // SAFETY: plyflow.h (see above): an instance of this table and a batch.
            let (i, b) = unsafe { given::<MaterialInstance<M>, _>(instance, b) };
            let lanes = b.lanes as usize;
            // SAFETY: its arrays have the lengths of the instance's sizes.
            let mut batch = unsafe {
                MembraneBatch {
                    lanes,
                    dt: b.dt,
                    metric: rows(b.metric, 3 * lanes),
                    history: rows_mut(b.history, i.sizes.membrane_history * lanes),
                    stress: rows_mut(b.stress, 3 * lanes),
                    energy: rows_mut(b.energy, lanes),
                    stiffness: some_mut(b.stiffness, 2 * lanes),
                }
            };
            i.material.membrane(&mut batch);
            PF_OK
        })
    }
    unsafe extern "C" fn bending<M: Material>(
        instance: *const c_void,
        b: *const pf_bending_batch,
    ) -> i32 {
        guarded(|| {
            // SAFETY: plyflow.h (see above): an instance of this table and a batch.
            let (i, b) = unsafe { given::<MaterialInstance<M>, _>(instance, b) };
            let lanes = b.lanes as usize;
            // SAFETY: its arrays have the lengths of the instance's sizes.
            let mut batch = unsafe {
                BendingBatch {
                    lanes,
                    dt: b.dt,
                    metric: rows(b.metric, 3 * lanes),
                    curvature: rows(b.curvature, 3 * lanes),
                    history: rows_mut(b.history, i.sizes.bending_history * lanes),
                    moment: rows_mut(b.moment, 3 * lanes),
                    energy: rows_mut(b.energy, lanes),
                    tangent: some_mut(b.tangent, 3 * lanes),
                }
            };
            i.material.bending(&mut batch);
            PF_OK
        })
    }
    unsafe extern "C" fn tape<M: Material>(
        instance: *const c_void,
        what: u32,
        to: *const pf_writer,
        error: *mut pf_error,
    ) -> i32 {
        let make = || {
            // SAFETY: plyflow.h (see above): an instance of this table.
            let i = unsafe { &*instance.cast::<MaterialInstance<M>>() };
            let what = match what {
                PF_TAPE_MEMBRANE => MaterialTape::Membrane,
                PF_TAPE_BENDING => MaterialTape::Bending,
                other => return Err(format!("a material has no function {other}")),
            };
            i.material.tape(what)
        };
        // SAFETY: plyflow.h (see above): a writer, and room for a text or none.
        unsafe { hand_tape(to, error, make) }
    }
    pf_material_functions {
        size: size_of::<pf_material_functions>() as u64,
        create: create::<M>,
        destroy: destroy::<M>,
        sizes: sizes::<M>,
        membrane: membrane::<M>,
        bending: Some(bending::<M>),
        tape: Some(tape::<M>),
    }
}
