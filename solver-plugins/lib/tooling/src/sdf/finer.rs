//! Finer splines on top of a grid's own, where a tool has features that its spacing does not show.
//!
//! Level l has the spacing h / 2^l. Its spline is a correction: that of what all coarser levels leave of the exact distance at its nodes.
//! Coefficients that are not needed are zero, so that the sum of all levels is twice continuously differentiable like each of them
//! (hierarchical B-splines; D. R. Forsey, R. H. Bartels, Hierarchical B-spline refinement, SIGGRAPH 1988).
//!
//! Coefficients are kept in bricks of 4 x 4 x 4 cells of their level, each with all that its cells need, in a tree: below each block of the grid
//! eight bricks of level 1, below each of these eight of level 2.

use super::{BLOCK, SignedDistanceGrid, evaluate};
use crate::audit::{FieldError, Near, Piece, Place, Survey};
use plyflow_geometry::vec3::Vec3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

/// Coefficients along a side of a brick: of its four cells, one before and two behind.
const SIDE: usize = BLOCK + 3;
const VALUES: usize = SIDE * SIDE * SIDE;
const NONE: u32 = u32::MAX;

/// Finest level: spacings 64 times smaller than the grid's.
pub(crate) const LEVELS: u32 = 6;

/// Most bricks, of 1.4 kB each.
const MOST_BRICKS: usize = 500_000;

/// Bricks whose coefficients are made together.
const MADE_TOGETHER: usize = 1024;

/// Share of what is wanted from which on a place is made finer: between the places that are looked at there is a little more.
const ENOUGH: f64 = 0.8;

#[derive(Debug, Clone, Copy, PartialEq)]
struct Brick {
    /// Number of its coefficients, [`VALUES`] each.
    values: u32,
    /// Number of its eight children.
    children: u32,
}

const EMPTY: Brick = Brick {
    values: NONE,
    children: NONE,
};

/// All finer levels of a grid.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Finer {
    /// Number of the eight children of each block of the grid; empty without any.
    roots: Vec<u32>,
    eights: Vec<[Brick; 8]>,
    values: Vec<f32>,
}

/// What has to be right, and where.
pub(crate) struct Wanted<'a> {
    /// Largest error (m) that is left where it can be helped.
    pub tolerance: f64,
    /// How far out of the surface (m) it counts as well.
    pub offset: f64,
    /// Whether it counts at a place.
    pub counts: &'a (dyn Fn(Vec3) -> bool + Sync),
}

impl Finer {
    /// Bytes held.
    pub fn memory(&self) -> usize {
        4 * (self.roots.len() + self.values.len())
            + std::mem::size_of::<[Brick; 8]>() * self.eights.len()
    }

    /// Adds all finer levels at a place to a value and its gradient; `block`, `cell` and `part` as of the grid, whose spacing is
    /// `spacing` (m).
    #[inline]
    pub fn add(
        &self,
        block: usize,
        cell: [usize; 3],
        part: [f32; 3],
        spacing: f64,
        found: &mut (f64, Vec3),
    ) {
        if self.roots.is_empty() {
            return;
        }
        let mut eight = self.roots[block];
        let mut inner = [cell[0] % BLOCK, cell[1] % BLOCK, cell[2] % BLOCK];
        let (mut part, mut inverse) = (part, 1.0 / spacing);
        while eight != NONE {
            let octant = [inner[0] >> 1, inner[1] >> 1, inner[2] >> 1];
            let brick = self.eights[eight as usize][(octant[0] * 2 + octant[1]) * 2 + octant[2]];
            inverse *= 2.0;
            for k in 0..3 {
                let twice = 2.0 * part[k];
                let half = usize::from(twice >= 1.0);
                inner[k] = 2 * (inner[k] & 1) + half;
                part[k] = twice - half as f32;
            }
            if brick.values != NONE {
                let from = brick.values as usize * VALUES;
                let base = from + (inner[0] * SIDE + inner[1]) * SIDE + inner[2];
                let (v, g) = evaluate(&self.values, base, [SIDE * SIDE, SIDE], part, inverse);
                found.0 += v;
                (0..3).for_each(|k| found.1[k] += g[k]);
            }
            eight = brick.children;
        }
    }

    /// Widens the bounds of a block's values, `[lowest, highest]`, by those of its bricks.
    pub fn widen(&self, block: usize, bounds: &mut [f32; 2]) {
        let Some(&eight) = self.roots.get(block) else {
            return;
        };
        self.widen_by(eight, bounds);
    }

