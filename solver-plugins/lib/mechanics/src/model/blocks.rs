//! Blocks: compact pieces of the sheets whose batches are gathered, computed and summed together.
//!
//! A block sums the forces of its elements at its own nodes, so that a node collects the sums of the one to four
//! blocks around it instead of every element's forces from all over memory. Blocks do not depend on the
//! number of threads, and neither does the order of any sum.

use super::batch::{
    BatchWorkspace, PatchWorkspace, Present, pressure_forces, run_batch, run_patch,
};
use super::transpose::{Sum, scatter};
use crate::LANES;
use crate::sheet::{Batch, PatchBatch};
use crate::team::least;
use crate::vec3::{Vec3, add};
use plyflow_abi::PF_OK;
use rayon::iter::Either;
use rayon::prelude::*;
use std::cell::RefCell;

/// Batches in a block: 16 x 16 elements.
pub(super) const BLOCK: usize = 8;

/// Nodes that are moved together.
pub(super) const NODE_CHUNK: usize = 256;

/// Blocks that a thread takes at most without leaving some to the others.
const TOGETHER: usize = 4;

/// Batches and the nodes that they share.
pub(super) struct Block<B> {
    /// At most [`BLOCK`].
    pub(super) batches: Vec<B>,
    /// Nodes of the model, in ascending order.
    pub(super) nodes: Vec<u32>,
    /// Status of the first batch that failed in the last step, and its sheet.
    pub(super) failed: Option<(i32, u32)>,
}

impl<B> Block<B> {
    /// A block without batches; `used` names its nodes, in any order and repeatedly.
    pub(super) fn new(used: impl Iterator<Item = u32>) -> Self {
        let mut nodes: Vec<u32> = used.collect();
        nodes.sort_unstable();
        nodes.dedup();
        Self {
            batches: Vec::new(),
            nodes,
            failed: None,
        }
    }

    /// Place of a node of the block.
    pub(super) fn place(&self, node: u32) -> u16 {
        let place = self.nodes.partition_point(|n| *n < node);
        debug_assert!(self.nodes.get(place) == Some(&node) && place <= usize::from(u16::MAX));
        place as u16
    }
}

/// Sums of all blocks at their nodes, and where those of a node are.
#[derive(Default)]
pub(super) struct Sums {
    /// Places that every block has in the arrays.
    pub(super) stride: usize,
    /// `[n]` first place of a node; one past the blocks' places, which is always zero, where it has none.
    first: Vec<u32>,
    /// The other places: node and place, by node.
    more: Vec<(u32, u32)>,
    /// Where the nodes of every [`NODE_CHUNK`] start in `more`.
    more_start: Vec<u32>,
    /// `[blocks * stride + 1]` forces of the elements on the nodes (N).
    pub(super) force: Vec<Sum>,
    /// The same: moments of the elements (N m); empty when no node rotates.
    pub(super) moment: Vec<Sum>,
    /// Pressure (N); empty when nothing presses.
    pub(super) pressure: Vec<Sum>,
    /// Sums of a quarter of the cells' area vectors (m2), every [`super::NORMAL_INTERVAL`] steps.
    pub(super) area: Vec<Sum>,
}

impl Sums {
    /// For `n` nodes of a model.
    pub(super) fn new<B>(n: usize, blocks: &[Block<B>]) -> Self {
        let stride = blocks.iter().map(|b| b.nodes.len()).max().unwrap_or(0);
        let none = (blocks.len() * stride) as u32;
        let mut first = vec![none; n];
        let mut more = Vec::new();
        for (b, block) in blocks.iter().enumerate() {
            for (place, node) in block.nodes.iter().enumerate() {
                let at = (b * stride + place) as u32;
                match &mut first[*node as usize] {
                    f if *f == none => *f = at,
                    _ => more.push((*node, at)),
                }
            }
        }
        more.sort_unstable();
        let chunks = n.div_ceil(NODE_CHUNK);
        let start = |c: usize| more.partition_point(|(n, _)| (*n as usize) < c * NODE_CHUNK);
        Self {
            stride,
            first,
            more_start: (0..=chunks).map(|c| start(c) as u32).collect(),
            more,
            force: vec![Sum::default(); none as usize + 1],
            ..Self::default()
        }
    }

