//! The thesis' hypoelastic form (eqs 3.10-3.23) in the metric.
//!
//! Each family carries its fibre stress and a shear stress in its own frame [fibre, in-plane unit
//! vector square to it, on the other family's side]; increments are added frame by frame, and the two frames are
//! superposed. With h = h0 / J (incompressible) the Kirchhoff resultants are `h0 sigma`, so
//!
//! `S11 = (N1 - 2 T1 s / c) / C11`, `S22 = (N2 - 2 T2 s / c) / C22`, `S12 = (T1 + T2) / (c l1 l2)`,
//!
//! c = cos g. Increments, from the strain increments in the frames: `dN_i = k dl_i / l_i` and
//! `dT_i = d[F_norm cos g / 2] +- d/dg(F_norm cos g / 2) tan g (dl2/l2 - dl1/l1)`: eq. 3.21 read as
//! stress over angle (not as a modulus), and half of it for each frame because both add theirs.
//! The frames turn with the fibres, so what eqs 3.10-3.17 do by polar decomposition needs no
//! rotation here. Strain increments are taken at mid-step; the sine is clamped to 0.985 (80 deg).

use super::ply::{Fabric, LEAST, tangents};
use super::shear::ShearOf;
use super::yarn::Law;
use crate::{Lanes, WIDTH};

/// Rows: C11 - 1, C22 - 1, C12 before; N1, N2, T1, T2 (N/m); F_norm cos g / 2 (N/m) before; work
/// (J/m2); largest shear angle of the stitch and its sine. Those of a slider follow.
pub(super) const HISTORY: usize = 11;
const SINE_LIMIT: f64 = 0.985;

/// A fibre's stress from `n` after a step to the stretch `l` from `o` with the strain increment `e`, and what it does meanwhile (J/m2). A step that
/// passes l = 1 has each modulus, in tension and in compression, for its own part, where they are uneven: with one of them for all of it fibres
/// that tremble about no strain would make energy.
#[inline(always)]
fn fibre<V: Lanes>(
    [tension, compression]: [V; 2],
    uneven: bool,
    n: V,
    [l, o]: [V; 2],
    e: V,
) -> (V, V) {
    let (half, one) = (V::splat(0.5), V::splat(1.0));
    let (below, was_below) = (l.lt(one), o.lt(one));
    let k = V::select(below, compression, tension);
    let (m, work) = (n + k * e, half * (n + (n + k * e)) * e);
    if !uneven {
        return (m, work);
    }
    let before = V::select(was_below, compression, tension);
    let (a, b) = (from_rest(l), from_rest(o));
    let passed = n + (k * a - before * b);
    let through = half * (passed * a - n * b);
    (
        if_passed(below, was_below, passed, m),
        if_passed(below, was_below, through, work),
    )
}

/// The strain from rest to the stretch `l`, as increments are measured.
#[inline(always)]
fn from_rest<V: Lanes>(l: V) -> V {
    let one = V::splat(1.0);
    V::splat(2.0) * (l - one) / (l + one)
}

/// `yes` where one of both is true alone.
#[inline(always)]
fn if_passed<V: Lanes>(below: V::Mask, was_below: V::Mask, yes: V, no: V) -> V {
    let from_below = V::select(was_below, no, yes);
    V::select(below, from_below, V::select(was_below, yes, no))
}

