//! The time loop of a coupon test.

use crate::specimen::{Common, Specimen};
use plyflow_mechanics::energy::{EnergyHealth, Ledger, judge};
use plyflow_model::artifact::SpecimenBody;
use plyflow_sdk::{Host, On, Progress, StepError};
use std::time::Instant;

/// A test: what is done to the specimen and what is measured.
pub trait Test {
    /// Simulated time (s).
    fn duration(&self) -> f64;
    /// Sets loads and pressures for the step from time `t` (s).
    fn apply(&mut self, _specimen: &mut Specimen, _t: f64) {}
    /// Called after every step; for averages. Cheap.
    fn stepped(&mut self, _specimen: &Specimen) {}
    /// Called [`SAMPLES`] times, evenly spaced, after a step that kept the element's fields, and once at the
    /// end.
    fn sample(&mut self, specimen: &Specimen, t: f64);
    /// Whether the test is over before its time.
    fn done(&self) -> bool {
        false
    }
    /// What is being done, for the progress.
    fn phase(&self) -> &'static str {
        "testing"
    }
}

/// Samples in a test.
pub const SAMPLES: usize = 400;

/// Steps between two looks at the critical step; elements that close under shear lose theirs quickly.
const CRITICAL_EVERY: u64 = 200;

/// What came of a run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Times of the ledger (s).
    pub time: Vec<f64>,
    /// The ledger, at each sample.
    pub ledger: Vec<Ledger>,
    /// Its health.
    pub health: EnergyHealth,
    /// Largest hourglass energy over the largest internal energy.
    pub hourglass_ratio: f64,
    /// Steps done.
    pub cycles: u64,
    /// Smallest step used (s).
    pub smallest_step: f64,
    /// Wall seconds of the loop.
    pub seconds: f64,
}

/// Runs the test to its end: writes a frame at the start, `frames` evenly spaced ones, and keeps the
/// ledger. The body is called `specimen`; it is defined here.
///
/// # Errors
/// When the run becomes unstable, a component fails, or it is cancelled.
pub fn run(
    host: &Host,
    p: &Common,
    specimen: &mut Specimen,
    test: &mut dyn Test,
) -> Result<Outcome, StepError> {
    let cells: Vec<u32> = specimen.mesh.cells.iter().flatten().copied().collect();
    host.define_mesh(
        "specimen",
        &specimen.mesh.points,
        4,
        &cells,
        &SpecimenBody::new(p.thickness()),
    )?;
    let end = test.duration();
    let started = Instant::now();
    let mut shown = (Instant::now(), 0);
    let (mut time, mut ledger) = (Vec::new(), Vec::new());
    let mut smallest_step = f64::INFINITY;
    let mut next_frame = 0;
    let frames = p.frames.max(1);
    let interval = end / SAMPLES as f64;
    let mut critical = 0.0;
    let mut looked = None;
    for sample in 0..SAMPLES {
        let stale = looked.is_none_or(|c| specimen.model.cycle() >= c + CRITICAL_EVERY);
        if stale {
            critical = specimen.model.critical_step().map_err(|e| e.to_string())?;
            looked = Some(specimen.model.cycle());
        }
        let wanted = p
            .time_step
            .unwrap_or(f64::INFINITY)
            .min(p.step_safety * critical);
        // Of two and more: what is measured is the mean over the steps between samples, and the first of all says nothing yet.
        let steps = (interval / wanted).ceil().max(2.0);
        if steps.is_nan() || steps > 1e9 {
            return Err(format!(
                "the critical step has fallen to {critical:.3e} s at t = {:.5} s: an element has collapsed. \
                 Try a finer mesh or a larger hourglass stiffness",
                specimen.model.time()
            )
            .into());
        }
        let steps = steps as u64;
        specimen.model.set_step(interval / steps as f64);
        smallest_step = smallest_step.min(specimen.model.dt());
        let start = interval * sample as f64;
        for k in 0..steps {
            // Times from the count, not from a sum.
            let t = start + specimen.model.dt() * k as f64;
            test.apply(specimen, t);
            specimen
                .model
                .step_from(t, k == 0)
                .map_err(|e| e.to_string())?;
            test.stepped(specimen);
            if k == 0 {
                test.sample(specimen, t);
                let energies = specimen.model.energies();
                time.push(t);
                ledger.push(energies);
                if sample * frames >= next_frame * SAMPLES {
                    frame(host, specimen, t)?;
                    next_frame += 1;
                }
                host.check_cancelled()?;
                report(host, specimen, test, &energies, end, &mut shown);
            }
            // At once: what runs away does not wait for the next sample.
            if test.done() {
                break;
            }
        }
        if test.done() {
            break;
        }
    }
    // A step has moved the time to its end.
    let t = specimen.model.time();
    test.apply(specimen, t);
    specimen.model.step(true).map_err(|e| e.to_string())?;
    test.sample(specimen, t);
    time.push(t);
    ledger.push(specimen.model.energies());
    frame(host, specimen, t)?;
    let internal = ledger.iter().map(Ledger::internal).fold(0.0, f64::max);
    let hourglass = ledger.iter().map(|l| l.hourglass).fold(0.0, f64::max);
    Ok(Outcome {
        health: judge(&ledger),
        hourglass_ratio: if internal > 0.0 {
            hourglass / internal
        } else {
            0.0
        },
        time,
        ledger,
        cycles: specimen.model.cycle(),
        smallest_step,
        seconds: started.elapsed().as_secs_f64(),
    })
}

fn frame(host: &Host, specimen: &Specimen, t: f64) -> Result<(), StepError> {
    host.begin_frame(t)?;
    host.write_points("specimen", specimen.model.x())?;
    for f in &specimen.fields {
        let (on, values) = if f.patch {
            (On::Points, specimen.model.patch_field(0, f.row))
        } else {
            (On::Cells, specimen.model.cell_field(0, f.row))
        };
        host.write_field("specimen", on, &f.name, 1, &f.unit, &values)?;
    }
    host.end_frame()
}

fn report(
    host: &Host,
    specimen: &Specimen,
    test: &dyn Test,
    e: &Ledger,
    end: f64,
    shown: &mut (Instant, u64),
) {
    let elapsed = shown.0.elapsed().as_secs_f64();
    if elapsed < 0.2 {
        return;
    }
    let cycle = specimen.model.cycle();
    let internal = e.internal();
    host.progress(&Progress {
        fraction: specimen.model.time() / end,
        simulated_time: specimen.model.time(),
        rate: (cycle - shown.1) as f64 / elapsed,
        energy_ratio: if internal > 0.0 {
            e.kinetic / internal
        } else {
            -1.0
        },
        phase: test.phase(),
    });
    *shown = (Instant::now(), cycle);
}

/// Runs `f` in a pool of the threads that the host allows.
///
/// # Errors
/// Those of `f`, or when the threads cannot be started.
pub fn with_threads(
    host: &Host,
    f: impl FnOnce() -> Result<(), StepError> + Send,
) -> Result<(), StepError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(host.threads())
        .build()
        .map_err(|e| format!("starting {} threads: {e}", host.threads()))?;
    pool.install(f)
}
