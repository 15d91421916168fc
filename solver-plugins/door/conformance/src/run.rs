//! The checks of a component as they gather.

use crate::breaches::Breaches;
use crate::check::{Check, Outcome, Rule, Sink};
use crate::rules;

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

    /// Makes calls and judges them as such: their status, guard zones, whole and finite outputs. `made` says what was called
    /// when all is well. Whether `further` checks can be made; where they cannot, it says so of each.
    pub(crate) fn calls(
        &mut self,
        made: &str,
        further: &[Rule],
        call: impl FnOnce() -> Breaches,
    ) -> bool {
        let verdict = |fault: Option<String>, what: &str| match fault {
            Some(text) => Seen::Bad(text),
            None => Seen::Well(what.into()),
        };
        let mut all = Breaches::default();
        let well = self.check(rules::STATUS, || {
            all = call();
            verdict(all.status.take(), made)
        });
        let what = "4 KiB before and after each buffer are untouched";
        self.check(rules::GUARDS, || verdict(all.guards, what));
        let what = "all outputs are written";
        let whole = self.check(rules::COMPLETE, || verdict(all.gaps, what));
        let what = "all outputs are finite";
        let finite = self.check(rules::FINITE, || verdict(all.finite, what));
        let on = well && whole && finite;
        if !on {
            self.skip(further, "not checked: repair the above first");
        }
        on
    }

    pub(crate) fn finish(self) -> Vec<Check> {
        self.checks
    }
}

/// Whether `a` is worse than `b`; a NaN is worse than anything.
pub(crate) fn worse(a: f64, b: f64) -> bool {
    a > b || a.is_nan()
}
