//! The step on cross-head curves of known laws.

use plyflow_characterisation::synthetic::{Noise, frame_force, ncf_shear, woven_shear};
use plyflow_characterise_picture_frame::CharacterisePictureFrame;
use plyflow_model::units::{Dimension, parse_quantity};
use plyflow_testing::{MemoryArtifact, run};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const SIDE: f64 = 0.145;
const SPECIMEN: f64 = 0.120;

fn csv(folder: &Path, name: &str, law: fn(f64) -> f64, sign: f64, to: f64) -> PathBuf {
    csv_with(folder, name, law, sign, to, (400, 0.0))
}

/// `rows` after the first; `offset` of the load cell (N).
fn csv_with(
    folder: &Path,
    name: &str,
    law: fn(f64) -> f64,
    sign: f64,
    to: f64,
    (rows, offset): (i32, f64),
) -> PathBuf {
    let last = 2.0 * SIDE * ((0.5 * (90.0 - to)).to_radians().cos() - 0.5f64.sqrt());
    let mut random = Noise::new(name.len() as u64);
    let rows: String = (0..=rows)
        .map(|i| last * f64::from(i) / f64::from(rows))
        .map(|d| {
            (
                d,
                frame_force(&law, SIDE, SPECIMEN, d, sign) + 0.01 * random.normal() + offset,
            )
        })
        .map(|(d, f)| format!("{},{f}\n", 1e3 * d))
        .collect();
    let path = folder.join(name);
    std::fs::write(&path, format!("displacement [mm],force [N]\n{rows}")).unwrap();
    path
}

fn with(positive: &[PathBuf], negative: &[PathBuf], stitch: bool, material: &str) -> Value {
    let template = format!(
        "{}/../../../../workflows/materials/{material}.yaml",
        env!("CARGO_MANIFEST_DIR")
    );
    json!({"positive": positive, "negative": negative, "frame_side": SIDE, "specimen_side": SPECIMEN,
           "stitch": stitch, "template": template})
}

/// Root mean square of the curve `curves/fit` less the law, over that of the law, for one sign of shear.
fn curve_error(out: &MemoryArtifact, law: fn(f64) -> f64, sign: f64) -> f64 {
    let (g, f) = (
        &out.arrays["curves/fit/shear_angle"].1,
        &out.arrays["curves/fit/normalised_force"].1,
    );
    let (mut off, mut size) = (0.0, 0.0);
    for (g, f) in g.iter().zip(f).filter(|(g, _)| **g * sign > 0.0) {
        off += (f - law(*g)).powi(2);
        size += law(*g).powi(2);
    }
    (off / size).sqrt()
}

fn material(out: &MemoryArtifact) -> Value {
    serde_saphyr::from_str(out.attributes["files"][0]["text"].as_str().unwrap()).unwrap()
}

#[test]
fn the_woven_law_comes_back_and_stands_in_the_material() {
    let folder = tempfile::tempdir().unwrap();
    let up = csv(folder.path(), "up.csv", woven_shear, 1.0, 60.0);
    let down = csv(folder.path(), "down.csv", woven_shear, -1.0, 60.0);
    let out = run::<CharacterisePictureFrame>(with(&[up], &[down], false, "woven-38616"), &[], &[])
        .unwrap();
    for sign in [1.0, -1.0] {
        let error = curve_error(&out, woven_shear, sign);
        println!("woven {sign}: {error:.5}");
        assert!(error < 0.003, "{error}");
    }
    // The polynomial of the file is the curve of the artifact.
    let value = material(&out);
    let coefficients: Vec<f64> = (value["with"]["shear"]["coefficients"]
        .as_array()
        .unwrap()
        .iter())
    .map(|c| parse_quantity(c.as_str().unwrap(), Dimension::ForcePerLength).unwrap())
    .collect();
    assert_eq!(coefficients[0], 0.0);
    let g = 0.8f64;
    let sum: f64 = (0..).zip(&coefficients).map(|(n, c)| c * g.powi(n)).sum();
    assert!((sum / woven_shear(g) - 1.0).abs() < 0.005, "{sum}");
    assert!(value["with"]["stitch"].is_null());
}

