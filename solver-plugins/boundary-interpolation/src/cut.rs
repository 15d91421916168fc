//! Motion of the nodes on a cut, and how well their straight edges follow the coarse run.

use crate::grid::{Grid, SAME_PLACE, SIDES};
use nalgebra::DMatrix;
use plyflow_surface::vector::{Vec3, add, cross, distance, dot, norm, scale, sub, unit};
use plyflow_surface::{Location, QuadLocator, Topology};

/// How far outside of the coarse mesh a node may lie (m): rounding of outlines.
const SLACK: f64 = 1e-5;

/// A fine sheet placed in its coarse one.
#[derive(Debug, Clone)]
pub struct Placed {
    /// The flat fine mesh.
    pub grid: Grid,
    /// `[n]` fine nodes at their place in the undeformed stack (m).
    pub points: Vec<Vec3>,
    /// Nodes on cut sides, ascending.
    pub driven_nodes: Vec<u32>,
    /// `[n]` places of all nodes on the coarse mesh.
    locations: Vec<Location>,
    /// `[n]` how far the undeformed coarse surface is lifted there (m): none where it is flat.
    lifted: Vec<Vec3>,
    /// The coarse cells, `[m * 4]`.
    cells: Vec<u32>,
    /// `[coarse nodes]`.
    bending: Vec<Bending>,
    crossings: Vec<Crossing>,
}

/// A coarse sheet as a smooth surface through its nodes.
#[derive(Debug, Clone)]
pub struct CoarseSheet {
    points: Vec<Vec3>,
    normals: Vec<Vec3>,
}

/// How far a sheet is taken as curved whose normals turn by an angle with this cosine from node to node: wholly up to 45 degrees; at
/// 60 it is folded, not curved, and stays straight. Between them it fades out, so that nothing jumps while a sheet folds.
fn curved(cosine: f64) -> f64 {
    let s = ((cosine - 0.5) / 0.2).clamp(0.0, 1.0);
    s * s * (3.0 - 2.0 * s)
}

impl CoarseSheet {
    /// Nodes at `points` (`[n]` m), `cells` `[m * 4]`. Normals of the cells are averaged by area at the nodes.
    fn new(points: Vec<Vec3>, cells: &[u32]) -> Self {
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
    fn lift(&self, nodes: &[u32], weights: &[f64]) -> Vec3 {
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
}

/// A place where a line of the coarse mesh crosses the cut: there the coarse displacement has a kink, and
/// the fine edges miss it most.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    coarse: [u32; 2],
    coarse_weight: f64,
    /// Positions in `driven_nodes`.
    fine: [usize; 2],
    fine_weight: f64,
}

impl Placed {
    /// Locates a fine mesh in the undeformed coarse mesh of the same sheet (`points` `[n]` m, `cells`
    /// `[m * 4]`).
    ///
    /// # Errors
    /// With the place of the first node that lies off the coarse mesh.
    pub fn new(grid: Grid, points: &[Vec3], cells: &[u32]) -> Result<Self, String> {
        let locator = QuadLocator::new(points, cells).ok_or("the coarse sheet has no cell")?;
        let find = |[x, y]: [f64; 2]| {
            locator.locate(x, y, SLACK).ok_or_else(|| {
                format!("the fine node at ({x}, {y}) m lies off the coarse mesh; is the zone inside the sheet?")
            })
        };
        let nodes = grid.points.iter();
        let locations: Vec<Location> = nodes.map(|p| find(*p)).collect::<Result<_, _>>()?;
        let height = |(l, &[x, y]): (&Location, &[f64; 2])| [x, y, l.interpolate(points)[2]];
        let placed = locations.iter().zip(&grid.points).map(height).collect();
        let driven_nodes = grid.driven_nodes();
        let crossings = crossings(&grid, &driven_nodes, points, cells);
        let topology = Topology::new(points.len(), 4, cells);
        let undeformed = CoarseSheet::new(points.to_vec(), cells);
        let lift = |l: &Location| undeformed.lift(&l.nodes, &l.weights);
        let [x0, y0, x1, y1] = grid.bounds;
        let fine_area = (x1 - x0) * (y1 - y0) / (grid.cells.len() / 4) as f64;
        let bending = |i: usize| Bending::new(i, points, &topology, fine_area);
        Ok(Self {
            bending: (0..points.len()).map(bending).collect(),
            cells: cells.to_vec(),
            lifted: locations.iter().map(lift).collect(),
            grid,
            points: placed,
            driven_nodes,
            locations,
            crossings,
        })
    }

    /// The coarse sheet with its nodes at `points` (`[coarse nodes]`, m), as a surface for fine nodes.
    ///
    /// Sides of elements are as long as the material. So nodes on a curved sheet lie off the material's surface, by size^2 / 24 times
    /// [`common_curvature`], and the more the longer the sides: fine nodes lie between the coarse ones and the surface.
    pub fn surface(&self, points: Vec<Vec3>) -> CoarseSheet {
        let coarse = CoarseSheet::new(points, &self.cells);
        let moved = |(i, bending): (usize, &Bending)| {
            let (at, normal) = (coarse.points[i], coarse.normals[i]);
            let (mut second, mut least) = ([0.0; 3], 1.0f64);
            for (n, weights) in &bending.around {
                let off = dot(sub(coarse.points[*n as usize], at), normal);
                second = add(second, scale(*weights, off));
            }
            for (n, _) in &bending.around[..bending.next] {
                least = least.min(dot(normal, coarse.normals[*n as usize]));
            }
            let shift = curved(least) * bending.finer / 24.0 * common_curvature(second);
            add(at, scale(normal, shift))
        };
        let points = self.bending.iter().enumerate().map(moved).collect();
        CoarseSheet { points, ..coarse }
    }

