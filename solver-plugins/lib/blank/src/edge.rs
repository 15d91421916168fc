//! Contours as the mesher sees them: places along them, their corners, the narrowest parts of a region.

use crate::error::MeshError;
use plyflow_fixed::FixedBits;
use plyflow_model::outline::{Millimetres, Point, Region, cross, segment_distance, signed_area};

/// A contour turns by more than this (rad) at its sharp corners; a node stands on every one of them. Of softer
/// corners a node stands on those that one comes near to: a contour of many short sides is a curve.
pub const SHARP: f64 = 25.0 * std::f64::consts::PI / 180.0;

/// Least length of a side between sharp corners, and of the material between two contours, over the element size:
/// a coarse cell across it is split in two.
pub const LEAST_FEATURE: f64 = 0.7;

/// A closed contour by arc length.
#[derive(Debug, Clone)]
pub struct Curve {
    /// `[n]` corners (m), the region on their left.
    corners: Vec<Point>,
    /// `[n + 1]` way from the first corner (m).
    way: Vec<f64>,
    /// Numbers of the sharp corners.
    sharp: Vec<usize>,
}

/// A node on a contour: how far along it, and whether it must stay there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// Way from the first corner (m).
    pub at: f64,
    /// On a corner.
    pub pinned: bool,
}

impl Curve {
    /// From the corners of a contour.
    pub fn new(corners: &[Point]) -> Self {
        let n = corners.len();
        let mut way = vec![0.0];
        for i in 0..n {
            let (a, b) = (corners[i], corners[(i + 1) % n]);
            way.push(way[i] + (b[0] - a[0]).fixed_hypot(b[1] - a[1]));
        }
        let mut curve = Self {
            corners: corners.to_vec(),
            way,
            sharp: Vec::new(),
        };
        curve.sharp = (0..n).filter(|i| curve.turn(*i).abs() > SHARP).collect();
        curve
    }

    /// Angle (rad) by which it turns at a corner, positive to the left.
    fn turn(&self, i: usize) -> f64 {
        let n = self.corners.len();
        let (a, b, c) = (
            self.corners[(i + n - 1) % n],
            self.corners[i],
            self.corners[(i + 1) % n],
        );
        let along = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]);
        cross(a, b, c).fixed_atan2(along)
    }

    /// Its length (m).
    pub fn length(&self) -> f64 {
        self.way[self.corners.len()]
    }

    /// The point at a way along it (m); ways count round and round.
    pub fn point(&self, at: f64) -> Point {
        let n = self.corners.len();
        let at = at.rem_euclid(self.length());
        let side = self.way.partition_point(|w| *w <= at).clamp(1, n) - 1;
        let (a, b) = (self.corners[side], self.corners[(side + 1) % n]);
        let t = ((at - self.way[side]) / (self.way[side + 1] - self.way[side])).clamp(0.0, 1.0);
        // A corner exactly, so that rectangles end where they are said to.
        if t == 0.0 {
            return a;
        }
        [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
    }

    /// Angle (rad) of the region at a way along it.
    pub fn angle(&self, at: f64) -> f64 {
        let near = 1e-9 * self.length();
        let found = (0..self.corners.len()).find(|i| (self.way[*i] - at).abs() < near);
        std::f64::consts::PI - found.map_or(0.0, |i| self.turn(i))
    }

    /// Evenly spaced stops near `spacing` (m) apart between the sharp corners, at least four in all; soft corners within a
    /// quarter of a spacing draw them onto themselves.
    pub fn stops(&self, spacing: f64) -> Vec<Stop> {
        let length = self.length();
        let ends: Vec<f64> = match self.sharp.len() {
            // Nothing to begin at: begin at the first corner, which all runs of the same scene share.
            0 => vec![0.0],
            _ => self.sharp.iter().map(|i| self.way[*i]).collect(),
        };
        let least = 4usize.div_ceil(ends.len());
        let mut stops = Vec::new();
        for (k, from) in ends.iter().enumerate() {
            let to = ends.get(k + 1).copied().unwrap_or(ends[0] + length);
            let run = to - from;
            let mut count = ((run / spacing).round() as usize).max(1);
            if ends.len() < 3 {
                count = count.max(least);
            }
            let step = run / count as f64;
            stops.push(Stop {
                at: *from,
                pinned: !self.sharp.is_empty(),
            });
            for i in 1..count {
                let at = from + step * i as f64;
                let soft = self.nearest_corner(at);
                let pinned = (soft - at).abs() < 0.25 * step && soft > *from && soft < to;
                stops.push(Stop {
                    at: if pinned { soft } else { at },
                    pinned,
                });
            }
        }
        stops
    }

    /// The way of the corner nearest to a way, which may go beyond the first corner.
    pub fn nearest_corner(&self, at: f64) -> f64 {
        let length = self.length();
        let rounds = (at / length).floor() * length;
        let inside = at - rounds;
        let next = self
            .way
            .partition_point(|w| *w <= inside)
            .min(self.way.len() - 1);
        let (a, b) = (self.way[next.saturating_sub(1)], self.way[next]);
        rounds + if inside - a <= b - inside { a } else { b }
    }

    /// Turns a way beyond the first corner back.
    pub fn wrapped(&self, at: f64) -> f64 {
        at.rem_euclid(self.length())
    }
}

