//! Motion of the nodes on a cut, and how well their straight edges follow the coarse run.

use crate::grid::{Grid, SAME_PLACE, SIDES};
use plyflow_surface::vector::{Vec3, add, cross, distance, sub, unit};
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
    locations: Vec<Location>,
    crossings: Vec<Crossing>,
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
        let mut placed = Vec::with_capacity(grid.points.len());
        for &[x, y] in &grid.points {
            let [_, _, z] = find([x, y])?.interpolate(points);
            placed.push([x, y, z]);
        }
        let driven_nodes = grid.driven_nodes();
        let locations = driven_nodes
            .iter()
            .map(|&i| find(grid.points[i as usize]))
            .collect::<Result<_, _>>()?;
        let crossings = crossings(&grid, &driven_nodes, points, cells);
        Ok(Self {
            grid,
            points: placed,
            driven_nodes,
            locations,
            crossings,
        })
    }

    /// Positions of the driven nodes (`[k]`, m) when the coarse nodes are at `coarse`.
    pub fn positions(&self, coarse: &[Vec3]) -> Vec<Vec3> {
        self.locations
            .iter()
            .map(|l| l.interpolate(coarse))
            .collect()
    }

    /// Unit normals of the coarse surface at the driven nodes (`[k]`), on the side that is up in the flat sheet: cells'
    /// normals averaged by area at the coarse nodes and interpolated, so that they are continuous along the cut.
    pub fn normals(&self, coarse: &[Vec3], cells: &[u32]) -> Vec<Vec3> {
        let mut at_nodes = vec![[0.0; 3]; coarse.len()];
        for cell in cells.chunks_exact(4) {
            let [a, b, c, d] = [0, 1, 2, 3].map(|i| coarse[cell[i] as usize]);
            // Half the cross product of the diagonals is the area of a quad, times its normal.
            let normal = cross(sub(c, a), sub(d, b));
            for &i in cell {
                at_nodes[i as usize] = add(at_nodes[i as usize], normal);
            }
        }
        let normals: Vec<Vec3> = at_nodes.into_iter().map(unit).collect();
        (self.locations.iter())
            .map(|l| unit(l.interpolate(&normals)))
            .collect()
    }

    /// Largest distance (m), where coarse lines cross the cut, between the fine edges with their nodes at
    /// `driven` and the coarse mesh with its nodes at `coarse`.
    pub fn error(&self, driven: &[Vec3], coarse: &[Vec3]) -> f64 {
        let between = |a: Vec3, b: Vec3, w: f64| [0, 1, 2].map(|d| a[d] + w * (b[d] - a[d]));
        self.crossings
            .iter()
            .map(|c| {
                let [a, b] = c.coarse.map(|i| coarse[i as usize]);
                let [p, q] = c.fine.map(|i| driven[i]);
                distance(between(a, b, c.coarse_weight), between(p, q, c.fine_weight))
            })
            .fold(0.0, f64::max)
    }
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
