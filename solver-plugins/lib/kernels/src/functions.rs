//! Elementary functions on lanes.

use crate::lanes::{Lanes, SHIFT};

/// Polynomial `c[0] + c[1] x + ..`.
#[inline(always)]
pub fn polynomial<V: Lanes>(x: V, c: &[f64]) -> V {
    let mut y = V::splat(0.0);
    for a in c.iter().rev() {
        y = y * x + V::splat(*a);
    }
    y
}

/// e^x with a relative error below 1e-15; x is clamped to [-708, 709].
#[inline(always)]
pub fn exp<V: Lanes>(x: V) -> V {
    // ln 2 in two parts; the first has 21 trailing zero bits, so n * HIGH is exact.
    const HIGH: f64 = 6.931_471_803_691_238e-1;
    const LOW: f64 = 1.908_214_929_270_587_7e-10;
    let x = x.max(V::splat(-708.0)).min(V::splat(709.0));
    let shifted = x * V::splat(core::f64::consts::LOG2_E) + V::splat(SHIFT);
    let n = shifted - V::splat(SHIFT);
    let r = (x - n * V::splat(HIGH)) - n * V::splat(LOW);
    // Taylor to r^13 in Estrin's order: |r| < 0.347, next term 4e-18.
    let c = |i: usize| V::splat(INVERSE_FACTORIAL[i]);
    let (r2, one) = (r * r, V::splat(1.0));
    let r4 = r2 * r2;
    let a = (c(2) + c(3) * r) + (c(4) + c(5) * r) * r2;
    let b = (c(6) + c(7) * r) + (c(8) + c(9) * r) * r2;
    let d = (c(10) + c(11) * r) + (c(12) + c(13) * r) * r2;
    let tail = (a + (b + d * r4) * r4) * r2;
    (one + (r + tail)) * shifted.power_of_two()
}

const INVERSE_FACTORIAL: [f64; 14] = {
    let mut t = [1.0; 14];
    let mut i = 1;
    while i < 14 {
        t[i] = t[i - 1] / i as f64;
        i += 1;
    }
    t
};

/// Arc sine for |x| <= 1, within 2 units in the last place (the rational approximation of
/// fdlibm's `e_asin.c`).
#[inline(always)]
pub fn asin<V: Lanes>(x: V) -> V {
    let (half, one) = (V::splat(0.5), V::splat(1.0));
    let a = x.abs();
    V::expect(a.lt(V::splat(1.0 + 1e-9)));
    let small = a.lt(half);
    let z = (one - a).max(V::splat(0.0)) * half;
    let t = V::select(small, a * a, z);
    let base = V::select(small, a, z.sqrt());
    let p = t * polynomial(t, &ASIN_P);
    let q = polynomial(t, &ASIN_Q);
    let r = base + base * (p / q);
    let y = V::select(small, r, V::splat(core::f64::consts::FRAC_PI_2) - (r + r));
    y.copysign(x)
}

const ASIN_P: [f64; 6] = [
    1.666_666_666_666_666_6e-1,
    -3.255_658_186_224_009e-1,
    2.012_125_321_348_629_3e-1,
    -4.005_553_450_067_941e-2,
    7.915_349_942_898_145e-4,
    3.479_331_075_960_212e-5,
];
const ASIN_Q: [f64; 5] = [
    1.0,
    -2.403_394_911_734_414,
    2.020_945_760_233_505_7,
    -6.882_839_716_054_533e-1,
    7.703_815_055_590_194e-2,
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Portable;

    fn each(f: impl Fn(Portable) -> Portable, x: f64) -> f64 {
        let mut out = [0.0; 8];
        f(Portable::splat(x)).store(&mut out, 0);
        out[3]
    }

    #[test]
    fn exponential_is_accurate_to_1e15_over_its_range() {
        for i in -70_000..=70_000 {
            let x = i as f64 * 0.010_1;
            if x.abs() > 708.0 {
                continue;
            }
            let (y, z) = (each(exp, x), x.exp());
            assert!((y - z).abs() <= 1e-15 * z, "exp({x}) = {y}, not {z}");
        }
        assert_eq!(each(exp, 0.0), 1.0);
        assert!(each(exp, 1e9).is_finite() && each(exp, -1e9) < 1e-300);
    }

    #[test]
    fn arc_sine_is_accurate_to_4e16_on_its_whole_domain() {
        for i in -10_000..=10_000 {
            let x = i as f64 * 1e-4;
            let (y, z) = (each(asin, x), x.asin());
            assert!(
                (y - z).abs() <= 4.5e-16 * z.abs().max(1e-300),
                "asin({x}) = {y}, not {z}"
            );
        }
    }
}
