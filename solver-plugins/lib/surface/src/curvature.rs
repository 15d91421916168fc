//! Principal curvatures by the iterative quadric fit (thesis 4.3.2, eqs 4.3-4.11), with terms of third and fourth order
//! beside the quadric (`docs/decisions/0021`).

use crate::topology::Topology;
use nalgebra::{SMatrix, SVector};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub, unit};
use rayon::prelude::*;

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
    /// Whether the neighbours determine a quadric; if not, the curvatures are given as zero.
    pub determined: bool,
}

/// The normal has converged when it moves by less than this (rad). The curvature's error is of second
/// order in it.
const CONVERGED: f64 = 1e-9;
/// After this many fits the last one counts.
const MOST_FITS: usize = 30;
/// The mean of the cells' normals is no further (rad) than this from the normal of what a fit can describe.
const LARGEST_TURN: f64 = 0.25;
/// Rings of neighbours that a fit takes. A neighbour counts by the inverse sixth power of its distance, so that the third ring
/// decides only what the first leaves open.
const RINGS: usize = 3;
/// Weight of the terms of third and fourth order being small, in units of the distance of the nearest neighbours.
const SMOOTHNESS: f64 = 0.05;
/// The quadric counts as determined when the smallest diagonal of the triangular factor of its weighted least squares
/// problem, with columns of unit length, exceeds this. An inner node of a regular mesh has 0.97, one at a corner 0.32, in
/// a strip two cells wide 0.27, in one that is one cell wide 0.
const DETERMINED: f64 = 0.01;

/// Terms of the quadric, and all of the polynomial.
const QUADRIC: usize = 5;
const TERMS: usize = 14;

/// Curvature at every node of a mesh with its nodes at `points` (`[nodes]`, m).
pub fn curvatures(topology: &Topology, points: &[Vec3]) -> Vec<Curvature> {
    let normals = topology.normals(points);
    (0..topology.nodes())
        .into_par_iter()
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
        determined: false,
    };
    if norm(normal) == 0.0 {
        return Curvature {
            max_direction: [1.0, 0.0, 0.0],
            min_direction: [0.0, 1.0, 0.0],
            ..none
        };
    }
    let offsets: Vec<Vec3> = topology
        .rings(node, RINGS)
        .into_iter()
        .map(|i| sub(points[i as usize], points[node]))
        .filter(|&o| norm(o) > 0.0)
        .collect();
    iterate(&offsets, normal).unwrap_or(none)
}

/// Repeats the fit in the frame of the last normal until the normal stays. On a crest sharper than the mesh resolves it does
/// not: it tips over to the normal of one flank, from where the other flank is no height. There the first fit counts.
fn iterate(offsets: &[Vec3], first: Vec3) -> Option<Curvature> {
    let mut lengths: Vec<f64> = offsets.iter().map(|&o| norm(o)).collect();
    lengths.sort_by(f64::total_cmp);
    let nearest = lengths.get(..4)?;
    let size = nearest.iter().sum::<f64>() / nearest.len() as f64;
    let (mut normal, mut fits) = (first, Vec::new());
    for _ in 0..MOST_FITS {
        let [e1, e2] = tangents(normal);
        let local: Vec<Vec3> = offsets
            .iter()
            .map(|&o| [dot(o, e1) / size, dot(o, e2) / size, dot(o, normal) / size])
            .collect();
        let Some(q) = fit(&local) else {
            break;
        };
        fits.push((q, normal));
        let [_, _, _, d, e] = q;
        let new = unit(add(normal, add(scale(e1, -d), scale(e2, -e))));
        let moved = norm(sub(new, normal));
        if moved < CONVERGED {
            break;
        }
        if dot(new, first) < LARGEST_TURN.fixed_cos() {
            fits.truncate(1);
            break;
        }
        normal = new;
    }
    let &(q, normal) = fits.last()?;
    Some(principal(q, size, normal))
}

/// Eq. 4.11, and the directions from the second derivatives (at convergence d = e = 0).
fn principal([a, b, c, d, e]: [f64; QUADRIC], size: f64, normal: Vec3) -> Curvature {
    let w = 1.0 + d * d + e * e;
    let gauss = (4.0 * a * c - b * b) / (w * w);
    let mean = (a + c + a * e * e + c * d * d - b * d * e) / w.fixed_powf(1.5);
    let root = (mean * mean - gauss).max(0.0).sqrt();
    let (large, small) = if mean >= 0.0 {
        (mean + root, mean - root)
    } else {
        (mean - root, mean + root)
    };
    // Eigenvector of [[2a, b], [b, 2c]]: twice its angle is that of (a - c, b), for the larger eigenvalue.
    let angle = 0.5 * b.fixed_atan2(a - c)
        + if mean >= 0.0 {
            0.0
        } else {
            std::f64::consts::FRAC_PI_2
        };
    let [e1, e2] = tangents(normal);
    let (sin, cos) = angle.fixed_sin_cos();
    Curvature {
        max: large / size,
        min: small / size,
        max_direction: add(scale(e1, cos), scale(e2, sin)),
        min_direction: add(scale(e1, -sin), scale(e2, cos)),
        normal,
        determined: true,
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

/// Weighted least squares fit of z = a x2 + b xy + c y2 + d x + e y (eq. 4.9) + terms of third and fourth order, which
/// take up what the surface has of them and are held small where the points do not determine them. Gives the quadric;
/// `None` when the points do not determine that.
fn fit(points: &[Vec3]) -> Option<[f64; QUADRIC]> {
    let mut gram = SMatrix::<f64, TERMS, TERMS>::zeros();
    let mut rhs = SVector::<f64, TERMS>::zeros();
    for &[x, y, z] in points {
        let row = SVector::from(terms(x, y));
        let weight = (x * x + y * y + z * z).powi(-3);
        gram.ger(weight, &row, &row, 1.0);
        rhs.axpy(weight * z, &row, 1.0);
    }
    let mut quadric = gram.fixed_view::<QUADRIC, QUADRIC>(0, 0).into_owned();
    let lengths = quadric.diagonal().map(f64::sqrt);
    if lengths.min() <= 0.0 {
        return None;
    }
    quadric.component_div_assign(&(lengths * lengths.transpose()));
    let least = quadric.cholesky()?.l_dirty().diagonal().min();
    if least < DETERMINED {
        return None;
    }
    for k in QUADRIC..TERMS {
        gram[(k, k)] += SMOOTHNESS * SMOOTHNESS;
    }
    let solution = gram.cholesky()?.solve(&rhs);
    Some(std::array::from_fn(|k| solution[k]))
}

fn terms(x: f64, y: f64) -> [f64; TERMS] {
    let (x2, xy, y2) = (x * x, x * y, y * y);
    [
        x2,
        xy,
        y2,
        x,
        y, //
        x2 * x,
        x2 * y,
        x * y2,
        y2 * y, //
        x2 * x2,
        x2 * xy,
        x2 * y2,
        xy * y2,
        y2 * y2,
    ]
}
