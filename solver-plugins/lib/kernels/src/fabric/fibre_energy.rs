//! The form `fibre-energy`: an energy of the fibres' stretches and of the sine of the shear angle.

use super::crossing::Tangents;
use super::ply::{Fabric, LEAST, tangents};
use super::shear::ShearOf;
use super::yarn::Law;
use crate::{Lanes, WIDTH};

/// Rows of history with a stitch: largest shear angle, its sine. Those of a slider follow, and then the stitch's are there in any case.
pub(super) const HISTORY: usize = 2;

/// Stresses and energies from the metric; the history is that of the stitch, `stiffness` may be empty. `MORE`: whether yarns may rub, fibres
/// follow a curve in compression, or families cross at another angle than a right one, which is known when it is compiled, as the tests for it would
/// cost the others a tenth of their time.
/// Long, as it is the loop of a kernel: pieces of it would share most of its values, and its speed would hang on how they are inlined.
#[inline(always)]
pub(super) fn membrane<V: Lanes, L: Law, const MORE: bool>(
    f: &Fabric,
    law: ShearOf<'_, L>,
    n: usize,
    metric: &[f64],
    history: &mut [f64],
    stress: &mut [f64],
    energy: &mut [f64],
    stiffness: &mut [f64],
) {
    let (one, half) = (V::splat(1.0), V::splat(0.5));
    let [tension_1, tension_2] = f.tension.map(V::splat);
    let [compression_1, compression_2] = f.compression.map(V::splat);
    let [stiffest_1, stiffest_2] = f.stiffest.map(V::splat);
    for c in (0..n).step_by(WIDTH) {
        let of = [0, 1, 2].map(|r| V::load(metric, r * n + c));
        let mut own = of;
        if MORE && let Some(crossing) = &f.crossing {
            own = crossing.metric(of);
        }
        let [c11, c22] = [own[0], own[1]].map(|square| square.max(V::splat(LEAST)));
        let c12 = own[2];
        let (i1, i2) = (one / c11, one / c22);
        // 1/l, and l = C / l: one division and one root for each family.
        let (r1, r2) = (i1.sqrt(), i2.sqrt());
        let (d1, d2) = (c11 * r1 - one, c22 * r2 - one);
        let zero = V::splat(0.0);
        let k1 = V::select(d1.lt(zero), compression_1, tension_1);
        let k2 = V::select(d2.lt(zero), compression_2, tension_2);
        let (mut n1, mut n2) = (k1 * d1, k2 * d2);
        let mut fibres = half * (n1 * d1 + n2 * d2);
        if MORE && let Some([crush_1, crush_2]) = &f.crush {
            let ((m1, w1), (m2, w2)) = (crush_1.at(d1), crush_2.at(d2));
            let either = |d: V, crushed: V, pulled: V| V::select(d.lt(zero), crushed, pulled);
            fibres = either(d1, w1, half * n1 * d1) + either(d2, w2, half * n2 * d2);
            (n1, n2) = (either(d1, m1, n1), either(d2, m2, n2));
        }
        let rr = r1 * r2;
        let s = c12 * rr;
        let mut shear = if law.stitch.is_some() {
            let (g, sine) = (V::load(history, c), V::load(history, n + c));
            let (shear, g, sine) = law.with_stitch(s, g, sine);
            g.store(history, c);
            sine.store(history, n + c);
            shear
        } else {
            law.yarn(s)
        };
        if MORE && let Some(slider) = &f.shear.slider {
            let tension = n1.max(zero) + n2.max(zero);
            let row = |r: usize| (HISTORY + r) * n + c;
            let (stands, lost) = (V::load(history, row(0)), V::load(history, row(1)));
            let slid = slider.at(s, tension, stands, lost);
            slid.stands.store(history, row(0));
            slid.lost.store(history, row(1));
            shear.force = shear.force + slid.force;
            shear.energy = shear.energy + slid.energy;
        }
        let fs = shear.force * s;
        let mut carried = [n1 * r1 - fs * i1, n2 * r2 - fs * i2, shear.force * rr];
        if MORE && let Some(crossing) = &f.crossing {
            carried = crossing.stress(of, carried);
        }
        carried[0].store(stress, c);
        carried[1].store(stress, n + c);
        carried[2].store(stress, 2 * n + c);
        (fibres + shear.energy).store(energy, c);
        if !stiffness.is_empty() {
            let mut slope = law.slopes(s).0;
            if MORE && let Some(slider) = &f.shear.slider {
                slope = slope + V::splat(slider.stiffness);
            }
            // Of a curve N(e), dS/dE = (N' l + N) / l^3: at most its largest slope over l^3, as N is at most that times e = 1 - l.
            let (a1, a2) = (stiffest_1 * i1 * r1, stiffest_2 * i2 * r2);
            let force = shear.force.abs();
            let (mut largest, mut soft) = tangents(slope, s, i1, i2, a1, a2, force);
            if MORE && let Some(crossing) = &f.crossing {
                // Friction that grows with the tension of fibres, which shear of the axes stretches.
                let per_tension = f.shear.slider.as_ref().map_or(0.0, |s| s.per_tension);
                let steepest = (stiffest_1 * r1).max(stiffest_2 * r2);
                let told = Tangents {
                    fibres: [a1, a2],
                    largest: largest + V::splat(per_tension) * steepest * rr,
                    shear: force * rr,
                };
                (largest, soft) = crossing.tangents(of, &told);
            }
            largest.store(stiffness, c);
            soft.store(stiffness, n + c);
        }
    }
}
