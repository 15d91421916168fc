//! Wrinkles on a circle.

use crate::surface::Hit;
use serde::Serialize;
use std::f64::consts::{FRAC_PI_2, TAU};

/// A wrinkle where a circle crosses it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Wave {
    /// Angle of its top from x, 0 to 2 pi (rad).
    pub angle: f64,
    /// Its top over the circle's median height (m); negative: under it.
    pub height: f64,
    /// Length of the arc on which it is at least half as high (m).
    pub width: f64,
    /// Shear angle at its top (rad).
    pub shear: f64,
}

impl Wave {
    /// 0 to 3: in which quarter of the circle its top is, counted from x > 0, y > 0 counter-clockwise.
    pub fn quadrant(&self) -> usize {
        (self.angle / FRAC_PI_2) as usize % 4
    }
}

/// The height that half of the points exceed (m); `None` without points.
pub fn median(hits: &[Option<Hit>]) -> Option<f64> {
    let mut heights: Vec<f64> = hits.iter().flatten().map(|h| h.height).collect();
    heights.sort_by(f64::total_cmp);
    let n = heights.len();
    (n > 0).then(|| 0.5 * (heights[(n - 1) / 2] + heights[n / 2]))
}

/// Wrinkles on a circle of that radius (m) with evenly spaced points, from angle 0 on: runs of points on one side of
/// the median that leave it by more than half of the threshold (m), and somewhere by the whole. In the order of their
/// tops.
pub fn waves(hits: &[Option<Hit>], radius: f64, threshold: f64) -> Vec<Wave> {
    let Some(middle) = median(hits) else {
        return Vec::new();
    };
    let n = hits.len();
    let deviation = |i: usize| hits[i % n].map_or(0.0, |h| h.height - middle);
    // Which side: -1, 0, 1.
    let side = |i: usize| {
        let d = deviation(i);
        if d.abs() <= 0.5 * threshold {
            0
        } else if d > 0.0 {
            1
        } else {
            -1
        }
    };
    // From a point that belongs to no run, or to another than the one before it.
    let Some(first) = (0..n).find(|i| side(*i) != side(i + n - 1)) else {
        return Vec::new();
    };
    let mut found = Vec::new();
    let mut i = first;
    while i < first + n {
        let run = (i..first + n).take_while(|k| side(*k) == side(i)).count();
        if side(i) != 0 {
            let top = (i..i + run).reduce(|a, b| {
                if deviation(b).abs() > deviation(a).abs() {
                    b
                } else {
                    a
                }
            });
            let top = top.unwrap_or(i);
            let height = deviation(top);
            if height.abs() >= threshold
                && let Some(hit) = hits[top % n]
            {
                let high = |k: &usize| deviation(*k).abs() >= 0.5 * height.abs();
                let steps = (i..i + run).filter(high).count();
                found.push(Wave {
                    angle: TAU * (top % n) as f64 / n as f64,
                    height,
                    width: radius * TAU * steps as f64 / n as f64,
                    shear: hit.shear,
                });
            }
        }
        i += run;
    }
    found.sort_by(|a, b| a.angle.total_cmp(&b.angle));
    found
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let profile = |a: f64| {
            // One across angle 0, one downwards, one too low, two that touch at less than half of the threshold.
            0.02 + bump(a, 0.05, 3e-3, 0.2)
                + bump(a, 2.0, -2e-3, 0.1)
                + bump(a, 3.0, 0.9e-3, 0.1)
                + bump(a, 4.5, 4e-3, 0.2)
                + bump(a, 5.1, 4e-3, 0.2)
        };
        let found = waves(&circle(profile), 0.1, 1e-3);
        let expected = [
            (0.05, 3e-3, 0.2),
            (2.0, -2e-3, 0.1),
            (4.5, 4e-3, 0.2),
            (5.1, 4e-3, 0.2),
        ];
        assert_eq!(found.len(), expected.len(), "{found:?}");
        for (w, (angle, height, wide)) in found.iter().zip(expected) {
            assert!((w.angle - angle).abs() < 0.01, "{w:?}");
            assert!((w.height - height).abs() < 0.02 * height.abs(), "{w:?}");
            assert!((w.width - 0.1 * wide).abs() < 0.002, "{w:?}");
            assert!((w.shear - angle.sin()).abs() < 0.01, "{w:?}");
        }
        assert_eq!([0, 1, 2, 3].map(|k| found[k].quadrant()), [0, 1, 2, 3]);
    }

    #[test]
    fn a_level_circle_and_one_beside_the_ply_have_no_wrinkles() {
        assert_eq!(waves(&circle(|_| 0.02), 0.1, 1e-3), []);
        assert_eq!(waves(&[None; 36], 0.1, 1e-3), []);
        // Where the ply ends there is no wrinkle either.
        let mut half = circle(|_| 0.02);
        half[300..].fill(None);
        assert_eq!(waves(&half, 0.1, 1e-3), []);
    }

    #[test]
    fn a_full_wave_has_a_crest_and_a_trough_for_each_period() {
        let found = waves(&circle(|a| 2e-3 * (3.0 * a).sin()), 0.1, 1e-3);
        let crests = found.iter().filter(|w| w.height > 0.0).count();
        assert_eq!((found.len(), crests), (6, 3));
    }
}
