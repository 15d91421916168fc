//! Wrinkles on a circle.
//!
//! The heights along a circle are a closed profile. Which of its tops are wrinkles is decided by their topographic
//! prominence: how far one must go down from a top, along the circle, before one can climb higher. Prominence
//! does not depend on where the ply lies between its wrinkles, it does not count the ripple on a large wrinkle, and a closed
//! profile has as many tops as troughs of any prominence: the number of wrinkles is the same from either side.

use crate::surface::Hit;
use plyflow_model::artifact::Wrinkle;
use serde::Deserialize;
use std::f64::consts::TAU;

/// To which side wrinkles leave the ply.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// To that side to which the circle departs farther from its median.
    Auto,
    /// To +z.
    Up,
    /// To -z.
    Down,
}

/// What is a wrinkle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria {
    /// Least height over its base (m).
    pub height: f64,
    /// Least prominence (m).
    pub prominence: f64,
    /// Its side.
    pub side: Side,
}

/// The height that half of the points exceed (m); `None` without points.
pub fn median(hits: &[Option<Hit>]) -> Option<f64> {
    middle(hits.iter().flatten().map(|h| h.height).collect())
}

fn middle(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (n > 0).then(|| 0.5 * (values[(n - 1) / 2] + values[n / 2]))
}

/// The heights of a circle as seen from the side to which wrinkles leave; `None` beside the ply.
struct Profile(Vec<Option<f64>>);

impl Profile {
    fn at(&self, i: isize) -> Option<f64> {
        self.0[i.rem_euclid(self.0.len() as isize) as usize]
    }

    /// Whether place `j` lies higher than place `i`; of places as high, the first does.
    fn higher(&self, j: isize, i: isize) -> bool {
        let n = self.0.len() as isize;
        match (self.at(j), self.at(i)) {
            (Some(a), Some(b)) => a > b || (a == b && j.rem_euclid(n) < i.rem_euclid(n)),
            _ => false,
        }
    }

    /// Where the way from place `i` in the direction `step` is lowest before it meets something higher, the ply's
    /// edge, or has gone around; 0 places when it meets that at once.
    fn saddle(&self, i: isize, step: isize) -> isize {
        let mut low = i;
        for k in 1..self.0.len() as isize {
            let j = i + step * k;
            match self.at(j) {
                Some(v) if !self.higher(j, i) => {
                    if Some(v) < self.at(low) {
                        low = j;
                    }
                }
                _ => break,
            }
        }
        low
    }

    /// The prominence of place `i` (m); `None` when it is no top, or lies at the ply's edge.
    fn prominence(&self, i: isize) -> Option<f64> {
        let top = self.at(i)?;
        let beside = [i - 1, i + 1];
        if beside
            .iter()
            .any(|j| self.at(*j).is_none() || self.higher(*j, i))
        {
            return None;
        }
        let saddles = [-1, 1].map(|step| self.at(self.saddle(i, step)).unwrap_or(top));
        Some(top - saddles[0].max(saddles[1]))
    }

    /// How far (in places, with the fraction) the profile stays at or over `level` from place `i` in the direction
    /// `step`, at most `limit` places.
    fn reach(&self, i: isize, step: isize, level: f64, limit: isize) -> f64 {
        let mut last = self.at(i).unwrap_or(level);
        for k in 1..=limit {
            match self.at(i + step * k) {
                Some(v) if v >= level => last = v,
                Some(v) => return (k - 1) as f64 + (last - level) / (last - v),
                None => return (k - 1) as f64,
            }
        }
        limit as f64
    }
}

