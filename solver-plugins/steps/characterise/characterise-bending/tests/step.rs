//! The step on profiles of a known law, from files and from a simulated coupon.

use plyflow_characterisation::synthetic::{BENDING, PublishedBending};
use plyflow_characterise_bending::CharacteriseBending;
use plyflow_testing::{MemoryArtifact, MemoryInput, run};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

const NCF: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../../../../workflows/materials/ncf-fcim359.yaml"
);

fn csv(folder: &Path, name: &str, law: &PublishedBending, noise: f64, seed: u64) -> PathBuf {
    let [x, z] = law.scan(0.5e-3, noise, seed);
    let rows: String = x
        .iter()
        .zip(&z)
        .map(|(x, z)| format!("{},{}\n", 1e3 * x, 1e2 * z))
        .collect();
    let path = folder.join(name);
    std::fs::write(&path, format!("# made up\nx [mm],z [cm]\n{rows}")).unwrap();
    path
}

fn coupon(law: &PublishedBending) -> MemoryArtifact {
    let [x, z] = law.scan(2e-3, 0.0, 1);
    let mut artifact = MemoryArtifact {
        kind: "coupon".into(),
        attributes: json!({}),
        ..Default::default()
    };
    artifact
        .arrays
        .insert("profile/x".into(), (vec![x.len()], x));
    artifact
        .arrays
        .insert("profile/z".into(), (vec![z.len()], z));
    artifact
}

/// Largest |M(k) found / true - 1| of the curve `curves/law`, from 5 to 100 % of the largest curvature.
fn law_error(out: &MemoryArtifact, law: &PublishedBending) -> f64 {
    let (k, m) = (
        &out.arrays["curves/law/curvature"].1,
        &out.arrays["curves/law/moment"].1,
    );
    k.iter()
        .zip(m)
        .fold(0.0f64, |e, (k, m)| e.max((m / law.moment(*k) - 1.0).abs()))
}

fn text(out: &MemoryArtifact) -> (String, String) {
    let file = &out.attributes["files"][0];
    (
        file["name"].as_str().unwrap().into(),
        file["text"].as_str().unwrap().into(),
    )
}

#[test]
fn two_scans_give_law_conditioning_and_a_complete_material() {
    let folder = tempfile::tempdir().unwrap();
    let law = &BENDING[2];
    let files = [1, 2].map(|i| csv(folder.path(), &format!("s{i}.csv"), law, 0.02e-3, i));
    let parameters = json!({"profiles": files, "bending": "negative", "template": NCF, "report_at": [10.0, 40.0]});
    let out = run::<CharacteriseBending>(parameters, &[], &[]).unwrap();
    assert!(law_error(&out, law) < 0.01, "{}", law_error(&out, law));
    for (i, k) in [(1, 10.0), (2, 40.0)] {
        assert!((out.result(&format!("moment.{i}")) / law.moment(k) - 1.0).abs() < 0.01);
    }
    assert!(
        out.result("law_condition") > 10.0 && out.result("law_error") < out.result("linear_error")
    );
    let (name, material) = text(&out);
    assert_eq!(name, "material.yaml");
    let value: Value = serde_saphyr::from_str(&material).unwrap();
    let old: Value = serde_saphyr::from_str(&std::fs::read_to_string(NCF).unwrap()).unwrap();
    assert_eq!(value["with"]["shear"], old["with"]["shear"]);
    assert_eq!(
        value["with"]["bending"]["positive"],
        old["with"]["bending"]["positive"]
    );
    // The numbers of the file are those of the results, and have units that read back.
    let read = |key: &str, dimension| {
        let text = value["with"]["bending"]["negative"][key].as_str().unwrap();
        plyflow_model::units::parse_quantity(text, dimension).unwrap()
    };
    use plyflow_model::units::Dimension::{Curvature, Force, Moment};
    for (key, dimension) in [
        ("linear", Moment),
        ("asymptote", Force),
        ("scale", Curvature),
    ] {
        assert!(
            (read(key, dimension) / out.result(key) - 1.0).abs() < 1e-5,
            "{key}"
        );
    }
}

#[test]
fn plots_name_curves_that_are_there() {
    let out = run::<CharacteriseBending>(
        json!({"areal_mass": 0.44}),
        &[MemoryInput::new("profile", &coupon(&BENDING[1]))],
        &[],
    )
    .unwrap();
    let plots = out.attributes["plots"].as_array().unwrap();
    assert_eq!(plots.len(), 4);
    assert!(out.arrays.contains_key("curves/profile/curvature"));
    for series in plots.iter().flat_map(|p| p["series"].as_array().unwrap()) {
        let [x, y] = ["x", "y"].map(|a| &out.arrays[series[a].as_str().unwrap()]);
        assert_eq!(x.0, y.0);
        assert_eq!(x.0.len(), 1);
    }
    let (name, fragment) = text(&out);
    assert_eq!(name, "bending.yaml");
    assert!(
        fragment.contains("# A fragment") && fragment.contains("bending:\n  positive: {"),
        "{fragment}"
    );
}

