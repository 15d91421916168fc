//! Nodes of one sheet (slaves) on the surface of another (master).
//!
//! The gap is the distance to the closest point of the master surface (its cells are bilinear), less the
//! offset. The normal force is the exact gradient of k gap^2 / 2: it acts along the line between the two points
//! and on the master's nodes by their shape functions, so it conserves energy, momentum and angular momentum.
//! A force along an interpolated normal is smoother to look at but is no gradient: two flat sheets under
//! 1 bar then flutter, and gain energy without bound (tried; `docs/decisions/0003`).

use super::friction::{Constant, Coulomb, FrictionLaw, Sliding};
use super::{ContactEnergy, content, friction_force, normal_force};
use crate::mesh::NONE;
use crate::vec3::{V, add, cross, dot, norm, scale, sub, unit};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// One slave node.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SlaveItem {
    /// Model node.
    pub node: u32,
    /// Master cell (model numbering) or [`NONE`].
    pub cell: u32,
    pub(super) sleep: u32,
    pub(super) turn: u8,
    /// The last search found one cell, on the slave's own side.
    pub(super) plain: bool,
    /// Direction from master to slave at the last search.
    pub(super) direction: V,
    /// In touch in the last step.
    pub active: bool,
    /// Place in the cell, -1..1.
    pub xi: [f64; 2],
    /// Normal stiffness (N/m).
    pub stiffness: f64,
    /// Damping (N s/m).
    pub damping: f64,
    /// Multiplier: the steady part of the normal force (N).
    pub multiplier: f64,
    pub(super) work: f64,
    /// Friction force held by the slip spring (N).
    pub slip: V,
    /// Force on the slave (N).
    pub force: V,
    /// Weights of the cell's nodes.
    pub weights: [f64; 4],
    /// Its share of the force (N): minus this, by the weights, acts on the cell's nodes.
    pub(super) share: V,
    /// The other cell of a concave fold in which the slave lies, or [`NONE`]; its weights and share.
    pub(super) second: u32,
    pub(super) second_weights: [f64; 4],
    pub(super) second_share: V,
    /// Normal part of the force (N).
    pub normal_force: f64,
    /// Penetration (m), 0 when apart.
    pub penetration: f64,
    /// Part of it that no motion has brought about (m): it is left standing and pushes nothing ([`SlaveItem::admit`]).
    pub(super) ignored: f64,
    /// Whether penetrations that no motion has brought about are ignored.
    pub(super) guarded: bool,
    pub(super) energy: ContactEnergy,
}

impl SlaveItem {
    /// A node above (or below) a cell; stiffness and damping are set by the model.
    pub fn new(node: u32, cell: u32, xi: [f64; 2]) -> Self {
        Self {
            node,
            cell,
            sleep: 0,
            // Spread over the nodes, so that every step searches for its share of them.
            turn: (node % SEARCH_INTERVAL as u32) as u8,
            plain: false,
            direction: [0.0; 3],
            active: false,
            xi,
            stiffness: 0.0,
            damping: 0.0,
            multiplier: 0.0,
            work: 0.0,
            slip: [0.0; 3],
            force: [0.0; 3],
            weights: shape(xi),
            share: [0.0; 3],
            second: NONE,
            second_weights: [0.0; 4],
            second_share: [0.0; 3],
            normal_force: 0.0,
            penetration: 0.0,
            ignored: 0.0,
            guarded: false,
            energy: ContactEnergy::default(),
        }
    }

    pub(super) fn part(&mut self) {
        self.active = false;
        self.ignored = 0.0;
        self.plain = false;
        self.multiplier = 0.0;
        self.work = 0.0;
        self.second = NONE;
        self.slip = [0.0; 3];
        self.force = [0.0; 3];
        self.normal_force = 0.0;
        self.penetration = 0.0;
        self.energy = ContactEnergy::default();
    }

    /// Takes note of a penetration `depth` (m, negative when apart) after a step `dt` (s) at the relative velocity
    /// `rel` (m/s), and gives the part of it that pushes.
    ///
    /// What motion cannot have brought about has come from the search: another face of a fold has become the
    /// closest one, or a slave has got behind a rim. To push it out would make energy from nothing. It is left
    /// standing; as the slave comes out it shrinks, and it never grows again.
    #[inline]
    fn admit(&mut self, depth: f64, rel: V, dt: f64, offset: f64) -> f64 {
        let jump = depth - self.penetration;
        if self.guarded && jump > SLACK * offset && jump > SLACK * offset + 2.0 * norm(rel) * dt {
            self.ignored += jump;
        }
        self.ignored = self.ignored.min(depth.max(0.0));
        depth - self.ignored
    }
}

