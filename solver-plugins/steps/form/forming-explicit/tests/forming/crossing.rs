//! Plies whose fibre families do not cross at a right angle.

use crate::common::scenes::gentle_press;
use crate::common::{BuiltIn, form};
use plyflow_forming_explicit::{Parameters, build_global};
use plyflow_geometry::vec3::{Vec3, norm, sub};
use serde_json::json;
use std::f64::consts::PI;

/// The ply of [`gentle_press`] with families at `first` and `second` (rad), of these moduli (Pa), and a law that knows it.
fn crossed(element: &str, [first, second]: [f64; 2], moduli: [f64; 2]) -> Parameters {
    let mut p = gentle_press(element, 0.0, &[]);
    let sheet = &mut p.scene.sheets[0];
    sheet.fibre_1 = serde_json::from_value(json!(format!("{first} rad"))).unwrap();
    sheet.fibre_2 = serde_json::from_value(json!(format!("{second} rad"))).unwrap();
    let plyflow_model::material::MaterialEntry::Inline(material) = &mut sheet.material else {
        unreachable!()
    };
    let crossing = (second - first).rem_euclid(2.0 * PI);
    material.with.insert("crossing".into(), json!(crossing));
    material
        .with
        .insert("fibre_modulus".into(), json!(moduli[0]));
    material
        .with
        .insert("fibre_modulus_2".into(), json!(moduli[1]));
    p
}

fn refused(p: &Parameters) -> String {
    build_global(p, &BuiltIn)
        .err()
        .expect("refused")
        .to_string()
}

#[test]
fn fields_are_those_of_both_families() {
    let fibres = [0.2, 1.3];
    // An even motion of the ply.
    let to = |[x, y, z]: Vec3| [1.01 * x + 0.3 * y, 0.9 * y - 0.05 * x, z];
    for element in ["m4", "rf4", "s4"] {
        let mut p = crossed(element, fibres, [3e9, 1e9]);
        if element == "s4" {
            p.element.with = json!({"twist": "material"});
        }
        let mut forming = build_global(&p, &BuiltIn).unwrap();
        let places: Vec<Vec3> = forming.model.x().iter().map(|x| to(*x)).collect();
        forming.model.x_mut().copy_from_slice(&places);
        forming.model.set_step(1e-12);
        forming.model.step(true).unwrap();
        let images = fibres.map(|t| to([t.cos(), t.sin(), 0.0]));
        let strains = images.map(|a| norm(a) - 1.0);
        let cosine = (0..3).map(|k| images[0][k] * images[1][k]).sum::<f64>();
        let now = (cosine / (norm(images[0]) * norm(images[1]))).acos();
        let shear = (fibres[1] - fibres[0]) - now;
        let fields: Vec<_> = ["shear_angle", "fibre_strain_1", "fibre_strain_2"]
            .iter()
            .enumerate()
            .map(|(row, name)| plyflow_mechanics::component::ElementField {
                name: (*name).into(),
                unit: "1".into(),
                patch: false,
                row,
                elsewhere: None,
            })
            .collect();
        let body = &forming.bodies[0];
        for (field, wanted) in fields.iter().zip([shear, strains[0], strains[1]]) {
            for value in forming.field(body, field, &fields) {
                assert!(
                    (value - wanted).abs() < 1e-9,
                    "{element} {}: {value} {wanted}",
                    field.name
                );
            }
        }
    }
}

/// The same ply, whose families are named the other way round: its axes lie elsewhere, and the supplement of the angle is between them.
#[test]
fn a_ply_that_names_its_families_the_other_way_round_is_formed_alike() {
    for element in ["m4", "rf4"] {
        let (a, b) = (0.1, 0.1 + PI / 3.0);
        let one = form(&crossed(element, [a, b], [3e9, 1e9]), 1).0;
        let other = form(&crossed(element, [b, a + PI], [1e9, 3e9]), 1).0;
        let apart = |(p, q): (&Vec3, &Vec3)| norm(sub(*p, *q));
        let most = |q: &[Vec3]| one.model.x().iter().zip(q).map(apart).fold(0.0, f64::max);
        let moved = most(&one.reference);
        assert!(moved > 5e-3, "{element}: {moved}");
        let off = most(other.model.x());
        assert!(off < 1e-3 * moved, "{element}: {off} of {moved}");
        // It is not what a ply with a right angle does.
        let square = form(&crossed(element, [a, a + PI / 2.0], [3e9, 1e9]), 1).0;
        assert!(most(square.model.x()) > 10.0 * off, "{element}");
    }
}

#[test]
fn what_cannot_be_crossed_is_refused_by_name() {
    let with = |change: &dyn Fn(&mut Parameters)| {
        let mut p = crossed("m4", [0.0, PI / 3.0], [3e9, 3e9]);
        change(&mut p);
        refused(&p)
    };
    let told = with(&|p| {
        p.scene.sheets[0].fibre_2 = serde_json::from_value(json!("90 deg")).unwrap();
    });
    assert!(
        told.contains("sheets[0].fibre_2")
            && told.contains("90 deg")
            && told.contains("fibre_2: 60 deg"),
        "{told}"
    );
    // Clockwise it is another ply, whose shear has the other sign.
    let told = with(&|p| {
        p.scene.sheets[0].fibre_2 = serde_json::from_value(json!("-60 deg")).unwrap();
    });
    assert!(told.contains("300 deg counter-clockwise"), "{told}");
    let told = with(&|p| p.scene.symmetry = serde_json::from_value(json!(["y"])).unwrap());
    assert!(told.contains("symmetry"), "{told}");
    let told = with(&|p| {
        p.element.plugin = "m4f".into();
        p.element.with = json!({"fibres_along_sides": true});
    });
    assert!(
        told.contains("m4f") && told.contains("right angle"),
        "{told}"
    );
    let told = with(&|p| {
        p.element.plugin = "s4".into();
        p.element.with = json!({});
    });
    assert!(told.contains("twist: material"), "{told}");
    let points = json!({"points": [{"x": "0 m", "y": "0 m", "angle": "0 deg"}, {"x": "0.1 m", "y": "0 m", "angle": "0 deg"}, {"x": "0 m", "y": "0.1 m", "angle": "0 deg"}]});
    let told = with(&|p| {
        p.scene.sheets[0].fibre_1 = serde_json::from_value(points.clone()).unwrap();
        p.scene.sheets[0].fibre_2 = None;
    });
    assert!(
        told.contains("steered") && told.contains("60 deg"),
        "{told}"
    );
}
