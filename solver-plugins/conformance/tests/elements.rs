//! The repository's own elements keep the contract; a faulty element is found out by the check that is meant
//! for its fault.

mod common;

use common::{sound, with_fabric, with_film};
use plyflow_conformance::failed;
use plyflow_kernels::m4::M4;
use plyflow_kernels::rf4::Rf4;
use plyflow_sdk::{Element, ElementBatch, ElementSizes, MaterialRef};

const MEMBRANE: [&str; 13] = [
    "create",
    "sizes",
    "status",
    "guard-zones",
    "complete",
    "finite",
    "batch-independence",
    "threads",
    "mass",
    "balance",
    "frame-invariance",
    "energy",
    "critical-step",
];
const PATCH: [&str; 5] = [
    "patch-complete",
    "patch-batch-independence",
    "patch-frame-invariance",
    "patch-energy",
    "patch-stiffness",
];

#[test]
fn nothing_is_found_in_the_membrane_element_with_film_and_with_fabric() {
    sound(&with_film::<M4>("{}"), &MEMBRANE);
    for form in ["fibre-energy", "hypoelastic"] {
        let checks = with_fabric::<M4>("{}", form);
        sound(&checks, &MEMBRANE);
        sound(&checks, &["work"]);
    }
}

#[test]
fn nothing_is_found_in_the_rotation_free_shell_with_film_and_with_fabric() {
    sound(&with_film::<Rf4>("{}"), &MEMBRANE);
    let checks = with_fabric::<Rf4>("{}", "fibre-energy");
    sound(&checks, &MEMBRANE);
    sound(&checks, &PATCH);
}
