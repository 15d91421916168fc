//! What pulls across a line of a sheet.

use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, sub};

/// First Piola-Kirchhoff traction (N/m of undeformed length) across a line with the normal `normal` of the flat ply, in a cell
/// whose corners were at `then` and are at `now` (m), with resultants `s` (S11, S22, S12, N/m) in axes of which the first
/// lies at `axis` (rad): `t = sum_AB (F e_A) S_AB (e_B . N)`, F that of the cell's centre.
pub fn traction(then: [Vec3; 4], now: [Vec3; 4], s: [f64; 3], axis: f64, normal: [f64; 2]) -> Vec3 {
    let diagonals = |p: &[Vec3; 4]| [sub(p[2], p[0]), sub(p[3], p[1])];
    let ([a, b], [d, e]) = (diagonals(&then), diagonals(&now));
    let det = a[0] * b[1] - a[1] * b[0];
    let mapped = |u: [f64; 2]| -> Vec3 {
        let (p, q) = (
            (u[0] * b[1] - u[1] * b[0]) / det,
            (a[0] * u[1] - a[1] * u[0]) / det,
        );
        [0, 1, 2].map(|k| p * d[k] + q * e[k])
    };
    let (sin, cos) = axis.fixed_sin_cos();
    let (e1, e2) = ([cos, sin], [-sin, cos]);
    let n = [e1, e2].map(|e| e[0] * normal[0] + e[1] * normal[1]);
    let (g1, g2) = (mapped(e1), mapped(e2));
    let (t1, t2) = (s[0] * n[0] + s[2] * n[1], s[2] * n[0] + s[1] * n[1]);
    [0, 1, 2].map(|k| g1[k] * t1 + g2[k] * t2)
}
