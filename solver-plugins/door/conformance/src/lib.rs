//! Judges element and material components against the contract of `plyflow.h`: buffers, finite numbers, lanes
//! that depend on themselves alone, forces that are derivatives of energies, independence of the observer,
//! critical steps that are bounds. Call it in a process that may die: the component is foreign code. The step
//! plugin `plugin-conformance` does, and `plyflow check-plugin` runs that.
//!
//! Every check has a [`Rule`] and ends in a [`Check`] with a measured number where there is one. A [`Sink`] hears
//! of a check before it begins, so that a crash can be told apart from its neighbours.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod bending;
mod breaches;
mod buffer;
mod cycle;
mod element;
mod element_motion;
mod law;
mod linear;
mod material;
mod material_law;
mod meeting;
mod neighbours;
mod patch;
mod rules;
mod shapes;
mod slope;
mod subject;

pub use element::check_element;
pub use material::check_material;

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

/// What a check came to, before it is paired with its rule.
pub(crate) enum Seen {
    /// A number that must not exceed a limit, and where it was met.
    Number {
        measured: f64,
        limit: f64,
        what: String,
    },
    /// As demanded.
    Well(String),
    /// Not as demanded.
    Bad(String),
    /// Nothing to check.
    Nothing(String),
}

/// The checks of one component as they gather.
pub(crate) struct Run<'a> {
    sink: &'a mut dyn Sink,
    checks: Vec<Check>,
}

impl<'a> Run<'a> {
    pub(crate) fn new(sink: &'a mut dyn Sink) -> Self {
        Self {
            sink,
            checks: Vec::new(),
        }
    }

    /// Makes a check; whether it did not fail.
    pub(crate) fn check(&mut self, rule: Rule, judge: impl FnOnce() -> Seen) -> bool {
        self.sink.begins(&rule);
        let (outcome, seen, measured, limit) = match judge() {
            Seen::Number {
                measured,
                limit,
                what,
            } => {
                // A NaN is no pass.
                let well = measured <= limit;
                let outcome = if well {
                    Outcome::Passed
                } else {
                    Outcome::Failed
                };
                (outcome, what, Some(measured), Some(limit))
            }
            Seen::Well(text) => (Outcome::Passed, text, None, None),
            Seen::Bad(text) => (Outcome::Failed, text, None, None),
            Seen::Nothing(text) => (Outcome::Skipped, text, None, None),
        };
        // JSON knows no NaN and no infinity.
        let measured = measured.filter(|m| m.is_finite());
        let check = Check {
            rule,
            outcome,
            seen,
            measured,
            limit,
        };
        self.sink.ends(&check);
        self.checks.push(check);
        outcome != Outcome::Failed
    }

    /// Says of checks that they were not made.
    pub(crate) fn skip(&mut self, rules: &[Rule], why: &str) {
        for rule in rules {
            self.check(*rule, || Seen::Nothing(why.to_owned()));
        }
    }

    pub(crate) fn finish(self) -> Vec<Check> {
        self.checks
    }
}

/// Whether `a` is worse than `b`; a NaN is worse than anything.
pub(crate) fn worse(a: f64, b: f64) -> bool {
    a > b || a.is_nan()
}

/// A reproducible sequence of numbers in -1..1 (xorshift).
pub(crate) struct Sequence(pub(crate) u64);

impl Sequence {
    pub(crate) fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Between two numbers.
    pub(crate) fn between(&mut self, a: f64, b: f64) -> f64 {
        a + 0.5 * (b - a) * (1.0 + self.next())
    }
}

/// The names of the checks that failed.
#[must_use]
pub fn failed(checks: &[Check]) -> Vec<&'static str> {
    let failed = checks.iter().filter(|c| c.outcome == Outcome::Failed);
    failed.map(|c| c.rule.name).collect()
}
