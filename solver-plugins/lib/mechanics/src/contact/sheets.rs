//! Nodes of one sheet (slaves) on the surface of another (master).
//!
//! The gap is the distance to the closest point of the master surface (its cells are bilinear), less the
//! offset. The normal force is the exact gradient of k gap^2 / 2: it acts along the line between the two points
//! and on the master's nodes by their shape functions, so it conserves energy, momentum and angular momentum.
//! A force along an interpolated normal is smoother to look at but is no gradient: two flat sheets under
//! 1 bar then flutter, and gain energy without bound (tried; `docs/decisions/0003`).

use super::blend::{Pull, pulled};
use super::closest::{Closest, Found, Surface, cell_normal, combine, middle};
use super::friction::{Constant, Coulomb};
use super::ledge::{BEVEL, Ledge, at_rim, ends_at, past_rim};
use super::penalty::{
    ContactEnergy, ContactSettings, Follow, Pace, SWIFT, TOGETHER, content, waking,
};
use super::regions::FrictionLaw;
use super::search::track;
use super::slave::{
    Law, SEARCH_INTERVAL, SlaveItem, held_gap, hold, relative_speed, scatter, touch,
};
use super::ties::Ties;
use crate::archive::{Archive, ArchiveError};
use crate::mesh::NONE;
use crate::vec3::{Vec3, add, dot, norm, scale, sub, unit};
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
    /// Penetration (m) from which on multipliers grow faster; infinite: never.
    pub deep: f64,
    /// Of a contact that catches what the other sheet's nodes let through: the share of the distance at which sheets touch by which its slaves may
    /// come nearer before they do, besides what straight cells cut off curved sheets. What is let in does not change while a slave touches: that
    /// would make energy. `None`: slaves touch at that distance.
    pub let_in: Option<f64>,
    /// By how much (m) the distance at which slaves touch is less where what the master's cells go on by past its rims ends.
    pub ledge: f64,
    /// Whether slaves are pushed out from wherever they are: also from so deep inside of the master that motion cannot have brought
    /// them there. That makes energy, and is for models that are put together by hand and damped.
    pub clearing: bool,
    /// Its stiffness over what the masses would allow.
    pub share: f64,
    /// What of its stiffness counts when nodes' shares of the stability limit are given out ([`crate::model::Model::set_contact_stiffness`]): 1, or less
    /// if it touches where others do not.
    pub counted: f64,
    /// Cells (model numbering) along the rim of a master whose rim is not convex: a slave beside such a rim may come nearer to another stretch
    /// of it than the one that it follows. Empty of any other master.
    pub rim: Vec<u32>,
    /// The slaves.
    pub items: Vec<SlaveItem>,
    /// Those of its nodes that are tied to the master besides.
    pub ties: Ties,
    /// By slave: call of [`SheetContact::compute`] before which it cannot touch. Apart from the items, so that to pass over one
    /// that sleeps touches four bytes and not some cache lines.
    wakes: Vec<u32>,
    spans: Vec<Span>,
    cycle: u64,
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
            deep: f64::INFINITY,
            let_in: None,
            ledge: BEVEL * offset,
            clearing: false,
            share: 1.0,
            counted: 1.0,
            rim: Vec::new(),
            items,
            ties: Ties::default(),
            wakes: Vec::new(),
            spans: Vec::new(),
            cycle: 0,
        }
    }

    /// Computes the force of every slave from positions and velocities (m/s).
    pub fn compute(&mut self, s: &Surface<'_>, v: &[Vec3], pace: Pace) -> ContactEnergy {
        self.compute_by_law(s, v, pace, None)
    }

    /// The same by one thread, which adds the forces to `f` (N) in the order of [`SheetContact::scatter`] while the slaves are in
    /// its cache.
    pub(crate) fn compute_onto(
        &mut self,
        s: &Surface<'_>,
        v: &[Vec3],
        pace: Pace,
        f: &mut [Vec3],
    ) -> ContactEnergy {
        self.compute_by_law(s, v, pace, Some(f))
    }

    fn compute_by_law(
        &mut self,
        s: &Surface<'_>,
        v: &[Vec3],
        pace: Pace,
        onto: Option<&mut [Vec3]>,
    ) -> ContactEnergy {
        match self.friction.clone() {
            FrictionLaw::Constant(mu) => self.compute_with(&Constant(mu), s, v, pace, onto),
            FrictionLaw::Varying(law) => self.compute_with(&*law, s, v, pace, onto),
            FrictionLaw::Regional(law) => self.compute_with(&*law, s, v, pace, onto),
        }
    }

    fn compute_with<F: Coulomb>(
        &mut self,
        friction: &F,
        s: &Surface<'_>,
        v: &[Vec3],
        pace: Pace,
        onto: Option<&mut [Vec3]>,
    ) -> ContactEnergy {
        self.make_room();
        let side = self.side;
        let law = Law {
            dt: pace.dt,
            friction,
            offset: self.offset,
            slip_factor: self.slip_factor,
            follow: self.follow(),
            growth: pace.growth,
            clearing: self.clearing,
        };
        let following = Following {
            surface: *s,
            v,
            side,
            let_in: self.let_in,
            ledge: self.ledge,
            rim: &self.rim,
            pace,
            cycle: self.cycle,
            law,
        };
        self.cycle += 1;
        let tied = self.ties.compute(s, v, pace.dt, side * self.offset);
        if let Some(f) = onto {
            self.ties.scatter(s.cells, f);
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
        total.add(&tied);
        total
    }

    /// What is known of each item, and of each span of them.
    fn make_room(&mut self) {
        debug_assert!(
            [0, self.items.len()].contains(&self.wakes.len()),
            "'{}' has other items than when it looked last",
            self.name
        );
        self.wakes.resize(self.items.len(), 0);
        self.spans
            .resize_with(self.items.len().div_ceil(SPAN), Span::default);
    }

    /// How its multipliers follow penetrations. What catches hurries nowhere: it bears what changes slowly, and nodes that slide over the edges of
    /// cells come and go.
    fn follow(&self) -> Follow {
        let (share, deep) = match self.let_in {
            Some(_) => (GENTLY * self.augmentation, f64::INFINITY),
            None => (self.augmentation, self.deep),
        };
        Follow {
            share,
            rest: content(self.offset),
            deep,
            swift: SWIFT * deep,
        }
    }

    /// Adds the forces to `f` (N), slaves and masters, in the order of the items.
    pub fn scatter(&self, cells: &[[u32; 4]], f: &mut [Vec3]) {
        self.ties.scatter(cells, f);
        for (items, span) in self.items.chunks(SPAN).zip(&self.spans) {
            if span.touches {
                scatter(items.iter(), cells, f);
            }
        }
    }

    /// What changes: slaves and their sleep.
    pub(crate) fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        a.value(&mut self.cycle)?;
        a.value(&mut self.ledge)?;
        a.value(&mut self.wakes)?;
        a.value(&mut self.spans)?;
        a.values(&mut self.items)?;
        a.values(&mut self.ties.items)
    }
}

