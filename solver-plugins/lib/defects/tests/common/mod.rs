//! Surfaces whose defects are known, shared by all ways to measure.
#![allow(dead_code)] // Not every test file uses all of it.

use plyflow_defects::{Defect, Kind, Ply, Settings, Shape, Tool, measure};
use plyflow_geometry::vec3::{Vec3, distance};
use plyflow_surface::{Ground, Surface, Topology};
use std::f64::consts::PI;

/// The tool: a plane.
pub const TOP: f64 = 0.060;
/// Of the mid-plane from it.
pub const OFFSET: f64 = 0.0003;
pub const SETTINGS: Settings = Settings {
    distance_threshold: 0.001,
    curvature_threshold: 100.0,
    crest_hold: 0.3,
    foot_margin: 0.010,
    minimum_wrinkle_length: 0.010,
    minimum_bridging_area: 50e-6,
};

/// A wrinkle 3 mm high and 14 mm wide through (-35, 0) mm at `angle` (rad) to x that fades over 30 mm to both ends, and a round blister
/// 2 mm high of 25 mm radius at (40, 0) mm.
pub fn height(angle: f64, x: f64, y: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let (along, across) = (cos * (x + 0.035) + sin * y, -sin * (x + 0.035) + cos * y);
    let bump = |s: f64, half: f64| {
        if s.abs() < half {
            0.5 * (1.0 + (PI * s / half).cos())
        } else {
            0.0
        }
    };
    let fade = if along.abs() < 0.030 {
        (0.5 * PI * along / 0.030).cos()
    } else {
        0.0
    };
    0.003 * bump(across, 0.007) * fade + 0.002 * bump((x - 0.040).hypot(y), 0.025)
}

/// Length of the crest, over the surface, where it is curved beyond crest_hold of the threshold and stands off.
pub fn crest_length() -> f64 {
    let peak = 0.0015 * (PI / 0.007f64).powi(2);
    let curved = SETTINGS.crest_hold * SETTINGS.curvature_threshold / peak;
    let least = curved.max(SETTINGS.distance_threshold / 0.003);
    let half = 0.060 / PI * least.acos();
    let place = |i: i32| {
        let s = half * f64::from(i) / 500.0;
        [s, 0.0, 0.003 * (PI * s / 0.060).cos()]
    };
    (-500..500).map(|i| distance(place(i), place(i + 1))).sum()
}

/// Where the blister is higher than the threshold.
pub const BLISTER_AREA: f64 = PI * 0.0125 * 0.0125;

pub fn tool() -> Tool {
    let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
    let points = corners.map(|[x, y]| [x, y, TOP]);
    Tool::new(Surface::new(&points, &[[0, 1, 2], [0, 2, 3]]).unwrap())
}

/// Nodes over 160 x 100 mm in the plane, inner ones moved by up to `jitter` of the distance `h` (m).
pub fn flat(h: f64, jitter: f64) -> (Vec<[f64; 2]>, Vec<u32>) {
    let [n, m] = [0.160 / h, 0.100 / h].map(|n| n.round() as usize);
    let mut state = 1u64;
    let mut random = move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    };
    let mut points = Vec::new();
    for j in 0..=m {
        for i in 0..=n {
            let rim = i == 0 || j == 0 || i == n || j == m;
            let [dx, dy] = [0, 1].map(|_| if rim { 0.0 } else { jitter * h * random() });
            points.push([-0.080 + h * i as f64 + dx, -0.050 + h * j as f64 + dy]);
        }
    }
    let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    let cells = (0..m)
        .flat_map(|j| (0..n).map(move |i| (i, j)))
        .flat_map(|(i, j)| [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)])
        .collect();
    (points, cells)
}

pub fn formed(flat: &[[f64; 2]], angle: f64) -> Vec<Vec3> {
    flat.iter()
        .map(|&[x, y]| [x, y, TOP + OFFSET + height(angle, x, y)])
        .collect()
}

pub fn ply(topology: Topology, formed: Vec<Vec3>) -> Ply {
    let undeformed = formed.iter().map(|p| [p[0], p[1], 0.0]).collect();
    Ply::new(
        "ply".into(),
        Shape {
            topology,
            undeformed,
            formed,
        },
        &tool(),
        OFFSET,
        Ground::bed(SETTINGS.foot_margin),
    )
}

/// Errors of the wrinkle's length and amplitude and of the blister's area, over what is known.
pub fn errors(found: &[Defect]) -> [f64; 3] {
    let kinds: Vec<Kind> = found.iter().map(|d| d.kind).collect();
    assert_eq!(kinds, [Kind::Wrinkle, Kind::Bridging]);
    [
        found[0].length / crest_length() - 1.0,
        found[0].amplitude / 0.003 - 1.0,
        found[1].area / BLISTER_AREA - 1.0,
    ]
}

pub fn all(ply: &Ply) -> Vec<Defect> {
    measure(ply, &vec![true; ply.formed.len()], &SETTINGS)
}
