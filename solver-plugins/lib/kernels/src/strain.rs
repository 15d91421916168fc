//! What linear laws have in common, on lanes: strains `[e11, e22, e12]` and the stresses that work on them.

use crate::Lanes;

/// Green's strain `(C - 1) / 2` of the eight lanes from `c` on, of a metric `[3][n]`.
#[inline(always)]
pub(crate) fn green_strain<V: Lanes>(metric: &[f64], n: usize, c: usize) -> [V; 3] {
    let (half, one) = (V::splat(0.5), V::splat(1.0));
    [
        half * (V::load(metric, c) - one),
        half * (V::load(metric, n + c) - one),
        half * V::load(metric, 2 * n + c),
    ]
}

/// Writes the stresses `s` that are linear in the strains `e` to `to` (`[3][n]`), and half their work to `energy` (`[n]`).
#[inline(always)]
pub(crate) fn store_with_work<V: Lanes>(
    s: [V; 3],
    e: [V; 3],
    n: usize,
    c: usize,
    to: &mut [f64],
    energy: &mut [f64],
) {
    s[0].store(to, c);
    s[1].store(to, n + c);
    s[2].store(to, 2 * n + c);
    let twice = s[0] * e[0] + s[1] * e[1] + V::splat(2.0) * s[2] * e[2];
    (V::splat(0.5) * twice).store(energy, c);
}
