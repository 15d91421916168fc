//! Censuses whose numbers are known, side by side.

use plyflow_census_comparison::{CensusComparison, never_falls, never_rises, relative_distance};
use plyflow_geometry::vec3::Vec3;
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, run};
use serde_json::{Value, json};

/// Cells along a side of 0.1 m.
const N: usize = 10;

/// A census of a level ply with so many wrinkles of that width (m), half of them sheared negatively; deviation (m) of
/// all nodes, and moments (N) if given: none on the ply's edge.
fn census(wrinkles: usize, width: f64, deviation: f64, moment: Option<f64>) -> MemoryArtifact {
    let wave = |k: usize| {
        json!({"angle": k, "z": 0.0, "height": -1e-3 * (k + 1) as f64, "prominence": 1e-3,
        "width": width, "shear": if k.is_multiple_of(2) { 0.1 } else { -0.1 }, "length": 0.03})
    };
    let waves: Vec<Value> = (0..wrinkles).map(wave).collect();
    let node = |i: usize, j: usize| (j * (N + 1) + i) as u32;
    let points: Vec<Vec3> = (0..(N + 1) * (N + 1))
        .map(|k| {
            [
                0.01 * (k % (N + 1)) as f64,
                0.01 * (k / (N + 1)) as f64,
                0.0,
            ]
        })
        .collect();
    let cells: Vec<u32> = (0..N * N)
        .flat_map(|k| {
            let (i, j) = (k % N, k / N);
            [
                node(i, j),
                node(i + 1, j),
                node(i + 1, j + 1),
                node(i, j + 1),
            ]
        })
        .collect();
    let field = |name: &str, values: Vec<f64>| MemoryField {
        name: name.into(),
        on: On::Points,
        components: 1,
        values,
    };
    let mut fields = vec![field("deviation", vec![deviation; points.len()])];
    if let Some(m) = moment {
        let inside = |k: usize| (1..N).contains(&(k % (N + 1))) && (1..N).contains(&(k / (N + 1)));
        let values = (0..points.len()).map(|k| if inside(k) { m } else { 0.0 });
        fields.push(field("bending_moment", values.collect()));
    }
    let curve = |plot: &str, label: &str, name: &str, x: &str| json!({"plot": plot, "label": label, "x": format!("curves/{name}/{x}"), "y": format!("curves/{name}/height")});
    let array = |values: &[f64]| (vec![values.len()], values.to_vec());
    MemoryArtifact {
        kind: "census".into(),
        attributes: json!({
            "ply": "ply_1", "circles": [{"radius": 0.08, "wrinkles": waves}],
            "cross_sections": [{"label": "A-A'", "result": "a_a", "wrinkles": []}],
            "curves": [curve("circles", "radius 80 mm", "circle_0", "angle"),
                       curve("cross_sections", "A-A'", "cross_section_0", "distance")],
        }),
        arrays: [
            ("curves/circle_0/angle".to_owned(), array(&[0.0, 3.0])),
            (
                "curves/circle_0/height".to_owned(),
                array(&[0.0, deviation]),
            ),
            (
                "curves/cross_section_0/distance".to_owned(),
                array(&[-0.1, 0.0, 0.1]),
            ),
            (
                "curves/cross_section_0/height".to_owned(),
                array(&[0.0, deviation, 0.0]),
            ),
        ]
        .into(),
        times: vec![0.0],
        bodies: vec![MemoryBody {
            name: "ply_1".into(),
            nodes_per_cell: 4,
            cells,
            frames: vec![points.clone()],
            points,
            fields: vec![fields],
            ..Default::default()
        }],
        ..Default::default()
    }
}

