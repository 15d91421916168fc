//! Instances of components behind the C ABI.

use crate::MechanicsError;
use plyflow_abi::*;
use plyflow_sdk::{ElementSizes, MaterialRef};
use std::ffi::c_void;
use std::sync::Arc;

/// Most nodes of a patch.
pub const MOST_PATCH_NODES: usize = 32;

/// One field of an element formulation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ElementField {
    /// Name.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// On node patches (points) instead of cells.
    pub patch: bool,
    /// Its row among the fields of cells, or of patches.
    pub row: usize,
    /// Of a sheet with two elements: its row among the cells' fields of the other one, if that has it.
    pub elsewhere: Option<usize>,
}

impl ElementField {
    /// Finds the row of a cells' field in the sheet's other element, which has the fields `others`.
    pub fn find_elsewhere(&mut self, others: &[Self]) {
        let same = |f: &&Self| !f.patch && !self.patch && f.name == self.name;
        self.elsewhere = others.iter().find(same).map(|f| f.row);
    }
}

/// The fields that an element's manifest declares, in the order of their rows; none when it is no JSON.
pub fn element_fields(manifest: &str) -> Vec<ElementField> {
    let value: serde_json::Value = serde_json::from_str(manifest).unwrap_or_default();
    let (mut cells, mut patches) = (0, 0);
    value["fields"]
        .as_array()
        .into_iter()
        .flatten()
        .map(|f| {
            let patch = f["patch"].as_bool().unwrap_or(false);
            let count = if patch { &mut patches } else { &mut cells };
            *count += 1;
            ElementField {
                name: f["name"].as_str().unwrap_or_default().into(),
                unit: f["unit"].as_str().unwrap_or("1").into(),
                patch,
                row: *count - 1,
                elsewhere: None,
            }
        })
        .collect()
}

/// A material made from its parameters.
pub struct MaterialInstance {
    reference: MaterialRef,
    functions: *const pf_material_functions,
    instance: *mut c_void,
}

// SAFETY: an instance does not change after `create`, several threads call it at once, and functions are static (plyflow.h). `destroy` comes last,
// from whichever thread drops it.
unsafe impl Send for MaterialInstance {}
// SAFETY: as for `Send`.
unsafe impl Sync for MaterialInstance {}

impl MaterialInstance {
    /// Makes an instance. `parameters` is JSON with SI numbers; `what` names it in errors.
    ///
    /// # Errors
    /// The component's own text when it refuses.
    ///
    /// # Safety
    /// If `component` says that it is a material, it must hold a material table that keeps to plyflow.h and outlives the instance.
    pub unsafe fn create(
        component: &pf_component,
        parameters: &str,
        what: &str,
    ) -> Result<Arc<Self>, MechanicsError> {
        let fail = |reason: String| MechanicsError::Component {
            what: what.to_owned(),
            reason,
        };
        if component.kind != PF_KIND_MATERIAL {
            return Err(fail("is not a material".into()));
        }
        let functions: *const pf_material_functions = component.functions.cast();
        let mut instance = std::ptr::null_mut();
        let mut error = pf_error::default();
        // SAFETY: a material, so this is its table (the caller's promise).
        let create = unsafe { (*functions).create };
        // SAFETY: a text, room for the instance and a whole `pf_error`, all of this function.
        let code = unsafe { create(pf_str::new(parameters), &raw mut instance, &raw mut error) };
        if code != PF_OK {
            return Err(fail(error.get()));
        }
        let raw = pf_material {
            functions,
            instance,
        };
        // SAFETY: the table, and the instance that it has just made: `Self` keeps both together with the reference, and ends the instance when it
        // is dropped.
        let reference = unsafe { MaterialRef::new(raw) }.map_err(|text| {
            if !instance.is_null() {
                // SAFETY: made above, and nobody else has it.
                unsafe { ((*functions).destroy)(instance) };
            }
            fail(text)
        })?;
        Ok(Arc::new(Self {
            reference,
            functions,
            instance,
        }))
    }

    /// The material as elements see it.
    pub fn reference(&self) -> &MaterialRef {
        &self.reference
    }
}

impl Drop for MaterialInstance {
    fn drop(&mut self) {
        // SAFETY: `create` has made the instance with this table. Elements hold their material by an `Arc`: nobody uses it any more.
        unsafe { ((*self.functions).destroy)(self.instance) };
    }
}

/// An element formulation made for a material.
pub struct ElementInstance {
    functions: *const pf_element_functions,
    instance: *mut c_void,
    /// Its sizes.
    pub sizes: ElementSizes,
    /// Its material.
    pub material: Arc<MaterialInstance>,
}

