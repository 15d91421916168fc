//! Principal curvatures by the iterative quadric fit (thesis 4.3.2, eqs 4.3-4.11).

use crate::topology::Topology;
use crate::vector::{Vec3, add, cross, dot, norm, scale, sub, unit};

/// Curvature of a surface at a node. Signs: positive where the surface bends towards its normal (a valley
/// seen from the normal's side), negative on a crest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Curvature {
    /// Principal curvature of largest magnitude (1/m).
    pub max: f64,
    /// The other principal curvature (1/m).
    pub min: f64,
    /// Unit direction of `max`.
    pub max_direction: Vec3,
    /// Unit direction of `min`: along a ridge.
    pub min_direction: Vec3,
    /// Unit normal after convergence.
    pub normal: Vec3,
    /// How many rings of neighbours the fit took; 0: even three rings do not determine it, and the
    /// curvatures are given as zero.
    pub rings: usize,
}

/// The normal has converged when it moves by less than this (rad). The curvature's error is of second
/// order in it.
const CONVERGED: f64 = 1e-9;
/// Folded neighbourhoods may never converge; after this many fits the last one counts.
const MOST_FITS: usize = 30;
/// The least squares problem counts as determined when the smallest diagonal of its triangular factor, with
/// columns of unit length, exceeds this. A regular interior quad ring has 0.7, a structured boundary node
/// 0; a slightly irregular boundary node (0.1) is determined on paper but multiplies errors by ten.
const DETERMINED_BY_ONE_RING: f64 = 0.2;
/// The same for more rings: one-sided neighbourhoods stay near 0.1 however many rings they have.
const DETERMINED: f64 = 0.03;

/// Curvature at every node of a mesh with its nodes at `points` (`[nodes]`, m).
///
/// The fit takes the one-ring, and the second (or third) ring where that does not determine the quadric: at
/// a structured boundary node its rank is 4 of 5, at a corner less.
pub fn curvatures(topology: &Topology, points: &[Vec3]) -> Vec<Curvature> {
    let normals = topology.normals(points);
    (0..topology.nodes())
        .map(|i| at_node(topology, points, i, normals[i]))
        .collect()
}

fn at_node(topology: &Topology, points: &[Vec3], node: usize, normal: Vec3) -> Curvature {
    let [e1, e2] = tangents(normal);
    let none = Curvature {
        max: 0.0,
        min: 0.0,
        max_direction: e1,
        min_direction: e2,
        normal,
        rings: 0,
    };
    if norm(normal) == 0.0 {
        return Curvature {
            max_direction: [1.0, 0.0, 0.0],
            min_direction: [0.0, 1.0, 0.0],
            ..none
        };
    }
    for rings in 1..=3 {
        let offsets: Vec<Vec3> = topology
            .rings(node, rings)
            .into_iter()
            .map(|i| sub(points[i as usize], points[node]))
            .collect();
        if let Some(found) = iterate(&offsets, normal, rings) {
            return found;
        }
    }
    none
}

/// Repeats the fit in the frame of the last normal until the normal stays.
fn iterate(offsets: &[Vec3], mut normal: Vec3, rings: usize) -> Option<Curvature> {
    let size = offsets.iter().map(|&o| norm(o)).sum::<f64>() / offsets.len() as f64;
    if offsets.len() < 5 || size <= 0.0 {
        return None;
    }
    let limit = if rings == 1 {
        DETERMINED_BY_ONE_RING
    } else {
        DETERMINED
    };
    let mut last = None;
    for _ in 0..MOST_FITS {
        let [e1, e2] = tangents(normal);
        let local: Vec<Vec3> = offsets
            .iter()
            .map(|&o| [dot(o, e1) / size, dot(o, e2) / size, dot(o, normal) / size])
            .collect();
        let Some(q) = fit_quadric(&local, limit) else {
            break;
        };
        last = Some((q, normal));
        let [_, _, _, d, e] = q;
        let new = unit(add(normal, add(scale(e1, -d), scale(e2, -e))));
        let moved = norm(sub(new, normal));
        if moved < CONVERGED {
            break;
        }
        normal = new;
    }
    last.map(|(q, normal)| principal(q, size, normal, rings))
}

