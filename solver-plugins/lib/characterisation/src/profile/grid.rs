//! Functions on [0, 1] at evenly spaced stations, integrals of them, and Legendre polynomials.

/// Number of panels of Simpson's rule; there is a station at both ends and in the middle of each.
const PANELS: usize = 200;

/// The stations.
pub struct Grid {
    /// Places in [0, 1].
    pub at: Vec<f64>,
}

impl Grid {
    /// The one grid.
    pub fn new() -> Self {
        let n = 2 * PANELS;
        Self {
            at: (0..=n).map(|i| i as f64 / n as f64).collect(),
        }
    }

    /// Integrals from 0 to each station of a function given at the stations, exact for parabolas over each
    /// panel.
    pub fn integral(&self, f: &[f64]) -> Vec<f64> {
        let h = 1.0 / PANELS as f64;
        let mut sums = vec![0.0; f.len()];
        for p in 0..PANELS {
            let i = 2 * p;
            let (a, b, c) = (f[i], f[i + 1], f[i + 2]);
            sums[i + 1] = sums[i] + h / 24.0 * (5.0 * a + 8.0 * b - c);
            sums[i + 2] = sums[i] + h / 6.0 * (a + 4.0 * b + c);
        }
        sums
    }

    /// Integrals from 0 to each station of a smooth function, by three Gauss points between stations.
    pub fn integral_of(&self, f: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut sums = vec![0.0; self.at.len()];
        let half = 0.5 * self.at[1];
        let offset = half * 0.6f64.sqrt();
        for i in 1..self.at.len() {
            let middle = self.at[i] - half;
            let part = 5.0 * f(middle - offset) + 8.0 * f(middle) + 5.0 * f(middle + offset);
            sums[i] = sums[i - 1] + half / 9.0 * part;
        }
        sums
    }
}

/// Legendre polynomial of degree `n` on [0, 1] (argument `2 t - 1`), with its first and second derivatives
/// with respect to `t`.
pub fn legendre(n: usize, t: f64) -> [f64; 3] {
    let u = 2.0 * t - 1.0;
    let (mut before, mut now) = ([0.0; 3], [1.0, 0.0, 0.0]);
    for k in 0..n {
        let k = k as f64;
        let (a, b) = ((2.0 * k + 1.0) / (k + 1.0), k / (k + 1.0));
        let next = [
            a * u * now[0] - b * before[0],
            a * (2.0 * now[0] + u * now[1]) - b * before[1],
            a * (4.0 * now[1] + u * now[2]) - b * before[2],
        ];
        (before, now) = (now, next);
    }
    now
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrals_and_legendre_polynomials_are_those_of_the_tables() {
        let grid = Grid::new();
        let f: Vec<f64> = grid.at.iter().map(|t| (3.0 * t).cos()).collect();
        for (i, v) in grid.integral(&f).iter().enumerate() {
            assert!((v - (3.0 * grid.at[i]).sin() / 3.0).abs() < 1e-9);
        }
        for (i, v) in grid.integral_of(|t| (3.0 * t).cos()).iter().enumerate() {
            assert!((v - (3.0 * grid.at[i]).sin() / 3.0).abs() < 1e-13);
        }
        // P3(u) = (5 u^3 - 3 u) / 2 at u = 0.4, t = 0.7: d/dt = 2 (15 u^2 - 3) / 2, d2/dt2 = 4 * 15 u.
        let p = legendre(3, 0.7);
        for (a, b) in p.iter().zip([-0.44, -0.6, 24.0]) {
            assert!((a - b).abs() < 1e-12, "{p:?}");
        }
    }
}
