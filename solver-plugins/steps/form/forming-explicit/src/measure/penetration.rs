//! How deep sheets lie in each other and in rigid surfaces.

use crate::forming::Forming;
use crate::stack::SHARE_SQUEEZED;
use crate::words::in_mm;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::contact::{RigidItem, SlaveItem};
use serde::{Deserialize, Serialize};

/// Share of the thinner body beyond which what bodies share is told.
pub const OVERLAP_BOUND: f64 = 0.1;
/// The same on the way, where loads grow and contacts take them over a little late.
pub const OVERLAP_PEAK_BOUND: f64 = 0.25;
/// Nodes in touch from which on a quantile says something of a pair: with fewer, one node at a corner is the 99.9 % quantile.
pub const MANY: usize = 100;

/// Penetration of one pair at present.
#[derive(Debug, Clone, PartialEq)]
pub struct Penetration {
    /// Name of the pair.
    pub pair: String,
    /// How many nodes touch.
    pub nodes: usize,
    /// Largest of its nodes in touch (m).
    pub largest: f64,
    /// Where that node is (m); `None` when none touches.
    pub place: Option<Vec3>,
    /// 99.9 % quantile of them (m).
    pub q999: f64,
    /// By how much two sheets are kept further apart than they are thick (m).
    pub spare: f64,
    /// Thickness of the thinner sheet (m); of a sheet held through others that of all these.
    pub thinner: f64,
}

impl Penetration {
    /// `depths`: of the nodes in touch, how deep (m) and where (m).
    fn new(pair: &str, mut depths: Vec<(f64, Vec3)>, spare: f64, thinner: f64) -> Self {
        depths.sort_by(|a, b| a.0.total_cmp(&b.0));
        let last = depths.len().saturating_sub(1);
        let at = (0.999 * depths.len() as f64) as usize;
        let depth = |i: usize| depths.get(i).map_or(0.0, |d| d.0);
        Self {
            pair: pair.to_owned(),
            nodes: depths.len(),
            largest: depth(last),
            place: depths.last().map(|d| d.1),
            q999: depth(at.min(last)),
            spare,
            thinner,
        }
    }

    /// What the bodies themselves share of the thinner one's thickness, at the 99.9 % quantile: penetration beyond the distance
    /// by which a pair is kept further apart than it is thick.
    pub fn overlap(&self) -> f64 {
        self.overlap_of(self.q999)
    }

    /// The same of a penetration of `depth` (m).
    pub fn overlap_of(&self, depth: f64) -> f64 {
        ((depth - self.spare) / self.thinner).max(0.0)
    }

    /// What to tell of bodies that share more than a tenth of the thinner one at the end.
    pub fn too_deep(&self) -> Option<String> {
        (self.overlap() > OVERLAP_BOUND).then(|| {
            format!(
                "'{}' reach into each other by {:.0} % of the thinner one (99.9 % quantile, bound {:.0} %{}): {REMEDY}",
                self.pair,
                100.0 * self.overlap(),
                100.0 * OVERLAP_BOUND,
                self.place.map_or_else(String::new, |p| format!(", deepest at {}", in_mm(p)))
            )
        })
    }

    /// By how much bodies shared more than a quarter of the thinner one when they did most with [`MANY`] nodes in touch, if they are not told
    /// at the end.
    fn was_too_deep(&self, peak: &PenetrationPeak) -> Option<f64> {
        let then = self.overlap_of(peak.q999);
        let gone = self.overlap() <= OVERLAP_BOUND;
        (gone && peak.many && then > OVERLAP_PEAK_BOUND).then_some(then)
    }
}

const REMEDY: &str =
    "refine the mesh there, or take a smaller time step, with which contacts are stiffer";

/// What to tell of all pairs that were too deep on the way and are no longer at the end, the deepest first.
pub fn too_deep_on_the_way(now: &[Penetration], peaks: &[PenetrationPeak]) -> Option<String> {
    let pairs = now.iter().zip(peaks);
    let mut deep: Vec<_> = pairs
        .filter_map(|(p, peak)| Some((p.was_too_deep(peak)?, p, peak)))
        .collect();
    deep.sort_by(|a, b| b.0.total_cmp(&a.0));
    let told = |(overlap, p, peak): &(f64, &Penetration, &PenetrationPeak)| {
        let place = peak
            .q999_place
            .map_or_else(String::new, |x| format!(", deepest at {}", in_mm(x)));
        format!(
            "'{}' by {:.0} % at {:.4} s{place}",
            p.pair,
            100.0 * overlap,
            peak.q999_time
        )
    };
    let all: Vec<String> = deep.iter().map(told).collect();
    (!all.is_empty()).then(|| {
        format!(
            "on the way, but no longer at the end, bodies reached into each other by more than {:.0} % of the thinner one (99.9 % quantiles): \
             {}. Where that matters, {REMEDY}",
            100.0 * OVERLAP_PEAK_BOUND,
            all.join("; ")
        )
    })
}

