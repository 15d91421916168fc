//! Friction against its closed forms: a belt around a drum, a block on an incline, a sheet that is pulled out of a stack.
//!
//! - [`belt`]: a belt that slides over a drum pulls `exp(mu a)` times as hard as it is held, over an arc of `a` (Euler and Eytelwein).
//! - [`block`]: a block on a plane that is inclined by `a` stays where `tan a < mu`, and slides with the acceleration
//!   `g (sin a - mu cos a)` otherwise (Coulomb).
//! - [`stack`]: a sheet between two under the pressure `p` on the area `A` is held by `2 mu p A`, half of it by each face.
//!
//! They are computed with the contacts that forming uses: nodes on a rigid surface, and nodes on the elements of another sheet.

mod belt;
mod block;
mod stack;

use crate::output::Output;
use crate::run::{Outcome, run, with_threads};
use crate::specimen::{Common, Specimen};
use plyflow_geometry::vec3::{Vec3, add, scale};
use plyflow_mechanics::history::constant_speed_way;
use plyflow_mechanics::model::Drive;
use plyflow_model::artifact::Style;
use plyflow_sdk::{Host, Step, StepError};
use serde::Deserialize;

/// Which of the tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Case {
    /// A belt around a drum.
    Capstan,
    /// A block on an incline.
    Incline,
    /// A sheet pulled out of a stack.
    Stack,
}

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    case: Case,
    /// Coefficient of friction.
    coefficient: f64,
    /// Of the drum (m).
    radius: f64,
    /// Of the belt around the drum (rad).
    arc: f64,
    /// With which the belt is held, per width (N/m).
    tension: f64,
    /// Of the plane (rad).
    slope: f64,
    /// On the stack (Pa).
    pressure: f64,
}

/// What a test has measured, beside what it should be.
struct Finding {
    /// Name of the result; with `_law` behind it that of the closed form.
    result: &'static str,
    /// What it is, for the axis of its plot.
    what: &'static str,
    unit: &'static str,
    /// Times of the samples (s), and the values there.
    time: Vec<f64>,
    value: Vec<f64>,
    /// The measured value, and that of the closed form.
    got: f64,
    law: f64,
    /// How far it slid (m).
    slid: f64,
}

/// The step plugin `coupon-friction`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        with_threads(host, || test(host, p))
    }
}

/// Acceleration by weight (m/s2).
const GRAVITY: f64 = 9.81;

/// A pull begins (s) when loads have risen, takes this time (s) at constant speed but for its first and last tenth, and goes this way (m).
const BEGIN: f64 = 0.02;
const PULL_TIME: f64 = 0.1;
const WAY: f64 = 0.006;
/// The last part of the pull at constant speed, in which everything slides; the means are taken from here on (shares of its time).
const MEASURED: [f64; 2] = [0.6, 0.9];

/// Nodes that stay where they are, followed by nodes that are pulled along a direction.
struct Pull {
    start: Vec<Vec3>,
    still: usize,
    direction: Vec3,
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
struct Means {
    since: [f64; 2],
    measured: [f64; 2],
    time: Vec<f64>,
    value: Vec<f64>,
}

impl Means {
    /// Counts the value of a step that ended at `t` (s).
    fn count(&mut self, t: f64, value: f64) {
        self.since = [self.since[0] + value, self.since[1] + 1.0];
        if t > BEGIN + MEASURED[0] * PULL_TIME {
            self.measured = [self.measured[0] + value, self.measured[1] + 1.0];
        }
    }

    fn sample(&mut self, t: f64) {
        let [sum, n] = std::mem::take(&mut self.since);
        // The first sample's sum holds a single step from rest.
        if n > 1.0 {
            self.time.push(t);
            self.value.push(sum / n);
        }
    }

    fn mean(&self) -> f64 {
        self.measured[0] / self.measured[1]
    }
}

fn test(host: &Host, mut p: Parameters) -> Result<(), StepError> {
    if p.case == Case::Incline {
        // It is a motion, and meant to be one: there is no kinetic energy that would be too large.
        p.common.kinetic_bound = f64::INFINITY;
    }
    match p.case {
        Case::Capstan => belt::test(host, &p),
        Case::Incline => block::test(host, &p),
        Case::Stack => stack::test(host, &p),
    }
}

/// A test that can say what it found.
trait Finds: crate::run::Test {
    fn finding(self) -> Finding;
}

/// Runs a test and writes what it found.
fn carry_out(
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