#[test]
fn each_specimen_has_its_curves_and_their_spread_is_in_the_errors() {
    let folder = tempfile::tempdir().unwrap();
    let law = &BENDING[2];
    let files: Vec<PathBuf> = [(1, 0.9), (2, 1.1)]
        .iter()
        .map(|(i, factor)| {
            let [r0, r_inf, limit] = law.numbers;
            let numbers = [factor * r0, factor * r_inf, limit];
            let strip = PublishedBending { numbers, ..*law };
            csv(folder.path(), &format!("s{i}.csv"), &strip, 0.02e-3, *i)
        })
        .collect();
    let parameters = |files: &[PathBuf]| json!({"profiles": files, "areal_mass": law.areal_mass});
    let out = run::<CharacteriseBending>(parameters(&files), &[], &[]).unwrap();
    let one = run::<CharacteriseBending>(parameters(&files[..1]), &[], &[]).unwrap();
    // Half the difference of two is the standard error of their mean, 10 %; at 95 % that counts 12.7 times.
    assert!((out.result("law_error") / 12.706 - 0.1).abs() < 0.015);
    assert!(one.result("law_error") < 0.005);
    assert_eq!(
        (out.result("specimens"), one.result("specimens")),
        (2.0, 1.0)
    );
    let lines = |out: &MemoryArtifact, plot: usize| {
        let series = out.attributes["plots"][plot]["series"].as_array().unwrap();
        series.len()
    };
    // Plots of the profile, of the curvature, of the moment.
    assert_eq!([0, 1, 2].map(|p| lines(&out, p)), [4, 2, 3]);
    assert_eq!([0, 1, 2].map(|p| lines(&one, p)), [2, 1, 2]);
    assert!(out.arrays.contains_key("curves/profile_2/curvature"));
}

#[test]
fn parameters_at_their_bounds_are_warned_of_and_have_no_error() {
    let of = |numbers| {
        let strip = PublishedBending {
            numbers,
            ..BENDING[1]
        };
        let coupon = coupon(&strip);
        let inputs = [MemoryInput::new("profile", &coupon)];
        run::<CharacteriseBending>(json!({"areal_mass": 0.44}), &inputs, &[]).unwrap()
    };
    let [r0, r_inf, limit] = BENDING[1].numbers;
    // A constant stiffness, and a moment that is there before the strip bends.
    for (numbers, says) in [
        ([20.0 * r0, 0.0, limit], "use a longer overhang"),
        ([r0, r_inf, 1e-3 * limit], "saturated already"),
    ] {
        let out = of(numbers);
        assert_eq!(out.result("saturation_undetermined"), 1.0);
        assert!(!out.results.contains_key("scale_error"));
        let log = &out.log;
        assert!(log.iter().any(|l| l.contains(says)), "{log:?}");
    }
    let out = of([r0, r_inf, limit]);
    assert!(out.results.contains_key("scale_error"));
}

#[test]
fn a_simulated_coupon_gives_its_law_back_by_both_fits() {
    for law in &BENDING {
        for fit in ["tangent-angle", "deflection"] {
            let parameters = json!({"areal_mass": law.areal_mass, "fit": fit});
            let out = run::<CharacteriseBending>(
                parameters,
                &[MemoryInput::new("profile", &coupon(law))],
                &[],
            )
            .unwrap();
            println!(
                "{} {fit}: M(k) off by at most {:.4}",
                law.name,
                law_error(&out, law)
            );
            assert!(
                law_error(&out, law) < 0.01,
                "{} {fit}: {}",
                law.name,
                law_error(&out, law)
            );
            assert!((out.result("overhang") - law.overhang).abs() < 1e-4);
        }
    }
}

#[test]
fn a_characterisation_hands_its_material_to_the_next() {
    let positive = coupon(&BENDING[1]);
    let first = run::<CharacteriseBending>(
        json!({"template": NCF}),
        &[MemoryInput::new("profile", &positive)],
        &[],
    )
    .unwrap();
    let negative = coupon(&BENDING[2]);
    let inputs = [
        MemoryInput::new("profile", &negative),
        MemoryInput::new("material", &first),
    ];
    let out = run::<CharacteriseBending>(json!({"bending": "negative"}), &inputs, &[]).unwrap();
    let [a, b] = [&first, &out].map(|o| serde_saphyr::from_str::<Value>(&text(o).1).unwrap());
    assert_eq!(
        a["with"]["bending"]["positive"],
        b["with"]["bending"]["positive"]
    );
    assert_ne!(
        a["with"]["bending"]["negative"],
        b["with"]["bending"]["negative"]
    );
    let both = run::<CharacteriseBending>(json!({"template": NCF}), &inputs, &[]).unwrap_err();
    assert!(
        both.contains("`template`") && both.contains("`material`"),
        "{both}"
    );
}

