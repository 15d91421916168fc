//! The inextensible elastica between two clamps that come together: load and amplitude over the end shortening.
//!
//! The clamped strip of length L consists of four pieces of the pinned elastica's half (Love, A Treatise on the Mathematical Theory of
//! Elasticity, art. 263; Bazant and Cedolin, Stability of Structures, section 1.9). With the modulus k of complete elliptic integrals
//! K(k) and E(k): shortening 2 (1 - E/K), load over Euler's (2 K / pi)^2, amplitude over length k / K.

use std::f64::consts::PI;

/// A state of the elastica, without units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Load over Euler's load 4 pi^2 B / L^2.
    pub load: f64,
    /// Height of the middle over the length.
    pub amplitude: f64,
}

/// Complete elliptic integrals of the first and second kind of modulus `k` in 0..1, by the arithmetic-geometric mean.
fn complete(k: f64) -> (f64, f64) {
    let (mut a, mut g, mut c) = (1.0, (1.0 - k * k).sqrt(), k);
    let (mut sum, mut power) = (0.5 * c * c, 0.5);
    while c.abs() > 1e-16 {
        c = 0.5 * (a - g);
        (a, g) = (0.5 * (a + g), (a * g).sqrt());
        power *= 2.0;
        sum += power * c * c;
    }
    let first = PI / (2.0 * a);
    (first, first * (1.0 - sum))
}

/// The state at an end shortening (over the length, 0 to 0.9).
pub fn at(shortening: f64) -> State {
    let (mut low, mut high) = (0.0, 0.999_9);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        let (first, second) = complete(middle);
        if 2.0 * (1.0 - second / first) < shortening {
            low = middle;
        } else {
            high = middle;
        }
    }
    let k = 0.5 * (low + high);
    let (first, _) = complete(k);
    State {
        load: (2.0 * first / PI) * (2.0 * first / PI),
        amplitude: k / first,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elliptic_integrals_are_those_of_tables() {
        // Abramowitz and Stegun, table 17.1, m = k^2 = 0.5.
        let (first, second) = complete(0.5_f64.sqrt());
        assert!((first - 1.854_074_677_301_372).abs() < 1e-14, "{first}");
        assert!((second - 1.350_643_881_047_676).abs() < 1e-14, "{second}");
    }

    #[test]
    fn at_40_per_cent_the_load_is_1_2588_of_eulers_and_the_amplitude_0_3487_of_the_length() {
        let state = at(0.4);
        assert!((state.load - 1.2588).abs() < 5e-5, "{}", state.load);
        assert!(
            (state.amplitude - 0.3487).abs() < 5e-5,
            "{}",
            state.amplitude
        );
    }

    #[test]
    fn a_little_shortened_it_is_a_cosine_under_eulers_load() {
        // Amplitude a (1 - cos) / 2: shortening (pi a)^2 / 4 over L^2.
        let state = at(1e-4);
        assert!((state.load - 1.0).abs() < 1e-4);
        let cosine = (4.0 * 1e-4_f64).sqrt() / PI;
        assert!((state.amplitude / cosine - 1.0).abs() < 1e-4);
    }

    /// Rolls the quarter out by steps: `B theta'' = -P sin(theta)` from the clamp to the inflection, by the classic Runge-Kutta method.
    #[test]
    fn another_method_gives_the_same_state() {
        let quarter = |load: f64, curvature: f64| {
            // Length 1, so that Euler's load over B is (2 pi)^2; a quarter of the strip from the clamp (theta = 0).
            let p = load * 4.0 * PI * PI;
            let slope = |[t, c, _, _]: [f64; 4]| [c, -p * t.sin(), t.cos(), t.sin()];
            let (n, mut s) = (4000, [0.0, curvature, 0.0, 0.0]);
            let h = 0.25 / f64::from(n);
            let step = |s: [f64; 4], k: [f64; 4], f: f64| std::array::from_fn(|i| s[i] + f * k[i]);
            for _ in 0..n {
                let a = slope(s);
                let b = slope(step(s, a, 0.5 * h));
                let c = slope(step(s, b, 0.5 * h));
                let d = slope(step(s, c, h));
                s = std::array::from_fn(|i| s[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
            }
            s
        };
        let state = at(0.3);
        // The curvature at the clamp for which the quarter ends without one.
        let (mut low, mut high) = (0.1, 30.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if quarter(state.load, middle)[1] > 0.0 {
                high = middle;
            } else {
                low = middle;
            }
        }
        let [_, _, x, z] = quarter(state.load, 0.5 * (low + high));
        assert!((1.0 - 4.0 * x - 0.3).abs() < 1e-7, "{x}");
        assert!((2.0 * z - state.amplitude).abs() < 1e-7, "{z}");
    }
}