/// What a search may move the closest point by while nothing folds, over the offset.
const SLACK: f64 = 1e-2;

/// How often (steps) the closest point of a slave in touch is searched anew. In between it keeps its place in the
/// cell: it slides by some micrometres, which changes the distance by less than a nanometre.
pub(super) const SEARCH_INTERVAL: u8 = 4;

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
    /// The slaves.
    pub items: Vec<SlaveItem>,
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
    /// `[cells][4]` cell across each edge or [`NONE`].
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
    half: f64,
    /// The foot of the perpendicular, not a place held at a side of the cell.
    pub(super) interior: bool,
}

/// The closest point of the surface, and in a concave fold the closest of the cell across it.
pub(super) struct Found {
    pub(super) first: Closest,
    pub(super) second: Option<Closest>,
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
    let (mut half, mut interior) = (0.0, true);
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
        interior = !(out[0] || out[1]);
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
        interior,
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

/// Where a walk over an edge enters the neighbour, coming from place `xi`.
fn entry(neighbours: &[[u32; 4]], from: u32, to: u32) -> [f64; 2] {
    match neighbours[to as usize].iter().position(|n| *n == from) {
        Some(0) => [0.0, -1.0],
        Some(1) => [1.0, 0.0],
        Some(2) => [0.0, 1.0],
        _ => [-1.0, 0.0],
    }
}

/// The closest point of the surface near where the slave was: of its cell, and of the cells across those
/// sides that the point lies on, and (every eighth step) of those so near that a concave fold could make the
/// neighbour closer. The walk enters only cells that are `open` to it.
#[inline]
pub(super) fn track(
    s: &Surface<'_>,
    item: &SlaveItem,
    p: V,
    iterations: u32,
    open: impl Fn(u32) -> bool,
) -> Found {
    let mut best = closest(s, item.cell, item.xi, p, iterations);
    let mut second: Option<Closest> = None;
    let every = |n: u8| item.second != NONE || item.turn.is_multiple_of(n) || !item.active;
    let careful = every(8);
    // A neighbour that is folded back over the slave (by more than a right angle) is as near as the slave's own
    // cell from further off its side. Found too late, it would stand deep inside from one step to the next.
    let reach = if every(16) { 4.0 } else { 1.0 };
    for _ in 0..12 {
        let near = s.neighbours[best.cell as usize];
        let band = 1.0 - (reach * best.distance2.sqrt() / best.half).min(0.5);
        let here = best;
        second = None;
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
            if near[edge] != NONE && open(near[edge]) {
                let start = entry(s.neighbours, here.cell, near[edge]);
                let mut other = closest(s, near[edge], start, p, 3);
                if other.distance2 < best.distance2 {
                    std::mem::swap(&mut best, &mut other);
                }
                if other.interior && second.is_none_or(|c| other.distance2 < c.distance2) {
                    second = Some(other);
                }
            }
        }
        if best.cell == here.cell {
            break;
        }
    }
    // Only where both feet are perpendicular does the surface fold towards the slave.
    let second = second.filter(|_| best.interior);
    Found {
        first: best,
        second,
    }
}

/// Distance in a concave fold, and the share of the second cell. There the distance to the surface is the
/// smaller of two, and its gradient jumps where they are equal: a node that is pressed into the fold would
/// rattle between the two faces, and explicit steps heat such a rattle. So within
/// e = 0.4 offset (1 - cos fold) of each other the two are blended into a smooth minimum,
/// d = d1 - (e - (d2 - d1))^2 / 4e. Both feet are still perpendicular there, so nothing jumps at its ends.
#[inline]
pub(super) fn blend(first: &Closest, second: Option<&Closest>, offset: f64) -> (f64, f64) {
    let d1 = first.distance2.sqrt();
    let Some(second) = second else {
        return (d1, 0.0);
    };
    let d2 = second.distance2.sqrt();
    let cosine = dot(first.arm, second.arm) / (d1 * d2);
    let e = 0.4 * offset * (1.0 - cosine);
    let rest = e - (d2 - d1);
    if rest <= 0.0 || e < 1e-9 * offset {
        return (d1, 0.0);
    }
    (d1 - rest * rest / (4.0 * e), rest / (2.0 * e))
}