    /// Positions of the driven nodes (`[k]`, m) on the coarse sheet.
    pub fn positions(&self, coarse: &CoarseSheet) -> Vec<Vec3> {
        let nodes = self.driven_nodes.iter();
        nodes.map(|n| self.position(*n as usize, coarse)).collect()
    }

    /// Positions of all nodes (`[n]`, m) on the coarse sheet.
    pub fn everywhere(&self, coarse: &CoarseSheet) -> Vec<Vec3> {
        let nodes = 0..self.points.len();
        nodes.map(|n| self.position(n, coarse)).collect()
    }

    fn position(&self, node: usize, coarse: &CoarseSheet) -> Vec3 {
        let l = &self.locations[node];
        let lift = sub(coarse.lift(&l.nodes, &l.weights), self.lifted[node]);
        add(l.interpolate(&coarse.points), lift)
    }

    /// Unit normals of the coarse sheet at the driven nodes (`[k]`), on the side that is up in the flat sheet: continuous along
    /// the cut.
    pub fn normals(&self, coarse: &CoarseSheet) -> Vec<Vec3> {
        let normal = |n: &u32| unit(self.locations[*n as usize].interpolate(&coarse.normals));
        self.driven_nodes.iter().map(normal).collect()
    }

    /// Largest distance (m), where coarse lines cross the cut, between the fine edges with their nodes at
    /// `driven` and the coarse sheet.
    pub fn error(&self, driven: &[Vec3], coarse: &CoarseSheet) -> f64 {
        let between = |a: Vec3, b: Vec3, w: f64| [0, 1, 2].map(|d| a[d] + w * (b[d] - a[d]));
        self.crossings
            .iter()
            .map(|c| {
                let [a, b] = c.coarse.map(|i| coarse.points[i as usize]);
                let lift = coarse.lift(&c.coarse, &[1.0 - c.coarse_weight, c.coarse_weight]);
                let [p, q] = c.fine.map(|i| driven[i]);
                let on_coarse = add(between(a, b, c.coarse_weight), lift);
                distance(on_coarse, between(p, q, c.fine_weight))
            })
            .fold(0.0, f64::max)
    }
}

/// How a coarse sheet's curvatures at a node come from how far the nodes around stand off its tangent plane.
#[derive(Debug, Clone)]
struct Bending {
    /// By how much coarse cells are larger than fine ones (m2).
    finer: f64,
    /// Nodes around, with their share (1/m2) in the second derivatives xx, xy and yy by the flat sheet's coordinates.
    around: Vec<(u32, Vec3)>,
    /// The first so many of them share a cell with it.
    next: usize,
}

impl Bending {
    /// Of a node: a paraboloid of least squares, with free slopes, through the nodes around (two rings at a free edge, where one lies
    /// on one side only). What they do not tell is 0.
    fn new(node: usize, points: &[Vec3], topology: &Topology, fine_area: f64) -> Self {
        let cells = topology.cells_of(node);
        if cells.is_empty() {
            // A node of no cell: nothing is placed on it.
            return Self {
                finer: 0.0,
                around: Vec::new(),
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
        let share = |j: usize| [2, 3, 4].map(|k| inverse[(k, j)] / area);
        let around = around.iter().enumerate().map(|(j, n)| (*n, share(j)));
        Self {
            finer: area - fine_area,
            around: around.collect(),
            next: ring.len(),
        }
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

fn crossings(grid: &Grid, driven: &[u32], points: &[Vec3], cells: &[u32]) -> Vec<Crossing> {
    let topology = Topology::new(points.len(), 4, cells);
    let mut found = Vec::new();
    for side in 0..SIDES {
        let Some(nodes) = &grid.cuts[side] else {
            continue;
        };
        // Left and right are lines of constant x, bottom and top of constant y.
        let (fixed, along) = (side / 2, 1 - side / 2);
        let level = grid.bounds[fixed + 2 * (side % 2)];
        for a in 0..topology.nodes() {
            let da = points[a][fixed] - level;
            for &b in topology.edge_neighbours(a) {
                let db = points[b as usize][fixed] - level;
                let on_line = da.abs() < SAME_PLACE;
                let seen = (b as usize) < a || da * db >= 0.0;
                if seen && !on_line {
                    continue;
                }
                let w = if on_line { 0.0 } else { da / (da - db) };
                let at = points[a][along] + w * (points[b as usize][along] - points[a][along]);
                if let Some((fine, fine_weight)) = on_polyline(grid, nodes, along, at) {
                    let fine = fine.map(|i| driven.partition_point(|&d| d < i));
                    found.push(Crossing {
                        coarse: [a as u32, b],
                        coarse_weight: w,
                        fine,
                        fine_weight,
                    });
                }
            }
        }
    }
    found
}

/// The two neighbouring nodes of a side around a coordinate, and the weight of the second.
fn on_polyline(grid: &Grid, nodes: &[u32], along: usize, at: f64) -> Option<([u32; 2], f64)> {
    nodes.windows(2).find_map(|w| {
        let [a, b] = [w[0], w[1]].map(|i| grid.points[i as usize][along]);
        (a <= at && at <= b).then(|| ([w[0], w[1]], (at - a) / (b - a)))
    })
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
