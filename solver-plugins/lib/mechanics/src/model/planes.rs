//! What a model cut at mirror planes does besides: holds nodes on the planes, keeps the others off them.

use super::boundary::Fixed;
use super::parts::Model;
use crate::contact::{ContactSettings, RigidContact, RigidItem, RigidSurface};
use crate::mirror::Planes;
use crate::vec3::Vec3;
use std::sync::Arc;

/// Stiffness of the contact with a mirror plane over mass / step^2. It comes on top of what [`Model::set_contact_stiffness`]
/// gives out: small, so that all stays stable, and so that the other contacts are those of the whole model.
const PLANE_STIFFNESS: f64 = 0.1;

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
    fn distance(&self, point: Vec3) -> (f64, Vec3) {
        (
            point[self.0],
            std::array::from_fn(|c| f64::from(u8::from(c == self.0))),
        )
    }
}
