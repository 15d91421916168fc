//! Wrinkles along and across the edge of a ply.

mod common;

use common::*;
use plyflow_defects::Kind;
use plyflow_geometry::vec3::distance;
use plyflow_surface::Topology;
use std::f64::consts::PI;

/// Of the crest (m).
const HEIGHT: f64 = 0.004;
/// From foot to foot across it (m).
const WIDTH: f64 = 0.018;
/// Along it from where it has no height any more to where it has none again (m).
const LONG: f64 = 0.120;

/// A ridge with its crest along a line through `(0, y)` that lies at `angle` (rad) to x.
fn ridge(angle: f64, at: [f64; 2], x: f64, y: f64) -> f64 {
    let (sin, cos) = angle.sin_cos();
    let [dx, dy] = [x - at[0], y - at[1]];
    let (along, across) = (cos * dx + sin * dy, -sin * dx + cos * dy);
    let bump = |s: f64, width: f64| match s.abs() < 0.5 * width {
        true => (PI * s / width).cos().powi(2),
        false => 0.0,
    };
    HEIGHT * bump(across, WIDTH) * bump(along, LONG)
}

/// Length of the crest inside of the ply where it is higher than the threshold, and curved beyond what holds a crest.
fn known(angle: f64, at: [f64; 2], inside: impl Fn(f64, f64) -> bool) -> f64 {
    let peak = 2.0 * HEIGHT * (PI / WIDTH).powi(2);
    let held = SETTINGS.crest_hold * SETTINGS.curvature_threshold / peak;
    let least = (held * HEIGHT).max(SETTINGS.distance_threshold);
    let place = |i: i32| {
        let s = LONG * f64::from(i) / 4000.0;
        let (x, y) = (at[0] + s * angle.cos(), at[1] + s * angle.sin());
        [x, y, ridge(angle, at, x, y)]
    };
    let (from, to) = (-2000, 2000);
    let counts = |p: &[f64; 3]| p[2] > least && inside(p[0], p[1]);
    let pieces = (from..to).map(|i| [place(i), place(i + 1)]);
    let pieces = pieces.filter(|p| p.iter().all(counts));
    pieces.map(|[a, b]| distance(a, b)).sum()
}

#[test]
fn a_wrinkle_by_the_edge_of_a_ply_keeps_its_length_at_any_angle() {
    let whole = known(0.0, [0.0; 2], |_, _| true);
    for (h, jitter) in [(0.002, 0.0), (0.002, 0.2), (0.003, 0.0), (0.003, 0.2)] {
        let (points, cells) = flat(h, jitter);
        let [right, top] = [0, 1].map(|k| points.iter().map(|p| p[k]).fold(0.0, f64::max));
        for degrees in [0.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 90.0] {
            for below in 0..=12 {
                let angle = f64::to_radians(degrees);
                let at = [0.0, top - 1e-3 * f64::from(below)];
                let place = |&[x, y]: &[f64; 2]| [x, y, TOP + OFFSET + ridge(angle, at, x, y)];
                let formed = points.iter().map(place).collect();
                let found = all(&ply(Topology::new(points.len(), 4, &cells), formed));
                let what =
                    format!("{h} m, jitter {jitter}, {degrees} deg, {below} mm from the edge");
                let kinds: Vec<Kind> = found.iter().map(|d| d.kind).collect();
                assert_eq!(kinds, [Kind::Wrinkle], "{what}");
                let length = found[0].length;
                let known = known(angle, at, |x, y| x <= right && y <= top);
                // Along the edge at less than two elements from it, where curvature is known from one side, up to 16 % is missing in the coarser ones.
                let least = if degrees < 1.0 && h > 0.0025 {
                    0.8
                } else {
                    0.9
                };
                assert!(length > least * known, "{what}: {length}, not {known}");
                // Where a crest leaves the ply at a low angle, its flank still stands off along the edge beyond.
                let most = if degrees > 15.0 || below > 6 {
                    known
                } else {
                    whole
                };
                assert!(length < 1.1 * most, "{what}: {length}, not {known}");
            }
        }
    }
}
