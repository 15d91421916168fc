//! What came of a run.

use crate::course::history::HistoryRow;
use crate::course::progress::Course;
use crate::measure::PenetrationPeak;
use crate::watch::PairDepth;
use plyflow_mechanics::energy::{EnergyHealth, Ledger, judge};

/// What came of a run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The history.
    pub history: Vec<HistoryRow>,
    /// Its health.
    pub health: EnergyHealth,
    /// Steps done.
    pub cycles: u64,
    /// Smallest step used (s).
    pub smallest_step: f64,
    /// Of a run that begins late: how far (m) nodes of plies went there by themselves, 99.9 % quantile.
    pub start_shift: Option<f64>,
    /// Largest penetrations over all frames, in the order of [`Forming::penetrations`](crate::Forming::penetrations).
    pub peaks: Vec<PenetrationPeak>,
    /// What the watch found.
    pub depths: Vec<PairDepth>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

impl Outcome {
    /// Of a run that has come to its end after `cycles` steps. `kinetic_bound`: kinetic over internal energy above which it is marked.
    /// `least`: energy (J) that is too little to judge. `source`: whose contact energy unaccounted for comes from.
    pub fn of(
        course: Course,
        depths: Vec<PairDepth>,
        cycles: u64,
        kinetic_bound: f64,
        least: f64,
        source: Option<String>,
    ) -> Self {
        let ledgers: Vec<Ledger> = course.history.iter().map(|r| r.ledger).collect();
        let health = judge(&ledgers, least);
        Self {
            warnings: warnings(&health, kinetic_bound, source.as_deref()),
            history: course.history,
            health,
            cycles,
            smallest_step: course.smallest_step,
            start_shift: course.start_shift,
            peaks: course.peaks,
            depths,
        }
    }
}

/// Share of the work from which on the user is told that it is unaccounted for.
const DRIFT: f64 = 0.01;

fn warnings(h: &EnergyHealth, kinetic_bound: f64, source: Option<&str>) -> Vec<String> {
    let mut list = Vec::new();
    if h.peak_kinetic_ratio > kinetic_bound {
        list.push(format!(
            "kinetic energy reached {:.1} % of internal energy (bound {:.1} %): the run is not \
             quasi-static. Use longer process times or less mass scaling",
            100.0 * h.peak_kinetic_ratio,
            100.0 * kinetic_bound
        ));
    }
    if h.peak_drift_ratio > DRIFT {
        list.push(format!(
            "{:.1} % of the external work is unaccounted for: reduce time_step or step_safety{}{}",
            100.0 * h.peak_drift_ratio,
            if source.is_some() { ". " } else { "" },
            source.unwrap_or_default()
        ));
    }
    if h.hourglass_ratio > 0.05 {
        list.push(format!(
            "hourglass energy is {:.1} % of internal energy: refine the mesh",
            100.0 * h.hourglass_ratio
        ));
    }
    list
}
