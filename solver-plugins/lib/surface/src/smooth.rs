//! A meshed sheet as a smooth surface through its nodes, and how far nodes stand off it so that elements are as long as the material.

use crate::topology::Topology;
use nalgebra::DMatrix;
use plyflow_geometry::Location;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub, unit};

/// A meshed sheet as a smooth surface through its nodes.
#[derive(Debug, Clone)]
pub struct SmoothSheet {
    /// `[n]` nodes (m).
    pub points: Vec<Vec3>,
    /// `[n]` unit normals, on the side that is up in the flat sheet.
    pub normals: Vec<Vec3>,
}

/// How far a sheet is taken as curved whose normals turn by an angle with this cosine from node to node: wholly up to 45 degrees; at
/// 60 it is folded, not curved, and stays straight. Between them it fades out, so that nothing jumps while a sheet folds.
fn curved(cosine: f64) -> f64 {
    let s = ((cosine - 0.5) / 0.2).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

impl SmoothSheet {
    /// Nodes at `points` (`[n]` m), `cells` `[m * 4]`. Normals of the cells are averaged by area at the nodes.
    pub fn new(points: Vec<Vec3>, cells: &[u32]) -> Self {
        let mut normals = vec![[0.0; 3]; points.len()];
        for cell in cells.chunks_exact(4) {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| points[cell[i] as usize]);
            // Half the cross product of the diagonals is the area of a quad, times its normal.
            let normal = cross(sub(c, a), sub(d, b));
            for &i in cell {
                normals[i as usize] = add(normals[i as usize], normal);
            }
        }
        let normals = normals.into_iter().map(unit).collect();
        Self { points, normals }
    }

    /// From a place of the bilinear mesh to the smooth surface (m): half of the weighted mean of the ways to the planes through
    /// the nodes at right angles to their normals (Phong tessellation, Boubekeur and Alexa 2008, with 1/2 instead of their 3/4).
    /// So the sagitta of a circle's chords is made up for but for a share of the fourth power of their length.
    pub fn lift(&self, nodes: &[u32], weights: &[f64]) -> Vec3 {
        let part = || nodes.iter().map(|n| *n as usize).zip(weights);
        let flat = part().fold([0.0; 3], |sum, (n, w)| add(sum, scale(self.points[n], *w)));
        let normal = |n: &u32| self.normals[*n as usize];
        let pairs = nodes.iter().flat_map(|a| nodes.iter().map(move |b| (a, b)));
        let least = pairs.fold(1.0, |c: f64, (a, b)| c.min(dot(normal(a), normal(b))));
        let share = 0.5 * curved(least);
        part().fold([0.0; 3], |sum, (n, w)| {
            let off = dot(sub(flat, self.points[n]), self.normals[n]);
            sub(sum, scale(self.normals[n], share * w * off))
        })
    }

    /// The place of the smooth surface (m) over a place of its flat mesh. For a sheet that is flat where it is undeformed.
    pub fn at(&self, place: &Location) -> Vec3 {
        add(
            place.interpolate(&self.points),
            self.lift(&place.nodes, &place.weights),
        )
    }
}

/// By how much nodes of a mesh of quads stand further off the material's surface than those of another mesh of the same sheet.
///
/// Sides of elements are as long as the material (`docs/decisions/0028-elements-as-long-as-the-tool.md`). So nodes on a curved sheet lie off
/// it, outside of what is convex and inside of what is hollow, by size^2 / 24 times the one curvature that stands for both of its own
/// (sum k^3 / sum k^2), and the more the longer the sides.
#[derive(Debug, Clone)]
pub struct StandOff {
    /// `[n]`.
    bending: Vec<Bending>,
}

impl StandOff {
    /// For nodes at `points` (`[n]` m) of the flat sheet. `other_area`: of a cell of the other mesh (m2).
    pub fn new(points: &[Vec3], topology: &Topology, other_area: f64) -> Self {
        let bending = |i: usize| Bending::new(i, points, topology, other_area);
        Self {
            bending: (0..points.len()).map(bending).collect(),
        }
    }

    /// From the sheet's nodes to where nodes of the other mesh would be (`[n]`, m), along its normals.
    pub fn to_other(&self, sheet: &SmoothSheet) -> Vec<Vec3> {
        let way = |(i, bending): (usize, &Bending)| {
            let at = sheet.points[i];
            let normal = bending.normal(sheet, i);
            let (mut second, mut least) = ([0.0; 3], 1.0f64);
            for (n, [_, _, weights @ ..]) in &bending.around {
                let off = dot(sub(sheet.points[*n as usize], at), normal);
                second = add(second, scale(*weights, off));
            }
            for (n, _) in &bending.around[..bending.next] {
                least = least.min(dot(normal, sheet.normals[*n as usize]));
            }
            let shift = curved(least) * bending.finer / 24.0 * common_curvature(second);
            scale(normal, shift)
        };
        self.bending.iter().enumerate().map(way).collect()
    }
}

