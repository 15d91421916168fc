//! The limits of the engineer, held against what the steps have found.
//!
//! A limit is judged where the finest model has looked: in the zones by their fine runs, elsewhere by the run of the whole part. What nobody
//! has looked at closely enough is not judged, and said to be so.

mod defects;
mod fields;
mod governed;
mod told;

pub use told::{allowed_text, failing, found_text, in_short, reasons, table};

use crate::family::Fate;
use crate::input::ReportInput;
use crate::read::{Material, Study};
use governed::Governed;
use plyflow_model::artifact::Cause;
use plyflow_model::workflow::{LimitOn, Limits};
use std::cmp::Ordering;

/// How a limit fared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kept {
    /// Nothing that was found is beyond it.
    Within,
    /// Something is.
    Beyond,
    /// Nothing is beyond it, but not all of what it is about has been looked at.
    NotJudged,
}

impl Kept {
    /// In words.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Within => "within",
            Self::Beyond => "beyond",
            Self::NotJudged => "not judged",
        }
    }
}

/// Something that was found, and where.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// Name of the defect, such as `AW1`; none of a field.
    pub name: Option<String>,
    /// Name of the ply.
    pub ply: String,
    /// Name of the zone in which it was found.
    pub zone: Option<String>,
    /// `[x, y]` (m), where it is in the flat ply.
    pub at: [f64; 2],
    /// What is held against the limit (SI).
    pub value: f64,
    /// The run that has it, for people.
    pub by: String,
    /// Whether it reaches the cut of its zone, so that it may be larger than it is told.
    pub at_cut: bool,
    /// What most likely brought a wrinkle about, where that is known.
    pub cause: Option<Cause>,
    /// Mean shear angle along a wrinkle's crest, where that is known (rad).
    pub crest_shear: Option<f64>,
}

impl Finding {
    /// Where it is, in words: `AW1 on ply_1, zone A, at x = 120 mm, y = -30 mm`.
    #[must_use]
    pub fn place(&self) -> String {
        let mm = |v: f64| crate::units::fixed(v * 1e3, 0);
        let zone = self.zone.as_ref().map(|z| format!(", zone {z}"));
        let name = self.name.as_ref().map(|n| format!("{n} on "));
        format!(
            "{}{}{} at x = {} mm, y = {} mm",
            name.unwrap_or_default(),
            self.ply,
            zone.unwrap_or_default(),
            mm(self.at[0]),
            mm(self.at[1])
        )
    }
}

/// A limit with what was found.
#[derive(Debug, Clone, PartialEq)]
pub struct Judged {
    /// The point of a study, else the run that was judged where there are several; empty where there is one.
    pub of: String,
    /// The place for which it holds; `None`: the whole part.
    pub place: Option<String>,
    /// What is limited.
    pub on: LimitOn,
    /// The limit (SI).
    pub limit: f64,
    /// How it fared.
    pub verdict: Kept,
    /// The worst that was found of it, within the limit or not; `None`: nothing was found.
    pub worst: Option<Finding>,
    /// All that is beyond it, the worst first. Of a field there is one for each ply and run.
    pub beyond: Vec<Finding>,
    /// Who has looked, for people.
    pub by: String,
    /// Why it is not judged, or what is to be known of the verdict.
    pub notes: Vec<String>,
}

/// How far a value has gone into the direction of a limit: what is compared with [`size`] of the limit.
pub(crate) fn size(on: LimitOn, value: f64) -> f64 {
    match on {
        LimitOn::ShearPositive => value,
        LimitOn::ShearNegative => -value,
        _ => value.abs(),
    }
}

/// What was looked at for a limit, before it is asked where that limit holds.
#[derive(Debug, Clone, Default)]
pub(crate) struct Evidence {
    /// What was found, of every size.
    pub(crate) findings: Vec<Finding>,
    /// Who has looked.
    pub(crate) by: Vec<String>,
    /// Why something has not been looked at.
    pub(crate) open: Vec<String>,
    /// What is to be known all the same.
    pub(crate) notes: Vec<String>,
}

impl Evidence {
    /// Without anybody who has looked.
    pub(crate) fn none(why: impl Into<String>) -> Self {
        Self {
            open: vec![why.into()],
            ..Self::default()
        }
    }
}

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
    for point in &family.points {
        let instances = point.instances.iter();
        let own = ReportInput {
            instances: instances.map(|i| input.instances[*i].clone()).collect(),
            family: None,
            ..input.clone()
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
        let governed = Governed::new(limits, sheets.unwrap_or_default());
        let of = if studies.len() > 1 { &study.title } else { "" };
        let defects = defects::Look::new(input, &material, study);
        let fields = fields::Look::new(input, &material, study);
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
    let none = Limits::default();
    let mut all = Vec::new();
    for on in [LimitOn::WrinkleHeight, LimitOn::BridgingGap] {
        for study in judged_studies(material) {
            let evidence = defects::Look::new(input, material, study).evidence(on, &none);
            let named = evidence.findings.into_iter().filter(|f| f.name.is_some());
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shear_limit_of_one_sign_leaves_the_other_alone() {
        assert!(size(LimitOn::ShearNegative, -0.9) > size(LimitOn::ShearNegative, -0.8));
        assert!(size(LimitOn::ShearNegative, 0.9) < 0.0);
        assert!(size(LimitOn::ShearPositive, -0.9) < 0.0);
        assert_eq!(size(LimitOn::Shear, -0.9), 0.9);
    }
}
