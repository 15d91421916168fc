//! Signed distance to a tool on a regular grid, smooth enough for a penalty force.
//!
//! Exact distances at the nodes of the grid are turned into coefficients of a tricubic B-spline by the local
//! quasi-interpolation c(i) = (8 d(i) - d(i-1) - d(i+1)) / 6 along each axis (de Boor, A Practical Guide
//! to Splines, XII), which reproduces cubics. The field is twice continuously differentiable and the
//! returned gradient is that of the returned distance, to the rounding of single precision.

use crate::audit::{FieldError, Survey};
use crate::mesh::ToolMesh;
use crate::tree::SurfaceTree;
use finer::{Finer, Wanted};
use plyflow_geometry::vec3::Vec3;
use rayon::prelude::*;
use std::sync::Arc;

mod finer;

/// Cells along each side of a block of the early-out map.
const BLOCK: usize = 4;

/// Signed distance to a tool, positive outside, with its gradient.
///
/// Facets on the bed do not count: walls that end there go on below it (the bed is a plane of its own). So
/// distances are meant for z >= 0, and right for both sides of a wall down to z = 0.
#[derive(Debug, Clone)]
pub struct SignedDistanceGrid {
    spacing: f64,
    reach: f64,
    /// Position of node (0, 0, 0).
    origin: Vec3,
    /// Nodes along x, y, z.
    nodes: [usize; 3],
    /// Box in which queries are interpolated.
    box_low: Vec3,
    box_high: Vec3,
    /// Box of the tool.
    tool_low: Vec3,
    tool_high: Vec3,
    /// B-spline coefficients (m), z fastest.
    coefficients: Vec<f32>,
    /// How much less than the distance a value may be at most (m).
    nearer: f64,
    blocks: [usize; 3],
    /// For each block of cells a bound of the distance in it: lower where positive, upper where negative
    /// (inside), 0 where the sign changes. z fastest.
    bounds: Vec<f32>,
    /// What is added where the tool is sharper than the spacing shows.
    finer: Arc<Finer>,
}

impl SignedDistanceGrid {
    /// Samples the surface at `spacing` (m). Distances up to `reach` (m) outside the tool are resolved:
    /// beyond, queries give a lower bound. Runs on the current rayon pool; the result does not depend on
    /// its threads.
    ///
    /// # Panics
    /// If the mesh has no facets, or `spacing` or `reach` is not a positive number.
    pub fn build(mesh: &ToolMesh, spacing: f64, reach: f64) -> Self {
        check_arguments(mesh, spacing, reach);
        let survey = Survey::new(mesh, reach + 8.0 * spacing);
        Self::over(mesh, &survey, spacing, reach)
    }

    /// As [`build`](Self::build), and finer, in steps of two down to a 64th of `spacing`, wherever the field would differ from the triangles by
    /// more than four fifths of `tolerance` (m) on the surface or `offset` (m) out of it, unless it differs by `tolerance` nowhere where `counts` is
    /// true. Also tells the largest error that is left.
    ///
    /// # Panics
    /// As [`build`](Self::build).
    pub fn build_within(
        mesh: &ToolMesh,
        [spacing, reach]: [f64; 2],
        [tolerance, offset]: [f64; 2],
        counts: &(dyn Fn([f64; 3]) -> bool + Sync),
    ) -> (Self, FieldError) {
        check_arguments(mesh, spacing, reach);
        let survey = Survey::new(mesh, reach + 8.0 * spacing);
        let mut grid = Self::over(mesh, &survey, spacing, reach);
        let wanted = Wanted {
            tolerance,
            offset,
            counts,
        };
        let error = grid.refine(&survey, &wanted);
        grid.bounds = block_bounds(&grid.coefficients, grid.nodes, grid.blocks, &grid.finer);
        (grid, error)
    }

