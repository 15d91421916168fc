//! What a search has led to, point by point.

use super::rank::{Outcome, Told, scales, unmet};
use super::search::{Search, distinct};
use crate::problem::Problem;

/// What is said of a point of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Whether it meets all constraints; `None`: it has no result.
    pub feasible: Option<bool>,
    /// Position of the best point so far, this one among them: one that meets the constraints, if there is any; else the one that is nearest to it.
    /// `None`: all have failed.
    pub best: Option<usize>,
}

/// The entries of the points that have been told, in the order in which they were asked for.
///
/// # Errors
/// When a value of the search has too many digits.
pub fn trace(search: &Search, told: &[Told]) -> Result<Vec<Entry>, Problem> {
    let first = distinct(search, &search.begin())?;
    let scales = scales(told, first);
    let place = |t: &Told| match &t.outcome {
        Outcome::Done { objective, .. } if t.outcome.is_feasible() => Some((false, *objective)),
        done => Some((true, unmet(done, &scales)?)),
    };
    let mut best: Option<(usize, (bool, f64))> = None;
    let mut all = Vec::with_capacity(told.len());
    for (i, t) in told.iter().enumerate() {
        if let Some(new) = place(t) {
            let better =
                |old: &(bool, f64)| new.0.cmp(&old.0).then(new.1.total_cmp(&old.1)).is_lt();
            if best.as_ref().is_none_or(|(_, old)| better(old)) {
                best = Some((i, new));
            }
        }
        all.push(Entry {
            feasible: match &t.outcome {
                Outcome::Failed => None,
                done @ Outcome::Done { .. } => Some(done.is_feasible()),
            },
            best: best.map(|(i, _)| i),
        });
    }
    Ok(all)
}

/// Position of the best point that meets the constraints, if there is one.
#[must_use]
pub fn best(told: &[Told]) -> Option<usize> {
    let mut best: Option<(usize, f64)> = None;
    for (i, t) in told.iter().enumerate() {
        if let Outcome::Done { objective, .. } = t.outcome
            && t.outcome.is_feasible()
            && best.is_none_or(|(_, old)| objective < old)
        {
            best = Some((i, objective));
        }
    }
    best.map(|b| b.0)
}
