//! The random out-of-plane shape of a specimen.

use plyflow_fixed::FixedBits;
use std::f64::consts::{PI, TAU};

/// Half waves along the length, at most: about the width of a wrinkle on a specimen twice as long as wide.
const ALONG: usize = 16;
/// Half waves across the width, at most.
const ACROSS: usize = 8;

/// A sum of standing waves with random amplitudes, scaled to a largest size of 1: zero at the clamps, free at the
/// long edges. It does not depend on the mesh. Half waves shorter than 1/16 of the length are left out: noise from
/// node to node would be another imperfection on every mesh.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    length: f64,
    width: f64,
    /// `[ALONG][ACROSS + 1]`.
    amplitudes: Vec<f64>,
}

/// The generator SplitMix64 (Steele, Lea, Flood 2014); the next number in -1..1.
fn next(state: &mut u64) -> f64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    (z >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

impl Shape {
    /// The shape of a seed for a specimen of a length (from x = 0) and width (about y = 0), m.
    pub fn new(seed: u64, length: f64, width: f64) -> Self {
        let mut state = seed;
        let count = ALONG * (ACROSS + 1);
        let mut shape = Self {
            length,
            width,
            amplitudes: (0..count).map(|_| next(&mut state)).collect(),
        };
        // Largest size over points that do not depend on the mesh.
        let mut most: f64 = 0.0;
        for i in 0..=4 * ALONG {
            for j in 0..=4 * ACROSS {
                let x = length * i as f64 / (4 * ALONG) as f64;
                let y = width * (j as f64 / (4 * ACROSS) as f64 - 0.5);
                most = most.max(shape.at(x, y).abs());
            }
        }
        for a in &mut shape.amplitudes {
            *a /= most;
        }
        shape
    }

    /// Value at a place (m); zero in the clamps.
    pub fn at(&self, x: f64, y: f64) -> f64 {
        if x <= 0.0 || x >= self.length {
            return 0.0;
        }
        let mut sum = 0.0;
        for m in 0..ALONG {
            let along = (PI * (m + 1) as f64 * x / self.length).fixed_sin();
            for n in 0..=ACROSS {
                let across = (0.5 * TAU * n as f64 * (y / self.width + 0.5)).fixed_cos();
                sum += self.amplitudes[m * (ACROSS + 1) + n] * along * across;
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shape_has_size_one_and_another_seed_another_shape() {
        let (a, b) = (Shape::new(1, 0.2, 0.1), Shape::new(2, 0.2, 0.1));
        let mut most: f64 = 0.0;
        for i in 0..=400 {
            for j in 0..=200 {
                let (x, y) = (
                    0.2 * f64::from(i) / 400.0,
                    0.1 * (f64::from(j) / 200.0 - 0.5),
                );
                most = most.max(a.at(x, y).abs());
            }
        }
        assert!((1.0..1.1).contains(&most), "{most}");
        assert!((a.at(0.11, 0.02) - b.at(0.11, 0.02)).abs() > 1e-3);
        assert_eq!((a.at(0.0, 0.01), a.at(0.2, 0.01)), (0.0, 0.0));
        assert_eq!(
            a.at(0.07, 0.03).to_bits(),
            Shape::new(1, 0.2, 0.1).at(0.07, 0.03).to_bits()
        );
    }
}