/// Slaves whose energies are summed, and that are passed over while all of them sleep: so many as stay in the nearest cache until their
/// forces are on the nodes.
const SPAN: usize = 64;

/// How fast multipliers of a contact that catches grow, over others.
const GENTLY: f64 = 0.3;

/// Steps for which a slave that is to be caught sleeps at least, and so many if it comes nearer in them, at the speed that it has, by no more than the
/// share [`LATE_BY`] of the distance at which sheets touch: almost all of them never touch.
const LATE: [f64; 2] = [6.0, 16.0];
const LATE_BY: f64 = 0.005;

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
    v: &'a [Vec3],
    side: f64,
    let_in: Option<f64>,
    ledge: f64,
    rim: &'a [u32],
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
                // SAFETY: AVX2, all that `wide` asks for, was found the line above.
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
                match follow(item, self) {
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
fn follow<F: Coulomb>(item: &mut SlaveItem, given: &Following<'_, F>) -> Met {
    let (s, v, pace) = (&given.surface, given.v, &given.pace);
    if item.cell == NONE {
        return Met::Never;
    }
    let mut own = given.let_in.map(|_| law_of(item, given));
    let law = own.as_ref().unwrap_or(&given.law);
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
    let p = s.x[item.node as usize];
    let mut found = track(s, item, p, law.offset, iterations, |_| true);
    let looks_around = !item.active || item.turn.is_multiple_of(4 * SEARCH_INTERVAL);
    if !given.rim.is_empty() && looks_around && past_rim(&found.first) {
        found = elsewhere(item, given, law.offset, found);
    }
    // One that is held from below the end of a ledge, as far as it is off that, is not to be held from above when it comes inwards.
    item.guarded |= item.active && ends_at(item.xi) && !at_rim(&found.first);
    (item.cell, item.xi) = (found.first.cell, found.first.xi);
    if let Some(base) = given.let_in.filter(|_| !item.active) {
        item.let_in(s, base, given.law.offset);
        own = Some(law_of(item, given));
    }
    let law = own.as_ref().unwrap_or(&given.law);
    let Some((pull, plain)) = pull_of(item, s, &found, given, law.offset) else {
        item.part();
        return Met::Apart(0);
    };
    item.direction = pull.first;
    // No slave gets deep inside at once.
    let deep = !item.active && pull.gap < -0.5 * law.offset && !law.clearing;
    // One that comes from beside has got behind the rim.
    let behind = deep && at_rim(&found.first);
    if behind || (pull.gap > 0.0 && item.multiplier == 0.0) {
        let met = apart(item, pull.gap.max(0.0), s, v, pace, plain);
        return match met {
            Met::Apart(steps) if given.let_in.is_some() => {
                item.plain = false;
                let [least, most] = LATE;
                let near = law.offset * LATE_BY / (relative_speed(item, s, v) * pace.dt);
                Met::Apart(steps.max(near.clamp(least, most) as u64))
            }
            met => met,
        };
    }
    // Any other was lost in a fold, and is found where it has no way to be pushed from: that would make energy from nothing, now or
    // when it is less deep.
    item.guarded |= deep;
    item.plain = plain;
    Met::Touch(touch(item, s, v, &pull, &found, law))
}

/// The law of a contact at the distance at which one of its slaves touches.
#[inline(always)]
fn law_of<'a, F: Coulomb>(item: &SlaveItem, given: &Following<'a, F>) -> Law<'a, F> {
    Law {
        offset: item.touching(given.law.offset),
        ..given.law
    }
}

