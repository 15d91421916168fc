//! Which defect of one model, or of a scan, is which of another, and how far apart the two are.

use crate::{Defect, Kind, Ply, Settings, measure};
use plyflow_fixed::FixedBits;

/// Two defects are the same when their centres lie within this (m) or within half of the longer ridge.
const SAME_DEFECT: f64 = 0.015;

/// What is found down to this share of the least sizes may be the other of a pair, so that a defect just below a least size is
/// not taken for one that is not there.
const PAIRED_DOWN_TO: f64 = 0.5;

/// Distance of the centres of two defects in the flat ply (m).
pub fn apart(a: &Defect, b: &Defect) -> f64 {
    (a.centre[0] - b.centre[0]).fixed_hypot(a.centre[1] - b.centre[1])
}

/// How unlike two defects of one kind are (m), whose centres are `apart` (m): by place, length and width. Of several that may be
/// the same, the most alike is.
pub fn unlike(a: &Defect, b: &Defect, apart: f64) -> f64 {
    let width = (a.area.sqrt() - b.area.sqrt()).abs();
    apart + 0.5 * (a.length - b.length).abs() + 0.5 * width
}

/// How far apart the centres of two defects may be (m) that are the same.
pub fn same_within(a: &Defect, b: &Defect) -> f64 {
    SAME_DEFECT.max(0.5 * a.length.max(b.length))
}

/// The defects of a ply among its nodes `inside` (`[nodes]`), also the smaller ones that a pair may need: bridging down to a smaller area,
/// and ridges that are too short for a wrinkle. Those come besides what is measured there as bridging, so that what a place
/// is does not hang on them.
pub fn measure_for_pairs(ply: &Ply, inside: &[bool], settings: &Settings) -> Vec<Defect> {
    let smaller = Settings {
        minimum_bridging_area: PAIRED_DOWN_TO * settings.minimum_bridging_area,
        ..*settings
    };
    let shorter = Settings {
        minimum_wrinkle_length: PAIRED_DOWN_TO * settings.minimum_wrinkle_length,
        ..*settings
    };
    let mut found = measure(ply, inside, &smaller);
    let short = |d: &Defect| d.kind == Kind::Wrinkle && d.length < settings.minimum_wrinkle_length;
    found.extend(measure(ply, inside, &shorter).into_iter().filter(short));
    found
}

/// Whether a place of bridging is around the ridge of a wrinkle of the same ply. (Meshes of several zones count their nodes anew: so the two must be near
/// each other too.)
fn has_ridge(bridging: &Defect, wrinkle: &Defect) -> bool {
    let near = apart(bridging, wrinkle) <= SAME_DEFECT.max(bridging.area.sqrt());
    let holds = |node: &u32| bridging.nodes.binary_search(node).is_ok();
    bridging.kind == Kind::Bridging
        && wrinkle.kind == Kind::Wrinkle
        && near
        && wrinkle.ridge_nodes.iter().all(holds)
}

/// Whether a defect is as large as it must be to count.
pub fn counts(d: &Defect, settings: &Settings) -> bool {
    match d.kind {
        Kind::Wrinkle => d.length >= settings.minimum_wrinkle_length,
        Kind::Bridging => d.area >= settings.minimum_bridging_area,
    }
}

/// Name of a defect of a zone, such as `AW1`: zone, W (wrinkle) or B (bridging), number from 1 on. They are numbered from the uppermost ply of the zone's run
/// down, wrinkles by length and bridging by area.
pub fn name_of(zone: &str, kind: Kind, number: usize) -> String {
    let letter = match kind {
        Kind::Wrinkle => 'W',
        Kind::Bridging => 'B',
    };
    format!("{zone}{letter}{number}")
}

/// Defects that two models share, and those that one has alone.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Pairs {
    /// Index of ours and of theirs, by ours.
    pub both: Vec<(usize, usize)>,
    /// Theirs that we miss.
    pub missed: Vec<usize>,
    /// Ours that they have not.
    pub wrong: Vec<usize>,
}