#[test]
fn yarns_and_stitch_of_the_ncf_come_back_and_stand_in_the_material() {
    let folder = tempfile::tempdir().unwrap();
    let up = csv(folder.path(), "up.csv", ncf_shear, 1.0, 55.0);
    let down = csv(folder.path(), "down.csv", ncf_shear, -1.0, 55.0);
    let out = run::<CharacterisePictureFrame>(with(&[up], &[down], true, "ncf-fcim359"), &[], &[])
        .unwrap();
    for sign in [1.0, -1.0] {
        let error = curve_error(&out, ncf_shear, sign);
        println!("NCF {sign}: {error:.5}");
        assert!(error < 0.01, "{error}");
    }
    assert!((out.result("stitch_onset") - 0.06).abs() < 2e-3);
    assert!((out.result("stitch_peak_angle") - 0.5).abs() < 2e-3);
    assert!((out.result("stitch_end") - 0.75).abs() < 2e-3);
    assert!((out.result("stitch_peak") / 880.0 - 1.0).abs() < 2e-3);
    let value = material(&out);
    let forces = &value["with"]["stitch"]["forces"];
    assert_eq!(
        (forces[0].as_str(), forces[2].as_str()),
        (Some("0 N/m"), Some("0 N/m"))
    );
    assert!(value["with"]["bending"]["negative"].is_object());
}

#[test]
fn what_the_tests_do_not_tell_of_a_fabric_stays_as_in_the_template() {
    let folder = tempfile::tempdir().unwrap();
    let up = csv(folder.path(), "up.csv", ncf_shear, 1.0, 55.0);
    let down = csv(folder.path(), "down.csv", ncf_shear, -1.0, 55.0);
    let guide = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../../docs/guide/materials.md"
    );
    let guide = std::fs::read_to_string(guide).unwrap();
    let start = guide
        .find("name: A fabric that shears differently")
        .unwrap();
    let start = &guide[start..start + guide[start..].find("```").unwrap()];
    let template = folder.path().join("both.yaml");
    std::fs::write(&template, format!("plyflow_material: 1\n{start}")).unwrap();
    let evaluated = |positive: &PathBuf, negative: &[PathBuf], stitch: bool| {
        let mut parameters = with(
            std::slice::from_ref(positive),
            negative,
            stitch,
            "woven-38616",
        );
        parameters["template"] = json!(template);
        run::<CharacterisePictureFrame>(parameters, &[], &[]).unwrap()
    };
    // The law of negative shear, where only the other was tested.
    let woven = csv(folder.path(), "woven.csv", woven_shear, 1.0, 60.0);
    let out = evaluated(&woven, &[], false);
    let shear = &material(&out)["with"]["shear"];
    assert_eq!(
        shear["negative"]["table"]["forces"][3], "240 N/m",
        "{shear}"
    );
    // Whose sign is not that of tests that stretch this stitch.
    assert!(
        out.log.len() == 1 && out.log[0].contains("`shear.negative` stays"),
        "{:?}",
        out.log
    );
    // Which sign of shear stretches the stitch.
    let out = evaluated(&up, &[down], true);
    let value = material(&out);
    assert_eq!(value["with"]["stitch"]["direction"], "negative");
    assert!(value["with"]["shear"]["negative"].is_null());
    assert!(
        out.log.iter().any(|l| l.contains("`shear.negative`")),
        "{:?}",
        out.log
    );
}

#[test]
fn a_fabric_fitted_without_a_stitch_loses_that_of_the_template() {
    let folder = tempfile::tempdir().unwrap();
    let up = csv(folder.path(), "up.csv", woven_shear, 1.0, 60.0);
    let out =
        run::<CharacterisePictureFrame>(with(&[up], &[], false, "ncf-fcim359"), &[], &[]).unwrap();
    assert!(material(&out)["with"]["stitch"].is_null());
}

