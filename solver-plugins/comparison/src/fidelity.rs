//! How far a model is from the reference: the coarse run by itself, and the fine runs of the zones.

use crate::QUANTILES;
use crate::models::{Model, Role, Zone};
use crate::table::{apart, same_within, unlike};
use plyflow_defects::{Defect, Kind, Ply, Settings, measure, quantiles};
use plyflow_sdk::{Host, StepError};

/// A defect and the name of its ply.
type Found<'a> = (&'a str, &'a Defect);

/// What one kind of model has of the reference's defects.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Fidelity {
    /// Relative errors of the lengths of wrinkles that both have.
    pub length: Vec<f64>,
    /// Of their amplitudes.
    pub amplitude: Vec<f64>,
    /// Of the areas of bridging that both have.
    pub area: Vec<f64>,
    /// Wrinkles, and places of bridging, that the reference has alone.
    pub missed: [usize; 2],
    /// Those that it has not.
    pub wrong: [usize; 2],
}

/// What is found down to this share of the least sizes may be the other of a pair, so that a defect just below a least size is
/// not taken for one that is not there.
const PAIRED_DOWN_TO: f64 = 0.5;

impl Fidelity {
    /// Pairs the defects of one ply and kind whose centres are near enough, the most alike first. Both lists go down to
    /// [`PAIRED_DOWN_TO`] of the least sizes in `settings`; what lies below these counts only beside one that does not.
    pub fn of(ours: &[Found<'_>], theirs: &[Found<'_>], settings: &Settings) -> Self {
        let counts = |d: &Defect| match d.kind {
            Kind::Wrinkle => d.length >= settings.minimum_wrinkle_length,
            Kind::Bridging => d.area >= settings.minimum_bridging_area,
        };
        let mut near: Vec<(f64, usize, usize)> = Vec::new();
        for (i, (ply, a)) in ours.iter().enumerate() {
            for (j, (other, b)) in theirs.iter().enumerate() {
                let same = ply == other && a.kind == b.kind && apart(a, b) <= same_within(a, b);
                if same && (counts(a) || counts(b)) {
                    near.push((unlike(a, b), i, j));
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
        let mut found = Self::default();
        let index = |d: &Defect| usize::from(d.kind == Kind::Bridging);
        for ((_, a), j) in ours.iter().zip(&pair) {
            let Some(j) = j else {
                found.wrong[index(a)] += usize::from(counts(a));
                continue;
            };
            let b = theirs[*j].1;
            let error = |a: f64, b: f64| (a - b).abs() / b;
            if a.kind == Kind::Wrinkle {
                found.length.push(error(a.length, b.length));
                found.amplitude.push(error(a.amplitude, b.amplitude));
            } else {
                found.area.push(error(a.area, b.area));
            }
        }
        for ((_, b), _) in theirs.iter().zip(&taken).filter(|(_, t)| !**t) {
            found.missed[index(b)] += usize::from(counts(b));
        }
        found
    }

    /// Mean over the reference's defects of the error of length or area, a missed one counting as 1; `None` when it has no
    /// defect.
    pub fn error(&self) -> Option<f64> {
        let both = self.length.iter().chain(&self.area);
        let missed = self.missed.iter().sum::<usize>();
        let count = both.clone().count() + missed;
        (count > 0).then(|| (both.sum::<f64>() + missed as f64) / count as f64)
    }

    fn write(&self, host: &Host, suffix: &str) -> Result<(), StepError> {
        if let Some(error) = self.error() {
            host.result(&format!("defect_error{suffix}"), error, "1")?;
        }
        let errors = [
            ("wrinkle_length_error", &self.length),
            ("wrinkle_amplitude_error", &self.amplitude),
            ("bridging_area_error", &self.area),
        ];
        for (name, errors) in errors.into_iter().filter(|e| !e.1.is_empty()) {
            let mean = errors.iter().sum::<f64>() / errors.len() as f64;
            host.result(&format!("{name}{suffix}"), mean, "1")?;
        }
        for (k, kind) in ["wrinkles", "bridging"].iter().enumerate() {
            host.result(
                &format!("missed_{kind}{suffix}"),
                self.missed[k] as f64,
                "1",
            )?;
            host.result(&format!("false_{kind}{suffix}"), self.wrong[k] as f64, "1")?;
        }
        Ok(())
    }
}

/// Writes how the local runs together, and the global run by itself, stand beside the reference, all of
/// whose defects count, wherever they are; and by model how far its shear angles are from the reference's.
pub fn write(
    host: &Host,
    models: &[Model],
    zones: &[Zone],
    settings: &Settings,
) -> Result<(), StepError> {
    let Some(reference) = models.iter().find(|m| m.role == Role::Reference) else {
        return Ok(());
    };
    let theirs = everywhere(&[reference], settings);
    let theirs = named(&theirs);
    for (role, suffix) in [(Role::Local, ""), (Role::Global, ".global")] {
        let models: Vec<&Model> = models.iter().filter(|m| m.role == role).collect();
        let ours = everywhere(&models, settings);
        Fidelity::of(&named(&ours), &theirs, settings).write(host, suffix)?;
    }
    for model in models.iter().filter(|m| m.role != Role::Reference) {
        let within = model.zone.map(|z| zones[z].bounds);
        let errors = model.plies.iter().filter_map(|p| {
            let other = reference.plies.iter().find(|r| r.name == p.name)?;
            shear_error(p, other, within)
        });
        if let Some(worst) = errors.reduce(f64::max) {
            host.result(
                &format!("shear_quantile_error.{}", model.name),
                worst,
                "rad",
            )?;
        }
    }
    Ok(())
}

/// The defects of all plies of some models, by ply, also the smaller ones that a pair may need: bridging down to a smaller area,
/// and ridges that are too short for a wrinkle. Those come besides what is measured there as bridging, so that what a place
/// is does not hang on them.
fn everywhere(models: &[&Model], settings: &Settings) -> Vec<(String, Vec<Defect>)> {
    let smaller = Settings {
        minimum_bridging_area: PAIRED_DOWN_TO * settings.minimum_bridging_area,
        ..*settings
    };
    let shorter = Settings {
        minimum_wrinkle_length: PAIRED_DOWN_TO * settings.minimum_wrinkle_length,
        ..*settings
    };
    let all = |p: &Ply| {
        let inside = vec![true; p.formed.len()];
        let mut found = measure(p, &inside, &smaller);
        let short =
            |d: &Defect| d.kind == Kind::Wrinkle && d.length < settings.minimum_wrinkle_length;
        found.extend(measure(p, &inside, &shorter).into_iter().filter(short));
        found
    };
    (models.iter().flat_map(|m| &m.plies))
        .map(|p| (p.name.clone(), all(p)))
        .collect()
}

fn named(found: &[(String, Vec<Defect>)]) -> Vec<Found<'_>> {
    found
        .iter()
        .flat_map(|(ply, defects)| defects.iter().map(move |d| (ply.as_str(), d)))
        .collect()
}

/// Largest difference of the quantiles of two plies' shear angles (rad), of the second within a box (m) of the flat ply.
fn shear_error(ours: &Ply, theirs: &Ply, within: Option<[f64; 4]>) -> Option<f64> {
    let inside = |c: &usize| {
        let corners = theirs.topology.cell(*c);
        let centre = |d: usize| {
            let sum: f64 = corners
                .iter()
                .map(|&i| theirs.undeformed[i as usize][d])
                .sum();
            sum / corners.len() as f64
        };
        within.is_none_or(|b| (0..2).all(|d| (b[d]..=b[d + 2]).contains(&centre(d))))
    };
    let angles: Vec<f64> = (0..theirs.topology.cells())
        .filter(inside)
        .map(|c| theirs.shear_angle[c])
        .collect();
    if angles.is_empty() || ours.shear_angle.is_empty() {
        return None;
    }
    let (a, b) = (
        quantiles(&ours.shear_angle, &QUANTILES),
        quantiles(&angles, &QUANTILES),
    );
    a.iter()
        .zip(&b)
        .map(|(a, b)| (a - b).abs())
        .reduce(f64::max)
}
