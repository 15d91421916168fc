//! Concave folds and corners of a master, where a slave lies between several of its cells.

use super::closest::{Closest, FACES, Found};
use crate::vec3::{Vec3, dot, scale};
use nalgebra::{Matrix5, Vector5};

/// Faces that may share a slave: the closest, and the others around its corner.
const ALL: usize = FACES + 1;

/// Width of a blend over the offset and 1 - cos of the angle between two faces.
const WIDTH: f64 = 0.4;

/// By how much the blend of two faces that meet at a corner alone is narrower, over that of a face with its next.
const ACROSS: f64 = 0.5;

/// Width (m) of the blend of two faces.
fn width(a: &Closest, b: &Closest, offset: f64) -> f64 {
    WIDTH * offset * (1.0 - dot(a.arm, b.arm) / (a.distance2 * b.distance2).sqrt())
}

/// Whether a face may have a share in the slave of the closest one beside that, or beside another face that has one.
#[inline]
pub(super) fn shares(first: &Closest, beside: &Closest, other: &Closest, offset: f64) -> bool {
    let e = width(beside, other, offset);
    e > 1e-9 * offset && other.distance2.sqrt() - first.distance2.sqrt() < e
}

/// Gap and its gradient for the slave: `first` and `others` are minus the gradients for the cells' points.
pub(super) struct Pull {
    pub(super) gap: f64,
    pub(super) first: Vec3,
    /// Shares of the other cells.
    pub(super) shares: [f64; FACES],
    pub(super) others: [Vec3; FACES],
}

impl Pull {
    /// By one cell alone, along `first`.
    #[inline(always)]
    pub(super) fn plain(gap: f64, first: Vec3) -> Self {
        Self {
            gap,
            first,
            shares: [0.0; FACES],
            others: [[0.0; 3]; FACES],
        }
    }
}

/// Pull of the cells around a slave, and whether it is that of the closest alone.
#[inline]
pub(super) fn pulled(found: &Found, offset: f64) -> (Pull, bool) {
    let d = found.first.distance2.sqrt();
    let plain = || Pull::plain(d - offset, scale(found.first.arm, 1.0 / d));
    if found.others.iter().all(Option::is_none) {
        return (plain(), true);
    }
    let Some((below, shares)) = blend(found, offset).filter(|b| b.1[0] < 1.0) else {
        return (plain(), true);
    };
    debug_assert!(
        (shares.iter().sum::<f64>() - 1.0).abs() < 1e-6 && below <= 0.0,
        "{shares:?}"
    );
    let along = |c: &Closest, share: f64| -> Vec3 { scale(c.arm, share / c.distance2.sqrt()) };
    let mut pull = Pull::plain(d + below - offset, along(&found.first, shares[0]));
    for (k, c) in found.others.iter().enumerate() {
        if let Some(c) = c {
            pull.shares[k] = shares[k + 1];
            pull.others[k] = along(c, shares[k + 1]);
        }
    }
    (pull, false)
}