/// Largest penetrations of one pair over the frames of a run, and when they were.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct PenetrationPeak {
    /// Largest of its nodes in touch (m).
    pub largest: f64,
    /// When that was (s).
    pub largest_time: f64,
    /// Where that node was (m); `None` when none touched.
    pub place: Option<Vec3>,
    /// Largest 99.9 % quantile (m): of the frames with [`MANY`] nodes in touch where there are such, else of all.
    pub q999: f64,
    /// When that was (s).
    pub q999_time: f64,
    /// Where its deepest node was then (m).
    pub q999_place: Option<Vec3>,
    /// Whether [`MANY`] nodes touched then.
    pub many: bool,
}

/// Counts the penetrations `now`, at `time` (s), among the largest so far, by pair. Of equal ones the first counts.
pub fn keep_largest(peaks: &mut Vec<PenetrationPeak>, now: &[Penetration], time: f64) {
    peaks.resize_with(now.len(), PenetrationPeak::default);
    for (peak, p) in peaks.iter_mut().zip(now) {
        if p.largest > peak.largest {
            (peak.largest, peak.largest_time, peak.place) = (p.largest, time, p.place);
        }
        let many = p.nodes >= MANY;
        if (many, p.q999) > (peak.many, peak.q999) {
            (peak.q999, peak.q999_time, peak.many) = (p.q999, time, many);
            peak.q999_place = p.place;
        }
    }
}