    fn widen_by(&self, eight: u32, bounds: &mut [f32; 2]) {
        if eight == NONE {
            return;
        }
        let [mut low, mut high] = [0f32; 2];
        for brick in self.eights[eight as usize] {
            let mut own = [0f32; 2];
            if brick.values != NONE {
                let from = brick.values as usize * VALUES;
                for c in &self.values[from..from + VALUES] {
                    own = [own[0].min(*c), own[1].max(*c)];
                }
            }
            self.widen_by(brick.children, &mut own);
            (low, high) = (low.min(own[0]), high.max(own[1]));
        }
        *bounds = [bounds[0] + low, bounds[1] + high];
    }

    /// The children of a brick's parent, made if they are not there. `at`: the brick's place among those of its level.
    fn place(&mut self, level: u32, at: [u32; 3], blocks: [usize; 3]) -> (usize, usize) {
        let block = at.map(|c| (c >> level) as usize);
        let root = (block[0] * blocks[1] + block[1]) * blocks[2] + block[2];
        if self.roots.is_empty() {
            self.roots = vec![NONE; blocks.iter().product()];
        }
        if self.roots[root] == NONE {
            self.roots[root] = self.eights.len() as u32;
            self.eights.push([EMPTY; 8]);
        }
        let mut eight = self.roots[root] as usize;
        for down in (1..level).rev() {
            let which = octant(at, down);
            if self.eights[eight][which].children == NONE {
                self.eights[eight][which].children = self.eights.len() as u32;
                self.eights.push([EMPTY; 8]);
            }
            eight = self.eights[eight][which].children as usize;
        }
        (eight, octant(at, 0))
    }
}

/// Which of eight a brick is that lies `down` levels above the one at `at`.
fn octant(at: [u32; 3], down: u32) -> usize {
    at.iter().fold(0, |o, c| 2 * o + (c >> down & 1) as usize)
}

/// Bricks of one level, in the order of their places.
#[derive(Default)]
struct Bricks {
    places: Vec<[u32; 3]>,
    /// Number of each; never gone through, so that its order does not matter.
    numbers: HashMap<[u32; 3], u32>,
}

impl Bricks {
    fn new(mut places: Vec<[u32; 3]>) -> Self {
        places.par_sort_unstable();
        places.dedup();
        let numbers = (places.iter().copied()).zip(0..).collect();
        Self { places, numbers }
    }

    fn number(&self, at: &[u32; 3]) -> Option<usize> {
        self.numbers.get(at).map(|n| *n as usize)
    }

    fn contains(&self, at: &[u32; 3]) -> bool {
        self.numbers.contains_key(at)
    }
}

/// The brick and all around it, within `most` bricks along each axis.
fn around(at: [u32; 3], most: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..27u32).filter_map(move |k| {
        let by = [k / 9, k / 3 % 3, k % 3];
        let mut to = [0; 3];
        for d in 0..3 {
            to[d] = (at[d] + by[d]).checked_sub(1).filter(|c| *c < most[d])?;
        }
        Some(to)
    })
}

impl SignedDistanceGrid {
    /// Adds finer levels where the field differs from its tool by more than [`ENOUGH`] of what is wanted, until it does so nowhere or no level is
    /// left, and tells the largest error over all pieces.
    pub(super) fn refine(&mut self, survey: &Survey, wanted: &Wanted<'_>) -> FieldError {
        let mut spacing = 0.5 * self.spacing;
        let mut pieces = survey.pieces();
        // What pieces that were looked at for the last time have at most.
        let mut settled = FieldError::default();
        let mut bricks = 0;
        for level in 0..=LEVELS {
            let looked = self.look(survey, &pieces, spacing, wanted);
            let worst = looked
                .iter()
                .fold(FieldError::default(), |w, l| w.or(l.error));
            if level == 0 && worst.largest <= wanted.tolerance || level == LEVELS {
                return settled.or(worst);
            }
            let failing = looked.iter().flat_map(|l| &l.failing);
            let next = self.bricks_at(level + 1, failing);
            bricks += next.places.len();
            if next.places.is_empty() || bricks > MOST_BRICKS {
                return settled.or(worst);
            }
            // What lies near a new brick is looked at again, more closely.
            let near = |p: Vec3| next.contains(&self.brick_at(level + 1, p));
            let (again, error) = self.sort(survey, (&pieces, looked), spacing, wanted, near);
            (pieces, settled) = (again, settled.or(error));
            self.add_level(survey, level + 1, &next);
            // Fewer places than at first: what is left is looked at with the finest cells.
            spacing = self.spacing / f64::from(1 << (level + 1));
        }
        settled
    }

    /// Bricks of a level along each axis.
    fn most(&self, level: u32) -> [u32; 3] {
        self.blocks.map(|b| (b as u32) << level)
    }

