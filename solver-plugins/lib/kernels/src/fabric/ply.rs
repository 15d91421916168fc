//! A ply, whatever the form of its law.

use super::bending::Bending;
use super::compression::Crush;
use super::crossing::Crossing;
use super::shear::Shear;
use crate::Lanes;

/// A floor for squared stretches.
pub(super) const LEAST: f64 = 1e-6;

#[derive(Clone, Copy, PartialEq, Eq, Debug, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Form {
    FibreEnergy,
    Hypoelastic,
}

/// A fabric ply.
pub struct Fabric {
    pub(super) form: Form,
    /// Fibre stiffness of each family in tension and in compression (N/m).
    pub(super) tension: [f64; 2],
    pub(super) compression: [f64; 2],
    /// Of each family in compression instead, where that is a curve; of neither or of both.
    pub(super) crush: Option<[Crush; 2]>,
    /// Largest fibre stiffness of each family, at any stretch (N/m).
    pub(super) stiffest: [f64; 2],
    /// Where the families do not cross at a right angle.
    pub(super) crossing: Option<Crossing>,
    pub(super) shear: Shear,
    pub(super) bending: Option<Bending>,
    pub(super) thickness: f64,
    pub(super) areal_mass: f64,
}

/// Bounds of the largest eigenvalue of dS/dE and of the shear tangent dS12 / d(2 E12); both are
/// positive also while the stitch softens, and count compressed fibres as stretched ones. `a1`, `a2`
/// are the fibre tangents k / l^3, `slope` bounds dF/ds. The shear part is F' (ds/dE)^2 + F d2s/dE2, each factor by its
/// Frobenius norm.
#[inline(always)]
pub(super) fn tangents<V: Lanes>(slope: V, s: V, i1: V, i2: V, a1: V, a2: V, force: V) -> (V, V) {
    let two = V::splat(2.0);
    let gradient = s * s * (i1 * i1 + i2 * i2) + two * i1 * i2;
    let widest = i1.max(i2);
    let largest = a1.max(a2) + slope * gradient + V::splat(8.0) * force * widest * widest;
    (largest, slope * i1 * i2)
}