#[test]
fn a_template_whose_families_cross_askew_is_no_fabric_of_a_square_frame() {
    let folder = tempfile::tempdir().unwrap();
    let up = csv(folder.path(), "up.csv", woven_shear, 1.0, 60.0);
    let mut parameters = with(&[up], &[], false, "unidirectional");
    let text = std::fs::read_to_string(parameters["template"].as_str().unwrap()).unwrap();
    let template = folder.path().join("askew.yaml");
    std::fs::write(
        &template,
        text.replace("with:\n", "with:\n  crossing: 60 deg\n"),
    )
    .unwrap();
    parameters["template"] = json!(template);
    let told = run::<CharacterisePictureFrame>(parameters, &[], &[])
        .err()
        .unwrap()
        .to_string();
    assert!(
        told.contains("crossing: 60 deg") && told.contains("begins as a square"),
        "{told}"
    );
}

#[test]
fn the_least_template_of_the_guide_becomes_a_fabric_with_the_fitted_shear() {
    let guide = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../../../docs/guide/characterisation.md"
    );
    let guide = std::fs::read_to_string(guide).unwrap();
    let start = guide.find("plyflow_material: 1").unwrap();
    let start = &guide[start..start + guide[start..].find("```").unwrap()];
    let folder = tempfile::tempdir().unwrap();
    let template = folder.path().join("start.yaml");
    std::fs::write(&template, start).unwrap();
    let up = csv(folder.path(), "up.csv", woven_shear, 1.0, 60.0);
    let mut parameters = with(&[up], &[], false, "woven-38616");
    parameters["template"] = json!(template);
    let value = material(&run::<CharacterisePictureFrame>(parameters, &[], &[]).unwrap());
    assert_eq!(value["name"], "My fabric");
    assert_eq!(value["with"]["fibre_modulus"], "3 GPa");
    assert_eq!(value["with"]["bending"]["families"], "opposite");
    assert!(value["with"]["shear"]["coefficients"].is_array());
}

