//! A ply with a known wrinkle and bridge, and scans of it.
#![allow(dead_code)] // Not every test file uses all of it.

use plyflow_defect_measurement::DefectMeasurement;
use plyflow_geometry::vec3::Vec3;
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, run};
use serde_json::{Value, json};
use std::f64::consts::PI;
use std::fmt::Write;

pub const TOP: f64 = 0.060;
pub const OFFSET: f64 = 0.0003;
pub const THICKNESS: f64 = 0.0004;
/// Distance of nodes (m), and how many there are along x and y.
pub const H: f64 = 0.00125;
pub const N: [usize; 2] = [128, 80];

pub fn bump(s: f64, half: f64) -> f64 {
    if s.abs() < half {
        0.5 * (1.0 + (PI * s / half).cos())
    } else {
        0.0
    }
}

/// A wrinkle of height 1, 14 mm wide and 60 mm long along x through (-35, 0) mm.
pub fn wrinkle(x: f64, y: f64) -> f64 {
    let fade = if (x + 0.035).abs() < 0.030 {
        (0.5 * PI * (x + 0.035) / 0.030).cos()
    } else {
        0.0
    };
    bump(y, 0.007) * fade
}

/// A wrinkle 3 mm high, 14 mm wide and 60 mm long along x through (-35, 0) mm; a round blister 2 mm high, 50 mm wide at (40, 0) mm.
pub fn height(x: f64, y: f64) -> f64 {
    0.003 * wrinkle(x, y) + 0.002 * bump((x - 0.040).hypot(y), 0.025)
}

pub fn flat() -> Vec<Vec3> {
    (0..=N[1])
        .flat_map(|j| (0..=N[0]).map(move |i| [-0.080 + H * i as f64, -0.050 + H * j as f64, 0.2]))
        .collect()
}

pub fn cells() -> Vec<u32> {
    let at = |i: usize, j: usize| (j * (N[0] + 1) + i) as u32;
    (0..N[1])
        .flat_map(|j| (0..N[0]).map(move |i| (i, j)))
        .flat_map(|(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
        .collect()
}

/// Two plies on each other, sheared by 0.1 rad; the upper one has the wrinkle.
pub fn formed() -> MemoryArtifact {
    let ply = |name: &str, z: f64, size: f64| {
        let field = |name: &str, value: f64| MemoryField {
            name: name.into(),
            on: On::Cells,
            components: 1,
            values: vec![value; N[0] * N[1]],
        };
        let place = |p: &Vec3| [p[0], p[1], TOP + z + size * height(p[0], p[1])];
        MemoryBody {
            name: name.into(),
            nodes_per_cell: 4,
            cells: cells(),
            frames: vec![flat().iter().map(place).collect()],
            points: flat(),
            fields: vec![vec![
                field("shear_angle", 0.1),
                field("fibre_strain_1", 1e-4),
                field("fibre_strain_2", 2e-4),
            ]],
            ..Default::default()
        }
    };
    let tool = MemoryBody {
        name: "tool".into(),
        points: [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
            .map(|[x, y]| [x, y, TOP])
            .into(),
        nodes_per_cell: 3,
        cells: vec![0, 1, 2, 0, 2, 3],
        ..Default::default()
    };
    let sheet = |name: &str, offset: f64, turn: f64| {
        json!({"name": name, "kind": "ply", "offset": offset, "thickness": THICKNESS,
               "fibre_1": turn, "fibre_2": turn + PI / 2.0})
    };
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"sheets": [sheet("ply_1", OFFSET, 0.0), sheet("ply_2", OFFSET + THICKNESS, PI / 4.0)]}),
        times: vec![1.0],
        bodies: vec![
            tool,
            ply("ply_1", OFFSET, 0.0),
            ply("ply_2", OFFSET + THICKNESS, 1.0),
        ],
        ..Default::default()
    }
}

pub fn measured(parameters: Value) -> MemoryArtifact {
    let formed = formed();
    run::<DefectMeasurement>(parameters, &[MemoryInput::new("formed", &formed)], &[]).unwrap()
}

/// A scan in mm, as a file of points, of heights over the outer face of the upper ply.
pub fn scan_file(
    folder: &tempfile::TempDir,
    height: impl Fn(f64, f64) -> f64,
    wider: f64,
) -> String {
    let path = folder.path().join("scan.xyz");
    let outer = TOP + OFFSET + 1.5 * THICKNESS;
    let mut text = String::new();
    for p in flat() {
        let [x, y] = [wider * p[0], p[1]];
        writeln!(
            text,
            "{} {} {}",
            1e3 * x,
            1e3 * y,
            1e3 * (outer + height(x, y))
        )
        .unwrap();
    }
    std::fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}
