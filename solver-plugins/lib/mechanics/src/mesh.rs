//! Quad meshes of flat sheets.

use crate::vec3::{Vec3, cross, norm, scale, sub};

/// No neighbour: the edge is on the boundary.
pub const NONE: u32 = u32::MAX;

/// A mesh of quads.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct QuadMesh {
    /// `[n]` points (m).
    pub points: Vec<[f64; 3]>,
    /// `[m]` cells, nodes counter-clockwise seen from above.
    pub cells: Vec<[u32; 4]>,
}

/// A node with the elements around it: the support of a curvature.
#[derive(Debug, Clone, PartialEq)]
pub struct Patch {
    /// Centre first, then the other nodes of the surrounding cells in increasing order.
    pub nodes: Vec<u32>,
    /// Undeformed area that the patch speaks for (m2).
    pub area: f64,
}

/// Grid lines from `lo` to `hi`: at the whole multiples of `size` from `fine_lo` to `fine_hi`, growing outwards by `growth` per
/// cell (geometric, stretched to end exactly at `lo` and `hi`). All in metres.
pub fn graded_axis(
    lo: f64,
    hi: f64,
    fine_lo: f64,
    fine_hi: f64,
    size: f64,
    growth: f64,
) -> Vec<f64> {
    let mut lines = multiples_axis(fine_lo, fine_hi, size);
    lines.retain(|x| lo <= *x && *x <= hi);
    if lines.is_empty() {
        lines.push(0.5 * (lo + hi));
    }
    let outward = |length: f64| -> Vec<f64> {
        if length <= 0.5 * size {
            return Vec::new();
        }
        let mut widths = Vec::new();
        let (mut sum, mut w) = (0.0, size);
        while sum < length {
            w *= growth;
            widths.push(w);
            sum += w;
        }
        let factor = length / sum;
        widths.iter().map(|w| w * factor).collect()
    };
    let (first, last) = (lines[0], lines[lines.len() - 1]);
    let mut xs: Vec<f64> = Vec::new();
    let mut x = first;
    for w in outward(first - lo) {
        x -= w;
        xs.push(x);
    }
    xs.reverse();
    xs.extend(lines);
    x = last;
    for w in outward(hi - last) {
        x += w;
        xs.push(x);
    }
    // A rest that makes no cell of its own goes to the last one.
    xs[0] = lo;
    *xs.last_mut().expect("not empty") = hi;
    xs
}

/// A length (m) on whole multiples of 2^-48 m (4e-15 m): differences between such lengths are exact.
const QUANTUM: f64 = 1.0 / (1u64 << 48) as f64;

/// Lines at whole multiples of `size` (m), from the last that is not above `lo` to the first that is not below `hi`, but for
/// rounding. So meshes of different extents share their lines. They lie on whole multiples of [`QUANTUM`].
pub fn multiples_axis(lo: f64, hi: f64, size: f64) -> Vec<f64> {
    let step = (size / QUANTUM).round() * QUANTUM;
    let from = (lo / step + 1e-6).floor() as i64;
    let to = (hi / step - 1e-6).ceil() as i64;
    (from..=to).map(|i| i as f64 * step).collect()
}

/// Evenly spaced grid lines from `lo` to `hi` with a spacing near `size` (m).
pub fn even_axis(lo: f64, hi: f64, size: f64) -> Vec<f64> {
    let n = ((hi - lo) / size).round().max(1.0) as usize;
    even_lines(lo, hi, n).collect()
}

/// `n + 1` evenly spaced lines from `lo` to `hi` (m), on whole multiples of 2^-48 m (4e-15 m): differences between
/// them are then exact, all elements between them have the same bits of constants, and these are kept once. From 0 on they
/// are those of twice as many between `-hi` and `hi`: the first is exactly 0, where a mirror plane may be.
fn even_lines(lo: f64, hi: f64, n: usize) -> impl Iterator<Item = f64> {
    let whole = |x: f64| (x / QUANTUM).round();
    // From the middle, so that what is symmetric stays so.
    let (middle, before) = if lo == 0.0 {
        (0.0, 0.0)
    } else {
        (whole(0.5 * (lo + hi)), n as f64)
    };
    let step = whole((hi - lo) / n as f64 / 2.0);
    (0..=n).map(move |i| (middle + (2.0 * i as f64 - before) * step) * QUANTUM)
}

