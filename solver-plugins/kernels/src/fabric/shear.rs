//! The shear law F_norm(g): yarns (an odd polynomial in the shear angle) and stitch (straight
//! pieces for positive shear, with irreversible failure).

use crate::{Lanes, asin, polynomial};

/// Most points of the stitch curve.
pub const MAX_POINTS: usize = 8;
/// Most polynomial coefficients.
pub const MAX_COEFFICIENTS: usize = 10;

/// Response of the shear law.
#[derive(Clone, Copy)]
pub(crate) struct Response<V> {
    /// dPhi/ds (N/m).
    pub force: V,
    /// Work done (J/m2): stored, and dissipated by the stitch.
    pub energy: V,
}

/// A hinge of the stitch curve: `slope * max(g - angle, 0)`.
#[derive(Clone, Copy, Debug, Default)]
struct Hinge {
    angle: f64,
    cosine: f64,
    slope: f64,
}

#[derive(Clone, Copy, Debug)]
struct Stitch {
    onset: f64,
    onset_cosine: f64,
    peak: f64,
    peak_sine: f64,
    /// Slope of the rise (N/m per rad).
    rise: f64,
    hinges: [Hinge; MAX_POINTS],
    count: usize,
}

/// F_norm(g) over s = sin g.
///
/// Yarns: an odd polynomial up to the limit angle; beyond it F goes on along its tangent over s,
/// which is convex and finite at |s| = 1. Stitch, for g > 0 only, with the largest angle reached
/// `m` as history: the first straight piece rises elastically from the onset to the peak; beyond
/// the peak the force follows the given curve while g grows, and unloads and reloads along the
/// straight line from the onset to the curve's point at `m` (secant damage, irreversible).
#[derive(Clone, Debug)]
pub struct Shear {
    count: usize,
    /// F and dF/dg.
    force: [f64; MAX_COEFFICIENTS],
    slope: [f64; MAX_COEFFICIENTS],
    /// Phi(g) = P(g) sin g + Q(g) cos g - Q(0): P = F - F'' + .., Q = F' - F''' + ..
    potential_sine: [f64; MAX_COEFFICIENTS],
    potential_cosine: [f64; MAX_COEFFICIENTS],
    limit_sine: f64,
    /// dF/ds beyond the limit.
    limit_slope: f64,
    stitch: Option<Stitch>,
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

impl Shear {
    /// The law from polynomial coefficients (N/m, of g^0, g^1, ..), the limit angle (rad) and the
    /// points (rad, N/m) of the stitch curve, empty for none.
    ///
    /// # Errors
    /// A text for the user: what was given and what is expected.
    pub fn new(
        coefficients: &[f64],
        limit: f64,
        angles: &[f64],
        forces: &[f64],
    ) -> Result<Self, String> {
        let n = coefficients.len();
        if !(2..=MAX_COEFFICIENTS).contains(&n) || coefficients[0] != 0.0 {
            return Err(format!(
                "shear.coefficients: given {n} coefficients starting with {:?} N/m; expected 2 to \
                 {MAX_COEFFICIENTS}, of g^0, g^1, ..., the first 0 N/m (the curve is odd)",
                coefficients.first()
            ));
        }
        if !(limit > 0.0 && limit < 1.5) {
            return Err(format!(
                "shear.limit: given {limit} rad; expected more than 0, below 1.5"
            ));
        }
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
        let at = |c: &[f64], g: f64| c.iter().rev().fold(0.0, |y, a| y * g + a);
        let (f1, s1) = (at(&force, limit), at(&slope, limit));
        let weakest = (1..=200)
            .map(|i| at(&force, limit * i as f64 / 200.0))
            .fold(f1, f64::min);
        if !(weakest > 0.0 && coefficients[1] > 0.0) {
            return Err(format!(
                "shear.coefficients: F_norm falls to {weakest} N/m between 0 and the limit of \
                 {limit} rad (slope at 0: {} N/m); expected positive values all the way",
                coefficients[1]
            ));
        }
        Ok(Self {
            count: n,
            force,
            slope,
            potential_sine: p,
            potential_cosine: q,
            limit_sine: limit.sin(),
            limit_slope: s1.max(f1 / limit) / limit.cos(),
            stitch: Stitch::new(angles, forces, limit)?,
        })
    }

    /// Whether there is a stitch (and with it history).
    pub fn has_stitch(&self) -> bool {
        self.stitch.is_some()
    }

    /// Initial slope dF/dg (N/m).
    pub fn initial_slope(&self) -> f64 {
        self.force[1]
    }

    /// The yarns' part at s = sin g.
    #[inline(always)]
    pub(crate) fn yarn<V: Lanes>(&self, s: V) -> Response<V> {
        let (sine, g, beyond) = self.angle(s);
        let cosine = (V::splat(1.0) - sine * sine).sqrt();
        self.finish(s, self.yarn_at(g, sine, cosine), beyond)
    }

