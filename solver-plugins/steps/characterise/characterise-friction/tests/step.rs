//! The step on pulls of known friction.

use plyflow_characterisation::synthetic::{Noise, sled_coefficient};
use plyflow_characterise_friction::CharacteriseFriction;
use plyflow_testing::run;
use serde_json::json;
use std::path::{Path, PathBuf};

fn pull(folder: &Path, name: &str, peak: f64, dynamic: f64, seed: u64) -> PathBuf {
    let mut random = Noise::new(seed);
    let rows: String = (0..=1250)
        .map(|i| 0.2e-3 * f64::from(i))
        .map(|s| {
            (
                s,
                5.0 * (sled_coefficient(peak, dynamic, 0.01, s) + 0.002 * random.normal()),
            )
        })
        .map(|(s, f)| format!("{},{f}\n", 1e3 * s))
        .collect();
    let path = folder.join(name);
    std::fs::write(&path, format!("displacement [mm],force [N]\n{rows}")).unwrap();
    path
}

#[test]
fn peak_mean_and_deviation_of_known_pulls_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let given = [0.33, 0.36, 0.39];
    let paths: Vec<PathBuf> = (0..3)
        .map(|i| {
            pull(
                folder.path(),
                &format!("p{i}.csv"),
                given[i] + 0.1,
                given[i],
                i as u64,
            )
        })
        .collect();
    let out = run::<CharacteriseFriction>(json!({"pulls": paths, "normal_force": 5.0}), &[], &[])
        .unwrap();
    // 12.5 periods of the stick-slip lie in the window: half a period of 8 mm over 100 mm is left, 5e-4.
    assert!(
        (out.result("dynamic_coefficient") - 0.36).abs() < 8e-4,
        "{}",
        out.result("dynamic_coefficient")
    );
    assert!((out.result("dynamic_deviation") - 0.03).abs() < 8e-4);
    // The largest of noisy values lies a little above the true peak.
    assert!((out.result("static_coefficient") - 0.46).abs() < 0.006);
    let scatter = (0.5 * 0.01f64.powi(2) + 0.002f64.powi(2)).sqrt();
    assert!(
        (out.result("scatter") - scatter).abs() < 0.1 * scatter,
        "{}",
        out.result("scatter")
    );
    let text = out.attributes["files"][0]["text"].as_str().unwrap();
    assert!(text.contains("friction:\n  fabric_fabric: 0.3"), "{text}");
    let by_mass = json!({"pulls": paths, "sled_mass": 5.0 / 9.80665});
    let same = run::<CharacteriseFriction>(by_mass, &[], &[]).unwrap();
    assert!((same.result("dynamic_coefficient") - out.result("dynamic_coefficient")).abs() < 1e-12);
}

#[test]
fn what_is_missing_or_wrong_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let good = pull(folder.path(), "p.csv", 0.4, 0.3, 1);
    let bad = folder.path().join("bad.csv");
    let refused = |text: &str| {
        std::fs::write(&bad, text).unwrap();
        run::<CharacteriseFriction>(json!({"pulls": [bad], "normal_force": 5.0}), &[], &[])
            .unwrap_err()
    };
    assert!(
        refused("displacement [mm],pull [N]\n1,2\n")
            .contains("bad.csv:1: there is no column 'force'")
    );
    assert!(refused("displacement [mm],force [mm]\n1,2\n").contains("the unit 'mm' does not fit"));
    assert!(refused("displacement [mm],force [N]\n1,NaN\n").contains("bad.csv:2"));
    assert!(refused("displacement [mm],force [N]\n").contains("covers"));
    let error = |with| run::<CharacteriseFriction>(with, &[], &[]).unwrap_err();
    assert!(error(json!({"pulls": [good]})).contains("neither `normal_force` nor `sled_mass`"));
    assert!(
        error(json!({"pulls": [good], "normal_force": 5.0, "sled_mass": 0.5})).contains("both")
    );
    assert!(error(json!({"pulls": [], "normal_force": 5.0})).contains("`pulls` is empty"));
}

#[test]
fn a_window_from_the_first_row_has_no_static_coefficient() {
    let folder = tempfile::tempdir().unwrap();
    let path = pull(folder.path(), "p.csv", 0.4, 0.3, 1);
    let of = |from: f64| {
        let with = json!({"pulls": [path], "normal_force": 5.0, "from": from});
        run::<CharacteriseFriction>(with, &[], &[]).unwrap()
    };
    let text = |out: &plyflow_testing::MemoryArtifact| {
        out.attributes["files"][0]["text"]
            .as_str()
            .unwrap()
            .to_owned()
    };
    let whole = of(0.0);
    assert!(!whole.results.contains_key("static_coefficient"));
    assert!(!text(&whole).contains("static"), "{}", text(&whole));
    let later = of(0.1);
    assert!(later.results.contains_key("static_coefficient") && text(&later).contains("static"));
}

#[test]
fn one_file_is_one_pull_and_a_sled_is_pulled_less_than_a_metre() {
    let folder = tempfile::tempdir().unwrap();
    let first = pull(folder.path(), "a.csv", 0.4, 0.3, 1);
    let other = pull(folder.path(), "b.csv", 0.4, 0.3, 2);
    let copy = folder.path().join("c.csv");
    std::fs::copy(&first, &copy).unwrap();
    let refused = |pulls: &[&PathBuf]| {
        let given = json!({"pulls": pulls, "normal_force": 5.0});
        run::<CharacteriseFriction>(given, &[], &[]).err()
    };
    assert_eq!(refused(&[&first, &other]), None);
    for twice in [[&first, &other, &first], [&other, &first, &copy]] {
        let told = refused(&twice).expect("two pulls of one file");
        assert!(told.contains("has the rows of a.csv"), "{told}");
    }
    let text = std::fs::read_to_string(&first).unwrap();
    std::fs::write(&copy, text.replace("[mm]", "[m]")).unwrap();
    let told = refused(&[&copy]).expect("a pull of 250 m");
    assert!(told.contains("column 'displacement [m]'"), "{told}");
}
