//! Which nodes of a sheet come near which of its cells in space.
//!
//! Cells are gathered once into compact blocks. A search takes the boxes of the blocks and the cones of their
//! cells' normals. Blocks that join each other, and a block with itself, cannot meet while all their normals
//! lie within a right angle (Volino and Magnenat-Thalmann, Comput. Graph. Forum 13 (1994) 155); of the others,
//! those whose boxes overlap are looked at node by node. So a flat sheet costs a pass over its cells.

use super::closest::{Surface, closest};
use crate::mesh::{area_vector, compact_order};
use crate::vec3::{Vec3, add, dot, norm, scale, sub, unit};
use plyflow_fixed::FixedBits;
use rayon::prelude::*;
use std::f64::consts::FRAC_PI_2;

/// Least number of cells of a block.
const CELLS: usize = 64;

/// Compact groups of a sheet's cells.
pub(super) struct Blocks {
    blocks: Vec<Block>,
}

struct Block {
    /// In the model's numbering.
    cells: Vec<u32>,
    /// Its corners, each once.
    corners: Vec<u32>,
    /// Those that are slaves, each in one block only.
    nodes: Vec<u32>,
    /// Blocks with which it shares nodes, in increasing order, itself among them.
    joined: Vec<u32>,
}

/// Where a block is.
#[derive(Clone, Copy)]
struct Extent {
    low: Vec3,
    high: Vec3,
    /// Mean direction of its normals.
    axis: Vec3,
    /// Largest angle of a normal with it (rad).
    spread: f64,
}

/// How far a search looks.
pub(super) struct Reach<'a> {
    /// In space (m).
    pub(super) distance: f64,
    /// Cells nearer than this in the undeformed sheet (m) are none of a node's.
    pub(super) near: f64,
    /// `[nodes]` undeformed positions (m).
    pub(super) undeformed: &'a [Vec3],
}

/// A node and a cell of its sheet within reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Candidate {
    pub(super) node: u32,
    pub(super) cell: u32,
    pub(super) xi: [f64; 2],
    /// From the closest point to the node (m), and its length.
    pub(super) arm: Vec3,
    pub(super) distance: f64,
}

impl Blocks {
    /// Blocks of the cells in `range`, at least `2.5 reach` edges wide, so that those that do not join lie apart
    /// while the sheet is flat. `reach` in edges.
    pub(super) fn new(
        range: (usize, usize),
        cells: &[[u32; 4]],
        slaves: &[u32],
        undeformed: &[Vec3],
        reach: f64,
    ) -> Self {
        let centre = |c: usize| {
            let corners = cells[c].map(|n| undeformed[n as usize]);
            scale(corners.into_iter().fold([0.0; 3], add), 0.25)
        };
        let centres: Vec<Vec3> = (range.0..range.1).map(centre).collect();
        let size = CELLS.max((2.5 * reach).powi(2).ceil() as usize);
        let order = compact_order(&centres, size);
        let mut home = vec![u32::MAX; undeformed.len()];
        let mut around: Vec<(u32, u32)> = Vec::new();
        let mut blocks: Vec<Block> = Vec::new();
        for (b, group) in order.chunks(size).enumerate() {
            let own: Vec<u32> = group.iter().map(|c| c + range.0 as u32).collect();
            let mut corners: Vec<u32> = own.iter().flat_map(|c| cells[*c as usize]).collect();
            corners.sort_unstable();
            corners.dedup();
            around.extend(corners.iter().map(|n| (*n, b as u32)));
            let first = |n: &u32| std::mem::replace(&mut home[*n as usize], 0) == u32::MAX;
            let nodes = corners.iter().copied().filter(first);
            let nodes = nodes.filter(|n| slaves.binary_search(n).is_ok()).collect();
            blocks.push(Block {
                cells: own,
                corners,
                nodes,
                joined: Vec::new(),
            });
        }
        around.sort_unstable();
        for shared in around.chunk_by(|a, b| a.0 == b.0) {
            for (_, a) in shared {
                blocks[*a as usize]
                    .joined
                    .extend(shared.iter().map(|s| s.1));
            }
        }
        for block in &mut blocks {
            block.joined.sort_unstable();
            block.joined.dedup();
        }
        Self { blocks }
    }

    /// Keeps only those nodes for which `keep` says so.
    pub(super) fn retain(&mut self, keep: impl Fn(u32) -> bool) {
        for block in &mut self.blocks {
            block.nodes.retain(|n| keep(*n));
        }
    }

