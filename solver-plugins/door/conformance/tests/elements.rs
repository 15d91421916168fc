//! The repository's own elements keep the contract; a faulty element is found out by the check that is meant
//! for its fault.

mod common;

use common::{ISOTROPIC, WOVEN, of_element, sound, with_fabric, with_film};
use plyflow_conformance::failed;
use plyflow_kernels::fabric::Fabric;
use plyflow_kernels::isotropic::Isotropic;
use plyflow_kernels::m4::M4;
use plyflow_kernels::m4f::M4f;
use plyflow_kernels::rf4::Rf4;
use plyflow_kernels::s4::S4;
use plyflow_sdk::{Element, ElementBatch, ElementSizes, MaterialRef, PatchBatch};

const MEMBRANE: [&str; 14] = [
    "create",
    "sizes",
    "status",
    "guard-zones",
    "complete",
    "finite",
    "batch-independence",
    "threads",
    "tape",
    "mass",
    "balance",
    "frame-invariance",
    "energy",
    "critical-step",
];
const PATCH: [&str; 9] = [
    "patch-complete",
    "patch-repeatable",
    "patch-batch-independence",
    "patch-asking",
    "patch-threads",
    "patch-tape",
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
fn nothing_is_found_in_the_fully_integrated_membrane_with_film_and_with_fabric() {
    sound(&with_film::<M4f>("{}"), &MEMBRANE);
    for form in ["fibre-energy", "hypoelastic"] {
        sound(
            &with_fabric::<M4f>(r#"{"fibres_along_sides": true}"#, form),
            &MEMBRANE,
        );
    }
}

#[test]
fn nothing_is_found_in_the_rotation_free_shell_with_film_and_with_fabric() {
    sound(&with_film::<Rf4>("{}"), &MEMBRANE);
    for with in ["{}", r#"{"thickening": 2}"#] {
        let checks = with_fabric::<Rf4>(with, "fibre-energy");
        sound(&checks, &MEMBRANE);
        sound(&checks, &PATCH);
    }
}

#[test]
fn nothing_is_found_in_the_shell_with_rotations_with_every_kind_of_law() {
    let refused = with_film::<S4>("{}");
    assert_eq!(refused.len(), 1, "a film has no bending");
    assert!(refused[0].seen.contains("bending"), "{}", refused[0].seen);
    let total = r#"{"bending": "total"}"#;
    let thick = r#"{"bending": "total", "thickening": 2}"#;
    for with in ["{}", total, thick] {
        for form in ["fibre-energy", "hypoelastic"] {
            let checks = with_fabric::<S4>(with, form);
            sound(&checks, &MEMBRANE);
            sound(&checks, &["work"]);
        }
    }
    sound(&of_element::<S4, Fabric>("{}", WOVEN), &MEMBRANE);
    let checks =
        of_element::<S4, Isotropic>(r#"{"bending": "total", "twist": "material"}"#, ISOTROPIC);
    sound(&checks, &MEMBRANE);
}

/// What only an element with rotations can do wrong.
const DEAF: u8 = 0;
const SIGN: u8 = 1;
const SOFT: u8 = 2;
const WEIGHTLESS: u8 = 3;
const DRILLING: u8 = 4;
/// Says that it does not read the velocity, and reads it.
const READS_VELOCITY: u8 = 5;

/// Takes a short way, with other bits, when all lanes turn little.
const HASTY: u8 = 6;
/// The same when all but one in eight do.
const HASTY_WITH_MOST: u8 = 7;

/// Of a batch of the most lanes.
static STILL: [f64; 12 * 64] = [0.0; 12 * 64];

/// S4 with one of these faults.
struct Faulty<const FAULT: u8>(S4);

impl<const FAULT: u8> Element for Faulty<FAULT> {
    const MANIFEST: &'static str = S4::MANIFEST;

    fn create(parameters: &str, material: &MaterialRef) -> Result<Self, String> {
        S4::create(parameters, material).map(Self)
    }

    fn sizes(&self) -> ElementSizes {
        self.0.sizes()
    }

    fn initialise(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) {
        self.0.initialise(batch, material);
        if FAULT == WEIGHTLESS {
            batch.inertia.fill(0.0);
        }
    }

    fn forces(&self, batch: &mut ElementBatch<'_>, material: &MaterialRef) -> i32 {
        if FAULT == READS_VELOCITY {
            batch.energy[0] += 0.0 * batch.velocity[0];
        }
        if FAULT == DEAF {
            batch.spin = &STILL[..batch.spin.len()];
        }
        let spin: Vec<f64> = batch.spin.to_vec();
        let code = self.0.forces(batch, material);
        let lanes = batch.lanes;
        let slow = |l: &usize| (0..12).all(|r| spin[r * lanes + l].abs() * batch.dt < 0.03);
        let hasty = (0..lanes).step_by(8).map(|c| {
            let slow = (c..c + 8).filter(slow).count();
            FAULT == HASTY && slow == 8 || FAULT == HASTY_WITH_MOST && slow >= 7
        });
        for (chunk, _) in hasty.enumerate().filter(|(_, hasty)| *hasty) {
            for row in batch.moment.chunks_exact_mut(lanes) {
                for m in &mut row[8 * chunk..8 * chunk + 8] {
                    *m *= 1.0 + 1e-15;
                }
            }
        }
        for (i, m) in batch.moment.iter_mut().enumerate() {
            match FAULT {
                SIGN => *m = -*m,
                SOFT => *m *= 0.99,
                DRILLING if i < batch.lanes => *m += 1e-6,
                _ => {}
            }
        }
        code
    }
}

#[test]
fn each_fault_of_rotations_is_found_by_the_check_that_is_meant_for_it() {
    fn found<const FAULT: u8>() -> Vec<&'static str> {
        failed(&with_fabric::<Faulty<FAULT>>("{}", "fibre-energy"))
    }
    assert!(found::<DEAF>().contains(&"frame-invariance"));
    assert!(found::<SIGN>().contains(&"energy"));
    assert!(found::<SOFT>().contains(&"energy"));
    assert!(found::<SOFT>().contains(&"balance"));
    assert_eq!(found::<HASTY>(), ["batch-independence"]);
    assert_eq!(found::<HASTY_WITH_MOST>(), ["batch-independence"]);
    assert!(found::<WEIGHTLESS>().contains(&"mass"));
    assert!(found::<DRILLING>().contains(&"rest"));
    // A slice without a velocity in it: a panic. In C it would be NULL.
    assert!(found::<READS_VELOCITY>().contains(&"status"));
}

/// Rf4 whose patches take a short way, with other bits, when all of a batch's chunk are nearly flat.
struct HastyPatches(Rf4);

impl Element for HastyPatches {
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
        self.0.forces(batch, material)
    }

    fn patch_initialise(&self, batch: &mut PatchBatch<'_>, material: &MaterialRef) {
        self.0.patch_initialise(batch, material);
    }

    fn patch_forces(&self, batch: &mut PatchBatch<'_>, material: &MaterialRef) -> i32 {
        let code = self.0.patch_forces(batch, material);
        let n = batch.lanes;
        for c in (0..n).step_by(8) {
            if batch.energy[c..c + 8].iter().all(|w| *w < 1e-12) {
                for row in batch.force.chunks_exact_mut(n) {
                    row[c..c + 8].iter_mut().for_each(|f| *f *= 1.0 + 1e-15);
                }
            }
        }
        code
    }
}

#[test]
fn a_patch_that_depends_on_its_neighbours_is_found_out() {
    let found = failed(&with_fabric::<HastyPatches>("{}", "fibre-energy"));
    assert_eq!(found, ["patch-batch-independence"]);
}

/// M4's sizes with three nodes: enough for the check that looks at them.
struct Triangle(M4);

impl Element for Triangle {
    const MANIFEST: &'static str = M4::MANIFEST;

    fn create(parameters: &str, material: &MaterialRef) -> Result<Self, String> {
        M4::create(parameters, material).map(Self)
    }

    fn sizes(&self) -> ElementSizes {
        ElementSizes {
            nodes: 3,
            ..self.0.sizes()
        }
    }

    fn initialise(&self, _: &mut ElementBatch<'_>, _: &MaterialRef) {
        panic!("no triangle");
    }

    fn forces(&self, _: &mut ElementBatch<'_>, _: &MaterialRef) -> i32 {
        panic!("no triangle");
    }
}

#[test]
fn of_a_triangle_the_verdict_says_that_this_solver_takes_quads_only() {
    let checks = with_film::<Triangle>("{}");
    let sizes = checks.iter().find(|c| c.rule.name == "sizes");
    let seen = &sizes.expect("a check of the sizes").seen;
    assert!(seen.contains("this solver takes quads only"), "{seen}");
    assert!(!failed(&checks).contains(&"sizes"));
}
