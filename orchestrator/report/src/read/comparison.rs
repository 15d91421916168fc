//! What a comparison found, with what the page tells of it besides.

use crate::units::plural;
use plyflow_model::artifact;
use plyflow_model::job::NamedResult;

/// A comparison.
#[derive(Debug, Clone)]
pub(crate) struct Comparison {
    /// Its attributes.
    pub(crate) told: artifact::Comparison,
    /// Its step, for people.
    pub(crate) label: String,
    /// Wrinkles and places of bridging that the reference has, wherever, and no local run.
    pub(crate) missed: [usize; 2],
    /// What else compares the same zones, for people.
    pub(crate) others: Vec<String>,
}

impl Comparison {
    /// What its step reported of the defects that the local runs have not; nought without a reference.
    pub(crate) fn missed_by(results: &[NamedResult]) -> [usize; 2] {
        let count = |name: &str| results.iter().find(|r| r.name == name);
        ["missed_wrinkles", "missed_bridging"].map(|n| count(n).map_or(0, |r| r.value as usize))
    }

    /// What the reference has and no local run, in words.
    pub(crate) fn missed_text(&self) -> Option<String> {
        let [wrinkles, bridging] = self.missed;
        let mut parts = Vec::new();
        if wrinkles > 0 {
            parts.push(plural(wrinkles, "wrinkle", "wrinkles"));
        }
        if bridging > 0 {
            parts.push(plural(bridging, "bridging area", "bridging areas"));
        }
        (!parts.is_empty()).then(|| parts.join(" and "))
    }
}
