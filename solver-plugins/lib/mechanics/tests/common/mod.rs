//! A fabric for tests, behind the C ABI.

#[allow(dead_code)]
pub mod slave;

use plyflow_abi::{PF_KIND_ELEMENT, PF_KIND_MATERIAL, pf_component, pf_str};
use plyflow_kernels::{fabric::Fabric, m4::M4, s4::S4};
use plyflow_mechanics::component::{ElementInstance, MaterialInstance};
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::sheet::{Pressed, SheetSpec};
use plyflow_sdk::{Element, element_table, material_table};

/// 1e5 N/m along the fibres, 1 kg/m2.
const FABRIC: &str =
    r#"{"fibre_modulus":1e8,"shear":{"coefficients":[0,1000]},"thickness":1e-3,"areal_mass":1.0}"#;

/// One with a stitch that fails and with bending.
pub const STITCHED: &str = r#"{"fibre_modulus":1e8,"shear":{"coefficients":[0,1000]},"thickness":1e-3,"areal_mass":1.0,
    "stitch":{"angles":[0.01,0.05,0.1],"forces":[0,880,0]},"bending":{"positive":{"linear":1e-3},"negative":{"linear":1e-3}}}"#;

fn component<T>(kind: u32, table: T) -> pf_component {
    pf_component {
        kind,
        reserved: 0,
        // Lives as long as the process: a test.
        functions: (&raw const *Box::leak(Box::new(table))).cast(),
        manifest: pf_str::new("{}"),
    }
}

/// An element of a fabric given by its parameters.
#[allow(dead_code)]
pub fn instance<E: Element>(fabric: &str) -> ElementInstance {
    // SAFETY: tables of the kinds that are said, which are never freed.
    unsafe {
        let material = component(PF_KIND_MATERIAL, material_table::<Fabric>());
        let material = MaterialInstance::create(&material, fabric, "material").unwrap();
        let element = component(PF_KIND_ELEMENT, element_table::<E>());
        ElementInstance::create(&element, "{}", material, "element").unwrap()
    }
}

/// `m4` of the fabric.
#[allow(dead_code)]
pub fn membrane() -> ElementInstance {
    instance::<M4>(FABRIC)
}

/// `s4` of a fabric with a stitch that fails, and with bending stiffness: everything that has a history.
#[allow(dead_code)]
pub fn shell() -> ElementInstance {
    instance::<S4>(STITCHED)
}

/// `s4` of a fabric that resists bending enough to fold in an arc of some millimetres.
#[allow(dead_code)]
pub fn stiff_shell() -> ElementInstance {
    instance::<S4>(
        r#"{"fibre_modulus":1e8,"shear":{"coefficients":[0,1000]},"thickness":1e-3,"areal_mass":1.0,
            "bending":{"positive":{"linear":5e-3},"negative":{"linear":5e-3}}}"#,
    )
}

/// `rf4` of a fabric that resists bending, more along the second family.
#[allow(dead_code)]
pub fn rotation_free() -> ElementInstance {
    instance::<plyflow_kernels::rf4::Rf4>(
        r#"{"fibre_modulus":1e8,"shear":{"coefficients":[0,1000]},"thickness":1e-3,"areal_mass":1.0,
            "bending":{"positive":{"linear":5e-3},"negative":{"linear":5e-3}}}"#,
    )
}

/// A sheet of the whole mesh with its first axis along x; its nodes follow `first` of the model, and nothing presses on it.
#[allow(dead_code)]
pub fn sheet(name: &str, mesh: &QuadMesh, first: u32, element: ElementInstance) -> SheetSpec {
    let m = mesh.cells.len();
    SheetSpec {
        name: name.into(),
        nodes: (first..first + mesh.points.len() as u32).collect(),
        cells: mesh.cells.clone(),
        patches: Vec::new(),
        axis: [1.0, 0.0, 0.0],
        steered: None,
        layers: vec![1.0; m],
        pressed: vec![Pressed::No; m],
        least_areal_mass: vec![0.0; m],
        element,
        elsewhere: None,
        other_material: None,
    }
}
