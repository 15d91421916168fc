//! Several drives of one model.

use super::*;

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
    fn position(&self, k: usize, t: f64) -> V {
        match k.checked_sub(self.first) {
            None => self.old.position(k, t),
            Some(k) => self.new.position(k, t),
        }
    }

    fn spin(&self, k: usize, t: f64) -> Option<V> {
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
