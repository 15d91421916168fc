//! Moments with the tangent at the previous curvature (thesis 3.3.3).

use crate::{Lanes, WIDTH, dispatch};

/// Rows: M (3), k (3), dM/dk (3) after the previous step; work done (J/m2); 1 after the first call.
pub(super) const HISTORY: usize = 11;
const STARTED: usize = 10;
const WORK: usize = 9;

// In: curvature and its tangents now; moment and energy as the law gives them, which count in the
// first call. Out: moment and energy as they have grown. `[3][n]`, energy `[n]`.
dispatch!(pub(super) fn moments(
    n: usize,
    curvature: &[f64],
    tangent: &[f64],
    history: &mut [f64],
    moment: &mut [f64],
    energy: &mut [f64],
) = moments_kernel);

#[inline(always)]
fn moments_kernel<V: Lanes>(
    n: usize,
    curvature: &[f64],
    tangent: &[f64],
    history: &mut [f64],
    moment: &mut [f64],
    energy: &mut [f64],
) {
    let half = V::splat(0.5);
    for c in (0..n).step_by(WIDTH) {
        let at = |r: usize| r * n + c;
        let started = half.lt(V::load(history, at(STARTED)));
        let mut work = V::load(history, at(WORK));
        for a in 0..3 {
            let before = V::load(history, at(a));
            let k = V::load(curvature, at(a));
            let dk = k - V::load(history, at(3 + a));
            let grown = before + V::load(history, at(6 + a)) * dk;
            let m = V::select(started, grown, V::load(moment, at(a)));
            // dW = M11 dk11 + M22 dk22 + 2 M12 dk12; the mean moment over the step.
            let twice = if a == 2 { V::splat(2.0) } else { V::splat(1.0) };
            work = work + twice * half * (before + m) * dk;
            m.store(moment, at(a));
            m.store(history, at(a));
            k.store(history, at(3 + a));
            V::load(tangent, at(a)).store(history, at(6 + a));
        }
        let work = V::select(started, work, V::load(energy, c));
        work.store(energy, c);
        work.store(history, at(WORK));
        V::splat(1.0).store(history, at(STARTED));
    }
}
