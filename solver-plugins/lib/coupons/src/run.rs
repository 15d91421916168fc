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

/// A test that has run, as what writes its results takes it.
pub struct Finished<'a, P, T> {
    /// The test's parameters.
    pub p: &'a P,
    /// The specimen at the end.
    pub specimen: &'a Specimen,
    /// What was measured.
    pub test: &'a T,
    /// What came of the run.
    pub outcome: &'a Outcome,
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
    let started = Instant::now();
    let mut course = Course {
        host,
        p,
        interval: test.duration() / SAMPLES as f64,
        specimen,
        test,
        critical: None,
        smallest_step: f64::INFINITY,
        time: Vec::new(),
        ledger: Vec::new(),
        frames: 0,
        shown: (Instant::now(), 0),
    };
    for sample in 0..SAMPLES {
        course.advance(sample)?;
        if course.test.done() {
            break;
        }
    }
    course.end()?;
    let ledger = course.ledger;
    let internal = ledger.iter().map(Ledger::internal).fold(0.0, f64::max);
    let hourglass = ledger.iter().map(|l| l.hourglass).fold(0.0, f64::max);
    Ok(Outcome {
        health: judge(&ledger, 0.0),
        hourglass_ratio: if internal > 0.0 {
            hourglass / internal
        } else {
            0.0
        },
        time: course.time,
        ledger,
        cycles: course.specimen.model.cycle(),
        smallest_step: course.smallest_step,
        seconds: started.elapsed().as_secs_f64(),
    })
}

/// A test on its way.
struct Course<'a> {
    host: &'a Host,
    p: &'a Common,
    specimen: &'a mut Specimen,
    test: &'a mut dyn Test,
    /// Time between two samples (s).
    interval: f64,
    /// The critical step (s), and the cycle in which it was looked at.
    critical: Option<(f64, u64)>,
    /// Smallest step so far (s).
    smallest_step: f64,
    /// Times of the ledger (s).
    time: Vec<f64>,
    ledger: Vec<Ledger>,
    /// Frames that are written.
    frames: usize,
    /// When progress was last reported, and at which cycle.
    shown: (Instant, u64),
}

impl Course<'_> {
    /// Chooses the step until the next sample; how many of them there are.
    fn steps(&mut self) -> Result<u64, StepError> {
        let (p, model) = (self.p, &mut self.specimen.model);
        let (critical, looked) = match self.critical {
            Some((step, cycle)) if model.cycle() < cycle + CRITICAL_EVERY => (step, cycle),
            _ => {
                let step = model.critical_step().map_err(|e| e.to_string())?;
                (step, model.cycle())
            }
        };
        self.critical = Some((critical, looked));
        let wanted = p
            .time_step
            .unwrap_or(f64::INFINITY)
            .min(p.step_safety * critical);
        // Of two and more: what is measured is the mean over the steps between samples, and the first of all says nothing yet.
        let steps = (self.interval / wanted).ceil().max(2.0);
        if steps.is_nan() || steps > 1e9 {
            return Err(format!(
                "the critical step has fallen to {critical:.3e} s at t = {:.5} s: an element has collapsed. \
                 Try a finer mesh or a larger hourglass stiffness",
                model.time()
            )
            .into());
        }
        let steps = steps as u64;
        model.set_step(self.interval / steps as f64);
        self.smallest_step = self.smallest_step.min(model.dt());
        Ok(steps)
    }

    /// Takes a sample, and goes on to the next.
    fn advance(&mut self, sample: usize) -> Result<(), StepError> {
        let steps = self.steps()?;
        let start = self.interval * sample as f64;
        for k in 0..steps {
            // Times from the count, not from a sum.
            let t = start + self.specimen.model.dt() * k as f64;
            self.test.apply(self.specimen, t);
            let stepped = self.specimen.model.step_from(t, k == 0);
            stepped.map_err(|e| e.to_string())?;
            self.test.stepped(self.specimen);
            if k == 0 {
                self.sample(t);
                if sample * self.p.frames.max(1) >= self.frames * SAMPLES {
                    frame(self.host, self.specimen, t)?;
                    self.frames += 1;
                }
                self.host.check_cancelled()?;
                self.report();
            }
            // At once: what runs away does not wait for the next sample.
            if self.test.done() {
                break;
            }
        }
        Ok(())
    }

    fn sample(&mut self, t: f64) {
        self.test.sample(self.specimen, t);
        self.time.push(t);
        self.ledger.push(self.specimen.model.energies());
    }

    /// The last sample and frame.
    fn end(&mut self) -> Result<(), StepError> {
        // A step has moved the time to its end.
        let t = self.specimen.model.time();
        self.test.apply(self.specimen, t);
        self.specimen.model.step(true).map_err(|e| e.to_string())?;
        self.sample(t);
        frame(self.host, self.specimen, t)
    }

    fn report(&mut self) {
        let elapsed = self.shown.0.elapsed().as_secs_f64();
        if elapsed < 0.2 {
            return;
        }
        let model = &self.specimen.model;
        let (cycle, energies) = (model.cycle(), model.energies());
        let internal = energies.internal();
        self.host.progress(&Progress {
            fraction: model.time() / self.test.duration(),
            simulated_time: model.time(),
            rate: (cycle - self.shown.1) as f64 / elapsed,
            energy_ratio: if internal > 0.0 {
                energies.kinetic / internal
            } else {
                -1.0
            },
            phase: self.test.phase(),
        });
        self.shown = (Instant::now(), cycle);
    }
}

fn frame(host: &Host, specimen: &Specimen, t: f64) -> Result<(), StepError> {
    host.begin_frame(t)?;
    host.write_points("specimen", specimen.model.x())?;
    for f in &specimen.fields {
        let on = if f.patch { On::Points } else { On::Cells };
        host.write_field("specimen", on, &f.name, 1, &f.unit, &specimen.values(f))?;
    }
    host.end_frame()
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
