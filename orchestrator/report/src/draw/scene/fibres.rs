//! Lines of fibres on the plies of a scene.

use super::body::Body;
use super::pack::{Extent, Stream};
use crate::plain::Vec3;
use plyflow_export::Fibre;
use plyflow_model::artifact::Zone;
use serde::Serialize;

/// Points of all lines on a page at full sharpness; about 5 bytes each.
pub(super) const POINTS: f64 = 60_000.0;
/// Lines across the widest ply, about.
const ACROSS: f64 = 40.0;
/// How often the distance is doubled for lines that would be too many.
const DOUBLINGS: u32 = 6;
/// Points within this of the line without them are left out (m).
const STRAIGHT: f64 = 1e-4;

/// Lines of one family: in `data` so many points a line.
#[derive(Debug, Serialize)]
pub(super) struct ToldFibres {
    family: usize,
    /// Absent: in no zone that has a finer ply.
    zone: Option<String>,
    lines: Vec<usize>,
}

/// How far apart lines are in the flat plies (m): a round number, and so far that there are no more than `most` points; `None` without fibres.
pub(super) fn apart(bodies: &[Body<'_>], most: usize) -> Option<f64> {
    let with = || {
        bodies
            .iter()
            .filter_map(|b| b.ply.filter(|p| p.fibres.is_some()))
    };
    let widest = with().map(|p| {
        let [low, high] = crate::plain::bounds(&p.flat);
        (high[0] - low[0]).hypot(high[1] - low[1])
    });
    let widest = widest.fold(0.0, f64::max);
    if widest <= 0.0 {
        return None;
    }
    let mut apart = rounded(widest / ACROSS);
    for _ in 0..DOUBLINGS {
        let lines = with().flat_map(|p| [0, 1].map(|family| p.fibre_lines(family, apart)));
        let points: usize = lines.flatten().map(|l| thinned(&l.formed).len()).sum();
        if points <= most {
            return Some(apart);
        }
        apart *= 2.0;
    }
    None
}

/// Upwards to 1, 1.5, 2, 3 or 5 times a power of ten.
fn rounded(value: f64) -> f64 {
    let power = 10f64.powf(value.log10().floor());
    let steps = [1.0, 1.5, 2.0, 3.0, 5.0].map(|s| s * power);
    let found = steps.into_iter().find(|s| *s >= value * (1.0 - 1e-9));
    found.unwrap_or(10.0 * power)
}

/// Writes the lines of a body, those in zones with a finer ply apart.
pub(super) fn write(
    stream: &mut Stream,
    extent: &Extent,
    body: &Body<'_>,
    zones: &[&Zone],
    apart: Option<f64>,
) -> Vec<ToldFibres> {
    let (Some(ply), Some(apart)) = (body.ply, apart) else {
        return Vec::new();
    };
    let mut all = Vec::new();
    for family in 0..2 {
        let lines = ply.fibre_lines(family, apart);
        for zone in std::iter::once(None).chain(zones.iter().map(|z| Some(*z))) {
            let pieces: Vec<Vec<Vec3>> =
                lines.iter().flat_map(|l| pieces(l, zones, zone)).collect();
            let pieces: Vec<Vec<Vec3>> = pieces.iter().map(|p| thinned(p)).collect();
            if pieces.is_empty() {
                continue;
            }
            for piece in &pieces {
                stream.points(extent, piece.iter().copied());
            }
            all.push(ToldFibres {
                family,
                zone: zone.map(|z| z.name.clone()),
                lines: pieces.iter().map(Vec::len).collect(),
            });
        }
    }
    all
}

/// The parts of a line that lie in a zone, or in none of them.
fn pieces(line: &Fibre, zones: &[&Zone], wanted: Option<&Zone>) -> Vec<Vec<Vec3>> {
    let mut all: Vec<Vec<Vec3>> = Vec::new();
    let mut open = false;
    for (flat, formed) in line.flat.windows(2).zip(line.formed.windows(2)) {
        let middle = [0, 1].map(|d| 0.5 * (flat[0][d] + flat[1][d]));
        let zone = zones.iter().find(|z| z.holds(&middle, 0.0));
        if zone.map(|z| &z.name) != wanted.map(|z| &z.name) {
            open = false;
            continue;
        }
        if !open {
            all.push(vec![formed[0]]);
        }
        open = true;
        all.last_mut().expect("just begun").push(formed[1]);
    }
    all
}

/// A line without the points that lie on it anyway.
fn thinned(line: &[Vec3]) -> Vec<Vec3> {
    let Some(last) = line.len().checked_sub(1).filter(|l| *l > 1) else {
        return line.to_vec();
    };
    let mut keep = vec![false; line.len()];
    (keep[0], keep[last]) = (true, true);
    let mut open = vec![(0, last)];
    while let Some((a, b)) = open.pop() {
        let off = |k: usize| distance(line[k], line[a], line[b]);
        let farthest = (a + 1..b).max_by(|i, j| off(*i).total_cmp(&off(*j)));
        if let Some(k) = farthest.filter(|k| off(*k) > STRAIGHT) {
            keep[k] = true;
            open.extend([(a, k), (k, b)]);
        }
    }
    let kept = line.iter().zip(keep).filter(|(_, k)| *k);
    kept.map(|(p, _)| *p).collect()
}

/// From a point to the line between two others (m).
fn distance(p: Vec3, a: Vec3, b: Vec3) -> f64 {
    let sub = |a: Vec3, b: Vec3| [0, 1, 2].map(|d| a[d] - b[d]);
    let dot = |a: Vec3, b: Vec3| (0..3).map(|d| a[d] * b[d]).sum::<f64>();
    let (ab, ap) = (sub(b, a), sub(p, a));
    let share = (dot(ap, ab) / dot(ab, ab).max(1e-30)).clamp(0.0, 1.0);
    let off = sub(ap, ab.map(|x| x * share));
    dot(off, off).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_keeps_its_corners_and_loses_what_lies_between_them() {
        let line: Vec<Vec3> = (0..=20)
            .map(|k| {
                let x = 0.01 * f64::from(k);
                [x, 0.0, (x - 0.1).max(0.0)]
            })
            .collect();
        assert_eq!(thinned(&line), [line[0], line[10], line[20]]);
        assert_eq!(thinned(&line[..2]), line[..2]);
    }

    #[test]
    fn a_line_is_parted_where_a_zone_begins_and_ends_and_nothing_is_lost() {
        let flat: Vec<Vec3> = (0..=10).map(|k| [0.1 * f64::from(k), 0.0, 0.0]).collect();
        let line = Fibre {
            formed: flat.clone(),
            flat,
        };
        let zone = Zone::new("A", [0.2, -1.0, 0.6, 1.0]);
        let zones = [&zone];
        let lengths =
            |wanted| -> Vec<usize> { pieces(&line, &zones, wanted).iter().map(Vec::len).collect() };
        assert_eq!(lengths(Some(&zone)), [5]);
        assert_eq!(lengths(None), [3, 5]);
    }

    #[test]
    fn distances_are_round() {
        let of = [0.0139, 0.0101, 0.01, 0.0512].map(rounded);
        let near = |(a, b): (f64, f64)| (a / b - 1.0).abs() < 1e-9;
        assert!(
            of.into_iter().zip([0.015, 0.015, 0.01, 0.1]).all(near),
            "{of:?}"
        );
    }
}