    /// The field over a survey of its tool.
    fn over(mesh: &ToolMesh, survey: &Survey, spacing: f64, reach: f64) -> Self {
        let [tool_low, tool_high] = mesh.bounds();
        let box_low = tool_low.map(|v| v - reach);
        let box_high = tool_high.map(|v| v + reach);
        // A cell needs a node more on each side for its spline, and one more for the coefficients.
        let origin = box_low.map(|v| v - 2.0 * spacing);
        let nodes: [usize; 3] =
            std::array::from_fn(|k| ((box_high[k] - box_low[k]) / spacing).ceil() as usize + 6);
        // Of bodies that stand on or in each other the nearest facet may be one inside of another: the least of their own distances is that of
        // what they are together, outside of it and in sign.
        let mut samples: Option<Vec<f32>> = None;
        for tree in survey.trees() {
            let own = sample(tree, origin, spacing, nodes);
            samples = Some(match samples {
                None => own,
                Some(mut least) => {
                    least.iter_mut().zip(own).for_each(|(a, b)| *a = a.min(b));
                    least
                }
            });
        }
        let samples = samples.unwrap_or_default();
        let coefficients = spline_coefficients(samples, nodes);
        let blocks = nodes.map(|n| (n - 1).div_ceil(BLOCK));
        let finer = Arc::default();
        let bounds = block_bounds(&coefficients, nodes, blocks, &finer);
        Self {
            spacing,
            reach,
            origin,
            nodes,
            box_low,
            box_high,
            tool_low,
            tool_high,
            coefficients,
            nearer: 0.0,
            blocks,
            bounds,
            finer,
        }
    }

    /// The field on whose zero the nodes of straight elements with sides of `size` (m) lie when the elements are as long, over all, as
    /// the surface. With their nodes on the surface itself they would take short cuts: chords of an arc of radius R are shorter than it by
    /// a share of size^2 / (24 R^2). So the nodes lie off by size^2 / 24 times the curvature, outside of what is
    /// convex, inside of what is hollow: the share left is of the fourth power. One offset serves two directions: for principal
    /// curvatures k it is best, in the least squares of both shares, with sum k^3 / sum k^2. The curvatures are those of the
    /// distance's second differences over half an element, over which an edge is spread as well, along the surface alone: across it the distance has none,
    /// but differences that reach to the other side of a thin wall have.
    pub fn of_equal_length(&self, size: f64) -> Self {
        let reach = ((0.5 * size / self.spacing).round() as usize).max(1);
        let step = reach as f64 * self.spacing;
        let (nodes, from) = (self.nodes, &self.coefficients);
        let slab = nodes[1] * nodes[2];
        let stride = [slab, nodes[2], 1].map(|s| s * reach);
        // Flatter than this over an element, a surface has no curvature to speak of, and its directions are noise.
        let flat = (1e-3 / size).powi(2);
        let shift = |k: usize| -> f64 {
            let index = [k / slab, k / nodes[2] % nodes[1], k % nodes[2]];
            if (0..3).any(|a| index[a] < reach || index[a] + reach >= nodes[a]) {
                return 0.0;
            }
            let at = |k: usize| f64::from(from[k]);
            // Summed so that the field of a symmetric tool is its own mirror image to the bit.
            let (mut second, mut mixed, mut across) = ([0.0; 3], [0.0; 3], [0.0; 3]);
            for a in 0..3 {
                let (s, t) = (stride[a], stride[(a + 1) % 3]);
                second[a] = ((at(k + s) + at(k - s)) - 2.0 * at(k)) / (step * step);
                let both = (at(k + s + t) + at(k - s - t)) - (at(k + s - t) + at(k - s + t));
                mixed[a] = both / (4.0 * step * step);
                across[a] = (at(k + s) - at(k - s)) / (2.0 * step);
            }
            let square = |v: [f64; 3]| (v[0] * v[0] + v[1] * v[1]) + v[2] * v[2];
            let steep = square(across).sqrt();
            // In the middle of a wall the distance has no direction.
            if steep < 0.1 {
                return 0.0;
            }
            let normal = across.map(|g| g / steep);
            // The second derivatives along the normal, and of these the part across the surface.
            let along: [f64; 3] = std::array::from_fn(|a| {
                let (b, c) = ((a + 1) % 3, (a + 2) % 3);
                second[a] * normal[a] + (mixed[a] * normal[b] + mixed[c] * normal[c])
            });
            let whole = square(second) + 2.0 * square(mixed);
            let through = (along[0] * normal[0] + along[1] * normal[1]) + along[2] * normal[2];
            let sum = ((second[0] + second[1]) + second[2]) - through;
            let squares =
                flat + ((whole - 2.0 * square(along)) + through * through).max(0.5 * sum * sum);
            // Of three principal curvatures one is none, across the surface.
            size * size / 24.0 * sum * (3.0 * squares - sum * sum) / (2.0 * squares)
        };
        let shifts: Vec<f64> = (0..from.len()).into_par_iter().map(shift).collect();
        let shifted = from.iter().zip(&shifts);
        let coefficients: Vec<f32> = shifted.map(|(c, s)| (f64::from(*c) - s) as f32).collect();
        Self {
            bounds: block_bounds(&coefficients, nodes, self.blocks, &self.finer),
            coefficients,
            finer: self.finer.clone(),
            nearer: self.nearer + shifts.iter().fold(0.0, |m: f64, s| m.max(*s)),
            ..*self
        }
    }

