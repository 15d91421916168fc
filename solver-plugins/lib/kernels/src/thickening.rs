//! Sections that thicken: a ply of constant volume is 1/J as thick when it is sheared to J = sqrt(det C) of its area, and
//! its bending energy per undeformed area is `J^-p W_b(k)`.

use crate::{Lanes, WIDTH, dispatch};

/// A homogeneous section: the cube of the thickness per width as it is, which is J of the undeformed one.
const MOST: u32 = 2;
/// A floor for det C, as the elements have it for their normals.
pub(crate) const LEAST: f64 = 1e-12;

pub(crate) fn check(power: u32) -> Result<(), String> {
    if power > MOST {
        return Err(format!(
            "thickening: given {power}; expected 0 to {MOST} (the power of the thickness with which a section's \
             bending energy per undeformed area grows; {MOST}: a homogeneous one)"
        ));
    }
    Ok(())
}

// Moments, tangents `[3][n]` and energies `[n]` times J^-power.
dispatch!(pub(crate) fn scale(
    power: u32,
    n: usize,
    metric: &[f64],
    moment: &mut [f64],
    tangent: &mut [f64],
    energy: &mut [f64],
) = scale_kernel, lanes n);

#[inline(always)]
fn scale_kernel<V: Lanes>(
    power: u32,
    n: usize,
    metric: &[f64],
    moment: &mut [f64],
    tangent: &mut [f64],
    energy: &mut [f64],
) {
    for c in (0..n).step_by(WIDTH) {
        let (c11, c22) = (V::load(metric, c), V::load(metric, n + c));
        let c12 = V::load(metric, 2 * n + c);
        let inverse = V::splat(1.0) / (c11 * c22 - c12 * c12).max(V::splat(LEAST));
        let thickness = inverse.sqrt();
        let factor = (0..power).fold(V::splat(1.0), |f, _| f * thickness);
        for at in [c, n + c, 2 * n + c] {
            (V::load(moment, at) * factor).store(moment, at);
            (V::load(tangent, at) * factor).store(tangent, at);
        }
        (V::load(energy, c) * factor).store(energy, c);
    }
}