    /// Yarns and stitch at s, and the history after it; `m`, `m_sine`: the largest angle reached
    /// before and its sine.
    #[inline(always)]
    pub(crate) fn with_stitch<V: Lanes>(&self, s: V, m: V, m_sine: V) -> (Response<V>, V, V) {
        let (sine, g, beyond) = self.angle(s);
        let (zero, one) = (V::splat(0.0), V::splat(1.0));
        let cosine = (one - sine * sine).sqrt();
        let yarn = self.yarn_at(g, sine, cosine);
        let stretched = zero.lt(s);
        // The yarns are odd and the stitch acts for s > 0, where both have the same sign.
        let m = V::select(stretched, m.max(g), m);
        let m_sine = V::select(stretched, m_sine.max(sine), m_sine);
        let Some(t) = &self.stitch else {
            return (self.finish(s, yarn, beyond), m, m_sine);
        };
        // Secant from the onset to the curve at the largest angle, which is the rise up to the peak.
        let e = m.max(V::splat(t.peak));
        let e_sine = m_sine.max(V::splat(t.peak_sine));
        let e_cosine = (one - e_sine * e_sine).sqrt();
        let (mut height, mut work) = (zero, zero);
        for h in &t.hinges[..t.count] {
            let x = (e - V::splat(h.angle)).max(zero);
            let slope = V::splat(h.slope);
            height = height + slope * x;
            let moment = x * e_sine + e_cosine - V::splat(h.cosine);
            work = work + V::select(zero.lt(x), slope * moment, zero);
        }
        let (onset, onset_cosine) = (V::splat(t.onset), V::splat(t.onset_cosine));
        let secant = height.max(zero) / (e - onset);
        let lost = work - secant * ((e - onset) * e_sine + e_cosine - onset_cosine);
        let x = V::select(stretched, (g - onset).max(zero), zero);
        let held = V::select(
            zero.lt(x),
            secant * (x * sine + cosine - onset_cosine),
            zero,
        );
        let r = Response {
            force: yarn.force + secant * x,
            energy: yarn.energy + held + lost,
        };
        (self.finish(s, r, beyond), m, m_sine)
    }

    /// |s| and |g| up to the limit, and how far |s| lies beyond it.
    #[inline(always)]
    fn angle<V: Lanes>(&self, s: V) -> (V, V, V) {
        let (a, end) = (s.abs(), V::splat(self.limit_sine));
        let sine = a.min(end);
        (sine, asin(sine), (a - end).max(V::splat(0.0)))
    }

    #[inline(always)]
    fn yarn_at<V: Lanes>(&self, g: V, sine: V, cosine: V) -> Response<V> {
        let n = self.count;
        let p = polynomial(g, &self.potential_sine[..n]);
        let q = polynomial(g, &self.potential_cosine[..n]);
        let rest = V::splat(self.potential_cosine[0]);
        Response {
            force: polynomial(g, &self.force[..n]),
            energy: p * sine + q * cosine - rest,
        }
    }

    /// Adds the part beyond the limit and the sign.
    #[inline(always)]
    fn finish<V: Lanes>(&self, s: V, r: Response<V>, beyond: V) -> Response<V> {
        let more = V::splat(self.limit_slope) * beyond;
        Response {
            force: (r.force + more).copysign(s),
            energy: r.energy + (r.force + V::splat(0.5) * more) * beyond,
        }
    }

    /// A bound of dF/ds that is never negative, and the yarns' own stiffness: the larger of their
    /// tangent and secant over s.
    #[inline(always)]
    pub(crate) fn slopes<V: Lanes>(&self, s: V) -> (V, V) {
        let (sine, g, beyond) = self.angle(s);
        let cosine = (V::splat(1.0) - sine * sine).sqrt();
        let n = self.count;
        let tangent = polynomial(g, &self.slope[..n - 1]) / cosine;
        let small = V::splat(1e-3);
        let first = V::splat(self.force[1]);
        let ratio = polynomial(g, &self.force[..n]) / sine.max(small);
        let secant = V::select(small.lt(sine), ratio, first);
        let inside = tangent.max(secant);
        let zero = V::splat(0.0);
        let yarn = V::select(
            zero.lt(beyond),
            inside.max(V::splat(self.limit_slope)),
            inside,
        );
        let rise = self.stitch.as_ref().map_or(0.0, |t| t.rise);
        let stretched = V::select(zero.lt(s), V::splat(rise) / cosine, zero);
        (yarn + stretched, yarn)
    }
}

impl Stitch {
    fn new(angles: &[f64], forces: &[f64], limit: f64) -> Result<Option<Self>, String> {
        if angles.is_empty() && forces.is_empty() {
            return Ok(None);
        }
        let n = angles.len();
        let falling = |v: &[f64]| v.windows(2).all(|w| w[1] <= w[0]);
        let fine = n == forces.len()
            && (3..=MAX_POINTS).contains(&n)
            && angles[0] >= 0.0
            && angles.windows(2).all(|w| w[1] > w[0])
            && angles[n - 1] <= limit
            && forces[0] == 0.0
            && forces[n - 1] == 0.0
            && forces[1] > 0.0
            && falling(&forces[1..]);
        if !fine {
            return Err(format!(
                "stitch: given angles {angles:?} rad and forces {forces:?} N/m; expected 3 to \
                 {MAX_POINTS} of each, angles increasing from 0 to at most shear.limit ({limit} rad), \
                 forces 0 at the first angle, largest at the second, not increasing from there, and \
                 0 at the last"
            ));
        }
        let mut hinges = [Hinge::default(); MAX_POINTS];
        let mut before = 0.0;
        for i in 0..n {
            let after = if i + 1 < n {
                (forces[i + 1] - forces[i]) / (angles[i + 1] - angles[i])
            } else {
                0.0
            };
            let (angle, slope) = (angles[i], after - before);
            hinges[i] = Hinge {
                angle,
                cosine: angle.cos(),
                slope,
            };
            before = after;
        }
        Ok(Some(Self {
            onset: angles[0],
            onset_cosine: angles[0].cos(),
            peak: angles[1],
            peak_sine: angles[1].sin(),
            rise: forces[1] / (angles[1] - angles[0]),
            hinges,
            count: n,
        }))
    }
}