    /// Where the sums of a node are.
    pub(super) fn places(&self, node: u32) -> impl Iterator<Item = u32> {
        let first = self.first[node as usize];
        let none = self.force.len() as u32 - 1;
        let start = self.more.partition_point(|(n, _)| *n < node);
        let more = self.more[start..].iter().take_while(move |m| m.0 == node);
        (first != none)
            .then_some(first)
            .into_iter()
            .chain(more.map(|m| m.1))
    }

    /// An array of zeros for more sums.
    pub(super) fn zeros(&self) -> Vec<Sum> {
        vec![Sum::default(); self.force.len()]
    }

    /// Sum of `of` (one of the arrays) at a node, in the order of [`Sums::collect`].
    pub(super) fn at(&self, of: &[Sum], node: usize) -> Vec3 {
        let chunk = node / NODE_CHUNK;
        let (start, end) = (self.more_start[chunk], self.more_start[chunk + 1]);
        let more = &self.more[start as usize..end as usize];
        let others = more.iter().filter(|(n, _)| *n as usize == node);
        let places = others.map(|(_, place)| *place);
        std::iter::once(self.first[node])
            .chain(places)
            .fold([0.0; 3], |sum, place| {
                let [x, y, z, _] = of[place as usize].0;
                add(sum, [x, y, z])
            })
    }

    /// Adds the sums `of` (one of the arrays) at the nodes of a chunk to `to`.
    #[inline(always)]
    pub(super) fn collect(&self, of: &[Sum], chunk: usize, to: &mut [Vec3]) {
        let base = chunk * NODE_CHUNK;
        for (t, place) in to.iter_mut().zip(&self.first[base..]) {
            let part = &of[*place as usize].0;
            for c in 0..3 {
                t[c] += part[c];
            }
        }
        let (start, end) = (self.more_start[chunk], self.more_start[chunk + 1]);
        for (node, place) in &self.more[start as usize..end as usize] {
            let t = &mut to[*node as usize - base];
            let [x, y, z, _] = of[*place as usize].0;
            *t = add(*t, [x, y, z]);
        }
    }
}

/// A block's part of the arrays of [`Sums`].
pub(super) struct Part<'a> {
    force: &'a mut [Sum],
    moment: &'a mut [Sum],
    pressure: &'a mut [Sum],
    area: &'a mut [Sum],
}

/// The first `n` chunks of an array, the last of which may be shorter; empty ones of an array that is empty because it is not wanted.
pub(super) fn chunks_or_none<T: Send>(
    array: &mut [T],
    size: usize,
    n: usize,
) -> impl IndexedParallelIterator<Item = &mut [T]> {
    if array.is_empty() {
        Either::Right((0..n).into_par_iter().map(|_| Default::default()))
    } else {
        let end = array.len().min(n * size);
        Either::Left(array[..end].par_chunks_mut(size))
    }
}

/// Computes all batches and sums them by block.
pub(super) fn run_blocks(blocks: &mut [Block<Batch>], sums: &mut Sums, present: Present<'_>) {
    let (stride, places) = (sums.stride, blocks.len() * sums.stride);
    if blocks.is_empty() {
        return;
    }
    let n = blocks.len();
    let areas = if present.areas {
        &mut sums.area[..]
    } else {
        &mut []
    };
    let others = chunks_or_none(&mut sums.moment, stride, n)
        .zip_eq(chunks_or_none(&mut sums.pressure, stride, n))
        .zip_eq(chunks_or_none(areas, stride, n));
    blocks
        .par_iter_mut()
        .zip_eq(sums.force[..places].par_chunks_exact_mut(stride))
        .zip_eq(others)
        .with_max_len(TOGETHER)
        .with_min_len(least())
        .for_each(|((block, force), ((moment, pressure), area))| {
            let part = Part {
                force,
                moment,
                pressure,
                area,
            };
            WORK.with_borrow_mut(|work| run_block(block, part, present, work));
        });
}

thread_local! {
    /// What a thread computes blocks in, kept from step to step: neither asked for nor cleared anew.
    static WORK: RefCell<Box<BatchWorkspace>> = RefCell::default();
    /// The same for blocks of patches.
    static PATCH_WORK: RefCell<Box<PatchWorkspace>> = RefCell::default();
}

