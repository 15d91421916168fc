//! What all contacts have in common: penalty, multiplier, friction force, and how long nodes sleep.

use crate::vec3::{dot, scale, sub};

/// Runs of slaves that a thread takes at most without leaving some to the others: how much there is to do in one is not known before.
pub(super) const TOGETHER: usize = 8;

/// Penetration (m) with which a multiplier is content where surfaces touch at the distance `offset` (m): half a percent
/// of it, and at most a micrometre, so that thick sheets do not sink in further than thin ones.
#[inline]
pub(super) fn content(offset: f64) -> f64 {
    (0.005 * offset).min(1e-6)
}

/// How multipliers follow penetrations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Follow {
    /// Share of the penalty force that a step adds to the multiplier.
    pub share: f64,
    /// Penetration (m) with which it is content.
    pub rest: f64,
    /// Penetration (m) from which on it grows faster: no more than a tenth of the thinner body. Infinite: never.
    pub deep: f64,
    /// Motion (m) in a step with which it does so no longer; infinite: whatever the motion.
    pub swift: f64,
}

/// How much faster than by its share a multiplier grows at most, where a contact is deep.
///
/// While a load grows at a constant rate, a multiplier lags behind it by a constant penetration. That is as much as the penalty alone
/// would bear of what is added in 1 / share steps: with 0.003 a film landed on the bed by its whole thickness, and plies sank by a third of a film
/// into those that wrap around their edges. A larger share for all penetrations feeds motions (`docs/decisions/0004`), so it is larger where a
/// contact is deep and nowhere else.
const FASTER: f64 = 8.0;

/// What a deep contact of two sheets may move by in a step for its multiplier to grow faster, over [`Follow::deep`]. One that lags behind a load
/// deepens by as much in hundreds of steps; one that chatters moves by a tenth of it in each, and would be fed: few nodes on the crests of
/// wrinkles had put 2 % of the external work in. On rigid surfaces there are no such crests.
pub(super) const SWIFT: f64 = 0.01;

impl Follow {
    /// What is added to the multiplier for a gap (m, negative inside) that has opened by `opened` (m) in the step, over stiffness and share.
    #[inline(always)]
    fn beyond(self, gap: f64, opened: f64) -> f64 {
        let lag = (-gap - self.rest).max(0.0);
        let mut grows = lag;
        if lag > self.deep {
            let slowly = (1.0 - opened.abs() / self.swift).max(0.0);
            grows += FASTER * slowly * lag * (lag / self.deep - 1.0).min(1.0);
        }
        grows - gap.max(0.0)
    }
}

/// How fast things may come nearer to each other, for nodes that sleep until they can touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Step (s).
    pub dt: f64,
    /// Bound of a relative speed (m/s), whatever it is now.
    pub speed: f64,
    /// Bound of a relative acceleration (m/s2); infinite where there is none.
    pub acceleration: f64,
    /// What presses sheets on each other now over what did in the last step: multipliers grow with it, and need not wait for penetrations.
    pub growth: f64,
}

impl Pace {
    /// Steps in which a gap (m) cannot close, at the relative speed `now` (m/s): the better of what the two bounds say, at
    /// most `most`. Small gaps at rest last by the acceleration, large ones by the speed.
    #[inline]
    pub(super) fn steps(&self, gap: f64, now: f64, most: f64) -> u64 {
        debug_assert!(gap >= 0.0 && now >= 0.0);
        let mut time = gap / self.speed;
        let a = self.acceleration;
        if a.is_finite() {
            time = time.max(((now * now + 2.0 * a * gap).sqrt() - now) / a);
        }
        (time / self.dt).min(most) as u64
    }
}

/// Number of the call up to which a node sleeps: `cycle + steps`. In 32 bits, for every node has one; a run of more calls
/// (seven weeks at a millisecond each) finds its nodes awake.
#[inline]
pub(super) fn waking(cycle: u64, steps: u64) -> u32 {
    (cycle + steps).min(u64::from(u32::MAX)) as u32
}