    /// Lowest and highest coordinates of the tool (m).
    pub fn tool_bounds(&self) -> [Vec3; 2] {
        [self.tool_low, self.tool_high]
    }

    /// Distance between the nodes of the grid (m).
    pub fn spacing(&self) -> f64 {
        self.spacing
    }

    /// Distance outside the tool up to which queries are resolved (m).
    pub fn reach(&self) -> f64 {
        self.reach
    }

    /// Bytes held.
    pub fn memory(&self) -> usize {
        4 * (self.coefficients.len() + self.bounds.len()) + self.finer.memory()
    }

    /// Signed distance (m) and its gradient (dimensionless, nearly unit length) at a point.
    ///
    /// Further than [`reach`](Self::reach) from the tool's box the result is the distance to that box: a
    /// lower bound of the distance to the tool.
    #[inline]
    pub fn distance_and_gradient(&self, p: [f64; 3]) -> (f64, [f64; 3]) {
        match self.cell(p) {
            Some((cell, part)) => self.interpolate(cell, part),
            None => self.distance_to_box(p),
        }
    }

    /// The field's largest error, held against the triangles at every facet and every edge, on the surface and `offset` (m) out of it, at
    /// places half a spacing apart, where `counts` is true.
    pub fn error_against(
        &self,
        mesh: &ToolMesh,
        offset: f64,
        counts: impl Fn([f64; 3]) -> bool + Sync,
    ) -> FieldError {
        let survey = Survey::new(mesh, self.reach + 8.0 * self.spacing);
        let field = |p| self.distance_and_gradient(p).0;
        survey.error([0.5 * self.spacing, offset], field, counts)
    }

    /// As [`distance_and_gradient`](Self::distance_and_gradient) for points closer than `limit` (at most
    /// `reach`) or inside; `None` for the others, mostly without interpolation.
    #[inline]
    pub fn within(&self, p: [f64; 3], limit: f64) -> Option<(f64, [f64; 3])> {
        debug_assert!(
            limit <= self.reach,
            "limit {limit} exceeds the reach {}",
            self.reach
        );
        let (cell, part) = self.cell(p)?;
        let bound = self.bounds[self.block(cell)];
        if f64::from(bound) >= limit {
            return None;
        }
        let found = self.interpolate(cell, part);
        (found.0 < limit).then_some(found)
    }

    /// [`within`](Self::within) for many points. Where a point is not closer than `limit` its distance is
    /// infinite and its gradient zero. The caller owns the outputs.
    ///
    /// # Panics
    /// If the slices differ in length.
    pub fn within_many(
        &self,
        points: &[[f64; 3]],
        limit: f64,
        distances: &mut [f64],
        gradients: &mut [[f64; 3]],
    ) {
        assert_eq!(points.len(), distances.len(), "one distance per point");
        assert_eq!(points.len(), gradients.len(), "one gradient per point");
        for ((p, d), g) in points.iter().zip(distances).zip(gradients) {
            (*d, *g) = self.within(*p, limit).unwrap_or((f64::INFINITY, [0.0; 3]));
        }
    }

