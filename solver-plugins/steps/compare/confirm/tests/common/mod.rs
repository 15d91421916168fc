//! Runs of zones whose wrinkles and bridging are known.
#![allow(dead_code)] // Not every test file uses all of it.

use plyflow_confirm::Confirm;
use plyflow_testing::{MemoryArtifact, MemoryBody, MemoryInput, flat_grid, run};
use serde_json::{Value, json};
use std::f64::consts::PI;

pub const TOP: f64 = 0.060;
pub const OFFSET: f64 = 0.00028;
pub const ZONE: [f64; 4] = [-0.080, -0.050, 0.080, 0.050];
pub const WIDE: [f64; 4] = [-0.110, -0.080, 0.110, 0.080];

/// What stands off the tool (m).
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// Height of a wrinkle along x through the middle of the left half, and its half length.
    pub wrinkle: f64,
    pub half_length: f64,
    /// By how much it is moved along y.
    pub moved: f64,
    /// Height of a round blister of 50 mm in the right half.
    pub blister: f64,
    /// Height of a wrinkle outside of the zone.
    pub outside: f64,
}

pub const USUAL: Shape = Shape {
    wrinkle: 0.003,
    half_length: 0.025,
    moved: 0.0,
    blister: 0.002,
    outside: 0.0,
};

/// A crest along x, 14 mm wide, that fades towards its ends.
fn crest(x: f64, y: f64, half: f64) -> f64 {
    let fade = if x.abs() < half {
        (0.5 * PI * x / half).cos()
    } else {
        0.0
    };
    let wave = if y.abs() < 0.007 {
        0.5 * (1.0 + (PI * y / 0.007).cos())
    } else {
        0.0
    };
    fade * wave
}

impl Shape {
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let r = (x - 0.045).hypot(y);
        let blister = if r < 0.025 {
            0.5 * (1.0 + (PI * r / 0.025).cos())
        } else {
            0.0
        };
        self.wrinkle * crest(x + 0.035, y - self.moved, self.half_length)
            + self.blister * blister
            + self.outside * crest(x, y - 0.066, 0.030)
    }
}

/// A fine run of a zone, in elements of a size (m).
pub fn fine(zone: (&str, [f64; 4]), size: f64, shape: Shape) -> MemoryArtifact {
    let (points, cells) = flat_grid(zone.1, size, 0.2);
    let place = |p: &[f64; 3]| [p[0], p[1], TOP + OFFSET + shape.height(p[0], p[1])];
    let ply = MemoryBody {
        name: "ply_1".into(),
        nodes_per_cell: 4,
        frames: vec![points.iter().map(place).collect()],
        cells,
        points,
        ..Default::default()
    };
    formed(
        vec![ply],
        json!({"name": zone.0, "box": zone.1, "free_sides": vec![false; 4], "plies": ["ply_1"]}),
    )
}

pub fn formed(bodies: Vec<MemoryBody>, zone: Value) -> MemoryArtifact {
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
    let sheets: Vec<Value> = bodies
        .iter()
        .map(|b| json!({"name": b.name, "kind": "ply", "thickness": 0.0004, "offset": OFFSET}))
        .collect();
    MemoryArtifact {
        kind: "forming".into(),
        attributes: json!({"sheets": sheets, "zone": zone, "time_step": 4e-6}),
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

pub fn global() -> MemoryArtifact {
    formed(Vec::new(), Value::Null)
}

/// Confirms the run of zone A by the others, each at its port.
pub fn confirmed(
    base: &MemoryArtifact,
    others: &[(&str, &MemoryArtifact)],
) -> Result<MemoryArtifact, String> {
    let (global, zones) = (global(), zones(json!([zone_a()])));
    let mut inputs = vec![
        MemoryInput::new("global", &global),
        MemoryInput::new("zones", &zones),
        MemoryInput {
            step: "local",
            ..MemoryInput::new("local", base)
        },
    ];
    let steps: Vec<String> = (0..others.len())
        .map(|k| format!("{}_{k}", others[k].0))
        .collect();
    for ((port, artifact), step) in others.iter().zip(&steps) {
        inputs.push(MemoryInput {
            step,
            ..MemoryInput::new(port, artifact)
        });
    }
    run::<Confirm>(json!({"shared_error": 0.0}), &inputs, &[])
}

/// A defect of what was told, by its id.
pub fn defect<'a>(out: &'a MemoryArtifact, id: &str) -> &'a Value {
    let all = out.attributes["defects"].as_array().unwrap();
    all.iter()
        .find(|d| d["id"] == id)
        .unwrap_or_else(|| panic!("no {id} in {all:?}"))
}
