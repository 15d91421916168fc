//! The linear fabric against its closed forms.

use plyflow_kernels::fabric_linear::FabricLinear;
use plyflow_sdk::{BendingBatch, Material, MembraneBatch};

const PLY: &str = r#"{"fibre_modulus_1": 3e9, "fibre_modulus_2": 1e9, "shear_modulus": 4e5, "thickness": 4e-4, "areal_mass": 0.4,
    "bending": {"family_1": 4e-4, "family_2": 2e-4, "twist": 1e-4}}"#;

fn membrane(metric: [f64; 3]) -> ([f64; 3], f64, [f64; 2]) {
    let law = FabricLinear::create(PLY).unwrap();
    let rows: Vec<f64> = metric.iter().flat_map(|c| [*c; 8]).collect();
    let (mut stress, mut energy, mut stiffness) = ([0.0; 24], [0.0; 8], [0.0; 16]);
    law.membrane(&mut MembraneBatch {
        lanes: 8,
        dt: 0.0,
        metric: &rows,
        history: &mut [],
        stress: &mut stress,
        energy: &mut energy,
        stiffness: Some(&mut stiffness),
    });
    (
        [stress[0], stress[8], stress[16]],
        energy[0],
        [stiffness[0], stiffness[8]],
    )
}

#[test]
fn each_strain_has_a_modulus_of_its_own() {
    // E11 = 0.01, E22 = -0.02, E12 = 0.05.
    let (stress, energy, stiffness) = membrane([1.02, 0.96, 0.1]);
    let wanted = [
        3e9 * 4e-4 * 0.01,
        -1e9 * 4e-4 * 0.02,
        2.0 * 4e5 * 4e-4 * 0.05,
    ];
    for (found, wanted) in stress.iter().zip(wanted) {
        assert!((found / wanted - 1.0).abs() < 1e-12, "{found} {wanted}");
    }
    let w = 0.5 * (wanted[0] * 0.01 - wanted[1] * 0.02 + 2.0 * wanted[2] * 0.05);
    assert!((energy / w - 1.0).abs() < 1e-12, "{energy} {w}");
    assert_eq!(stiffness, [3e9 * 4e-4, 4e5 * 4e-4]);
}

#[test]
fn a_picture_frame_measures_the_shear_modulus() {
    // Sides keep their length: C11 = C22 = 1, C12 = sin g; the normalised shear force is S12 cos g = G h sin g cos g.
    let g: f64 = 0.3;
    let (stress, ..) = membrane([1.0, 1.0, g.sin()]);
    let force = stress[2] * g.cos();
    assert!(
        (force / (4e5 * 4e-4 * g.sin() * g.cos()) - 1.0).abs() < 1e-12,
        "{force}"
    );
}

#[test]
fn without_bending_it_has_none_and_with_it_families_bend_alone() {
    let law = FabricLinear::create(PLY).unwrap();
    assert!(law.sizes().has_bending);
    let (mut moment, mut energy, mut tangent) = ([0.0; 24], [0.0; 8], [0.0; 24]);
    let curvature: Vec<f64> = [20.0, 0.0, 5.0].iter().flat_map(|k| [*k; 8]).collect();
    law.bending(&mut BendingBatch {
        lanes: 8,
        dt: 0.0,
        metric: &[1.0; 24],
        curvature: &curvature,
        history: &mut [],
        moment: &mut moment,
        energy: &mut energy,
        tangent: Some(&mut tangent),
    });
    let at = |rows: [f64; 24]| [rows[0], rows[8], rows[16]];
    // Family 1 bends and the ply twists: family 2 feels nothing of either.
    let wanted = [4e-4 * 20.0, 0.0, 1e-4 * 5.0];
    for (found, wanted) in at(moment).iter().zip(wanted) {
        assert!((found - wanted).abs() < 1e-15, "{found} {wanted}");
    }
    let stored = 0.5 * (wanted[0] * 20.0 + 2.0 * wanted[2] * 5.0);
    assert!((energy[0] / stored - 1.0).abs() < 1e-12, "{}", energy[0]);
    assert_eq!(at(tangent), [4e-4, 2e-4, 1e-4]);
    let plain = PLY.replace(
        r#",
    "bending": {"family_1": 4e-4, "family_2": 2e-4, "twist": 1e-4}"#,
        "",
    );
    assert!(!FabricLinear::create(&plain).unwrap().sizes().has_bending);
}

#[test]
fn a_modulus_of_nothing_is_refused_by_name() {
    let error = FabricLinear::create(&PLY.replace("4e5", "0"))
        .err()
        .unwrap();
    assert!(error.contains("shear_modulus: given 0 Pa"), "{error}");
    let error = FabricLinear::create(&PLY.replace("2e-4", "-2e-4"))
        .err()
        .unwrap();
    assert!(
        error.contains("bending.family_2: given -0.0002 N m"),
        "{error}"
    );
}
