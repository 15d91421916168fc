//! A rectangle meshed with quads whose interior is a square grid turned by any angle.
//!
//! The cells of a turned grid that lie well inside are kept; the rim between them and the rectangle's edges is
//! filled with Delaunay triangles (Bowyer 1981, Watson 1981); then every quad becomes four quads and every
//! triangle three. Grid points are kept where they are at least 0.6 grid spacings away from the edges, so
//! the edges of the kept cells are Delaunay edges: no other point lies in the circle over such an edge.

use plyflow_fixed::FixedBits;
use plyflow_mechanics::mesh::{QuadMesh, area_vector, even_axis};
use std::collections::BTreeMap;

type P = [f64; 2];

/// The rectangle `[0, length] x [-width/2, width/2]` (m) with element edges near `size` (m) whose grid lines
/// are turned by `angle` (rad) from the rectangle's sides. Multiples of a right angle give a plain grid.
pub fn turned_rectangle(length: f64, width: f64, size: f64, angle: f64) -> QuadMesh {
    let quarter = std::f64::consts::FRAC_PI_2;
    let turn = angle.rem_euclid(quarter);
    if turn.min(quarter - turn) < 1e-6 {
        return QuadMesh::grid(
            &even_axis(0.0, length, size),
            &even_axis(-0.5 * width, 0.5 * width, size),
        );
    }
    let h = 2.0 * size;
    let mut points = rectangle_edge(length, width, h);
    let (c, s) = (turn.fixed_cos(), turn.fixed_sin());
    let reach = (length + width) / h;
    let reach = reach.ceil() as i32;
    let mut grid: BTreeMap<(i32, i32), u32> = BTreeMap::new();
    for j in -reach..=reach {
        for i in -reach..=reach {
            let (u, v) = (h * f64::from(i), h * f64::from(j));
            let p = [0.5 * length + u * c - v * s, u * s + v * c];
            let inside = p[0].min(length - p[0]).min(0.5 * width - p[1].abs());
            if inside >= 0.6 * h {
                grid.insert((i, j), points.len() as u32);
                points.push(p);
            }
        }
    }
    let mut polygons: Vec<Vec<u32>> = Vec::new();
    let corners = |i: i32, j: i32| -> Option<Vec<u32>> {
        [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            .iter()
            .map(|k| grid.get(k).copied())
            .collect()
    };
    polygons.extend(grid.keys().filter_map(|(i, j)| corners(*i, *j)));
    for t in delaunay(&points, h) {
        let [a, b, d] = t.map(|n| points[n as usize]);
        let m = [
            (a[0] + b[0] + d[0]) / 3.0 - 0.5 * length,
            (a[1] + b[1] + d[1]) / 3.0,
        ];
        let (i, j) = ((m[0] * c + m[1] * s) / h, (m[1] * c - m[0] * s) / h);
        let covered = corners(i.floor() as i32, j.floor() as i32).is_some();
        if !covered && cross(a, b, d) > 1e-3 * h * h {
            polygons.push(t.to_vec());
        }
    }
    split(&points, &polygons)
}

/// Points along the rectangle's sides, near `h` apart.
fn rectangle_edge(length: f64, width: f64, h: f64) -> Vec<P> {
    let xs = even_axis(0.0, length, h);
    let ys = even_axis(-0.5 * width, 0.5 * width, h);
    let mut points = Vec::new();
    for x in &xs {
        points.push([*x, ys[0]]);
        points.push([*x, ys[ys.len() - 1]]);
    }
    for y in &ys[1..ys.len() - 1] {
        points.push([xs[0], *y]);
        points.push([xs[xs.len() - 1], *y]);
    }
    points
}

/// Twice the area of a triangle, positive counter-clockwise.
fn cross(a: P, b: P, c: P) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Whether p lies in the circle through the counter-clockwise triangle.
fn in_circle(a: P, b: P, c: P, p: P) -> bool {
    let row = |q: P| {
        let (x, y) = (q[0] - p[0], q[1] - p[1]);
        (x, y, x * x + y * y)
    };
    let ((ax, ay, aa), (bx, by, bb), (cx, cy, cc)) = (row(a), row(b), row(c));
    ax * (by * cc - cy * bb) - ay * (bx * cc - cx * bb) + aa * (bx * cy - cx * by) > 0.0
}

/// Delaunay triangles, counter-clockwise. Points of a grid lie on common circles: for the decisions they
/// are moved by a few 1e-6 h, always the same way.
fn delaunay(points: &[P], h: f64) -> Vec<[u32; 3]> {
    let n = points.len();
    let mut at: Vec<P> = (points.iter().enumerate())
        .map(|(k, p)| {
            let noise = |seed: f64| (k as f64 * seed).fract() - 0.5;
            [
                p[0] + 4e-6 * h * noise(0.618_033_988_749_894_9),
                p[1] + 4e-6 * h * noise(0.754_877_666_246_692_8),
            ]
        })
        .collect();
    let size = points.iter().flatten().fold(h, |m, x| m.max(x.abs()));
    let far = 1e4 * size;
    at.extend([[-far, -far], [far, -far], [0.0, far]]);
    let n32 = n as u32;
    let mut triangles = vec![[n32, n32 + 1, n32 + 2]];
    for k in 0..n {
        let mut edges: Vec<(u32, u32)> = Vec::new();
        triangles.retain(|t| {
            let [a, b, c] = t.map(|i| at[i as usize]);
            let hit = in_circle(a, b, c, at[k]);
            if hit {
                edges.extend([(t[0], t[1]), (t[1], t[2]), (t[2], t[0])]);
            }
            !hit
        });
        for (a, b) in &edges {
            if !edges.contains(&(*b, *a)) {
                triangles.push([*a, *b, k as u32]);
            }
        }
    }
    triangles.retain(|t| t.iter().all(|i| *i < n32));
    triangles
}

/// Every polygon with k corners becomes k quads around its centre.
fn split(points: &[P], polygons: &[Vec<u32>]) -> QuadMesh {
    let mut mesh = QuadMesh {
        points: points.iter().map(|p| [p[0], p[1], 0.0]).collect(),
        cells: Vec::new(),
    };
    let mut middles: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    for polygon in polygons {
        let k = polygon.len();
        let corners: Vec<[f64; 3]> = polygon.iter().map(|n| mesh.points[*n as usize]).collect();
        let mean = |c: usize| corners.iter().map(|p| p[c]).sum::<f64>() / k as f64;
        let centre = mesh.points.len() as u32;
        mesh.points.push([mean(0), mean(1), 0.0]);
        let edge: Vec<u32> = (0..k)
            .map(|e| {
                let (a, b) = (polygon[e], polygon[(e + 1) % k]);
                *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let (p, q) = (mesh.points[a as usize], mesh.points[b as usize]);
                    mesh.points
                        .push([0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), 0.0]);
                    mesh.points.len() as u32 - 1
                })
            })
            .collect();
        for e in 0..k {
            mesh.cells
                .push([polygon[e], edge[e], centre, edge[(e + k - 1) % k]]);
        }
    }
    drop_unused(mesh)
}

