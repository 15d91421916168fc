//! Meshes over a rectangle of the plane, mapped onto known surfaces.
#![allow(dead_code)]

use plyflow_geometry::vec3::Vec3;

/// The same numbers in [-1, 1) in every run.
pub fn random() -> impl FnMut() -> f64 {
    let mut state = 12345u64;
    move || {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 53) as f64 * 2.0 - 1.0
    }
}

/// Structured quads over [-a, a]^2 with `n` cells a side; inner nodes moved by up to `jitter` cells.
pub fn grid(n: usize, a: f64, jitter: f64) -> (Vec<[f64; 2]>, Vec<u32>) {
    let h = 2.0 * a / n as f64;
    let mut random = random();
    let mut points = Vec::new();
    for j in 0..=n {
        for i in 0..=n {
            let (mut dx, mut dy) = (jitter * h * random(), jitter * h * random());
            if i == 0 || i == n {
                dx = 0.0;
            }
            if j == 0 || j == n {
                dy = 0.0;
            }
            points.push([-a + h * i as f64 + dx, -a + h * j as f64 + dy]);
        }
    }
    let mut cells = Vec::new();
    let at = |i: usize, j: usize| (j * (n + 1) + i) as u32;
    for j in 0..n {
        for i in 0..n {
            cells.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    (points, cells)
}

/// The grid lifted to z = f(x, y).
pub fn lifted(points: &[[f64; 2]], f: impl Fn(f64, f64) -> f64) -> Vec<Vec3> {
    points.iter().map(|&[x, y]| [x, y, f(x, y)]).collect()
}

/// An icosahedron refined `levels` times onto a sphere of radius r, outward.
pub fn sphere(levels: usize, r: f64) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    use plyflow_geometry::vec3::{add, scale, unit};
    let g = (1.0 + 5f64.sqrt()) / 2.0;
    let mut points: Vec<Vec3> = Vec::new();
    for s in [-1.0, 1.0] {
        for t in [-g, g] {
            points.extend([[0.0, s, t], [s, t, 0.0], [t, 0.0, s]]);
        }
    }
    points.iter_mut().for_each(|p| *p = unit(*p));
    let near = |a: Vec3, b: Vec3| plyflow_geometry::vec3::distance(a, b) < 1.1;
    let mut triangles = Vec::new();
    for i in 0..12 {
        for j in i + 1..12 {
            for k in j + 1..12 {
                let [a, b, c] = [points[i], points[j], points[k]];
                if near(a, b) && near(b, c) && near(a, c) {
                    let t = [i as u32, j as u32, k as u32];
                    let n = plyflow_geometry::vec3::cross(
                        plyflow_geometry::vec3::sub(b, a),
                        plyflow_geometry::vec3::sub(c, a),
                    );
                    let out = plyflow_geometry::vec3::dot(n, a) > 0.0;
                    triangles.push(if out { t } else { [t[0], t[2], t[1]] });
                }
            }
        }
    }
    for _ in 0..levels {
        let mut finer = Vec::new();
        // Middle points are repeated on purpose: the surface must merge them.
        for t in &triangles {
            let [a, b, c] = t.map(|i| points[i as usize]);
            let n = points.len() as u32;
            points.extend([unit(add(a, b)), unit(add(b, c)), unit(add(c, a))]);
            let [ab, bc, ca] = [n, n + 1, n + 2];
            finer.extend([[t[0], ab, ca], [t[1], bc, ab], [t[2], ca, bc], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    (points.iter().map(|&p| scale(p, r)).collect(), triangles)
}