impl QuadMesh {
    /// A structured grid in the plane z = 0; node (i, j) has the index j * xs.len() + i.
    pub fn grid(xs: &[f64], ys: &[f64]) -> Self {
        let points = ys
            .iter()
            .flat_map(|y| xs.iter().map(|x| [*x, *y, 0.0]))
            .collect();
        let nx = xs.len() as u32;
        let cells = (0..ys.len() as u32 - 1)
            .flat_map(|j| {
                (0..nx - 1).map(move |i| {
                    let a = j * nx + i;
                    [a, a + 1, a + nx + 1, a + nx]
                })
            })
            .collect();
        Self { points, cells }
    }

    /// `[m]` area of each cell (m2).
    pub fn areas(&self) -> Vec<f64> {
        self.cells
            .iter()
            .map(|c| norm(area_vector(c.map(|n| self.points[n as usize]))))
            .collect()
    }

    /// `[m][4]` the cell across edge e (from node e to node e+1), or [`NONE`].
    pub fn neighbours(&self) -> Vec<[u32; 4]> {
        let mut edges: Vec<(u32, u32, u32, u8)> = Vec::with_capacity(self.cells.len() * 4);
        for (c, nodes) in self.cells.iter().enumerate() {
            for e in 0..4 {
                let (a, b) = (nodes[e], nodes[(e + 1) % 4]);
                edges.push((a.min(b), a.max(b), c as u32, e as u8));
            }
        }
        edges.sort_unstable();
        let mut result = vec![[NONE; 4]; self.cells.len()];
        for pair in edges.windows(2) {
            let ((a, b, c, e), (a2, b2, c2, e2)) = (pair[0], pair[1]);
            if (a, b) == (a2, b2) {
                result[c as usize][e as usize] = c2;
                result[c2 as usize][e2 as usize] = c;
            }
        }
        result
    }

    /// `[n]` whether a node lies on the boundary.
    pub fn on_boundary(&self) -> Vec<bool> {
        let mut flags = vec![false; self.points.len()];
        for (cell, near) in self.cells.iter().zip(self.neighbours()) {
            for e in 0..4 {
                if near[e] == NONE {
                    flags[cell[e] as usize] = true;
                    flags[cell[(e + 1) % 4] as usize] = true;
                }
            }
        }
        flags
    }

    /// `[n]` cells around each node, in increasing order.
    pub fn cells_of_nodes(&self) -> Vec<Vec<u32>> {
        let mut around = vec![Vec::new(); self.points.len()];
        for (c, nodes) in self.cells.iter().enumerate() {
            for n in nodes {
                around[*n as usize].push(c as u32);
            }
        }
        around
    }

    /// One patch per interior node. The area of a boundary node goes in equal parts to the interior nodes
    /// that share a cell with it, so that the patches' areas add up to the mesh's wherever it is at least
    /// two cells wide.
    pub fn patches(&self) -> Vec<Patch> {
        let around = self.cells_of_nodes();
        let areas = self.areas();
        let boundary = self.on_boundary();
        let share = |n: usize| {
            around[n]
                .iter()
                .map(|c| areas[*c as usize] / 4.0)
                .sum::<f64>()
        };
        let mut area: Vec<f64> = (0..self.points.len()).map(share).collect();
        let ring = |n: usize| -> Vec<u32> {
            let mut nodes: Vec<u32> = around[n]
                .iter()
                .flat_map(|c| self.cells[*c as usize])
                .collect();
            nodes.sort_unstable();
            nodes.dedup();
            nodes.retain(|m| *m as usize != n);
            nodes
        };
        for n in (0..self.points.len()).filter(|n| boundary[*n]) {
            let inner: Vec<u32> = ring(n)
                .into_iter()
                .filter(|m| !boundary[*m as usize])
                .collect();
            for m in &inner {
                area[*m as usize] += area[n] / inner.len() as f64;
            }
        }
        (0..self.points.len())
            .filter(|n| !boundary[*n] && !around[*n].is_empty())
            .map(|n| {
                let mut nodes = vec![n as u32];
                nodes.extend(ring(n));
                Patch {
                    nodes,
                    area: area[n],
                }
            })
            .collect()
    }
}