/// Wrinkles on a circle of that radius (m) with evenly spaced points, from angle 0 on, in the order of their angles: tops of at
/// least the wanted prominence that stand over the circle's base by at least the wanted height. The base is the
/// median height of what lies on no wrinkle, that is, farther from every such top than where the profile has fallen by half
/// of its prominence.
pub fn waves(hits: &[Option<Hit>], radius: f64, what: &Criteria) -> Vec<Wrinkle> {
    let Some(sign) = sign(hits, what.side) else {
        return Vec::new();
    };
    let n = hits.len() as isize;
    let profile = Profile(hits.iter().map(|h| h.map(|h| sign * h.height)).collect());
    let prominent = |i: isize| {
        let p = profile.prominence(i)?;
        (p >= what.prominence && p > 0.0).then_some((i, p))
    };
    let tops: Vec<(isize, f64)> = (0..n).filter_map(prominent).collect();
    let base = base(&profile, &tops);
    let angle = |places: f64| TAU * places / n as f64;
    let mut found = Vec::new();
    for (k, (i, prominence)) in tops.iter().copied().enumerate() {
        let height = profile.at(i).unwrap_or(base) - base;
        if height < what.height {
            continue;
        }
        let level = base + 0.5 * height;
        // No farther than the lowest place on the way to the next top.
        let limit = |step: isize| {
            let next = tops[(k as isize + step).rem_euclid(tops.len() as isize) as usize].0;
            let way = match (step * (next - i)).rem_euclid(n) {
                0 => n - 1,
                way => way,
            };
            let lower = |a: &isize, b: &isize| {
                let at = |k: isize| profile.at(i + step * k).unwrap_or(f64::NEG_INFINITY);
                at(*a).total_cmp(&at(*b))
            };
            (1..=way).min_by(lower).unwrap_or(way)
        };
        let reach = [-1, 1].map(|step| profile.reach(i, step, level, limit(step)));
        let inside = (i - reach[0] as isize)..=(i + reach[1] as isize);
        let shears = inside.filter_map(|j| hits[j.rem_euclid(n) as usize].map(|h| h.shear));
        let (sum, count) = shears.fold((0.0, 0.0), |(s, c), v| (s + v, c + 1.0));
        found.push(Wrinkle {
            angle: angle(i as f64 + 0.5 * (reach[1] - reach[0])).rem_euclid(TAU),
            z: sign * (base + height),
            height: sign * height,
            prominence,
            width: radius * angle(reach[0] + reach[1]),
            shear: sum / f64::max(count, 1.0),
            length: 0.0,
        });
    }
    found.sort_by(|a, b| a.angle.total_cmp(&b.angle));
    found
}

/// +1 when wrinkles leave upwards, -1 when downwards; `None` without points.
fn sign(hits: &[Option<Hit>], side: Side) -> Option<f64> {
    let middle = median(hits)?;
    let off = hits.iter().flatten().map(|h| h.height - middle);
    let up = off.clone().fold(0.0, f64::max);
    let down = -off.fold(0.0, f64::min);
    Some(match side {
        Side::Up => 1.0,
        Side::Down => -1.0,
        Side::Auto if up >= down => 1.0,
        Side::Auto => -1.0,
    })
}

