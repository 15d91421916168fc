//! Between nodes and lanes: node vectors lie together, elements want every component in a row of lanes.
//!
//! Four lanes at a time are a transposition in vector registers. Nothing is computed, so the bits are the same as
//! those of the plain loops.

use crate::LANES;
use crate::vec3::Vec3;

/// A sum at a node; the fourth component is of no use but fills a register.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[repr(C, align(32))]
pub(super) struct Sum(pub(super) [f64; 4]);

/// Writes `[node][3][LANES]` of `nodes`.
#[inline]
pub(super) fn gather(nodes: &[[u32; LANES]], x: &[Vec3], out: &mut [f64]) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: AVX2, all that it asks for, was found the line above.
        return unsafe { wide::gather(nodes, x, out) };
    }
    for (nodes, rows) in nodes.iter().zip(out.chunks_exact_mut(3 * LANES)) {
        let (a, rest) = rows.split_at_mut(LANES);
        let (b, c) = rest.split_at_mut(LANES);
        for l in 0..LANES {
            let p = x[nodes[l] as usize];
            (a[l], b[l], c[l]) = (p[0], p[1], p[2]);
        }
    }
}

/// Adds, or takes off when `minus`, the rows `[3][LANES]` at the places of the first `count` lanes.
#[inline]
pub(super) fn scatter(
    places: &[u16; LANES],
    count: usize,
    rows: &[f64],
    minus: bool,
    to: &mut [Sum],
) {
    #[cfg(target_arch = "x86_64")]
    if count == LANES && std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: AVX2, all that it asks for, was found the line above.
        return unsafe { wide::scatter(places, rows, minus, to) };
    }
    let (x, rest) = rows[..3 * LANES].split_at(LANES);
    let (y, z) = rest.split_at(LANES);
    let sign = if minus { -1.0 } else { 1.0 };
    for l in 0..count.min(LANES) {
        let t = &mut to[places[l] as usize].0;
        t[0] += sign * x[l];
        t[1] += sign * y[l];
        t[2] += sign * z[l];
    }
}

#[cfg(target_arch = "x86_64")]
mod wide {
    use super::{LANES, Sum, Vec3};
    use std::arch::x86_64::*;

    #[target_feature(enable = "avx2")]
    pub(super) fn gather(nodes: &[[u32; LANES]], x: &[Vec3], out: &mut [f64]) {
        // The fourth component would be the next node's first, and past the end at the last node.
        let three = _mm256_set_epi64x(0, -1, -1, -1);
        for (nodes, rows) in nodes.iter().zip(out.chunks_exact_mut(3 * LANES)) {
            for l in (0..LANES).step_by(4) {
                let at = |i: usize| {
                    let node: &Vec3 = &x[nodes[l + i] as usize];
                    // SAFETY: the mask has the three components of the node alone.
                    unsafe { _mm256_maskload_pd(node.as_ptr(), three) }
                };
                let (a, b, c, d) = (at(0), at(1), at(2), at(3));
                let (ab_xz, cd_xz) = (_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d));
                let (ab_y, cd_y) = (_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d));
                let row = [
                    _mm256_permute2f128_pd::<0x20>(ab_xz, cd_xz),
                    _mm256_permute2f128_pd::<0x20>(ab_y, cd_y),
                    _mm256_permute2f128_pd::<0x31>(ab_xz, cd_xz),
                ];
                for (k, row) in row.into_iter().enumerate() {
                    let to = &mut rows[k * LANES + l..k * LANES + l + 4];
                    // SAFETY: four places, as sliced.
                    unsafe { _mm256_storeu_pd(to.as_mut_ptr(), row) };
                }
            }
        }
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn scatter(places: &[u16; LANES], rows: &[f64], minus: bool, to: &mut [Sum]) {
        for l in (0..LANES).step_by(4) {
            let row = |k: usize| {
                let from = &rows[k * LANES + l..k * LANES + l + 4];
                // SAFETY: four places, as sliced.
                unsafe { _mm256_loadu_pd(from.as_ptr()) }
            };
            let (x, y, z) = (row(0), row(1), row(2));
            let (even, odd) = (_mm256_unpacklo_pd(x, y), _mm256_unpackhi_pd(x, y));
            let (even_z, odd_z) = (_mm256_unpacklo_pd(z, z), _mm256_unpackhi_pd(z, z));
            let vectors = [
                _mm256_permute2f128_pd::<0x20>(even, even_z),
                _mm256_permute2f128_pd::<0x20>(odd, odd_z),
                _mm256_permute2f128_pd::<0x31>(even, even_z),
                _mm256_permute2f128_pd::<0x31>(odd, odd_z),
            ];
            for (i, vector) in vectors.into_iter().enumerate() {
                let sum = to[places[l + i] as usize].0.as_mut_ptr();
                // SAFETY: the four doubles of a sum, which is aligned to its 32 bytes and borrowed alone.
                unsafe {
                    let old = _mm256_load_pd(sum);
                    let new = if minus {
                        _mm256_sub_pd(old, vector)
                    } else {
                        _mm256_add_pd(old, vector)
                    };
                    _mm256_store_pd(sum, new);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lanes_and_nodes_hold_the_same_numbers() {
        let x: Vec<Vec3> = (0..40)
            .map(|i| std::array::from_fn(|c| f64::from(i) + 0.01 * c as f64))
            .collect();
        // Also the last node, and one twice.
        let nodes: [[u32; LANES]; 2] = [
            std::array::from_fn(|l| 39 - l as u32),
            std::array::from_fn(|l| (7 * l as u32) % 20),
        ];
        let mut out = vec![f64::NAN; 6 * LANES];
        gather(&nodes, &x, &mut out);
        for k in 0..2 {
            for c in 0..3 {
                for l in 0..LANES {
                    assert_eq!(out[(3 * k + c) * LANES + l], x[nodes[k][l] as usize][c]);
                }
            }
        }
        let places: [u16; LANES] = std::array::from_fn(|l| ((7 * l) % 20) as u16);
        for (count, minus) in [(LANES, false), (LANES, true), (13, true)] {
            let mut sums = vec![Sum([0.5; 4]); 20];
            scatter(&places, count, &out[..3 * LANES], minus, &mut sums);
            let mut expected = vec![[0.5; 3]; 20];
            for l in 0..count {
                for (c, e) in expected[places[l] as usize].iter_mut().enumerate() {
                    let f = out[c * LANES + l];
                    *e += if minus { -f } else { f };
                }
            }
            for (sum, expected) in sums.iter().zip(expected) {
                assert_eq!(sum.0[..3], expected);
            }
        }
    }
}
