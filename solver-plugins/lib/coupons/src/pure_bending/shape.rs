//! The folded strip.

use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::model::Drive;

/// Geometry of the folded strip.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shape {
    /// Length of an element along X (m).
    pub h: f64,
    /// Elements from the middle to an end.
    pub half: usize,
}

impl Shape {
    /// `[x, z, turn]` of column i: place (m) and turn about -y (rad) at the shear (rad) and curvature (1/m).
    pub fn column(&self, i: usize, shear: f64, curvature: f64) -> [f64; 3] {
        let j = i as f64 - self.half as f64;
        let delta = curvature * self.h / shear.fixed_cos();
        let chord = self.h * shear.fixed_cos();
        let (x, z) = if delta.abs() < 1e-9 {
            (j, 0.5 * j * j * delta)
        } else {
            let twice = 2.0 * (0.5 * delta).fixed_sin();
            // 1 - cos a as 2 sin^2(a / 2): no cancellation.
            let s = (0.5 * j * delta).fixed_sin();
            ((j * delta).fixed_sin() / twice, 2.0 * s * s / twice)
        };
        [chord * x, chord * z, j * delta]
    }
}

/// Shear and curvature over time.
#[derive(Debug, Clone)]
pub(super) struct History {
    pub shear: f64,
    pub shear_time: f64,
    pub curvatures: Vec<f64>,
    pub leg: f64,
}

impl History {
    /// When bending begins (s).
    pub fn begin(&self) -> f64 {
        self.shear_time
    }

    pub fn duration(&self) -> f64 {
        self.shear_time + self.leg * (self.curvatures.len() - 1) as f64
    }

    /// Shear (rad) and curvature (1/m).
    pub fn at(&self, t: f64) -> (f64, f64) {
        let mut k = 0.0;
        for (i, w) in self.curvatures.windows(2).enumerate() {
            k += (w[1] - w[0]) * smooth_step(t, self.shear_time + self.leg * i as f64, self.leg);
        }
        (self.shear * smooth_step(t, 0.0, self.shear_time), k)
    }
}

/// Moves the driven nodes.
pub(super) struct Roll {
    pub shape: Shape,
    pub history: History,
    /// Column and Y (m) of each driven node.
    pub nodes: Vec<(usize, f64)>,
}

impl Drive for Roll {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let (i, y) = self.nodes[k];
        let (shear, curvature) = self.history.at(t);
        let [x, z, _] = self.shape.column(i, shear, curvature);
        let along = self.shape.h * (i as f64 - self.shape.half as f64);
        [x, y + along * shear.fixed_sin(), z]
    }

    fn spin(&self, k: usize, t: f64) -> Option<Vec3> {
        let small = 1e-6 * self.history.leg;
        let turn = |t: f64| {
            let (shear, curvature) = self.history.at(t);
            self.shape.column(self.nodes[k].0, shear, curvature)[2]
        };
        Some([
            0.0,
            -(turn(t + small) - turn(t - small)) / (2.0 * small),
            0.0,
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folding_keeps_lengths_and_turns_each_element_by_the_same_angle() {
        let shape = Shape { h: 0.002, half: 15 };
        for (shear, k) in [(0.0, 50.0), (0.5, -40.0), (-0.5, 1e-8)] {
            let place = |i| shape.column(i, shear, k);
            for i in 0..30 {
                let (a, b) = (place(i), place(i + 1));
                let chord = (b[0] - a[0]).hypot(b[1] - a[1]);
                assert!((chord - 0.002 * shear.cos()).abs() < 1e-15);
                let angle = (b[1] - a[1]).atan2(b[0] - a[0]);
                assert!((angle - 0.5 * (a[2] + b[2])).abs() < 1e-12);
                // Normal curvature of the bent family: turn per length times cos^2 of its angle to the arc.
                let turned = (b[2] - a[2]) / chord * shear.cos() * shear.cos();
                assert!((turned - k).abs() < 1e-9 * k.abs().max(1.0));
            }
        }
    }
}