    /// All pairs within reach, by node and then by distance.
    pub(super) fn candidates(&self, s: &Surface<'_>, reach: &Reach<'_>) -> Vec<Candidate> {
        let extents: Vec<Extent> = self.blocks.par_iter().map(|b| b.extent(s)).collect();
        let pairs = self.pairs(&extents, reach.distance);
        let look = |(a, b): &(u32, u32)| {
            let mut found = Vec::new();
            let mut one_way = |a: u32, b: u32| {
                let (nodes, cells) = (
                    &self.blocks[a as usize].nodes,
                    &self.blocks[b as usize].cells,
                );
                near_pairs(s, reach, nodes, cells, &extents[b as usize], &mut found);
            };
            one_way(*a, *b);
            if a != b {
                one_way(*b, *a);
            }
            found
        };
        let found: Vec<Vec<Candidate>> = pairs.par_iter().map(look).collect();
        let mut all: Vec<Candidate> = found.into_iter().flatten().collect();
        all.sort_by(|a, b| {
            let by_distance = a.distance.total_cmp(&b.distance);
            a.node
                .cmp(&b.node)
                .then(by_distance)
                .then(a.cell.cmp(&b.cell))
        });
        all
    }

    /// Pairs of blocks that may meet: a sweep along the axis over which the sheet extends furthest.
    fn pairs(&self, extents: &[Extent], reach: f64) -> Vec<(u32, u32)> {
        let low = |c: usize| {
            extents
                .iter()
                .map(|e| e.low[c])
                .fold(f64::INFINITY, f64::min)
        };
        let high = |c: usize| {
            extents
                .iter()
                .map(|e| e.high[c])
                .fold(f64::NEG_INFINITY, f64::max)
        };
        let sizes = [0, 1, 2].map(|c| high(c) - low(c));
        let axis = (0..3).fold(0, |m, c| if sizes[c] > sizes[m] { c } else { m });
        let mut order: Vec<u32> = (0..extents.len() as u32).collect();
        order.sort_by(|a, b| {
            let at = |i: &u32| extents[*i as usize].low[axis];
            at(a).total_cmp(&at(b)).then(a.cmp(b))
        });
        let mut pairs = Vec::new();
        for (k, i) in order.iter().enumerate() {
            let a = &extents[*i as usize];
            for j in &order[k..] {
                let b = &extents[*j as usize];
                if b.low[axis] > a.high[axis] + reach {
                    break;
                }
                if a.overlaps(b, reach) && !self.is_open(*i, *j, a, b) {
                    pairs.push((*i.min(j), *i.max(j)));
                }
            }
        }
        pairs.sort_unstable();
        pairs
    }

    /// Whether two blocks are one piece of surface too open to meet itself.
    fn is_open(&self, i: u32, j: u32, a: &Extent, b: &Extent) -> bool {
        let joined = self.blocks[i as usize].joined.binary_search(&j).is_ok();
        let between = dot(a.axis, b.axis).clamp(-1.0, 1.0).fixed_acos();
        joined && between + a.spread + b.spread < FRAC_PI_2
    }
}

impl Block {
    fn extent(&self, s: &Surface<'_>) -> Extent {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for n in &self.corners {
            let x = s.x[*n as usize];
            for c in 0..3 {
                low[c] = low[c].min(x[c]);
                high[c] = high[c].max(x[c]);
            }
        }
        let area = |c: &u32| area_vector(s.cells[*c as usize].map(|n| s.x[n as usize]));
        let axis = unit(self.cells.iter().map(area).fold([0.0; 3], add));
        let cosine = |a: Vec3| dot(a, axis) / norm(a).max(1e-300);
        let least = self.cells.iter().map(area).map(cosine).fold(1.0, f64::min);
        Extent {
            low,
            high,
            axis,
            spread: least.clamp(-1.0, 1.0).fixed_acos(),
        }
    }
}

impl Extent {
    fn overlaps(&self, o: &Self, reach: f64) -> bool {
        (0..3).all(|c| self.low[c] <= o.high[c] + reach && o.low[c] <= self.high[c] + reach)
    }

    fn holds(&self, x: Vec3, reach: f64) -> bool {
        (0..3).all(|c| x[c] >= self.low[c] - reach && x[c] <= self.high[c] + reach)
    }
}

/// Whether no corner of a cell is `near` (m) a point in the undeformed sheet.
#[inline]
pub(super) fn is_far(cell: [u32; 4], undeformed: &[Vec3], own: Vec3, near: f64) -> bool {
    cell.iter().all(|n| {
        let d = sub(undeformed[*n as usize], own);
        dot(d, d) > near * near
    })
}

