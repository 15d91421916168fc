//! Fibres that are softer in compression by a curve: stiff at first, then they buckle within the ply.

use super::cubic::Cubic;
use crate::Lanes;

/// Force per width of a family over its compressive strain `e = 1 - l`, both as sizes.
#[derive(Clone, Debug)]
pub(super) struct Crush {
    curve: Cubic,
}

impl Crush {
    /// Through strains (increasing from 0) and forces (N/m, the first 0, not falling).
    pub(super) fn new(strains: &[f64], forces: &[f64]) -> Self {
        let curve = Cubic::new(strains, forces);
        Self { curve }
    }

    /// Largest slope of the curve (N/m).
    pub(super) fn steepest(&self) -> f64 {
        self.curve.steepest()
    }

    /// Force per width (N/m, negative) and energy (J/m2) at `d = l - 1`; both 0 where that is not below 0. Beyond the last point the force goes on
    /// along its tangent.
    #[inline(always)]
    pub(super) fn at<V: Lanes>(&self, d: V) -> (V, V) {
        let zero = V::splat(0.0);
        let e = (-d).max(zero);
        let beyond = (e - V::splat(self.curve.end)).max(zero);
        let cut = self.curve.at(e);
        let more = V::splat(self.curve.end_slope) * beyond;
        let energy = cut.integral + (cut.value + V::splat(0.5) * more) * beyond;
        (-(cut.value + more), energy)
    }
}
