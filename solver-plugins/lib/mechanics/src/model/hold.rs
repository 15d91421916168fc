//! Driven nodes that may go off their drive: what surrounds the model pulls at them and holds them.

use super::*;
use serde::{Deserialize, Serialize};

/// How a driven node is held that may go off the position of its [`Drive`], in a plane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hold {
    /// Force of what surrounds the model on the node while it is where [`Model::anchor`] found it; without that, at its position (N).
    pub pull: V,
    /// By how much that force changes with the way off it (N/m).
    pub stiffness: f64,
    /// Unit normal of the plane.
    pub normal: V,
}

/// Share of the way that a free node would go in a step from rest which a held one goes: it creeps to its balance and does not swing.
const EASE: f64 = 0.05;

/// From where the stiffness of held nodes counts.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct Anchors {
    /// Whether nothing but their pull holds them.
    loose: bool,
    /// `[driven]`; empty: each from the position of its drive.
    at: Vec<Anchor>,
}

/// Where a held node has the pull of its surroundings.
#[derive(Clone, Copy, Default, Serialize, Deserialize)]
struct Anchor {
    /// Way there from the position of its drive (m), in the plane of `normal`.
    way: V,
    /// Unit normal at the time when it was anchored.
    normal: V,
}

impl Anchor {
    /// The way there when the plane has turned to that of `normal`, by the shortest turn.
    fn turned(&self, normal: V) -> V {
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
    pub(super) fn in_plane(&self, a: V) -> V {
        sub(a, scale(self.normal, dot(a, self.normal)))
    }

    /// How far (m) node `k` of the driven ones goes in a step, besides going with its drive, from which it is `way` (m) off. `force`: of
    /// the model on it (N); `mobility`: square of the step over its mass (m/N).
    pub(super) fn creep(&self, anchors: &Anchors, k: usize, way: V, force: V, mobility: f64) -> V {
        let stiffness = if anchors.loose { 0.0 } else { self.stiffness };
        let off = (anchors.at.get(k)).map_or(way, |a| sub(way, a.turned(self.normal)));
        let rest = sub(add(force, self.pull), scale(off, stiffness));
        let ease = EASE * mobility;
        // However stiff the surroundings are, they are not overshot.
        let ease = ease / (1.0 + ease * stiffness);
        scale(self.in_plane(rest), ease)
    }
}

impl Model {
    /// Lets held nodes go with the pull of their surroundings alone, whatever their stiffness, until [`Model::anchor`].
    pub fn loosen(&mut self) {
        self.boundary.anchors.loose = true;
    }

    /// Ends what [`Model::loosen`] began: the stiffness of held nodes counts from where they are now, off the positions of their
    /// drive. So what the drive has wrong now is no force, only what it does wrong from now on.
    pub fn anchor(&mut self) {
        let Some(drive) = &self.boundary.drive else {
            return;
        };
        let at = |(k, n): (usize, &u32)| {
            let hold = drive.hold(k, self.state.time);
            hold.map_or(Anchor::default(), |hold| Anchor {
                way: hold.in_plane(sub(
                    self.state.x[*n as usize],
                    drive.position(k, self.state.time),
                )),
                normal: hold.normal,
            })
        };
        self.boundary.anchors = Anchors {
            loose: false,
            at: self.boundary.driven.iter().enumerate().map(at).collect(),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
