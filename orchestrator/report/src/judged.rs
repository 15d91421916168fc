//! Verdicts on the limits of the engineer.

use plyflow_model::artifact::Cause;
use plyflow_model::workflow::LimitOn;

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
