//! The step on overhangs of known stiffness.

use plyflow_characterise_cantilever::CharacteriseCantilever;
use plyflow_testing::run;
use serde_json::json;
use std::path::PathBuf;

fn file(text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("o.csv");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

#[test]
fn mean_deviation_and_bending_length_are_those_of_the_formula() {
    // w = 4.4 N/m2 less rounding: B = w (L/2)^3.
    let (_folder, path) = file("overhang [mm]\n190\n200\n210\n");
    let out =
        run::<CharacteriseCantilever>(json!({"overhangs": path, "areal_mass": 0.44}), &[], &[])
            .unwrap();
    let w = 0.44 * 9.80665;
    let b = [0.095f64, 0.1, 0.105].map(|l| w * l.powi(3));
    let mean = (b[0] + b[1] + b[2]) / 3.0;
    assert!((out.result("bending_stiffness") / mean - 1.0).abs() < 1e-12);
    assert!((out.result("bending_length") - (mean / w).cbrt()).abs() < 1e-12);
    let deviation = ((b.iter().map(|v| (v - mean).powi(2)).sum::<f64>()) / 2.0).sqrt();
    assert!((out.result("bending_stiffness_deviation") / deviation - 1.0).abs() < 1e-9);
    assert_eq!(out.result("specimens"), 3.0);
    let text = out.attributes["files"][0]["text"].as_str().unwrap();
    assert!(
        text.contains("bending:\n  positive: {linear: 4.3"),
        "{text}"
    );
}

#[test]
fn a_linear_law_replaces_the_block_of_the_template() {
    let (_folder, path) = file("overhang [mm],angle [deg]\n120,7.1\n");
    let woven = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../../workflows/materials/woven-38616.yaml"
    );
    let parameters = json!({"overhangs": path, "template": woven, "formula": "peirce"});
    let out = run::<CharacteriseCantilever>(parameters, &[], &[]).unwrap();
    let text = out.attributes["files"][0]["text"].as_str().unwrap();
    let value: serde_json::Value = serde_saphyr::from_str(text).unwrap();
    let block = value["with"]["bending"]["positive"].as_object().unwrap();
    assert_eq!(block.len(), 1, "{text}");
    let linear = plyflow_model::units::parse_quantity(
        block["linear"].as_str().unwrap(),
        plyflow_model::units::Dimension::Moment,
    );
    // At 7.1 deg Peirce's formula is nearly w L^3.
    let expected = 0.21 * 9.80665 * 0.12f64.powi(3);
    assert!((linear.unwrap() / expected - 1.0).abs() < 3e-3, "{text}");
}

#[test]
fn a_template_that_is_no_fabric_is_refused() {
    let (_folder, path) = file("overhang [mm]\n200\n");
    let film = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../../workflows/materials/stretchlon-ht350.yaml"
    );
    let parameters = json!({"overhangs": path, "template": film});
    let e = run::<CharacteriseCantilever>(parameters, &[], &[]).unwrap_err();
    assert!(
        e.contains("stretchlon-ht350.yaml: its plugin is `material-marlow`")
            && e.contains("material-fabric"),
        "{e}"
    );
}

#[test]
fn bad_overhangs_are_refused_with_file_and_line() {
    for (text, parameters, expected) in [
        (
            "length [mm]\n1\n",
            json!({}),
            "o.csv:1: there is no column 'overhang'",
        ),
        (
            "overhang [deg]\n1\n",
            json!({}),
            "the unit 'deg' does not fit",
        ),
        (
            "overhang [mm]\n200\n-3\n",
            json!({}),
            "o.csv:3: an overhang of -3.000 mm",
        ),
        (
            "overhang [mm]\nNaN\n",
            json!({}),
            "o.csv:2: column 'overhang'",
        ),
        ("overhang [mm]\n", json!({}), "0 rows"),
        (
            "overhang [m]\n0.1\n97.0\n",
            json!({}),
            "o.csv:3: column 'overhang [m]': 97 m is not plausible for a strip of fabric; expected 1 mm to 2 m",
        ),
        (
            "overhang [mm]\n0.0970\n",
            json!({}),
            "o.csv:2: column 'overhang [mm]': 0.000097 m is not plausible",
        ),
        (
            "overhang [mm],Angle [deg]\n120,7.1\n",
            json!({"formula": "peirce"}),
            "o.csv:1: the column 'Angle' is not one that is read; did you mean `angle [deg]`?",
        ),
        (
            "overhang [mm],angle [deg]\n200,7.1\n",
            json!({}),
            "o.csv:2: the standard's formula holds at 41.5 deg",
        ),
        (
            "overhang [mm]\n200\n",
            json!({"formula": "peirce"}),
            "o.csv: the angle of the secant is not told",
        ),
        (
            "overhang [mm],angle [deg]\n200,0\n",
            json!({"formula": "peirce"}),
            "o.csv:2: an angle of 0.00 deg",
        ),
    ] {
        let (_folder, path) = file(text);
        let mut with = json!({"overhangs": path, "areal_mass": 0.44});
        with.as_object_mut()
            .unwrap()
            .extend(parameters.as_object().unwrap().clone());
        let e = run::<CharacteriseCantilever>(with, &[], &[]).unwrap_err();
        assert!(e.contains(expected), "{e}");
    }
}

#[test]
fn overhangs_and_masses_in_another_unit_than_that_of_the_header_are_warned_of() {
    // 190 mm and 0.44 kg/m2, the lengths in cm under a header in mm, and the other way about; the mass in g.
    for (text, mass, says) in [
        ("overhang [mm]\n19\n20\n", 0.44, Some("the bending length")),
        (
            "overhang [cm]\n190\n199\n",
            0.44,
            Some("the bending length"),
        ),
        (
            "overhang [mm]\n190\n200\n",
            440.0,
            Some("the areal mass is 440 kg/m2"),
        ),
        (
            "overhang [mm]\n190\n200\n",
            4.4e-4,
            Some("the areal mass is 0.00044 kg/m2"),
        ),
        ("overhang [mm]\n190\n200\n", 0.44, None),
    ] {
        let (_folder, path) = file(text);
        let given = json!({"overhangs": path, "areal_mass": mass});
        let log = run::<CharacteriseCantilever>(given, &[], &[]).unwrap().log;
        match says {
            Some(says) => assert!(log.iter().any(|l| l.contains(says)), "{text}: {log:?}"),
            None => assert!(log.is_empty(), "{log:?}"),
        }
    }
}
