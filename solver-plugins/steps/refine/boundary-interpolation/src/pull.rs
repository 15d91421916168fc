//! What the surroundings of a zone pull at its cut with, in the coarse run.

use crate::grid::{Grid, SAME_PLACE, SIDES};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add};
use plyflow_geometry::{Location, QuadLocator};
use plyflow_model::steering::Laid;
use plyflow_surface::traction;

/// Fields of a coarse ply that hold S11, S22, S12 (N/m).
pub(crate) const FORCES: [&str; 3] = ["membrane_force_1", "membrane_force_2", "membrane_force_12"];

/// How far on either side of the cut the coarse ply is looked at, over the length of a piece of the cut: forces jump from cell to cell.
const BESIDE: f64 = 0.01;

/// A side of a fine cell on the cut.
struct Piece {
    /// Its nodes, as positions in the driven ones.
    ends: [usize; 2],
    /// Outward normal in the flat ply.
    normal: [f64; 2],
    /// (m).
    length: f64,
    /// Coarse places on its sides; one where the other is off the ply.
    beside: Vec<Location>,
}

/// The cut of a fine ply on its coarse one.
pub(crate) struct Pull {
    pieces: Vec<Piece>,
    driven: usize,
    /// `[coarse nodes]` (m).
    undeformed: Vec<Vec3>,
    /// Directions of the fibres, whose first axis is that of the forces.
    laid: Laid,
}

impl Pull {
    /// Of a fine mesh with its driven nodes (ascending) on the coarse one (`undeformed`, m; `cells` `[m * 4]`).
    pub(crate) fn new(
        grid: &Grid,
        driven: &[u32],
        undeformed: &[Vec3],
        cells: &[u32],
        laid: Laid,
    ) -> Self {
        let locator = QuadLocator::new(undeformed, cells);
        let mut pieces = Vec::new();
        for side in 0..SIDES {
            let Some(nodes) = &grid.cuts[side] else {
                continue;
            };
            // Left and right are lines of constant x, bottom and top of constant y.
            let (fixed, along) = (side / 2, 1 - side / 2);
            let outward = if side % 2 == 0 { -1.0 } else { 1.0 };
            for pair in nodes.windows(2) {
                let [a, b] = [0, 1].map(|i| grid.points[pair[i] as usize]);
                let length = (b[along] - a[along]).abs();
                let place = |way: f64| {
                    let mut at = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
                    at[fixed] += way * BESIDE * length;
                    locator.as_ref()?.locate(at[0], at[1], SAME_PLACE)
                };
                let mut normal = [0.0; 2];
                normal[fixed] = outward;
                pieces.push(Piece {
                    ends: [0, 1].map(|i| driven.partition_point(|d| *d < pair[i])),
                    normal,
                    length,
                    beside: [-1.0, 1.0].into_iter().filter_map(place).collect(),
                });
            }
        }
        for ends in &grid.pieces {
            let [a, b] = ends.map(|n| grid.points[n as usize]);
            let way = [b[0] - a[0], b[1] - a[1]];
            let length = way[0].fixed_hypot(way[1]);
            // The material is on the left.
            let normal = [way[1] / length, -way[0] / length];
            let place = |side: f64| {
                let at = |d: usize| 0.5 * (a[d] + b[d]) + side * BESIDE * length * normal[d];
                locator.as_ref()?.locate(at(0), at(1), SAME_PLACE)
            };
            pieces.push(Piece {
                ends: ends.map(|n| driven.partition_point(|d| *d < n)),
                normal,
                length,
                beside: [-1.0, 1.0].into_iter().filter_map(place).collect(),
            });
        }
        Self {
            pieces,
            driven: driven.len(),
            undeformed: undeformed.to_vec(),
            laid,
        }
    }

    /// By driven node, how long a part of the cut it stands for (m).
    pub(crate) fn lengths(&self) -> Vec<f64> {
        let mut all = vec![0.0; self.driven];
        for piece in &self.pieces {
            for end in piece.ends {
                all[end] += 0.5 * piece.length;
            }
        }
        all
    }

