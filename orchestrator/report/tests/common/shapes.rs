//! The sheets and the tool of the made-up study.

use std::f64::consts::PI;

pub const RADIUS: f64 = 0.06;
/// Half length and half width of the blank (m).
pub const HALF: [f64; 2] = [0.12, 0.08];

pub struct Sheet {
    pub flat: Vec<f64>,
    pub formed: Vec<f64>,
    pub cells: Vec<u32>,
    pub shear: Vec<f64>,
    pub distance: Vec<f64>,
    pub curvature: Vec<f64>,
}

/// Height of the wave over a place of the flat ply.
pub fn wave(x: f64, y: f64) -> f64 {
    let bump = |cx: f64, cy: f64, a: f64| {
        let (u, v) = ((x - cx) / 0.03, (y - cy) / 0.02);
        a * (-(u * u + v * v)).exp() * (1.0 + (2.0 * PI * (x - cx) / 0.02).cos()) / 2.0
    };
    bump(-0.05, -0.045, 0.006) + bump(0.06, 0.03, 0.004)
}

pub fn sheet(bounds: [f64; 4], size: f64, offset: f64) -> Sheet {
    wavy(bounds, size, offset, 1.0)
}

/// A sheet whose waves are higher by a factor.
pub fn wavy(bounds: [f64; 4], size: f64, offset: f64, factor: f64) -> Sheet {
    let wave = |x, y| factor * wave(x, y);
    let n = [0, 1].map(|d| ((bounds[d + 2] - bounds[d]) / size).round() as usize);
    let mut s = Sheet {
        flat: vec![],
        formed: vec![],
        cells: vec![],
        shear: vec![],
        distance: vec![],
        curvature: vec![],
    };
    for j in 0..=n[1] {
        for i in 0..=n[0] {
            let x = bounds[0] + (bounds[2] - bounds[0]) * i as f64 / n[0] as f64;
            let y = bounds[1] + (bounds[3] - bounds[1]) * j as f64 / n[1] as f64;
            let (r, a) = (RADIUS + offset + wave(x, y), y / RADIUS);
            s.flat.extend([x, y, 0.0]);
            s.formed.extend([x, r * a.sin(), r * a.cos()]);
            s.distance.push(wave(x, y));
            s.curvature.push(-1.0 / RADIUS + 2e4 * wave(x, y));
        }
    }
    let row = n[0] as u32 + 1;
    for j in 0..n[1] as u32 {
        for i in 0..n[0] as u32 {
            let a = j * row + i;
            s.cells.extend([a, a + 1, a + row + 1, a + row]);
            let [x, y] = [0, 1].map(|d| s.flat[3 * a as usize + d]);
            s.shear
                .push(0.5 * (x / HALF[0]) * (y / HALF[1]).abs() - 0.1);
        }
    }
    s
}

pub fn tool() -> (Vec<f64>, Vec<u32>) {
    let (mut points, mut cells) = (vec![], vec![]);
    let n = 40u32;
    for k in 0..=n {
        let a = PI * (f64::from(k) / f64::from(n) - 0.5) * 1.1;
        points.extend([-0.16, RADIUS * a.sin(), RADIUS * a.cos()]);
        points.extend([0.16, RADIUS * a.sin(), RADIUS * a.cos()]);
        if k < n {
            let i = 2 * k;
            cells.extend([i, i + 1, i + 3, i, i + 3, i + 2]);
        }
    }
    (points, cells)
}

pub fn plies(bounds: [f64; 4], size: f64) -> [(&'static str, Sheet); 2] {
    [
        ("ply_1", sheet(bounds, size, 0.001)),
        ("ply_2", sheet(bounds, size, 0.002)),
    ]
}
