//! The observer of a run that writes for the host.

use crate::course::{Course, Observer};
use crate::forming::Forming;
use crate::output::checkpoint::{Part, Recorder};
use crate::stack::RigidName;
use plyflow_geometry::vec3::{Vec3, add};
use plyflow_mechanics::component::ElementField;
use plyflow_mechanics::energy::Ledger;
use plyflow_sdk::{Host, Log, Progress, StepError};
use std::borrow::Cow;
use std::time::Instant;

/// What follows a run for the host: frames, checkpoints, progress.
pub struct Writer<'a> {
    host: &'a Host,
    frames: Recorder<'a>,
    /// By body.
    fields: Vec<Vec<ElementField>>,
    started: Instant,
    shown: Instant,
    cycle_shown: u64,
    /// Where this attempt began.
    first_cycle: u64,
}

impl<'a> Writer<'a> {
    /// For a run that starts now; `fields`: by body, what is written of its elements.
    pub fn new(host: &'a Host, fields: Vec<Vec<ElementField>>) -> Self {
        let started = Instant::now();
        Self {
            host,
            frames: Recorder::new(host),
            fields,
            started,
            shown: started,
            cycle_shown: 0,
            first_cycle: 0,
        }
    }

    /// Steps of this attempt per second, when it has come to step `cycles`.
    pub fn rate(&self, cycles: u64) -> f64 {
        let own = cycles - self.first_cycle;
        own as f64 / self.started.elapsed().as_secs_f64().max(1e-9)
    }
}

impl Writer<'_> {
    /// Shows where the run is, a few times in a second, and stops it when that is wanted.
    fn show(
        &mut self,
        f: &Forming,
        end: f64,
        energy_ratio: f64,
        phase: &str,
    ) -> Result<(), StepError> {
        self.host.check_cancelled()?;
        let (elapsed, model) = (self.shown.elapsed().as_secs_f64(), &f.model);
        if elapsed > 0.2 {
            self.host.progress(&Progress {
                fraction: model.time() / end,
                simulated_time: model.time(),
                rate: (model.cycle() - self.cycle_shown) as f64 / elapsed,
                energy_ratio,
                phase,
            });
            (self.shown, self.cycle_shown) = (Instant::now(), model.cycle());
        }
        Ok(())
    }
}

impl Observer for Writer<'_> {
    fn frame(&mut self, forming: &Forming, time: f64) -> Result<(), StepError> {
        self.frames.put(&Part::Begin(time))?;
        for (body, fields) in forming.bodies.iter().zip(&self.fields) {
            let name = || Cow::from(&body.name);
            let points = forming.points(body).into();
            self.frames.put(&Part::Points(name(), points))?;
            for f in fields {
                let values = forming.field(body, f, fields);
                let (field, unit) = (Cow::from(&f.name), Cow::from(&f.unit));
                self.frames
                    .put(&Part::Field(name(), !f.patch, field, unit, values.into()))?;
            }
            let pressure = forming.contact_pressure(body).into();
            let (field, unit) = ("contact_pressure".into(), "Pa".into());
            self.frames
                .put(&Part::Field(name(), false, field, unit, pressure))?;
        }
        if forming.load.moves_parts() {
            let moved = |points: &[Vec3], part: &RigidName| -> Vec<Vec3> {
                let shift = forming.shift(part);
                points.iter().map(|x| add(*x, shift)).collect()
            };
            let tool = moved(&forming.tool.points, &RigidName::Tool).into();
            let name = RigidName::Tool.word().into();
            self.frames.put(&Part::Points(name, tool))?;
            for part in &forming.rigid {
                let points = moved(part.points(), &part.name).into();
                let name = Cow::from(part.name.word().to_owned());
                self.frames.put(&Part::Points(name, points))?;
            }
        }
        self.frames.put(&Part::End)
    }

    fn resume(&mut self, forming: &mut Forming, course: &mut Course) -> Result<(), StepError> {
        if self.frames.resume(forming, course)? {
            let model = &forming.model;
            (self.cycle_shown, self.first_cycle) = (model.cycle(), model.cycle());
            self.host.progress(&Progress {
                fraction: model.time() / forming.load.duration(),
                simulated_time: model.time(),
                phase: "going on from a checkpoint",
                ..Progress::default()
            });
        }
        Ok(())
    }

    fn threads(&self) -> Option<usize> {
        Some(self.host.threads())
    }

    fn slower(&mut self, what: &str) {
        self.host.log(Log::Warn, what);
    }

    fn between_frames(&mut self, forming: &mut Forming, course: &mut Course) {
        self.frames.checkpoint(forming, course);
    }

    fn tick(&mut self, forming: &Forming, e: &Ledger, end: f64) -> Result<(), StepError> {
        let (internal, time) = (e.internal(), forming.model.time());
        let ratio = if internal > 0.0 {
            e.kinetic / internal
        } else {
            -1.0
        };
        self.show(forming, end, ratio, forming.load.phase(time))
    }

    fn settling(&mut self, forming: &Forming) -> Result<(), StepError> {
        let end = forming.load.duration();
        self.show(forming, end, -1.0, "finding the balance at the start")
    }
}
