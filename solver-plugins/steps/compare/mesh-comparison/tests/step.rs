//! Runs whose shear angles are known.

use plyflow_mesh_comparison::{MeshComparison, advise};
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, run};
use serde_json::json;

/// A strip of `n` cells over 0.1 m with shear angles g(x) (rad), each cell with that of its middle.
fn strip(n: usize, g: impl Fn(f64) -> f64) -> MemoryArtifact {
    let h = 0.1 / n as f64;
    let points: Vec<[f64; 3]> = (0..=n)
        .flat_map(|i| [[h * i as f64, 0.0, 0.0], [h * i as f64, 0.01, 0.0]])
        .collect();
    let cells = (0..n as u32)
        .flat_map(|i| [2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1])
        .collect();
    let values = (0..n).map(|i| g(h * (i as f64 + 0.5))).collect();
    let ply = MemoryBody {
        name: "ply_1".into(),
        nodes_per_cell: 4,
        cells,
        frames: vec![points.clone()],
        points,
        fields: vec![vec![MemoryField {
            name: "shear_angle".into(),
            on: On::Cells,
            components: 1,
            values,
        }]],
        ..Default::default()
    };
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"element_size": h, "elements": n,
            "sheets": [{"name": "film", "kind": "diaphragm", "thickness": 5e-5, "offset": 2.5e-5},
                {"name": "ply_1", "kind": "ply", "thickness": 0.0004, "offset": 2.5e-4}]}),
        times: vec![1.0],
        bodies: vec![ply],
        ..Default::default()
    }
}

fn compare(runs: &[MemoryArtifact]) -> Result<MemoryArtifact, String> {
    let steps = ["a", "b", "c", "d"];
    let inputs: Vec<MemoryInput<'_>> = (runs.iter().zip(steps))
        .map(|(r, step)| MemoryInput {
            step,
            cost: [2.0, 3.0, 0.0],
            ..MemoryInput::new("runs", r)
        })
        .collect();
    run::<MeshComparison>(json!({}), &inputs, &[])
}

#[test]
fn quartiles_extremes_and_their_order_are_those_of_the_angles() {
    // Shear grows evenly from -0.4 to 0.4 rad: cells of h miss the extremes by 4 h.
    let linear = |x: f64| 8.0 * x - 0.4;
    let runs = [100, 25, 50, 1000].map(|n| strip(n, linear));
    let out = compare(&runs).unwrap();
    let (_, sizes) = &out.arrays["study/element_size"];
    let sorted: Vec<bool> = sizes.windows(2).map(|w| w[0] > w[1]).collect();
    assert_eq!(sorted, [true; 3]);
    let (_, largest) = &out.arrays["study/shear_max"];
    for (h, g) in sizes.iter().zip(largest) {
        assert!((g - (0.4 - 4.0 * h)).abs() < 1e-12);
    }
    let (_, quarter) = &out.arrays["study/shear_q25"];
    assert!(
        quarter.iter().all(|q| (q + 0.2).abs() < 0.02),
        "{quarter:?}"
    );
    // Less the finest's own error, 1.0 becomes 1.06.
    let order = out.result("extreme_order");
    assert!((1.0..1.1).contains(&order), "{order}");
    assert_eq!(
        (
            out.result("quartile_error.d"),
            out.result("extreme_error.d")
        ),
        (0.0, 0.0)
    );
    assert!((out.result("extreme_error.b") - (0.016 - 4e-4) / (0.4 - 4e-4)).abs() < 1e-9);
    assert_eq!(out.measured["cost.c.cpu_seconds"], (3.0, "s".into()));
    assert_eq!(out.attributes["finest"], "d");
    // A box for each run, its arrays in the order of what they hold; what was measured is in the results alone.
    let series = &out.attributes["plots"][0]["series"][0];
    assert_eq!(series["style"], "box");
    let paths = series["y"].as_array().unwrap();
    assert_eq!(paths.len(), 7);
    for run in 0..4 {
        let value = |p: &serde_json::Value| out.arrays[p.as_str().unwrap()].1[run];
        let spread: Vec<f64> = paths.iter().map(value).collect();
        assert!(spread.windows(2).all(|w| w[0] <= w[1]), "{spread:?}");
    }
    let (_, low) = &out.arrays["study/shear_q01"];
    assert!((low[3] + 0.4 - 0.008).abs() < 1e-3, "{low:?}");
    let table = &out.attributes["tables"][0];
    assert_eq!(table["columns"][3]["measured"], "cost.{0}.cpu_seconds");
    let wide = table["columns"].as_array().unwrap().len();
    for row in table["rows"].as_array().unwrap() {
        assert_eq!(row.as_array().unwrap().len(), wide);
        assert!(row[3].is_null() && row[2].as_u64() > Some(20));
    }
    assert_eq!(
        out.attributes["tables"][0]["rows"]
            .as_array()
            .unwrap()
            .len(),
        4
    );
}