impl SheetContact {
    /// Computes the force of every slave. `reach` (m): twice the furthest that any node moves in a step.
    pub fn compute(&mut self, s: &Surface<'_>, v: &[V], dt: f64, reach: f64) -> ContactEnergy {
        match self.friction.clone() {
            FrictionLaw::Constant(mu) => self.compute_with(&Constant(mu), s, v, dt, reach),
            FrictionLaw::Varying(law) => self.compute_with(&*law, s, v, dt, reach),
        }
    }

    fn compute_with<F: Coulomb>(
        &mut self,
        friction: &F,
        s: &Surface<'_>,
        v: &[V],
        dt: f64,
        reach: f64,
    ) -> ContactEnergy {
        let (side, offset) = (self.side, self.offset);
        let law = Law {
            dt,
            friction,
            offset,
            slip_factor: self.slip_factor,
            augmentation: self.augmentation,
        };
        self.items
            .par_iter_mut()
            .with_min_len(256)
            .for_each(|item| {
                if item.cell == NONE {
                    return;
                }
                if item.sleep > 0 {
                    item.sleep -= 1;
                    return;
                }
                let n = item.node as usize;
                item.turn = item.turn.wrapping_add(1);
                if item.active && item.plain && !item.turn.is_multiple_of(SEARCH_INTERVAL) {
                    hold(item, s, v, offset, &law);
                    return;
                }
                // In touch, the place moves by far less than a cell in a step: one iteration follows it.
                let found = track(s, item, s.x[n], if item.active { 1 } else { 3 }, |_| true);
                let first = &found.first;
                (item.cell, item.xi) = (first.cell, first.xi);
                let nodes = s.cells[first.cell as usize];
                let up = combine(first.weights, &nodes.map(|n| s.normals[n as usize]));
                let distance = first.distance2.sqrt();
                let height = side * dot(first.arm, up);
                // At a free rim the sheet is round: there the gap is the distance, wherever the slave lies. On its
                // own side, it is so too; a slave whose mid-surface has just passed through the master's has a
                // negative one. Anything else lies beyond a fold.
                let at_rim = first.xi.iter().any(|x| x.abs() > 1.0 + 0.999 * RIM);
                let mut plain = false;
                let pull = if height > 0.5 * distance || (at_rim && distance > 0.2 * offset) {
                    let (d, w) = blend(first, found.second.as_ref(), offset);
                    let n = scale(first.arm, (1.0 - w) / distance);
                    let m = match &found.second {
                        Some(c) if w > 0.0 => scale(c.arm, w / c.distance2.sqrt()),
                        _ => [0.0; 3],
                    };
                    plain = w == 0.0 && !at_rim;
                    Pull {
                        gap: d - offset,
                        share: w,
                        first: n,
                        second: m,
                    }
                } else if item.active && height < -0.5 * distance && height > -offset {
                    let n = scale(up, side);
                    Pull {
                        gap: height - offset,
                        share: 0.0,
                        first: n,
                        second: [0.0; 3],
                    }
                } else {
                    item.part();
                    return;
                };
                // A slave that comes from beside cannot be deep inside at once: it has got behind the rim.
                let behind = !item.active && pull.gap < -0.5 * offset;
                let apart = pull.gap > 0.0 && item.multiplier == 0.0;
                if behind || apart {
                    item.part();
                    item.sleep = (pull.gap.max(0.0) / reach).min(50.0) as u32;
                } else {
                    item.plain = plain;
                    item.direction = pull.first;
                    touch(item, s, v, &pull, &found, &law);
                }
            });
        let mut total = ContactEnergy::default();
        for item in self.items.iter().filter(|i| i.active) {
            total.add(&item.energy);
        }
        total
    }

    /// Adds the forces to `f` (N), slaves and masters, in the order of the items.
    pub fn scatter(&self, cells: &[[u32; 4]], f: &mut [V]) {
        scatter(self.items.iter(), cells, f);
    }
}

/// Adds the forces of the items in touch to `f` (N): all masters', then all slaves'.
pub(super) fn scatter<'a>(
    items: impl Iterator<Item = &'a SlaveItem> + Clone,
    cells: &[[u32; 4]],
    f: &mut [V],
) {
    let mut push = |cell: u32, weights: &[f64; 4], force: V| {
        for (w, n) in weights.iter().zip(cells[cell as usize]) {
            let n = n as usize;
            f[n] = sub(f[n], scale(force, *w));
        }
    };
    for item in items.clone().filter(|i| i.active) {
        push(item.cell, &item.weights, item.share);
        if item.second != NONE {
            push(item.second, &item.second_weights, item.second_share);
        }
    }
    for item in items.filter(|i| i.active) {
        let node = item.node as usize;
        f[node] = add(f[node], item.force);
    }
}

