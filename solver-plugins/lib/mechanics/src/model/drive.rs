//! Driven nodes: several drives of one model, and nodes that may go off theirs.

use super::boundary::{Anchor, Anchors, Drive, Held, Hold};
use super::parts::Model;
use crate::vec3::{Vec3, sub};

impl Model {
    /// Drives further nodes, which no drive has yet, besides those that are driven already.
    pub fn drive_also(&mut self, nodes: Vec<u32>, drive: Box<dyn Drive>) {
        let mut all = std::mem::take(&mut self.boundary.driven);
        let first = all.len();
        all.extend(nodes);
        let drive: Box<dyn Drive> = match self.boundary.drive.take() {
            None => drive,
            Some(old) => Box::new(Both {
                old,
                first,
                new: drive,
            }),
        };
        self.set_driven(all, drive);
    }

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

    /// Whether a node follows a drive.
    pub fn is_driven(&self, node: u32) -> bool {
        self.boundary.held[node as usize] == Held::Driven
    }
}

/// Two drives, of nodes that lie one after the other.
struct Both {
    old: Box<dyn Drive>,
    /// How many nodes the old one has.
    first: usize,
    new: Box<dyn Drive>,
}

impl Drive for Both {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        match k.checked_sub(self.first) {
            None => self.old.position(k, t),
            Some(k) => self.new.position(k, t),
        }
    }

    fn spin(&self, k: usize, t: f64) -> Option<Vec3> {
        match k.checked_sub(self.first) {
            None => self.old.spin(k, t),
            Some(k) => self.new.spin(k, t),
        }
    }

    fn hold(&self, k: usize, t: f64) -> Option<Hold> {
        match k.checked_sub(self.first) {
            None => self.old.hold(k, t),
            Some(k) => self.new.hold(k, t),
        }
    }
}