#[test]
fn one_run_and_two_of_the_finest_size_are_refused() {
    let error = compare(&[strip(10, |x| x)]).unwrap_err();
    assert!(error.contains("two or more"), "{error}");
    let error = compare(&[strip(10, |x| x), strip(20, |x| x), strip(20, |x| x)]).unwrap_err();
    assert!(error.contains("leave one out"), "{error}");
}

#[test]
fn advised_sizes_keep_the_target_by_the_power_law_of_the_errors() {
    // An error of 1 % (h / 1 mm)^p, of which the differences from the finest run are known.
    for p in [1.0, 1.4, 2.0] {
        let law = |h: f64| 0.01 * (h / 0.001).powf(p);
        let runs = [0.001, 0.002, 0.004, 0.008].map(|h| (h, law(h) - law(0.001)));
        for target in [0.02, 0.03, 0.05, 0.075] {
            let advice = advise(&runs, target);
            assert!(
                (law(advice.size) / target - 1.0).abs() < 1e-9,
                "{target}: {advice:?}"
            );
            assert!((advice.finest_error / 0.01 - 1.0).abs() < 1e-9);
            assert_eq!(advice.doubt, None);
        }
        // Below the finest run the error is taken to fall in proportion, which is on the safe side of its square.
        let advice = advise(&runs, 0.005);
        assert!((advice.size - 0.0005).abs() < 1e-12 && law(advice.size) < 0.005 + 1e-12);
        assert!(advice.doubt.unwrap().contains("0.500 mm"));
        // Never coarser than what was run.
        let advice = advise(&runs, 0.9);
        assert_eq!(advice.size, 0.008);
        assert!(advice.doubt.unwrap().contains("coarser one may do"));
        // Two runs tell no order: the finest has all of their difference once more, when it halves the size.
        let two = advise(&runs[..2], 0.9);
        assert!((two.finest_error - runs[1].1).abs() < 1e-12 && two.finest_error > 0.01 - 1e-12);
    }
    // An order of four among three runs is not believed.
    let steep = [(0.001, 0.0), (0.002, 0.015), (0.004, 0.255)];
    assert!((advise(&steep, 0.1).finest_error - 0.005).abs() < 1e-9);
    // A difference that is small by chance does not hide that of a finer run, nor make it steeper.
    let chance = [(0.001, 0.0), (0.002, 0.2), (0.004, 0.01), (0.008, 0.5)];
    let small = advise(&chance, 0.1);
    assert!(
        (small.finest_error - 0.2).abs() < 1e-9 && (small.size - 0.0005).abs() < 1e-12,
        "{small:?}"
    );
    let size = advise(&chance, 0.5).size;
    assert!(size > 0.004 && size < 0.008, "{size}");
    // Of two runs of one size the worse one counts.
    let twice = [(0.001, 0.0), (0.002, 0.01), (0.002, 0.03), (0.004, 0.09)];
    let once = [(0.001, 0.0), (0.002, 0.03), (0.004, 0.09)];
    assert_eq!(advise(&twice, 0.05), advise(&once, 0.05));
    // Runs that do not differ have no error to tell.
    let same = advise(&[(0.001, 0.0), (0.002, 0.0)], 0.1);
    assert_eq!((same.size, same.finest_error), (0.002, 0.0));
}

#[test]
fn the_artifact_holds_the_advice() {
    let runs = [
        strip(4, |x| 0.4 * x),
        strip(8, |x| 0.4 * x),
        strip(16, |x| 0.4 * x),
    ];
    let out = compare(&runs).unwrap();
    let size = out.result("advised_element_size");
    assert!(size > 0.0 && out.attributes["advised_element_size"] == size);
    assert_eq!(out.attributes["target_error"], 0.1);
}

#[test]
fn cells_that_a_net_does_not_reach_are_in_no_quantile() {
    let runs = [50, 100].map(|n| {
        let mut run = strip(n, |x| if x < 0.08 { x } else { 9.0 });
        let values = (0..n).map(|c| f64::from(u8::from(c < 4 * n / 5))).collect();
        run.bodies[0].fields[0].push(MemoryField {
            name: "draped".into(),
            on: On::Cells,
            components: 1,
            values,
        });
        run
    });
    let out = compare(&runs).unwrap();
    let (_, largest) = &out.arrays["study/shear_max"];
    assert!(largest.iter().all(|g| *g < 0.08), "{largest:?}");
    let told = out.log.iter().filter(|l| l.contains("80.0 % of its area"));
    assert_eq!(told.count(), 2, "{:?}", out.log);
}

#[test]
fn plies_that_are_hardly_sheared_ask_for_no_finer_mesh() {
    // What rounding leaves of a flat ply, another one in every mesh.
    let noise = |k: f64| move |x: f64| 4e-13 * (k * x).sin();
    let runs = [(25, 7.0), (50, 31.0), (100, 113.0)].map(|(n, k)| strip(n, noise(k)));
    let out = compare(&runs).unwrap();
    assert!(out.result("quartile_error.b") < 1e-8);
    // Never coarser than the coarsest.
    assert!((out.result("advised_element_size") - 0.004).abs() < 1e-9);
    let told = |l: &String| l.contains("sheared by 0.00 deg at most");
    assert!(out.log.iter().any(told), "{:?}", out.log);
}
