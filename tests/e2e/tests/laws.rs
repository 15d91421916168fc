//! The curves that the report draws of materials are what their laws answer in a run.

// Components behind their C tables, as the solver meets them.
#[path = "../../../solver-plugins/lib/kernels/tests/common/mod.rs"]
mod common;

use common::{Mat, Point, bend, fabric};
use plyflow_report::{LawCurve, law_curves};
use serde_json::{Value, json};

/// Formulas, and a stitch: the non-crimp fabric of the thesis.
fn formulas() -> Value {
    serde_json::from_str(&common::ncf("fibre-energy", "")).unwrap()
}

/// Tables for all: shear by sign, bending by sign.
fn tables() -> Value {
    json!({"form": "fibre-energy", "fibre_modulus": 2e9, "compression_factor": 0.5, "thickness": 3e-4, "areal_mass": 0.3,
        "shear": {"table": {"angles": [0.0, 0.2, 0.5, 0.9], "forces": [0.0, 12.0, 40.0, 210.0]},
                  "negative": {"table": {"angles": [0.0, 0.3, 0.8], "forces": [0.0, 9.0, 70.0]}}},
        "bending": {"positive": {"table": {"curvatures": [0.0, 5.0, 20.0, 50.0], "moments": [0.0, 0.01, 0.03, 0.05]}},
                    "negative": {"table": {"curvatures": [0.0, 10.0, 50.0], "moments": [0.0, 0.015, 0.04]}}, "families": "same"}})
}

/// A unidirectional fabric, as `workflows/materials/unidirectional.yaml` has it.
fn unidirectional() -> Value {
    json!({"form": "fibre-energy", "fibre_modulus": 3e9, "fibre_modulus_2": 6e6, "compression_factor": 0.2, "thickness": 3e-4, "areal_mass": 0.3,
        "shear": {"coefficients": [0.0, 60.0, 0.0, 120.0]},
        "bending": {"family_1": {"positive": {"stiffness": 4e-3}}, "family_2": {"positive": {"stiffness": 4e-5}}, "families": "same"}})
}

/// A fabric whose fibres buckle within the ply, by a curve for each family.
fn crushed() -> Value {
    json!({"form": "fibre-energy", "fibre_modulus": 3e9, "thickness": 3e-4, "areal_mass": 0.3, "shear": {"coefficients": [0.0, 60.0, 0.0, 120.0]},
        "compression": {"table": {"strains": [0.0, 0.001, 0.003, 0.02], "stresses": [0.0, 2e6, 4e6, 5e6]}},
        "compression_2": {"table": {"strains": [0.0, 0.002, 0.03], "stresses": [0.0, 1e6, 2e6]}}})
}

fn made(with: &Value) -> Mat {
    fabric(&with.to_string()).unwrap_or_else(|e| panic!("{e}"))
}

/// The curves of a plot.
fn of<'a>(all: &'a [LawCurve], plot: &str) -> Vec<&'a LawCurve> {
    all.iter().filter(|c| c.plot == plot).collect()
}

/// Force (N/m) of a picture frame at a shear angle (rad), loaded from nothing as the curve is. The yarns' own is that with the fibres unstretched.
fn shear_force(law: &Mat, angle: f64) -> f64 {
    let mut point = Point::new(law);
    let mut force = 0.0;
    for k in 1..=200 {
        let g = angle * f64::from(k) / 200.0;
        force = point.at(law, [1.0, 1.0, g.sin()]).stress[2];
    }
    force
}

fn is_close(found: f64, drawn: f64, largest: f64, what: &str) {
    assert!(
        (found - drawn).abs() < 1e-6 * largest,
        "{what}: the law gives {found}, drawn is {drawn}"
    );
}

#[test]
fn shear_curves_are_the_forces_of_the_law_at_every_place() {
    for (name, with) in [
        ("formulas", formulas()),
        ("tables", tables()),
        ("unidirectional", unidirectional()),
    ] {
        let (curves, _) = law_curves("material-fabric", &with);
        let shear = of(&curves, "Shear");
        let mut without = with.clone();
        let stitched = without.as_object_mut().unwrap().remove("stitch").is_some();
        assert_eq!(shear.len(), 1 + usize::from(stitched), "{name}");
        // With a stitch there are two curves: of the yarns alone, and of both.
        for (curve, law) in shear.iter().zip([made(&without), made(&with)]) {
            let largest = curve.y.iter().map(|y| y.abs()).fold(0.0, f64::max);
            assert!(largest > 10.0 && curve.x.len() > 4, "{name}");
            for (x, y) in curve.x.iter().zip(&curve.y) {
                let found = shear_force(&law, x.to_radians());
                is_close(
                    found,
                    *y,
                    largest,
                    &format!("{name}, {} at {x} deg", curve.name),
                );
            }
        }
    }
}

