//! Nodes of one sheet (slaves) on the surface of another (master).
//!
//! The gap is the distance to the closest point of the master surface (its cells are bilinear), less the
//! offset. The normal force is the exact gradient of k gap^2 / 2: it acts along the line between the two points
//! and on the master's nodes by their shape functions, so it conserves energy, momentum and angular momentum.
//! A force along an interpolated normal is smoother to look at but is no gradient: two flat sheets under
//! 1 bar then flutter, and gain energy without bound (tried; `docs/decisions/0003`).

use super::blend::{pulled, shares};
use super::friction::{Constant, Coulomb, FrictionLaw};
use super::slave::{
    Law, Pull, SEARCH_INTERVAL, SlaveItem, held_gap, hold, relative_speed, scatter, touch,
};
use super::{ContactEnergy, ContactSettings, Pace, TOGETHER, waking};
use crate::archive::{Archive, ArchiveError};
use crate::mesh::NONE;
use crate::mirror::{Image, mirrored_in, reflect};
use crate::vec3::{V, cross, dot, scale, sub, unit};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Slaves of one sheet on one master sheet.
pub struct SheetContact {
    /// Name of the pair, for reports.
    pub name: String,
    /// +1: slaves lie on the side of the master's normal (above); -1: below.
    pub side: f64,
    /// Distance of the two mid-surfaces in touch (m).
    pub offset: f64,
    /// Coulomb coefficient.
    pub friction: FrictionLaw,
    /// Elastic-slip stiffness over normal stiffness.
    pub slip_factor: f64,
    /// Share of the penalty force that a step adds to the multiplier.
    pub augmentation: f64,
    /// Whether slaves are pushed out from wherever they are: also from so deep inside of the master that motion cannot have brought
    /// them there. That makes energy, and is for models that are put together by hand and damped.
    pub clearing: bool,
    /// The slaves.
    pub items: Vec<SlaveItem>,
    /// By slave: call of [`SheetContact::compute`] before which it cannot touch. Apart from the items, so that to pass over one
    /// that sleeps touches four bytes and not some cache lines.
    wakes: Vec<u32>,
    spans: Vec<Span>,
    cycle: u64,
}

/// Bilinear shape functions at `xi`.
#[inline(always)]
pub fn shape(xi: [f64; 2]) -> [f64; 4] {
    let (a, b) = (0.25 * (1.0 - xi[0]), 0.25 * (1.0 + xi[0]));
    let (c, d) = (1.0 - xi[1], 1.0 + xi[1]);
    [a * c, b * c, b * d, a * d]
}

#[inline(always)]
pub(super) fn combine(w: [f64; 4], p: &[V; 4]) -> V {
    let mut s = [0.0; 3];
    for (w, p) in w.iter().zip(p) {
        for c in 0..3 {
            s[c] += w * p[c];
        }
    }
    s
}

/// Surface of all sheets as the contact sees it.
#[derive(Clone, Copy)]
pub struct Surface<'a> {
    /// `[cells][4]` model nodes.
    pub cells: &'a [[u32; 4]],
    /// `[cells][4]` cell across each edge, [`NONE`], or one of [`crate::mirror::MIRRORED`].
    pub neighbours: &'a [[u32; 4]],
    /// `[nodes]` positions (m).
    pub x: &'a [V],
    /// `[nodes]` unit normals.
    pub normals: &'a [V],
}

/// Closest point of a cell to a slave.
#[derive(Clone, Copy)]
pub(super) struct Closest {
    pub(super) cell: u32,
    pub(super) xi: [f64; 2],
    pub(super) weights: [f64; 4],
    /// From the closest point to the slave (m).
    pub(super) arm: V,
    pub(super) distance2: f64,
    /// Half the cell's shorter middle line (m).
    pub(super) half: f64,
    /// By coordinate, whether the place is not held at a side of the cell: in both, the way to it is a perpendicular.
    pub(super) free: [bool; 2],
    /// Whether it lies on the cell's mirror image.
    pub(super) image: Image,
}