/// Constants that all contacts share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactSettings {
    /// Normal stiffness over (reduced mass / step^2).
    pub stiffness_factor: f64,
    /// Elastic-slip stiffness over the normal stiffness.
    pub slip_factor: f64,
    /// Damping of the normal approach over critical.
    pub damping_ratio: f64,
    /// Share of the penalty force that a step adds to the multiplier.
    pub augmentation: f64,
}

/// Nodes of a coarse sheet that may ride on a single node of a finer one: those of three by three elements around it.
const RIDING: f64 = 16.0;

impl ContactSettings {
    /// Largest augmentation with which multipliers do not feed a motion of a sheet that rests on single nodes of another one, each of
    /// which has `mass_ratio` of the mass of a node of the first.
    ///
    /// A mass M on a contact of stiffness k and damping c, whose multiplier grows by a k x in each step dt, moves as M s^3 + c s^2 + k s +
    /// a k / dt = 0, and comes to rest while a < c dt / M (Routh and Hurwitz). Stiffness and damping are those of the light node: k = f m / dt^2
    /// and c = 2 zeta sqrt(k m). With twice as large a bound a stack with 27 times as heavy nodes trembles (decision 4).
    pub fn largest_augmentation(&self, mass_ratio: f64) -> f64 {
        let damping = 2.0 * self.damping_ratio * self.stiffness_factor.sqrt();
        damping * mass_ratio / RIDING
    }
}

impl Default for ContactSettings {
    fn default() -> Self {
        Self {
            stiffness_factor: 0.3,
            slip_factor: 0.5,
            damping_ratio: 0.3,
            augmentation: 0.003,
        }
    }
}

/// What contacts did in a step (J): stored, lost to friction, lost to damping, and the work that was done on them.
#[derive(Debug, Clone, Copy, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct ContactEnergy {
    /// Stored in normal and slip springs.
    pub stored: f64,
    /// Lost to friction in the step.
    pub friction: f64,
    /// Lost to damping in the step.
    pub damping: f64,
    /// Mechanical work that was done on them in the step: by the mean of the forces before and after it. What is stored and lost beyond
    /// the sum of it has come from nothing.
    pub work: f64,
}

impl ContactEnergy {
    /// `n` times as much.
    pub fn times(&self, n: f64) -> Self {
        Self {
            stored: n * self.stored,
            friction: n * self.friction,
            damping: n * self.damping,
            work: n * self.work,
        }
    }

    /// What they store and have lost beyond the work that was done on them (J): made from nothing, or below 0 lost without a word. Of energies
    /// that are summed over steps, as those of [`crate::model::Model::interface_energies`] are.
    pub fn made(&self) -> f64 {
        self.stored + self.friction + self.damping - self.work
    }

    pub(super) fn add(&mut self, o: &Self) {
        self.stored += o.stored;
        self.friction += o.friction;
        self.damping += o.damping;
        self.work += o.work;
    }
}

/// Normal force of a contact with a multiplier.
pub(super) struct Normal {
    /// Force (N), not negative.
    pub force: f64,
    /// Multiplier for the next step (N).
    pub multiplier: f64,
    /// Mechanical work that the contact has taken up and not given back (J), slip apart.
    pub stored: f64,
    /// Work that the growing multiplier has put into the contact so far (J).
    pub work: f64,
    /// Damping loss of the step (J).
    pub loss: f64,
}

/// Penalty, multiplier and damper. `gap` (m) negative inside, `vn` (m/s) opening speed, `held` multiplier
/// (N), `work` put in by it so far (J).
///
/// The multiplier takes over what lies beyond [`Follow::rest`]. A multiplier that
/// follows every penetration lags behind an oscillation like the integral part of a controller and feeds it:
/// bags at rest came alive out of rounding. Within the band between touch and `rest` it stands still, and
/// the contact is a spring that conserves energy.
///
/// An open contact keeps its multiplier, which dies out at the rate at which it grew: to drop it at once
/// would let the sheets fall back freely over `held / stiffness`, and a bag that rattles would gain
/// energy in every cycle.
#[inline(always)]
pub(super) fn normal_force(
    gap: f64,
    vn: f64,
    dt: f64,
    stiffness: f64,
    damping: f64,
    follow: Follow,
    held: f64,
    work: f64,
) -> Normal {
    debug_assert!(stiffness > 0.0 && damping >= 0.0 && held >= 0.0);
    let spring = (held - stiffness * gap).max(0.0);
    let damper = if spring > 0.0 {
        (-damping * vn).max(-spring)
    } else {
        0.0
    };
    let multiplier = (held + follow.share * stiffness * follow.beyond(gap, vn * dt)).max(0.0);
    // Stored is F^2 / 2k; its change is mechanical work, but for what the multiplier's change puts in.
    let work = work + spring * (multiplier - held) / stiffness;
    Normal {
        force: spring + damper,
        multiplier,
        stored: 0.5 * spring * spring / stiffness - work,
        work,
        loss: -damper * vn * dt,
    }
}

