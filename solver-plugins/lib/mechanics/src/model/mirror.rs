//! What a model cut at mirror planes does besides: holds nodes on the planes, moves its ghosts.

use super::transpose::Sum;
use super::*;
use crate::mesh::NONE;
use crate::mirror::{Ghost, MIRRORED, Mirrors, Planes, common, reflect};
use std::sync::Arc;

/// Stiffness of the contact with a mirror plane over mass / step^2. It comes on top of what [`Model::set_contact_stiffness`]
/// gives out: small, so that all stays stable, and so that the other contacts are those of the whole model.
const PLANE_STIFFNESS: f64 = 0.1;

/// Planes and ghosts of a model; per-node arrays in its numbering.
#[derive(Default)]
pub(super) struct Mirroring {
    planes: Planes,
    ghosts: Vec<Ghost>,
    /// By ghost: where its image's sums are among the patches', and where its own begin in `places`.
    places_of: Vec<(u32, u32)>,
    places: Vec<u32>,
    /// Nodes on a plane, and the plane.
    held: Vec<(u32, u8)>,
    /// `[n]` share of a node that is modelled; empty without planes.
    share: Vec<f64>,
}

impl Mirroring {
    pub(super) fn new(mirrors: Mirrors, points: &[V]) -> Self {
        let planes = mirrors.planes;
        let mut is_ghost = vec![false; points.len()];
        for g in &mirrors.ghosts {
            is_ghost[g.node as usize] = true;
        }
        let on = |(n, p): (usize, &V)| {
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
    pub(super) fn mark(&self, cells: &[[u32; 4]], x: &[V], neighbours: &mut [[u32; 4]]) {
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
    pub(super) fn follow(&self, x: &mut [V]) {
        for g in &self.ghosts {
            x[g.node as usize] = reflect(x[g.of as usize], g.image);
        }
    }

    /// Turns the area vectors at the planes into those of the whole (times the share): without the part across.
    pub(super) fn level(&self, areas: &mut [V]) {
        for (n, k) in &self.held {
            areas[*n as usize][usize::from(*k)] = 0.0;
        }
    }

    /// The same for unit normals.
    pub(super) fn level_normals(&self, normals: &mut [V]) {
        self.level(normals);
        for (n, _) in &self.held {
            let normal = &mut normals[*n as usize];
            *normal = crate::vec3::unit(*normal);
        }
    }
}

impl Model {
    /// The planes at which the model is cut.
    pub fn planes(&self) -> Planes {
        self.topology.mirroring.planes
    }

    /// Puts the ghosts to their places after [`Model::x`] was changed by hand; steps do it themselves.
    pub fn place_ghosts(&mut self) {
        self.topology.mirroring.follow(&mut self.state.x);
    }

    /// Holds the nodes of the planes on them. A rotation about an axis in a plane would turn it: only that about its
    /// normal is free.
    pub(super) fn hold_at_planes(&mut self) {
        let mut fixed = std::collections::BTreeMap::<u32, Fixed>::new();
        for (n, k) in &self.topology.mirroring.held {
            let k = usize::from(*k);
            let of = fixed.entry(*n).or_default();
            of.translations[k] = true;
            for c in (0..3).filter(|c| *c != k) {
                of.rotations[c] = true;
            }
        }
        for (n, fixed) in fixed {
            self.fix(n, fixed);
        }
    }

    /// Adds the contact of all nodes beside a mirror plane with it, without friction: there they meet their own images.
    /// Call it after [`Model::set_contact_stiffness`].
    pub fn add_plane_contacts(&mut self, settings: &ContactSettings) {
        let dt2 = self.topology.settings.target_step.powi(2);
        for k in (0..2).filter(|k| self.topology.mirroring.planes.0[*k]) {
            let mut seen = vec![false; self.state.x.len()];
            for sheet in &self.topology.sheets {
                let mut items = Vec::new();
                for n in &sheet.nodes {
                    let i = *n as usize;
                    if std::mem::replace(&mut seen[i], true) || self.state.x[i][k] == 0.0 {
                        continue;
                    }
                    let mut item = RigidItem::new(*n);
                    item.stiffness = PLANE_STIFFNESS * self.topology.mass[i] / dt2;
                    let critical = 2.0 * (item.stiffness * self.topology.mass[i]).sqrt();
                    item.damping = (settings.damping_ratio * critical) as f32;
                    items.push(item);
                }
                let name = format!("symmetry_{}/{}", ["x", "y"][k], sheet.name);
                let surface = Arc::new(MirrorPlane(k));
                let without = ContactSettings {
                    augmentation: 0.0,
                    ..*settings
                };
                self.contacts
                    .rigid
                    .push(RigidContact::new(name, surface, 0.0, 0.0, &without, items));
            }
        }
    }
}

/// The plane through the origin square to an axis, solid on its negative side.
struct MirrorPlane(usize);

impl RigidSurface for MirrorPlane {
    fn distance(&self, point: V) -> (f64, V) {
        (
            point[self.0],
            std::array::from_fn(|c| f64::from(u8::from(c == self.0))),
        )
    }
}
