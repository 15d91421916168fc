//! Where the time of a step goes, from some of the steps.

use std::time::{Duration, Instant};

/// One step of so many is measured: no multiple of the steps in which normals are made or contacts look again, so that all kinds
/// are met in their shares.
const INTERVAL: u64 = 61;

/// Wall time of the steps that were measured. It is no part of the model's state: it tells of the machine, and a run that goes on
/// from a checkpoint begins with none.
#[derive(Debug, Clone, Copy, Default)]
pub struct Spent {
    /// In contacts: looking for them, their forces, the normals that they want; with one thread also the adding of the forces to the nodes,
    /// which with several is done beside the elements.
    pub contacts: Duration,
    /// In elements and patches, from gathering their nodes to adding up their forces.
    pub elements: Duration,
    /// In moving the nodes and what drives them.
    pub nodes: Duration,
    /// In what loads and guides the model before each step, such as the cavity of a bag.
    pub loads: Duration,
    /// In all.
    pub all: Duration,
}

impl Spent {
    /// Share of the time that a `part` of it takes; `None` before a step was measured.
    pub fn share(&self, part: Duration) -> Option<f64> {
        (!self.all.is_zero()).then(|| part.as_secs_f64() / self.all.as_secs_f64())
    }

    /// Counts what a clock that was started before the loads has seen: they come before the step.
    pub fn count_loads(&mut self, clock: Clock) {
        let before = self.loads;
        clock.add_to(&mut self.loads);
        self.all += self.loads - before;
    }
}

/// The clock of one step: running in those that are measured.
pub struct Clock(Option<Instant>);

impl Clock {
    /// That of the step which is to come, when so many have been done.
    pub fn of_step(cycle: u64) -> Self {
        Self(cycle.is_multiple_of(INTERVAL).then(Instant::now))
    }

    /// Another one, which runs if this one does.
    pub(super) fn part(&self) -> Self {
        Self(self.0.map(|_| Instant::now()))
    }

    /// Adds what has passed.
    pub(super) fn add_to(self, sum: &mut Duration) {
        if let Some(start) = self.0 {
            *sum += start.elapsed();
        }
    }
}
