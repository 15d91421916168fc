//! A block (a sheet under its weight) on a plane that is tilted at once.

use super::sliding::{Finding, Finds, GRAVITY, Parameters, carry_out};
use crate::run::Test;
use crate::specimen::Specimen;
use plyflow_fixed::FixedBits;
use plyflow_mechanics::contact::{ContactSettings, Plane, RigidContact, RigidItem};
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::sheet::Pressed;
use plyflow_sdk::{Host, StepError};
use std::sync::Arc;

/// Side of the block (m).
const SIDE: f64 = 0.02;
/// Time in which it lies down (s), and time on the incline (s).
const LIE_DOWN: f64 = 0.02;
const SLIDE: f64 = 0.05;

struct Block {
    slope: f64,
    law: f64,
    /// Mean place along the plane (m) when it is tilted and now; time (s) and speed (m/s) when half of its time there is over, and speed now.
    start: Option<f64>,
    place: f64,
    half: Option<[f64; 2]>,
    speed: f64,
    time: Vec<f64>,
    speeds: Vec<f64>,
    /// Time of the last step's end (s).
    now: f64,
}

impl Test for Block {
    fn duration(&self) -> f64 {
        LIE_DOWN + SLIDE
    }

    fn apply(&mut self, specimen: &mut Specimen, t: f64) {
        // First it lies down on the level plane; then the plane tilts at once.
        let tilt = if t < LIE_DOWN { 0.0 } else { self.slope };
        let weight = GRAVITY * smooth_step(t, 0.0, 0.5 * LIE_DOWN);
        let (sin, cos) = tilt.fixed_sin_cos();
        let pull = [weight * sin, 0.0, -weight * cos];
        specimen.model.set_body_acceleration(pull);
    }

    fn stepped(&mut self, specimen: &Specimen) {
        let model = &specimen.model;
        let n = model.x().len() as f64;
        self.place = model.x().iter().map(|x| x[0]).sum::<f64>() / n;
        self.speed = model.v().iter().map(|v| v[0]).sum::<f64>() / n;
        self.now = model.time();
        if self.now >= LIE_DOWN && self.start.is_none() {
            self.start = Some(self.place);
        }
        if self.now >= LIE_DOWN + 0.5 * SLIDE && self.half.is_none() {
            self.half = Some([self.now, self.speed]);
        }
    }

    fn sample(&mut self, _specimen: &Specimen, t: f64) {
        self.time.push(t);
        self.speeds.push(self.speed);
    }

    fn phase(&self) -> &'static str {
        "on the incline"
    }
}

impl Finds for Block {
    fn finding(self) -> Finding {
        let [since, half] = self.half.unwrap_or([LIE_DOWN, 0.0]);
        Finding {
            result: "acceleration",
            what: "acceleration",
            unit: "m/s2",
            got: (self.speed - half) / (self.now - since),
            law: self.law,
            slid: self.place - self.start.unwrap_or(0.0),
            value: accelerations(&self.time, &self.speeds),
            time: self.time,
        }
    }
}

/// Accelerations (m/s2) at the samples, each since the one before; 0 at the first.
fn accelerations(time: &[f64], speed: &[f64]) -> Vec<f64> {
    let since = |i: usize| (speed[i] - speed[i - 1]) / (time[i] - time[i - 1]);
    let rest = (1..time.len()).map(since);
    std::iter::once(0.0).chain(rest).collect()
}

pub(super) fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    p.common.allow(SIDE * SIDE)?;
    let axis = crate::strip::rows(SIDE, p.common.element_size);
    let mesh = QuadMesh::grid(&axis, &axis);
    let mut specimen = Specimen::new(host, &p.common, mesh, [1.0, 0.0, 0.0], Pressed::No)?;
    let contact = ContactSettings::default();
    let items = (0..specimen.mesh.points.len() as u32).map(RigidItem::new);
    let plane = Arc::new(Plane { height: 0.0 });
    let on = RigidContact::new(
        "incline".into(),
        plane,
        0.0,
        p.coefficient,
        &contact,
        items.collect(),
    );
    specimen.model.add_rigid_contact(on);
    specimen.model.set_contact_stiffness(&contact);
    let (sin, cos) = p.slope.fixed_sin_cos();
    let block = Block {
        slope: p.slope,
        law: GRAVITY * (sin - p.coefficient * cos).max(0.0),
        start: None,
        place: 0.0,
        half: None,
        speed: 0.0,
        time: Vec::new(),
        speeds: Vec::new(),
        now: 0.0,
    };
    carry_out(host, p, specimen, block)
}
