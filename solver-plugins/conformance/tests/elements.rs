//! The repository's own components keep the contract; a faulty element is found out.

use plyflow_conformance::{Finding, check_element, check_material};
use plyflow_kernels::m4::M4;
use plyflow_kernels::marlow::Marlow;
use plyflow_sdk::abi::*;
use plyflow_sdk::{
    Element, ElementBatch, ElementSizes, MaterialRef, element_table, material_table,
};

const FILM: &str = r#"{"uniaxial": {"amplitude": 5e6, "growth": 0.5, "decay": 5.0},
                       "thickness": 8e-5, "areal_mass": 0.09}"#;

fn with_film<E: Element>(parameters: &str) -> Vec<Finding> {
    let (materials, elements) = (material_table::<Marlow>(), element_table::<E>());
    let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
    let code = unsafe { (materials.create)(pf_str::new(FILM), &raw mut instance, &raw mut error) };
    assert_eq!(code, PF_OK, "{}", error.get());
    let material = pf_material {
        functions: &raw const materials,
        instance,
    };
    let found = unsafe { check_element(&raw const elements, parameters, &material) };
    unsafe { (materials.destroy)(instance) };
    found
}

#[test]
fn nothing_is_found_in_the_film_material() {
    let table = material_table::<Marlow>();
    assert_eq!(unsafe { check_material(&raw const table, FILM) }, []);
}

#[test]
fn nothing_is_found_in_the_membrane_element() {
    assert_eq!(with_film::<M4>("{}"), []);
}

/// M4 whose forces miss a part along x: no derivative of the energy, and not turning with the element.
struct Biased(M4);

impl Element for Biased {
    const MANIFEST: &'static str = M4::MANIFEST;

    fn create(parameters: &str, material: &MaterialRef) -> Result<Self, String> {
        M4::create(parameters, material).map(Self)
    }

    fn sizes(&self) -> ElementSizes {
        self.0.sizes()
    }

    fn initialise(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) {
        self.0.initialise(batch, material);
    }

    fn forces(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32 {
        let code = self.0.forces(batch, material);
        let lanes = batch.lanes;
        batch.force[..lanes].iter_mut().for_each(|f| *f *= 0.99);
        code
    }
}

#[test]
fn forces_that_are_no_derivative_are_found() {
    let checks: Vec<&str> = with_film::<Biased>("{}").iter().map(|f| f.check).collect();
    assert!(checks.contains(&"balance"), "{checks:?}");
    assert!(checks.contains(&"frame-invariance"), "{checks:?}");
    assert!(checks.contains(&"derivative"), "{checks:?}");
}
