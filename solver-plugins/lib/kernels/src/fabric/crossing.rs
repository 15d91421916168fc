//! Fibre families that cross at another angle than a right one.
//!
//! Family 1 lies along e1, family 2 at the crossing `p` from it, counter-clockwise. The laws of a ply are written over its families, so
//! they see a metric of their own: `[l1^2, l2^2, l1 l2 sin g]`, where `g` is the shear angle, by which the families have come
//! nearer to each other: `g = p - t`, `cos t = a1 . C a2 / (l1 l2)`. With `c = cos p`, `s = sin p` and `J^2 = det C`:
//!
//! `l2^2 = c^2 C11 + 2 c s C12 + s^2 C22`, `l1 l2 sin g = s (c C11 + s C12 - c J)`,
//!
//! because `l1 l2 sin t = s J`. Stresses and moments follow by the chain rule, so they stay the gradient of one energy. For `p` = 90
//! degrees all of this is the metric itself.

use crate::Lanes;
use plyflow_fixed::FixedBits;

/// A floor for the area ratio J.
const LEAST_AREA: f64 = 1e-6;

/// How the families of a ply cross.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    cosine: f64,
    sine: f64,
}

/// What the laws say of a state, for the bounds of its tangents.
pub(super) struct Tangents<V> {
    /// Fibre tangents `k / l^3` of both families (N/m).
    pub fibres: [V; 2],
    /// The largest tangent over the families' own metric (N/m), with the fibres'.
    pub largest: V,
    /// Size of the stress that works on the families' shear (N/m).
    pub shear: V,
}

impl Crossing {
    /// Of families at this angle (rad); none where it is a right one, to rounding of degrees.
    pub(super) fn new(angle: f64) -> Option<Self> {
        let (cosine, sine) = (angle.fixed_cos(), angle.fixed_sin());
        (cosine.abs() > 1e-9).then_some(Self { cosine, sine })
    }

    /// c^2, c s and s.
    #[inline(always)]
    fn products<V: Lanes>(&self) -> (V, V, V) {
        let (c, s) = (self.cosine, self.sine);
        (V::splat(c * c), V::splat(c * s), V::splat(s))
    }

    /// J of a metric C11, C22, C12.
    #[inline(always)]
    fn area<V: Lanes>([c11, c22, c12]: [V; 3]) -> V {
        let square = c11 * c22 - c12 * c12;
        square.max(V::splat(LEAST_AREA * LEAST_AREA)).sqrt()
    }

    /// The families' own metric of the sheet's.
    #[inline(always)]
    pub(super) fn metric<V: Lanes>(&self, of: [V; 3]) -> [V; 3] {
        let [c11, c22, c12] = of;
        let (cc, cs, s) = self.products::<V>();
        // As differences, so that what is undeformed is so to the last bit.
        let along = c22 + cc * (c11 - c22) + (cs + cs) * c12;
        [c11, along, cs * (c11 - Self::area(of)) + s * s * c12]
    }

    /// Stresses on the sheet's metric `of` by those on the families' own one.
    #[inline(always)]
    pub(super) fn stress<V: Lanes>(&self, of: [V; 3], [s11, s22, s12]: [V; 3]) -> [V; 3] {
        let [c11, c22, c12] = of;
        let (cc, cs, s) = self.products::<V>();
        let (one, two) = (V::splat(1.0), V::splat(2.0));
        let over = one / Self::area(of);
        let sheared = s12 * cs;
        [
            s11 + cc * s22 + sheared * (two - c22 * over),
            (one - cc) * s22 - sheared * c11 * over,
            cs * s22 + s12 * (s * s + cs * c12 * over),
        ]
    }

    /// Bounds of the largest tangent and of the shear tangent (N/m) at the sheet's metric `of`. `dE` of the families is `P dE` of the sheet: the rows of
    /// P are `a1 a1`, `a2 a2`, whose squares add up to at most `1 + c^2`, and T, that of the families' shear. What is left comes with
    /// `d2J`, which is at most `(2 / J + |C|^2 / J^3) |dE|^2`.
    #[inline(always)]
    pub(super) fn tangents<V: Lanes>(&self, of: [V; 3], t: &Tangents<V>) -> (V, V) {
        let [c11, c22, c12] = of;
        let (cc, cs, s) = self.products::<V>();
        let (one, two, half) = (V::splat(1.0), V::splat(2.0), V::splat(0.5));
        let over = one / Self::area(of);
        let cubed = over * over * over;
        let steepest = t.fibres[0].max(t.fibres[1]);
        let others = t.largest - steepest;
        let (t11, t22) = (cs * (one - half * c22 * over), cs * half * c11 * over);
        let t12 = half * (s * s + cs * c12 * over);
        let sheared = t11 * t11 + t22 * t22 + two * t12 * t12;
        let both = one + cc;
        let norm = c11 * c11 + c22 * c22 + two * c12 * c12;
        let turned = t.shear * cs.abs();
        let largest = steepest * both
            + others * (both + two * sheared)
            + turned * (two * over + norm * cubed);
        let soft = (t.fibres[1] + others) * cs * cs
            + others * two * t12 * t12
            + turned * c11 * c22 * cubed;
        (largest, soft)
    }

    /// The families' own curvatures `[k11, k22, k12]`: of family 1, of family 2, and of one along the other.
    #[inline(always)]
    pub(super) fn curvature<V: Lanes>(&self, [k11, k22, k12]: [V; 3]) -> [V; 3] {
        let (cc, cs, s) = self.products::<V>();
        let c = V::splat(self.cosine);
        [
            k11,
            k22 + cc * (k11 - k22) + (cs + cs) * k12,
            c * k11 + s * k12,
        ]
    }

    /// Moments on the sheet's curvatures by those on the families' own.
    #[inline(always)]
    pub(super) fn moment<V: Lanes>(&self, [m11, m22, m12]: [V; 3]) -> [V; 3] {
        let (cc, cs, s) = self.products::<V>();
        let c = V::splat(self.cosine);
        [
            m11 + cc * m22 + (c + c) * m12,
            (V::splat(1.0) - cc) * m22,
            cs * m22 + s * m12,
        ]
    }

    /// Tangents dM11/dk11, dM22/dk22 and dM12/dk12 of the sheet by those of the families' own.
    #[inline(always)]
    pub(super) fn diagonal<V: Lanes>(&self, [t1, t2, twist]: [V; 3]) -> [V; 3] {
        let (cc, cs, s) = self.products::<V>();
        let (two, ss) = (V::splat(2.0), V::splat(1.0) - cc);
        [
            t1 + cc * cc * t2 + two * cc * twist,
            ss * ss * t2,
            two * cs * cs * t2 + s * s * twist,
        ]
    }
}
