//! A coarse motion that is known, and zones in it.
#![allow(dead_code)] // Not every test file uses all of it.

use plyflow_boundary_interpolation::BoundaryInterpolation;
use plyflow_geometry::vec3::Vec3;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryInput, run};
use serde_json::{Value, json};

pub const TIMES: [f64; 6] = [0.0, 0.2, 0.4, 0.6, 0.8, 1.0];

/// A place that starts at (x, y, z) moves as a cubic in time and bilinearly in space.
pub fn motion(p: Vec3, t: f64) -> Vec3 {
    let s = t * t * (3.0 - 2.0 * t);
    [
        p[0] + 0.1 * s * p[1],
        p[1] - 0.05 * s,
        p[2] - s * (0.05 + 2.0 * p[0] * p[1]),
    ]
}

pub fn rectangle(b: [f64; 4]) -> Vec<[f64; 2]> {
    vec![[b[0], b[1]], [b[2], b[1]], [b[2], b[3]], [b[0], b[3]]]
}

pub fn coarse(bend: f64) -> MemoryArtifact {
    let sheet = |name: &str, half: [f64; 2], n: [usize; 2], z: f64| {
        let mut points = Vec::new();
        for j in 0..=n[1] {
            for i in 0..=n[0] {
                let at = |d: usize, i: usize| half[d] * (2.0 * i as f64 / n[d] as f64 - 1.0);
                points.push([at(0, i), at(1, j), z]);
            }
        }
        let node = |i: usize, j: usize| (j * (n[0] + 1) + i) as u32;
        let mut cells = Vec::new();
        for j in 0..n[1] {
            for i in 0..n[0] {
                cells.extend([
                    node(i, j),
                    node(i + 1, j),
                    node(i + 1, j + 1),
                    node(i, j + 1),
                ]);
            }
        }
        let at = |t: f64| {
            let moved = |p: &Vec3| {
                let [x, y, z] = motion(*p, t);
                [x, y, z + bend * t * p[1] * p[1]]
            };
            points.iter().map(moved).collect::<Vec<Vec3>>()
        };
        let frames = TIMES.map(at).to_vec();
        MemoryBody {
            name: name.into(),
            points,
            nodes_per_cell: 4,
            cells,
            frames,
            ..Default::default()
        }
    };
    let outline = rectangle([-0.24, -0.15, 0.24, 0.15]);
    let history = |v: [f64; 3]| (vec![3], v.to_vec());
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"scene": "s", "sheets": [
            {"name": "film_low", "kind": "diaphragm", "thickness": 0.00008, "offset": 0.00004},
            {"name": "ply_1", "kind": "ply", "thickness": 0.0004, "offset": 0.00028, "outline": outline}]}),
        arrays: [
            ("history/time".to_owned(), history([0.0, 0.5, 1.0])),
            (
                "history/cavity_pressure".to_owned(),
                history([1e5, 1e5, 0.0]),
            ),
            ("history/bag_pressure".to_owned(), history([0.0, 1e5, 1e5])),
        ]
        .into(),
        times: TIMES.to_vec(),
        bodies: vec![
            sheet("film_low", [0.9, 0.75], [37, 31], 0.100),
            sheet("ply_1", [0.24, 0.15], [48, 30], 0.101),
        ],
        ..Default::default()
    }
}

pub fn zones() -> MemoryArtifact {
    let zone =
        |name: &str, b: [f64; 4]| json!({"name": name, "box": b, "free_sides": vec![false; 4]});
    MemoryArtifact {
        kind: "zones".into(),
        attributes: json!({"zones": [zone("A", [-0.24, -0.15, -0.1, -0.02]), zone("B", [0.0, 0.0, 0.1, 0.1])]}),
        ..Default::default()
    }
}

pub fn interpolate(
    formed: &MemoryArtifact,
    parameters: Value,
    item: &[u64],
) -> Result<MemoryArtifact, String> {
    of_pass(formed, parameters, item, &[])
}

/// The coarse run is that of a pass of zone-feedback.
pub fn of_pass(
    formed: &MemoryArtifact,
    parameters: Value,
    item: &[u64],
    pass: &[u64],
) -> Result<MemoryArtifact, String> {
    let zones = zones();
    let inputs = [
        MemoryInput {
            step: "coarse_2",
            item: pass,
            ..MemoryInput::new("formed", formed)
        },
        MemoryInput::new("zones", &zones),
    ];
    run::<BoundaryInterpolation>(parameters, &inputs, item)
}
