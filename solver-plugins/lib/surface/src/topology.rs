//! Who touches whom in a mesh of triangles or quads, and sums over its cells.

use plyflow_geometry::vec3::{Vec3, cross, norm, scale, sub};
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Lists of indices, one list per row.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Rows {
    offsets: Vec<usize>,
    items: Vec<u32>,
}

impl Rows {
    /// From pairs (row, item), sorted and without repetitions.
    fn new(rows: usize, mut pairs: Vec<(u32, u32)>) -> Self {
        pairs.sort_unstable();
        pairs.dedup();
        let mut offsets = vec![0; rows + 1];
        for &(row, _) in &pairs {
            offsets[row as usize + 1] += 1;
        }
        for i in 0..rows {
            offsets[i + 1] += offsets[i];
        }
        Self {
            offsets,
            items: pairs.into_iter().map(|(_, item)| item).collect(),
        }
    }

    fn row(&self, i: usize) -> &[u32] {
        &self.items[self.offsets[i]..self.offsets[i + 1]]
    }
}

/// Neighbourhoods of a mesh whose cells all have 3 or 4 nodes. All lists are in ascending order, so
/// that everything built on them is the same in every run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topology {
    nodes: usize,
    nodes_per_cell: usize,
    cells: Vec<u32>,
    node_cells: Rows,
    rings: Rows,
    edges: Rows,
    free_edges: Vec<[u32; 2]>,
    free_nodes: Vec<bool>,
}

impl Topology {
    /// `cells`: `[m * nodes_per_cell]` node indices below `nodes`; `nodes_per_cell` is 3 or 4.
    ///
    /// # Panics
    /// When an index is out of range or `nodes_per_cell` is neither 3 nor 4.
    pub fn new(nodes: usize, nodes_per_cell: usize, cells: &[u32]) -> Self {
        assert!(
            nodes_per_cell == 3 || nodes_per_cell == 4,
            "cells of 3 or 4 nodes"
        );
        assert!(
            cells.iter().all(|&i| (i as usize) < nodes),
            "a cell names a node beyond {nodes}"
        );
        let k = nodes_per_cell;
        let (mut in_cell, mut ring, mut directed) = (Vec::new(), Vec::new(), Vec::new());
        for (c, cell) in cells.chunks_exact(k).enumerate() {
            for i in 0..k {
                in_cell.push((cell[i], c as u32));
                let (a, b) = (cell[i], cell[(i + 1) % k]);
                directed.push((a.min(b), a.max(b)));
                for j in 0..k {
                    if cell[j] != cell[i] {
                        ring.push((cell[i], cell[j]));
                    }
                }
            }
        }
        directed.retain(|(a, b)| a != b);
        directed.sort_unstable();
        let mut free_edges = Vec::new();
        let mut free_nodes = vec![false; nodes];
        for group in directed.chunk_by(|a, b| a == b) {
            if group.len() == 1 {
                let (a, b) = group[0];
                free_edges.push([a, b]);
                free_nodes[a as usize] = true;
                free_nodes[b as usize] = true;
            }
        }
        let both = directed
            .iter()
            .flat_map(|&(a, b)| [(a, b), (b, a)])
            .collect();
        Self {
            nodes,
            nodes_per_cell,
            cells: cells.to_vec(),
            node_cells: Rows::new(nodes, in_cell),
            rings: Rows::new(nodes, ring),
            edges: Rows::new(nodes, both),
            free_edges,
            free_nodes,
        }
    }

    /// Number of nodes.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Number of cells.
    pub fn cells(&self) -> usize {
        self.cells.len() / self.nodes_per_cell
    }

    /// Nodes of a cell, and the nodes of all cells one after the other.
    pub fn connectivity(&self) -> (usize, &[u32]) {
        (self.nodes_per_cell, &self.cells)
    }

    /// Nodes of a cell, in its order.
    pub fn cell(&self, c: usize) -> &[u32] {
        &self.cells[c * self.nodes_per_cell..(c + 1) * self.nodes_per_cell]
    }

    /// Cells at a node.
    pub fn cells_of(&self, node: usize) -> &[u32] {
        self.node_cells.row(node)
    }

    /// The one-ring: the other nodes of the cells at a node.
    pub fn ring(&self, node: usize) -> &[u32] {
        self.rings.row(node)
    }

    /// Nodes at the other end of the edges at a node.
    pub fn edge_neighbours(&self, node: usize) -> &[u32] {
        self.edges.row(node)
    }

    /// The nodes within `n` rings, without the node itself, ascending.
    pub fn rings(&self, node: usize, n: usize) -> Vec<u32> {
        let mut all = vec![node as u32];
        for _ in 0..n {
            let outer: Vec<u32> = all
                .iter()
                .flat_map(|&i| self.ring(i as usize).iter().copied())
                .collect();
            all.extend(outer);
            all.sort_unstable();
            all.dedup();
        }
        all.retain(|&i| i as usize != node);
        all
    }

    /// Edges with a cell on one side only, as (lower, higher) node, ascending.
    pub fn free_edges(&self) -> &[[u32; 2]] {
        &self.free_edges
    }