#[test]
fn where_no_polynomial_is_taken_a_table_is_written_with_a_warning() {
    // Up to a peak at 0.5 rad (29 deg), and down to a half: no polynomial of degree 9 rises over it.
    fn peak(g: f64) -> f64 {
        let a = g.abs();
        if a < 0.5 {
            200.0 * a
        } else {
            150.0 - 100.0 * a
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let up = csv(folder.path(), "up.csv", peak, 1.0, 57.0);
    let mut parameters = with(&[up], &[], false, "woven-38616");
    parameters["degree"] = json!(9);
    let out = run::<CharacterisePictureFrame>(parameters, &[], &[]).unwrap();
    assert_eq!(out.result("table"), 1.0);
    assert!(!out.results.contains_key("degree"));
    let warned = |l: &String| l.contains("`table`") && l.contains(" and 57.0 deg");
    assert!(out.log.iter().any(warned), "{:?}", out.log);
    let value = material(&out);
    let shear = value["with"]["shear"].as_object().unwrap();
    assert_eq!(shear.len(), 1);
    let column = |name: &str, dimension| -> Vec<f64> {
        let texts = shear["table"][name].as_array().unwrap().iter();
        texts
            .map(|v| parse_quantity(v.as_str().unwrap(), dimension).unwrap())
            .collect()
    };
    let forces = column("forces", Dimension::ForcePerLength);
    let angles = column("angles", Dimension::Angle);
    assert!(forces.windows(2).all(|f| f[0] < f[1]), "{forces:?}");
    assert!(angles.windows(2).all(|g| g[0] < g[1]), "{angles:?}");
    assert!((angles[angles.len() - 1].to_degrees() - 57.0).abs() < 0.01);
}

#[test]
fn an_offset_of_the_load_cell_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let warned = |law, to, rows_and_offset| {
        let up = csv_with(folder.path(), "up.csv", law, 1.0, to, rows_and_offset);
        let out = run::<CharacterisePictureFrame>(with(&[up], &[], false, "woven-38616"), &[], &[]);
        let log = out.unwrap().log;
        log.iter().any(|l| {
            l.contains("up.csv: the force does not start at 0")
                && l.contains("subtract the offset of the load cell")
        })
    };
    // The largest force is about 4.5 N, noise 0.01 N. Few rows and short tests, whose start is steep, are no offset.
    for (to, rows) in [(60.0, 400), (60.0, 20), (15.0, 400), (15.0, 20)] {
        assert!(
            !warned(woven_shear, to, (rows, 0.0)),
            "{to} deg, {rows} rows"
        );
    }
    for offset in [0.6, -0.6] {
        for rows in [400, 20] {
            assert!(
                warned(woven_shear, 60.0, (rows, offset)),
                "{offset} N, {rows} rows"
            );
        }
    }
    // Also one of 2 %, ten times the noise.
    assert!(warned(woven_shear, 60.0, (400, 0.1)));
    assert!(!warned(ncf_shear, 55.0, (400, 0.0)));
}

#[test]
fn a_zero_that_is_elsewhere_is_taken_off_and_told_or_kept_when_asked() {
    fn law(g: f64) -> f64 {
        (90.0 * g.abs() + 150.0 * g.abs().powi(3)) * g.signum()
    }
    let folder = tempfile::tempdir().unwrap();
    let up = csv_with(folder.path(), "up.csv", law, 1.0, 55.0, (200, 1.0));
    let mut parameters = json!({"positive": [up], "frame_side": SIDE, "specimen_side": SPECIMEN});
    let found = run::<CharacterisePictureFrame>(parameters.clone(), &[], &[]).unwrap();
    let off = found.result("initial_stiffness") - 90.0;
    assert!(off.abs() < found.result("initial_stiffness_error"), "{off}");
    assert!((found.result("zero_force") - 1.0).abs() < 0.03);
    assert!(off.abs() < 10.0 && found.log.iter().any(|l| l.contains("taken off")));
    parameters["zero"] = json!("given");
    let given = run::<CharacterisePictureFrame>(parameters, &[], &[]).unwrap();
    assert!(given.result("initial_stiffness") > 150.0);
    assert!(
        given.log.iter().any(|l| l.contains("`zero: given`")),
        "{:?}",
        given.log
    );
}

#[test]
fn what_no_fabric_has_and_what_the_rows_do_not_tell_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let warned = |text: &str, says: &str| {
        let path = folder.path().join("t.csv");
        std::fs::write(&path, text).unwrap();
        let out = run::<CharacterisePictureFrame>(
            json!({"positive": [path], "frame_side": SIDE}),
            &[],
            &[],
        );
        let log = out.unwrap().log;
        assert!(log.iter().any(|l| l.contains(says)), "{says}: {log:?}");
    };
    let rows = |from: i32, skip: std::ops::Range<i32>, factor: f64| -> String {
        let all = (from..=100).filter(|i| !skip.contains(i));
        let line = |i: i32| {
            let d = 0.6 * f64::from(i);
            let force = frame_force(&woven_shear, SIDE, SIDE, 1e-3 * d, 1.0);
            format!("{d},{}\n", factor * force)
        };
        all.map(line).collect()
    };
    let head = "displacement [mm],force [N]\n";
    let kilo = "displacement [mm],force [kN]\n";
    warned(
        &(kilo.to_owned() + &rows(0, 0..0, 50.0)),
        "fabrics have 3 to 10000 N/m",
    );
    warned(
        &(head.to_owned() + &rows(0, 0..0, 1e-3)),
        "fabrics have 3 to 10000 N/m",
    );
    warned(
        &(head.to_owned() + &rows(0, 30..60, 1.0)),
        "there is no row between",
    );
    warned(
        &(head.to_owned() + &rows(20, 0..0, 1.0)),
        "there is no row between 0.0 and",
    );
    warned(
        &(head.to_owned() + &rows(0, 31..101, 1.0)),
        "the test ends at",
    );
    let exchanged: String = (0..=100)
        .map(|i| 0.01 * f64::from(i))
        .map(|g| (83.0 * g, 60.0 * (0.1 * g + 0.9 * g.powi(3))))
        .map(|(d, f)| format!("{f},{d}\n"))
        .collect();
    warned(&(head.to_owned() + &exchanged), "exchanged");
}