// SAFETY: as for `MaterialInstance`, whose contract is that of an element, too.
unsafe impl Send for ElementInstance {}
// SAFETY: as for `Send`.
unsafe impl Sync for ElementInstance {}

impl ElementInstance {
    /// Makes an instance for `material`. Long, as it looks at each thing that the solver takes for granted afterwards, one after the other.
    ///
    /// # Errors
    /// The component's own text, or sizes that the solver cannot serve.
    ///
    /// # Safety
    /// If `component` says that it is an element, it must hold an element table that keeps to plyflow.h and outlives the instance, and a manifest
    /// that can be read.
    pub unsafe fn create(
        component: &pf_component,
        parameters: &str,
        material: Arc<MaterialInstance>,
        what: &str,
    ) -> Result<Self, MechanicsError> {
        let fail = |reason: String| MechanicsError::Component {
            what: what.to_owned(),
            reason,
        };
        if component.kind != PF_KIND_ELEMENT {
            return Err(fail("is not an element formulation".into()));
        }
        let functions: *const pf_element_functions = component.functions.cast();
        let mut instance = std::ptr::null_mut();
        let mut error = pf_error::default();
        let raw: *const pf_material = material.reference.raw();
        // SAFETY: an element, so this is its table (the caller's promise). A text, room for the instance and a whole `pf_error`, all of this
        // function; the material is kept by `Self` as long as the instance.
        let code = unsafe {
            ((*functions).create)(
                pf_str::new(parameters),
                raw,
                &raw mut instance,
                &raw mut error,
            )
        };
        if code != PF_OK {
            return Err(fail(error.get()));
        }
        if instance.is_null() {
            let text = "returned PF_OK from `create` but left the instance NULL";
            return Err(fail(text.into()));
        }
        let mut s = pf_element_sizes {
            size: size_of::<pf_element_sizes>() as u64,
            ..Default::default()
        };
        // SAFETY: the instance that the table has just made; `s` is a whole struct, as its `size` says.
        let code = unsafe { ((*functions).sizes)(instance, &raw mut s) };
        let sizes = ElementSizes {
            nodes: s.nodes as usize,
            dofs_per_node: s.dofs_per_node as usize,
            constants: s.constants as usize,
            history: s.history as usize,
            material_points: s.material_points as usize,
            fields: s.fields as usize,
            patch_nodes: s.patch_nodes as usize,
            patch_constants: s.patch_constants as usize,
            patch_history: s.patch_history as usize,
            patch_fields: s.patch_fields as usize,
            ignores_velocity: s.ignores_velocity != 0,
        };
        let made = Self {
            functions,
            instance,
            sizes,
            material,
        };
        if code != PF_OK {
            return Err(fail(format!("did not tell its sizes (code {code})")));
        }
        // Fields are read by the rows that the manifest gives them.
        // SAFETY: the component's manifest (the caller's promise).
        let manifest = unsafe { component.manifest.as_str() }.unwrap_or("{}");
        let declared = element_fields(manifest);
        let count = |patch| declared.iter().filter(|f| f.patch == patch).count();
        for (patch, told, kind) in [
            (false, sizes.fields, "fields"),
            (true, sizes.patch_fields, "patch fields"),
        ] {
            if count(patch) > told {
                return Err(fail(format!(
                    "declares {} {kind} in its manifest and tells {told} in its sizes; expected as many",
                    count(patch)
                )));
            }
        }
        if sizes.nodes != 4 {
            return Err(fail(format!(
                "has {} nodes; this solver takes quads",
                sizes.nodes
            )));
        }
        if !matches!(sizes.dofs_per_node, 3 | 6) {
            return Err(fail(format!(
                "has {} degrees of freedom per node; this solver carries 3 (translations) or 6 \
                 (and rotations)",
                sizes.dofs_per_node
            )));
        }
        // SAFETY: the caller's table.
        let patches = unsafe {
            (*functions).patch_initialise.is_some() && (*functions).patch_forces.is_some()
        };
        if sizes.patch_nodes > 0 && !patches {
            return Err(fail(
                "declares patch nodes but has no patch functions".into(),
            ));
        }
        if sizes.patch_nodes > MOST_PATCH_NODES {
            return Err(fail(format!(
                "declares patches of {} nodes; this solver takes at most {MOST_PATCH_NODES}",
                sizes.patch_nodes
            )));
        }
        Ok(made)
    }

    /// Whether its nodes rotate.
    pub fn rotates(&self) -> bool {
        self.sizes.dofs_per_node == 6
    }

