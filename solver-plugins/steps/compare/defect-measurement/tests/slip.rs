//! Slip between plies: motions of which it is known.

use plyflow_defect_measurement::DefectMeasurement;
use plyflow_geometry::vec3::Vec3;
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, run};
use serde_json::{Value, json};

/// Thickness of a ply (m).
const T: f64 = 0.0004;

/// A flat ply on a grid, and where its places go.
fn ply(
    name: &str,
    bounds: [f64; 4],
    cells: [usize; 2],
    goes: &dyn Fn(f64, f64) -> Vec3,
) -> MemoryBody {
    let [x0, y0, x1, y1] = bounds;
    let [nx, ny] = cells;
    let place = |i: usize, j: usize| {
        [
            x0 + (x1 - x0) * i as f64 / nx as f64,
            y0 + (y1 - y0) * j as f64 / ny as f64,
            0.1,
        ]
    };
    let points: Vec<Vec3> = (0..=ny)
        .flat_map(|j| (0..=nx).map(move |i| (i, j)))
        .map(|(i, j)| place(i, j))
        .collect();
    let at = |i: usize, j: usize| (j * (nx + 1) + i) as u32;
    let quads = (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j)));
    let field = |name: &str| MemoryField {
        name: name.into(),
        on: On::Cells,
        components: 1,
        values: vec![0.0; nx * ny],
    };
    MemoryBody {
        name: name.into(),
        nodes_per_cell: 4,
        cells: quads
            .flat_map(|(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
            .collect(),
        frames: vec![points.iter().map(|p| goes(p[0], p[1])).collect()],
        points,
        fields: vec![vec![field("shear_angle")]],
        ..Default::default()
    }
}

fn artifact(plies: Vec<MemoryBody>) -> MemoryArtifact {
    let tool = MemoryBody {
        name: "tool".into(),
        points: [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
            .map(|[x, y]| [x, y, 0.0])
            .into(),
        nodes_per_cell: 3,
        cells: vec![0, 1, 2, 0, 2, 3],
        ..Default::default()
    };
    let sheet = |(k, b): (usize, &MemoryBody)| json!({"name": b.name, "kind": "ply", "offset": T * (k as f64 + 0.5), "thickness": T});
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"sheets": plies.iter().enumerate().map(sheet).collect::<Vec<_>>()}),
        times: vec![1.0],
        bodies: std::iter::once(tool).chain(plies).collect(),
        ..Default::default()
    }
}

fn measure(run_of: &MemoryArtifact, parameters: Value) -> Result<MemoryArtifact, String> {
    run::<DefectMeasurement>(parameters, &[MemoryInput::new("formed", run_of)], &[])
}

const LARGE: [f64; 4] = [-0.1, -0.06, 0.1, 0.06];
/// Lies on a part of the large one, on other nodes, and reaches out over one of its edges.
const SMALL: [f64; 4] = [-0.05, -0.05, 0.13, 0.05];

/// A section across the length through the middle, and one along it through (0, 20) mm.
fn sections() -> Value {
    json!([
        {"name": "O-O", "at": [0.0, 0.0], "direction": std::f64::consts::FRAC_PI_2},
        {"name": "L_1", "at": [0.0, 0.02], "direction": 0.0, "length": 0.06},
    ])
}