#[test]
fn bending_curves_are_the_moments_of_the_law_by_family_and_sign() {
    for (name, with, expected) in [
        ("formulas", formulas(), vec!["positive", "negative"]),
        ("tables", tables(), vec!["positive", "negative"]),
        (
            "unidirectional",
            unidirectional(),
            vec!["family 1", "family 2"],
        ),
    ] {
        let (curves, _) = law_curves("material-fabric", &with);
        let (law, bending) = (made(&with), of(&curves, "Bending"));
        let names: Vec<&str> = bending.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, expected, "{name}");
        for curve in bending {
            let (family, sign) = (
                usize::from(curve.name.ends_with('2')),
                if curve.name == "negative" { -1.0 } else { 1.0 },
            );
            let largest = curve.y.iter().copied().fold(0.0, f64::max);
            for (x, y) in curve.x.iter().zip(&curve.y) {
                let mut curvature = [0.0; 3];
                curvature[family] = sign * x * 1e3;
                let found = sign * bend(&law, [1.0, 1.0, 0.0], curvature).moment[family];
                is_close(
                    found,
                    *y,
                    largest,
                    &format!("{name}, {} at {x} 1/mm", curve.name),
                );
            }
        }
    }
}

#[test]
fn moduli_and_their_share_in_compression_are_told_as_the_law_has_them() {
    let told = |all: &[(&str, String)], what: &str| {
        all.iter()
            .find(|(name, _)| *name == what)
            .map(|(_, v)| v.clone())
    };
    for (with, modulus, second, share) in [
        (formulas(), "3 GPa", None, 1.0),
        (tables(), "2 GPa", None, 0.5),
        (unidirectional(), "3 GPa", Some("6 MPa"), 0.2),
    ] {
        let (_, words) = law_curves("material-fabric", &with);
        assert_eq!(
            told(&words, "Modulus along the fibres").as_deref(),
            Some(modulus)
        );
        assert_eq!(
            told(&words, "Modulus of the second family").as_deref(),
            second
        );
        assert_eq!(
            told(&words, "Share of it in compression"),
            Some(share.to_string())
        );
        let law = made(&with);
        let moduli = ["fibre_modulus", "fibre_modulus_2"].map(|key| with[key].as_f64());
        for (family, e) in [moduli[0], moduli[1].or(moduli[0])].into_iter().enumerate() {
            // Small strains: force per width over thickness and strain.
            for (strain, factor) in [(1e-6, 1.0), (-1e-6, share)] {
                let mut metric = [1.0, 1.0, 0.0];
                metric[family] = (1.0f64 + strain).powi(2);
                let found = Point::new(&law).at(&law, metric).stress[family]
                    / (with["thickness"].as_f64().unwrap() * strain);
                assert!(
                    (found / (factor * e.unwrap()) - 1.0).abs() < 1e-4,
                    "family {family} at {strain}: {found}"
                );
            }
        }
    }
}

#[test]
fn curves_of_compressed_fibres_are_the_stresses_of_the_law_by_family() {
    let mut same = crushed();
    same.as_object_mut().unwrap().remove("compression_2");
    for (with, expected) in [
        (crushed(), vec!["family 1", "family 2"]),
        (same, vec!["both families"]),
    ] {
        let (curves, words) = law_curves("material-fabric", &with);
        let (law, drawn) = (made(&with), of(&curves, "Fibres in compression"));
        let names: Vec<&str> = drawn.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, expected);
        // A curve is no share.
        assert!(words.iter().all(|w| w.0 != "Share of it in compression"));
        for (k, curve) in drawn.iter().enumerate() {
            let families = if expected.len() == 1 { 0..2 } else { k..k + 1 };
            assert!(curve.x.len() > 2);
            for family in families {
                for (x, y) in curve.x.iter().zip(&curve.y) {
                    let stretch = 1.0 - 0.01 * x;
                    let mut metric = [1.0, 1.0, 0.0];
                    metric[family] = stretch * stretch;
                    let stress = Point::new(&law).at(&law, metric).stress[family] * stretch;
                    is_close(
                        -1e-6 * stress / 3e-4,
                        *y,
                        5.0,
                        &format!("{} at {x} %", curve.name),
                    );
                }
            }
        }
    }
}