    /// Calls the function of that name.
    ///
    /// # Safety
    /// The batch has all that plyflow.h asks of the call: `LANES` lanes, every array that it names for this call and none else, each
    /// 64-byte aligned, as long as [`Self::sizes`] and its material's sizes make it, there for the call; none that is written may be
    /// borrowed by anybody else.
    pub(crate) unsafe fn initialise(&self, batch: &pf_element_batch) -> i32 {
        // SAFETY: instance and table live as long as `self` (`create`); the batch is the caller's promise.
        unsafe { ((*self.functions).initialise)(self.instance, batch) }
    }

    /// Calls the function of that name.
    ///
    /// # Safety
    /// As [`Self::initialise`]; constants are only read, and may be shared.
    #[inline]
    pub(crate) unsafe fn forces(&self, batch: &pf_element_batch) -> i32 {
        // SAFETY: as in `initialise`.
        unsafe { ((*self.functions).forces)(self.instance, batch) }
    }

    /// Calls the function of that name, if there is one.
    ///
    /// # Safety
    /// As [`Self::initialise`].
    pub(crate) unsafe fn patch_initialise(&self, batch: &pf_patch_batch) -> i32 {
        // SAFETY: the table lives as long as `self` (`create`).
        match unsafe { (*self.functions).patch_initialise } {
            // SAFETY: as in `initialise`.
            Some(f) => unsafe { f(self.instance, batch) },
            None => PF_OK,
        }
    }

    /// Calls the function of that name, if there is one.
    ///
    /// # Safety
    /// As [`Self::forces`].
    #[inline]
    pub(crate) unsafe fn patch_forces(&self, batch: &pf_patch_batch) -> i32 {
        // SAFETY: the table lives as long as `self` (`create`).
        match unsafe { (*self.functions).patch_forces } {
            // SAFETY: as in `initialise`.
            Some(f) => unsafe { f(self.instance, batch) },
            None => PF_OK,
        }
    }
}

impl Drop for ElementInstance {
    fn drop(&mut self) {
        // SAFETY: `create` has made the instance with this table, and `self` is its only owner. Its material is dropped after it.
        unsafe { ((*self.functions).destroy)(self.instance) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_sdk::{Element, ElementBatch, Material, MaterialSizes, MembraneBatch};

    struct Sheet;

    impl Material for Sheet {
        const MANIFEST: &'static str = "{}";

        fn create(_: &str) -> Result<Self, String> {
            Ok(Self)
        }

        fn sizes(&self) -> MaterialSizes {
            MaterialSizes {
                thickness: 1e-3,
                areal_mass: 1.0,
                ..Default::default()
            }
        }

        fn membrane(&self, _: &mut MembraneBatch<'_>) {}
    }

    struct Quad;

    impl Element for Quad {
        const MANIFEST: &'static str = "{}";

        fn create(_: &str, _: &MaterialRef) -> Result<Self, String> {
            Ok(Self)
        }

        fn sizes(&self) -> ElementSizes {
            ElementSizes {
                nodes: 4,
                dofs_per_node: 3,
                ..Default::default()
            }
        }

        fn initialise(&self, _: &mut ElementBatch<'_>, _: &MaterialRef) {}

        fn forces(&self, _: &mut ElementBatch<'_>, _: &MaterialRef) -> i32 {
            PF_OK
        }
    }

    extern "C" fn forgetful(
        _: pf_str,
        _: *const pf_material,
        _: *mut *mut c_void,
        _: *mut pf_error,
    ) -> i32 {
        PF_OK
    }

    #[test]
    fn an_element_that_says_ok_and_leaves_no_instance_is_refused() {
        let component = |kind, functions| pf_component {
            kind,
            reserved: 0,
            functions,
            manifest: pf_str::new("{}"),
        };
        let sheet = plyflow_sdk::material_table::<Sheet>();
        let sheet = component(PF_KIND_MATERIAL, (&raw const sheet).cast());
        // SAFETY: the table of a material, which lives to the end of the test.
        let material = unsafe { MaterialInstance::create(&sheet, "{}", "sheet") };
        let material = material.expect("a material");
        let mut quad = plyflow_sdk::element_table::<Quad>();
        let make = |table: &pf_element_functions| {
            let quad = component(PF_KIND_ELEMENT, std::ptr::from_ref(table).cast());
            // SAFETY: the table of an element, which lives to the end of the test; in one case its `create` makes no instance, which is looked at
            // before anything is done with it.
            unsafe { ElementInstance::create(&quad, "{}", Arc::clone(&material), "quad") }
        };
        assert!(make(&quad).is_ok());
        quad.create = forgetful;
        let refused = make(&quad).map(|_| ()).expect_err("a NULL instance");
        assert!(refused.to_string().contains("NULL"), "{refused}");
    }
}