#[test]
fn exactly_one_source_of_the_profile_is_asked_for() {
    let none = run::<CharacteriseBending>(json!({"areal_mass": 0.44}), &[], &[]).unwrap_err();
    assert!(
        none.contains("neither the parameter `profiles` nor the input `profile`"),
        "{none}"
    );
    let simulated = coupon(&BENDING[1]);
    let parameters = json!({"areal_mass": 0.44, "profiles": ["a.csv"]});
    let both =
        run::<CharacteriseBending>(parameters, &[MemoryInput::new("profile", &simulated)], &[])
            .unwrap_err();
    assert!(
        both.contains("both the parameter `profiles` and the input `profile`"),
        "{both}"
    );
    let massless =
        run::<CharacteriseBending>(json!({}), &[MemoryInput::new("profile", &simulated)], &[])
            .unwrap_err();
    assert!(massless.contains("`areal_mass`"), "{massless}");
}

#[test]
fn bad_profiles_are_refused_with_file_and_line() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |text: &str| {
        let path = folder.path().join("bad.csv");
        std::fs::write(&path, text).unwrap();
        run::<CharacteriseBending>(json!({"profiles": [path], "areal_mass": 0.44}), &[], &[])
            .unwrap_err()
    };
    let line = |x0: f64| {
        (0..40)
            .map(|i| format!("{},{}\n", x0 + f64::from(i), -0.02 * f64::from(i * i)))
            .collect::<String>()
    };
    for (text, expected) in [
        (
            "x [mm],y [mm]\n1,2\n".to_owned(),
            "bad.csv:1: there is no column 'z'",
        ),
        (
            "x [mm],z [N]\n1,2\n".to_owned(),
            "bad.csv:1: column 'z': the unit 'N' does not fit",
        ),
        (
            format!("x [mm],z [mm]\n{}40,NaN\n", line(0.0)),
            "bad.csv:42: column 'z': 'NaN'",
        ),
        (
            "x [mm],z [mm]\n0,0\n1,-1\n".to_owned(),
            "bad.csv: 2 rows of data",
        ),
        (
            format!("x [mm],z [mm]\n{}", line(5.0)),
            "bad.csv:2: the profile starts at x = 5.000 mm",
        ),
        (
            format!("x [mm],z [mm]\n{}20,-8\n", line(0.0)),
            "bad.csv:42: the points turn back",
        ),
        (
            format!("x [m],z [m]\n{}", line(0.0)),
            "bad.csv:5: column 'x [m]': 3 m is not plausible for a strip of fabric",
        ),
    ] {
        let e = refused(&text);
        assert!(e.contains(expected), "{e}");
    }
    let mut coupon = coupon(&BENDING[1]);
    coupon.arrays.remove("profile/z");
    let e = run::<CharacteriseBending>(
        json!({"areal_mass": 0.44}),
        &[MemoryInput::new("profile", &coupon)],
        &[],
    )
    .unwrap_err();
    assert!(e.contains("profile/z"), "{e}");
}

#[test]
fn one_file_is_one_specimen_and_units_that_no_strip_has_are_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let law = &BENDING[0];
    let [first, other] =
        [(1, "a.csv"), (2, "b.csv")].map(|(seed, name)| csv(folder.path(), name, law, 5e-5, seed));
    let step = |profiles: &[&PathBuf], areal_mass: f64| {
        let given = json!({"profiles": profiles, "areal_mass": areal_mass});
        run::<CharacteriseBending>(given, &[], &[])
    };
    let told = step(&[&first, &other, &first], law.areal_mass).err();
    assert!(told.unwrap().contains("a.csv has the rows of a.csv"));
    let sound = step(&[&first, &other], law.areal_mass).unwrap().log;
    let units = |log: &[String]| {
        log.iter()
            .filter(|l| l.contains("units of the header") || l.contains("areal mass is"))
            .count()
    };
    assert_eq!(units(&sound), 0, "{sound:?}");
    // A mass in g under kg, and lengths in cm under mm.
    let heavy = step(&[&first], 1e3 * law.areal_mass).unwrap().log;
    assert!(
        heavy.iter().any(|l| l.contains("the areal mass is")),
        "{heavy:?}"
    );
    let text = std::fs::read_to_string(&first).unwrap();
    let long = folder.path().join("long.csv");
    std::fs::write(&long, text.replace("[cm]", "[dm]").replace("[mm]", "[cm]")).unwrap();
    match step(&[&long], law.areal_mass) {
        Ok(out) => assert!(units(&out.log) > 0, "{:?}", out.log),
        Err(told) => assert!(told.contains("unit"), "{told}"),
    }
}
