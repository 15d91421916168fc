//! How the frame of a bag drives the edges of its films.

use crate::load::Cycle;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::model::Drive;

/// Stretches the films, then moves the frame straight down.
pub struct FrameDrive {
    /// `[k]` x, y of the frame's nodes (m).
    pub plan: Vec<[f64; 2]>,
    /// The process.
    pub cycle: Cycle,
}

impl Drive for FrameDrive {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let s = 1.0 + self.cycle.stretch(t);
        [
            s * self.plan[k][0],
            s * self.plan[k][1],
            self.cycle.frame_height(t),
        ]
    }
}