    fn brick_at(&self, level: u32, at: Vec3) -> [u32; 3] {
        let size = self.spacing * BLOCK as f64 / f64::from(1 << level);
        let most = self.most(level);
        std::array::from_fn(|k| {
            (((at[k] - self.origin[k]) / size).max(0.0) as u32).min(most[k] - 1)
        })
    }

    /// Bricks of a level at places, and next to these by half a cell of the level above.
    fn bricks_at<'a>(&self, level: u32, places: impl Iterator<Item = &'a Vec3>) -> Bricks {
        let margin = self.spacing / f64::from(1 << level);
        let mut found = Vec::new();
        let mut last = None;
        for at in places {
            let [low, high] = [-margin, margin].map(|m| self.brick_at(level, at.map(|c| c + m)));
            // Neighbours come one after the other.
            if last.replace([low, high]) == Some([low, high]) {
                continue;
            }
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        found.push([x, y, z]);
                    }
                }
            }
        }
        Bricks::new(found)
    }

    /// What is found at one part of a piece: its largest error, none where nothing counts.
    fn at_part(
        &self,
        survey: &Survey,
        part: &Piece,
        wanted: &Wanted<'_>,
        near: &mut Near,
        mut visit: impl FnMut(FieldError),
    ) -> Option<FieldError> {
        let mut worst = None;
        survey.places(part, wanted.offset, near, |Place { at, distance }| {
            if (wanted.counts)(at) {
                let largest = (self.distance_and_gradient(at).0 - distance).abs();
                let error = FieldError { largest, at };
                worst = Some(worst.unwrap_or(FieldError::default()).or(error));
                visit(error);
            }
        });
        worst
    }

    /// Looks at the parts of pieces, [`TOGETHER`] pieces at a time.
    fn look(
        &self,
        survey: &Survey,
        pieces: &[Piece],
        spacing: f64,
        wanted: &Wanted<'_>,
    ) -> Vec<Looked> {
        let of = |pieces: &[Piece]| {
            let (mut looked, mut near) = (Looked::default(), survey.anywhere());
            for piece in pieces {
                piece.parts(spacing, &mut |part| {
                    let failing = &mut looked.failing;
                    let error = self.at_part(survey, &part, wanted, &mut near, |e| {
                        if e.largest > ENOUGH * wanted.tolerance {
                            failing.push(e.at);
                        }
                    });
                    looked.error = looked.error.or(error.unwrap_or_default());
                    looked.parts.push(error.map_or(f64::NAN, |e| e.largest));
                });
            }
            looked.parts.shrink_to_fit();
            looked
        };
        pieces.par_chunks(TOGETHER).map(of).collect()
    }

    /// Of what was looked at, the parts that lie `near` something new, and the largest error of the others. Parts are made again here: kept for
    /// all pieces they would be the largest thing that a run ever holds.
    fn sort(
        &self,
        survey: &Survey,
        (pieces, looked): (&[Piece], Vec<Looked>),
        spacing: f64,
        wanted: &Wanted<'_>,
        near: impl Fn(Vec3) -> bool + Sync,
    ) -> (Vec<Piece>, FieldError) {
        let of = |(pieces, looked): (&[Piece], Looked)| {
            let mut errors = looked.parts.into_iter();
            let (mut again, mut largest, mut worst) = (Vec::new(), 0.0, None);
            for piece in pieces {
                piece.parts(spacing, &mut |part| {
                    let error = errors.next().unwrap_or(f64::NAN);
                    if error.is_nan() {
                        return;
                    }
                    if part.middles(wanted.offset).into_iter().any(&near) {
                        again.push(part);
                    } else if error > largest {
                        (largest, worst) = (error, Some(part));
                    }
                });
            }
            let error = worst.and_then(|part| {
                self.at_part(survey, &part, wanted, &mut survey.anywhere(), |_| ())
            });
            (again, error.unwrap_or_default())
        };
        let all: Vec<(Vec<Piece>, FieldError)> =
            (pieces.par_chunks(TOGETHER)).zip(looked).map(of).collect();
        let mut again = Vec::with_capacity(all.iter().map(|a| a.0.len()).sum());
        let mut worst = FieldError::default();
        for (parts, error) in all {
            again.extend(parts);
            worst = worst.or(error);
        }
        (again, worst)
    }

    fn add_level(&mut self, survey: &Survey, level: u32, wanted: &Bricks) {
        let most = self.most(level);
        let with_neighbours = wanted.places.iter().flat_map(|b| around(*b, most));
        let all = Bricks::new(with_neighbours.collect());
        let of = |b: &[u32; 3]| self.left(survey, level, *b, wanted);
        let left: Vec<[f32; 64]> = all.places.par_iter().map(of).collect();
        let values = |b: &[u32; 3]| coefficients(*b, wanted, (&all, &left), most);
        let finer = Arc::make_mut(&mut self.finer);
        let blocks = self.blocks;
        finer.values.reserve_exact(VALUES * all.places.len());
        // Some at a time, so that they are not held twice.
        for places in all.places.chunks(MADE_TOGETHER) {
            let made: Vec<Vec<f32>> = places.par_iter().map(values).collect();
            for (b, made) in places.iter().zip(&made) {
                if made.iter().any(|c| *c != 0.0) {
                    let (eight, which) = finer.place(level, *b, blocks);
                    finer.eights[eight][which].values = (finer.values.len() / VALUES) as u32;
                    finer.values.extend_from_slice(made);
                }
            }
        }
        finer.values.shrink_to_fit();
    }

    /// What the field leaves of the exact distance at the first node of each cell of a brick; 0 where no wanted brick asks for it.
    fn left(&self, survey: &Survey, level: u32, brick: [u32; 3], wanted: &Bricks) -> [f32; 64] {
        let spacing = self.spacing / f64::from(1 << level);
        let near: Vec<[i64; 3]> = around(brick, self.most(level))
            .filter(|b| wanted.contains(b))
            .map(|b| std::array::from_fn(|k| 4 * (i64::from(b[k]) - i64::from(brick[k]))))
            .collect();
        let asked = |node: [i64; 3]| {
            let within = |b: &[i64; 3]| (0..3).all(|k| (-2..=6).contains(&(node[k] - b[k])));
            near.iter().any(within)
        };
        let (mut left, mut closest) = ([0f32; 64], survey.anywhere());
        for (n, left) in left.iter_mut().enumerate() {
            let node = [n / 16, n / 4 % 4, n % 4];
            if !asked(node.map(|c| c as i64)) {
                continue;
            }
            let at: Vec3 = std::array::from_fn(|k| {
                self.origin[k] + (4 * u64::from(brick[k]) + node[k] as u64) as f64 * spacing
            });
            // Outside of the box there is no field to correct.
            if self.cell(at).is_some() {
                *left =
                    (survey.distance(at, &mut closest) - self.distance_and_gradient(at).0) as f32;
            }
        }
        left
    }
}