/// The memory host names the step of an input after its port and place.
fn compare(with: Value, all: &[MemoryArtifact]) -> Result<MemoryArtifact, String> {
    let items: Vec<[u64; 1]> = (0..all.len() as u64).map(|i| [i]).collect();
    let inputs: Vec<MemoryInput<'_>> = (all.iter().zip(&items))
        .map(|(artifact, item)| MemoryInput {
            item,
            ..MemoryInput::new("censuses", artifact)
        })
        .collect();
    run::<CensusComparison>(with, &inputs, &[]).map_err(|e| format!("{e:?}"))
}

/// The names of the runs in the order of the workflow.
fn names(all: &[MemoryArtifact]) -> Vec<String> {
    let found = compare(json!({}), all).unwrap();
    let runs = found.attributes["runs"].as_array().unwrap();
    runs.iter()
        .map(|r| r["name"].as_str().unwrap().to_owned())
        .collect()
}

fn four() -> [MemoryArtifact; 4] {
    [
        census(9, 0.005, 3e-3, None),
        census(4, 0.012, 2e-3, Some(0.03)),
        census(3, 0.020, 1e-3, Some(0.02)),
        census(6, 0.010, 2e-3, Some(0.01)),
    ]
}

#[test]
fn runs_stand_in_the_order_given_with_their_numbers() {
    let all = four();
    let n = names(&all);
    // Another order than that of the inputs; the membrane has no stiffness, nor has the last.
    let runs = json!([
        {"step": n[3], "label": "nonlinear"},
        {"step": n[0], "label": "membrane"},
        {"step": n[2], "label": "stiff", "bending_stiffness": 4e-4},
        {"step": n[1], "label": "soft", "bending_stiffness": 2e-5},
    ]);
    let found = compare(json!({ "runs": runs }), &all).unwrap();
    let table = &found.attributes["tables"][0];
    let columns: Vec<&str> = table["columns"]
        .as_array()
        .unwrap()
        .iter()
        .map(|c| c["label"].as_str().unwrap())
        .collect();
    let at = |row: usize, column: &str| {
        let k = columns.iter().position(|c| *c == column).unwrap();
        table["rows"][row][k].clone()
    };
    let column = |name: &str| -> Vec<Value> { (0..4).map(|r| at(r, name)).collect() };
    assert_eq!(column("run"), ["nonlinear", "membrane", "stiff", "soft"]);
    assert_eq!(column("wrinkles"), [6, 9, 3, 4]);
    assert_eq!(column("positive shear"), [3, 5, 2, 2]);
    assert_eq!(
        column("bending stiffness"),
        [Value::Null, Value::Null, json!(4e-4), json!(2e-5)]
    );
    // Heights 1, 2, 3 mm.
    assert!((at(2, "mean height").as_f64().unwrap() - 2e-3).abs() < 1e-15);
    assert!((at(2, "largest height").as_f64().unwrap() - 3e-3).abs() < 1e-15);
    assert!((at(2, "mean deviation").as_f64().unwrap() - 1e-3).abs() < 1e-15);
    // The edge of the ply has no moment and does not count; a membrane has none at all.
    assert!((at(3, "mean bending moment").as_f64().unwrap() - 0.03).abs() < 1e-15);
    assert_eq!(at(1, "mean bending moment"), Value::Null);
    assert_eq!((found.result("falls"), found.result("grows")), (1.0, 1.0));
    assert_eq!(found.result(&format!("wrinkles.{}", n[2])), 3.0);
}