/// Cells around a corner besides the one that is closest.
pub(super) const FACES: usize = 3;

/// The closest point of the surface, and in a concave fold or corner those of the cells across it.
pub(super) struct Found {
    pub(super) first: Closest,
    /// Of the cells across the sides along xi and along eta that the slave is near, and of the one between these two across
    /// the corner, as far as the foot on them is a perpendicular's.
    pub(super) others: [Option<Closest>; FACES],
}

/// How far a cell goes on past a free rim, in half cells: a node that sits on the rim would else balance on an
/// edge, slide off and get under the sheet.
pub(super) const RIM: f64 = 0.5;

/// Closest point of one cell to `p` by Newton steps from `xi`, kept inside the cell.
#[inline(always)]
pub(super) fn closest(
    s: &Surface<'_>,
    cell: u32,
    mut xi: [f64; 2],
    p: V,
    iterations: u32,
) -> Closest {
    let x = s.cells[cell as usize].map(|n| s.x[n as usize]);
    let (mut half, mut free) = (0.0, [true; 2]);
    let [south, east, north, west] = s.neighbours[cell as usize];
    let end = |near: u32| if near == NONE { 1.0 + RIM } else { 1.0 };
    let (low, high) = ([-end(west), -end(south)], [end(east), end(north)]);
    for _ in 0..iterations {
        let (a, b) = (0.25 * (1.0 - xi[1]), 0.25 * (1.0 + xi[1]));
        let (c, d) = (0.25 * (1.0 - xi[0]), 0.25 * (1.0 + xi[0]));
        let t1 = combine([-a, a, b, -b], &x);
        let t2 = combine([-c, -d, d, c], &x);
        let r = sub(p, combine(shape(xi), &x));
        let (g11, g22, g12) = (dot(t1, t1), dot(t2, t2), dot(t1, t2));
        let (r1, r2) = (dot(r, t1), dot(r, t2));
        let det = (g11 * g22 - g12 * g12).max(1e-12 * g11 * g22);
        let next = [
            xi[0] + (r1 * g22 - r2 * g12) / det,
            xi[1] + (r2 * g11 - r1 * g12) / det,
        ];
        let held = [
            next[0].clamp(low[0], high[0]),
            next[1].clamp(low[1], high[1]),
        ];
        // Held at one side of the cell, the best place along that side is another one.
        let along = |k: usize, other: f64| {
            let (gkk, rk) = if k == 0 { (g11, r1) } else { (g22, r2) };
            (xi[k] + (rk - g12 * other) / gkk).clamp(low[k], high[k])
        };
        let out = [next[0] != held[0], next[1] != held[1]];
        free = out.map(|o| !o);
        xi = match out {
            [false, false] => held,
            [true, false] => [held[0], along(1, held[0] - xi[0])],
            [false, true] => [along(0, held[1] - xi[1]), held[1]],
            [true, true] => {
                // In a corner's range: take the side that is overshot more, slide along it.
                if (next[0] - held[0]).abs() > (next[1] - held[1]).abs() {
                    [held[0], along(1, held[0] - xi[0])]
                } else {
                    [along(0, held[1] - xi[1]), held[1]]
                }
            }
        };
        half = g11.min(g22).sqrt();
    }
    let weights = shape(xi);
    let arm = sub(p, combine(weights, &x));
    Closest {
        cell,
        xi,
        weights,
        arm,
        distance2: dot(arm, arm),
        half,
        free,
        image: [false; 2],
    }
}

/// Unit normal of a cell at a place in it.
pub(super) fn cell_normal(s: &Surface<'_>, cell: u32, xi: [f64; 2]) -> V {
    let x = s.cells[cell as usize].map(|n| s.x[n as usize]);
    let (a, b) = (1.0 - xi[1], 1.0 + xi[1]);
    let (c, d) = (1.0 - xi[0], 1.0 + xi[0]);
    unit(cross(
        combine([-a, a, b, -b], &x),
        combine([-c, -d, d, c], &x),
    ))
}

