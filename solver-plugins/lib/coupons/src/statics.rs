//! Load steps that are brought to rest.

use plyflow_mechanics::model::Model;
use plyflow_mechanics::relax::{Relaxed, Tolerance, relax};
use plyflow_sdk::{Host, Progress, StepError};
use std::time::{Duration, Instant};

/// Between two reports of progress.
const REPORT: Duration = Duration::from_millis(200);

/// One load step of several.
#[derive(Debug, Clone, Copy)]
pub struct LoadStep {
    /// Its number, from 1.
    pub number: usize,
    /// How many there are.
    pub of: usize,
}

/// Brings the model to rest under its loads.
///
/// # Errors
/// When it does not come to rest, becomes unstable, a component fails, or the step is cancelled.
pub fn rest(
    host: &Host,
    model: &mut Model,
    tolerance: Tolerance,
    step: LoadStep,
    shown: &mut Instant,
) -> Result<Relaxed, StepError> {
    let relaxed = relax(model, tolerance, |_| {
        host.check_cancelled()?;
        if shown.elapsed() > REPORT {
            *shown = Instant::now();
            host.progress(&Progress {
                fraction: (step.number as f64 - 0.5) / step.of as f64,
                phase: "loading",
                ..Progress::default()
            });
        }
        Ok::<(), Stop>(())
    })
    .map_err(|e| e.0)?;
    if relaxed.balanced {
        return Ok(relaxed);
    }
    Err(format!(
        "load step {} of {} is not at rest after {} steps: forces out of balance are {:.1e} of the \
         loads, expected {:.1e}. Allow more cycles, use more load steps, a smaller step_safety, or a coarser mesh",
        step.number, step.of, relaxed.cycles, relaxed.residual, tolerance.balance
    )
    .into())
}

/// Why a relaxation stopped.
struct Stop(StepError);

impl From<plyflow_mechanics::MechanicsError> for Stop {
    fn from(e: plyflow_mechanics::MechanicsError) -> Self {
        Self(e.to_string().into())
    }
}

impl From<StepError> for Stop {
    fn from(e: StepError) -> Self {
        Self(e)
    }
}