#[test]
fn signs_that_differ_have_each_a_law_in_the_file() {
    fn apart(g: f64) -> f64 {
        if g > 0.0 {
            90.0 * g + 150.0 * g.powi(3)
        } else {
            240.0 * g + 60.0 * g.powi(3)
        }
    }
    let folder = tempfile::tempdir().unwrap();
    let up = csv(folder.path(), "up.csv", apart, 1.0, 55.0);
    let down = csv(folder.path(), "down.csv", apart, -1.0, 55.0);
    let out = run::<CharacterisePictureFrame>(with(&[up], &[down], false, "woven-38616"), &[], &[]);
    let out = out.unwrap();
    assert_eq!(out.result("signs_differ"), 1.0);
    assert!(out.result("positive_rms") < 0.02 && out.result("negative_rms") < 0.02);
    for (name, right) in [
        ("initial_stiffness", 90.0),
        ("negative_initial_stiffness", 240.0),
    ] {
        assert!((out.result(name) / right - 1.0).abs() < 0.05, "{name}");
    }
    let shear = &material(&out)["with"]["shear"];
    assert!(shear["coefficients"].is_array() && shear["negative"]["coefficients"].is_array());
    for sign in [1.0, -1.0] {
        assert!(curve_error(&out, apart, sign) < 0.01);
    }
}

#[test]
fn bad_tests_are_refused_with_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    let bad = folder.path().join("bad.csv");
    let refused = |text: &str| {
        std::fs::write(&bad, text).unwrap();
        run::<CharacterisePictureFrame>(json!({"positive": [bad], "frame_side": SIDE}), &[], &[])
            .unwrap_err()
    };
    for (text, expected) in [
        (
            "displacement [mm],load [N]\n1,2\n",
            "bad.csv:1: there is no column 'force'",
        ),
        (
            "displacement [mm],force [N/m]\n1,2\n",
            "the unit 'N/m' does not fit",
        ),
        (
            "displacement [mm],force [N]\n1,inf\n",
            "bad.csv:2: column 'force'",
        ),
        ("displacement [mm],force [N]\n1,2\n2,3\n", "at least 20"),
    ] {
        let e = refused(text);
        assert!(e.contains(expected), "{e}");
    }
    let good = csv(folder.path(), "up.csv", woven_shear, 1.0, 60.0);
    let error = |with| run::<CharacterisePictureFrame>(with, &[], &[]).unwrap_err();
    assert!(error(json!({"positive": [], "frame_side": SIDE})).contains("`positive` is empty"));
    assert!(
        error(json!({"positive": [good], "frame_side": SIDE, "stitch": true}))
            .contains("`negative`")
    );
    let large = json!({"positive": [good], "frame_side": SIDE, "specimen_side": 2.0 * SIDE});
    assert!(error(large).contains("`specimen_side` is larger"));
}

#[test]
fn one_file_is_one_test_and_the_one_that_is_not_like_the_others_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let test = |name: &str, factor: f64| {
        let line = |i: i32| {
            let d = 0.6 * f64::from(i);
            let force = frame_force(&woven_shear, SIDE, SIDE, 1e-3 * d, 1.0);
            format!("{d},{}\n", factor * force)
        };
        let rows: String = (0..=100).map(line).collect();
        let path = folder.path().join(name);
        std::fs::write(&path, "displacement [mm],force [N]\n".to_owned() + &rows).unwrap();
        path
    };
    let all = [
        ("a.csv", 1.0),
        ("b.csv", 1.02),
        ("c.csv", 1.9),
        ("d.csv", 0.98),
    ];
    let [a, b, c, d] = all.map(|(name, factor)| test(name, factor));
    let step = |positive: &[&std::path::PathBuf], negative: &[&std::path::PathBuf]| {
        let given = json!({"positive": positive, "negative": negative, "frame_side": SIDE});
        run::<CharacterisePictureFrame>(given, &[], &[])
    };
    for (up, down) in [(vec![&a, &b, &a], vec![]), (vec![&a, &b], vec![&d, &a])] {
        let told = step(&up, &down).expect_err("one file for two tests");
        assert!(told.contains("a.csv has the rows of a.csv"), "{told}");
    }
    for (up, down, names) in [
        (vec![&a, &b, &c], vec![], "c.csv: "),
        (vec![&a, &b], vec![&d, &c], "d.csv, c.csv: "),
    ] {
        let log = step(&up, &down).unwrap().log;
        let named = |l: &String| l.starts_with(&format!("{names}the mean force of a test is"));
        assert!(log.iter().any(named), "{log:?}");
    }
}
