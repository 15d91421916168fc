//! The yarns' part of the shear law: F_norm over |s|, s = sin g, as a polynomial of the angle or a
//! table, the same for both signs of shear or not.

use super::cubic::Cubic;
use crate::{Lanes, polynomial};
use plyflow_fixed::FixedBits;

/// Most polynomial coefficients.
pub(super) const MAX_COEFFICIENTS: usize = 10;
/// Sines below this count as 0 where a secant is wanted.
const SMALL: f64 = 1e-3;

/// Response of the shear law.
#[derive(Clone, Copy)]
pub(super) struct Response<V> {
    /// dPhi/ds (N/m).
    pub force: V,
    /// Work done (J/m2): stored, and dissipated by the stitch.
    pub energy: V,
}

/// |s|, |g| and cos g up to the limit of the law.
#[derive(Clone, Copy)]
pub(super) struct Angle<V> {
    pub sine: V,
    pub g: V,
    pub cosine: V,
}

/// A shear law over |s|. `s` is given for its sign alone.
pub(super) trait Law {
    /// Sine of the limit angle, and the slope dF/ds with which F goes on beyond it.
    fn limit<V: Lanes>(&self, s: V) -> (V, V);
    /// Force and energy.
    fn response<V: Lanes>(&self, s: V, a: &Angle<V>) -> Response<V>;
    /// The larger of tangent and secant over s: never negative, also where the force falls.
    fn stiffness<V: Lanes>(&self, s: V, a: &Angle<V>) -> V;
}

/// Larger of tangent and secant.
#[inline(always)]
fn stiffer<V: Lanes>(tangent: V, force: V, sine: V, first: f64) -> V {
    let small = V::splat(SMALL);
    let ratio = force / sine.max(small);
    tangent.max(V::select(small.lt(sine), ratio, V::splat(first)))
}

/// `F = c0 + c1 g + c2 g^2 + ..` with c0 = 0.
#[derive(Clone, Debug)]
pub(super) struct Polynomial {
    count: usize,
    /// F and dF/dg.
    force: [f64; MAX_COEFFICIENTS],
    slope: [f64; MAX_COEFFICIENTS],
    /// Phi(g) = P(g) sin g + Q(g) cos g - Q(0): P = F - F'' + .., Q = F' - F''' + ..
    potential_sine: [f64; MAX_COEFFICIENTS],
    potential_cosine: [f64; MAX_COEFFICIENTS],
    limit: f64,
    limit_sine: f64,
    limit_slope: f64,
}

fn derivative(c: &[f64; MAX_COEFFICIENTS]) -> [f64; MAX_COEFFICIENTS] {
    core::array::from_fn(|i| {
        if i + 1 < c.len() {
            (i + 1) as f64 * c[i + 1]
        } else {
            0.0
        }
    })
}

impl Polynomial {
    /// From 2 to [`MAX_COEFFICIENTS`] coefficients (N/m, of g^0, g^1, ..), the first 0, and the limit
    /// angle (rad).
    pub(super) fn new(coefficients: &[f64], limit: f64) -> Self {
        let n = coefficients.len();
        let mut force = [0.0; MAX_COEFFICIENTS];
        force[..n].copy_from_slice(coefficients);
        let slope = derivative(&force);
        let (mut p, mut q, mut d) = (force, [0.0; MAX_COEFFICIENTS], force);
        for i in 0..MAX_COEFFICIENTS {
            let sign = if (i / 2) % 2 == 0 { 1.0 } else { -1.0 };
            let to = if i % 2 == 0 { &mut p } else { &mut q };
            if i > 0 {
                for (t, a) in to.iter_mut().zip(&d) {
                    *t += sign * a;
                }
            }
            d = derivative(&d);
        }
        let mut law = Self {
            count: n,
            force,
            slope,
            potential_sine: p,
            potential_cosine: q,
            limit,
            limit_sine: limit.fixed_sin(),
            limit_slope: 0.0,
        };
        let (f, s) = law.scalar(limit);
        law.limit_slope = s.max(f / limit) / limit.fixed_cos();
        law
    }

    /// F and dF/dg at the angle.
    pub(super) fn scalar(&self, g: f64) -> (f64, f64) {
        let at = |c: &[f64; MAX_COEFFICIENTS]| c.iter().rev().fold(0.0, |y, a| y * g + a);
        (at(&self.force), at(&self.slope))
    }
}

impl Law for Polynomial {
    #[inline(always)]
    fn limit<V: Lanes>(&self, _s: V) -> (V, V) {
        (V::splat(self.limit_sine), V::splat(self.limit_slope))
    }

    #[inline(always)]
    fn response<V: Lanes>(&self, _s: V, a: &Angle<V>) -> Response<V> {
        let n = self.count;
        let p = polynomial(a.g, &self.potential_sine[..n]);
        let q = polynomial(a.g, &self.potential_cosine[..n]);
        let rest = V::splat(self.potential_cosine[0]);
        Response {
            force: polynomial(a.g, &self.force[..n]),
            energy: p * a.sine + q * a.cosine - rest,
        }
    }