/// How a sheet's curvatures at a node come from how far the nodes around stand off its tangent plane.
#[derive(Debug, Clone)]
struct Bending {
    /// By how much its cells are larger than the other mesh's (m2).
    finer: f64,
    /// Nodes around, with their share in the derivatives x, y (1/m) and xx, xy, yy (1/m2) by the flat sheet's coordinates.
    around: Vec<(u32, [f64; 5])>,
    /// Whether it lies at the sheet's edge.
    free: bool,
    /// The first so many of them share a cell with it.
    next: usize,
}

impl Bending {
    /// Of a node: a paraboloid of least squares, with free slopes, through the nodes around (two rings at a free edge, where one lies
    /// on one side only). What they do not tell is 0.
    fn new(node: usize, points: &[Vec3], topology: &Topology, other_area: f64) -> Self {
        let cells = topology.cells_of(node);
        if cells.is_empty() {
            // A node of no cell: nothing lies on it.
            return Self {
                finer: 0.0,
                around: Vec::new(),
                free: true,
                next: 0,
            };
        }
        let areas = cells.iter().map(|c| {
            let corners = topology.cell(*c as usize);
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| points[corners[i] as usize]);
            0.5 * norm(cross(sub(c, a), sub(d, b)))
        });
        let area = areas.sum::<f64>() / cells.len() as f64;
        let ring = topology.ring(node);
        let mut around = ring.to_vec();
        if topology.is_free(node) {
            around = topology.rings(node, 2);
            around.sort_by_key(|n| !ring.contains(n));
        }
        let size = area.sqrt();
        let row = |n: &u32| {
            let [u, v, _] = sub(points[*n as usize], points[node]).map(|w| w / size);
            [u, v, 0.5 * u * u, u * v, 0.5 * v * v]
        };
        let rows = DMatrix::from_row_iterator(around.len(), 5, around.iter().flat_map(row));
        let inverse = (rows.pseudo_inverse(RANK)).expect("the tolerance is not negative");
        let unit = [size, size, area, area, area];
        let share = |j: usize| [0, 1, 2, 3, 4].map(|k| inverse[(k, j)] / unit[k]);
        let around = around.iter().enumerate().map(|(j, n)| (*n, share(j)));
        Self {
            finer: area - other_area,
            around: around.collect(),
            free: topology.is_free(node),
            next: ring.len(),
        }
    }

    /// Unit normal at the node `i`. The cells at an edge lie to one side of it and tell the normal of their middles: there it is that of the
    /// paraboloid.
    fn normal(&self, sheet: &SmoothSheet, i: usize) -> Vec3 {
        if !self.free || self.around.is_empty() {
            return sheet.normals[i];
        }
        let along = |k: usize| {
            let part = |(n, weights): &(u32, [f64; 5])| {
                scale(sub(sheet.points[*n as usize], sheet.points[i]), weights[k])
            };
            (self.around.iter().map(part)).fold([0.0; 3], add)
        };
        unit(cross(along(0), along(1)))
    }
}

/// Singular values below this, of the places of nodes around one in units of the cells' size, are none.
const RANK: f64 = 1e-6;

/// The one curvature (1/m) that stands for both of a surface with these second derivatives xx, xy, yy (1/m), for which an offset makes up
/// best for both directions' chords: sum k^3 / sum k^2, that of a cylinder or a ball, none of a saddle.
fn common_curvature([xx, xy, yy]: Vec3) -> f64 {
    let (sum, squares) = (xx + yy, xx * xx + 2.0 * xy * xy + yy * yy);
    if squares == 0.0 {
        return 0.0;
    }
    sum * (3.0 * squares - sum * sum) / (2.0 * squares)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_curvature_stands_for_a_cylinder_askew_a_ball_and_no_saddle() {
        let (s, c) = 0.4f64.sin_cos();
        let cylinder = [70.0 * c * c, 70.0 * s * c, 70.0 * s * s];
        assert!((common_curvature(cylinder) - 70.0).abs() < 1e-9);
        assert!((common_curvature([-70.0, 0.0, 0.0]) + 70.0).abs() < 1e-9);
        assert!((common_curvature([30.0, 0.0, 30.0]) - 30.0).abs() < 1e-9);
        assert!(common_curvature([30.0, 0.0, -30.0]).abs() < 1e-9);
        assert!(common_curvature([0.0, 30.0, 0.0]).abs() < 1e-9);
        assert_eq!(common_curvature([0.0; 3]), 0.0);
        // Between them, the least squares of both directions' shares: d k = k^2 + rest.
        let (k, l) = (50.0f64, 20.0f64);
        let d = common_curvature([k, 0.0, l]);
        let off = |d: f64| (d * k - k * k).powi(2) + (d * l - l * l).powi(2);
        assert!(off(d) < off(1.01 * d) && off(d) < off(0.99 * d));
    }
}