/// Removes points that no cell uses.
fn drop_unused(mesh: QuadMesh) -> QuadMesh {
    let mut used = vec![false; mesh.points.len()];
    for n in mesh.cells.iter().flatten() {
        used[*n as usize] = true;
    }
    let mut number = vec![0u32; used.len()];
    let mut points = Vec::new();
    for (n, p) in mesh.points.iter().enumerate().filter(|(n, _)| used[*n]) {
        number[n] = points.len() as u32;
        points.push(*p);
    }
    let cells = mesh.cells.iter().map(|c| c.map(|n| number[n as usize]));
    QuadMesh {
        points,
        cells: cells.collect(),
    }
}

/// Least scaled Jacobian of a mesh in the plane: the sine of a corner's angle, 1 for rectangles, at or below 0
/// for cells that are folded.
pub fn least_jacobian(mesh: &QuadMesh) -> f64 {
    let mut least = f64::INFINITY;
    for cell in &mesh.cells {
        let p = cell.map(|n| [mesh.points[n as usize][0], mesh.points[n as usize][1]]);
        for k in 0..4 {
            let (a, b, c) = (p[k], p[(k + 1) % 4], p[(k + 3) % 4]);
            let long = |q: P| (q[0] - a[0]).fixed_hypot(q[1] - a[1]);
            least = least.min(cross(a, b, c) / (long(b) * long(c)));
        }
    }
    least
}

/// Area of a mesh (m2).
pub fn area(mesh: &QuadMesh) -> f64 {
    let cells = mesh.cells.iter();
    cells
        .map(|c| area_vector(c.map(|n| mesh.points[n as usize]))[2])
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_mechanics::mesh::NONE;

    #[test]
    fn turned_meshes_fill_the_rectangle_with_sound_quads() {
        for angle in [10.0, 22.5, 30.0, 45.0, 67.5] {
            for size in [0.0025, 0.004, 0.005] {
                let mesh = turned_rectangle(0.2, 0.1, size, f64::to_radians(angle));
                let what = format!("{angle} deg, {size} m");
                assert!((area(&mesh) - 0.02).abs() < 1e-12, "{what}");
                assert!(
                    least_jacobian(&mesh) > 0.35,
                    "{what}: {}",
                    least_jacobian(&mesh)
                );
                // The only free edges are those of the rectangle: their lengths are its circumference.
                let mut around = 0.0;
                for (cell, near) in mesh.cells.iter().zip(mesh.neighbours()) {
                    for e in (0..4).filter(|e| near[*e] == NONE) {
                        let (a, b) = (cell[e] as usize, cell[(e + 1) % 4] as usize);
                        let (a, b) = (mesh.points[a], mesh.points[b]);
                        around += (a[0] - b[0]).hypot(a[1] - b[1]);
                    }
                }
                assert!((around - 0.6).abs() < 1e-12, "{what}: {around}");
            }
        }
    }

    #[test]
    fn most_of_a_turned_mesh_has_the_wanted_angle() {
        let mesh = turned_rectangle(0.2, 0.1, 0.0025, f64::to_radians(22.5));
        let turned: usize = (mesh.cells.iter())
            .filter(|c| {
                let (a, b) = (mesh.points[c[0] as usize], mesh.points[c[1] as usize]);
                let angle = (b[1] - a[1]).atan2(b[0] - a[0]).to_degrees();
                (angle.rem_euclid(90.0) - 22.5).abs() < 1e-6
            })
            .count();
        assert!(turned as f64 > 0.7 * mesh.cells.len() as f64, "{turned}");
    }
}