/// Refuses what is too small for the elements.
///
/// # Errors
/// When a side between sharp corners, or the material between two contours or two parts of one, is less than
/// [`LEAST_FEATURE`] elements wide, or a contour too short for a ring of elements.
pub fn check_features(region: &Region, curves: &[Curve], size: f64) -> Result<(), MeshError> {
    let least = LEAST_FEATURE * size;
    for curve in curves {
        // Rounding of what is given in round numbers of elements.
        let (n, short) = (curve.sharp.len(), least * (1.0 - 1e-9));
        for (k, i) in curve.sharp.iter().enumerate() {
            let from = curve.way[*i];
            let to = if k + 1 < n {
                curve.way[curve.sharp[k + 1]]
            } else {
                curve.way[curve.sharp[0]] + curve.length()
            };
            if to - from < short {
                return Err(MeshError::Small {
                    what: "a side",
                    at: Millimetres(curve.corners[*i]),
                    given: 1e3 * (to - from),
                    size: 1e3 * size,
                    wanted: 1e3 * (to - from) / LEAST_FEATURE,
                });
            }
        }
        if curve.length() < 6.0 * short {
            return Err(MeshError::Small {
                what: "a contour around",
                at: Millimetres(curve.corners[0]),
                given: 1e3 * curve.length(),
                size: 1e3 * size,
                wanted: 1e3 * curve.length() / (6.0 * LEAST_FEATURE),
            });
        }
        if signed_area(&curve.corners).abs() < short * short {
            let side = signed_area(&curve.corners).abs().sqrt();
            return Err(MeshError::Small {
                what: "the area within a contour (as the side of a square)",
                at: Millimetres(curve.corners[0]),
                given: 1e3 * side,
                size: 1e3 * size,
                wanted: 1e3 * side / LEAST_FEATURE,
            });
        }
    }
    narrowest(region, curves, least * (1.0 - 1e-9)).map_or(Ok(()), |(at, width)| {
        Err(MeshError::Small {
            what: "the material between two edges",
            at: Millimetres(at),
            given: 1e3 * width,
            size: 1e3 * size,
            wanted: 1e3 * width / LEAST_FEATURE,
        })
    })
}

/// The narrowest place below `least` (m), if any: a corner opposite to a side. Sides of one corner close in on each
/// other, which is no narrow place: along a contour, what lies opposite is at least four times as far away as across.
fn narrowest(region: &Region, curves: &[Curve], least: f64) -> Option<(Point, f64)> {
    let mut found: Option<(Point, f64)> = None;
    for (k, one) in curves.iter().enumerate() {
        for (i, p) in one.corners.iter().enumerate() {
            for (m, other) in curves.iter().enumerate() {
                let n = other.corners.len();
                for j in 0..n {
                    let (a, b) = (other.corners[j], other.corners[(j + 1) % n]);
                    let width = segment_distance(*p, a, b);
                    if width >= found.map_or(least, |f| f.1)
                        || (k == m && (j == i || (j + 1) % n == i))
                    {
                        continue;
                    }
                    let way = |w: f64| {
                        let d = (w - one.way[i]).abs();
                        d.min(one.length() - d)
                    };
                    if k == m && way(other.way[j]).min(way(other.way[j + 1])) < 4.0 * width {
                        continue;
                    }
                    let d = [b[0] - a[0], b[1] - a[1]];
                    let along = (p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1];
                    let t = (along / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
                    let middle = [0, 1].map(|c| 0.5 * (p[c] + a[c] + t * d[c]));
                    if region.contains(middle) {
                        found = Some((*p, width));
                    }
                }
            }
        }
    }
    found
}
