//! Bending of a fibre family: `M = linear k + asymptote (1 - exp(-|k| / scale)) sign k` (Voce, thesis
//! eq. 3.4) from the potential `linear k^2 / 2 + asymptote (|k| - scale (1 - exp(-|k| / scale)))`, a
//! constant stiffness (its case without asymptote), or a table ([`Cubic`], going on along its tangent
//! beyond the last point), with a law of its own for each family and sign; twist is linear.
//!
//! Curvatures are those of material lines per undeformed length (k11 of a fibre that keeps its
//! length is its normal curvature), and moments are per undeformed width: a family keeps its fibres
//! while the ply shears, so the law does not depend on the shear angle. The metric has no influence,
//! which keeps the bending force the exact gradient of this energy.

use super::crossing::Crossing;
use super::cubic::Cubic;
use super::hysteresis::{HISTORY, Slider};
use crate::{Lanes, WIDTH, dispatch, exp};

/// Voce's law (SI: N m, N, 1/m).
#[derive(Clone, Copy, Debug)]
pub(super) struct Voce {
    pub linear: f64,
    pub asymptote: f64,
    pub scale: f64,
}

/// Law of one sign.
#[derive(Clone, Debug)]
pub(super) enum Law {
    Voce(Voce),
    Table(Cubic),
}

/// Laws of each family: positive, negative.
#[derive(Clone, Debug)]
pub(super) enum Laws {
    Voce([[Voce; 2]; 2]),
    Any(Box<[[Law; 2]; 2]>),
}

impl From<[[Law; 2]; 2]> for Laws {
    fn from(laws: [[Law; 2]; 2]) -> Self {
        if let [[Law::Voce(a), Law::Voce(b)], [Law::Voce(c), Law::Voce(d)]] = &laws {
            return Laws::Voce([[*a, *b], [*c, *d]]);
        }
        Laws::Any(Box::new(laws))
    }
}

/// Bending law of a ply.
#[derive(Clone, Debug)]
pub(super) struct Bending {
    pub laws: Laws,
    /// For each family: +1 when a positive curvature bends it positively.
    pub signs: [f64; 2],
    /// dM12/dk12 (N m); of families that do not cross at a right angle that of one along the other.
    pub twist: f64,
    /// Where they do not.
    pub crossing: Option<Crossing>,
    /// Friction of the yarns of each family; `None`: neither has any.
    pub sliders: Option<[Option<Slider>; 2]>,
}

impl Bending {
    /// Rows of history.
    pub(super) fn history(&self) -> usize {
        self.sliders.map_or(0, |_| 2 * HISTORY)
    }
}

/// What friction is added to.
pub(super) struct Rubbed<'a> {
    /// `[2][HISTORY][n]`.
    pub history: &'a mut [f64],
    pub moment: &'a mut [f64],
    pub energy: &'a mut [f64],
    /// May be empty.
    pub tangent: &'a mut [f64],
}

dispatch!(pub(super) fn rub(
    sliders: &[Option<Slider>; 2],
    crossing: Option<&Crossing>,
    n: usize,
    curvature: &[f64],
    of: Rubbed<'_>,
) = rub_kernel);

/// Adds the moments of the families' friction to those of their laws.
#[inline(always)]
fn rub_kernel<V: Lanes>(
    sliders: &[Option<Slider>; 2],
    crossing: Option<&Crossing>,
    n: usize,
    curvature: &[f64],
    of: Rubbed<'_>,
) {
    let zero = V::splat(0.0);
    for (family, slider) in sliders.iter().enumerate() {
        let Some(slider) = slider else {
            continue;
        };
        for c in (0..n).step_by(WIDTH) {
            let row = |r: usize| (family * HISTORY + r) * n + c;
            let stands = V::load(of.history, row(0));
            let own = match crossing {
                Some(x) => x.curvature([0, 1, 2].map(|r| V::load(curvature, r * n + c)))[family],
                None => V::load(curvature, family * n + c),
            };
            let slid = slider.at(own, zero, stands, V::load(of.history, row(1)));
            slid.stands.store(of.history, row(0));
            slid.lost.store(of.history, row(1));
            (V::load(of.energy, c) + slid.energy).store(of.energy, c);
            // Where it slides the moment does not grow any more.
            let sticks = slid.force.abs().lt(V::splat(slider.limit));
            let held = V::select(sticks, V::splat(slider.stiffness), zero);
            match crossing {
                Some(x) => {
                    let (mut force, mut stiffness) = ([zero; 3], [zero; 3]);
                    (force[family], stiffness[family]) = (slid.force, held);
                    let (moment, tangent) = (x.moment(force), x.diagonal(stiffness));
                    for r in 0..3 {
                        add(of.moment, r * n + c, moment[r]);
                        if !of.tangent.is_empty() {
                            add(of.tangent, r * n + c, tangent[r]);
                        }
                    }
                }
                None => {
                    add(of.moment, family * n + c, slid.force);
                    if !of.tangent.is_empty() {
                        add(of.tangent, family * n + c, held);
                    }
                }
            }
        }
    }
}