    /// Cell that holds the point and the place in it, 0..1 along each axis.
    #[inline]
    fn cell(&self, p: Vec3) -> Option<([usize; 3], [f32; 3])> {
        let inverse = 1.0 / self.spacing;
        let mut cell = [0; 3];
        let mut part = [0.0; 3];
        for k in 0..3 {
            // Also false for NaN.
            if !(p[k] >= self.box_low[k] && p[k] <= self.box_high[k]) {
                return None;
            }
            let s = (p[k] - self.origin[k]) * inverse;
            cell[k] = s as usize;
            part[k] = (s - cell[k] as f64) as f32;
        }
        Some((cell, part))
    }

    #[inline]
    fn interpolate(&self, cell: [usize; 3], part: [f32; 3]) -> (f64, Vec3) {
        let stride = [self.nodes[1] * self.nodes[2], self.nodes[2]];
        let base = (cell[0] - 1) * stride[0] + (cell[1] - 1) * stride[1] + cell[2] - 1;
        let mut found = evaluate(&self.coefficients, base, stride, part, 1.0 / self.spacing);
        self.finer
            .add(self.block(cell), cell, part, self.spacing, &mut found);
        found
    }

    /// The block that holds a cell.
    #[inline]
    fn block(&self, cell: [usize; 3]) -> usize {
        let b = [cell[0] / BLOCK, cell[1] / BLOCK, cell[2] / BLOCK];
        (b[0] * self.blocks[1] + b[1]) * self.blocks[2] + b[2]
    }

    fn distance_to_box(&self, p: Vec3) -> (f64, Vec3) {
        let away: Vec3 = std::array::from_fn(|k| {
            if p[k] < self.tool_low[k] {
                p[k] - self.tool_low[k]
            } else if p[k] > self.tool_high[k] {
                p[k] - self.tool_high[k]
            } else {
                0.0
            }
        });
        let d = plyflow_geometry::vec3::norm(away);
        (
            (d - self.nearer).max(0.0),
            if d > 0.0 {
                [away[0] / d, away[1] / d, away[2] / d]
            } else {
                [0.0; 3]
            },
        )
    }
}

fn check_arguments(mesh: &ToolMesh, spacing: f64, reach: f64) {
    assert!(!mesh.triangles.is_empty(), "the tool has no facets");
    assert!(
        spacing > 0.0 && spacing.is_finite(),
        "spacing must be positive, not {spacing}"
    );
    assert!(
        reach > 0.0 && reach.is_finite(),
        "reach must be positive, not {reach}"
    );
}

/// Value and gradient of a tricubic B-spline at `part` of a cell, whose 4 x 4 x 4 coefficients begin at `base` and are apart by `stride` along x
/// and y; `inverse`: one over their spacing (1/m).
#[inline]
fn evaluate(
    coefficients: &[f32],
    base: usize,
    stride: [usize; 2],
    part: [f32; 3],
    inverse: f64,
) -> (f64, Vec3) {
    // One by one: the compiler leaves `map` over arrays as calls here, in the innermost loop of contact with a tool.
    let (wx, wy, wz) = (weights(part[0]), weights(part[1]), weights(part[2]));
    let (dx, dy, dz) = (slopes(part[0]), slopes(part[1]), slopes(part[2]));
    // Sums over x and y of rows along z: value, slope along x, slope along y.
    let (mut v, mut vx, mut vy) = ([0f32; 4], [0f32; 4], [0f32; 4]);
    for a in 0..4 {
        let (mut r, mut ry) = ([0f32; 4], [0f32; 4]);
        for b in 0..4 {
            let from = base + a * stride[0] + b * stride[1];
            let row: &[f32; 4] = coefficients[from..from + 4].try_into().unwrap();
            for c in 0..4 {
                r[c] += wy[b] * row[c];
                ry[c] += dy[b] * row[c];
            }
        }
        for c in 0..4 {
            v[c] += wx[a] * r[c];
            vx[c] += dx[a] * r[c];
            vy[c] += wx[a] * ry[c];
        }
    }
    let dot = |u: [f32; 4], w: [f32; 4]| {
        f64::from((u[0] * w[0] + u[1] * w[1]) + (u[2] * w[2] + u[3] * w[3]))
    };
    (
        dot(v, wz),
        [
            dot(vx, wz) * inverse,
            dot(vy, wz) * inverse,
            dot(v, dz) * inverse,
        ],
    )
}