    /// Whether a node lies on a free edge.
    pub fn is_free(&self, node: usize) -> bool {
        self.free_nodes[node]
    }

    /// Connected sets of the `chosen` nodes (`[nodes]`), where nodes of one cell count as neighbours. Each
    /// set ascending; sets in the order of their lowest node.
    pub fn node_components(&self, chosen: &[bool]) -> Vec<Vec<u32>> {
        let mut seen = vec![false; self.nodes];
        let mut found = Vec::new();
        for start in 0..self.nodes {
            if !chosen[start] || seen[start] {
                continue;
            }
            seen[start] = true;
            let mut set = vec![start as u32];
            let mut at = 0;
            while at < set.len() {
                for &n in self.ring(set[at] as usize) {
                    if chosen[n as usize] && !seen[n as usize] {
                        seen[n as usize] = true;
                        set.push(n);
                    }
                }
                at += 1;
            }
            set.sort_unstable();
            found.push(set);
        }
        found
    }

    /// Area of every cell (m2) with its nodes at `points` (`[nodes]`): half the cross product of the
    /// diagonals for quads.
    pub fn cell_areas(&self, points: &[Vec3]) -> Vec<f64> {
        (0..self.cells())
            .map(|c| {
                let p: Vec<Vec3> = self.cell(c).iter().map(|&i| points[i as usize]).collect();
                let (u, v) = match p.len() {
                    3 => (sub(p[1], p[0]), sub(p[2], p[0])),
                    _ => (sub(p[2], p[0]), sub(p[3], p[1])),
                };
                0.5 * norm(cross(u, v))
            })
            .collect()
    }

    /// Tributary area of every node (m2): an equal share of each of its cells.
    pub fn node_areas(&self, points: &[Vec3]) -> Vec<f64> {
        let mut areas = vec![0.0; self.nodes];
        for (c, area) in self.cell_areas(points).into_iter().enumerate() {
            for &i in self.cell(c) {
                areas[i as usize] += area / self.nodes_per_cell as f64;
            }
        }
        areas
    }

    /// The areas of [`Topology::node_areas`], but 0 at nodes on a free edge: for what is known only where a node is
    /// surrounded by cells.
    pub fn inner_node_areas(&self, points: &[Vec3]) -> Vec<f64> {
        let areas = self.node_areas(points).into_iter().enumerate();
        areas
            .map(|(i, a)| if self.is_free(i) { 0.0 } else { a })
            .collect()
    }

    /// Length of the shortest path over cell sides and diagonals from the nearest of `sources` to every
    /// node (m); infinite beyond `reach` and where `passable` (`[nodes]`) does not let it through.
    pub fn path_lengths(
        &self,
        points: &[Vec3],
        sources: &[u32],
        passable: &[bool],
        reach: f64,
    ) -> Vec<f64> {
        let mut length = vec![f64::INFINITY; self.nodes];
        let mut queue = BinaryHeap::new();
        for &s in sources {
            length[s as usize] = 0.0;
            queue.push(Reverse((0u64, s)));
        }
        // Lengths are not negative, so their bit patterns are ordered as they are.
        while let Some(Reverse((bits, i))) = queue.pop() {
            let so_far = f64::from_bits(bits);
            if so_far > length[i as usize] {
                continue;
            }
            for &j in self.ring(i as usize) {
                let next = so_far + norm(sub(points[j as usize], points[i as usize]));
                if passable[j as usize] && next <= reach && next < length[j as usize] {
                    length[j as usize] = next;
                    queue.push(Reverse((next.to_bits(), j)));
                }
            }
        }
        length
    }

    /// Nodal normals by eq. 4.4 (after Max): the sum of cross products of the two sides at the node over
    /// the squares of their lengths, made unit. A quad gives the triangle of the node and its two
    /// neighbours in the cell. Zero where all cells are degenerate.
    pub fn normals(&self, points: &[Vec3]) -> Vec<Vec3> {
        let k = self.nodes_per_cell;
        let mut normals = vec![[0.0; 3]; self.nodes];
        for cell in self.cells.chunks_exact(k) {
            for i in 0..k {
                let p = points[cell[i] as usize];
                let u = sub(points[cell[(i + 1) % k] as usize], p);
                let v = sub(points[cell[(i + k - 1) % k] as usize], p);
                let weight = plyflow_geometry::vec3::dot(u, u) * plyflow_geometry::vec3::dot(v, v);
                if weight > 0.0 {
                    let n = &mut normals[cell[i] as usize];
                    *n = plyflow_geometry::vec3::add(*n, scale(cross(u, v), 1.0 / weight));
                }
            }
        }
        normals
            .into_iter()
            .map(plyflow_geometry::vec3::unit)
            .collect()
    }
}

/// Splits quads along their first diagonal (nodes 0 and 2) into triangles; triangles pass through.
pub fn triangles(nodes_per_cell: usize, cells: &[u32]) -> Vec<[u32; 3]> {
    match nodes_per_cell {
        3 => cells.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
        _ => cells
            .chunks_exact(4)
            .flat_map(|c| [[c[0], c[1], c[2]], [c[0], c[2], c[3]]])
            .collect(),
    }
}