/// The edge over which a walk enters the cell `to`.
fn entry(neighbours: &[[u32; 4]], from: u32, to: u32) -> usize {
    let edge = neighbours[to as usize].iter().position(|n| *n == from);
    edge.unwrap_or(3)
}

/// The middle of an edge.
fn middle(edge: usize) -> [f64; 2] {
    match edge {
        0 => [0.0, -1.0],
        1 => [1.0, 0.0],
        2 => [0.0, 1.0],
        _ => [-1.0, 0.0],
    }
}

/// Closest point to `p` of the mirror image of a cell: the image of the closest point to the image of `p`.
#[inline(never)]
fn across(s: &Surface<'_>, cell: u32, start: [f64; 2], p: V, image: Image) -> Closest {
    let other = closest(s, cell, start, reflect(p, image), 3);
    Closest {
        arm: reflect(other.arm, image),
        image,
        ..other
    }
}

/// Closest point of the cell across a corner: the neighbour of both cells (or images) `a` and `b` next to `first`.
#[inline(never)]
fn around(
    s: &Surface<'_>,
    first: &Closest,
    [a, b]: [&Closest; 2],
    p: V,
    open: impl Fn(u32) -> bool,
) -> Option<Closest> {
    let real = |c: &Closest| c.image == [false; 2];
    let image = [a.image[0] != b.image[0], a.image[1] != b.image[1]];
    let found = match (real(a), real(b)) {
        (true, true) => {
            let near = s.neighbours[b.cell as usize];
            let of_both = |c: &u32| {
                let none = *c == NONE || *c == first.cell || mirrored_in(*c).is_some();
                !none && near.contains(c)
            };
            let cell = s.neighbours[a.cell as usize].into_iter().find(of_both)?;
            if !open(cell) {
                return None;
            }
            let start = middle(entry(s.neighbours, a.cell, cell));
            closest(s, cell, start, p, 3)
        }
        // Images of the cell next to the one that lies at the plane, or of that itself across both.
        (false, true) => across(s, b.cell, b.xi, p, image),
        (true, false) => across(s, a.cell, a.xi, p, image),
        (false, false) => across(s, first.cell, first.xi, p, image),
    };
    Some(found).filter(|c| c.free == [true; 2])
}