impl Forming {
    /// Penetrations of all pairs: on rigid surfaces, of sheets on each other, of plies on themselves.
    pub fn penetrations(&self) -> Vec<Penetration> {
        let m = &self.model;
        // Pairs are called by their two bodies; what is no sheet is rigid, and has no thickness.
        let thickness = |pair: &str| -> Vec<f64> {
            let of = |name: &str| m.sheets().iter().find(|s| s.name == name);
            pair.split('/')
                .filter_map(of)
                .map(|s| s.thickness)
                .collect()
        };
        let judge = |pair: &str, spare: f64, depths: Vec<(f64, Vec3)>| {
            let thinner = thickness(pair).into_iter().fold(f64::INFINITY, f64::min);
            Penetration::new(pair, depths, spare, thinner)
        };
        let between = |pair: &str, offset: f64, depths: Vec<(f64, Vec3)>| {
            let spare = offset - 0.5 * thickness(pair).iter().sum::<f64>();
            judge(pair, spare, depths)
        };
        let at = |node: u32| m.x()[node as usize];
        let deep = |i: &SlaveItem| (i.penetration, at(i.node));
        let rigid = m.rigid_contacts().iter().map(|c| {
            let touching = c.items.iter().filter(|i| i.penetration > 0.0);
            let depth = |i: &RigidItem| (f64::from(i.penetration) + c.slack, at(i.node));
            let touching = touching.map(depth).collect();
            if c.slack > 0.0 {
                // What lies between is squeezed, not the sheet itself.
                Penetration::new(&c.name, touching, 0.0, c.slack / SHARE_SQUEEZED)
            } else {
                judge(&c.name, 0.0, touching)
            }
        });
        // What catches lets in on purpose, by another depth at each place. How deep plies are in each other the watch tells. Where a driven node lies
        // is not for contact to say.
        let holding = m.sheet_contacts().iter().filter(|c| c.let_in.is_none());
        let sheets = holding.map(|c| {
            let touching = (c.items.iter()).filter(|i| i.active && !m.is_driven(i.node));
            between(&c.name, c.offset, touching.map(deep).collect())
        });
        let selves = m.self_contacts().iter().map(|c| {
            let touching = c.items.iter().map(|i| &i.slave);
            let touching = touching.filter(|i| i.active && !m.is_driven(i.node));
            judge(&c.name, 0.0, touching.map(deep).collect())
        });
        rigid.chain(sheets).chain(selves).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_every_pair_the_largest_and_their_times_are_kept() {
        let at =
            |depth: f64| Penetration::new("film/ply", vec![(depth, [depth, 0.0, 0.0])], 0.0, 1e-4);
        let few = || Penetration::new("ply/ply", vec![(3e-5, [2.0; 3])], 0.0, 1e-4);
        let many = || (0..2000).map(|i| (f64::from(i) / 1e8, [1.0; 3])).collect();
        let spread = Penetration::new("ply/ply", many(), 0.0, 1e-4);
        let none = || Penetration::new("ply/ply", Vec::new(), 0.0, 1e-4);
        let mut peaks = Vec::new();
        keep_largest(&mut peaks, &[at(1e-6), few()], 0.0);
        keep_largest(&mut peaks, &[at(3e-6), spread], 0.1);
        keep_largest(&mut peaks, &[at(3e-6), none()], 0.2);
        keep_largest(&mut peaks, &[at(2e-6), none()], 0.3);
        let [film, ply] = &peaks[..] else {
            panic!("two pairs")
        };
        assert_eq!(
            (film.largest, film.largest_time, film.q999_time),
            (3e-6, 0.1, 0.1)
        );
        assert_eq!(film.place, Some([3e-6, 0.0, 0.0]));
        // One node was deeper before many touched: the largest of all, but no quantile.
        assert_eq!((ply.largest, ply.largest_time), (3e-5, 0.0));
        assert_eq!((ply.q999, ply.q999_time), (1.998e-5, 0.1));
        assert!(ply.many && !film.many);
    }

    #[test]
    fn what_is_kept_further_apart_than_it_is_thick_overlaps_later() {
        let depths: Vec<(f64, Vec3)> = (0..2000)
            .map(|i| (f64::from(i) / 1e8, [0.0, 0.0, f64::from(i)]))
            .collect();
        let close = Penetration::new("film/ply", depths.clone(), 0.0, 8e-5);
        assert_eq!((close.largest, close.q999), (1.999e-5, 1.998e-5));
        assert!((close.overlap() - 0.24975).abs() < 1e-12);
        assert_eq!(close.place, Some([0.0, 0.0, 1999.0]));
        let told = close.too_deep().unwrap();
        assert!(
            told.contains("'film/ply'") && told.contains("25 %") && !told.contains(" at 0"),
            "{told}"
        );
        let apart = Penetration::new("film/film", depths, 2.2e-4, 8e-5);
        assert_eq!((apart.overlap(), apart.too_deep()), (0.0, None));
        assert_eq!(
            Penetration::new("ply/ply", Vec::new(), 0.0, 1e-4).overlap(),
            0.0
        );
    }

    #[test]
    fn all_that_was_too_deep_on_the_way_is_told_at_once() {
        let peak = |q999: f64, many: bool| PenetrationPeak {
            q999,
            q999_time: 0.125,
            place: Some([0.0; 3]),
            q999_place: Some([0.001, 0.002, 0.003]),
            many,
            ..PenetrationPeak::default()
        };
        let pair =
            |name: &str, depth: f64| Penetration::new(name, vec![(depth, [0.0; 3])], 0.0, 8e-5);
        let now = ["bed/film", "film/ply", "ply/ply", "film/film", "tool/film"]
            .map(|name| pair(name, if name == "film/film" { 2e-5 } else { 0.0 }));
        // Of these the third is within the bound, the fourth still too deep at the end, the last of a few nodes only.
        let peaks = [
            (2.4e-5, true),
            (4e-5, true),
            (1.9e-5, true),
            (4e-5, true),
            (4e-5, false),
        ];
        let peaks = peaks.map(|(q999, many)| peak(q999, many));
        let told = too_deep_on_the_way(&now, &peaks).unwrap();
        let deepest = told.find("'film/ply' by 50 % at 0.1250 s, deepest at (1.0, 2.0, 3.0) mm");
        let next = told.find("'bed/film' by 30 % at 0.1250 s");
        assert!(deepest.is_some() && deepest < next, "{told}");
        assert!(
            ["ply/ply", "film/film", "tool/film"]
                .iter()
                .all(|n| !told.contains(n)),
            "{told}"
        );
        assert!(now[3].too_deep().is_some());
        assert_eq!(too_deep_on_the_way(&now[2..3], &peaks[2..3]), None);
    }
}