impl Pairs {
    /// Pairs the defects of one kind whose centres are near enough, the most alike first. `apart`: distance of ours `i` from
    /// theirs `j` (m), `None` where they cannot be the same (on different plies). Both lists are those of
    /// [`measure_for_pairs`]; what lies below the least sizes of `settings` counts only beside one that does not.
    pub fn of(
        ours: &[&Defect],
        theirs: &[&Defect],
        settings: &Settings,
        apart: impl Fn(usize, usize) -> Option<f64>,
    ) -> Self {
        let counts = |d: &Defect| counts(d, settings);
        let mut near: Vec<(f64, usize, usize)> = Vec::new();
        for (i, a) in ours.iter().enumerate() {
            for (j, b) in theirs.iter().enumerate() {
                let within = |d: &f64| a.kind == b.kind && *d <= same_within(a, b);
                let Some(d) = apart(i, j).filter(within) else {
                    continue;
                };
                if counts(a) || counts(b) {
                    near.push((unlike(a, b, d), i, j));
                }
            }
        }
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
        let mut pair = vec![None; ours.len()];
        let mut taken = vec![false; theirs.len()];
        for (_, i, j) in near {
            if pair[i].is_none() && !taken[j] {
                (pair[i], taken[j]) = (Some(j), true);
            }
        }
        let both: Vec<(usize, usize)> = pair
            .iter()
            .enumerate()
            .filter_map(|(i, j)| Some((i, (*j)?)))
            .collect();
        let alone = |all: &[&Defect], free: &dyn Fn(usize) -> bool| -> Vec<usize> {
            let places = 0..all.len();
            places.filter(|&i| free(i) && counts(all[i])).collect()
        };
        let mut missed = alone(theirs, &|j| !taken[j]);
        let mut wrong = alone(ours, &|i| pair[i].is_none());
        // The bridging that a ridge too short for a wrinkle is part of is one place with it.
        for &(i, j) in &both {
            if !counts(ours[i]) {
                wrong.retain(|&k| !(has_ridge(ours[k], ours[i]) && apart(k, j).is_some()));
            }
            if !counts(theirs[j]) {
                missed.retain(|&k| !(has_ridge(theirs[k], theirs[j]) && apart(i, k).is_some()));
            }
        }
        Self {
            both,
            missed,
            wrong,
        }
    }
}

/// What one model has of another's defects.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PairErrors {
    /// Relative errors of the lengths of wrinkles that both have.
    pub length: Vec<f64>,
    /// Of their amplitudes.
    pub amplitude: Vec<f64>,
    /// Of the areas of bridging that both have.
    pub area: Vec<f64>,
    /// Wrinkles, and places of bridging, that the other has alone.
    pub missed: [usize; 2],
    /// Those that it has not.
    pub wrong: [usize; 2],
}

impl PairErrors {
    /// Of our defects against theirs.
    pub fn of(ours: &[&Defect], theirs: &[&Defect], pairs: &Pairs) -> Self {
        let mut errors = Self::default();
        let error = |a: f64, b: f64| (a - b).abs() / b;
        for &(i, j) in &pairs.both {
            let (a, b) = (ours[i], theirs[j]);
            if a.kind == Kind::Wrinkle {
                errors.length.push(error(a.length, b.length));
                errors.amplitude.push(error(a.amplitude, b.amplitude));
            } else {
                errors.area.push(error(a.area, b.area));
            }
        }
        let index = |d: &Defect| usize::from(d.kind == Kind::Bridging);
        (pairs.missed.iter()).for_each(|&j| errors.missed[index(theirs[j])] += 1);
        (pairs.wrong.iter()).for_each(|&i| errors.wrong[index(ours[i])] += 1);
        errors
    }

    /// Mean over the defects of both of the error of length or area, one that only one of the two has counting as
    /// 1; `None` when neither has one.
    pub fn error(&self) -> Option<f64> {
        let both = self.length.iter().chain(&self.area);
        let alone = self.missed.iter().chain(&self.wrong).sum::<usize>();
        let count = both.clone().count() + alone;
        (count > 0).then(|| (both.sum::<f64>() + alone as f64) / count as f64)
    }

    /// What it comes to, as names of results and shares or numbers, in the order in which they are reported.
    pub fn told(&self) -> Vec<(&'static str, f64)> {
        let mut told = Vec::new();
        told.extend(self.error().map(|e| ("defect_error", e)));
        let errors = [
            ("wrinkle_length_error", &self.length),
            ("wrinkle_amplitude_error", &self.amplitude),
            ("bridging_area_error", &self.area),
        ];
        for (name, errors) in errors.into_iter().filter(|e| !e.1.is_empty()) {
            told.push((name, errors.iter().sum::<f64>() / errors.len() as f64));
        }
        told.extend([
            ("missed_wrinkles", self.missed[0] as f64),
            ("false_wrinkles", self.wrong[0] as f64),
            ("missed_bridging", self.missed[1] as f64),
            ("false_bridging", self.wrong[1] as f64),
        ]);
        told
    }
}