/// The closest point of the surface near where the slave was: of its cell, and of the cells across those
/// sides that the point lies on, and (every eighth step) of those so near that a concave fold could make the
/// neighbour closer. The walk enters only cells that are `open` to it.
#[inline(always)]
pub(super) fn track(
    s: &Surface<'_>,
    item: &SlaveItem,
    p: V,
    offset: f64,
    iterations: u32,
    open: impl Fn(u32) -> bool,
) -> Found {
    let mut best = closest(s, item.cell, item.xi, p, iterations);
    let mut others = [None; FACES];
    let every = |n: u8| item.is_between() || item.turn.is_multiple_of(n) || !item.active;
    let careful = every(8);
    // A neighbour that is folded back over the slave (by more than a right angle) is as near as the slave's own
    // cell from further off its side. Found too late, it would stand deep inside from one step to the next.
    let reach = if every(16) { 4.0 } else { 1.0 };
    for _ in 0..12 {
        let near = s.neighbours[best.cell as usize];
        let band = 1.0 - (reach * best.distance2.sqrt() / best.half).min(0.5);
        let here = best;
        others = [None; FACES];
        for k in 0..2 {
            let place = here.xi[k];
            if place.abs() < band || (place.abs() < 1.0 && !careful) {
                continue;
            }
            // Sides 0: eta = -1, 1: xi = 1, 2: eta = 1, 3: xi = -1.
            let edge = match (k, place > 0.0) {
                (0, true) => 1,
                (0, false) => 3,
                (_, true) => 2,
                (_, false) => 0,
            };
            if let Some(plane) = mirrored_in(near[edge]) {
                // Across the plane the surface goes on as its own image, which is never closer.
                let image = [plane == 0, plane == 1];
                let other = across(s, here.cell, middle(edge), p, image);
                others[k] = Some(other).filter(|c| c.free[k]);
            } else if near[edge] != NONE && open(near[edge]) {
                let start = entry(s.neighbours, here.cell, near[edge]);
                let mut other = closest(s, near[edge], middle(start), p, 3);
                if other.distance2 < best.distance2 {
                    std::mem::swap(&mut best, &mut other);
                }
                // Edges 0 and 2 are held in eta, 1 and 3 in xi.
                others[k] = Some(other).filter(|c| c.free[1 - start % 2]);
            }
        }
        if best.cell == here.cell {
            break;
        }
    }
    // Only where the ways to both cells are perpendicular across their common side does the surface fold towards the slave;
    // along it they may end on a ridge, as on a saddle.
    for k in 0..2 {
        others[k] = others[k].filter(|c| best.free[k] && shares(&best, c, offset));
    }
    if let [Some(a), Some(b), _] = &others {
        others[2] = around(s, &best, [a, b], p, open);
    }
    Found {
        first: best,
        others,
    }
}

impl SheetContact {
    /// A master sheet and its slaves; the settings' `stiffness_factor` and `damping_ratio` are not used here.
    pub fn new(
        name: String,
        side: f64,
        offset: f64,
        friction: impl Into<FrictionLaw>,
        settings: &ContactSettings,
        items: Vec<SlaveItem>,
    ) -> Self {
        Self {
            name,
            side,
            offset,
            friction: friction.into(),
            slip_factor: settings.slip_factor,
            augmentation: settings.augmentation,
            clearing: false,
            items,
            wakes: Vec::new(),
            spans: Vec::new(),
            cycle: 0,
        }
    }

    /// Computes the force of every slave from positions and velocities (m/s).
    pub fn compute(&mut self, s: &Surface<'_>, v: &[V], pace: Pace) -> ContactEnergy {
        self.compute_by_law(s, v, pace, None)
    }

    /// The same by one thread, which adds the forces to `f` (N) in the order of [`SheetContact::scatter`] while the slaves are in
    /// its cache.
    pub(crate) fn compute_onto(
        &mut self,
        s: &Surface<'_>,
        v: &[V],
        pace: Pace,
        f: &mut [V],
    ) -> ContactEnergy {
        self.compute_by_law(s, v, pace, Some(f))
    }

    fn compute_by_law(
        &mut self,
        s: &Surface<'_>,
        v: &[V],
        pace: Pace,
        onto: Option<&mut [V]>,
    ) -> ContactEnergy {
        match self.friction.clone() {
            FrictionLaw::Constant(mu) => self.compute_with(&Constant(mu), s, v, pace, onto),
            FrictionLaw::Varying(law) => self.compute_with(&*law, s, v, pace, onto),
        }
    }