/// Weights of the uniform cubic B-spline at place `t` in a cell.
#[inline]
fn weights(t: f32) -> [f32; 4] {
    let s = 1.0 - t;
    let (t2, s2) = (t * t, s * s);
    const SIXTH: f32 = 1.0 / 6.0;
    [
        SIXTH * s * s2,
        SIXTH * (4.0 - 3.0 * t2 * (2.0 - t)),
        SIXTH * (4.0 - 3.0 * s2 * (2.0 - s)),
        SIXTH * t * t2,
    ]
}

/// Their derivatives.
#[inline]
fn slopes(t: f32) -> [f32; 4] {
    let s = 1.0 - t;
    [
        -0.5 * s * s,
        0.5 * t * (3.0 * t - 4.0),
        0.5 * s * (4.0 - 3.0 * s),
        0.5 * t * t,
    ]
}

/// Exact distances at all nodes, z fastest.
fn sample(tree: &SurfaceTree, origin: Vec3, spacing: f64, nodes: [usize; 3]) -> Vec<f32> {
    let mut samples = vec![0f32; nodes.iter().product()];
    samples
        .par_chunks_mut(nodes[1] * nodes[2])
        .enumerate()
        .for_each(|(i, slab)| {
            let x = origin[0] + i as f64 * spacing;
            // The last facet found is nearly always close to the next: the search starts there.
            let mut hint = 0;
            for j in 0..nodes[1] {
                let y = origin[1] + j as f64 * spacing;
                for l in 0..nodes[2] {
                    // Up and down by turns, so that the next node is a neighbour.
                    let k = if j % 2 == 0 { l } else { nodes[2] - 1 - l };
                    let p = [x, y, origin[2] + k as f64 * spacing];
                    let (closest, place) = tree.closest_from(p, hint);
                    hint = place;
                    slab[j * nodes[2] + k] = closest.signed_distance as f32;
                }
            }
        });
    samples
}

/// A cubic B-spline stays between the least and the largest of the coefficients that it is made of.
fn block_bounds(
    coefficients: &[f32],
    nodes: [usize; 3],
    blocks: [usize; 3],
    finer: &Finer,
) -> Vec<f32> {
    let mut bounds = vec![0f32; blocks.iter().product()];
    let slab_size = blocks[1] * blocks[2];
    bounds
        .par_chunks_mut(slab_size)
        .enumerate()
        .for_each(|(bx, slab)| {
            for (at, bound) in slab.iter_mut().enumerate() {
                let b = [bx, at / blocks[2], at % blocks[2]];
                let range: [_; 3] = std::array::from_fn(|k| {
                    (b[k] * BLOCK).saturating_sub(1)..((b[k] + 1) * BLOCK + 2).min(nodes[k])
                });
                let (mut low, mut high) = (f32::INFINITY, f32::NEG_INFINITY);
                for i in range[0].clone() {
                    for j in range[1].clone() {
                        for k in range[2].clone() {
                            let c = coefficients[(i * nodes[1] + j) * nodes[2] + k];
                            (low, high) = (low.min(c), high.max(c));
                        }
                    }
                }
                let mut range = [low, high];
                finer.widen(bx * slab_size + at, &mut range);
                let [low, high] = range;
                *bound = if low > 0.0 { low } else { high.min(0.0) };
            }
        });
    bounds
}

/// Quasi-interpolation along each axis in turn; the outermost nodes keep their samples (no query uses
/// coefficients that depend on that).
fn spline_coefficients(mut from: Vec<f32>, nodes: [usize; 3]) -> Vec<f32> {
    let slab = nodes[1] * nodes[2];
    for axis in 0..3 {
        let stride = [slab, nodes[2], 1][axis];
        let mut to = from.clone();
        to.par_chunks_mut(slab).enumerate().for_each(|(i, out)| {
            for (at, c) in out.iter_mut().enumerate() {
                let index = [i, at / nodes[2], at % nodes[2]][axis];
                if index > 0 && index + 1 < nodes[axis] {
                    let k = i * slab + at;
                    let (d, sides) = (
                        f64::from(from[k]),
                        f64::from(from[k - stride]) + f64::from(from[k + stride]),
                    );
                    *c = ((8.0 * d - sides) / 6.0) as f32;
                }
            }
        });
        from = to;
    }
    from
}

#[cfg(test)]
mod tests;
