//! Artifacts whose wrinkles and bridging are known.
#![allow(dead_code)] // Not every test file uses all of it.

use plyflow_comparison::Comparison;
use plyflow_sdk::On;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryField, MemoryInput, flat_grid, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

pub const TOP: f64 = 0.060;
pub const OFFSET: f64 = 0.00028;
pub const ZONE: [f64; 4] = [-0.080, -0.050, 0.080, 0.050];

/// Height of the ply over the tool; wrinkle: 3 mm high, 14 mm wide, along the diagonal through (-35, 0) mm, of
/// half length 30 mm; bridging: 2 mm high, 50 mm wide, round, at (40, 0) mm.
pub fn height(size: f64) -> impl Fn(f64, f64) -> f64 {
    move |x, y| {
        let (u, v) = (x + 0.035, y);
        let (along, across) = ((u + v) / 2f64.sqrt(), (v - u) / 2f64.sqrt());
        let fade = if along.abs() < 0.030 {
            (0.5 * PI * along / 0.030).cos()
        } else {
            0.0
        };
        let wave = if across.abs() < 0.007 {
            0.5 * (1.0 + (PI * across / 0.007).cos())
        } else {
            0.0
        };
        let r = (x - 0.040).hypot(y);
        let blister = if r < 0.025 {
            0.001 * (1.0 + (PI * r / 0.025).cos())
        } else {
            0.0
        };
        size * (0.003 * wave * fade + blister)
    }
}

pub fn ply(name: &str, b: [f64; 4], size: f64, up: f64, f: impl Fn(f64, f64) -> f64) -> MemoryBody {
    let (points, cells) = flat_grid(b, size, 0.2);
    let formed = points
        .iter()
        .map(|p| [p[0], p[1], TOP + up + f(p[0], p[1])])
        .collect();
    // Shear grows along x from -0.1 to 0.1 rad over the zone.
    let shear = cells
        .chunks_exact(4)
        .map(|c| points[c[0] as usize][0] / 0.8)
        .collect();
    MemoryBody {
        name: name.into(),
        nodes_per_cell: 4,
        cells,
        frames: vec![formed],
        points,
        fields: vec![vec![MemoryField {
            name: "shear_angle".into(),
            on: On::Cells,
            components: 1,
            values: shear,
        }]],
        ..Default::default()
    }
}

pub fn formed(bodies: Vec<MemoryBody>, size: f64, zone: Value) -> MemoryArtifact {
    let tool = MemoryBody {
        name: "tool".into(),
        points: vec![
            [-0.5, -0.5, TOP],
            [0.5, -0.5, TOP],
            [0.5, 0.5, TOP],
            [-0.5, 0.5, TOP],
        ],
        nodes_per_cell: 3,
        cells: vec![0, 1, 2, 0, 2, 3],
        ..Default::default()
    };
    let sheets: Vec<Value> = (bodies.iter().enumerate())
        .map(|(i, b)| json!({"name": b.name, "kind": "ply", "thickness": 0.0004, "offset": OFFSET + 0.0004 * i as f64}))
        .collect();
    let elements: usize = bodies.iter().map(|b| b.cells.len() / 4).sum();
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"sheets": sheets, "element_size": size, "element_cycles": 1000.0 * elements as f64, "zone": zone}),
        times: vec![1.0],
        bodies: std::iter::once(tool).chain(bodies).collect(),
        ..Default::default()
    }
}

pub fn zones(list: Value) -> MemoryArtifact {
    MemoryArtifact {
        kind: "zones".into(),
        attributes: json!({"zones": list}),
        ..Default::default()
    }
}

pub fn zone_a() -> Value {
    json!({"name": "A", "box": ZONE, "free_sides": vec![false; 4], "plies": ["ply_1"]})
}

pub const BLANK: [f64; 4] = [-0.240, -0.150, 0.240, 0.150];

pub fn global() -> MemoryArtifact {
    formed(
        vec![ply("ply_1", BLANK, 0.010, OFFSET, |_, _| 0.0)],
        0.010,
        Value::Null,
    )
}

pub fn local(up: f64) -> MemoryArtifact {
    formed(
        vec![ply("ply_1", ZONE, 0.00125, OFFSET, height(up))],
        0.00125,
        zone_a(),
    )
}

pub fn compare(inputs: &[MemoryInput<'_>]) -> MemoryArtifact {
    run::<Comparison>(json!({}), inputs, &[]).unwrap()
}
