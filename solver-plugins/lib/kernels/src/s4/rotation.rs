//! Vectors on lanes, and finite rotations of directors.
//!
//! Written out component by component: what `array::from_fn` and `array::map` call is not compiled
//! for the instruction set of the kernel, which costs a factor of ten.

use crate::lanes::{Lanes, SHIFT};

type V3<V> = [V; 3];

/// `a . b`.
#[inline(always)]
pub(super) fn dot<V: Lanes>(a: &V3<V>, b: &V3<V>) -> V {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a x b`.
#[inline(always)]
pub(super) fn cross<V: Lanes>(a: &V3<V>, b: &V3<V>) -> V3<V> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// `p a + q b`.
#[inline(always)]
pub(super) fn mix<V: Lanes>(p: V, a: &V3<V>, q: V, b: &V3<V>) -> V3<V> {
    [
        p * a[0] + q * b[0],
        p * a[1] + q * b[1],
        p * a[2] + q * b[2],
    ]
}

/// `a - b`.
#[inline(always)]
pub(super) fn sub<V: Lanes>(a: &V3<V>, b: &V3<V>) -> V3<V> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `p a`.
#[inline(always)]
pub(super) fn scaled<V: Lanes>(p: V, a: &V3<V>) -> V3<V> {
    [p * a[0], p * a[1], p * a[2]]
}

/// The unit vector d turned by the rotation vector t (Rodrigues), any angle, and renormalised:
/// `d cos a + (t x d) sin a / a + t (t . d) (1 - cos a) / a^2`, a = |t|.
///
/// A lane that turns by less than [`SMALL`], which in a step of a run nearly all do, has `sin a / a` and
/// `(1 - cos a) / a^2` as Taylor series in a^2 of four terms (truncation below 1e-17): no root, no quotient. In the others sine
/// and cosine are Taylor series at a quarter of the angle (at most pi/4 after whole turns are taken off; truncation below
/// 1e-16), doubled twice, and `(1 - cos a) / a^2` is `(sin(a/2) / (a/2))^2 / 2`, which has no cancellation.
///
/// Each lane has its own way, whatever its neighbours do: that none goes the long way only saves the work.
#[inline(always)]
pub(super) fn turn<V: Lanes>(d: &V3<V>, t: &V3<V>) -> V3<V> {
    let squared = dot(t, t);
    let small = squared.lt(V::splat(SMALL * SMALL));
    let (sine, versine) = (cubic(&SINC, squared), cubic(&VERSINE, squared));
    let cosine = V::splat(1.0) - squared * versine;
    if V::all(small) {
        return rotated(d, t, sine, cosine, versine);
    }
    let long = long_way(squared);
    let pick = |short: V, long: V| V::select(small, short, long);
    rotated(
        d,
        t,
        pick(sine, long[0]),
        pick(cosine, long[1]),
        pick(versine, long[2]),
    )
}

/// `sin a / a`, `cos a` and `(1 - cos a) / a^2` of any angle, from its square.
#[inline(always)]
fn long_way<V: Lanes>(squared: V) -> V3<V> {
    let (one, two, half) = (V::splat(1.0), V::splat(2.0), V::splat(0.5));
    // The floor keeps the quotients below defined; at 1e-100 rad they are 1 and 1/2.
    let a = squared.sqrt().max(V::splat(1e-100));
    let turns =
        (a * V::splat(core::f64::consts::FRAC_1_PI * 0.5) + V::splat(SHIFT)) - V::splat(SHIFT);
    let rest = a - turns * V::splat(core::f64::consts::TAU);
    let q = V::splat(0.25) * rest;
    let z = q * q;
    let (mut s, mut c) = (V::splat(0.0), V::splat(0.0));
    for i in (0..SINE.len()).rev() {
        s = s * z + V::splat(SINE[i]);
        c = c * z + V::splat(COSINE[i]);
    }
    let s = s * q;
    // Half the angle, then the angle.
    let (s2, c2) = (two * s * c, one - two * s * s);
    let (s4, c4) = (two * s2 * c2, one - two * s2 * s2);
    let over = one / a;
    let along = two * s2 * over;
    [s4 * over, c4, half * along * along]
}

#[inline(always)]
fn cubic<V: Lanes>(c: &[f64; 4], x: V) -> V {
    ((V::splat(c[3]) * x + V::splat(c[2])) * x + V::splat(c[1])) * x + V::splat(c[0])
}

/// Of a rotation by a: sin a / a, cos a, (1 - cos a) / a^2.
#[inline(always)]
fn rotated<V: Lanes>(d: &V3<V>, t: &V3<V>, sine: V, cosine: V, versine: V) -> V3<V> {
    let (td, x) = (dot(t, d), cross(t, d));
    let r = mix(cosine, d, versine * td, t);
    let r = [r[0] + sine * x[0], r[1] + sine * x[1], r[2] + sine * x[2]];
    // One Newton step to length 1: the length is off by rounding alone.
    scaled(V::splat(1.5) - V::splat(0.5) * dot(&r, &r), &r)
}

/// Angle (rad).
const SMALL: f64 = 0.03;
const SINC: [f64; 4] = [1.0, -1.0 / 6.0, 1.0 / 120.0, -1.0 / 5040.0];
const VERSINE: [f64; 4] = [0.5, -1.0 / 24.0, 1.0 / 720.0, -1.0 / 40_320.0];

const SINE: [f64; 9] = [
    1.0,
    -1.0 / 6.0,
    1.0 / 120.0,
    -1.0 / 5040.0,
    1.0 / 362_880.0,
    -1.0 / 39_916_800.0,
    1.0 / 6_227_020_800.0,
    -1.0 / 1_307_674_368_000.0,
    1.0 / 355_687_428_096_000.0,
];
const COSINE: [f64; 9] = [
    1.0,
    -0.5,
    1.0 / 24.0,
    -1.0 / 720.0,
    1.0 / 40_320.0,
    -1.0 / 3_628_800.0,
    1.0 / 479_001_600.0,
    -1.0 / 87_178_291_200.0,
    1.0 / 20_922_789_888_000.0,
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Portable;

    fn turned(d: [f64; 3], t: [f64; 3]) -> [f64; 3] {
        let r = turn(&d.map(Portable::splat), &t.map(Portable::splat));
        r.map(|x| {
            let mut out = [0.0; 8];
            x.store(&mut out, 0);
            out[5]
        })
    }

    #[test]
    fn rotation_agrees_with_sine_and_cosine_from_zero_to_many_turns() {
        for i in 0..4000 {
            // From 1e-12 rad to 1000 rad, about an axis in the x-y plane.
            let a = 10f64.powf(-12.0 + 15.0 * i as f64 / 4000.0);
            let r = turned([0.0, 0.0, 1.0], [0.6 * a, 0.8 * a, 0.0]);
            let want = [0.8 * a.sin(), -0.6 * a.sin(), a.cos()];
            for k in 0..3 {
                let e = (r[k] - want[k]).abs();
                assert!(e < 1e-15 * (3.0 + a), "angle {a}: {r:?}, not {want:?}");
            }
        }
        assert_eq!(turned([0.0, 0.6, 0.8], [0.0; 3]), [0.0, 0.6, 0.8]);
    }

    /// The lanes of the directors (0, 0.6, 0.8) turned about x by the angles.
    fn lanes_turned(angles: [f64; 8]) -> [[u64; 8]; 3] {
        let d = [0.0, 0.6, 0.8].map(Portable::splat);
        let (t, zero) = (Portable::load(&angles, 0), Portable::splat(0.0));
        turn(&d, &[t, zero, zero]).map(|x| {
            let mut out = [0.0; 8];
            x.store(&mut out, 0);
            out.map(f64::to_bits)
        })
    }

    #[test]
    fn a_director_s_bits_do_not_depend_on_how_far_its_neighbours_turn() {
        for i in 0..200 {
            let a = 1e-4 * 1.06f64.powi(i);
            let alone = lanes_turned([a; 8]);
            for other in [0.0, 1e-5, 0.029, 0.5, 2.0] {
                for place in 0..8 {
                    let mut angles = [other; 8];
                    angles[place] = a;
                    let among = lanes_turned(angles);
                    for k in 0..3 {
                        assert_eq!(among[k][place], alone[k][0], "{a} rad among {other} rad");
                    }
                }
            }
        }
    }

    #[test]
    fn opposite_rotations_give_the_vector_back() {
        let d = [0.48, -0.6, 0.64];
        let t = [1.1, -0.3, 0.7];
        let back = turned(turned(d, t), t.map(|x| -x));
        assert!((0..3).all(|k| (back[k] - d[k]).abs() < 1e-15), "{back:?}");
    }
}
