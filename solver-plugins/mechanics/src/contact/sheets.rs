//! Nodes of one sheet (slaves) on the surface of another (master).
//!
//! The gap is the distance to the closest point of the master surface (its cells are bilinear), less the
//! offset. The normal force is the exact gradient of k gap^2 / 2: it acts along the line between the two points
//! and on the master's nodes by their shape functions, so it conserves energy, momentum and angular momentum.
//! A force along an interpolated normal is smoother to look at but is no gradient: two flat sheets under
//! 1 bar then flutter, and gain energy without bound (tried; `docs/decisions/0003`).

use super::{ContactEnergy, coulomb, normal_force};
use crate::mesh::NONE;
use crate::vec3::{V, add, dot, scale, sub};
use rayon::prelude::*;

/// One slave node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlaveItem {
    /// Model node.
    pub node: u32,
    /// Master cell (model numbering) or [`NONE`].
    pub cell: u32,
    sleep: u32,
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
    work: f64,
    /// Friction force held by the slip spring (N).
    pub slip: V,
    /// Force on the slave (N); minus this, by the weights, on the cell's nodes.
    pub force: V,
    /// Weights of the cell's nodes.
    pub weights: [f64; 4],
    /// Normal part of the force (N).
    pub normal_force: f64,
    /// Penetration (m), 0 when apart.
    pub penetration: f64,
    energy: ContactEnergy,
}

impl SlaveItem {
    /// A node above (or below) a cell; stiffness and damping are set by the model.
    pub fn new(node: u32, cell: u32, xi: [f64; 2]) -> Self {
        Self {
            node,
            cell,
            sleep: 0,
            active: false,
            xi,
            stiffness: 0.0,
            damping: 0.0,
            multiplier: 0.0,
            work: 0.0,
            slip: [0.0; 3],
            force: [0.0; 3],
            weights: shape(xi),
            normal_force: 0.0,
            penetration: 0.0,
            energy: ContactEnergy::default(),
        }
    }

    fn part(&mut self) {
        self.active = false;
        self.multiplier = 0.0;
        self.work = 0.0;
        self.slip = [0.0; 3];
        self.force = [0.0; 3];
        self.normal_force = 0.0;
        self.penetration = 0.0;
        self.energy = ContactEnergy::default();
    }
}