    /// By driven node, the force (N) of the surroundings on it, with the coarse nodes at `points` (m) and the fields [`FORCES`] by
    /// coarse cell.
    pub(crate) fn forces(&self, points: &[Vec3], forces: &[Vec<f64>; 3]) -> Vec<Vec3> {
        let mut all = vec![[0.0; 3]; self.driven];
        for piece in &self.pieces {
            let share = 0.5 * piece.length / piece.beside.len().max(1) as f64;
            for at in &piece.beside {
                let [then, now] =
                    [&self.undeformed[..], points].map(|p| at.nodes.map(|n| p[n as usize]));
                let s = [0, 1, 2].map(|k| forces[k][at.cell]);
                let axis = self.laid.axis_in_cell(&then);
                let pull = traction(then, now, s, axis, piece.normal).map(|t| share * t);
                for end in piece.ends {
                    all[end] = add(all[end], pull);
                }
            }
        }
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::ply_grid;
    use plyflow_geometry::vec3::norm;

    #[test]
    fn a_zone_is_in_balance_under_the_pulls_of_an_even_tension() {
        // 100 x 60 mm in cells of 10 mm, stretched by 2 % along x and turned about y, under 500 N/m along x.
        let (mut points, mut cells) = (Vec::new(), Vec::new());
        for j in 0..=6u32 {
            for i in 0..=10u32 {
                points.push([0.01 * f64::from(i), 0.01 * f64::from(j), 0.0]);
            }
        }
        for j in 0..6u32 {
            for i in 0..10u32 {
                let n = 11 * j + i;
                cells.extend([n, n + 1, n + 12, n + 11]);
            }
        }
        let (sin, cos) = 0.3f64.sin_cos();
        let now: Vec<Vec3> = points
            .iter()
            .map(|p| [1.02 * cos * p[0], p[1], 1.02 * sin * p[0]])
            .collect();
        // The right side is the ply's own edge: not cut.
        let grid = ply_grid([0.02, 0.01, 0.2, 0.05], [0.0, 0.0, 0.1, 0.06], 0.005).unwrap();
        let driven = grid.driven_nodes();
        let axis = 0.4f64;
        let laid = Laid::Straight([axis, axis + std::f64::consts::FRAC_PI_2]);
        let pull = Pull::new(&grid, &driven, &points, &cells, laid);
        let (s, c) = axis.sin_cos();
        let even = [500.0 * c * c, 500.0 * s * s, -500.0 * s * c];
        let forces = even.map(|v| vec![v; cells.len() / 4]);
        let all = pull.forces(&now, &forces);
        let sum = all.iter().fold([0.0; 3], |s, f| add(s, *f));
        // Only the left side, 40 mm of it, is pulled at: 500 N/m times the stretch, along the ply.
        let expected = [-20.0 * 1.02 * cos, 0.0, -20.0 * 1.02 * sin];
        let off = [0, 1, 2].map(|k| sum[k] - expected[k]);
        assert!(norm(off) < 1e-9, "{sum:?} {expected:?}");
        for (n, f) in driven.iter().zip(&all) {
            let left = (grid.points[*n as usize][0] - 0.02).abs() < 1e-9;
            assert_eq!(norm(*f) > 1e-9, left);
        }
        // All of the cut: left, and bottom and top from there to the edge.
        let length: f64 = pull.lengths().iter().sum();
        assert!((length - (0.04 + 2.0 * 0.08)).abs() < 1e-12, "{length}");
    }

    #[test]
    fn the_pulls_at_a_cut_across_an_edge_are_those_of_the_line_between_its_ends() {
        // 100 x 60 mm in cells of 10 mm under 500 N/m along x; the fine ply ends at a slanted edge in them.
        let axis = |n: u32| (0..=n).map(|i| 0.01 * f64::from(i)).collect::<Vec<_>>();
        let coarse = plyflow_mechanics::mesh::QuadMesh::grid(&axis(10), &axis(6));
        let cells = coarse.cells.as_flattened();
        let outline = [[0.0, 0.0], [0.1, 0.0], [0.06, 0.06], [0.0, 0.06]];
        let zone = [0.03, 0.02, 0.2, 0.05];
        let grid = crate::part::ply_part(zone, &outline, &[], 0.005)
            .unwrap()
            .unwrap();
        let driven = grid.driven_nodes();
        let pull = Pull::new(
            &grid,
            &driven,
            &coarse.points,
            cells,
            Laid::Straight([0.0, 1.0]),
        );
        let forces = [500.0, 0.0, 0.0].map(|v| vec![v; coarse.cells.len()]);
        let all = pull.forces(&coarse.points, &forces);
        let sum = all.iter().fold([0.0; 3], |s, f| add(s, *f));
        // The material lies left of its pieces, which go around it: their normals along x add up to the way along y.
        let y = |n: u32| grid.points[n as usize][1];
        let way: f64 = grid.pieces.iter().map(|[a, b]| y(*b) - y(*a)).sum();
        assert!(way < -0.025, "{way}");
        assert!(
            (sum[0] - 500.0 * way).abs() < 1e-9 && sum[1].abs() < 1e-9,
            "{sum:?}"
        );
        let length: f64 = pull.lengths().iter().sum();
        assert!(length > 0.09, "{length}");
    }
}
