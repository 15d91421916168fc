//! The order of points: what is better than what.

use crate::value::Value;

/// What became of a point.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// It has a result.
    Done {
        /// What is to be small.
        objective: f64,
        /// How far each constraint is from being met; 0: it is.
        excess: Vec<f64>,
    },
    /// It has none, and never will.
    Failed,
}

impl Outcome {
    /// Whether it has a result that meets all constraints.
    #[must_use]
    pub fn is_feasible(&self) -> bool {
        matches!(self, Self::Done { excess, .. } if excess.iter().all(|e| *e == 0.0))
    }
}

/// A point and what became of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Told {
    /// Its values.
    pub point: Vec<Value>,
    /// What became of it.
    pub outcome: Outcome,
}

/// What the excess of each constraint is divided by before they are added: the largest among the first points that a method asks for, or,
/// where these meet it, that of the first point that does not. It never changes once it is used, so that the order of two points never does.
pub(super) fn scales(told: &[Told], first: usize) -> Vec<f64> {
    let mut scales: Vec<f64> = Vec::new();
    for (i, t) in told.iter().enumerate() {
        let Outcome::Done { excess, .. } = &t.outcome else {
            continue;
        };
        scales.resize(excess.len(), 0.0);
        for (scale, e) in scales.iter_mut().zip(excess) {
            if i < first || *scale == 0.0 {
                *scale = scale.max(*e);
            }
        }
    }
    scales
}

/// The sum of what is unmet, each constraint by its scale; `None` of what has failed.
pub(super) fn unmet(outcome: &Outcome, scales: &[f64]) -> Option<f64> {
    let Outcome::Done { excess, .. } = outcome else {
        return None;
    };
    let parts = excess.iter().zip(scales).filter(|(e, _)| **e > 0.0);
    Some(parts.map(|(e, s)| e / s).sum())
}

/// The place of each in the order: points that meet the constraints by what is to be small; behind them those that do not, by the sum of
/// what is unmet; behind them those that have failed. Equal points have equal places.
pub(super) fn ranks(told: &[Told], first: usize) -> Vec<f64> {
    let scales = scales(told, first);
    let place = |t: &Told| match &t.outcome {
        Outcome::Done { objective, .. } if t.outcome.is_feasible() => (0, *objective),
        done @ Outcome::Done { .. } => (1, unmet(done, &scales).unwrap_or(f64::INFINITY)),
        Outcome::Failed => (2, 0.0),
    };
    let places: Vec<(u8, f64)> = told.iter().map(place).collect();
    let mut order: Vec<usize> = (0..places.len()).collect();
    let compare = |a: &(u8, f64), b: &(u8, f64)| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1));
    order.sort_by(|a, b| compare(&places[*a], &places[*b]));
    let mut ranks = vec![0.0; told.len()];
    let mut rank = 0.0;
    for (k, i) in order.iter().enumerate() {
        if k > 0 && compare(&places[order[k - 1]], &places[*i]).is_ne() {
            rank += 1.0;
        }
        ranks[*i] = rank;
    }
    ranks
}