#[test]
fn curves_lie_over_each_other_and_plies_side_by_side() {
    let all = four();
    let found = compare(json!({}), &all).unwrap();
    let plots = found.attributes["plots"].as_array().unwrap();
    let of = |name: &str| plots.iter().find(|p| p["name"] == name).unwrap();
    assert_eq!(of("cross_sections_0")["title"], "A-A'");
    for (plot, runs) in [
        ("circles_0", 4),
        ("cross_sections_0", 4),
        ("deviation_density", 4),
        ("bending_moment_density", 3),
    ] {
        let series = of(plot)["series"].as_array().unwrap();
        assert_eq!(series.len(), runs, "{plot}");
        for s in series {
            let size = |axis: &str| found.arrays[s[axis].as_str().unwrap()].1.len();
            assert_eq!(size("x"), size("y"), "{plot}");
        }
    }
    // All densities share their bins and integrate to one.
    let width = |values: &[f64]| values[1] - values[0];
    for s in of("deviation_density")["series"].as_array().unwrap() {
        let [x, y] = ["x", "y"].map(|a| &found.arrays[s[a].as_str().unwrap()].1);
        assert!((y.iter().sum::<f64>() * width(x) - 1.0).abs() < 1e-9);
    }
    let maps = found.attributes["maps"].as_array().unwrap();
    let panels = |k: usize| maps[k]["panels"].as_array().unwrap().len();
    assert_eq!((maps.len(), panels(0), panels(1)), (2, 4, 3));
    assert_eq!(found.bodies.len(), 4);
    // Without stiffnesses nothing is said of how the number changes.
    assert!(!found.results.contains_key("falls"));
}

#[test]
fn a_number_that_rises_with_the_stiffness_is_told() {
    let all = [census(3, 0.02, 1e-3, None), census(5, 0.01, 1e-3, None)];
    let n = names(&all);
    let runs = json!([{"step": n[0], "bending_stiffness": 1e-5}, {"step": n[1], "bending_stiffness": 1e-4}]);
    let found = compare(json!({ "runs": runs }), &all).unwrap();
    assert_eq!((found.result("falls"), found.result("grows")), (0.0, 0.0));
    assert!(never_rises(&[[2.0, 3.0], [1.0, 3.0], [3.0, 1.0]]));
    assert!(!never_rises(&[[1.0, 2.0], [3.0, 1.0], [2.0, 3.0]]));
    assert!(never_falls(&[[2.0, 4.0], [1.0, 3.0]]) && !never_falls(&[[2.0, 2.0], [1.0, 3.0]]));
}

#[test]
fn a_run_without_wrinkles_has_no_width_that_could_fall() {
    let all = [
        census(4, 0.01, 1e-3, None),
        census(2, 0.02, 1e-3, None),
        census(0, 0.0, 1e-3, None),
    ];
    let n = names(&all);
    let runs = json!([{"step": n[0], "bending_stiffness": 1e-5}, {"step": n[1], "bending_stiffness": 1e-4},
                      {"step": n[2], "bending_stiffness": 1e-3}]);
    let found = compare(json!({ "runs": runs }), &all).unwrap();
    assert_eq!((found.result("falls"), found.result("grows")), (1.0, 1.0));
    let n = names(&all[1..]);
    let runs = json!([{"step": n[0], "bending_stiffness": 1e-4}, {"step": n[1], "bending_stiffness": 1e-3}]);
    let found = compare(json!({ "runs": runs }), &all[1..]).unwrap();
    assert_eq!(found.result("falls"), 1.0);
    assert!(!found.results.contains_key("grows"));
}

#[test]
fn runs_that_do_not_fit_the_wires_are_refused() {
    let all = [census(3, 0.02, 1e-3, None), census(5, 0.01, 1e-3, None)];
    let n = names(&all);
    let told = |runs: Value| compare(json!({ "runs": runs }), &all).unwrap_err();
    let one = told(json!([{"step": n[0]}]));
    assert!(
        one.contains(&n[1]) && one.contains("give it an entry"),
        "{one}"
    );
    let unknown = told(json!([{"step": n[0]}, {"step": n[1]}, {"step": "other"}]));
    assert!(
        unknown.contains("'other'") && unknown.contains(&n[0]),
        "{unknown}"
    );
    let twice = told(json!([{"step": n[0]}, {"step": n[1]}, {"step": n[0]}]));
    assert!(twice.contains("twice"), "{twice}");
    let same = told(
        json!([{"step": n[0], "bending_stiffness": 1e-4}, {"step": n[1], "bending_stiffness": 1e-4}]),
    );
    assert!(
        same.contains("same bending_stiffness") && same.contains(&n[1]),
        "{same}"
    );
}