fn run_block(
    block: &mut Block<Batch>,
    part: Part<'_>,
    present: Present<'_>,
    work: &mut BatchWorkspace,
) {
    part.force.fill(Sum::default());
    part.moment.fill(Sum::default());
    part.pressure.fill(Sum::default());
    part.area.fill(Sum::default());
    block.failed = None;
    for batch in &mut block.batches {
        run_batch(batch, present, work);
        if batch.status != PF_OK {
            block.failed = block.failed.or(Some((batch.status, batch.sheet)));
            continue;
        }
        let (places, count) = (&batch.places, batch.count as usize);
        scatter_all(places, count, &work.force.0, true, part.force);
        let sheet = &present.sheets[batch.sheet as usize];
        if sheet.element_of(batch).rotates() {
            scatter_all(places, count, &work.moment.0, true, part.moment);
        }
        if !batch.pressed.is_empty() {
            let pressure = std::array::from_fn(|l| {
                batch.pressed[l][0] * present.pressures.below
                    - batch.pressed[l][1] * present.pressures.above
            });
            pressure_forces(&work.area.0, &pressure, &mut work.load.0);
            scatter_all(places, count, &work.load.0, false, part.pressure);
        }
        if present.areas {
            let rows = &work.area.0[..3 * LANES];
            for places in places {
                scatter(places, count, rows, false, part.area);
            }
        }
    }
}

/// The same for patches.
pub(super) fn run_patch_blocks(
    blocks: &mut [Block<PatchBatch>],
    sums: &mut Sums,
    present: Present<'_>,
) {
    let (stride, places) = (sums.stride, blocks.len() * sums.stride);
    if blocks.is_empty() {
        return;
    }
    blocks
        .par_iter_mut()
        .zip_eq(sums.force[..places].par_chunks_exact_mut(stride))
        .with_max_len(TOGETHER)
        .with_min_len(least())
        .for_each(|(block, force)| {
            PATCH_WORK.with_borrow_mut(|work| run_patch_block(block, force, present, work));
        });
}

fn run_patch_block(
    block: &mut Block<PatchBatch>,
    force: &mut [Sum],
    present: Present<'_>,
    work: &mut PatchWorkspace,
) {
    force.fill(Sum::default());
    block.failed = None;
    for batch in &mut block.batches {
        run_patch(batch, present, work);
        if batch.status != PF_OK {
            block.failed = block.failed.or(Some((batch.status, batch.sheet)));
            continue;
        }
        // Unused nodes of a patch repeat its centre and have no force.
        let count = batch.count as usize;
        scatter_all(&batch.places, count, &work.force.0, true, force);
    }
}

/// Adds or takes off the rows `[node][3][LANES]` at the places of the first `count` lanes.
#[inline(always)]
fn scatter_all(places: &[[u16; LANES]], count: usize, rows: &[f64], minus: bool, to: &mut [Sum]) {
    for (places, rows) in places.iter().zip(rows.chunks_exact(3 * LANES)) {
        scatter(places, count, rows, minus, to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_of_blocks_come_together_at_their_nodes() {
        let blocks = [[7, 3, 9, 3, 7], [9, 1, 7, 0, 300]].map(|n| Block::<()>::new(n.into_iter()));
        assert_eq!(blocks[0].nodes, [3, 7, 9]);
        assert_eq!([3, 7, 9].map(|n| blocks[0].place(n)), [0, 1, 2]);
        let mut sums = Sums::new(301, &blocks);
        assert_eq!(sums.stride, 5);
        for (i, f) in sums.force[..10].iter_mut().enumerate() {
            *f = Sum([10f64.powi(i as i32), 0.0, 1.0, 0.0]);
        }
        let mut to = vec![[0.0; 3]; 301];
        for (chunk, to) in to.chunks_mut(NODE_CHUNK).enumerate() {
            sums.collect(&sums.force, chunk, to);
        }
        let of = |n: usize| to[n][0];
        assert_eq!([0, 1, 2, 3].map(of), [1e5, 1e6, 0.0, 1.0]);
        assert_eq!([7, 9, 300].map(of), [10.0 + 1e7, 100.0 + 1e8, 1e9]);
        assert_eq!(to.iter().map(|t| t[2]).sum::<f64>(), 8.0);
    }
}
