//! Friction between yarns: what a cycle of shear or of bending does not give back.
//!
//! A slider on a spring, beside the law (Prandtl): the force follows `stiffness` times what the deformation is away from where the
//! slider stands, up to the `limit`; beyond it the slider moves along. The law itself is then the middle of a measured loop, and the
//! limit half of its width (2HG and 2HB of Kawabata's tests are twice that). A cycle between two deformations that are `w` apart costs
//! `4 limit (w / 2 - limit / stiffness)`, if it is wide enough to slide. What sliding costs is counted, so that the energy that a law
//! tells is all the work that was done on it.

use crate::Lanes;

/// Rows of history: where the slider stands, and the energy lost so far.
pub(super) const HISTORY: usize = 2;

/// A slider on its spring, for shear over the sine of the shear angle (N/m), for bending over the curvature (N, N m).
#[derive(Clone, Copy, Debug)]
pub(super) struct Slider {
    pub limit: f64,
    pub stiffness: f64,
    /// By how much the limit grows with the tension of both families (1); 0 for bending.
    pub per_tension: f64,
}

/// What a slider answers.
#[derive(Clone, Copy)]
pub(super) struct Slid<V> {
    /// Force, with its sign.
    pub force: V,
    /// Held in the spring and lost so far.
    pub energy: V,
    /// The history after it.
    pub stands: V,
    pub lost: V,
}

impl Slider {
    /// At the deformation `x`; `tension`: of both families together, not below 0 (N/m).
    #[inline(always)]
    pub(super) fn at<V: Lanes>(&self, x: V, tension: V, stands: V, lost: V) -> Slid<V> {
        let (stiffness, limit) = (
            V::splat(self.stiffness),
            V::splat(self.limit) + V::splat(self.per_tension) * tension,
        );
        let force = (stiffness * (x - stands)).max(-limit).min(limit);
        let spring = force * V::splat(1.0 / self.stiffness);
        let now = x - spring;
        // Sliding goes the way of the force: nothing comes back. Where it does not slide rounding must not cost anything.
        let slid = (force * (now - stands)).max(V::splat(0.0));
        let slides = limit.lt((stiffness * (x - stands)).abs());
        let lost = lost + V::select(slides, slid, V::splat(0.0));
        Slid {
            force,
            energy: V::splat(0.5) * force * spring + lost,
            stands: V::select(slides, now, stands),
            lost,
        }
    }
}
