//! Mirror planes at which a model is cut: which nodes lie on them, where its ghosts are.

use super::blocks::Sums;
use super::transpose::Sum;
use crate::MechanicsError;
use crate::mesh::NONE;
use crate::mirror::{Ghost, MIRRORED, Mirrors, Planes, common, reflect};
use crate::vec3::{Vec3, unit};

/// Planes and ghosts of a model; per-node arrays in its numbering.
#[derive(Default)]
pub(super) struct Mirroring {
    pub(super) planes: Planes,
    ghosts: Vec<Ghost>,
    /// By ghost: where its image's sums are among the patches', and where its own begin in `places`.
    places_of: Vec<(u32, u32)>,
    places: Vec<u32>,
    /// Nodes on a plane, and the plane.
    pub(super) held: Vec<(u32, u8)>,
    /// `[n]` share of a node that is modelled; empty without planes.
    share: Vec<f64>,
}

impl Mirroring {
    pub(super) fn new(mirrors: Mirrors, points: &[Vec3]) -> Self {
        let planes = mirrors.planes;
        let mut is_ghost = vec![false; points.len()];
        for g in &mirrors.ghosts {
            is_ghost[g.node as usize] = true;
        }
        let on = |(n, p): (usize, &Vec3)| {
            let (on, ghost) = (planes.holding(*p), is_ghost[n]);
            let held = (0..2).filter(move |k| on[*k] && !ghost);
            held.map(|k| (n as u32, k as u8)).collect::<Vec<_>>()
        };
        let share = points.iter().map(|p| planes.share(*p));
        Self {
            planes,
            share: if planes.any() {
                share.collect()
            } else {
                Vec::new()
            },
            held: points.iter().enumerate().flat_map(on).collect(),
            ghosts: mirrors.ghosts,
            ..Self::default()
        }
    }

    /// Share of a node that is modelled: 1, on one plane 1/2, on both 1/4.
    #[inline]
    pub(super) fn share(&self, node: u32) -> f64 {
        self.share.get(node as usize).copied().unwrap_or(1.0)
    }

    pub(super) fn is_ghost(&self, node: u32) -> bool {
        self.ghosts.binary_search_by_key(&node, |g| g.node).is_ok()
    }

    /// The nodes of a sheet without the ghosts at their end.
    pub(super) fn own(&self, mut nodes: Vec<u32>) -> Vec<u32> {
        let ghosts = nodes.iter().rev().take_while(|n| self.is_ghost(**n));
        let own = nodes.len() - ghosts.count();
        nodes.truncate(own);
        nodes
    }

    /// Marks the edges of cells on a plane in their neighbours.
    pub(super) fn mark(&self, cells: &[[u32; 4]], x: &[Vec3], neighbours: &mut [[u32; 4]]) {
        if !self.planes.any() {
            return;
        }
        for (cell, near) in cells.iter().zip(neighbours) {
            for e in 0..4 {
                let ends = [cell[e], cell[(e + 1) % 4]].map(|n| x[n as usize]);
                if let (NONE, Some(k)) = (near[e], common(self.planes, ends[0], ends[1])) {
                    near[e] = MIRRORED[k];
                }
            }
        }
    }

    /// Finds where the patches' sums of the ghosts and of their images are.
    pub(super) fn place(&mut self, sums: &Sums) -> Result<(), MechanicsError> {
        for g in &self.ghosts {
            let Some(to) = sums.places(g.of).next() else {
                return Err(MechanicsError::Input(format!(
                    "the mirror image of node {} belongs to a patch, the node itself to none",
                    g.of
                )));
            };
            self.places_of.push((to, self.places.len() as u32));
            self.places.extend(sums.places(g.node));
        }
        Ok(())
    }

    /// Hands the forces on ghosts over to their images, ghost by ghost.
    pub(super) fn hand_over(&self, force: &mut [Sum]) {
        for (k, (g, (to, first))) in self.ghosts.iter().zip(&self.places_of).enumerate() {
            let end = self
                .places_of
                .get(k + 1)
                .map_or(self.places.len(), |p| p.1 as usize);
            for place in &self.places[*first as usize..end] {
                let [x, y, z, _] = std::mem::take(&mut force[*place as usize]).0;
                let mirrored = reflect([x, y, z], g.image);
                for (sum, f) in force[*to as usize].0.iter_mut().zip(mirrored) {
                    *sum += f;
                }
            }
        }
    }

    /// Adds the values of ghosts to their images'.
    pub(super) fn fold(&self, values: &mut [f64]) {
        for g in &self.ghosts {
            values[g.of as usize] += std::mem::take(&mut values[g.node as usize]);
        }
    }

    /// Puts the ghosts where the images of their nodes are.
    pub(super) fn follow(&self, x: &mut [Vec3]) {
        for g in &self.ghosts {
            x[g.node as usize] = reflect(x[g.of as usize], g.image);
        }
    }

    /// Turns the area vectors at the planes into those of the whole (times the share): without the part across.
    pub(super) fn level(&self, areas: &mut [Vec3]) {
        for (n, k) in &self.held {
            areas[*n as usize][usize::from(*k)] = 0.0;
        }
    }

    /// The same for unit normals.
    pub(super) fn level_normals(&self, normals: &mut [Vec3]) {
        self.level(normals);
        for (n, _) in &self.held {
            let normal = &mut normals[*n as usize];
            *normal = unit(*normal);
        }
    }
}
