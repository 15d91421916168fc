//! Nodes of one sheet (slaves) on the surface of another (master).
//!
//! The slave is projected along the master's interpolated nodal normal: x_s = X(xi, eta) + g N(xi, eta).
//! So the line of the normal force runs through both points and angular momentum is kept; and the normal is
//! continuous from cell to cell, so that a flat stack under pressure stays silent.

use super::{ContactEnergy, coulomb};
use crate::mesh::NONE;
use crate::vec3::{V, add, cross, dot, norm, scale, sub};
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

struct Projection {
    weights: [f64; 4],
    gap: f64,
    normal: V,
}

/// One Newton step of the projection; gives the increment of xi and what is found at the old xi.
#[inline(always)]
fn newton(s: &Surface<'_>, cell: u32, xi: [f64; 2], p: V) -> ([f64; 2], Projection) {
    let nodes = s.cells[cell as usize];
    let x = nodes.map(|n| s.x[n as usize]);
    let m = nodes.map(|n| s.normals[n as usize]);
    let w = shape(xi);
    let (a, b) = (0.25 * (1.0 - xi[1]), 0.25 * (1.0 + xi[1]));
    let wx = [-a, a, b, -b];
    let (c, d) = (0.25 * (1.0 - xi[0]), 0.25 * (1.0 + xi[0]));
    let wy = [-c, -d, d, c];
    let normal = combine(w, &m);
    let r = sub(p, combine(w, &x));
    let g0 = dot(r, normal) / dot(normal, normal);
    let t1 = add(combine(wx, &x), scale(combine(wx, &m), g0));
    let t2 = add(combine(wy, &x), scale(combine(wy, &m), g0));
    // [t1 t2 normal] [dxi deta g] = r by Cramer's rule.
    let t12 = cross(t1, t2);
    let det = dot(t12, normal);
    let inv = if det.abs() > 0.0 { 1.0 / det } else { 0.0 };
    let dxi = dot(cross(r, t2), normal) * inv;
    let deta = dot(cross(t1, r), normal) * inv;
    let g = dot(t12, r) * inv;
    let size = norm(normal);
    let unit = scale(normal, 1.0 / size);
    ([dxi, deta], Projection { weights: w, gap: g * size, normal: unit })
}

/// Where a walk over an edge enters the neighbour.
fn entry(neighbours: &[[u32; 4]], from: u32, to: u32) -> [f64; 2] {
    match neighbours[to as usize].iter().position(|n| *n == from) {
        Some(0) => [0.0, -1.0],
        Some(1) => [1.0, 0.0],
        Some(2) => [0.0, 1.0],
        _ => [-1.0, 0.0],
    }
}

/// Follows the slave over the surface; `None` when it is off the edge.
#[inline]
fn track(s: &Surface<'_>, item: &mut SlaveItem, p: V, iterations: u32) -> Option<Projection> {
    let mut left = iterations;
    let mut hops = 0;
    loop {
        let (d, found) = newton(s, item.cell, item.xi, p);
        // Far outside the cell the bilinear map means nothing: limit the reach of a step.
        item.xi = [
            (item.xi[0] + d[0].clamp(-2.0, 2.0)).clamp(-3.0, 3.0),
            (item.xi[1] + d[1].clamp(-2.0, 2.0)).clamp(-3.0, 3.0),
        ];
        left = left.saturating_sub(1);
        let over = [-item.xi[1] - 1.0, item.xi[0] - 1.0, item.xi[1] - 1.0, -item.xi[0] - 1.0];
        let edge = (1..4).fold(0, |e, k| if over[k] > over[e] { k } else { e });
        if over[edge] > 1e-9 {
            let near = s.neighbours[item.cell as usize][edge];
            if near == NONE || hops == 12 {
                return None;
            }
            item.xi = entry(s.neighbours, item.cell, near);
            item.cell = near;
            hops += 1;
            left = 3;
            continue;
        }
        if left == 0 {
            return Some(found);
        }
    }
}

impl SheetContact {
    /// Computes the force of every slave. `reach` (m): twice the furthest that any node moves in a step.
    pub fn compute(&mut self, s: &Surface<'_>, v: &[V], dt: f64, reach: f64) -> ContactEnergy {
        let (side, offset) = (self.side, self.offset);
        let (friction, slip_factor) = (self.friction, self.slip_factor);
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
            let iterations = if item.active { 1 } else { 3 };
            let Some(found) = track(s, item, s.x[n], iterations) else {
                item.part();
                item.sleep = 8;
                return;
            };
            let gap = side * found.gap - offset;
            if gap > 0.0 {
                item.part();
                item.sleep = (gap / reach).min(50.0) as u32;
                return;
            }
            // Far behind the master: that is no contact of a thin stack but the other side of a fold.
            if gap < -20.0 * offset {
                item.part();
                return;
            }
            touch(item, s, v, gap, &found, side, dt, friction, slip_factor);
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

#[inline]
fn touch(
    item: &mut SlaveItem,
    s: &Surface<'_>,
    v: &[V],
    gap: f64,
    found: &Projection,
    side: f64,
    dt: f64,
    friction: f64,
    slip_factor: f64,
) {
    let nodes = s.cells[item.cell as usize];
    let master_v = combine(found.weights, &nodes.map(|n| v[n as usize]));
    let n = scale(found.normal, side);
    let rel = sub(v[item.node as usize], master_v);
    let vn = dot(rel, n);
    let spring = -item.stiffness * gap;
    let damper = (-item.damping * vn).max(-spring);
    let normal = spring + damper;
    let slip_stiffness = slip_factor * item.stiffness;
    let vt = sub(rel, scale(n, vn));
    let held = sub(item.slip, scale(n, dot(item.slip, n)));
    let trial = sub(held, scale(vt, slip_stiffness * dt));
    let (slip, loss) = coulomb(trial, friction * normal, slip_stiffness);
    item.active = true;
    item.slip = slip;
    item.force = add(scale(n, normal), slip);
    item.weights = found.weights;
    item.normal_force = normal;
    item.penetration = -gap;
    item.energy = ContactEnergy {
        stored: 0.5 * item.stiffness * gap * gap + 0.5 * dot(slip, slip) / slip_stiffness,
        friction: loss,
        damping: -damper * vn * dt,
    };
}
