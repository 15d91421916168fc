//! Derivatives of an energy that may have kinks, from differences.

use crate::run::worse;

/// Differences of an energy on both sides of a state.
///
/// An energy that is computed as a difference of large terms is noisy: the noise over a small step is an error of its
/// derivative. A large step bends, and may reach over a kink. So there are three. A right derivative is right by one of
/// them, a wrong one by none.
pub(crate) struct Energies {
    /// The steps, rising.
    pub(crate) widths: [f64; 3],
    pub(crate) at: f64,
    /// By each of the steps forwards, and back.
    pub(crate) up: [f64; 3],
    pub(crate) down: [f64; 3],
}

impl Energies {
    /// The derivatives. Each comes as two numbers that both have to be right: the same central difference twice, or the
    /// derivatives to either side. Where a stiffness jumps (fibres between tension and compression, what has just failed
    /// or slipped) the sides know better: each is of second order by itself, and the central difference only of first.
    fn derivatives(&self) -> [[f64; 2]; 5] {
        let w = self.widths;
        let central = |i: usize| [(self.up[i] - self.down[i]) / (2.0 * w[i]); 2];
        let side = |i: usize, energies: &[f64; 3]| {
            let (a, b) = (w[i], w[i + 1]);
            let [near, far] = [energies[i], energies[i + 1]].map(|e| e - self.at);
            (near * b / a - far * a / b) / (b - a)
        };
        let sides = |i: usize| [side(i, &self.up), -side(i, &self.down)];
        [central(0), central(1), central(2), sides(0), sides(1)]
    }

    /// The derivative, times `factor`, that is nearest to what was given.
    pub(crate) fn nearest(&self, factor: f64, given: f64) -> f64 {
        let off = |x: f64| (given - x).abs();
        let farther = |[a, b]: [f64; 2]| {
            let [a, b] = [factor * a, factor * b];
            if worse(off(a), off(b)) { a } else { b }
        };
        let [first, more @ ..] = self.derivatives().map(farther);
        let nearer = |a: f64, b: f64| if worse(off(a), off(b)) { b } else { a };
        more.into_iter().fold(first, nearer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(energy: impl Fn(f64) -> f64) -> Energies {
        let widths = [1e-6, 1e-5, 1e-4];
        Energies {
            widths,
            at: energy(0.0),
            up: widths.map(&energy),
            down: widths.map(|h| energy(-h)),
        }
    }

    #[test]
    fn at_a_jump_of_the_stiffness_the_sides_give_the_derivative_and_a_central_difference_does_not()
    {
        let e = of(|x| 3.0 * x + 0.5 * x * x * if x > 0.0 { 1e6 } else { 1e4 });
        assert!((e.derivatives()[0][0] - 3.0).abs() > 0.2);
        assert!((e.nearest(1.0, 3.0) - 3.0).abs() < 1e-6);
        assert!((e.nearest(2.0, 6.0) - 6.0).abs() < 1e-6);
    }

    #[test]
    fn a_jump_of_the_derivative_itself_is_right_for_nobody() {
        let e = of(|x| if x > 0.0 { 4.0 * x } else { 2.0 * x });
        for given in [2.0, 4.0] {
            assert!((e.nearest(1.0, given) - given).abs() > 0.9, "{given}");
        }
    }
}