    #[inline(always)]
    fn stiffness<V: Lanes>(&self, _s: V, a: &Angle<V>) -> V {
        let n = self.count;
        let tangent = polynomial(a.g, &self.slope[..n - 1]) / a.cosine;
        let force = polynomial(a.g, &self.force[..n]);
        stiffer(tangent, force, a.sine, self.force[1])
    }
}

/// Points, with F a cubic of s between them: its integral over s, the energy, is exact, and no
/// arc sine is needed.
#[derive(Clone, Debug)]
pub(super) struct Table {
    curve: Cubic,
    limit: f64,
    limit_slope: f64,
}

impl Table {
    /// From angles (rad, increasing from 0, below pi/2) and forces (N/m, the first 0).
    pub(super) fn new(angles: &[f64], forces: &[f64]) -> Self {
        let sines: Vec<f64> = angles.iter().map(|g| g.fixed_sin()).collect();
        let curve = Cubic::new(&sines, forces);
        let limit = angles[angles.len() - 1];
        // As beyond the limit of a polynomial.
        let limit_slope = curve
            .end_slope
            .max(curve.end_value / (limit * limit.fixed_cos()));
        Self {
            curve,
            limit,
            limit_slope,
        }
    }
}

impl Law for Table {
    #[inline(always)]
    fn limit<V: Lanes>(&self, _s: V) -> (V, V) {
        (V::splat(self.curve.end), V::splat(self.limit_slope))
    }

    #[inline(always)]
    fn response<V: Lanes>(&self, _s: V, a: &Angle<V>) -> Response<V> {
        let cut = self.curve.at(a.sine);
        Response {
            force: cut.value,
            energy: cut.integral,
        }
    }

    #[inline(always)]
    fn stiffness<V: Lanes>(&self, _s: V, a: &Angle<V>) -> V {
        let cut = self.curve.at(a.sine);
        stiffer(cut.slope, cut.value, a.sine, self.curve.start_slope())
    }
}

/// A law of one sign.
#[derive(Clone, Debug)]
pub(super) enum Branch {
    Polynomial(Box<Polynomial>),
    Table(Table),
}

impl Branch {
    /// Slope dF/dg at 0 (N/m).
    pub(super) fn initial_slope(&self) -> f64 {
        match self {
            Branch::Polynomial(p) => p.force[1],
            Branch::Table(t) => t.curve.start_slope(),
        }
    }

    /// Limit angle (rad).
    pub(super) fn limit_angle(&self) -> f64 {
        match self {
            Branch::Polynomial(p) => p.limit,
            Branch::Table(t) => t.limit,
        }
    }
}

impl Law for Branch {
    #[inline(always)]
    fn limit<V: Lanes>(&self, s: V) -> (V, V) {
        match self {
            Branch::Polynomial(p) => p.limit(s),
            Branch::Table(t) => t.limit(s),
        }
    }

    #[inline(always)]
    fn response<V: Lanes>(&self, s: V, a: &Angle<V>) -> Response<V> {
        match self {
            Branch::Polynomial(p) => p.response(s, a),
            Branch::Table(t) => t.response(s, a),
        }
    }

    #[inline(always)]
    fn stiffness<V: Lanes>(&self, s: V, a: &Angle<V>) -> V {
        match self {
            Branch::Polynomial(p) => p.stiffness(s, a),
            Branch::Table(t) => t.stiffness(s, a),
        }
    }
}

/// A law of its own for each sign.
#[derive(Clone, Debug)]
pub(super) struct Signed {
    pub positive: Branch,
    pub negative: Branch,
}

impl Signed {
    #[inline(always)]
    fn pick<V: Lanes>(s: V, positive: V, negative: V) -> V {
        V::select(s.lt(V::splat(0.0)), negative, positive)
    }
}

// Both laws are evaluated in every lane and one is kept: a value at an angle beyond the limit of the
// other law is finite, and dropped.
impl Law for Signed {
    #[inline(always)]
    fn limit<V: Lanes>(&self, s: V) -> (V, V) {
        let (p, n) = (self.positive.limit(s), self.negative.limit(s));
        (Self::pick(s, p.0, n.0), Self::pick(s, p.1, n.1))
    }

    #[inline(always)]
    fn response<V: Lanes>(&self, s: V, a: &Angle<V>) -> Response<V> {
        let (p, n) = (self.positive.response(s, a), self.negative.response(s, a));
        Response {
            force: Self::pick(s, p.force, n.force),
            energy: Self::pick(s, p.energy, n.energy),
        }
    }

    #[inline(always)]
    fn stiffness<V: Lanes>(&self, s: V, a: &Angle<V>) -> V {
        let (p, n) = (self.positive.stiffness(s, a), self.negative.stiffness(s, a));
        Self::pick(s, p, n)
    }
}
