//! What holds, drives and presses a model.

use crate::sheet::Pressures;
use crate::vec3::{Vec3, add, dot, scale, sub};
use serde::{Deserialize, Serialize};

/// What holds, drives and presses.
pub(super) struct Boundary {
    /// Pressures, set before each step.
    pub pressures: Pressures,
    /// The pressure above (Pa) in the last step.
    pub last_above: f64,
    /// Acceleration of free fall (m/s2), global axes.
    pub body_acceleration: Vec3,
    /// What the nodal loads are multiplied by.
    pub load_factor: f64,
    pub loads: Loads,
    pub supports: Supports,
    /// `[n]` how a node is held.
    pub held: Vec<Held>,
    /// Driven nodes, in the order of [`Drive::position`].
    pub driven: Vec<u32>,
    pub drive: Option<Box<dyn Drive>>,
    pub anchors: Anchors,
    /// `[n]` pressure, weight and nodal loads (N): what does external work on free nodes. Empty when nothing acts.
    pub external_force: Vec<Vec3>,
}

/// How a node is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Held {
    /// Moves freely.
    Free,
    /// Follows the position given by [`Drive`].
    Driven,
}

/// Components (global axes) of a node's motion that are held at zero.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Fixed {
    /// Translations along x, y, z.
    pub translations: [bool; 3],
    /// Rotations about x, y, z.
    pub rotations: [bool; 3],
}

impl Fixed {
    #[inline(always)]
    fn keep(held: [bool; 3], v: Vec3) -> Vec3 {
        std::array::from_fn(|c| if held[c] { 0.0 } else { v[c] })
    }

    /// The free part of a velocity.
    #[inline(always)]
    pub(super) fn translation(&self, v: Vec3) -> Vec3 {
        Self::keep(self.translations, v)
    }

    /// The free part of a spin.
    #[inline(always)]
    pub(super) fn rotation(&self, v: Vec3) -> Vec3 {
        Self::keep(self.rotations, v)
    }
}

/// Gives the positions of the driven nodes.
pub trait Drive: Send + Sync {
    /// Writes the position (m) at time `t` (s) of driven node `k`, in the order of
    /// [`super::Model::set_driven`].
    fn position(&self, k: usize, t: f64) -> Vec3;

    /// Spin (rad/s, global axes) of driven node `k` at time `t` (s), for sheets whose nodes rotate;
    /// `None`: its rotation is free.
    fn spin(&self, _k: usize, _t: f64) -> Option<Vec3> {
        None
    }

    /// How driven node `k` is held at time `t` (s), if it may go off its position along its sheet; `None`: it may not.
    fn hold(&self, _k: usize, _t: f64) -> Option<Hold> {
        None
    }
}

/// How a driven node is held that may go off the position of its [`Drive`], in a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hold {
    /// Force of what surrounds the model on the node while it is where [`super::Model::anchor`] found it; without that, at its position (N).
    pub pull: Vec3,
    /// By how much that force changes with the way off it (N/m).
    pub stiffness: f64,
    /// Unit normal of the plane.
    pub normal: Vec3,
}

/// Share of the way that a free node would go in a step from rest which a held one goes: it creeps to its balance and does not swing.
const EASE: f64 = 0.05;

/// From where the stiffness of held nodes counts.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Anchors {
    /// Whether nothing but their pull holds them.
    pub(super) loose: bool,
    /// `[driven]`; empty: each from the position of its drive.
    pub(super) at: Vec<Anchor>,
}

/// Where a held node has the pull of its surroundings.
#[derive(Clone, Copy, Default, Serialize, Deserialize)]
pub(super) struct Anchor {
    /// Way there from the position of its drive (m), in the plane of `normal`.
    pub(super) way: Vec3,
    /// Unit normal at the time when it was anchored.
    pub(super) normal: Vec3,
}

impl Anchor {
    /// The way there when the plane has turned to that of `normal`, by the shortest turn.
    fn turned(&self, normal: Vec3) -> Vec3 {
        let (from, to) = (self.normal, normal);
        // A plane that turns over keeps no direction in itself; none does that is on its way onto a tool.
        let cosine = (1.0 + dot(from, to)).max(LEAST_COSINE);
        sub(self.way, scale(add(from, to), dot(self.way, to) / cosine))
    }
}

/// Least `1 + cos` of a turn.
const LEAST_COSINE: f64 = 0.1;

impl Hold {
    /// Part of a vector along the plane.
    pub(super) fn in_plane(&self, a: Vec3) -> Vec3 {
        sub(a, scale(self.normal, dot(a, self.normal)))
    }

    /// How far (m) node `k` of the driven ones goes in a step, besides going with its drive, from which it is `way` (m) off. `force`: of
    /// the model on it (N); `mobility`: square of the step over its mass (m/N).
    pub(super) fn creep(
        &self,
        anchors: &Anchors,
        k: usize,
        way: Vec3,
        force: Vec3,
        mobility: f64,
    ) -> Vec3 {
        let stiffness = if anchors.loose { 0.0 } else { self.stiffness };
        let off = (anchors.at.get(k)).map_or(way, |a| sub(way, a.turned(self.normal)));
        let rest = sub(add(force, self.pull), scale(off, stiffness));
        let ease = EASE * mobility;
        // However stiff the surroundings are, they are not overshot.
        let ease = ease / (1.0 + ease * stiffness);
        scale(self.in_plane(rest), ease)
    }
}

/// A dead load at a node (global axes); [`super::Model::set_load_factor`] multiplies it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodalLoad {
    /// Node of the model.
    pub node: u32,
    /// Force (N).
    pub force: Vec3,
    /// Moment (N m); needs a sheet whose nodes rotate.
    pub moment: Vec3,
}

/// Dead loads by node.
#[derive(Default)]
pub(super) struct Loads {
    /// `[n]` (N), or empty without forces.
    pub(super) force: Vec<Vec3>,
    /// `[n]` (N m), or empty without moments.
    pub(super) moment: Vec<Vec3>,
}

/// What holds a model besides its drive.
#[derive(Default)]
pub(super) struct Supports {
    /// `[n]`, or empty when nothing is fixed.
    pub(super) fixed: Vec<Fixed>,
    /// By driven node: force of the support on it (N).
    pub(super) reaction: Vec<Vec3>,
    /// By driven node: moment of the support on it (N m).
    pub(super) reaction_moment: Vec<Vec3>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vec3::norm;

    #[test]
    fn what_a_node_is_off_turns_with_its_sheet() {
        let anchor = Anchor {
            way: [3e-4, 4e-4, 0.0],
            normal: [0.0, 0.0, 1.0],
        };
        // About y, which keeps y and turns x to -z.
        for angle in [0.0f64, 0.3, 1.5, -2.0] {
            let (s, c) = angle.sin_cos();
            let turned = anchor.turned([s, 0.0, c]);
            let expected = [3e-4 * c, 4e-4, -3e-4 * s];
            assert!(norm(sub(turned, expected)) < 1e-15, "{angle}: {turned:?}");
        }
        // Where it has turned over there is no shortest turn: nothing that is not finite.
        let over = anchor.turned([0.0, 0.0, -1.0]);
        assert_eq!(over, anchor.way);
    }
}
