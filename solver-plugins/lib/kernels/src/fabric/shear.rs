//! The shear law F_norm(g) over s = sin g: yarns ([`Law`]) and stitch ([`Stitch`]).
//!
//! Yarns: a law up to its limit angle; beyond it F goes on along its tangent over s (the secant,
//! where that is steeper), which is convex and finite at |s| = 1.

use super::hysteresis::Slider;
use super::stitch::Stitch;
use super::yarn::{Angle, Branch, Law, Polynomial, Response, Signed, Table};
use crate::{Lanes, asin};

/// Yarns of a ply: what is the same for both signs has a kernel of its own.
#[derive(Clone, Debug)]
pub(super) enum Yarn {
    Polynomial(Box<Polynomial>),
    Table(Table),
    Signed(Box<Signed>),
}

/// The shear law of a ply.
#[derive(Clone, Debug)]
pub(super) struct Shear {
    pub yarn: Yarn,
    pub stitch: Option<Stitch>,
    pub slider: Option<Slider>,
    initial_slope: f64,
}

impl Shear {
    /// The law for g > 0, that for g < 0 over |g| (absent: odd), the stitch, and the friction of the yarns. `signed`: whether it is to be kept by sign even
    /// where both are the same: plies whose yarns rub, or whose fibres follow a curve in compression, have one kernel, that of any two laws.
    pub(super) fn new(
        positive: Branch,
        negative: Option<Branch>,
        stitch: Option<Stitch>,
        slider: Option<Slider>,
        signed: bool,
    ) -> Self {
        let first = positive.initial_slope();
        let initial_slope = negative
            .as_ref()
            .map_or(first, |n| 0.5 * (first + n.initial_slope()));
        let yarn = match (positive, negative) {
            (p, n) if signed || slider.is_some() => Yarn::Signed(Box::new(Signed {
                negative: n.unwrap_or_else(|| p.clone()),
                positive: p,
            })),
            (Branch::Polynomial(p), None) => Yarn::Polynomial(p),
            (Branch::Table(t), None) => Yarn::Table(t),
            (positive, Some(negative)) => Yarn::Signed(Box::new(Signed { positive, negative })),
        };
        Self {
            yarn,
            stitch,
            slider,
            initial_slope,
        }
    }

    /// Initial slope dF/dg (N/m), the mean of both signs.
    pub(super) fn initial_slope(&self) -> f64 {
        self.initial_slope
    }
}

/// A shear law with the kind of its yarns known, for kernels.
#[derive(Clone, Copy)]
pub(super) struct ShearOf<'a, L> {
    pub yarn: &'a L,
    pub stitch: Option<&'a Stitch>,
}

impl<L: Law> ShearOf<'_, L> {
    /// The yarns' part at s = sin g.
    #[inline(always)]
    pub(super) fn yarn<V: Lanes>(&self, s: V) -> Response<V> {
        let (a, beyond, slope) = self.angle(s);
        Self::finish(s, self.yarn.response(s, &a), beyond, slope)
    }

    /// Yarns and stitch at s, and the history after it; `m`, `m_sine`: the largest angle reached
    /// before and its sine.
    #[inline(always)]
    pub(super) fn with_stitch<V: Lanes>(&self, s: V, m: V, m_sine: V) -> (Response<V>, V, V) {
        let (a, beyond, slope) = self.angle(s);
        let yarn = self.yarn.response(s, &a);
        let zero = V::splat(0.0);
        let Some(stitch) = self.stitch else {
            // Kept as with a stitch: what the history means does not depend on there being one.
            let stretched = zero.lt(s);
            let m = V::select(stretched, m.max(a.g), m);
            let m_sine = V::select(stretched, m_sine.max(a.sine), m_sine);
            return (Self::finish(s, yarn, beyond, slope), m, m_sine);
        };
        let stretched = stitch.stretched(s);
        let m = V::select(stretched, m.max(a.g), m);
        let m_sine = V::select(stretched, m_sine.max(a.sine), m_sine);
        let (force, held, lost) = stitch.response(stretched, &a, m, m_sine);
        let r = Response {
            force: yarn.force + force,
            energy: yarn.energy + held + lost,
        };
        (Self::finish(s, r, beyond, slope), m, m_sine)
    }

    /// |s|, |g| and cos g up to the limit, how far |s| lies beyond it, and dF/ds there.
    #[inline(always)]
    fn angle<V: Lanes>(&self, s: V) -> (Angle<V>, V, V) {
        let (end, slope) = self.yarn.limit(s);
        let size = s.abs();
        let sine = size.min(end);
        let a = Angle {
            sine,
            g: asin(sine),
            cosine: (V::splat(1.0) - sine * sine).sqrt(),
        };
        (a, (size - end).max(V::splat(0.0)), slope)
    }

    /// Adds the part beyond the limit and the sign.
    #[inline(always)]
    fn finish<V: Lanes>(s: V, r: Response<V>, beyond: V, slope: V) -> Response<V> {
        let more = slope * beyond;
        Response {
            force: (r.force + more).copysign(s),
            energy: r.energy + (r.force + V::splat(0.5) * more) * beyond,
        }
    }

    /// A bound of dF/ds that is never negative, and the yarns' own stiffness: the larger of their
    /// tangent and secant over s.
    #[inline(always)]
    pub(super) fn slopes<V: Lanes>(&self, s: V) -> (V, V) {
        let (a, beyond, slope) = self.angle(s);
        let inside = self.yarn.stiffness(s, &a);
        let zero = V::splat(0.0);
        let yarn = V::select(zero.lt(beyond), inside.max(slope), inside);
        let stretched = match self.stitch {
            Some(t) => V::select(t.stretched(s), V::splat(t.rise) / a.cosine, zero),
            None => zero,
        };
        (yarn + stretched, yarn)
    }
}
