//! The limits of the engineer, held against what the steps have found.
//!
//! A limit is judged where the finest model has looked: in the zones by their fine runs, elsewhere by the run of the whole part. What nobody
//! has looked at closely enough is not judged, and said to be so.

mod defects;
mod draped;
mod evidence;
mod fields;
mod governed;

use crate::family::Fate;
use crate::input::ReportInput;
use crate::judged::{Finding, Judged};
use crate::read::{Material, Study};
use evidence::Evidence;
use governed::Governed;
use plyflow_model::workflow::{LimitOn, Limits};
use std::cmp::Ordering;

/// Holds the limits of a workflow against what its artifacts tell, which are read for it; nothing without limits. Of a study every point is
/// judged by itself.
#[must_use]
pub fn judge(input: &ReportInput) -> Vec<Judged> {
    let Some(limits) = &input.limits else {
        return Vec::new();
    };
    let Some(family) = &input.family else {
        return of_run(input, limits);
    };
    let mut all = Vec::new();
    // What all points share, without the instances of a thousand of them.
    let shared = ReportInput {
        instances: Vec::new(),
        family: None,
        ..input.clone()
    };
    for point in &family.points {
        let instances = point.instances.iter();
        let own = ReportInput {
            instances: instances.map(|i| input.instances[*i].clone()).collect(),
            ..shared.clone()
        };
        let judged = match point.fate {
            Fate::Done => of_run(&own, limits),
            Fate::Failed { .. } => unjudged(limits, "a step of this point has failed"),
            Fate::NotRun => unjudged(limits, "not all steps of this point have run"),
        };
        all.extend(judged.into_iter().map(|j| {
            let of = match j.of.is_empty() {
                true => point.name.clone(),
                false => format!("{}, {}", point.name, j.of),
            };
            Judged { of, ..j }
        }));
    }
    all
}

/// All limits without a verdict.
fn unjudged(limits: &Limits, why: &str) -> Vec<Judged> {
    let evidence = |_| Evidence::none(why);
    Governed::new(limits, &[]).judged("", evidence)
}

fn of_run(input: &ReportInput, limits: &Limits) -> Vec<Judged> {
    let material = Material::read(input, false);
    let studies = judged_studies(&material);
    if studies.is_empty() {
        return unjudged(limits, "no step has formed plies yet");
    }
    let mut all = Vec::new();
    for study in &studies {
        let sheets = study.global.as_ref().map(|g| g.facts.sheets.as_slice());
        let of = if studies.len() > 1 { &study.title } else { "" };
        let defects = defects::Look::new(input, &material, study);
        let fields = fields::Look::new(input, &material, study);
        let governed = Governed::new(limits, sheets.unwrap_or_default()).over(fields.cells());
        all.extend(governed.judged(of, |on| match on {
            LimitOn::WrinkleHeight
            | LimitOn::WrinkleLength
            | LimitOn::BridgingGap
            | LimitOn::BridgingArea => defects.evidence(on, limits),
            _ => fields.evidence(on, &governed),
        }));
    }
    all
}

/// The wrinkles by their heights and the bridging by its gaps that were found, each the largest first: what is told where there are no limits.
pub(crate) fn largest(input: &ReportInput, material: &Material) -> Vec<(LimitOn, Finding)> {
    let mut all = Vec::new();
    for on in [LimitOn::WrinkleHeight, LimitOn::BridgingGap] {
        for study in judged_studies(material) {
            let list = defects::Look::new(input, material, study).list(on);
            let named = list.into_iter().filter(|f| f.name.is_some());
            all.extend(named.map(|f| (on, f)));
        }
    }
    all.sort_by(|a, b| {
        (a.0, b.1.value)
            .partial_cmp(&(b.0, a.1.value))
            .unwrap_or(Ordering::Equal)
    });
    all
}

/// A wrinkle or a place of bridging, with all its sizes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Found {
    pub(crate) name: String,
    pub(crate) ply: String,
    pub(crate) zone: Option<String>,
    /// `[x, y]` (m), where it is in the flat ply.
    pub(crate) at: [f64; 2],
    /// Of a wrinkle (m).
    pub(crate) height: Option<f64>,
    /// Of a wrinkle's crest (m); else 0.
    pub(crate) length: f64,
    /// Of bridging (m).
    pub(crate) gap: Option<f64>,
}

impl Found {
    pub(crate) fn is_wrinkle(&self) -> bool {
        self.height.is_some()
    }

    /// Height or gap (m).
    pub(crate) fn size(&self) -> f64 {
        self.height.or(self.gap).unwrap_or(0.0)
    }
}

/// All wrinkles and places of bridging that were measured.
pub(crate) fn found(input: &ReportInput, material: &Material) -> Vec<Found> {
    let mut all: Vec<Found> = Vec::new();
    for study in judged_studies(material) {
        let look = defects::Look::new(input, material, study);
        for on in [
            LimitOn::WrinkleHeight,
            LimitOn::WrinkleLength,
            LimitOn::BridgingGap,
        ] {
            for f in look.list(on) {
                let Some(name) = f.name else { continue };
                let same = |d: &&mut Found| {
                    (&d.name, &d.ply, &d.zone, d.at) == (&name, &f.ply, &f.zone, f.at)
                };
                if on == LimitOn::WrinkleLength {
                    if let Some(known) = all.iter_mut().find(same) {
                        known.length = f.value;
                    }
                    continue;
                }
                all.push(Found {
                    name,
                    ply: f.ply,
                    zone: f.zone,
                    at: f.at,
                    height: (on == LimitOn::WrinkleHeight).then_some(f.value),
                    length: 0.0,
                    gap: (on == LimitOn::BridgingGap).then_some(f.value),
                });
            }
        }
    }
    all
}

/// The runs that are judged: those that something looked at; else those of a solver, else all. A drape by geometry that stands beside a run
/// with forces says nothing that the run does not say better.
pub(crate) fn judged_studies(material: &Material) -> Vec<&Study> {
    let all = || material.studies.iter().filter(|s| s.global.is_some());
    let looked_at: Vec<&Study> = all().filter(|s| is_looked_at(material, s)).collect();
    if !looked_at.is_empty() {
        return looked_at;
    }
    let has_forces = |s: &&Study| {
        let net = |g: &crate::read::Run| g.facts.net_spacing.is_some();
        !s.global.as_ref().is_some_and(net)
    };
    let solved: Vec<&Study> = all().filter(has_forces).collect();
    if solved.is_empty() {
        all().collect()
    } else {
        solved
    }
}

fn is_looked_at(material: &Material, study: &Study) -> bool {
    study.detection.is_some()
        || study.comparison.is_some()
        || !defects::measurements(material, study).is_empty()
}