/// The median height of the places that lie on none of the tops; the lowest place when all do (m).
fn base(profile: &Profile, tops: &[(isize, f64)]) -> f64 {
    let n = profile.0.len() as isize;
    let mut taken = vec![false; n as usize];
    for (i, prominence) in tops {
        let Some(top) = profile.at(*i) else { continue };
        for step in [-1, 1] {
            let reach = profile.reach(*i, step, top - 0.5 * prominence, n - 1) as isize;
            for k in 0..=reach {
                taken[(i + step * k).rem_euclid(n) as usize] = true;
            }
        }
    }
    let free = profile.0.iter().zip(&taken).filter(|(_, t)| !**t);
    let lowest = || {
        profile
            .0
            .iter()
            .flatten()
            .copied()
            .fold(f64::INFINITY, f64::min)
    };
    middle(free.filter_map(|(v, _)| *v).collect()).unwrap_or_else(lowest)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHAT: Criteria = Criteria {
        height: 1e-3,
        prominence: 1e-3,
        side: Side::Auto,
    };

    fn circle(height: impl Fn(f64) -> f64) -> Vec<Option<Hit>> {
        let at = |i: usize| TAU * i as f64 / 720.0;
        let hit = |i: usize| Hit {
            height: height(at(i)),
            shear: at(i).sin(),
        };
        (0..720).map(|i| Some(hit(i))).collect()
    }

    /// A bump of that height at `top` (rad), `wide` at half height.
    fn bump(a: f64, top: f64, height: f64, wide: f64) -> f64 {
        let d = (a - top + TAU / 2.0).rem_euclid(TAU) - TAU / 2.0;
        height * (-(4.0 * 2f64.ln()) * d * d / (wide * wide)).exp()
    }

    #[test]
    fn bumps_are_found_with_their_place_height_and_width() {
        let profile = |sign: f64| {
            move |a: f64| {
                // One across angle 0, one too low, two that touch.
                let bumps = bump(a, 0.05, 3e-3, 0.2)
                    + bump(a, 2.0, 2e-3, 0.1)
                    + bump(a, 3.0, 0.9e-3, 0.1)
                    + bump(a, 4.5, 4e-3, 0.2)
                    + bump(a, 5.1, 4e-3, 0.2);
                0.02 + sign * bumps
            }
        };
        let expected = [
            (0.05, 3e-3, 0.2),
            (2.0, 2e-3, 0.1),
            (4.5, 4e-3, 0.2),
            (5.1, 4e-3, 0.2),
        ];
        for sign in [1.0, -1.0] {
            let found = waves(&circle(profile(sign)), 0.1, &WHAT);
            assert_eq!(found.len(), expected.len(), "{found:?}");
            for (w, (angle, height, wide)) in found.iter().zip(expected) {
                assert!((w.angle - angle).abs() < 0.01, "{w:?}");
                assert!((w.height - sign * height).abs() < 0.02 * height, "{w:?}");
                assert!((w.width - 0.1 * wide).abs() < 0.0005, "{w:?}");
                assert!((w.shear - angle.sin()).abs() < 0.01, "{w:?}");
            }
            assert_eq!([0, 1, 2, 3].map(|k| found[k].quadrant()), [0, 1, 2, 3]);
        }
    }

    #[test]
    fn a_ripple_on_a_wrinkle_is_none_and_a_deep_saddle_parts_two() {
        let with = |saddle: f64| {
            // Two tops of 5 mm, 0.6 rad apart, and between them the saddle.
            let found = waves(
                &circle(|a| {
                    let wide = bump(a, 1.3, 5e-3, 0.9).max(bump(a, 1.9, 5e-3, 0.9));
                    let between = bump(a, 1.6, 1.0, 0.2);
                    wide - (wide - saddle) * between
                }),
                0.1,
                &WHAT,
            );
            found.len()
        };
        assert_eq!((with(4.5e-3), with(2e-3)), (1, 2));
        // Noise of 0.1 mm on a level ply and on a wrinkle.
        let noise = |a: f64| 1e-4 * (97.0 * a).sin();
        let found = waves(&circle(|a| bump(a, 3.0, 3e-3, 0.4) + noise(a)), 0.1, &WHAT);
        assert_eq!(found.len(), 1, "{found:?}");
    }

    #[test]
    fn a_circle_that_fills_its_gap_has_as_many_wrinkles_from_both_sides() {
        // As between plates 6 mm apart: cut off on both sides.
        let cut = |a: f64| (8e-3 * (5.0 * a + 0.3).sin()).clamp(-3e-3, 3e-3);
        for side in [Side::Up, Side::Down] {
            let found = waves(&circle(cut), 0.1, &Criteria { side, ..WHAT });
            assert_eq!(found.len(), 5, "{found:?}");
            let all = |of: fn(&Wrinkle) -> f64, near: f64| {
                let off = found.iter().map(|w| (of(w).abs() - near).abs());
                off.fold(0.0, f64::max) < 1e-9
            };
            assert!(
                all(|w| w.height, 6e-3) && all(|w| w.prominence, 6e-3),
                "{found:?}"
            );
            // At half height: half of the circle.
            let sum: f64 = found.iter().map(|w| w.width).sum();
            assert!((sum - 0.05 * TAU).abs() < 1e-4, "{sum}");
        }
    }

    #[test]
    fn a_level_circle_and_one_beside_the_ply_have_no_wrinkles() {
        assert_eq!(waves(&circle(|_| 0.02), 0.1, &WHAT), []);
        assert_eq!(waves(&[None; 36], 0.1, &WHAT), []);
        // Where the ply ends there is no wrinkle either, though it rises towards its edge.
        let mut half = circle(|a| 0.02 + 2e-3 * a);
        half[300..].fill(None);
        assert_eq!(waves(&half, 0.1, &WHAT), []);
        // A lone top on what is left of a circle is one.
        let mut arc = circle(|a| bump(a, 1.0, 3e-3, 0.3));
        arc[300..].fill(None);
        assert_eq!(waves(&arc, 0.1, &WHAT).len(), 1);
    }

    #[test]
    fn a_full_wave_is_one_wrinkle_for_each_period() {
        let found = waves(&circle(|a| 2e-3 * (3.0 * a).sin()), 0.1, &WHAT);
        assert_eq!(found.len(), 3);
        assert!(found.iter().all(|w| (w.prominence - 4e-3).abs() < 1e-6));
    }
}