/// Stresses and energies from the metric and the [`HISTORY`]; `stiffness` may be empty.
/// Long, as it is the loop of a kernel: pieces of it would share most of its values, and its speed would hang on how they are inlined.
#[inline(always)]
pub(super) fn membrane<V: Lanes, L: Law, const SLIDES: bool>(
    f: &Fabric,
    law: ShearOf<'_, L>,
    n: usize,
    metric: &[f64],
    history: &mut [f64],
    stress: &mut [f64],
    energy: &mut [f64],
    stiffness: &mut [f64],
) {
    let (half, one, two) = (V::splat(0.5), V::splat(1.0), V::splat(2.0));
    let (least, end) = (V::splat(LEAST), V::splat(SINE_LIMIT));
    let (tension, compression) = (f.tension.map(V::splat), f.compression.map(V::splat));
    let uneven = f.tension != f.compression;
    for c in (0..n).step_by(WIDTH) {
        let row = |h: &[f64], r: usize| V::load(h, r * n + c);
        let raw: [V; 3] = [row(metric, 0), row(metric, 1), row(metric, 2)];
        let (c11, c22) = (raw[0].max(least), raw[1].max(least));
        let (p11, p22) = (
            (row(history, 0) + one).max(least),
            (row(history, 1) + one).max(least),
        );
        let (l1, l2, o1, o2) = (c11.sqrt(), c22.sqrt(), p11.sqrt(), p22.sqrt());
        let (r1, r2) = (one / l1, one / l2);
        let s = (raw[2] * (r1 * r2)).max(-end).min(end);
        let before = (row(history, 2) * (one / (o1 * o2))).max(-end).min(end);
        let cosine = (one - s * s).sqrt();
        // Increments of the fibres' logarithmic strains and of the angle at mid-step.
        let e1 = two * (l1 - o1) / (l1 + o1);
        let e2 = two * (l2 - o2) / (l2 + o2);
        let ratio = s / cosine;
        let middle = half * (ratio + before / (one - before * before).sqrt());
        let moduli = |family: usize| [tension[family], compression[family]];
        let (m1, w1) = fibre(moduli(0), uneven, row(history, 3), [l1, o1], e1);
        let (m2, w2) = fibre(moduli(1), uneven, row(history, 4), [l2, o2], e2);
        // Shear stress of each frame.
        let (mut response, g, gs) = law.with_stitch(s, row(history, 9), row(history, 10));
        if SLIDES && let Some(slider) = &f.shear.slider {
            let tension = m1.max(V::splat(0.0)) + m2.max(V::splat(0.0));
            let slid = slider.at(s, tension, row(history, 11), row(history, 12));
            slid.stands.store(history, HISTORY * n + c);
            slid.lost.store(history, (HISTORY + 1) * n + c);
            response.force = response.force + slid.force;
        }
        let q = half * response.force * cosine;
        let (mut bound, yarn) = law.slopes(s);
        if SLIDES && let Some(slider) = &f.shear.slider {
            bound = bound + V::splat(slider.stiffness);
        }
        let modulus = half * (yarn * cosine - response.force * s / cosine) * cosine;
        let lean = modulus * middle * (e2 - e1);
        let dq = q - row(history, 7);
        let (t1, t2) = (row(history, 5), row(history, 6));
        let (u1, u2) = (t1 + dq + lean, t2 + dq - lean);
        // Work: the stress at mid-step over the increments; the frames' shear strains are
        // dg +- tan g (de2 - de1).
        let dg = (s - before) / (half * (cosine + (one - before * before).sqrt()));
        let turn = middle * (e2 - e1);
        let work = row(history, 8)
            + (w1 + w2)
            + half * ((t1 + u1) * (dg + turn) + (t2 + u2) * (dg - turn));
        for (r, v) in [
            (0, raw[0] - one),
            (1, raw[1] - one),
            (2, raw[2]),
            (3, m1),
            (4, m2),
            (5, u1),
            (6, u2),
            (7, q),
            (8, work),
            (9, g),
            (10, gs),
        ] {
            v.store(history, r * n + c);
        }
        let (i1, i2) = (r1 * r1, r2 * r2);
        ((m1 - two * u1 * ratio) * i1).store(stress, c);
        ((m2 - two * u2 * ratio) * i2).store(stress, n + c);
        ((u1 + u2) * r1 * r2 / cosine).store(stress, 2 * n + c);
        work.store(energy, c);
        if !stiffness.is_empty() {
            // d(N / C) / dE = (k - 2 N) / C^2; the frames' shear as in the energy form.
            let a1 = (tension[0] + two * m1.abs()) * i1 * i1;
            let a2 = (tension[1] + two * m2.abs()) * i2 * i2;
            let (largest, soft) = tangents(bound, s, i1, i2, a1, a2, response.force.abs());
            largest.store(stiffness, c);
            soft.store(stiffness, n + c);
        }
    }
}