/// Gap and its gradient for the slave: `first` and `second` are minus the gradients for the two cells' points.
pub(super) struct Pull {
    pub(super) gap: f64,
    pub(super) share: f64,
    pub(super) first: V,
    pub(super) second: V,
}

/// Force of a slave that keeps its place in its cell and its direction. (The distance to a point that stands
/// still would not do: pressed at a tenth of a millimetre from it, the slave is a pendulum on its head.)
#[inline]
pub(super) fn hold<F: Coulomb>(
    item: &mut SlaveItem,
    s: &Surface<'_>,
    v: &[V],
    offset: f64,
    law: &Law<'_, F>,
) {
    let x = s.cells[item.cell as usize].map(|n| s.x[n as usize]);
    let arm = sub(s.x[item.node as usize], combine(item.weights, &x));
    let n = item.direction;
    let pull = Pull {
        gap: dot(arm, n) - offset,
        share: 0.0,
        first: n,
        second: [0.0; 3],
    };
    let (cell, xi, weights) = (item.cell, item.xi, item.weights);
    let first = Closest {
        cell,
        xi,
        weights,
        arm,
        distance2: 0.0,
        half: 0.0,
        interior: true,
    };
    touch(
        item,
        s,
        v,
        &pull,
        &Found {
            first,
            second: None,
        },
        law,
    );
}

/// Constants of a contact in a step.
pub(super) struct Law<'a, F> {
    pub(super) dt: f64,
    pub(super) offset: f64,
    pub(super) friction: &'a F,
    pub(super) slip_factor: f64,
    pub(super) augmentation: f64,
}

/// Force of a slave in touch, or so lately that it still has a multiplier.
#[inline]
pub(super) fn touch<F: Coulomb>(
    item: &mut SlaveItem,
    s: &Surface<'_>,
    v: &[V],
    pull: &Pull,
    found: &Found,
    law: &Law<'_, F>,
) {
    let speed = |c: &Closest| combine(c.weights, &s.cells[c.cell as usize].map(|n| v[n as usize]));
    let own = v[item.node as usize];
    let first = &found.first;
    let rel1 = sub(own, speed(first));
    let (mut rel, mut vn) = (rel1, dot(rel1, pull.first));
    let second = found.second.as_ref().filter(|_| pull.share > 0.0);
    if let Some(c) = second {
        let rel2 = sub(own, speed(c));
        vn += dot(rel2, pull.second);
        rel = add(scale(rel1, 1.0 - pull.share), scale(rel2, pull.share));
    }
    let (k, c, held, work) = (item.stiffness, item.damping, item.multiplier, item.work);
    let depth = -pull.gap;
    let gap = -item.admit(depth, rel, law.dt, law.offset);
    let rest = content(law.offset);
    let normal = normal_force(gap, vn, law.dt, k, c, law.augmentation, rest, held, work);
    let n = unit(add(pull.first, pull.second));
    let vt = sub(rel, scale(n, dot(rel, n)));
    let rest = sub(item.slip, scale(n, dot(item.slip, n)));
    let limit = law.friction.limit(&Sliding {
        node: item.node,
        cell: first.cell,
        x: s.x,
        normal: n,
        force: normal.force,
        held: rest,
        vt,
        spring: law.slip_factor * k * law.dt,
    });
    let f = friction_force(
        rest,
        vt,
        law.dt,
        law.slip_factor * k,
        law.slip_factor * c,
        limit,
    );
    item.active = true;
    item.slip = f.slip;
    item.weights = first.weights;
    item.share = add(
        scale(pull.first, normal.force),
        scale(f.force, 1.0 - pull.share),
    );
    item.force = item.share;
    item.second = NONE;
    if let Some(c) = second {
        item.second = c.cell;
        item.second_weights = c.weights;
        item.second_share = add(scale(pull.second, normal.force), scale(f.force, pull.share));
        item.force = add(item.force, item.second_share);
    }
    item.normal_force = normal.force;
    item.multiplier = normal.multiplier;
    item.work = normal.work;
    item.penetration = depth.max(0.0);
    item.energy = ContactEnergy {
        stored: normal.stored + f.stored,
        friction: f.friction,
        damping: normal.loss + f.damping,
    };
}
