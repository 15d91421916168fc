//! A sheet as the watch sees it: bilinear cells, their neighbours, the closest point of them.

use crate::watch::cell::{Foot, corner, direction, edge, foot, mix, tangents, weights};
use plyflow_geometry::TriangleTree;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub};
use plyflow_mechanics::mirror::Planes;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::sync::OnceLock;

/// A node nearer than this share of an element to the edge of a sheet is beside it.
const BESIDE: f64 = 0.1;
/// No cell: what lies across an edge where the sheet ends.
const RIM: u32 = u32::MAX;
/// Across this edge lies the cell's own mirror image.
const MIRROR: u32 = u32::MAX - 1;

/// Where on a sheet the closest point of a node was.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Seat {
    /// Cell, in the sheet's numbers; [`Seat::NOWHERE`]'s when none is known.
    pub cell: u32,
    /// Place in it, -1 to 1.
    pub xi: [f32; 2],
    /// Distance (m) from the sheet's middle surface, positive on the side where the node belongs; infinite when it was beside the sheet, or
    /// behind it without having gone through.
    pub side: f32,
}

impl Seat {
    /// Nothing known.
    pub const NOWHERE: Self = Self {
        cell: u32::MAX,
        xi: [0.0; 2],
        side: f32::INFINITY,
    };
}

/// The closest point of a sheet.
#[derive(Debug, Clone, Copy)]
pub struct Near {
    /// Cell.
    pub cell: u32,
    /// Place in it.
    pub xi: [f64; 2],
    /// Distance (m), positive on the upper side.
    pub height: f64,
    /// How far (m) the closest point is from the edge of the sheet, 0 on it; infinite where the cell does not reach the edge.
    pub to_rim: f64,
}

impl Near {
    /// Whether it is past the edge of the sheet, whose elements have that size (m), or hardly on it.
    pub fn is_beside(&self, size: f64) -> bool {
        self.to_rim <= BESIDE * size
    }
}

/// Topology of a sheet.
pub struct SheetMesh {
    /// Nodes of its cells, in the model's numbers, ascending.
    pub nodes: Vec<u32>,
    cells: Vec<[u32; 4]>,
    /// The same in the sheet's numbers.
    local: Vec<[u32; 4]>,
    /// By cell, across the edge from node k to the next: a cell, [`RIM`] or [`MIRROR`].
    across: Vec<[u32; 4]>,
    /// By node of the model: where its cells begin in `around`; one more at the end.
    first: Vec<u32>,
    around: Vec<u32>,
    /// By node of the model: whether it lies on the edge of the sheet.
    on_rim: Vec<bool>,
}

/// Where a cell is looked for among all.
pub struct SheetTree {
    tree: TriangleTree,
    /// By triangle.
    cells: Vec<u32>,
}

impl SheetTree {
    /// The cell that is closest to a place (m), each as two triangles. `hint`: a cell that is probably near.
    pub fn cell(&self, p: Vec3, hint: u32) -> u32 {
        // Its first triangle, where all cells have two.
        let triangle = (2 * hint as usize).min(self.cells.len() - 1);
        self.cells[self.tree.closest_from(p, triangle)]
    }

    /// The same, if it is nearer than `reach` (m). `last`: the triangle that was found last, if any (of a tree over the same cells), and is now.
    pub fn cell_within(&self, p: Vec3, reach: f64, last: &mut u32) -> Option<u32> {
        let hint = Some(*last as usize).filter(|t| *t < self.cells.len());
        let found = self.tree.closest_within(p, reach, hint)?;
        *last = found as u32;
        Some(self.cells[found])
    }
}

/// How a sheet is bent at one time, found out where it is asked for: a normal counts for up to four cells, and a cell for four nodes.
pub struct Bent {
    /// By node, in the sheet's numbers: [`SheetMesh::normal_at_node`].
    normals: Vec<OnceLock<Vec3>>,
    /// By cell: [`SheetMesh::bulge`] in its middle (m).
    middles: Vec<OnceLock<f64>>,
}

impl Bent {
    /// Nothing is known yet.
    pub fn new(mesh: &SheetMesh) -> Self {
        Self {
            normals: vec![OnceLock::new(); mesh.nodes.len()],
            middles: vec![OnceLock::new(); mesh.cells.len()],
        }
    }
}

