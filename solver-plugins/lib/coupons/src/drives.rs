//! How grips and clamps of several tests move.

use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::model::Drive;

/// Nodes that stay where they are and do not turn.
pub struct Held {
    /// Their places (m).
    pub places: Vec<Vec3>,
}

impl Drive for Held {
    fn position(&self, k: usize, _t: f64) -> Vec3 {
        self.places[k]
    }

    fn spin(&self, _k: usize, _t: f64) -> Option<Vec3> {
        Some([0.0; 3])
    }
}

/// The two ends of a specimen, each of which goes half of a way along x: away from each other, or with a way below 0 towards each other.
pub struct Ends {
    /// Places of their nodes at the start (m).
    pub places: Vec<Vec3>,
    /// x between the ends (m).
    pub middle: f64,
    /// How far both together go (m).
    pub way: f64,
    /// In what time (s), with [`smooth_step`].
    pub time: f64,
    /// Whether the nodes of the ends do not turn; else their rotation is free.
    pub clamped: bool,
}

impl Drive for Ends {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let half = 0.5 * self.way * smooth_step(t, 0.0, self.time);
        let [x, y, z] = self.places[k];
        [if x > self.middle { x + half } else { x - half }, y, z]
    }

    fn spin(&self, _k: usize, _t: f64) -> Option<Vec3> {
        self.clamped.then_some([0.0; 3])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_share_their_way_and_keep_their_middle() {
        let ends = |way, clamped| Ends {
            places: vec![[0.1, 0.0, 0.0], [0.3, 0.01, 0.0]],
            middle: 0.2,
            way,
            time: 2.0,
            clamped,
        };
        let apart = ends(0.02, false);
        for t in [0.0, 0.7, 2.0, 3.0] {
            let [left, right] = [0, 1].map(|k| apart.position(k, t));
            let way = 0.02 * smooth_step(t, 0.0, 2.0);
            assert!((right[0] - left[0] - 0.2 - way).abs() < 1e-15);
            assert!((right[0] + left[0] - 0.4).abs() < 1e-15);
            assert_eq!((left[1], right[1]), (0.0, 0.01));
        }
        assert_eq!(apart.spin(0, 1.0), None);
        let together = ends(-0.02, true);
        assert_eq!(together.position(1, 2.0), [0.29, 0.01, 0.0]);
        assert_eq!(together.spin(1, 1.0), Some([0.0; 3]));
    }
}