/// The multiplier (N) and the work (J) put in by it of a contact whose load has grown by the factor `growth` since the last step: what presses
/// steadily presses in proportion to its load. The spring's force grows by as much, so what is stored grows by what is put in.
#[inline(always)]
pub(super) fn grown(held: f64, work: f64, growth: f64, stiffness: f64, gap: f64) -> (f64, f64) {
    let more = held * (growth - 1.0);
    let before = held - stiffness * gap;
    if more == 0.0 || before <= 0.0 || before + more <= 0.0 {
        return (held, work);
    }
    (held + more, work + (before + 0.5 * more) * more / stiffness)
}

/// Friction of a contact in a step.
pub(super) struct Tangential {
    /// Traction held by the slip spring (N).
    pub slip: [f64; 3],
    /// Force (N): the spring's and the damper's, together within Coulomb's limit.
    pub force: [f64; 3],
    /// Lost to sliding (J).
    pub friction: f64,
    /// Lost in the damper (J).
    pub damping: f64,
    /// Stored in the spring (J).
    pub stored: f64,
}

/// Coulomb friction with an elastic-slip spring of stiffness `k` (N/m) and a damper `c` (N s/m) beside it.
/// `held` (N) is the spring's force so far, in the plane of contact; `vt` (m/s) the sliding velocity;
/// `limit` (N) the coefficient times the normal force. The damper calms a node that sticks in a fold of its
/// master, where the direction of the normal force jumps.
#[inline(always)]
pub(super) fn friction_force(
    held: [f64; 3],
    vt: [f64; 3],
    dt: f64,
    k: f64,
    c: f64,
    limit: f64,
) -> Tangential {
    let trial = sub(held, scale(vt, k * dt));
    // By squares: a contact that sticks, as most do, needs no root.
    let (most, size) = (limit * limit, dot(trial, trial));
    let (slip, friction) = if size <= most {
        (trial, 0.0)
    } else {
        let size = size.sqrt();
        (scale(trial, limit / size), limit * (size - limit) / k)
    };
    let both = sub(slip, scale(vt, c));
    let size = dot(both, both);
    let force = if size > most {
        scale(both, limit / size.sqrt())
    } else {
        both
    };
    let damping = -dot(sub(force, slip), vt) * dt;
    // Sliding loses energy, and so does the damper: the force is what is nearest to both within the limit.
    debug_assert!(friction >= 0.0 && damping >= -1e-9 * limit * dot(vt, vt).sqrt() * dt);
    Tangential {
        slip,
        force,
        friction,
        damping,
        stored: 0.5 * dot(slip, slip) / k,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Growth per step of the swinging of a mass on a contact, whose light side has the mass 1, in steps of 1: from its heights at two
    /// passages through rest with 20 cycles between.
    fn growth(mass: f64, augmentation: f64) -> f64 {
        let settings = ContactSettings::default();
        let stiffness = settings.stiffness_factor;
        let damping = 2.0 * settings.damping_ratio * stiffness.sqrt();
        let weight = 1.0;
        let (mut held, mut work) = (weight, 0.0);
        let (mut x, mut v) = (1e-3 * weight / stiffness, 0.0);
        let period = std::f64::consts::TAU * (mass / stiffness).sqrt();
        let (mut peaks, mut peak) = (Vec::new(), 0.0f64);
        for step in 0..(26.0 * period) as u64 {
            let follow = Follow {
                share: augmentation,
                rest: 0.0,
                deep: f64::INFINITY,
                swift: f64::INFINITY,
            };
            let n = normal_force(x, v, 1.0, stiffness, damping, follow, held, work);
            (held, work) = (n.multiplier, n.work);
            v += (n.force - weight) / mass;
            let before = x;
            x += v;
            peak = peak.max(x);
            if before < 0.0 && x >= 0.0 {
                peaks.push((step as f64, peak));
                peak = 0.0;
            }
        }
        let ((t0, p0), (t1, p1)) = (peaks[2], peaks[22]);
        (p1 / p0).ln() / (t1 - t0)
    }

    /// Real part of the swinging roots of M s^3 + c s^2 + k s + a k = 0.
    fn root(mass: f64, augmentation: f64) -> f64 {
        use nalgebra::{Complex, Matrix3};
        let k = ContactSettings::default().stiffness_factor;
        let c = 2.0 * ContactSettings::default().damping_ratio * k.sqrt();
        let companion = Matrix3::new(
            -c / mass,
            -k / mass,
            -augmentation * k / mass,
            1.0,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0,
        );
        let roots = companion.complex_eigenvalues();
        let swings = |s: &&Complex<f64>| s.im > 0.0;
        roots.iter().find(swings).expect("swinging roots").re
    }

    #[test]
    fn multipliers_feed_a_mass_that_rides_on_a_light_node_beyond_the_bound_and_not_below_it() {
        let ratio = 1.0 / 27.0;
        let mass = RIDING / ratio;
        let bound = ContactSettings::default().largest_augmentation(ratio);
        let damped = root(mass, 0.0);
        for (share, sign) in [(0.0, -1.0), (0.5, -1.0), (2.0, 1.0), (4.0, 1.0)] {
            let a = share * bound;
            let (got, expected) = (growth(mass, a), root(mass, a));
            assert!(got * sign > 0.0, "{share} of the bound: {got:.3e}");
            let error = (got - expected).abs() / damped.abs();
            assert!(
                error < 0.03,
                "{share} of the bound: {got:.4e}, not {expected:.4e}"
            );
        }
        assert!(root(mass, bound).abs() < 1e-3 * damped.abs());
    }

    /// How deep (over `deep`) a mass on a contact with a multiplier lies at last while its load grows by `rate` (over stiffness, share and `deep`)
    /// in each step.
    fn lag(rate: f64, follow: Follow) -> f64 {
        let settings = ContactSettings::default();
        let (k, scale) = (settings.stiffness_factor, 1e-3);
        let c = 2.0 * settings.damping_ratio * k.sqrt();
        let (mut held, mut work, mut x, mut v, mut load) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for _ in 0..20_000 {
            let n = normal_force(x, v, 1.0, k, c, follow, held, work);
            (held, work) = (n.multiplier, n.work);
            v += n.force - load;
            x += v;
            load += rate * k * follow.share * scale;
        }
        -x / scale
    }

    #[test]
    fn a_growing_load_is_followed_within_little_more_than_a_tenth_where_a_share_for_all_depths_lags_by_a_third()
     {
        let share = ContactSettings::default().augmentation;
        let follow = |deep: f64| Follow {
            share,
            rest: 0.0,
            deep,
            swift: SWIFT * deep,
        };
        // With one share for all depths the lag is rate / (k share).
        let plain = lag(3.2, follow(f64::INFINITY));
        assert!((plain - 3.2).abs() < 1e-3, "{plain}");
        // d (1 + 8 (d - 1)) = 3.2
        let got = lag(3.2, follow(1e-3));
        let expected = (7.0 + (49.0f64 + 4.0 * 8.0 * 3.2).sqrt()) / 16.0;
        assert!((got - expected).abs() < 1e-3, "{got}, not {expected}");
        // Up to `deep` nothing is different, to the last bit.
        let shallow = lag(0.9, follow(1e-3));
        assert_eq!(shallow.to_bits(), lag(0.9, follow(f64::INFINITY)).to_bits());
    }
}