/// Adds to eight lanes.
#[inline(always)]
fn add<V: Lanes>(to: &mut [f64], at: usize, value: V) {
    (V::load(to, at) + value).store(to, at);
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
    // Compiled for each kind of law, and for families that cross at a right angle and at another one.
    macro_rules! of_laws {
        ($family:expr) => {{
            let family = $family;
            match &law.crossing {
                None => moments_of::<V>(law, &family, n, curvature, moment, energy, tangent),
                Some(x) => {
                    crossed_moments_of::<V>(law, x, &family, n, curvature, moment, energy, tangent);
                }
            }
        }};
    }
    let signs = law.signs;
    match &law.laws {
        Laws::Voce(laws) => of_laws!(OfVoce { laws, signs }),
        Laws::Any(laws) => of_laws!(OfAny { laws, signs }),
    }
}

/// Moment, energy and tangent of a family at its curvature. A trait, and no closure: what calls a closure more than once is not compiled
/// for the instruction set of the kernel (`scripts/check-inlined`).
trait OfFamily {
    fn at<V: Lanes>(&self, family: usize, k: V) -> (V, V, V);
}

struct OfVoce<'a> {
    laws: &'a [[Voce; 2]; 2],
    signs: [f64; 2],
}

impl OfFamily for OfVoce<'_> {
    #[inline(always)]
    fn at<V: Lanes>(&self, family: usize, k: V) -> (V, V, V) {
        voce(&self.laws[family], self.signs[family], k)
    }
}

struct OfAny<'a> {
    laws: &'a [[Law; 2]; 2],
    signs: [f64; 2],
}

impl OfFamily for OfAny<'_> {
    #[inline(always)]
    fn at<V: Lanes>(&self, family: usize, k: V) -> (V, V, V) {
        any(&self.laws[family], self.signs[family], k)
    }
}

#[inline(always)]
fn moments_of<V: Lanes>(
    law: &Bending,
    family_law: &impl OfFamily,
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
            let (m, u, t) = family_law.at(family, k);
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

/// The same of families that do not cross at a right angle.
#[inline(always)]
fn crossed_moments_of<V: Lanes>(
    law: &Bending,
    crossing: &Crossing,
    family_law: &impl OfFamily,
    n: usize,
    curvature: &[f64],
    moment: &mut [f64],
    energy: &mut [f64],
    tangent: &mut [f64],
) {
    let twist = V::splat(law.twist);
    for c in (0..n).step_by(WIDTH) {
        let [k1, k2, k12] = crossing.curvature([0, 1, 2].map(|r| V::load(curvature, r * n + c)));
        let ((m1, w1, t1), (m2, w2, t2)) = (family_law.at(0, k1), family_law.at(1, k2));
        (w1 + w2 + twist * k12 * k12).store(energy, c);
        let moments = crossing.moment([m1, m2, twist * k12]);
        for (r, value) in moments.into_iter().enumerate() {
            value.store(moment, r * n + c);
        }
        if !tangent.is_empty() {
            let tangents = crossing.diagonal([t1, t2, twist]);
            for (r, value) in tangents.into_iter().enumerate() {
                value.store(tangent, r * n + c);
            }
        }
    }
}

/// Moment, energy and tangent of a family.
#[inline(always)]
fn voce<V: Lanes>(laws: &[Voce; 2], sign: f64, k: V) -> (V, V, V) {
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

/// The same with any two laws: both are evaluated and one is kept.
#[inline(always)]
fn any<V: Lanes>(laws: &[Law; 2], sign: f64, k: V) -> (V, V, V) {
    let positive = V::splat(0.0).lt(k * V::splat(sign));
    let a = k.abs();
    let (p, n) = (one_sign(&laws[0], a), one_sign(&laws[1], a));
    let pick = |x: V, y: V| V::select(positive, x, y);
    (pick(p.0, n.0).copysign(k), pick(p.1, n.1), pick(p.2, n.2))
}

/// Size of the moment, energy and tangent at the curvature `a >= 0`.
#[inline(always)]
fn one_sign<V: Lanes>(law: &Law, a: V) -> (V, V, V) {
    match law {
        Law::Voce(l) => voce(&[*l; 2], 1.0, a),
        Law::Table(curve) => {
            let cut = curve.at(a);
            let zero = V::splat(0.0);
            let beyond = (a - V::splat(curve.end)).max(zero);
            let (end, slope) = (V::splat(curve.end_value), V::splat(curve.end_slope));
            let more = slope * beyond;
            (
                cut.value + more,
                cut.integral + (end + V::splat(0.5) * more) * beyond,
                V::select(zero.lt(beyond), slope, cut.slope),
            )
        }
    }
}