#[test]
fn a_ply_that_is_shifted_and_turned_on_one_of_another_outline_has_the_slip_of_that_motion() {
    let (shift, turn) = ([0.003, -0.002], 0.02f64);
    let flat = |x: f64, y: f64| [x, y, T];
    let turned = |x: f64, y: f64| {
        [
            x * turn.cos() - y * turn.sin() + shift[0],
            x * turn.sin() + y * turn.cos() + shift[1],
            2.0 * T,
        ]
    };
    let lower = ply("ply_1", LARGE, [40, 24], &flat);
    let upper = ply("ply_2", SMALL, [37, 23], &turned);
    let out = measure(
        &artifact(vec![lower, upper]),
        json!({"slip_sections": sections()}),
    )
    .unwrap();
    let body = out.body("ply_2");
    let (slip, on) = (body.last("slip"), body.last("slip_on"));
    let (along, across) = (body.last("slip_along"), body.last("slip_across"));
    let mut beyond = 0;
    for (k, p) in body.points.iter().enumerate() {
        if p[0] > 0.1 + 1e-9 {
            beyond += 1;
            assert_eq!((on[k], along[k]), (0.0, 0.0));
            continue;
        }
        let q = turned(p[0], p[1]);
        let way = [q[0] - p[0], q[1] - p[1], 0.0];
        assert_eq!(on[k], 1.0);
        let off = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        (0..3).for_each(|d| off(slip[3 * k + d], way[d]));
        off(along[k], way[0]);
        off(across[k], way[1]);
    }
    assert!(
        beyond > 0
            && out.body("ply_1").fields[0]
                .iter()
                .all(|f| !f.name.starts_with("slip"))
    );
    let near = |name: &str, value: f64| {
        let found = out.result(name);
        assert!((found - value).abs() < 1e-6, "{name}: {found} for {value}");
    };
    // Across the length the part along it is the shift and -sin(turn) y: even and odd about the middle.
    let y: Vec<f64> = (-50..=50).map(|k| f64::from(k) * 1e-3).collect();
    let rms = (y.iter().map(|y| y * y).sum::<f64>() / y.len() as f64).sqrt();
    let (even, odd) = (shift[0], turn.sin() * rms);
    near("section_slip_symmetric.O-O.along.ply_1.ply_2", even);
    near("section_slip_antisymmetric.O-O.along.ply_1.ply_2", odd);
    near(
        "section_slip_asymmetry.O-O.along.ply_1.ply_2",
        odd / even.hypot(odd),
    );
    near("section_slip_mean.O-O.along.ply_1.ply_2", even);
    near(
        "section_slip_max.O-O.along.ply_1.ply_2",
        even + turn.sin() * 0.05,
    );
    near(
        "section_slip_mean.L_1.across.ply_1.ply_2",
        shift[1] - (1.0 - turn.cos()) * 0.02,
    );
    near("section_slip_antisymmetric.L_1.across.ply_1.ply_2", {
        let x: Vec<f64> = (-30..=30).map(|k| f64::from(k) * 1e-3).collect();
        turn.sin() * (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt()
    });
    let (_, stations) = &out.arrays["slip/O-O/ply_1/ply_2/station"];
    assert_eq!((stations.len(), stations[0]), (101, -0.05));
    let (_, values) = &out.arrays["slip/O-O/ply_1/ply_2/along"];
    assert!((values[0] - (shift[0] + turn.sin() * 0.05)).abs() < 1e-12);
    // Largest at the corner (-50, -50) mm, a node of the upper ply.
    let largest = turned(-0.05, -0.05);
    near(
        "slip_max.ply_1.ply_2",
        (largest[0] + 0.05).hypot(largest[1] + 0.05),
    );
}

#[test]
fn what_moves_as_one_has_no_slip_however_it_is_turned() {
    // Plies at one distance, turned in space by 50 degrees about y and then by 30 about z: through the thickness they are not displaced alike.
    let (a, b) = (50f64.to_radians(), 30f64.to_radians());
    let at = |z: f64| {
        move |x: f64, y: f64| {
            let p = [x * a.cos() + z * a.sin(), y, z * a.cos() - x * a.sin()];
            [
                p[0] * b.cos() - p[1] * b.sin(),
                p[0] * b.sin() + p[1] * b.cos(),
                p[2] + 0.2,
            ]
        }
    };
    let plies = vec![
        ply("ply_1", LARGE, [20, 12], &at(T)),
        ply("ply_2", LARGE, [17, 10], &at(2.0 * T)),
    ];
    let out = measure(&artifact(plies), json!({"slip_sections": sections()})).unwrap();
    assert!(out.result("slip_max.ply_1.ply_2") < 1e-12);
    assert!(out.result("section_slip_max.O-O.across.ply_1.ply_2") < 1e-12);
}

#[test]
fn slip_around_a_bend_is_the_way_along_the_arc_less_what_its_thickness_takes() {
    // Bent around a cylinder along x, radius 50 mm for the lower ply; the upper one slides by 2 mm of its own arc.
    let r = 0.05;
    let on = |r: f64, way: f64| {
        move |x: f64, y: f64| {
            let a = (y + way) / r;
            [x, r * a.sin(), r * a.cos()]
        }
    };
    let plies = vec![
        ply("ply_1", LARGE, [10, 120], &on(r, 0.0)),
        ply("ply_2", LARGE, [10, 97], &on(r + T, 0.002)),
    ];
    let out = measure(&artifact(plies), json!({"slip_sections": sections()})).unwrap();
    let body = out.body("ply_2");
    let across = body.last("slip_across");
    for (k, p) in body.points.iter().enumerate() {
        // The same length lies on the larger radius over a smaller angle: the angle between both places, seen in the tangent plane of the lower one.
        let way = (r + T) * ((p[1] + 0.002) / (r + T) - p[1] / r).sin();
        // On an edge the normal is that of the last cell, half a cell's angle off; the thickness is seen under it.
        let half = 0.5 * (0.12 / 120.0) / r;
        let edge = if p[1].abs() > 0.0589 { half * T } else { 0.0 };
        assert!(
            (across[k] - way).abs() < 1e-6 + edge,
            "{} at {}: {} for {way}",
            k,
            p[1],
            across[k]
        );
    }
    assert!(out.result("slip_along_max.ply_1.ply_2") < 1e-12);
    // About the middle: 2 mm for all, and what the radius takes, odd.
    let odd = T / r * 0.06 / 3f64.sqrt();
    let found = out.result("section_slip_antisymmetric.O-O.across.ply_1.ply_2");
    assert!((found - odd).abs() < 0.02 * odd, "{found} for {odd}");
    let found = out.result("section_slip_symmetric.O-O.across.ply_1.ply_2");
    assert!((found - 0.002).abs() < 5e-6, "{found}");
}

#[test]
fn a_ply_past_the_end_of_the_one_below_slips_on_the_next_that_lies_there() {
    let by = |d: f64, z: f64| move |x: f64, y: f64| [x + d, y, z];
    let patch = [-0.1, -0.06, 0.0, 0.06];
    let plies = vec![
        ply("ply_1", LARGE, [20, 12], &by(0.0, T)),
        ply("patch", patch, [9, 12], &by(0.001, 2.0 * T)),
        ply("ply_3", LARGE, [20, 12], &by(0.004, 3.0 * T)),
    ];
    let section = json!({"slip_sections": [{"name": "all", "at": [0.0, 0.0], "direction": 0.0}]});
    let out = measure(&artifact(plies), section).unwrap();
    for (pair, value) in [
        ("ply_1.patch", 0.001),
        ("patch.ply_3", 0.003),
        ("ply_1.ply_3", 0.004),
    ] {
        assert!(
            (out.result(&format!("slip_mean.{pair}")) - value).abs() < 1e-12,
            "{pair}"
        );
        assert!(
            (out.result(&format!("section_slip_mean.all.along.{pair}")) - value).abs() < 1e-12,
            "{pair}"
        );
    }
    let on = out.body("ply_3").last("slip_on");
    let is = |x: f64, n: f64| {
        out.body("ply_3")
            .points
            .iter()
            .zip(on)
            .filter(|(p, _)| (p[0] - x).abs() < 1e-9)
            .all(|(_, o)| *o == n)
    };
    assert!(is(-0.05, 2.0) && is(0.0, 2.0) && is(0.05, 1.0));
    // Each pair lies on one side of the middle: no mirror image, nothing is told of parts, and that is said. At the middle itself the patch ends.
    assert!(
        !out.results
            .contains_key("section_slip_asymmetry.all.along.ply_1.ply_3")
    );
    assert!(out.log.join("\n").contains("mirror image about its middle"));
}

#[test]
fn what_is_wrong_with_a_slip_section_is_told() {
    let flat = |x: f64, y: f64| [x, y, T];
    let two = artifact(vec![
        ply("ply_1", LARGE, [8, 6], &flat),
        ply("ply_2", LARGE, [8, 6], &flat),
    ]);
    let one = artifact(vec![ply("ply_1", LARGE, [8, 6], &flat)]);
    let section = |name: &str, x: f64| json!({"name": name, "at": [x, 0.0], "direction": std::f64::consts::FRAC_PI_2, "length": 0.1});
    let refused = |of: &MemoryArtifact, sections: Value, step: f64| {
        measure(of, json!({"slip_sections": sections, "slip_step": step})).unwrap_err()
    };
    for (found, told) in [
        (
            refused(&one, json!([section("A", 0.0)]), 1e-3),
            "the run has one ply",
        ),
        (
            refused(&two, json!([section("A", 0.3)]), 1e-3),
            "meets no two plies",
        ),
        (
            refused(&two, json!([section("A-A'", 0.0)]), 1e-3),
            "cannot be a part of a result's name",
        ),
        (
            refused(&two, json!([section("A", 0.0), section("A", 0.01)]), 1e-3),
            "another one 'A'",
        ),
        (
            refused(&two, json!([section("A", 0.0)]), 1e-9),
            "expected at most 100000",
        ),
    ] {
        assert!(found.contains(told), "{found}");
    }
    let out = measure(&one, json!({})).unwrap();
    assert!(out.attributes["slip"].is_null());
}