/// The closest point of the surface for a slave past its rim, whose closest point so far is `found`: the walk along a rim that is not convex
/// may end at a stretch that is nearest only of those around.
#[inline(never)]
fn elsewhere<F: Coulomb>(
    item: &SlaveItem,
    given: &Following<'_, F>,
    offset: f64,
    found: Found,
) -> Found {
    let s = &given.surface;
    let p = s.x[item.node as usize];
    let own = s.cells[found.first.cell as usize];
    // The walk knows what is around the cell that it has ended at.
    let others =
        (given.rim.iter()).filter(|c| !s.cells[**c as usize].iter().any(|n| own.contains(n)));
    // A cell is no nearer than its middle less half its diagonal.
    let apart = |cell: &u32| {
        let x = s.cells[*cell as usize].map(|n| s.x[n as usize]);
        let way = norm(sub(p, combine([0.25; 4], &x)));
        way - 0.5 * norm(sub(x[2], x[0])).max(norm(sub(x[3], x[1])))
    };
    let nearer = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
    let Some((_, cell)) = others.map(|c| (apart(c), *c)).min_by(nearer) else {
        return found;
    };
    let start = SlaveItem::new(item.node, cell, [0.0; 2]);
    let other = track(s, &start, p, offset, 3, |_| true);
    // In a slot that is narrower than two ledges both are below it.
    let gap = |c: &Closest| c.distance2.sqrt() + Ledge::under(c, given.ledge).less();
    if gap(&other.first) < gap(&found.first) {
        other
    } else {
        found
    }
}

/// A slave that does not touch. One that is so near that it looks again at once keeps its place, as one in touch does.
#[inline(always)]
fn apart(
    item: &mut SlaveItem,
    gap: f64,
    s: &Surface<'_>,
    v: &[Vec3],
    pace: &Pace,
    plain: bool,
) -> Met {
    let steps = pace.steps(gap, relative_speed(item, s, v), 50.0);
    item.part();
    item.plain = plain && steps == 0;
    Met::Apart(steps)
}

/// Gap and direction of a slave whose closest point is found, and whether it may keep both for some steps; `None`: it lies
/// beyond a fold.
#[inline(always)]
fn pull_of<F: Coulomb>(
    item: &SlaveItem,
    s: &Surface<'_>,
    found: &Found,
    given: &Following<'_, F>,
    offset: f64,
) -> Option<(Pull, bool)> {
    let (side, ledge, clearing) = (given.side, given.ledge, given.law.clearing);
    let first = &found.first;
    let nodes = s.cells[first.cell as usize];
    let up = combine(first.weights, &nodes.map(|n| s.normals[n as usize]));
    let distance = first.distance2.sqrt();
    let height = side * dot(first.arm, up);
    let past = past_rim(first);
    let bevelled = |(mut pull, alone): (Pull, bool)| {
        if past {
            Ledge::under(first, ledge).bevel(&mut pull, s, first);
        }
        (pull, alone && !past)
    };
    // At a free rim the sheet is round: there the gap is the distance, wherever the slave lies. On its
    // own side, it is so too; a slave whose mid-surface has just passed through the master's has a
    // negative one. Anything else lies beyond a fold.
    let at_rim = at_rim(first);
    if height > 0.5 * distance || (at_rim && distance > 0.2 * offset) {
        return Some(bevelled(pulled(found, offset)));
    }
    // Where a sheet is bent sharply, what lies between its nodes' normals is far from those of its cells.
    let on_own_side = |n: Vec3| side * dot(first.arm, n) > 0.1 * distance;
    if own_normal(s, first).is_some_and(on_own_side) {
        return Some(bevelled(pulled(found, offset)));
    }
    let through = (item.active || clearing) && height < -0.5 * distance && height > -offset;
    let pull = || Pull::plain(height - offset, scale(up, side));
    through.then(|| bevelled((pull(), false)))
}

/// Unit normal of the cell at the closest point on it, or of it and the next one where that point lies on the edge between them; `None` at a
/// corner, where the node's normal is as good.
#[inline(never)]
fn own_normal(s: &Surface<'_>, c: &Closest) -> Option<Vec3> {
    let own = cell_normal(s, c.cell, c.xi);
    let edge = match c.free {
        [true, true] => return Some(own),
        [false, true] if c.xi[0] > 0.0 => 1,
        [false, true] => 3,
        [true, false] if c.xi[1] > 0.0 => 2,
        [true, false] => 0,
        [false, false] => return None,
    };
    let next = s.neighbours[c.cell as usize][edge];
    // A rim or a mirror plane.
    if next as usize >= s.cells.len() {
        return Some(own);
    }
    let back = s.neighbours[next as usize]
        .iter()
        .position(|n| *n == c.cell)?;
    Some(unit(add(own, cell_normal(s, next, middle(back)))))
}
