//! How long wrinkles are: their tops followed over neighbouring circles.

use crate::surface::Hit;
use crate::waves::{Criteria, Side, waves};
use plyflow_fixed::FixedBits;
use plyflow_model::artifact::Wrinkle;
use std::f64::consts::{PI, TAU};

/// The circles on which wrinkles are followed.
pub struct Trace<'a> {
    /// What vertical lines meet on a circle of a radius (m), as [`waves`] takes it.
    pub around: &'a dyn Fn(f64) -> Vec<Option<Hit>>,
    /// What is a wrinkle there.
    pub what: Criteria,
    /// Distance of the circles (m).
    pub step: f64,
    /// Smallest radius (m).
    pub inner: f64,
}

impl Trace<'_> {
    /// Gives the wrinkles of the circle of that radius (m) their lengths: of the line through their tops inwards and
    /// outwards, as far as the next circle has a wrinkle whose top is no farther from the last one along the circle than half
    /// of the wider of the two and the distance of the circles.
    pub fn lengths(&self, radius: f64, of: &mut [Wrinkle]) {
        // All wrinkles of a circle leave to the same side. Others follow it: in a corner of the ply little more than the
        // wrinkle may be left to judge by.
        let Some(first) = of.first() else { return };
        let side = if first.height > 0.0 {
            Side::Up
        } else {
            Side::Down
        };
        let what = Criteria { side, ..self.what };
        for outwards in [-1.0, 1.0] {
            let mut heads: Vec<Option<(f64, Wrinkle)>> =
                of.iter().map(|w| Some((radius, *w))).collect();
            for k in 1.. {
                let r = radius + outwards * self.step * f64::from(k);
                if r < self.inner || heads.iter().all(Option::is_none) {
                    break;
                }
                let there = waves(&(self.around)(r), r, &what);
                for (wave, head) in of.iter_mut().zip(&mut heads) {
                    let next = head.and_then(|(at, last)| {
                        let next = self.next(&last, r, &there)?;
                        Some((distance((at, &last), (r, &next)), next))
                    });
                    wave.length += next.map_or(0.0, |(way, _)| way);
                    *head = next.map(|(_, next)| (r, next));
                }
            }
        }
    }

    /// The wrinkle on the circle of radius `r` (m) that goes on from `last`.
    fn next(&self, last: &Wrinkle, r: f64, there: &[Wrinkle]) -> Option<Wrinkle> {
        let apart = |w: &Wrinkle| r * turn(last, w).abs();
        let near = there
            .iter()
            .filter(|w| apart(w) <= 0.5 * w.width.max(last.width) + self.step);
        near.min_by(|a, b| apart(a).total_cmp(&apart(b))).copied()
    }
}

/// Angle from one top to another, -pi to pi (rad).
fn turn(a: &Wrinkle, b: &Wrinkle) -> f64 {
    (b.angle - a.angle + PI).rem_euclid(TAU) - PI
}

/// Distance of two tops in space (m).
fn distance((r, a): (f64, &Wrinkle), (s, b): (f64, &Wrinkle)) -> f64 {
    let plan = r * r + s * s - 2.0 * r * s * turn(a, b).fixed_cos();
    (plan.max(0.0) + (a.z - b.z).powi(2)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrinkle_is_followed_as_far_as_it_goes_and_where_it_turns() {
        // One straight along a radius from 60 to 95 mm, one that turns by 0.3 rad from 70 mm on outwards.
        let what = Criteria {
            height: 1e-3,
            prominence: 1e-3,
            side: Side::Up,
        };
        let bump = |d: f64| {
            let d = (d + PI).rem_euclid(TAU) - PI;
            3e-3 * (-(d / 0.05).powi(2)).exp()
        };
        let height = |r: f64, a: f64| {
            let straight = if (0.060..=0.095).contains(&r) {
                bump(a - 6.2)
            } else {
                0.0
            };
            let turned = bump(a - 2.0 - 0.3 * ((r - 0.07) / 0.03).clamp(0.0, 2.0));
            straight + turned
        };
        let around = |r: f64| -> Vec<Option<Hit>> {
            let at = |i: usize| TAU * i as f64 / 1440.0;
            (0..1440)
                .map(|i| {
                    (r <= 0.1).then(|| Hit {
                        height: height(r, at(i)),
                        shear: 0.0,
                    })
                })
                .collect()
        };
        let mut found = waves(&around(0.08), 0.08, &what);
        let trace = Trace {
            around: &around,
            what,
            step: 1e-3,
            inner: 0.05,
        };
        trace.lengths(0.08, &mut found);
        assert_eq!(found.len(), 2);
        // From the innermost circle, 50 mm, straight to 70 mm, then 30 mm outwards turning by 10 rad/m.
        let spiral = |n: i32| -> f64 {
            let d = 0.03 / f64::from(n);
            let r = |i: i32| 0.07 + d * (f64::from(i) + 0.5);
            (0..n)
                .map(|i| d * (1.0 + (10.0 * r(i)).powi(2)).sqrt())
                .sum()
        };
        let expected = [0.02 + spiral(1000), 0.035];
        for (w, e) in found.iter().zip(expected) {
            assert!((w.length - e).abs() < 1.5e-3, "{} {e}", w.length);
        }
    }
}