/// Drops from patches of more than `most` nodes (0: no patches) those farthest from the centre: six cells and more around
/// a node have more nodes than a fit of five derivatives needs.
pub fn limit_patches(patches: &mut [Patch], points: &[[f64; 3]], most: usize) {
    for patch in patches
        .iter_mut()
        .filter(|p| most > 0 && p.nodes.len() > most)
    {
        let centre = points[patch.nodes[0] as usize];
        let mut ring = patch.nodes.split_off(1);
        let away = |n: &u32| norm(sub(points[*n as usize], centre));
        ring.sort_by(|a, b| away(a).total_cmp(&away(b)).then(a.cmp(b)));
        ring.truncate(most - 1);
        ring.sort_unstable();
        patch.nodes.extend(ring);
    }
}

/// Area vector of a quad: half the cross product of its diagonals (m2).
#[inline(always)]
pub fn area_vector(p: [[f64; 3]; 4]) -> [f64; 3] {
    scale(cross(sub(p[2], p[0]), sub(p[3], p[1])), 0.5)
}

/// An order of points in which every run of `group` lies close together: halves by the longer extent, cut at
/// whole groups. Within a group the order is the given one.
pub(crate) fn compact_order(points: &[Vec3], group: usize) -> Vec<u32> {
    fn split(order: &mut [u32], points: &[Vec3], group: usize) {
        if order.len() <= group {
            order.sort_unstable();
            return;
        }
        let extent = |c: usize| {
            let of = |n: &u32| points[*n as usize][c];
            let low = order.iter().map(of).fold(f64::INFINITY, f64::min);
            let high = order.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
            high - low
        };
        let sizes = [extent(0), extent(1), extent(2)];
        let axis = (0..3).fold(0, |m, c| if sizes[c] > sizes[m] { c } else { m });
        let half = order.len().div_ceil(group).div_ceil(2) * group;
        let key = |n: &u32| points[*n as usize][axis];
        order.select_nth_unstable_by(half - 1, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
        let (left, right) = order.split_at_mut(half);
        split(left, points, group);
        split(right, points, group);
    }
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    split(&mut order, points, group);
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_of_a_grid_are_compact() {
        let points: Vec<Vec3> = (0..96 * 64)
            .map(|i| [f64::from(i % 96), f64::from(i / 96), 0.0])
            .collect();
        let order = compact_order(&points, 256);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, n)| i as u32 == *n));
        for group in order.chunks(256) {
            for c in 0..2 {
                let of = |n: &u32| points[*n as usize][c];
                let low = group.iter().map(of).fold(f64::INFINITY, f64::min);
                let high = group.iter().map(of).fold(0.0, f64::max);
                assert!(high - low < 32.0, "{low} to {high}");
            }
        }
    }

    #[test]
    fn graded_axis_reaches_both_ends_and_never_jumps() {
        let xs = graded_axis(-0.9, 0.9, -0.35, 0.36, 0.008, 1.2);
        assert_eq!((xs[0], *xs.last().unwrap()), (-0.9, 0.9));
        let w: Vec<f64> = xs.windows(2).map(|p| p[1] - p[0]).collect();
        assert!(w.iter().all(|w| *w > 0.0));
        assert!(w.windows(2).all(|p| p[0] / p[1] < 1.3 && p[1] / p[0] < 1.3));
    }

    #[test]
    fn lines_from_nought_are_half_of_those_on_both_sides() {
        for (half, size) in [(0.1, 0.0033), (0.15, 0.007), (0.06, 0.006)] {
            let part = even_axis(0.0, half, size);
            let n = part.len() - 1;
            let whole: Vec<f64> = even_lines(-half, half, 2 * n).collect();
            assert_eq!((part[0], &part[..]), (0.0, &whole[n..]));
            assert!((part[n] - half).abs() < 1e-11);
        }
    }

    #[test]
    fn axes_of_different_extents_share_their_lines() {
        let (size, ends) = (0.006, [-0.9, 0.9]);
        let whole = graded_axis(ends[0], ends[1], -0.3301, 0.41, size, 1.2);
        let fine: Vec<f64> = (whole.iter())
            .filter(|x| (-0.333..0.413).contains(*x))
            .copied()
            .collect();
        // -330.1 to 410 mm need the lines from -336 to 414.
        assert_eq!(fine, multiples_axis(-0.3301, 0.41, size)[1..125]);
        let zone = multiples_axis(-0.0721, 0.0481, size);
        assert_eq!(zone.len(), 23);
        assert!(zone.iter().all(|x| whole.contains(x)));
        // Exact multiples stay where they are; a mirror plane gets a line of exactly 0.
        let exact = multiples_axis(-0.072, 0.048, size);
        assert_eq!((exact[0], exact.len()), (zone[1], 21));
        let half = graded_axis(0.0, ends[1], 0.0, 0.41, size, 1.2);
        assert_eq!(half[0], 0.0);
        assert!(half.windows(2).take(69).all(|w| w[1] - w[0] == half[1]));
        // Within half a cell of the end the last line moves there.
        let close = graded_axis(-0.098, 0.098, -0.097, 0.097, size, 1.2);
        assert_eq!((close[0], close.len()), (-0.098, 33));
    }

    #[test]
    fn patch_areas_add_up_to_the_mesh_area() {
        let mesh = QuadMesh::grid(&even_axis(0.0, 0.3, 0.01), &even_axis(0.0, 0.2, 0.013));
        let total: f64 = mesh.patches().iter().map(|p| p.area).sum();
        assert!((total - 0.06).abs() < 1e-12);
        assert!(mesh.patches().iter().all(|p| p.nodes.len() == 9));
    }

    #[test]
    fn patches_of_too_many_nodes_keep_the_nearest() {
        let at = |k: u32, r: f64| {
            let (s, c) = (std::f64::consts::TAU * f64::from(k) / 12.0).sin_cos();
            [r * c, r * s, 0.0]
        };
        let mut points = vec![[0.0; 3]];
        points.extend((0..12).map(|k| {
            at(
                k,
                if k % 2 == 0 {
                    1.0
                } else {
                    1.4 + 0.01 * f64::from(k)
                },
            )
        }));
        let cells = (0..6).map(|k| [0, 1 + 2 * k, 2 + 2 * k, 1 + (2 * k + 2) % 12]);
        let mesh = QuadMesh {
            points,
            cells: cells.collect(),
        };
        let mut patches = mesh.patches();
        assert_eq!((patches.len(), patches[0].nodes.len()), (1, 13));
        limit_patches(&mut patches, &mesh.points, 12);
        // The corner of the last cell is the farthest.
        assert_eq!(patches[0].nodes, (0..12).collect::<Vec<u32>>());
        limit_patches(&mut patches, &mesh.points, 0);
        assert_eq!(patches[0].nodes.len(), 12);
    }

    #[test]
    fn neighbours_are_mutual_and_missing_on_the_boundary() {
        let mesh = QuadMesh::grid(&even_axis(0.0, 3.0, 1.0), &even_axis(0.0, 2.0, 1.0));
        let near = mesh.neighbours();
        assert_eq!(near[0], [NONE, 1, 3, NONE]);
        assert_eq!(near[4], [1, 5, NONE, 3]);
        assert_eq!(mesh.on_boundary().iter().filter(|b| !**b).count(), 2);
    }
}
