//! Materials whose shear and stretches, or twist and curvatures, hang together at rest, as those of fabrics do whose families cross at another angle
//! than a right one. What such a material tells of its shear tangent is no measure of its softest strain, and its moments' tangents
//! alone are no bound of its bending stiffness.

use crate::WIDTH;
use crate::rows::Rows;
use plyflow_sdk::abi::PF_OK;
use plyflow_sdk::{Aligned, BendingBatch, MaterialRef, MembraneBatch};

/// A strain, and a curvature times the thickness: small against every law's scale, large against rounding.
const SMALL: f64 = 1e-7;
/// Shares of the largest answer from which another component's counts as one.
const COUNTS: f64 = 1e-4;

/// Half of the softest tangent dS/dE (N/m) of a material at rest, so that it compares with shear tangents dS12/d(2 E12); `None` where shear brings
/// no stress along the axes, so that its own tangent is that, and where the material gives no answer.
pub(crate) fn softest(material: &MaterialRef) -> Option<f64> {
    let mut metric = Rows::<{ 3 * WIDTH }>::zeros();
    metric.0[..2 * WIDTH].fill(1.0);
    // Lanes 0 to 2: E11, E22, E12; the next ones are at rest.
    for r in 0..3 {
        metric.0[r * WIDTH + r] += 2.0 * SMALL;
    }
    let mut history = Aligned::zeros(material.sizes().membrane_history * WIDTH);
    let mut stress = Rows::<{ 3 * WIDTH }>::zeros();
    let mut energy = Rows::<WIDTH>::zeros();
    let code = material.membrane(&mut MembraneBatch {
        lanes: WIDTH,
        dt: 0.0,
        metric: &metric.0,
        history: &mut history,
        stress: &mut stress.0,
        energy: &mut energy.0,
        stiffness: None,
    });
    // In the components S11, S22, sqrt(2) S12 of a symmetric tensor.
    let weights = [1.0, 1.0, std::f64::consts::SQRT_2];
    let at = |r: usize, lane: usize| {
        let answer = stress.0[r * WIDTH + lane] - stress.0[r * WIDTH + 3];
        weights[r] * answer / (weights[lane] * SMALL)
    };
    let d = |a: usize, b: usize| 0.5 * (at(a, b) + at(b, a));
    let largest = (0..3).map(|k| d(k, k)).fold(0.0, f64::max);
    let turned = d(0, 2).abs().max(d(1, 2).abs());
    if code != PF_OK || turned.is_nan() || turned <= COUNTS * largest {
        return None;
    }
    // The softest is at most, and where it is by far the softest nearly, 1 / the trace of the inverse.
    let minor = |a: usize, b: usize| d(a, a) * d(b, b) - d(a, b) * d(a, b);
    let minors = minor(1, 2) + minor(0, 2) + minor(0, 1);
    let determinant = d(0, 0) * minor(1, 2) - d(0, 1) * (d(0, 1) * d(2, 2) - d(1, 2) * d(0, 2))
        + d(0, 2) * (d(0, 1) * d(1, 2) - d(1, 1) * d(0, 2));
    Some(0.5 * (determinant / minors).max(0.0))
}

/// Whether a twist of the material bends its families at rest.
pub(crate) fn twist_bends(material: &MaterialRef) -> bool {
    let sizes = material.sizes();
    if !sizes.has_bending {
        return false;
    }
    let mut metric = Rows::<{ 3 * WIDTH }>::zeros();
    metric.0[..2 * WIDTH].fill(1.0);
    let mut curvature = Rows::<{ 3 * WIDTH }>::zeros();
    for r in 0..3 {
        curvature.0[r * WIDTH + r] = SMALL / sizes.thickness;
    }
    let mut history = Aligned::zeros(sizes.bending_history * WIDTH);
    let mut moment = Rows::<{ 3 * WIDTH }>::zeros();
    let mut energy = Rows::<WIDTH>::zeros();
    let code = material.bending(&mut BendingBatch {
        lanes: WIDTH,
        dt: 0.0,
        metric: &metric.0,
        curvature: &curvature.0,
        history: &mut history,
        moment: &mut moment.0,
        energy: &mut energy.0,
        tangent: None,
    });
    let at = |r: usize, lane: usize| moment.0[r * WIDTH + lane].abs();
    let largest = at(0, 0).max(at(1, 1)).max(at(2, 2));
    code == PF_OK && at(0, 2).max(at(1, 2)) > COUNTS * largest
}
