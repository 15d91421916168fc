//! Defects of the runs that are confirmed, followed through the variants.

use crate::runs::All;
use plyflow_defects::pairs::{Pairs, apart, counts, measure_for_pairs, name_of, same_within};
use plyflow_defects::{Defect, Kind, Ply, Settings};
use plyflow_model::artifact::Zone;
use plyflow_sdk::{Host, StepError};

/// A defect and the name of its ply.
type Found = (String, Defect);

/// A defect of a run that is confirmed, and what became of it.
pub struct Followed {
    /// Such as `AW1`.
    pub id: String,
    /// Index of its zone.
    pub zone: usize,
    /// Name of its ply.
    pub ply: String,
    /// As it is in that run.
    pub defect: Defect,
    /// By variant, and by the runs of it that look at the zone, the coarsest first.
    pub seen: Vec<Vec<Seen>>,
    /// In the whole by which the bounds are judged, if there is one.
    pub reference: Option<Seen>,
}

/// What a run has of a defect.
#[derive(Debug, Clone)]
pub enum Seen {
    /// The same defect.
    Same(Box<Defect>),
    /// The other kind of defect at its place.
    Instead(Kind),
    /// None.
    Gone,
}

impl Seen {
    /// The defect, where it is there.
    pub fn same(&self) -> Option<&Defect> {
        match self {
            Self::Same(defect) => Some(defect),
            _ => None,
        }
    }
}

/// A defect of a variant that is none of the run that is confirmed.
pub struct New {
    /// Index of the variant.
    pub variant: usize,
    /// Name of the step.
    pub step: String,
    /// Index of the zone whose box it lies in; `None`: outside of all of them.
    pub zone: Option<usize>,
    /// Name of its ply.
    pub ply: String,
    /// What was measured.
    pub defect: Defect,
}

/// Everything that was found.
pub struct Tracks {
    /// By zone, numbered.
    pub followed: Vec<Followed>,
    /// By variant and its runs.
    pub new: Vec<New>,
    /// By variant: wrinkles and places of bridging.
    pub count: Vec<[usize; 2]>,
    /// Defects that only the whole has by which the bounds are judged.
    pub missed: usize,
}

/// Place of a kind in a count.
pub fn place(kind: Kind) -> usize {
    usize::from(kind == Kind::Bridging)
}

/// The defects of a run within a zone, from the uppermost ply down, also the smaller ones that a pair may need.
fn found(plies: &[Ply], zone: &Zone, settings: &Settings) -> Vec<Found> {
    let mut all = Vec::new();
    for ply in plies.iter().rev() {
        // The mesh of a zone reaches past it, to the nearest lines of the whole's.
        let inside: Vec<bool> = ply.undeformed.iter().map(|p| zone.holds(p, 0.0)).collect();
        let measured = measure_for_pairs(ply, &inside, settings);
        all.extend(measured.into_iter().map(|d| (ply.name.clone(), d)));
    }
    all
}

/// Follows every defect through every variant.
///
/// # Errors
/// When the run is cancelled.
pub fn follow(host: &Host, all: &All, settings: &Settings) -> Result<Tracks, StepError> {
    let mut base = Vec::new();
    for (run, zone) in all.base.iter().zip(&all.zones) {
        host.check_cancelled()?;
        base.push(found(&run.plies, zone, settings));
    }
    let mut followed = numbered(all, &base, settings);
    let (mut new, mut count) = (Vec::new(), Vec::new());
    for (v, variant) in all.variants.iter().enumerate() {
        let mut own = [0, 0];
        for (k, run) in variant.runs.iter().enumerate() {
            host.check_cancelled()?;
            let zones: Vec<usize> = (0..base.len())
                .filter(|&z| variant.of_zone[z].contains(&k))
                .collect();
            let is_finest = zones.iter().any(|&z| variant.of_zone[z].last() == Some(&k));
            let theirs = found(&run.plies, &run.zone, settings);
            let looked = Looked::new(zones, &base, theirs, settings);
            for defect in followed
                .iter_mut()
                .filter(|d| looked.zones.contains(&d.zone))
            {
                let seen = looked.seen(defect);
                defect.seen[v].push(seen);
            }
            if is_finest {
                looked.count(&mut own);
                let alone = looked.alone(&followed).into_iter();
                new.extend(alone.map(|(ply, defect)| {
                    New {
                        variant: v,
                        step: run.step.clone(),
                        zone: (looked.zones.iter().copied())
                            .find(|z| all.zones[*z].holds(&defect.centre, 0.0)),
                        ply,
                        defect,
                    }
                }));
            }
        }
        count.push(own);
    }
    // Runs come in the order in which they were given.
    for defect in &mut followed {
        for (seen, variant) in defect.seen.iter_mut().zip(&all.variants) {
            let order = &variant.of_zone[defect.zone];
            let mut given = order.clone();
            given.sort_unstable();
            let at = |k: &usize| given.iter().position(|g| g == k).unwrap_or(0);
            *seen = order.iter().map(|k| seen[at(k)].clone()).collect();
        }
    }
    let missed = in_reference(host, all, &base, &mut followed, settings)?;
    Ok(Tracks {
        followed,
        new,
        count,
        missed,
    })
}

