//! A bilinear cell, and the point of it that is closest to another.

use plyflow_geometry::vec3::{Vec3, dot, norm, scale, sub};

/// Steps to the closest point of a cell at most.
const STEPS: usize = 12;
/// Last step (of half an element) to it: of 4 um in an element of 8 mm, which is 0.03 um of a distance of 0.24 mm.
const SETTLED: f64 = 1e-3;
const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// The closest point of one cell.
pub struct Foot {
    /// Place in it.
    pub xi: [f64; 2],
    /// Squared distance (m2).
    pub square: f64,
    /// From it to the point (m).
    pub away: Vec3,
    /// By coordinate: whether the closest point of the whole surface may lie across the side where it ends, and on which.
    pub out: [i8; 2],
}

/// Weights of a cell's corners at a place in it.
pub fn weights(xi: [f64; 2]) -> [f64; 4] {
    CORNERS.map(|c| 0.25 * (1.0 + c[0] * xi[0]) * (1.0 + c[1] * xi[1]))
}

pub fn mix(w: [f64; 4], q: &[Vec3; 4]) -> Vec3 {
    [0, 1, 2].map(|k| w[0] * q[0][k] + w[1] * q[1][k] + w[2] * q[2][k] + w[3] * q[3][k])
}

/// Derivatives of the place by the two coordinates.
pub fn tangents(q: &[Vec3; 4], xi: [f64; 2]) -> [Vec3; 2] {
    let along = CORNERS.map(|c| 0.25 * c[0] * (1.0 + c[1] * xi[1]));
    let across = CORNERS.map(|c| 0.25 * c[1] * (1.0 + c[0] * xi[0]));
    [mix(along, q), mix(across, q)]
}

/// Closest point of a bilinear cell: Gauss and Newton's steps within its bounds.
pub fn foot(q: &[Vec3; 4], p: Vec3, start: [f64; 2]) -> Foot {
    let mut xi = start.map(|c| c.clamp(-1.0, 1.0));
    for step in 0..=STEPS {
        let away = sub(p, mix(weights(xi), q));
        let [a, b] = tangents(q, xi);
        let g = [dot(a, away), dot(b, away)];
        let side = |k: usize| match xi[k] {
            c if c >= 1.0 && g[k] > 0.0 => 1,
            c if c <= -1.0 && g[k] < 0.0 => -1,
            _ => 0,
        };
        let out = [side(0), side(1)];
        let (aa, ab, bb) = (dot(a, a), dot(a, b), dot(b, b));
        let det = aa * bb - ab * ab;
        let mut move_by = [0.0; 2];
        match out {
            [0, 0] if det > 1e-12 * aa * bb => {
                move_by = [(bb * g[0] - ab * g[1]) / det, (aa * g[1] - ab * g[0]) / det];
            }
            [0, _] if aa > 0.0 => move_by[0] = g[0] / aa,
            [_, 0] if bb > 0.0 => move_by[1] = g[1] / bb,
            _ => {}
        }
        let next = [0, 1].map(|k| (xi[k] + move_by[k]).clamp(-1.0, 1.0));
        let moved = (next[0] - xi[0]).abs().max((next[1] - xi[1]).abs());
        if moved < SETTLED || step == STEPS {
            return Foot {
                xi,
                square: dot(away, away),
                away,
                out,
            };
        }
        xi = next;
    }
    unreachable!("the last step returns")
}

/// The edge on which a coordinate ends.
pub fn edge(coordinate: usize, side: i8) -> usize {
    match (coordinate, side > 0) {
        (0, true) => 1,
        (0, false) => 3,
        (_, true) => 2,
        (_, false) => 0,
    }
}

/// The corner at which both coordinates end.
pub fn corner(out: [i8; 2]) -> usize {
    match (out[0] > 0, out[1] > 0) {
        (false, false) => 0,
        (true, false) => 1,
        (true, true) => 2,
        (false, true) => 3,
    }
}

pub fn direction(v: Vec3) -> Vec3 {
    let n = norm(v);
    if n > 0.0 { scale(v, 1.0 / n) } else { v }
}