/// Pieces that are looked at together.
const TOGETHER: usize = 64;

/// What was found at the parts of some pieces.
#[derive(Default)]
struct Looked {
    /// The largest error.
    error: FieldError,
    /// By part: its largest error (m); not a number where nothing counts.
    parts: Vec<f64>,
    /// Places that are off by too much.
    failing: Vec<Vec3>,
}

/// Coefficients of a brick: of those nodes that cells of wanted bricks need, the quasi-interpolation of what is left.
fn coefficients(
    brick: [u32; 3],
    wanted: &Bricks,
    (all, left): (&Bricks, &[[f32; 64]]),
    most: [u32; 3],
) -> Vec<f32> {
    // Nodes -2 to 6 of the brick, of which -1 to 5 get coefficients.
    const WIDE: usize = SIDE + 2;
    let mut at = vec![0f64; WIDE * WIDE * WIDE];
    let mut needed = [false; VALUES];
    for other in around(brick, most) {
        let by: [i64; 3] = std::array::from_fn(|k| 4 * (i64::from(other[k]) - i64::from(brick[k])));
        if let Some(number) = all.number(&other) {
            for (n, v) in left[number].iter().enumerate() {
                let node = [n / 16, n / 4 % 4, n % 4];
                let to: [i64; 3] = std::array::from_fn(|k| by[k] + node[k] as i64 + 2);
                if to.iter().all(|c| (0..WIDE as i64).contains(c)) {
                    let [x, y, z] = to.map(|c| c as usize);
                    at[(x * WIDE + y) * WIDE + z] = f64::from(*v);
                }
            }
        }
        if wanted.contains(&other) {
            for (n, needed) in needed.iter_mut().enumerate() {
                let node = [n / (SIDE * SIDE), n / SIDE % SIDE, n % SIDE];
                // In the other brick's own count the nodes that it needs are 0 to 6.
                *needed |= (0..3).all(|k| (0..SIDE as i64).contains(&(node[k] as i64 - by[k])));
            }
        }
    }
    for stride in [WIDE * WIDE, WIDE, 1] {
        let from = at.clone();
        for k in stride..at.len() - stride {
            at[k] = (8.0 * from[k] - (from[k - stride] + from[k + stride])) / 6.0;
        }
    }
    (0..VALUES)
        .map(|n| {
            let [x, y, z] = [n / (SIDE * SIDE), n / SIDE % SIDE, n % SIDE].map(|c| c + 1);
            let value = at[(x * WIDE + y) * WIDE + z] as f32;
            if needed[n] { value } else { 0.0 }
        })
        .collect()
}
