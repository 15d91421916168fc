//! A belt around a drum.

use super::sliding::{
    BEGIN, Finding, Finds, MEASURED, Means, PULL_TIME, Parameters, Pull, carry_out,
};
use crate::run::Test;
use crate::specimen::Specimen;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::{Vec3, add, dot, norm, scale, sub};
use plyflow_mechanics::contact::{ContactSettings, RigidContact, RigidItem, RigidSurface};
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::NodalLoad;
use plyflow_mechanics::sheet::Pressed;
use plyflow_sdk::{Host, StepError};
use std::sync::Arc;

/// Straight part of the belt at each end (m): the belt slides over the drum by less.
const TAIL: f64 = 0.02;
/// Half the width of the belt (m).
const HALF_WIDTH: f64 = 0.005;

/// A cylinder about the y axis.
struct Drum {
    radius: f64,
}

impl RigidSurface for Drum {
    fn distance(&self, p: Vec3) -> (f64, Vec3) {
        let r = p[0].fixed_hypot(p[2]);
        (r - self.radius, [p[0] / r, 0.0, p[2] / r])
    }
}

/// Place and direction of the belt at the length `s` (m) along it: a tail, the arc symmetric about the drum's top, a tail.
fn place(p: &Parameters, s: f64) -> (Vec3, Vec3) {
    let turned = ((s - TAIL) / p.radius).clamp(0.0, p.arc) - 0.5 * p.arc;
    let (sin, cos) = turned.fixed_sin_cos();
    let tangent = [cos, 0.0, -sin];
    let foot = [p.radius * sin, 0.0, p.radius * cos];
    let beyond = (s - TAIL).min(0.0) + (s - TAIL - p.radius * p.arc).max(0.0);
    (add(foot, scale(tangent, beyond)), tangent)
}

struct Belt {
    /// Force with which it is held (N).
    held: f64,
    direction: Vec3,
    /// A pulled node: where it began, and how far it went (m).
    end: (usize, Vec3),
    slid: f64,
    law: f64,
    means: Means,
}

impl Test for Belt {
    fn duration(&self) -> f64 {
        BEGIN + MEASURED[1] * PULL_TIME
    }

    fn apply(&mut self, specimen: &mut Specimen, t: f64) {
        let risen = smooth_step(t, 0.0, BEGIN);
        specimen.model.set_load_factor(risen);
    }

    fn stepped(&mut self, specimen: &Specimen) {
        let model = &specimen.model;
        let forces = model.reactions().iter().map(|r| dot(*r, self.direction));
        self.means
            .count(model.time(), forces.sum::<f64>() / self.held);
        self.slid = norm(sub(model.x()[self.end.0], self.end.1));
    }

    fn sample(&mut self, _specimen: &Specimen, t: f64) {
        self.means.sample(t);
    }

    fn phase(&self) -> &'static str {
        "sliding"
    }
}

impl Finds for Belt {
    fn finding(self) -> Finding {
        Finding {
            result: "force_ratio",
            what: "pulling over holding force",
            unit: "1",
            got: self.means.mean(),
            law: self.law,
            slid: self.slid,
            time: self.means.time,
            value: self.means.value,
        }
    }
}

pub(super) fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    let length = p.radius * p.arc + 2.0 * TAIL;
    p.common.allow(2.0 * HALF_WIDTH * length)?;
    let size = p.common.element_size;
    let along = even_axis(0.0, length, size);
    let across = crate::strip::rows(2.0 * HALF_WIDTH, size);
    let flat = QuadMesh::grid(&along, &across);
    let laid = |q: &Vec3| add(place(p, q[0]).0, [0.0, q[1], 0.0]);
    let mesh = QuadMesh {
        points: flat.points.iter().map(laid).collect(),
        cells: flat.cells.clone(),
    };
    // Family 1 lies across the belt: that direction is in the plane of every element.
    let mut specimen = Specimen::new(host, &p.common, mesh, [0.0, 1.0, 0.0], Pressed::No)?;
    let points = &specimen.mesh.points;
    let column = |i: usize| -> Vec<u32> {
        let node = |j| (j * along.len() + i) as u32;
        (0..across.len()).map(node).collect()
    };
    let (held, pulled) = (column(0), column(along.len() - 1));
    let back = scale(place(p, 0.0).1, -1.0);
    let force = p.tension * 2.0 * HALF_WIDTH;
    let share = force / (across.len() - 1) as f64;
    let loads = held.iter().enumerate().map(|(j, n)| {
        let edge = j == 0 || j + 1 == across.len();
        NodalLoad {
            node: *n,
            force: scale(back, if edge { 0.5 * share } else { share }),
            moment: [0.0; 3],
        }
    });
    specimen.model.set_loads(loads.collect());
    let direction = place(p, length).1;
    let end = (
        pulled[across.len() / 2] as usize,
        points[pulled[across.len() / 2] as usize],
    );
    let drive = Pull {
        start: pulled.iter().map(|n| points[*n as usize]).collect(),
        still: 0,
        direction,
    };
    let contact = ContactSettings::default();
    let drum = Arc::new(Drum { radius: p.radius });
    let items = (0..points.len() as u32).map(RigidItem::new).collect();
    let on = RigidContact::new("drum".into(), drum, 0.0, p.coefficient, &contact, items);
    specimen.model.set_driven(pulled, Box::new(drive));
    specimen.model.add_rigid_contact(on);
    specimen.model.set_contact_stiffness(&contact);
    let belt = Belt {
        held: force,
        direction,
        end,
        slid: 0.0,
        law: (p.coefficient * p.arc).fixed_exp(),
        means: Means::default(),
    };
    carry_out(host, p, specimen, belt)
}