/// Adds the pairs of `nodes` with those of `cells` (in `extent`) that are far in the sheet and near in space.
fn near_pairs(
    s: &Surface<'_>,
    reach: &Reach<'_>,
    nodes: &[u32],
    cells: &[u32],
    extent: &Extent,
    found: &mut Vec<Candidate>,
) {
    let inside = |n: &&u32| extent.holds(s.x[**n as usize], reach.distance);
    let nodes: Vec<u32> = nodes.iter().filter(inside).copied().collect();
    if nodes.is_empty() {
        return;
    }
    for cell in cells {
        let corners = s.cells[*cell as usize];
        let x = corners.map(|n| s.x[n as usize]);
        let centre = scale(x.into_iter().fold([0.0; 3], add), 0.25);
        let radius = x.iter().map(|p| norm(sub(*p, centre))).fold(0.0, f64::max);
        // A rim reaches out by a part of the cell.
        let within = 1.5 * radius + reach.distance;
        for n in &nodes {
            let p = s.x[*n as usize];
            let arm = sub(p, centre);
            let own = reach.undeformed[*n as usize];
            if dot(arm, arm) > within * within
                || !is_far(corners, reach.undeformed, own, reach.near)
            {
                continue;
            }
            let c = closest(s, *cell, [0.0; 2], p, 6);
            if c.distance2 <= reach.distance * reach.distance {
                found.push(Candidate {
                    node: *n,
                    cell: *cell,
                    xi: c.xi,
                    arm: c.arm,
                    distance: c.distance2.sqrt(),
                });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{QuadMesh, even_axis};

    /// A strip wound up into a spiral whose layers are 2 mm apart.
    fn spiral() -> (QuadMesh, Vec<Vec3>) {
        let mesh = QuadMesh::grid(&even_axis(0.0, 0.4, 0.002), &even_axis(0.0, 0.05, 0.002));
        let pitch = 0.002 / std::f64::consts::TAU;
        let wind = |p: &Vec3| {
            // Length of the spiral r = a + b t, to first order in b / r.
            let t = ((0.01f64.powi(2) + 2.0 * pitch * p[0]).sqrt() - 0.01) / pitch;
            let r = 0.01 + pitch * t;
            [r * t.cos(), p[1], r * t.sin()]
        };
        let x = mesh.points.iter().map(wind).collect();
        (mesh, x)
    }

    fn blocks(mesh: &QuadMesh) -> Blocks {
        let slaves: Vec<u32> = (0..mesh.points.len() as u32).collect();
        Blocks::new(
            (0, mesh.cells.len()),
            &mesh.cells,
            &slaves,
            &mesh.points,
            1.0,
        )
    }

    #[test]
    fn a_search_finds_what_looking_at_all_pairs_finds() {
        let (mesh, x) = spiral();
        let neighbours = mesh.neighbours();
        let s = Surface {
            cells: &mesh.cells,
            neighbours: &neighbours,
            x: &x,
            normals: &x,
        };
        let reach = Reach {
            distance: 0.0022,
            near: 0.006,
            undeformed: &mesh.points,
        };
        let found = blocks(&mesh).candidates(&s, &reach);
        let (nodes, cells): (Vec<u32>, Vec<u32>) = (
            (0..x.len() as u32).collect(),
            (0..mesh.cells.len() as u32).collect(),
        );
        let everywhere = Extent {
            low: [-1.0; 3],
            high: [1.0; 3],
            axis: [0.0, 0.0, 1.0],
            spread: 0.0,
        };
        let mut all = Vec::new();
        near_pairs(&s, &reach, &nodes, &cells, &everywhere, &mut all);
        let keys = |list: &[Candidate]| {
            let mut keys: Vec<(u32, u32)> = list.iter().map(|c| (c.node, c.cell)).collect();
            keys.sort_unstable();
            keys
        };
        assert!(all.len() > 3 * x.len(), "{}", all.len());
        assert!(keys(&found) == keys(&all));
    }

    #[test]
    fn a_sheet_without_folds_has_no_blocks_to_look_at() {
        // Whole blocks.
        let mesh = QuadMesh::grid(&even_axis(0.0, 0.256, 0.002), &even_axis(0.0, 0.256, 0.002));
        // Waves with slopes of up to 37 degrees.
        let lift = |p: &Vec3| [p[0], p[1], 0.05 * (15.0 * p[0]).sin()];
        let x: Vec<Vec3> = mesh.points.iter().map(lift).collect();
        let neighbours = mesh.neighbours();
        let s = Surface {
            cells: &mesh.cells,
            neighbours: &neighbours,
            x: &x,
            normals: &x,
        };
        let blocks = blocks(&mesh);
        let extents: Vec<Extent> = blocks.blocks.iter().map(|b| b.extent(&s)).collect();
        assert_eq!(blocks.blocks.len(), 256);
        assert_eq!(blocks.pairs(&extents, 0.002), []);
    }
}
