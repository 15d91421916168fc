//! What would help: only what the fields of the run speak for, with what they say.

use super::bad::Bad;
use crate::input::ReportInput;
use crate::judged::{Finding, Kept};
use crate::units::quantity;
use plyflow_model::artifact::Cause;
use plyflow_model::workflow::LimitOn;

/// Leads that the first screen has room for.
pub(super) const SHOWN: usize = 4;
/// Names that a lead gives.
const NAMED: usize = 3;

/// What might help, and what speaks for it.
#[derive(Debug, PartialEq)]
pub(super) struct Lead {
    pub(super) advice: &'static str,
    pub(super) because: String,
}

/// Leads by the likely causes of what is bad, the worst place first.
pub(super) fn leads(input: &ReportInput, bad: &[Bad]) -> Vec<Lead> {
    let found: Vec<&(LimitOn, Finding)> = bad.iter().flat_map(|b| &b.found).collect();
    let mut all = of_causes(&found);
    all.extend(of_shear(&found));
    let cut = input.judged.iter().filter(|j| j.verdict == Kept::NotJudged);
    let mut cut = cut
        .flat_map(|j| &j.notes)
        .filter(|n| n.contains("the cut of"));
    all.extend(cut.next().map(|note| Lead {
        advice: "Let the fine runs reach farther there.",
        because: format!("{note}."),
    }));
    all
}

fn of_causes(found: &[&(LimitOn, Finding)]) -> Vec<Lead> {
    let mut causes: Vec<Cause> = Vec::new();
    for (on, f) in found {
        let gap = matches!(on, LimitOn::BridgingGap | LimitOn::BridgingArea);
        let cause = if gap { Some(Cause::Bridging) } else { f.cause };
        causes.extend(cause.filter(|c| !causes.contains(c)));
    }
    let with = |cause: Cause| {
        let mut names: Vec<&Finding> = Vec::new();
        for (_, f) in found {
            let new = !names.iter().any(|n| n.name == f.name && n.ply == f.ply);
            if f.cause == Some(cause) && new {
                names.push(f);
            }
        }
        names
    };
    causes
        .into_iter()
        .filter_map(|c| lead(c, &with(c), found))
        .collect()
}

/// Names of defects in words.
fn named(all: &[&Finding]) -> String {
    let names = all.iter().filter_map(|f| f.name.as_deref());
    let mut text = names.clone().take(NAMED).collect::<Vec<_>>().join(", ");
    let more = names.count().saturating_sub(NAMED);
    if more > 0 {
        text += &format!(" and {more} more");
    }
    text
}

fn lead(cause: Cause, with: &[&Finding], found: &[&(LimitOn, Finding)]) -> Option<Lead> {
    let (advice, because) = match cause {
        Cause::OverShear => {
            let shears = with.iter().filter_map(|f| f.crest_shear);
            let most = shears.max_by(|a, b| a.abs().total_cmp(&b.abs()));
            let most = most.map(|s| format!(", up to {} on the mean", quantity(s, "rad", 3)));
            (
                "Let the fabric shear less there: other fibre directions, or a cut in the blank.",
                format!(
                    "Along the crest of {} it is sheared further than it bears{}.",
                    named(with),
                    most.unwrap_or_default()
                ),
            )
        }
        Cause::Bridging => {
            let gap = |(on, f): &&&(LimitOn, Finding)| {
                matches!(on, LimitOn::BridgingGap | LimitOn::BridgingArea) && f.name.is_some()
            };
            let mut gaps: Vec<&Finding> = found.iter().filter(gap).map(|(_, f)| f).collect();
            gaps.dedup_by_key(|f| f.name.clone());
            let lies = match with.len() {
                1 => "lies beside a bridge",
                _ => "lie beside bridges",
            };
            let beside = match with.is_empty() {
                true => String::new(),
                false => format!(" {} {lies}, where length is left over.", named(with)),
            };
            let bridges = match gaps.is_empty() {
                true => String::new(),
                false => format!("The ply lacks length at {}.", named(&gaps)),
            };
            if beside.is_empty() && bridges.is_empty() {
                return None;
            }
            (
                "Give the ply the length that it lacks: a larger radius of the tool, or a cut beside the bridge.",
                format!("{bridges}{beside}").trim().to_owned(),
            )
        }
        Cause::InterPlyCompression => (
            "Let the plies slide on each other: less friction between them there, or plies of equal directions.",
            format!(
                "On the crest of {} fibres are compressed, and the next ply has other fibre directions.",
                named(with)
            ),
        ),
        Cause::FibreCompression => (
            "Keep the yarns under tension there: a holder, or a blank that ends elsewhere.",
            format!(
                "On the crest of {} the ply is pushed together along its yarns.",
                named(with)
            ),
        ),
        Cause::Undetermined => return None,
    };
    Some(Lead { advice, because })
}

fn of_shear(found: &[&(LimitOn, Finding)]) -> Option<Lead> {
    let is = |on: LimitOn| {
        matches!(
            on,
            LimitOn::Shear | LimitOn::ShearPositive | LimitOn::ShearNegative
        )
    };
    let (_, f) = found.iter().find(|(on, _)| is(*on))?;
    Some(Lead {
        advice: "Change what the tool asks of the ply: its fibre directions, or where the blank lies.",
        because: format!(
            "The shear angle is {} on {}.",
            quantity(f.value, "rad", 3),
            f.place()
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wrinkle(name: &str, cause: Cause, shear: f64) -> (LimitOn, Finding) {
        let finding = Finding {
            name: Some(name.into()),
            ply: "a".into(),
            zone: None,
            at: [0.0; 2],
            value: 1e-3,
            by: "run".into(),
            at_cut: false,
            cause: Some(cause),
            crest_shear: Some(shear),
        };
        (LimitOn::WrinkleHeight, finding)
    }

    #[test]
    fn a_lead_names_the_defects_that_speak_for_it_and_an_unknown_cause_gives_none() {
        let found = [
            wrinkle("AW1", Cause::OverShear, -0.9),
            wrinkle("AW2", Cause::Undetermined, 0.0),
            wrinkle("BW1", Cause::OverShear, -0.5),
        ];
        let leads = of_causes(&found.iter().collect::<Vec<_>>());
        assert_eq!(leads.len(), 1);
        assert_eq!(
            leads[0].because,
            "Along the crest of AW1, BW1 it is sheared further than it bears, up to -51.6 deg on the mean."
        );
        let none = [wrinkle("AW2", Cause::Undetermined, 0.0)];
        assert!(of_causes(&none.iter().collect::<Vec<_>>()).is_empty());
        assert_eq!(of_shear(&none.iter().collect::<Vec<_>>()), None);
    }
}
