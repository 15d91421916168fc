//! Small dense matrices and vectors.

use plyflow_fixed::FixedBits;

// The door stands below `solver-plugins/lib`, so it does not take these from there.
pub(crate) type Vec3 = [f64; 3];

pub(crate) fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn cross(a: Vec3, b: Vec3) -> Vec3 {
    let [i, j, k] = [[1, 2], [2, 0], [0, 1]].map(|[p, q]| a[p] * b[q] - a[q] * b[p]);
    [i, j, k]
}

/// The rotation by the vector `w` (rad), row by row (Rodrigues).
pub(crate) fn rotation(w: Vec3) -> [Vec3; 3] {
    let angle = dot(w, w).sqrt();
    let n = w.map(|c| c / angle.max(f64::MIN_POSITIVE));
    let (s, c) = angle.fixed_sin_cos();
    let k = [[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]];
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            let own = if i == j { c } else { 0.0 };
            own + (1.0 - c) * n[i] * n[j] + s * k[i][j]
        })
    })
}

pub(crate) fn turn(q: &[Vec3; 3], v: Vec3) -> Vec3 {
    q.map(|row| dot(row, v))
}

/// Largest eigenvalue of the symmetric part of `a` (`[n][n]`).
pub(crate) fn largest_eigenvalue(a: &[f64], n: usize) -> f64 {
    largest_eigenpair(a, n).0
}

/// Largest eigenvalue of the symmetric part of `a` (`[n][n]`) and its unit vector, by cyclic Jacobi rotations.
pub(crate) fn largest_eigenpair(a: &[f64], n: usize) -> (f64, Vec<f64>) {
    let mut vectors: Vec<f64> = (0..n * n)
        .map(|i| f64::from(u8::from(i / n == i % n)))
        .collect();
    let mut s = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            s[i * n + j] = 0.5 * (a[i * n + j] + a[j * n + i]);
        }
    }
    for _ in 0..30 {
        let mut off = 0.0f64;
        for p in 0..n {
            for q in p + 1..n {
                let x = s[p * n + q];
                if x == 0.0 {
                    continue;
                }
                off = off.max(x.abs());
                let theta = (s[q * n + q] - s[p * n + p]) / (2.0 * x);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let d = t * c;
                for k in 0..n {
                    let (u, v) = (s[k * n + p], s[k * n + q]);
                    (s[k * n + p], s[k * n + q]) = (c * u - d * v, d * u + c * v);
                }
                for k in 0..n {
                    let (u, v) = (s[p * n + k], s[q * n + k]);
                    (s[p * n + k], s[q * n + k]) = (c * u - d * v, d * u + c * v);
                }
                for k in 0..n {
                    let (u, v) = (vectors[k * n + p], vectors[k * n + q]);
                    (vectors[k * n + p], vectors[k * n + q]) = (c * u - d * v, d * u + c * v);
                }
            }
        }
        let scale = (0..n).fold(0.0f64, |m, i| m.max(s[i * n + i].abs()));
        if off <= 1e-13 * scale {
            break;
        }
    }
    let larger = |i: usize, j: usize| if s[i * n + i] >= s[j * n + j] { i } else { j };
    let at = (1..n).fold(0, larger);
    let vector = (0..n).map(|k| vectors[k * n + at]).collect();
    (s[at * n + at], vector)
}

/// Spectral norm of a 3 x 3 matrix.
pub(crate) fn norm(b: &[Vec3; 3]) -> f64 {
    let mut square = [0.0; 9];
    for i in 0..3 {
        for j in 0..3 {
            square[3 * i + j] = (0..3).map(|k| b[k][i] * b[k][j]).sum();
        }
    }
    largest_eigenvalue(&square, 3).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_largest_eigenvalue_of_a_chain_is_the_known_one() {
        // Springs and equal masses with fixed ends: 2 - 2 cos(n pi / (n + 1)).
        let n = 12;
        let mut a = vec![0.0; n * n];
        for i in 0..n {
            a[i * n + i] = 2.0;
            if i + 1 < n {
                a[i * n + i + 1] = -1.0;
                a[(i + 1) * n + i] = -1.0;
            }
        }
        let want = 2.0 - 2.0 * (n as f64 * std::f64::consts::PI / (n as f64 + 1.0)).cos();
        let (value, v) = largest_eigenpair(&a, n);
        assert!((value - want).abs() < 1e-12);
        for i in 0..n {
            let row: f64 = (0..n).map(|j| a[i * n + j] * v[j]).sum();
            assert!((row - value * v[i]).abs() < 1e-12, "its vector");
        }
    }

    #[test]
    fn a_rotation_keeps_lengths_and_has_norm_one() {
        let q = rotation([0.3, -1.2, 2.0]);
        assert!((norm(&q) - 1.0).abs() < 1e-12);
        let v = turn(&q, [0.3, -1.2, 2.0]);
        assert!((v[1] + 1.2).abs() < 1e-12, "the axis stays");
    }
}