#[test]
fn runs_are_held_against_one_of_them() {
    let all = four();
    let n = names(&all);
    let found = compare(json!({"reference": n[3]}), &all).unwrap();
    let of = |what: &str, k: usize| found.result(&format!("{what}.{}", n[k]));
    assert!((of("bending_moment_ratio", 1) - 3.0).abs() < 1e-12);
    assert!((of("deviation_ratio", 2) - 0.5).abs() < 1e-12);
    // A membrane has no moments, and the reference is not held against itself.
    for (what, k) in [("bending_moment_ratio", 0), ("deviation_ratio", 3)] {
        assert!(!found.results.contains_key(&format!("{what}.{}", n[k])));
    }
    // Tops of 1 and 2 mm at the middle of three places: 1 mm / sqrt(3) over the 2 mm of the reference.
    let error = |k: usize| found.result(&format!("section_error.{}.a_a", n[k]));
    assert!((error(2) - 0.5 / 3f64.sqrt()).abs() < 1e-12, "{}", error(2));
    assert_eq!(error(1), 0.0);
    let told = compare(json!({"reference": "other"}), &all).unwrap_err();
    assert!(told.contains("'other'") && told.contains(&n[0]), "{told}");
}

#[test]
fn profiles_with_other_places_are_compared_where_both_are() {
    // A slope against one 0.1 higher, at other places, and beyond its end: root mean square 0.1 over a height of 1.
    let slope: Vec<[f64; 2]> = (0..=10).map(|k| [0.1 * f64::from(k); 2]).collect();
    let other: Vec<[f64; 2]> = (0..=9)
        .map(|k| [0.09 * f64::from(k), 0.09 * f64::from(k) + 0.1])
        .collect();
    assert!((relative_distance(&slope, &other).unwrap() - 0.1).abs() < 1e-12);
    assert_eq!(relative_distance(&slope, &[]), None);
    assert_eq!(relative_distance(&[[0.0, 1.0], [1.0, 1.0]], &slope), None);
}

/// Two circles whose radii differ by 0.8 mm, labelled as wrinkle-census does, and as it did before.
#[test]
fn circles_close_to_each_other_keep_their_curves() {
    let with_second = |height: f64, labels: [&str; 2]| {
        let mut census = census(3, 0.02, 1e-3, None);
        let curves = census.attributes["curves"].as_array_mut().unwrap();
        curves[0]["label"] = json!(labels[0]);
        curves.push(json!({"plot": "circles", "label": labels[1], "x": "curves/circle_1/angle", "y": "curves/circle_1/height"}));
        let array = |values: &[f64]| (vec![values.len()], values.to_vec());
        let second = [
            ("angle", array(&[0.0, 3.0])),
            ("height", array(&[0.0, height])),
        ];
        for (what, values) in second {
            let path = format!("curves/circle_1/{what}");
            census.arrays.insert(path, values);
        }
        census
    };
    for labels in [["radius 80.4 mm", "radius 79.6 mm"], ["radius 80 mm"; 2]] {
        let all = [0.5, 0.7].map(|height| with_second(height, labels));
        let found = compare(json!({}), &all).unwrap();
        let plots = found.attributes["plots"].as_array().unwrap();
        let shown: Vec<Vec<f64>> = (plots.iter())
            .filter(|p| p["title"].as_str().unwrap().starts_with("radius"))
            .map(|p| {
                let series = p["series"].as_array().unwrap().iter();
                let last = |s: &Value| found.arrays[s["y"].as_str().unwrap()].1[1];
                series.map(last).collect()
            })
            .collect();
        assert_eq!(shown, [[1e-3, 1e-3], [0.5, 0.7]], "{labels:?}");
    }
}