/// Slaves of one sheet on one master sheet.
pub struct SheetContact {
    /// Name of the pair, for reports.
    pub name: String,
    /// +1: slaves lie on the side of the master's normal (above); -1: below.
    pub side: f64,
    /// Distance of the two mid-surfaces in touch (m).
    pub offset: f64,
    /// Coulomb coefficient.
    pub friction: f64,
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
fn combine(w: [f64; 4], p: &[V; 4]) -> V {
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
struct Closest {
    cell: u32,
    xi: [f64; 2],
    weights: [f64; 4],
    /// From the closest point to the slave (m).
    arm: V,
    distance2: f64,
    /// Half the cell's shorter middle line (m).
    half: f64,
}

/// How far a cell goes on past a free rim, in half cells: a node that sits on the rim would else balance on an
/// edge, slide off and get under the sheet.
const RIM: f64 = 0.5;

/// Closest point of one cell to `p` by Newton steps from `xi`, kept inside the cell.
#[inline(always)]
fn closest(s: &Surface<'_>, cell: u32, mut xi: [f64; 2], p: V, iterations: u32) -> Closest {
    let x = s.cells[cell as usize].map(|n| s.x[n as usize]);
    let mut half = 0.0;
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
        let held = [next[0].clamp(low[0], high[0]), next[1].clamp(low[1], high[1])];
        // Held at one side of the cell, the best place along that side is another one.
        let along = |k: usize, other: f64| {
            let (gkk, rk) = if k == 0 { (g11, r1) } else { (g22, r2) };
            (xi[k] + (rk - g12 * other) / gkk).clamp(low[k], high[k])
        };
        let out = [next[0] != held[0], next[1] != held[1]];
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
    Closest { cell, xi, weights, arm, distance2: dot(arm, arm), half }
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
/// sides that the point lies on or so near that a concave fold could make the neighbour closer.
#[inline]
fn track(s: &Surface<'_>, item: &SlaveItem, p: V, iterations: u32) -> Closest {
    let mut best = closest(s, item.cell, item.xi, p, iterations);
    for _ in 0..12 {
        let near = s.neighbours[best.cell as usize];
        let band = 1.0 - (best.distance2.sqrt() / best.half).min(0.5);
        let here = best;
        for k in 0..2 {
            let place = here.xi[k];
            if place.abs() < band {
                continue;
            }
            // Sides 0: eta = -1, 1: xi = 1, 2: eta = 1, 3: xi = -1.
            let edge = match (k, place > 0.0) {
                (0, true) => 1,
                (0, false) => 3,
                (_, true) => 2,
                (_, false) => 0,
            };
            if near[edge] != NONE {
                let start = entry(s.neighbours, here.cell, near[edge]);
                let other = closest(s, near[edge], start, p, 3);
                if other.distance2 < best.distance2 {
                    best = other;
                }
            }
        }
        if best.cell == here.cell {
            break;
        }
    }
    best
}

impl SheetContact {
    /// Computes the force of every slave. `reach` (m): twice the furthest that any node moves in a step.
    pub fn compute(&mut self, s: &Surface<'_>, v: &[V], dt: f64, reach: f64) -> ContactEnergy {
        let (side, offset) = (self.side, self.offset);
        let law = Law {
            dt,
            friction: self.friction,
            slip_factor: self.slip_factor,
            augmentation: self.augmentation,
        };
        self.items.par_iter_mut().with_min_len(256).for_each(|item| {
            if item.cell == NONE {
                return;
            }
            if item.sleep > 0 {
                item.sleep -= 1;
                return;
            }
            let n = item.node as usize;
            // In touch, the place moves by far less than a cell in a step: one iteration follows it.
            let found = track(s, item, s.x[n], if item.active { 1 } else { 3 });
            (item.cell, item.xi) = (found.cell, found.xi);
            let nodes = s.cells[found.cell as usize];
            let up = combine(found.weights, &nodes.map(|n| s.normals[n as usize]));
            let distance = found.distance2.sqrt();
            let height = side * dot(found.arm, up);
            // On its own side, the gap is the distance; a slave whose mid-surface has just passed through
            // the master's has a negative one. Anything else lies beside the rim, or beyond a fold.
            let (gap, n) = if height > 0.5 * distance {
                (distance - offset, scale(found.arm, 1.0 / distance))
            } else if item.active && height < -0.5 * distance && height > -offset {
                (height - offset, scale(up, side))
            } else {
                item.part();
                return;
            };
            // A slave that comes from beside cannot be deep inside at once: it has got behind the rim.
            let behind = !item.active && gap < -0.5 * offset;
            let apart = gap > 0.0 && item.multiplier == 0.0;
            if behind || apart {
                item.part();
                item.sleep = (gap.max(0.0) / reach).min(50.0) as u32;
            } else {
                touch(item, s, v, gap, n, &found, &law);
            }
        });
        let mut total = ContactEnergy::default();
        for item in &self.items {
            total.stored += item.energy.stored;
            total.friction += item.energy.friction;
            total.damping += item.energy.damping;
        }
        total
    }

    /// Adds the forces to `f` (N), slaves and masters, in the order of the items.
    pub fn scatter(&self, cells: &[[u32; 4]], f: &mut [V]) {
        for item in self.items.iter().filter(|i| i.active) {
            let node = item.node as usize;
            f[node] = add(f[node], item.force);
            for (k, n) in cells[item.cell as usize].iter().enumerate() {
                let n = *n as usize;
                f[n] = sub(f[n], scale(item.force, item.weights[k]));
            }
        }
    }
}

struct Law {
    dt: f64,
    friction: f64,
    slip_factor: f64,
    augmentation: f64,
}

/// Force of a slave in touch, or so lately that it still has a multiplier.
#[inline]
fn touch(
    item: &mut SlaveItem,
    s: &Surface<'_>,
    v: &[V],
    gap: f64,
    n: V,
    found: &Closest,
    law: &Law,
) {
    let nodes = s.cells[found.cell as usize];
    let master_v = combine(found.weights, &nodes.map(|n| v[n as usize]));
    let rel = sub(v[item.node as usize], master_v);
    let vn = dot(rel, n);
    let (k, c, held, work) = (item.stiffness, item.damping, item.multiplier, item.work);
    let normal = normal_force(gap, vn, law.dt, k, c, law.augmentation, held, work);
    let slip_stiffness = law.slip_factor * k;
    let vt = sub(rel, scale(n, vn));
    let rest = sub(item.slip, scale(n, dot(item.slip, n)));
    let trial = sub(rest, scale(vt, slip_stiffness * law.dt));
    let (slip, loss) = coulomb(trial, law.friction * normal.force, slip_stiffness);
    item.active = true;
    item.slip = slip;
    item.force = add(scale(n, normal.force), slip);
    item.weights = found.weights;
    item.normal_force = normal.force;
    item.multiplier = normal.multiplier;
    item.work = normal.work;
    item.penetration = (-gap).max(0.0);
    item.energy = ContactEnergy {
        stored: normal.stored + 0.5 * dot(slip, slip) / slip_stiffness,
        friction: loss,
        damping: normal.loss,
    };
}