/// Eq. 4.11, and the directions from the second derivatives (at convergence d = e = 0).
fn principal([a, b, c, d, e]: [f64; 5], size: f64, normal: Vec3, rings: usize) -> Curvature {
    let w = 1.0 + d * d + e * e;
    let gauss = (4.0 * a * c - b * b) / (w * w);
    let mean = (a + c + a * e * e + c * d * d - b * d * e) / w.powf(1.5);
    let root = (mean * mean - gauss).max(0.0).sqrt();
    let (large, small) = if mean >= 0.0 {
        (mean + root, mean - root)
    } else {
        (mean - root, mean + root)
    };
    // Eigenvector of [[2a, b], [b, 2c]]: twice its angle is that of (a - c, b), for the larger eigenvalue.
    let angle = 0.5 * b.atan2(a - c)
        + if mean >= 0.0 {
            0.0
        } else {
            std::f64::consts::FRAC_PI_2
        };
    let [e1, e2] = tangents(normal);
    let (sin, cos) = angle.sin_cos();
    Curvature {
        max: large / size,
        min: small / size,
        max_direction: add(scale(e1, cos), scale(e2, sin)),
        min_direction: add(scale(e1, -sin), scale(e2, cos)),
        normal,
        rings,
    }
}

/// Eqs 4.5, 4.6: the first global axis projected onto the tangent plane, or the second one where the first
/// is nearly normal to it.
fn tangents(n: Vec3) -> [Vec3; 2] {
    let axis = if n[0].abs() < 0.9 {
        [1.0, 0.0, 0.0]
    } else {
        [0.0, 1.0, 0.0]
    };
    let e1 = unit(sub(axis, scale(n, dot(axis, n))));
    [e1, cross(n, e1)]
}

/// Least squares fit of z = a x2 + b xy + c y2 + d x + e y (eq. 4.9) by modified Gram-Schmidt with column
/// pivoting; `None` when the points do not determine it.
fn fit_quadric(points: &[Vec3], limit: f64) -> Option<[f64; 5]> {
    let n = points.len();
    let mut columns: [Vec<f64>; 5] = std::array::from_fn(|_| Vec::with_capacity(n));
    for &[x, y, _] in points {
        for (column, value) in columns.iter_mut().zip([x * x, x * y, y * y, x, y]) {
            column.push(value);
        }
    }
    let mut rhs: Vec<f64> = points.iter().map(|p| p[2]).collect();
    let mut lengths = [0.0; 5];
    for (column, length) in columns.iter_mut().zip(&mut lengths) {
        *length = inner(column, column).sqrt();
        if *length < 1e-12 {
            return None;
        }
        column.iter_mut().for_each(|v| *v /= *length);
    }
    let mut order = [0, 1, 2, 3, 4];
    let mut r = [[0.0; 5]; 5];
    let mut projected = [0.0; 5];
    for k in 0..5 {
        let left = |j: usize| inner(&columns[order[j]], &columns[order[j]]);
        let pivot = (k..5)
            .max_by(|&i, &j| left(i).total_cmp(&left(j)))
            .unwrap_or(k);
        order.swap(k, pivot);
        for row in &mut r {
            row.swap(k, pivot);
        }
        let length = inner(&columns[order[k]], &columns[order[k]]).sqrt();
        if length < limit {
            return None;
        }
        r[k][k] = length;
        let q: Vec<f64> = columns[order[k]].iter().map(|v| v / length).collect();
        for j in k + 1..5 {
            let along = inner(&q, &columns[order[j]]);
            r[k][j] = along;
            columns[order[j]]
                .iter_mut()
                .zip(&q)
                .for_each(|(v, q)| *v -= along * q);
        }
        projected[k] = inner(&q, &rhs);
        rhs.iter_mut()
            .zip(&q)
            .for_each(|(v, q)| *v -= projected[k] * q);
    }
    let mut solution = [0.0; 5];
    for k in (0..5).rev() {
        let known: f64 = (k + 1..5).map(|j| r[k][j] * solution[order[j]]).sum();
        solution[order[k]] = (projected[k] - known) / r[k][k];
    }
    for (s, length) in solution.iter_mut().zip(lengths) {
        *s /= length;
    }
    Some(solution)
}

fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