/// By how much (m, not above 0) the distance in a concave fold or corner is less than that of the closest face, and the shares of
/// the faces. There the distance to the surface is the smallest of several, and its gradient jumps where they are equal: a
/// node that is pressed into the fold would rattle between the faces, and explicit steps heat such a rattle. So a smooth
/// minimum takes its place, over shares `w >= 0` whose sum is 1:
///
/// `d = min_w sum_i w_i d_i - sum_i<j e_ij w_i w_j` with `e_ij = 0.4 offset (1 - cos fold)`.
///
/// Of two faces that is `d_1 - (e - (d_2 - d_1))^2 / 4 e` where they differ by less than `e`. All feet are still perpendicular
/// there, so nothing jumps at its ends. Faces that meet at the corner alone have less, by half of the smaller `e` of
/// the closest face with its next: four faces of a bowl could else share by one diagonal as well as by the other, and
/// would change over with a jump.
fn blend(found: &Found, offset: f64) -> Option<(f64, [f64; ALL])> {
    let [a, b, c] = &found.others;
    let faces = [Some(&found.first), a.as_ref(), b.as_ref(), c.as_ref()];
    let d = faces.map(|f| f.map_or(0.0, |f| f.distance2.sqrt()));
    let mut there = (1..ALL).filter(|i| faces[*i].is_some());
    if let (Some(k), None) = (there.next(), there.next()) {
        let e = faces[k].map_or(0.0, |other| width(&found.first, other, offset));
        let rest = (e - (d[k] - d[0])).max(0.0);
        let mut shares = [0.0; ALL];
        shares[k] = rest / (2.0 * e);
        shares[0] = 1.0 - shares[k];
        return Some((-rest * rest / (4.0 * e), shares));
    }
    let between = |i: usize, j: usize| match (faces[i], faces[j]) {
        (Some(a), Some(b)) => width(a, b, offset),
        _ => 0.0,
    };
    let mut e = [[0.0; ALL]; ALL];
    for i in 0..ALL {
        for j in 0..i {
            e[i][j] = between(i, j);
        }
    }
    // The ring is 0, 1, 3, 2. Of three faces the one between the others is the first, or that next to it which is there: so three faces
    // share alike, whichever is the closest.
    let less = match (faces[1], faces[2]) {
        (Some(_), None) => ACROSS * e[1][0].min(e[3][1]),
        (None, Some(_)) => ACROSS * e[2][0].min(e[3][2]),
        _ => ACROSS * e[1][0].min(e[2][0]),
    };
    for (i, j) in [(2, 1), (3, 0)] {
        e[i][j] = (e[i][j] - less).max(0.0);
    }
    let widest = e.iter().flatten().fold(0.0, |m: f64, x| m.max(*x));
    for i in 0..ALL {
        for j in 0..i {
            e[i][j] /= widest;
            e[j][i] = e[i][j];
        }
    }
    let (below, shares) = smooth_minimum(
        d.map(|x| (x - d[0]) / widest),
        e,
        faces.map(|f| f.is_some()),
    )?;
    Some((widest * below, shares))
}

/// Sets of faces, smaller ones first.
const SETS: [u8; 15] = [1, 2, 4, 8, 3, 5, 9, 6, 10, 12, 7, 11, 13, 14, 15];

/// Least value of `sum_i w_i d_i - sum_i<j e_ij w_i w_j` over shares `w >= 0` of those `present` whose sum is 1, and these: by
/// the first set of faces that fulfils the conditions of Karush, Kuhn and Tucker. `e` is symmetric with zeros on the
/// diagonal. `None` when none does, which takes faces that are no corner's.
fn smooth_minimum(
    d: [f64; ALL],
    e: [[f64; ALL]; ALL],
    present: [bool; ALL],
) -> Option<(f64, [f64; ALL])> {
    const ROUNDING: f64 = 1e-10;
    let all = (0..ALL).fold(0, |m, i| m | u8::from(present[i]) << i);
    SETS.into_iter().filter(|s| s & !all == 0).find_map(|set| {
        let has = |i: usize| set >> i & 1 == 1;
        // Unknowns: the shares, and what d_i - sum_j e_ij w_j is for all that share.
        let (mut a, mut b) = (Matrix5::zeros(), Vector5::zeros());
        for i in 0..ALL {
            if has(i) {
                (0..ALL).for_each(|j| a[(i, j)] = e[i][j]);
                (a[(i, ALL)], a[(ALL, i)], b[i]) = (1.0, 1.0, d[i]);
            } else {
                a[(i, i)] = 1.0;
            }
        }
        b[ALL] = 1.0;
        let x = a.lu().solve(&b)?;
        let w: [f64; ALL] = std::array::from_fn(|i| x[i]);
        let shared = |i: usize| (0..ALL).map(|j| e[i][j] * w[j]).sum::<f64>();
        let holds = |i: usize| match has(i) {
            true => w[i] > -ROUNDING,
            false => !present[i] || d[i] - shared(i) > x[ALL] - ROUNDING,
        };
        let value = x[ALL] + 0.5 * (0..ALL).map(|i| w[i] * shared(i)).sum::<f64>();
        (0..ALL).all(holds).then(|| (value, w.map(|w| w.max(0.0))))
    })
}
