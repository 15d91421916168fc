//! Materials and calls that the tests share.
#![allow(dead_code)]

use plyflow_conformance::{Check, Outcome, Silent, check_element, check_material, failed};
use plyflow_kernels::fabric::Fabric;
use plyflow_kernels::marlow::Marlow;
use plyflow_sdk::abi::*;
use plyflow_sdk::{Element, Material, element_table, material_table};

/// StretchLon HT-350 of workflows/materials, SI.
pub const FILM: &str = r#"{"uniaxial": {"amplitude": 6.364e6, "growth": 0.4451, "decay": 7.545},
    "limit": 5.0, "thickness": 8e-5, "areal_mass": 0.08}"#;

/// An aluminium foil, SI.
pub const ISOTROPIC: &str =
    r#"{"youngs_modulus": 7e10, "poisson_ratio": 0.33, "thickness": 2e-4, "areal_mass": 0.54}"#;

/// A ply with constant moduli, SI.
pub const LINEAR: &str = r#"{"fibre_modulus_1": 3e9, "fibre_modulus_2": 1e9, "shear_modulus": 4e5, "thickness": 4e-4,
    "areal_mass": 0.4, "bending": {"family_1": 4e-4, "family_2": 2e-4, "twist": 1e-4}}"#;

/// NCF FCIM359 of workflows/materials, SI, in one of the two forms.
pub fn ncf(form: &str) -> String {
    r#"{"form": "FORM", "fibre_modulus": 3e9,
        "shear": {"coefficients": [0.0, 112.19, 94.73, 137.06, -65.56, 29.56]},
        "stitch": {"angles": [0.06, 0.5, 0.75], "forces": [0.0, 880.0, 0.0]},
        "bending": {"positive": {"linear": 1.9457e-4, "asymptote": 0.03139, "scale": 4.0},
                    "negative": {"linear": 1.0279e-4, "asymptote": 0.03619, "scale": 6.5},
                    "positive_face": "up", "families": "opposite"},
        "thickness": 4e-4, "areal_mass": 0.44}"#
        .replace("FORM", form)
}

/// Woven 38616 of workflows/materials, SI: a polynomial whose energy is a difference of large terms.
pub const WOVEN: &str = r#"{"form": "fibre-energy", "fibre_modulus": 3e9,
    "shear": {"coefficients": [0.0, 37.35, -322.61, 1458.51, -3539.56, 4727.84, -3275.20, 930.53]},
    "bending": {"positive": {"linear": 1.549e-5, "asymptote": 0.00757, "scale": 20.0}},
    "thickness": 3e-4, "areal_mass": 0.21}"#;

/// The film's curve in a few straight pieces.
pub const TABULATED_FILM: &str = r#"{"uniaxial": {"strains": [0.0, 0.029, 0.098, 0.255, 0.748, 1.95, 5.0],
        "stresses": [0.0, 1.3333e6, 3.6096e6, 6.1996e6, 8.8556e6, 15.1591e6, 58.9186e6]},
    "thickness": 8e-5, "areal_mass": 0.08}"#;

/// As many kinks as a fabric can have: fibres that are soft in compression, a law for each sign of shear, a stitch that
/// fails in negative shear, tabulated moments.
pub const KINKED: &str = r#"{"form": "fibre-energy", "fibre_modulus": 3e9, "compression_factor": 0.1,
    "shear": {"table": {"angles": [0.0, 0.1, 0.3, 0.6, 0.9], "forces": [0.0, 10.0, 30.0, 90.0, 300.0]},
              "negative": {"coefficients": [0.0, 112.19, 94.73], "limit": 0.8}},
    "stitch": {"direction": "negative", "angles": [0.06, 0.4, 0.7], "forces": [0.0, 500.0, 0.0]},
    "bending": {"positive": {"table": {"curvatures": [0.0, 10.0, 60.0, 200.0], "moments": [0.0, 0.01, 0.03, 0.06]}},
                "negative": {"linear": 1e-4, "asymptote": 0.03, "scale": 6.0}, "families": "opposite"},
    "thickness": 4e-4, "areal_mass": 0.44}"#;

/// Fibres that buckle within the ply, of a curve for each family; rubbing yarns beside them.
pub const CRUSHED: &str = r#"{"form": "fibre-energy", "fibre_modulus": 3e9,
    "compression": {"table": {"strains": [0.0, 0.001, 0.003, 0.01, 0.05], "stresses": [0.0, 3e6, 4.5e6, 5e6, 5.2e6]}},
    "compression_2": {"table": {"strains": [0.0, 0.002, 0.02], "stresses": [0.0, 1e6, 3e6]}},
    "shear": {"coefficients": [0.0, 112.19, 94.73], "limit": 0.8, "hysteresis": {"force": 8.0, "angle": 0.05, "per_tension": 1e-3}},
    "bending": {"positive": {"linear": 1e-4, "asymptote": 0.03, "scale": 6.0}},
    "thickness": 4e-4, "areal_mass": 0.44}"#;

/// Checks of a material.
pub fn of_material<M: Material>(parameters: &str) -> Vec<Check> {
    let table = material_table::<M>();
    // SAFETY: a whole table, which lives through the call.
    unsafe { check_material(&raw const table, parameters, &mut Silent) }
}

/// Checks of an element with a material.
pub fn of_element<E: Element, M: Material>(with: &str, material: &str) -> Vec<Check> {
    let (materials, elements) = (material_table::<M>(), element_table::<E>());
    let (mut instance, mut error) = (std::ptr::null_mut(), pf_error::default());
    let text = pf_str::new(material);
    // SAFETY: a text, room for the instance and a whole `pf_error`.
    let code = unsafe { (materials.create)(text, &raw mut instance, &raw mut error) };
    assert_eq!(code, PF_OK, "{}", error.get());
    let raw = pf_material {
        functions: &raw const materials,
        instance,
    };
    // SAFETY: a whole table and a material that has just been made, both alive through the call.
    let found = unsafe { check_element(&raw const elements, with, None, &raw, &mut Silent) };
    // SAFETY: made above, ended once; the elements that had it are gone.
    unsafe { (materials.destroy)(instance) };
    found
}

/// With the film.
pub fn with_film<E: Element>(with: &str) -> Vec<Check> {
    of_element::<E, Marlow>(with, FILM)
}

/// With the fabric in a form.
pub fn with_fabric<E: Element>(with: &str, form: &str) -> Vec<Check> {
    of_element::<E, Fabric>(with, &ncf(form))
}

/// Demands that nothing failed, and that these checks were really made.
pub fn sound(checks: &[Check], made: &[&str]) {
    for c in checks {
        println!("{:?} {:26} {}", c.outcome, c.rule.name, c.seen);
    }
    assert_eq!(failed(checks), [""; 0]);
    for name in made {
        let passed = |c: &&Check| c.rule.name == *name && c.outcome == Outcome::Passed;
        assert!(checks.iter().any(|c| passed(&c)), "{name} was not checked");
    }
}