/// Cells that are crossed at most on the way to the closest one.
const CROSSED: usize = 200;
/// A cell is nearer only when it is by this share of the squared distance: on a common edge both are equally near but for rounding.
const NEARER: f64 = 1.0 - 1e-9;

/// By node, of so many: where its cells begin in what comes second; one more at the end.
fn cells_around(cells: &[[u32; 4]], nodes: usize) -> (Vec<u32>, Vec<u32>) {
    let mut first = vec![0u32; nodes + 1];
    for n in cells.iter().flatten() {
        first[*n as usize + 1] += 1;
    }
    for n in 0..nodes {
        first[n + 1] += first[n];
    }
    let mut place = first.clone();
    let mut around = vec![0; 4 * cells.len()];
    for (i, cell) in cells.iter().enumerate() {
        for n in cell {
            around[place[*n as usize] as usize] = i as u32;
            place[*n as usize] += 1;
        }
    }
    (first, around)
}

impl SheetMesh {
    /// Of cells in the numbers of a model with points that started at `start` (m).
    pub fn new(cells: &[[u32; 4]], start: &[Vec3], planes: Planes) -> Self {
        let mut nodes: Vec<u32> = cells.iter().flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        let mut sides: HashMap<[u32; 2], [u32; 2]> = HashMap::new();
        let key = |c: &[u32; 4], e: usize| {
            let (a, b) = (c[e], c[(e + 1) % 4]);
            [a.min(b), a.max(b)]
        };
        for (i, cell) in cells.iter().enumerate() {
            for e in 0..4 {
                let both = sides.entry(key(cell, e)).or_insert([RIM; 2]);
                both[usize::from(both[0] != RIM)] = i as u32;
            }
        }
        let holding = |n: u32| planes.holding(start[n as usize]);
        let mut on_rim = vec![false; start.len()];
        let across = |(i, cell): (usize, &[u32; 4])| {
            [0, 1, 2, 3].map(|e| {
                let ends = key(cell, e);
                let both = sides[&ends];
                match both[usize::from(both[0] == i as u32)] {
                    RIM => {
                        let [a, b] = ends.map(holding);
                        if (0..2).any(|k| a[k] && b[k]) {
                            MIRROR
                        } else {
                            on_rim[ends[0] as usize] = true;
                            on_rim[ends[1] as usize] = true;
                            RIM
                        }
                    }
                    other => other,
                }
            })
        };
        let across = cells.iter().enumerate().map(across).collect();
        let (first, around) = cells_around(cells, start.len());
        let index = |n: u32| nodes.binary_search(&n).map_or(0, |k| k as u32);
        Self {
            local: cells.iter().map(|c| c.map(index)).collect(),
            nodes,
            cells: cells.to_vec(),
            across,
            first,
            around,
            on_rim,
        }
    }

    /// Number of a node of the model among [`SheetMesh::nodes`].
    ///
    /// # Panics
    /// When it is none of them.
    pub fn index(&self, node: u32) -> usize {
        self.nodes
            .binary_search(&node)
            .expect("a node of the sheet")
    }