    fn compute_with<F: Coulomb>(
        &mut self,
        friction: &F,
        s: &Surface<'_>,
        v: &[V],
        pace: Pace,
        onto: Option<&mut [V]>,
    ) -> ContactEnergy {
        let side = self.side;
        let law = Law {
            dt: pace.dt,
            friction,
            offset: self.offset,
            slip_factor: self.slip_factor,
            augmentation: self.augmentation,
            clearing: self.clearing,
        };
        let following = Following {
            surface: *s,
            v,
            side,
            pace,
            cycle: self.cycle,
            law,
        };
        self.cycle += 1;
        self.wakes.resize(self.items.len(), 0);
        self.spans
            .resize_with(self.items.len().div_ceil(SPAN), Span::default);
        if let Some(f) = onto {
            let items = self.items.chunks_mut(SPAN);
            let wakes = self.wakes.chunks_mut(SPAN);
            for ((items, wakes), span) in items.zip(wakes).zip(&mut self.spans) {
                following.span(items, wakes, span);
                if span.touches {
                    scatter(items.iter(), s.cells, f);
                }
            }
        } else {
            self.items
                .par_chunks_mut(SPAN)
                .zip_eq(self.wakes.par_chunks_mut(SPAN))
                .zip_eq(self.spans.par_iter_mut())
                .with_max_len(TOGETHER)
                .for_each(|((items, wakes), span)| following.span(items, wakes, span));
        }
        let mut total = ContactEnergy::default();
        for span in self.spans.iter().filter(|s| s.touches) {
            total.add(&span.energy);
        }
        total
    }

    /// Adds the forces to `f` (N), slaves and masters, in the order of the items.
    pub fn scatter(&self, cells: &[[u32; 4]], f: &mut [V]) {
        for (items, span) in self.items.chunks(SPAN).zip(&self.spans) {
            if span.touches {
                scatter(items.iter(), cells, f);
            }
        }
    }

    /// What changes: slaves and their sleep.
    pub(crate) fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        a.value(&mut self.cycle)?;
        a.value(&mut self.wakes)?;
        a.value(&mut self.spans)?;
        a.values(&mut self.items)
    }
}

/// Slaves whose energies are summed, and that are passed over while all of them sleep: so many as stay in the nearest cache until their
/// forces are on the nodes.
const SPAN: usize = 64;

/// A run of [`SPAN`] slaves.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
struct Span {
    /// Call of [`SheetContact::compute`] in which the first of them wakes.
    wake: u32,
    /// Whether any touched in the last call.
    touches: bool,
    energy: ContactEnergy,
}

/// What following the slaves of a contact needs.
struct Following<'a, F> {
    surface: Surface<'a>,
    v: &'a [V],
    side: f64,
    pace: Pace,
    cycle: u64,
    law: Law<'a, F>,
}

impl<F: Coulomb> Following<'_, F> {
    /// Forces of those slaves of a span that are awake, with the machine's wider vectors; no fused operations, so the bits are
    /// the same on all.
    fn span(&self, items: &mut [SlaveItem], wakes: &mut [u32], span: &mut Span) {
        if self.cycle < u64::from(span.wake) {
            return;
        }
        #[cfg(target_arch = "x86_64")]
        {
            #[target_feature(enable = "avx2")]
            fn wide<F: Coulomb>(
                following: &Following<'_, F>,
                items: &mut [SlaveItem],
                wakes: &mut [u32],
                span: &mut Span,
            ) {
                following.each(items, wakes, span);
            }
            if std::arch::is_x86_feature_detected!("avx2") {
                // Checked the line above.
                return unsafe { wide(self, items, wakes, span) };
            }
        }
        self.each(items, wakes, span);
    }

    #[inline(always)]
    fn each(&self, items: &mut [SlaveItem], wakes: &mut [u32], span: &mut Span) {
        *span = Span {
            wake: u32::MAX,
            ..Span::default()
        };
        for (item, wake) in items.iter_mut().zip(wakes) {
            if self.cycle >= u64::from(*wake) {
                match follow(
                    item,
                    &self.surface,
                    self.v,
                    self.side,
                    &self.pace,
                    &self.law,
                ) {
                    Met::Touch(energy) => {
                        span.energy.add(&energy);
                        span.touches = true;
                    }
                    Met::Apart(steps) => *wake = waking(self.cycle, 1 + steps),
                    Met::Never => *wake = u32::MAX,
                }
            }
            span.wake = span.wake.min(*wake);
        }
    }
}

/// How a slave has been found.
enum Met {
    Touch(ContactEnergy),
    /// So many steps may pass before it can touch.
    Apart(u64),
    /// It has no cell to touch.
    Never,
}

