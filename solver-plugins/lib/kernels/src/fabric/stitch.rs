//! The stitch: straight pieces over the angle, for one sign of shear, failing for good.
//!
//! With the largest angle reached, m, as history: the first piece rises elastically from the onset
//! to the peak; beyond the peak the force follows the given curve while g grows, and unloads and
//! reloads along the straight line from the onset to the curve's point at m (secant damage). The
//! thesis does not define unloading. Since the curve does not rise after its peak, the secant only
//! falls as m grows: the energy held is never negative and what was lost never comes back.

use super::yarn::Angle;
use crate::Lanes;
use plyflow_fixed::FixedBits;

/// Most points of the curve.
pub(super) const MAX_POINTS: usize = 8;

/// A hinge of the curve: `slope * max(g - angle, 0)`.
#[derive(Clone, Copy, Debug, Default)]
struct Hinge {
    angle: f64,
    cosine: f64,
    slope: f64,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Stitch {
    /// +1: acts where g > 0; -1: where g < 0.
    sign: f64,
    onset: f64,
    onset_cosine: f64,
    peak: f64,
    peak_sine: f64,
    /// Slope of the rise (N/m per rad).
    pub rise: f64,
    hinges: [Hinge; MAX_POINTS],
    count: usize,
}

impl Stitch {
    /// From checked points: angles |g| (rad) increasing, forces (N/m) 0, largest, not rising, .., 0;
    /// `sign`: of the shear that stretches it.
    pub(super) fn new(sign: f64, angles: &[f64], forces: &[f64]) -> Self {
        let n = angles.len();
        let mut hinges = [Hinge::default(); MAX_POINTS];
        let mut before = 0.0;
        for i in 0..n {
            let after = if i + 1 < n {
                (forces[i + 1] - forces[i]) / (angles[i + 1] - angles[i])
            } else {
                0.0
            };
            let (angle, slope) = (angles[i], after - before);
            hinges[i] = Hinge {
                angle,
                cosine: angle.fixed_cos(),
                slope,
            };
            before = after;
        }
        Self {
            sign,
            onset: angles[0],
            onset_cosine: angles[0].fixed_cos(),
            peak: angles[1],
            peak_sine: angles[1].fixed_sin(),
            rise: forces[1] / (angles[1] - angles[0]),
            hinges,
            count: n,
        }
    }

    /// Whether the shear stretches the stitch.
    #[inline(always)]
    pub(super) fn stretched<V: Lanes>(&self, s: V) -> V::Mask {
        V::splat(0.0).lt(s * V::splat(self.sign))
    }

    /// Force (its size), energy held, and energy lost so far, at the largest angle `m`.
    #[inline(always)]
    pub(super) fn response<V: Lanes>(
        &self,
        stretched: V::Mask,
        a: &Angle<V>,
        m: V,
        m_sine: V,
    ) -> (V, V, V) {
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        // Secant from the onset to the curve at the largest angle, which is the rise up to the peak.
        let e = m.max(V::splat(self.peak));
        let e_sine = m_sine.max(V::splat(self.peak_sine));
        let e_cosine = (one - e_sine * e_sine).sqrt();
        let (mut height, mut work) = (zero, zero);
        for h in &self.hinges[..self.count] {
            let x = (e - V::splat(h.angle)).max(zero);
            let slope = V::splat(h.slope);
            height = height + slope * x;
            let moment = x * e_sine + e_cosine - V::splat(h.cosine);
            work = work + V::select(zero.lt(x), slope * moment, zero);
        }
        let (onset, onset_cosine) = (V::splat(self.onset), V::splat(self.onset_cosine));
        let secant = height.max(zero) / (e - onset);
        let lost = work - secant * ((e - onset) * e_sine + e_cosine - onset_cosine);
        let x = V::select(stretched, (a.g - onset).max(zero), zero);
        let held = V::select(
            zero.lt(x),
            secant * (x * a.sine + a.cosine - onset_cosine),
            zero,
        );
        (secant * x, held, lost)
    }
}
