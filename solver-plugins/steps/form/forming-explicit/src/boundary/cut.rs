//! How other runs drive nodes: those of the cut of a zone, or of the plies of a whole scene.

use crate::request::LocalSheet;
use plyflow_geometry::vec3::{Vec3, add, cross, dot, norm, scale, sub};
use plyflow_mechanics::history::{hermite, hermite_rate, locate};
use plyflow_mechanics::model::{Drive, Hold};

/// Cubic Hermite motion of given nodes through the frames of another run.
pub struct CutDrive {
    time: Vec<f64>,
    /// `[frames][driven]` (m).
    position: Vec<Vec<Vec3>>,
    /// `[frames][driven]` (m/s).
    velocity: Vec<Vec<Vec3>>,
    /// `[frames][driven]`; `None` where the other run tells no normal.
    normal: Vec<Vec<Option<[Vec3; 2]>>>,
    /// `[frames][driven]` (N); `None` where the cut gives no way.
    pull: Vec<Vec<Option<Vec3>>>,
    /// `[driven]` (N/m).
    stiffness: Vec<f64>,
}

impl CutDrive {
    /// Of other nodes through frames at these times (s); none yet.
    pub fn new(time: Vec<f64>) -> Self {
        let none = || vec![Vec::new(); time.len()];
        Self {
            position: none(),
            velocity: none(),
            normal: vec![Vec::new(); time.len()],
            pull: vec![Vec::new(); time.len()],
            stiffness: Vec::new(),
            time,
        }
    }

    /// Adds the driven nodes of a sheet, in their order.
    pub fn add(&mut self, sheet: &LocalSheet) {
        for f in 0..self.time.len() {
            self.position[f].extend_from_slice(&sheet.position[f]);
            self.velocity[f].extend_from_slice(&sheet.velocity[f]);
            let known = |k: usize| {
                Some([
                    *sheet.normal.get(f)?.get(k)?,
                    *sheet.normal_rate.get(f)?.get(k)?,
                ])
            };
            self.normal[f].extend((0..sheet.driven.len()).map(known));
            let pull = |k: usize| sheet.pull.get(f)?.get(k).copied();
            self.pull[f].extend((0..sheet.driven.len()).map(pull));
        }
        let stiffness = |k: usize| sheet.stiffness.get(k).copied().unwrap_or_default();
        (self.stiffness).extend((0..sheet.driven.len()).map(stiffness));
    }
}

impl Drive for CutDrive {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let (i, s) = locate(&self.time, t);
        let w = hermite(s, self.time[i + 1] - self.time[i]);
        let (p, q) = (self.position[i][k], self.position[i + 1][k]);
        let (u, v) = (self.velocity[i][k], self.velocity[i + 1][k]);
        [0, 1, 2].map(|c| w[0] * p[c] + w[1] * q[c] + w[2] * u[c] + w[3] * v[c])
    }

    /// Turns the node as the coarse surface's normal n turns, `n x n' / n^2`, and not about it.
    fn spin(&self, k: usize, t: f64) -> Option<Vec3> {
        let (i, s) = locate(&self.time, t);
        let h = self.time[i + 1] - self.time[i];
        if t < self.time[0] || t > self.time[self.time.len() - 1] {
            return self.normal[i][k].map(|_| [0.0; 3]);
        }
        let ([p, u], [q, v]) = (self.normal[i][k]?, self.normal[i + 1][k]?);
        let mix =
            |w: [f64; 4]| [0, 1, 2].map(|c| w[0] * p[c] + w[1] * q[c] + w[2] * u[c] + w[3] * v[c]);
        let (n, rate) = (mix(hermite(s, h)), mix(hermite_rate(s, h)));
        // Normals of neighbouring frames that are opposite tell no way to turn.
        let square = dot(n, n).max(MIN_NORMAL);
        Some(scale(cross(n, rate), 1.0 / square))
    }

    fn hold(&self, k: usize, t: f64) -> Option<Hold> {
        let (i, s) = locate(&self.time, t);
        let between = |a: Vec3, b: Vec3| add(a, scale(sub(b, a), s));
        let ([n, _], [m, _]) = (self.normal[i][k]?, self.normal[i + 1][k]?);
        let normal = between(n, m);
        Some(Hold {
            pull: between(self.pull[i][k]?, self.pull[i + 1][k]?),
            stiffness: self.stiffness[k],
            normal: scale(normal, 1.0 / norm(normal).max(MIN_NORMAL.sqrt())),
        })
    }
}

/// Least square of a normal between two frames.
const MIN_NORMAL: f64 = 0.01;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driven_node_turns_as_the_coarse_surface_does() {
        // The normal turns in the xz plane by a(t), faster and faster, over 1 s and 11 frames.
        let angle = |t: f64| 1.2 * t * t;
        let time: Vec<f64> = (0..11).map(|f| 0.1 * f64::from(f)).collect();
        let at = |t: &f64| {
            let (s, c) = angle(*t).sin_cos();
            let rate = 2.4 * t;
            vec![Some([[s, 0.0, c], [rate * c, 0.0, -rate * s]]), None]
        };
        let drive = CutDrive {
            position: vec![vec![[0.0; 3]; 2]; 11],
            velocity: vec![vec![[0.0; 3]; 2]; 11],
            normal: time.iter().map(at).collect(),
            ..CutDrive::new(time)
        };
        let (mut turned, steps) = (0.0, 1000);
        for k in 0..steps {
            let t = (f64::from(k) + 0.5) / f64::from(steps);
            let [x, y, z] = drive.spin(0, t).unwrap();
            assert!(x.abs() < 1e-12 && z.abs() < 1e-12);
            assert!((y - 2.4 * t).abs() < 2e-3, "{y} rad/s at {t} s");
            turned += y / f64::from(steps);
        }
        assert!((turned - angle(1.0)).abs() < 1e-5, "{turned} rad");
        assert_eq!(
            drive.spin(0, 1.5),
            Some([0.0; 3]),
            "after the last frame it rests"
        );
        assert_eq!(drive.spin(1, 0.5), None, "no normal: free");
    }
}