/// Follows a slave to the closest point of the surface and computes its force.
#[inline(always)]
fn follow<F: Coulomb>(
    item: &mut SlaveItem,
    s: &Surface<'_>,
    v: &[V],
    side: f64,
    pace: &Pace,
    law: &Law<'_, F>,
) -> Met {
    if item.cell == NONE {
        return Met::Never;
    }
    item.turn = item.turn.wrapping_add(1);
    if item.plain && !item.turn.is_multiple_of(SEARCH_INTERVAL) {
        if item.active {
            return Met::Touch(hold(item, s, v, law));
        }
        let gap = held_gap(item, s, law.offset);
        if gap > 0.0 {
            return apart(item, gap, s, v, pace, true);
        }
    }
    // In touch, the place moves by far less than a cell in a step: one iteration follows it.
    let iterations = if item.active { 1 } else { 3 };
    let found = track(
        s,
        item,
        s.x[item.node as usize],
        law.offset,
        iterations,
        |_| true,
    );
    (item.cell, item.xi) = (found.first.cell, found.first.xi);
    let Some((pull, plain)) = pull_of(item, s, &found, side, law.offset, law.clearing) else {
        item.part();
        return Met::Apart(0);
    };
    item.direction = pull.first;
    // No slave gets deep inside at once.
    let deep = !item.active && pull.gap < -0.5 * law.offset && !law.clearing;
    // One that comes from beside has got behind the rim.
    let behind = deep && at_rim(&found.first);
    if behind || (pull.gap > 0.0 && item.multiplier == 0.0) {
        return apart(item, pull.gap.max(0.0), s, v, pace, plain);
    }
    // Any other was lost in a fold, and is found where it has no way to be pushed from: that would make energy from nothing, now or
    // when it is less deep.
    item.guarded |= deep;
    item.plain = plain;
    Met::Touch(touch(item, s, v, &pull, &found, law))
}

/// A slave that does not touch. One that is so near that it looks again at once keeps its place, as one in touch does.
#[inline(always)]
fn apart(
    item: &mut SlaveItem,
    gap: f64,
    s: &Surface<'_>,
    v: &[V],
    pace: &Pace,
    plain: bool,
) -> Met {
    let steps = pace.steps(gap, relative_speed(item, s, v), 50.0);
    item.part();
    item.plain = plain && steps == 0;
    Met::Apart(steps)
}

/// Whether a closest point lies on a free rim.
fn at_rim(c: &Closest) -> bool {
    c.xi.iter().any(|x| x.abs() > 1.0 + 0.999 * RIM)
}

/// Gap and direction of a slave whose closest point is found, and whether it may keep both for some steps; `None`: it lies
/// beyond a fold.
#[inline(always)]
fn pull_of(
    item: &SlaveItem,
    s: &Surface<'_>,
    found: &Found,
    side: f64,
    offset: f64,
    clearing: bool,
) -> Option<(Pull, bool)> {
    let first = &found.first;
    let nodes = s.cells[first.cell as usize];
    let up = combine(first.weights, &nodes.map(|n| s.normals[n as usize]));
    let distance = first.distance2.sqrt();
    let height = side * dot(first.arm, up);
    // At a free rim the sheet is round: there the gap is the distance, wherever the slave lies. On its
    // own side, it is so too; a slave whose mid-surface has just passed through the master's has a
    // negative one. Anything else lies beyond a fold.
    let at_rim = at_rim(first);
    if height > 0.5 * distance || (at_rim && distance > 0.2 * offset) {
        let (pull, alone) = pulled(found, offset);
        return Some((pull, alone && !at_rim));
    }
    let through = (item.active || clearing) && height < -0.5 * distance && height > -offset;
    let pull = || Pull::plain(height - offset, scale(up, side));
    through.then(|| (pull(), false))
}
