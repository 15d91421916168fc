//! Motion of the nodes on a cut, and how well their straight edges follow the coarse run.

use crate::grid::{Grid, SAME_PLACE, SIDES};
use plyflow_geometry::vec3::{Vec3, add, distance, sub, unit};
use plyflow_geometry::{Location, QuadLocator};
use plyflow_surface::{SmoothSheet, StandOff, Topology};

/// How far outside of the coarse mesh a node may lie (m): rounding of outlines.
const SLACK: f64 = 1e-5;
/// The same of a mesh that follows an outline, over the length of a coarse element: chords of the coarse mesh cut curved edges off.
const CHORDS: f64 = 0.3;

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
    /// Of coarse nodes over fine ones.
    stand_off: StandOff,
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
        let outlined = grid.outlined;
        let topology = Topology::new(points.len(), 4, cells);
        let beyond = CHORDS * mean_size(points, &topology);
        let find = |[x, y]: [f64; 2]| {
            let inside = locator.locate(x, y, SLACK);
            let on_chords = || locator.locate_beyond(x, y, beyond).filter(|_| outlined);
            inside.or_else(on_chords).ok_or_else(|| {
                format!("the fine node at ({x}, {y}) m lies off the coarse mesh; is the zone inside the sheet?")
            })
        };
        let nodes = grid.points.iter();
        let locations: Vec<Location> = nodes.map(|p| find(*p)).collect::<Result<_, _>>()?;
        let height = |(l, &[x, y]): (&Location, &[f64; 2])| [x, y, l.interpolate(points)[2]];
        let placed = locations.iter().zip(&grid.points).map(height).collect();
        let driven_nodes = grid.driven_nodes();
        let mut crossings = crossings(&grid, &driven_nodes, points, &topology);
        crossings.extend(piece_crossings(&grid, &driven_nodes, points, &topology));
        let undeformed = SmoothSheet::new(points.to_vec(), cells);
        let lift = |l: &Location| undeformed.lift(&l.nodes, &l.weights);
        let fine_area = cell_area(&grid);
        Ok(Self {
            stand_off: StandOff::new(points, &topology, fine_area),
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
    /// Coarse nodes lie further off the material's surface than fine ones: they are brought back ([`StandOff`]).
    pub fn surface(&self, points: Vec<Vec3>) -> SmoothSheet {
        let coarse = SmoothSheet::new(points, &self.cells);
        let ways = self.stand_off.to_other(&coarse);
        let points = coarse.points.iter().zip(ways).map(|(p, w)| add(*p, w));
        SmoothSheet {
            points: points.collect(),
            ..coarse
        }
    }

    /// Positions of the driven nodes (`[k]`, m) on the coarse sheet.
    pub fn positions(&self, coarse: &SmoothSheet) -> Vec<Vec3> {
        let nodes = self.driven_nodes.iter();
        nodes.map(|n| self.position(*n as usize, coarse)).collect()
    }

    /// Positions of all nodes (`[n]`, m) on the coarse sheet.
    pub fn everywhere(&self, coarse: &SmoothSheet) -> Vec<Vec3> {
        let nodes = 0..self.points.len();
        nodes.map(|n| self.position(n, coarse)).collect()
    }

    fn position(&self, node: usize, coarse: &SmoothSheet) -> Vec3 {
        let l = &self.locations[node];
        let lift = sub(coarse.lift(&l.nodes, &l.weights), self.lifted[node]);
        add(l.interpolate(&coarse.points), lift)
    }

    /// Unit normals of the coarse sheet at the driven nodes (`[k]`), on the side that is up in the flat sheet: continuous along
    /// the cut.
    pub fn normals(&self, coarse: &SmoothSheet) -> Vec<Vec3> {
        let normal = |n: &u32| unit(self.locations[*n as usize].interpolate(&coarse.normals));
        self.driven_nodes.iter().map(normal).collect()
    }

    /// Largest distance (m), where coarse lines cross the cut, between the fine edges with their nodes at
    /// `driven` and the coarse sheet.
    pub fn error(&self, driven: &[Vec3], coarse: &SmoothSheet) -> f64 {
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

/// Mean area of a fine cell (m2).
fn cell_area(grid: &Grid) -> f64 {
    let cells = grid.cells.as_chunks::<4>().0;
    if !grid.outlined {
        let [x0, y0, x1, y1] = grid.bounds;
        return (x1 - x0) * (y1 - y0) / cells.len() as f64;
    }
    let area = |cell: &[u32; 4]| {
        let [a, b, c, d] = cell.map(|n| grid.points[n as usize]);
        0.5 * ((c[0] - a[0]) * (d[1] - b[1]) - (c[1] - a[1]) * (d[0] - b[0]))
    };
    cells.iter().map(area).sum::<f64>() / cells.len() as f64
}

/// Side (m) of a square as large as the mean cell of a flat mesh.
fn mean_size(points: &[Vec3], topology: &Topology) -> f64 {
    let areas = topology.cell_areas(points);
    (areas.iter().sum::<f64>() / areas.len().max(1) as f64).sqrt()
}

/// Where lines of the coarse mesh cross the cut of a mesh that follows an outline.
fn piece_crossings(
    grid: &Grid,
    driven: &[u32],
    points: &[Vec3],
    topology: &Topology,
) -> Vec<Crossing> {
    let mut found = Vec::new();
    for ends in &grid.pieces {
        let [p, q] = ends.map(|n| grid.points[n as usize]);
        let along = [q[0] - p[0], q[1] - p[1]];
        // Signed distance from the line through the piece, times its length.
        let off = |n: usize| along[0] * (points[n][1] - p[1]) - along[1] * (points[n][0] - p[0]);
        let fine = ends.map(|i| driven.partition_point(|&d| d < i));
        for a in 0..topology.nodes() {
            let da = off(a);
            for &b in topology
                .edge_neighbours(a)
                .iter()
                .filter(|b| **b as usize > a)
            {
                let db = off(b as usize);
                if da * db >= 0.0 {
                    continue;
                }
                let w = da / (da - db);
                let at = [0, 1].map(|d| points[a][d] + w * (points[b as usize][d] - points[a][d]));
                let way = (at[0] - p[0]) * along[0] + (at[1] - p[1]) * along[1];
                let share = way / (along[0] * along[0] + along[1] * along[1]);
                if (0.0..=1.0).contains(&share) {
                    found.push(Crossing {
                        coarse: [a as u32, b],
                        coarse_weight: w,
                        fine,
                        fine_weight: share,
                    });
                }
            }
        }
    }
    found
}

fn crossings(grid: &Grid, driven: &[u32], points: &[Vec3], topology: &Topology) -> Vec<Crossing> {
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
