//! Bending of a fibre family: `M = linear k + asymptote (1 - exp(-|k| / scale)) sign k` (Voce, thesis
//! eq. 3.4), with a law of its own for each sign, from the potential
//! `linear k^2 / 2 + asymptote (|k| - scale (1 - exp(-|k| / scale)))`; twist is linear.
//!
//! Curvatures are those of material lines per undeformed length (k11 of a fibre that keeps its
//! length is its normal curvature), and moments are per undeformed width: a family keeps its fibres
//! while the ply shears, so the law does not depend on the shear angle. The metric has no influence,
//! which keeps the bending force the exact gradient of this energy.

use crate::{Lanes, WIDTH, dispatch, exp};

/// Law of one sign (SI: N m, N, 1/m).
#[derive(Clone, Copy, Debug, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Law {
    pub linear: f64,
    #[serde(default)]
    pub asymptote: f64,
    #[serde(default = "unit_scale")]
    pub scale: f64,
}

fn unit_scale() -> f64 {
    1.0
}

/// Bending law of a ply.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bending {
    /// Positive, negative.
    pub laws: [Law; 2],
    /// For each family: +1 when a positive curvature bends it positively.
    pub signs: [f64; 2],
    /// dM12/dk12 (N m).
    pub twist: f64,
}

dispatch!(pub(super) fn moments(
    law: &Bending,
    n: usize,
    curvature: &[f64],
    moment: &mut [f64],
    energy: &mut [f64],
    tangent: &mut [f64],
) = moments_kernel);

#[inline(always)]
fn moments_kernel<V: Lanes>(
    law: &Bending,
    n: usize,
    curvature: &[f64],
    moment: &mut [f64],
    energy: &mut [f64],
    tangent: &mut [f64],
) {
    let twist = V::splat(law.twist);
    for c in (0..n).step_by(WIDTH) {
        let k12 = V::load(curvature, 2 * n + c);
        (twist * k12).store(moment, 2 * n + c);
        let mut w = twist * k12 * k12;
        for family in 0..2 {
            let k = V::load(curvature, family * n + c);
            let (m, u, t) = voce(&law.laws, law.signs[family], k);
            m.store(moment, family * n + c);
            w = w + u;
            if !tangent.is_empty() {
                t.store(tangent, family * n + c);
            }
        }
        w.store(energy, c);
        if !tangent.is_empty() {
            twist.store(tangent, 2 * n + c);
        }
    }
}

/// Moment, energy and tangent of a family.
#[inline(always)]
fn voce<V: Lanes>(laws: &[Law; 2], sign: f64, k: V) -> (V, V, V) {
    let one = V::splat(1.0);
    let positive = V::splat(0.0).lt(k * V::splat(sign));
    let pick = |a: f64, b: f64| V::select(positive, V::splat(a), V::splat(b));
    let linear = pick(laws[0].linear, laws[1].linear);
    let asymptote = pick(laws[0].asymptote, laws[1].asymptote);
    let scale = pick(laws[0].scale, laws[1].scale);
    let rate = pick(1.0 / laws[0].scale, 1.0 / laws[1].scale);
    let a = k.abs();
    let e = exp(-(a * rate));
    let risen = one - e;
    let m = linear * a + asymptote * risen;
    let w = V::splat(0.5) * linear * a * a + asymptote * (a - scale * risen);
    (m.copysign(k), w, linear + asymptote * rate * e)
}
