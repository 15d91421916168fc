//! What is demanded, how it ended, and who hears of it.

pub use plyflow_model::artifact::CheckOutcome as Outcome;
use plyflow_model::artifact::{ConformanceCheck, ConformanceRule};

/// What is demanded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rule {
    /// Name of the check, e.g. `batch-independence`.
    pub name: &'static str,
    /// What a component that keeps the contract does.
    pub expected: &'static str,
    /// What to do when it does not.
    pub remedy: &'static str,
}

/// One check that has ended.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// What was demanded.
    pub rule: Rule,
    /// How it ended.
    pub outcome: Outcome,
    /// What was seen, in a sentence.
    pub seen: String,
    /// The measured number, when the check has one.
    pub measured: Option<f64>,
    /// The largest that is allowed.
    pub limit: Option<f64>,
}

impl Rule {
    /// For the artifact.
    pub fn told(&self) -> ConformanceRule {
        ConformanceRule {
            name: self.name.into(),
            expected: self.expected.into(),
            remedy: self.remedy.into(),
        }
    }
}

impl Check {
    /// For the artifact.
    pub fn told(&self) -> ConformanceCheck {
        ConformanceCheck {
            rule: self.rule.told(),
            outcome: self.outcome,
            seen: self.seen.clone(),
            measured: self.measured,
            limit: self.limit,
        }
    }
}

/// Hears of checks as they go.
pub trait Sink {
    /// A check begins; should the component end the process now, it was this one.
    fn begins(&mut self, rule: &Rule);
    /// A check has ended.
    fn ends(&mut self, check: &Check);
}

/// For callers that only want the checks at the end.
pub struct Silent;

impl Sink for Silent {
    fn begins(&mut self, _: &Rule) {}
    fn ends(&mut self, _: &Check) {}
}

/// The names of the checks that failed.
#[must_use]
pub fn failed(checks: &[Check]) -> Vec<&'static str> {
    let failed = checks.iter().filter(|c| c.outcome == Outcome::Failed);
    failed.map(|c| c.rule.name).collect()
}
