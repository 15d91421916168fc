//! The one list of Plyflow's own components: tests, benches and end-to-end runs read it, so that a new element or material is named here
//! and nowhere else.

use plyflow_sdk::abi::{PF_KIND_ELEMENT, PF_KIND_MATERIAL, pf_component, pf_str};
use plyflow_sdk::{Element, Material, element_table, material_table};
use std::sync::LazyLock;

/// A component that comes along with Plyflow.
#[derive(Clone, Copy)]
pub struct BuiltIn {
    /// As in its manifest.
    pub name: &'static str,
    /// The manifest.
    pub manifest: &'static str,
    /// [`PF_KIND_ELEMENT`] or [`PF_KIND_MATERIAL`].
    pub kind: u32,
    /// Makes its function table, which lives as long as the program.
    table: fn() -> *const std::ffi::c_void,
}

fn element<T: Element>(name: &'static str) -> BuiltIn {
    BuiltIn {
        name,
        manifest: T::MANIFEST,
        kind: PF_KIND_ELEMENT,
        table: || std::ptr::from_ref(Box::leak(Box::new(element_table::<T>()))).cast(),
    }
}

fn material<T: Material>(name: &'static str) -> BuiltIn {
    BuiltIn {
        name,
        manifest: T::MANIFEST,
        kind: PF_KIND_MATERIAL,
        table: || std::ptr::from_ref(Box::leak(Box::new(material_table::<T>()))).cast(),
    }
}

static LIST: LazyLock<[BuiltIn; 8]> = LazyLock::new(|| {
    [
        element::<crate::m4::M4>("m4"),
        element::<crate::m4f::M4f>("m4f"),
        element::<crate::rf4::Rf4>("rf4"),
        element::<crate::s4::S4>("s4"),
        material::<crate::fabric::Fabric>("material-fabric"),
        material::<crate::fabric_linear::FabricLinear>("fabric-linear"),
        material::<crate::isotropic::Isotropic>("material-isotropic"),
        material::<crate::marlow::Marlow>("material-marlow"),
    ]
});

/// All of them: elements, then materials.
pub fn all() -> &'static [BuiltIn] {
    &*LIST
}

/// The elements.
pub fn elements() -> impl Iterator<Item = &'static BuiltIn> {
    all().iter().filter(|c| c.kind == PF_KIND_ELEMENT)
}

/// The materials.
pub fn materials() -> impl Iterator<Item = &'static BuiltIn> {
    all().iter().filter(|c| c.kind == PF_KIND_MATERIAL)
}

/// What a host hands out when a step asks for a component by name, without loading a library. Each call keeps a table for the rest of the
/// program: for tests and benches.
pub fn component(kind: u32, name: &str) -> Option<pf_component> {
    let found = all().iter().find(|c| c.kind == kind && c.name == name)?;
    Some(pf_component {
        kind,
        reserved: 0,
        functions: (found.table)(),
        manifest: pf_str::new(found.manifest),
    })
}
