//! Runs of zones whose distances from the tool are known.

use plyflow_mesh_comparison::MeshComparison;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryInput, flat_grid, run};
use serde_json::{Value, json};

/// A ply of 80 x 40 mm over a flat tool that stands off it by (1 + 25 h) times a ramp, which every mesh has exactly.
fn zone(name: &str, size: f64) -> MemoryArtifact {
    let (points, cells) = flat_grid([0.0, 0.0, 0.08, 0.04], size, 0.3);
    let formed = points
        .iter()
        .map(|p| [p[0], p[1], (1.0 + 25.0 * size) * (0.001 + 0.05 * p[0])])
        .collect();
    let ply = MemoryBody {
        name: "ply_1".into(),
        nodes_per_cell: 4,
        cells,
        frames: vec![formed],
        points,
        ..Default::default()
    };
    let tool = MemoryBody {
        name: "tool".into(),
        points: vec![
            [-1.0, -1.0, 0.0],
            [1.0, -1.0, 0.0],
            [1.0, 1.0, 0.0],
            [-1.0, 1.0, 0.0],
        ],
        nodes_per_cell: 3,
        cells: vec![0, 1, 2, 0, 2, 3],
        ..Default::default()
    };
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"element_size": size, "elements": 1, 
            "zone": {"name": name, "box": [-0.1, -0.1, 0.1, 0.1], "free_sides": [false, false, false, false]},
            "sheets": [{"name": "ply_1", "kind": "ply", "thickness": 0.0004, "offset": 0.0}]}),
        times: vec![1.0],
        bodies: vec![tool, ply],
        ..Default::default()
    }
}

fn compare(runs: &[(&str, &MemoryArtifact)], target: f64) -> Result<MemoryArtifact, String> {
    let inputs: Vec<MemoryInput<'_>> = (runs.iter())
        .map(|&(step, artifact)| MemoryInput {
            step,
            ..MemoryInput::new("runs", artifact)
        })
        .collect();
    run::<MeshComparison>(json!({"target_error": target}), &inputs, &[])
}

#[test]
fn every_zone_gets_a_size_from_the_errors_of_its_own_runs() {
    let runs = [
        zone("A", 0.008),
        zone("B", 0.008),
        zone("A", 0.004),
        zone("B", 0.002),
        zone("A", 0.002),
    ];
    let steps = ["coarse", "coarse", "middle", "fine", "fine"];
    let runs: Vec<(&str, &MemoryArtifact)> = steps.into_iter().zip(&runs).collect();
    let out = compare(&runs, 0.1).unwrap();
    let error = |h: f64| (1.0 + 25.0 * h) / (1.0 + 25.0 * 0.002) - 1.0;
    for (step, zone, h) in [
        ("coarse", "A", 0.008),
        ("middle", "A", 0.004),
        ("coarse", "B", 0.008),
    ] {
        let found = out.result(&format!("zone_error.{step}.{zone}"));
        assert!(
            (found - error(h)).abs() < 1e-9,
            "{step} {zone}: {found} {}",
            error(h)
        );
    }
    assert!(out.result("zone_error.fine.A") < 1e-12);
    // A grows in proportion to the size: 2 mm have 5 / 105. B has two runs, which are taken to do so.
    let own = |h: f64| error(h) / (h / 0.002 - 1.0);
    for name in ["A", "B"] {
        let found = out.result(&format!("finest_error.{name}"));
        assert!((found - own(0.008)).abs() < 1e-6, "{name}: {found}");
    }
    // A: a power between 4 and 8 mm; B: one between 2 and 8 mm.
    let whole = |h: f64| error(h) + own(0.008);
    let power =
        |a: f64, b: f64| a * (b / a).powf((0.1 / whole(a)).ln() / (whole(b) / whole(a)).ln());
    let expected = [power(0.004, 0.008), power(0.002, 0.008)];
    let zones = out.attributes["zones"].as_array().unwrap();
    for (k, name) in ["A", "B"].into_iter().enumerate() {
        let size = out.result(&format!("advised_element_size.{name}"));
        assert!((size / expected[k] - 1.0).abs() < 1e-6, "{name}: {size}");
        assert_eq!(
            (&zones[k]["name"], &zones[k]["element_size"]),
            (&json!(name), &json!(size))
        );
    }
    assert!(!out.results.contains_key("advised_element_size"));
}

/// A ply on a flat top and down a wall 50 mm high, 2 (1 + 25 h) mm off both; but where it hangs past the wall's lower end it lies anywhere.
#[test]
fn what_hangs_at_the_tool_s_foot_is_not_judged() {
    let run_off = |size: f64| {
        let mut run = zone("A", size);
        let corners = [[-1.0, 0.0], [0.06, 0.0], [0.06, -0.05]];
        run.bodies[0].points = (corners.iter())
            .flat_map(|[x, z]| [-1.0, 1.0].map(|y| [*x, y, *z]))
            .collect();
        run.bodies[0].cells = vec![0, 2, 1, 1, 2, 3, 2, 4, 3, 3, 4, 5];
        let off = 0.002 * (1.0 + 25.0 * size);
        let place = |p: &[f64; 3]| match p[0] {
            x if x < 0.0601 => [x, p[1], off],
            x if x < 0.077 => [0.06 + off, p[1], -2.4 * (x - 0.06)],
            x => [0.06 + off + 2.5 * size, p[1], -2.4 * (x - 0.06)],
        };
        let ply = &mut run.bodies[1];
        ply.frames = vec![ply.points.iter().map(place).collect()];
        run
    };
    let (coarse, fine) = (run_off(0.008), run_off(0.002));
    let error = |parameters: Value| {
        let of = |step, run| MemoryInput {
            step,
            ..MemoryInput::new("runs", run)
        };
        let inputs = [of("coarse", &coarse), of("fine", &fine)];
        let out = run::<MeshComparison>(parameters, &inputs, &[]).unwrap();
        out.result("zone_error.coarse.A")
    };
    let known = (1.0 + 25.0 * 0.008) / (1.0 + 25.0 * 0.002) - 1.0;
    let found = error(json!({}));
    assert!((found - known).abs() < 1e-9, "{found} {known}");
    let found = error(json!({"foot_margin": 0.0}));
    assert!(found > 2.0 * known, "{found} {known}");
}

#[test]
fn zones_with_one_run_drawn_again_or_mixed_with_the_whole_are_refused() {
    let (a, b) = (zone("A", 0.008), zone("A", 0.004));
    let lone = zone("B", 0.004);
    let error = compare(&[("x", &a), ("y", &b), ("y", &lone)], 0.1).unwrap_err();
    assert!(error.contains("zone B has one run"), "{error}");
    let error = compare(&[("x", &a), ("y", &a)], 0.1).unwrap_err();
    assert!(
        error.contains("'x' and 'y' are both the finest of zone A, with 8 mm"),
        "{error}"
    );
    let mut grown = zone("A", 0.004);
    grown.attributes["zone"]["box"] = json!([-0.2, -0.1, 0.1, 0.1]);
    let error = compare(&[("x", &a), ("y", &grown)], 0.1).unwrap_err();
    assert!(
        error.contains("zone A of 'y' has the box [-0.2,") && error.contains("one list of zones"),
        "{error}"
    );
    let mut whole = zone("A", 0.004);
    whole.attributes["zone"] = Value::Null;
    let error = compare(&[("x", &a), ("y", &whole)], 0.1).unwrap_err();
    assert!(error.contains("some of the runs are of zones"), "{error}");
}
