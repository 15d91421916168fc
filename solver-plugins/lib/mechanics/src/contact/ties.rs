//! Nodes of one sheet that are tied to the points of another that they were laid on: plies that are stitched to each other.
//!
//! With the way `a` from the point to the node, the unit normal `n` of the point's cell and the height `a.n`, a tie stores k/2 |a - (a.n) n|^2, of
//! sliding alone, up to the height `d` = [`SLACK`] times the distance at which the sheets touch, and k/2 |a - d n|^2 beyond. What presses the two
//! on each other is the contact's, and what the straight cells of curved sheets stand off each other is not drawn together. The force is the
//! exact gradient of that, the turning of the normal with the cell's diagonals included, so that it conserves energy, momentum and angular
//! momentum (ours, `docs/decisions/0085-tied-plies.md`).

use super::closest::{Surface, combine, shape};
use super::penalty::ContactEnergy;
use crate::vec3::{Vec3, add, cross, dot, norm, scale, sub};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Height from which on a tie holds two sheets together, over the distance at which they touch.
pub const SLACK: f64 = 2.0;

/// A node and the point that it is tied to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Tie {
    /// Model node.
    pub node: u32,
    /// Master cell (model numbering).
    pub cell: u32,
    /// Place in the cell, -1..1.
    pub xi: [f64; 2],
    /// Stiffness (N/m), of sliding and of opening.
    pub stiffness: f64,
    /// Damping (N s/m).
    pub damping: f64,
    /// Force on the node (N): minus this acts on the point.
    force: Vec3,
    /// Forces (N) on the second ends of the cell's two diagonals, minus these on the first ends: what turns the cell with the force.
    turning: [Vec3; 2],
    /// How far (m) the node has gone along the cell, and away from it beyond the slack.
    stretch: f64,
    /// That over the length of its cell.
    share: f64,
}

impl Tie {
    /// A node over a place in a cell; stiffness and damping are set by the model.
    pub fn new(node: u32, cell: u32, xi: [f64; 2]) -> Self {
        Self {
            node,
            cell,
            xi,
            stiffness: 0.0,
            damping: 0.0,
            force: [0.0; 3],
            turning: [[0.0; 3]; 2],
            stretch: 0.0,
            share: 0.0,
        }
    }

    /// Computes the forces from positions and velocities (m/s); their energies in a step `dt` (s).
    fn compute(&mut self, s: &Surface<'_>, v: &[Vec3], dt: f64, distance: f64) -> ContactEnergy {
        let nodes = s.cells[self.cell as usize];
        let weights = shape(self.xi);
        let node = self.node as usize;
        let (x, speeds) = (nodes.map(|n| s.x[n as usize]), nodes.map(|n| v[n as usize]));
        let arm = sub(s.x[node], combine(weights, &x));
        let diagonals = [sub(x[2], x[0]), sub(x[3], x[1])];
        let area = cross(diagonals[0], diagonals[1]);
        let size = norm(area).max(1e-300);
        let normal = scale(area, 1.0 / size);
        let across = |a: Vec3| sub(a, scale(normal, dot(a, normal)));
        let height = dot(arm, normal);
        let distance = SLACK * distance;
        let is_open = distance.signum() * height > distance.abs();
        let (way, lever) = match is_open {
            true => (sub(arm, scale(normal, distance)), distance),
            false => (across(arm), height),
        };
        // How fast the node leaves the place over its point, which turns with the cell.
        let turns = [sub(speeds[2], speeds[0]), sub(speeds[3], speeds[1])];
        let area_rate = add(cross(turns[0], diagonals[1]), cross(diagonals[0], turns[1]));
        let normal_rate = scale(across(area_rate), 1.0 / size);
        let leaves = sub(
            sub(v[node], combine(weights, &speeds)),
            scale(normal_rate, lever),
        );
        let damped = match is_open {
            true => leaves,
            false => across(leaves),
        };
        let damper = scale(damped, -self.damping);
        let before = dot(self.force, leaves);
        self.force = add(scale(way, -self.stiffness), damper);
        let turner = scale(across(self.force), lever / size);
        self.turning = [cross(turner, diagonals[1]), cross(diagonals[0], turner)];
        self.stretch = norm(way);
        self.share = self.stretch / (0.5 * size).sqrt();
        ContactEnergy {
            stored: 0.5 * self.stiffness * dot(way, way),
            friction: 0.0,
            damping: -dot(damper, leaves) * dt,
            work: -0.5 * (before + dot(self.force, leaves)) * dt,
        }
    }

    /// Adds its forces to `f` (N).
    fn scatter(&self, cells: &[[u32; 4]], f: &mut [Vec3]) {
        let nodes = cells[self.cell as usize].map(|n| n as usize);
        for (w, n) in shape(self.xi).iter().zip(nodes) {
            f[n] = sub(f[n], scale(self.force, *w));
        }
        for (k, turning) in self.turning.iter().enumerate() {
            f[nodes[k + 2]] = add(f[nodes[k + 2]], *turning);
            f[nodes[k]] = sub(f[nodes[k]], *turning);
        }
        f[self.node as usize] = add(f[self.node as usize], self.force);
    }
}

/// The ties of two sheets.
#[derive(Debug, Default)]
pub struct Ties {
    /// Of each node that is tied.
    pub items: Vec<Tie>,
    energies: Vec<ContactEnergy>,
}

/// Ties whose energies are summed.
const SPAN: usize = 64;

impl Ties {
    /// Of these nodes.
    pub fn new(items: Vec<Tie>) -> Self {
        let energies = Vec::new();
        Self { items, energies }
    }

    /// The largest way (m) that a node has gone along the cell from where it was laid, and away from it beyond the slack.
    pub fn stretch(&self) -> f64 {
        self.items.iter().fold(0.0, |most, t| most.max(t.stretch))
    }

    /// The same over the length of its cell, the largest.
    pub fn stretch_share(&self) -> f64 {
        self.items.iter().fold(0.0, |most, t| most.max(t.share))
    }

    /// Forces of all from positions and velocities (m/s), and their energies in a step `dt` (s). `distance`: at which the sheets touch (m), negative
    /// where the nodes lie below.
    pub(super) fn compute(
        &mut self,
        s: &Surface<'_>,
        v: &[Vec3],
        dt: f64,
        distance: f64,
    ) -> ContactEnergy {
        let mut total = ContactEnergy::default();
        if self.items.is_empty() {
            return total;
        }
        let count = self.items.len().div_ceil(SPAN);
        self.energies.resize(count, ContactEnergy::default());
        self.items
            .par_chunks_mut(SPAN)
            .zip_eq(self.energies.par_iter_mut())
            .with_min_len(crate::team::least())
            .for_each(|(items, energy)| {
                *energy = ContactEnergy::default();
                for item in items {
                    energy.add(&item.compute(s, v, dt, distance));
                }
            });
        for energy in &self.energies {
            total.add(energy);
        }
        total
    }

    /// Adds the forces to `f` (N), in the order of the nodes.
    pub(super) fn scatter(&self, cells: &[[u32; 4]], f: &mut [Vec3]) {
        for item in &self.items {
            item.scatter(cells, f);
        }
    }
}
