//! What the tests of friction share: parameters, the pull, means while all slides, and what is written.

use crate::output::Output;
use crate::run::{Outcome, Test, run};
use crate::specimen::{Common, Specimen};
use plyflow_geometry::vec3::{Vec3, add, scale};
use plyflow_mechanics::history::constant_speed_way;
use plyflow_mechanics::model::Drive;
use plyflow_model::artifact::Style;
use plyflow_sdk::{Host, StepError};
use serde::Deserialize;

/// Which of the tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Case {
    /// A belt around a drum.
    Capstan,
    /// A block on an incline.
    Incline,
    /// A sheet pulled out of a stack.
    Stack,
}

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub(super) struct Parameters {
    #[serde(flatten)]
    pub(super) common: Common,
    pub(super) case: Case,
    /// Coefficient of friction.
    pub(super) coefficient: f64,
    /// Of the drum (m).
    pub(super) radius: f64,
    /// Of the belt around the drum (rad).
    pub(super) arc: f64,
    /// With which the belt is held, per width (N/m).
    pub(super) tension: f64,
    /// Of the plane (rad).
    pub(super) slope: f64,
    /// On the stack (Pa).
    pub(super) pressure: f64,
}

/// What a test has measured, beside what it should be.
pub(super) struct Finding {
    /// Name of the result; with `_law` behind it that of the closed form.
    pub(super) result: &'static str,
    /// What it is, for the axis of its plot.
    pub(super) what: &'static str,
    pub(super) unit: &'static str,
    /// Times of the samples (s), and the values there.
    pub(super) time: Vec<f64>,
    pub(super) value: Vec<f64>,
    /// The measured value, and that of the closed form.
    pub(super) got: f64,
    pub(super) law: f64,
    /// How far it slid (m).
    pub(super) slid: f64,
}

/// Acceleration by weight (m/s2).
pub(super) const GRAVITY: f64 = 9.81;

/// A pull begins (s) when loads have risen, takes this time (s) at constant speed but for its first and last tenth, and goes this way (m).
pub(super) const BEGIN: f64 = 0.02;
pub(super) const PULL_TIME: f64 = 0.1;
pub(super) const WAY: f64 = 0.006;
/// The last part of the pull at constant speed, in which everything slides; the means are taken from here on (shares of its time).
pub(super) const MEASURED: [f64; 2] = [0.6, 0.9];

/// Nodes that stay where they are, followed by nodes that are pulled along a direction.
pub(super) struct Pull {
    pub(super) start: Vec<Vec3>,
    pub(super) still: usize,
    pub(super) direction: Vec3,
}

impl Drive for Pull {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        if k < self.still {
            return self.start[k];
        }
        let way = constant_speed_way((t - BEGIN).max(0.0), WAY, PULL_TIME, 0.1 * PULL_TIME);
        add(self.start[k], scale(self.direction, way))
    }
}

/// A mean over the steps between two samples, and one over the measured part of the pull.
#[derive(Debug, Clone, Default)]
pub(super) struct Means {
    pub(super) since: [f64; 2],
    pub(super) measured: [f64; 2],
    pub(super) time: Vec<f64>,
    pub(super) value: Vec<f64>,
}

impl Means {
    /// Counts the value of a step that ended at `t` (s).
    pub(super) fn count(&mut self, t: f64, value: f64) {
        self.since = [self.since[0] + value, self.since[1] + 1.0];
        if t > BEGIN + MEASURED[0] * PULL_TIME {
            self.measured = [self.measured[0] + value, self.measured[1] + 1.0];
        }
    }

    pub(super) fn sample(&mut self, t: f64) {
        let [sum, n] = std::mem::take(&mut self.since);
        // The first sample's sum holds a single step from rest.
        if n > 1.0 {
            self.time.push(t);
            self.value.push(sum / n);
        }
    }

    pub(super) fn mean(&self) -> f64 {
        self.measured[0] / self.measured[1]
    }
}

/// A test that can say what it found.
pub(super) trait Finds: Test {
    fn finding(self) -> Finding;
}

/// Runs a test and writes what it found.
pub(super) fn carry_out(
    host: &Host,
    p: &Parameters,
    mut specimen: Specimen,
    mut test: impl Finds,
) -> Result<(), StepError> {
    let outcome = run(host, &p.common, &mut specimen, &mut test)?;
    write(host, p, &specimen, &outcome, &test.finding())
}

fn write(
    host: &Host,
    p: &Parameters,
    specimen: &Specimen,
    outcome: &Outcome,
    found: &Finding,
) -> Result<(), StepError> {
    let mut out = Output::new(host);
    let time = out.curve("run/time", "s", &found.time)?;
    let value = out.curve("run/value", found.unit, &found.value)?;
    let ends = [found.time[0], found.time[found.time.len() - 1]];
    let across = out.curve("law/time", "s", &ends)?;
    let law = out.curve("law/value", found.unit, &[found.law; 2])?;
    out.plot(
        "friction",
        &format!("{} over time", found.what),
        ("time", "s"),
        (found.what, found.unit),
    )
    .series("this run", &time, &value, Style::Line)
    .series("closed form", &across, &law, Style::Dashed)
    .done();
    host.result(found.result, found.got, found.unit)?;
    host.result(&format!("{}_law", found.result), found.law, found.unit)?;
    host.result("slid", found.slid, "m")?;
    // A block that stays has no acceleration to compare with: its way is the measure.
    if found.law != 0.0 {
        host.result("friction_error", (found.got / found.law - 1.0).abs(), "1")?;
    }
    out.finish(&p.common, specimen, outcome)
}