/// Follows every defect to the whole by which the bounds are judged; how many defects that has alone, in the zones.
fn in_reference(
    host: &Host,
    all: &All,
    base: &[Vec<Found>],
    followed: &mut [Followed],
    settings: &Settings,
) -> Result<usize, StepError> {
    let Some(whole) = &all.reference else {
        return Ok(0);
    };
    let mut missed = 0;
    for (z, zone) in all.zones.iter().enumerate() {
        host.check_cancelled()?;
        let theirs = found(&whole.plies, zone, settings);
        let looked = Looked::new(vec![z], base, theirs, settings);
        for defect in followed.iter_mut().filter(|d| d.zone == z) {
            defect.reference = Some(looked.seen(defect));
        }
        missed += looked.alone(followed).len();
    }
    Ok(missed)
}

/// Those that count, with their names.
fn numbered(all: &All, base: &[Vec<Found>], settings: &Settings) -> Vec<Followed> {
    let mut list = Vec::new();
    for (zone, found) in base.iter().enumerate() {
        let mut next = [0, 0];
        for (ply, defect) in found.iter().filter(|f| counts(&f.1, settings)) {
            let number = &mut next[place(defect.kind)];
            *number += 1;
            list.push(Followed {
                id: name_of(&all.zones[zone].name, defect.kind, *number),
                zone,
                ply: ply.clone(),
                defect: defect.clone(),
                seen: vec![Vec::new(); all.variants.len()],
                reference: None,
            });
        }
    }
    list
}

/// A run of a variant, or the whole, beside those of the zones at which it looks.
struct Looked<'a> {
    /// Their indices.
    zones: Vec<usize>,
    ours: Vec<(usize, &'a Found)>,
    theirs: Vec<Found>,
    pairs: Pairs,
    settings: &'a Settings,
}

impl<'a> Looked<'a> {
    fn new(
        zones: Vec<usize>,
        base: &'a [Vec<Found>],
        theirs: Vec<Found>,
        settings: &'a Settings,
    ) -> Self {
        let of_zone = |&z: &usize| base[z].iter().map(move |f| (z, f));
        let ours: Vec<(usize, &Found)> = zones.iter().flat_map(of_zone).collect();
        let a: Vec<&Defect> = ours.iter().map(|(_, f)| &f.1).collect();
        let b: Vec<&Defect> = theirs.iter().map(|f| &f.1).collect();
        let on_one_ply =
            |i: usize, j: usize| (ours[i].1.0 == theirs[j].0).then(|| apart(a[i], b[j]));
        let pairs = Pairs::of(&a, &b, settings, on_one_ply);
        Self {
            zones,
            ours,
            theirs,
            pairs,
            settings,
        }
    }

    /// Place of a defect among ours.
    fn at(&self, of: &Followed) -> Option<usize> {
        let is = |(zone, (ply, d)): &(usize, &Found)| {
            *zone == of.zone
                && *ply == of.ply
                && d.kind == of.defect.kind
                && d.nodes == of.defect.nodes
        };
        self.ours.iter().position(is)
    }

    /// What this run has of a defect.
    fn seen(&self, of: &Followed) -> Seen {
        let at = self.at(of);
        let pair = self.pairs.both.iter().find(|p| Some(p.0) == at);
        if let Some((_, j)) = pair {
            return Seen::Same(Box::new(self.theirs[*j].1.clone()));
        }
        match self.instead(of) {
            Some(j) => Seen::Instead(self.theirs[j].1.kind),
            None => Seen::Gone,
        }
    }

    /// The other kind of defect at the place of one that is not there.
    fn instead(&self, of: &Followed) -> Option<usize> {
        let there = |j: &&usize| {
            let (ply, d) = &self.theirs[**j];
            let near = apart(d, &of.defect) <= same_within(d, &of.defect);
            *ply == of.ply && d.kind != of.defect.kind && near
        };
        self.pairs.missed.iter().find(there).copied()
    }

    /// Adds its wrinkles and places of bridging: those that are in what is confirmed too, and those that count by themselves.
    fn count(&self, sum: &mut [usize; 2]) {
        let of_pairs = self.pairs.both.iter();
        let of_pairs = of_pairs.filter(|(i, _)| counts(&self.ours[*i].1.1, self.settings));
        let all = of_pairs
            .map(|p| p.1)
            .chain(self.pairs.missed.iter().copied());
        all.for_each(|j| sum[place(self.theirs[j].1.kind)] += 1);
    }

    /// Its defects that are not in what is confirmed, also not as the other kind.
    fn alone(&self, followed: &[Followed]) -> Vec<Found> {
        let here = followed.iter().filter(|f| self.zones.contains(&f.zone));
        let lost = here.filter(|f| self.seen(f).same().is_none());
        let told: Vec<usize> = lost.filter_map(|f| self.instead(f)).collect();
        let free = self.pairs.missed.iter().filter(|j| !told.contains(j));
        free.map(|&j| self.theirs[j].clone()).collect()
    }
}