    /// The box around it (m).
    pub fn bounds(&self, x: &[Vec3]) -> [Vec3; 2] {
        let all = self.nodes.iter().map(|n| x[*n as usize]);
        all.fold(
            [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]],
            |[low, high], p| {
                [
                    [0, 1, 2].map(|k| low[k].min(p[k])),
                    [0, 1, 2].map(|k| high[k].max(p[k])),
                ]
            },
        )
    }

    /// The cell with the nearest middle.
    pub fn nearest_middle(&self, x: &[Vec3], p: Vec3) -> u32 {
        let mut best = (f64::INFINITY, 0);
        for cell in 0..self.cells.len() as u32 {
            let away = sub(mix([0.25; 4], &self.corners(x, cell)), p);
            let square = dot(away, away);
            if square < best.0 {
                best = (square, cell);
            }
        }
        best.1
    }

    /// A tree over its cells as they are now; `None` when they have no area.
    pub fn tree(&self, x: &[Vec3]) -> Option<SheetTree> {
        let points: Vec<Vec3> = self.nodes.iter().map(|n| x[*n as usize]).collect();
        let (mut triangles, mut cells) = (Vec::new(), Vec::new());
        for (c, [a, b, d, e]) in self.local.iter().enumerate() {
            for t in [[*a, *b, *d], [*a, *d, *e]] {
                let [p, q, r] = t.map(|n| points[n as usize]);
                if norm(cross(sub(q, p), sub(r, p))) > 0.0 {
                    triangles.push(t);
                    cells.push(c as u32);
                }
            }
        }
        let tree = TriangleTree::new(points, triangles)?;
        Some(SheetTree { tree, cells })
    }

    /// Cells, in the model's nodes.
    pub fn cells(&self) -> &[[u32; 4]] {
        &self.cells
    }

    /// Nodes of the model in a cell.
    pub fn cell(&self, cell: u32) -> [u32; 4] {
        self.cells[cell as usize]
    }

    /// Whether a node of the model is one of the sheet's.
    pub fn has(&self, node: u32) -> bool {
        self.first[node as usize] < self.first[node as usize + 1]
    }

    fn around(&self, node: u32) -> &[u32] {
        let n = node as usize;
        &self.around[self.first[n] as usize..self.first[n + 1] as usize]
    }

    fn corners(&self, x: &[Vec3], cell: u32) -> [Vec3; 4] {
        self.cells[cell as usize].map(|n| x[n as usize])
    }

    /// The closest point to `p` (m), from a place near it: down to the closest of all cells that can be reached so.
    pub fn closest(&self, x: &[Vec3], p: Vec3, from: (u32, [f64; 2])) -> Near {
        let (mut cell, start) = from;
        let mut best = foot(&self.corners(x, cell), p, start);
        for _ in 0..CROSSED {
            let mut better = None;
            let mut look = |c: u32| {
                let least = better
                    .as_ref()
                    .map_or(best.square, |b: &(u32, Foot)| b.1.square);
                let f = foot(&self.corners(x, c), p, [0.0; 2]);
                if f.square < NEARER * least {
                    better = Some((c, f));
                }
            };
            match best.out {
                [0, 0] => break,
                [a, 0] | [0, a] => {
                    let coordinate = usize::from(best.out[0] == 0);
                    let other = self.across[cell as usize][edge(coordinate, a)];
                    if other < MIRROR {
                        look(other);
                    }
                }
                out => {
                    let node = self.cells[cell as usize][corner(out)];
                    for other in self.around(node).iter().filter(|c| **c != cell) {
                        look(*other);
                    }
                }
            }
            match better {
                Some((c, f)) => (cell, best) = (c, f),
                None => break,
            }
        }
        self.describe(x, cell, &best)
    }

    fn describe(&self, x: &[Vec3], cell: u32, f: &Foot) -> Near {
        let q = self.corners(x, cell);
        let nodes = self.cells[cell as usize];
        let across = self.across[cell as usize];
        let distance = f.square.sqrt();
        let own = || {
            let [a, b] = tangents(&q, f.xi);
            cross(a, b)
        };
        let (normal, on_rim) = match f.out {
            [0, 0] => (own(), false),
            [a, 0] | [0, a] => {
                let coordinate = usize::from(f.out[0] == 0);
                let e = edge(coordinate, a);
                match across[e] {
                    RIM => (own(), true),
                    MIRROR => (own(), false),
                    other => {
                        let there = self.normal_at_edge(x, other, [nodes[e], nodes[(e + 1) % 4]]);
                        (add(direction(own()), there), false)
                    }
                }
            }
            out => {
                let node = nodes[corner(out)];
                (self.normal_at_node(x, node), self.on_rim[node as usize])
            }
        };
        let above = dot(f.away, normal) >= 0.0;
        let to_rim = if on_rim {
            0.0
        } else {
            let of = |e: usize| {
                if across[e] != RIM {
                    return f64::INFINITY;
                }
                let length = norm(sub(
                    scale(add(q[(e + 2) % 4], q[(e + 3) % 4]), 0.5),
                    scale(add(q[e], q[(e + 1) % 4]), 0.5),
                ));
                let share = match e {
                    0 => 1.0 + f.xi[1],
                    1 => 1.0 - f.xi[0],
                    2 => 1.0 - f.xi[1],
                    _ => 1.0 + f.xi[0],
                };
                0.5 * share * length
            };
            (0..4).map(of).fold(f64::INFINITY, f64::min)
        };
        Near {
            cell,
            xi: f.xi,
            height: if above { distance } else { -distance },
            to_rim,
        }
    }

    /// Normal of a cell at the middle of the edge between two of its nodes.
    fn normal_at_edge(&self, x: &[Vec3], cell: u32, ends: [u32; 2]) -> Vec3 {
        let nodes = self.cells[cell as usize];
        let at = |e: usize| ends.contains(&nodes[e]) && ends.contains(&nodes[(e + 1) % 4]);
        let xi = match (0..4).find(|e| at(*e)) {
            Some(0) => [0.0, -1.0],
            Some(1) => [1.0, 0.0],
            Some(2) => [0.0, 1.0],
            Some(_) => [-1.0, 0.0],
            None => [0.0; 2],
        };
        let [a, b] = tangents(&self.corners(x, cell), xi);
        direction(cross(a, b))
    }

    /// Unit normal of the smooth sheet at a node: of the cells around it, each the less the longer its sides there
    /// (N. Max, J. Graphics Tools 4, 1999).
    pub fn normal_at_node(&self, x: &[Vec3], node: u32) -> Vec3 {
        let mut sum = [0.0; 3];
        for cell in self.around(node) {
            let nodes = self.cells[*cell as usize];
            let k = nodes.iter().position(|n| *n == node).unwrap_or(0);
            let at = |i: usize| x[nodes[(k + i) % 4] as usize];
            let (a, b) = (sub(at(1), at(0)), sub(at(3), at(0)));
            let lengths = dot(a, a) * dot(b, b);
            if lengths > 0.0 {
                sum = add(sum, scale(cross(a, b), 1.0 / lengths));
            }
        }
        direction(sum)
    }

    /// Normal (of any length) of a cell in its middle.
    pub fn normal_in(&self, x: &[Vec3], cell: u32) -> Vec3 {
        let [a, b, c, d] = self.corners(x, cell);
        cross(sub(c, a), sub(d, b))
    }

    /// How far (m) the smooth sheet through the nodes lies off the cell at a place in it: half of how far the tangent planes of the corners lie
    /// off it there, which is exact for a parabola; at most what it is for an element whose diagonal turns by one radian.
    pub fn bulge(&self, x: &[Vec3], bent: &Bent, cell: u32, xi: [f64; 2]) -> f64 {
        let (nodes, local) = (self.cells[cell as usize], self.local[cell as usize]);
        let q = self.corners(x, cell);
        let [a, b] = tangents(&q, xi);
        let normal = direction(cross(a, b));
        let w = weights(xi);
        let c = mix(w, &q);
        let off: f64 = (0..4)
            .map(|k| {
                let known = &bent.normals[local[k] as usize];
                let n = *known.get_or_init(|| self.normal_at_node(x, nodes[k]));
                w[k] * dot(n, sub(q[k], c)) / dot(n, normal).max(0.3)
            })
            .sum();
        let longest = (0..4)
            .map(|k| norm(sub(q[(k + 1) % 4], q[k])))
            .fold(0.0, f64::max);
        (0.5 * off.abs()).min(longest / 4.0)
    }

    /// The same in the middle of the cells around a node, the largest.
    pub fn bulge_around(&self, x: &[Vec3], bent: &Bent, node: u32) -> f64 {
        let of = |c: u32| {
            let known = &bent.middles[c as usize];
            *known.get_or_init(|| self.bulge(x, bent, c, [0.0; 2]))
        };
        let around = self.around(node).iter();
        around.map(|c| of(*c)).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_mechanics::mesh::{QuadMesh, even_axis};

    fn grid(shape: impl Fn(f64, f64) -> f64) -> (SheetMesh, Vec<Vec3>) {
        let mesh = QuadMesh::grid(&even_axis(0.0, 0.1, 0.01), &even_axis(0.0, 0.06, 0.01));
        let sheet = SheetMesh::new(&mesh.cells, &mesh.points, Planes::default());
        let lifted = |p: &Vec3| [p[0], p[1], shape(p[0], p[1])];
        let x = mesh.points.iter().map(lifted).collect();
        (sheet, x)
    }

    /// Nearest of many points of all cells.
    fn nearest(sheet: &SheetMesh, x: &[Vec3], p: Vec3) -> f64 {
        let steps = || (0..=40).map(|k| -1.0 + 0.05 * f64::from(k));
        let mut best = f64::INFINITY;
        for cell in 0..sheet.cells().len() as u32 {
            let q = sheet.corners(x, cell);
            for (u, v) in steps().flat_map(|u| steps().map(move |v| (u, v))) {
                best = best.min(norm(sub(p, mix(weights([u, v]), &q))));
            }
        }
        best
    }

    #[test]
    fn the_closest_point_of_a_wavy_sheet_is_found_from_anywhere_near_with_its_side() {
        let (sheet, x) = grid(|a, b| 0.004 * (90.0 * a).sin() * (60.0 * b).cos());
        let tree = sheet.tree(&x).unwrap();
        for i in 0..120 {
            let f = |k: f64| (f64::from(i) * k).fract();
            let (a, b) = (0.005 + 0.09 * f(0.618), 0.005 + 0.05 * f(0.414));
            let up = if i % 2 == 0 { 1.0 } else { -1.0 };
            let p = [
                a,
                b,
                0.004 * (90.0 * a).sin() * (60.0 * b).cos() + up * 0.0025,
            ];
            let near = sheet.closest(&x, p, (tree.cell(p, 0), [0.0; 2]));
            let by_points = nearest(&sheet, &x, p);
            let found = near.height.abs();
            assert!(
                found <= by_points + 1e-12 && found > by_points - 5e-5,
                "{p:?}: {found}, {by_points}"
            );
            assert!(near.height * up > 0.0, "{p:?}: {}", near.height);
            // From two cells away too.
            let from = sheet.nearest_middle(&x, [a + 0.012, b - 0.009, p[2]]);
            let walked = sheet.closest(&x, p, (from, [0.0; 2]));
            // Beside a hollow edge the closest point of one cell is not that of both: by what the edge's angle makes of the distance.
            let more = walked.height.abs() - near.height.abs();
            assert!(more < 2e-4 && walked.height * up > 0.0, "{p:?}: {more}");
        }
    }

    #[test]
    fn past_its_edge_a_sheet_has_no_side_and_at_a_mirror_plane_it_has_no_edge() {
        let (sheet, x) = grid(|_, _| 0.0);
        let at = |sheet: &SheetMesh, p: Vec3| {
            sheet.closest(&x, p, (sheet.nearest_middle(&x, p), [0.0; 2]))
        };
        assert_eq!(at(&sheet, [-0.003, 0.03, -0.002]).to_rim, 0.0);
        assert_eq!(at(&sheet, [0.102, 0.062, 0.002]).to_rim, 0.0);
        assert!((at(&sheet, [0.004, 0.03, -0.002]).to_rim - 0.004).abs() < 1e-9);
        assert_eq!(at(&sheet, [0.05, 0.03, -0.002]).to_rim, f64::INFINITY);
        let mesh = QuadMesh::grid(&even_axis(0.0, 0.1, 0.01), &even_axis(0.0, 0.06, 0.01));
        let half = SheetMesh::new(&mesh.cells, &mesh.points, Planes([true, false]));
        let near = at(&half, [0.0, 0.03, -0.002]);
        assert_eq!((near.to_rim, near.height), (f64::INFINITY, -0.002));
    }

    #[test]
    fn what_a_cell_cuts_off_a_parabola_is_found_from_the_normals_at_its_corners() {
        let k = 20.0;
        let (sheet, x) = grid(|a, _| -0.5 * k * a * a);
        let cell = sheet.nearest_middle(&x, [0.035, 0.035, 0.0]);
        let (found, expected) = (
            sheet.bulge(&x, &Bent::new(&sheet), cell, [0.0; 2]),
            k * 0.01 * 0.01 / 8.0,
        );
        // The normals of the middle of the sheet are turned by its slope.
        assert!(
            (found / expected - 1.0).abs() < 0.25,
            "{found}, not {expected}"
        );
        let (flat, y) = grid(|a, b| 0.3 * a - 0.1 * b);
        assert!(flat.bulge(&y, &Bent::new(&flat), cell, [0.3, -0.4]) < 1e-15);
    }
}
