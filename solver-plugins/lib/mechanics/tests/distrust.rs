//! What elements of others may get wrong, and what becomes of it.

mod common;

use plyflow_abi::{PF_ERROR, PF_KIND_ELEMENT, PF_KIND_MATERIAL, PF_OK, pf_component, pf_str};
use plyflow_kernels::{fabric::Fabric, rf4::Rf4};
use plyflow_mechanics::component::{ElementInstance, MaterialInstance};
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::{Model, StepSettings};
use plyflow_mechanics::sheet::SheetSpec;
use plyflow_sdk::{
    Element, ElementBatch, ElementSizes, MaterialRef, PatchBatch, element_table, material_table,
};

/// `rf4` with one of these faults, which it has off the plane of its reference alone.
struct Faulty<const FAULT: u8>(Rf4);

const NO_STEP: u8 = 0;
const NO_ROWS: u8 = 1;
const REFUSES: u8 = 2;
const NONE: u8 = 3;

impl<const FAULT: u8> Element for Faulty<FAULT> {
    const MANIFEST: &'static str = Rf4::MANIFEST;

    fn create(parameters: &str, material: &MaterialRef) -> Result<Self, String> {
        Rf4::create(parameters, material).map(Self)
    }

    fn sizes(&self) -> ElementSizes {
        self.0.sizes()
    }

    fn initialise(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) {
        self.0.initialise(batch, material);
    }

    fn forces(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32 {
        let code = self.0.forces(batch, material);
        let off = batch.position[2 * batch.lanes] > 0.0;
        if let (NO_STEP, true, Some(step)) = (FAULT, off, batch.critical_step.as_deref_mut()) {
            step[3] = f64::NAN;
        }
        code
    }

    fn patch_initialise(&self, batch: &mut PatchBatch<'_>, material: &MaterialRef) {
        self.0.patch_initialise(batch, material);
    }

    fn patch_forces(&self, batch: &mut PatchBatch<'_>, material: &MaterialRef) -> i32 {
        let code = self.0.patch_forces(batch, material);
        let off = batch.position[2 * batch.lanes] > 0.0;
        match (FAULT, off, batch.stiffness.as_deref_mut()) {
            (NO_ROWS, true, Some(rows)) => rows[2] = f64::NAN,
            (REFUSES, true, _) => return PF_ERROR,
            _ => {}
        }
        code
    }
}

fn critical_step<const FAULT: u8>() -> f64 {
    let element = common::instance::<Faulty<FAULT>>(common::STITCHED);
    let mesh = QuadMesh::grid(&even_axis(0.0, 0.06, 0.01), &even_axis(0.0, 0.05, 0.01));
    let spec = SheetSpec {
        patches: mesh.patches(),
        ..common::sheet("sheet", &mesh, 0, element)
    };
    let settings = StepSettings {
        target_step: 1e-6,
        safety: 0.8,
        damping: 0.0,
    };
    let mut model = Model::new(mesh.points.clone(), vec![spec], settings).unwrap();
    assert!(model.critical_step().unwrap() > 1e-6);
    model.x_mut().iter_mut().for_each(|x| x[2] = 1e-3);
    model.critical_step().unwrap()
}

#[test]
fn a_bound_that_is_none_allows_no_step() {
    assert!(critical_step::<NONE>() > 1e-6);
    assert_eq!(critical_step::<NO_STEP>(), 0.0);
    assert_eq!(critical_step::<NO_ROWS>(), 0.0);
    assert_eq!(critical_step::<REFUSES>(), 0.0);
}

#[test]
fn an_element_that_declares_more_fields_than_its_sizes_tell_is_refused() {
    // SAFETY: tables of the kinds that are said, and manifests, which are never freed.
    let create = |manifest: &'static str| unsafe {
        let component = |kind, functions, manifest| pf_component {
            kind,
            reserved: 0,
            functions,
            manifest: pf_str::new(manifest),
        };
        let fabric = Box::leak(Box::new(material_table::<Fabric>()));
        let fabric = component(PF_KIND_MATERIAL, (&raw const *fabric).cast(), "{}");
        let material = MaterialInstance::create(&fabric, common::STITCHED, "fabric").unwrap();
        let element = Box::leak(Box::new(element_table::<Rf4>()));
        let element = component(PF_KIND_ELEMENT, (&raw const *element).cast(), manifest);
        ElementInstance::create(&element, "{}", material, "element").map(|_| PF_OK)
    };
    assert_eq!(create(Rf4::MANIFEST).ok(), Some(PF_OK));
    let field = r#"{"name": "f", "unit": "1", "patch": true},"#;
    let more = Rf4::MANIFEST.replacen(
        "\"fields\": [",
        &format!("\"fields\": [{}", field.repeat(9)),
        1,
    );
    let e = create(more.leak()).unwrap_err().to_string();
    assert!(e.contains("patch fields in its manifest and tells"), "{e}");
}
