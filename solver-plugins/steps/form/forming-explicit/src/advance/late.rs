//! A local run that begins late: at a state that the coarse run had on its way. Until something stands off or folds a zone of
//! fine shells does what coarse membranes do, and need not be computed again.

use crate::course::Observer;
use crate::error::Result;
use crate::forming::Forming;
use crate::request::Control;
use plyflow_geometry::vec3::{Vec3, add, norm, scale, sub};
use plyflow_mechanics::model::Model;

/// Steps in which elements are led from one state of the path to the next.
const STEPS: u32 = 5;
/// Steps in which nothing swings, at least, and at most.
const CREEPING: [f64; 2] = [1000.0, 10000.0];
/// The same in the steps that the contacts' multipliers take to follow to within 1 / e.
const FOLLOWING: f64 = 3.0;
/// Most steps (with all loads, at the time of the start) to find the balance of fine shells there.
const SETTLING: u32 = 3000;
/// Kinetic over internal energy at a peak below which they have found it.
const SETTLED: f64 = 1e-5;
/// Way (m) that fine plies may go by themselves at a late start: half of what counts as a wrinkle.
const LARGEST_SHIFT: f64 = 5e-4;

/// What to tell of a start at which fine plies were already elsewhere.
pub fn too_late(shift: f64) -> Option<String> {
    (shift > LARGEST_SHIFT).then(|| {
        format!(
            "at the start fine plies went {:.2} mm by themselves from where the coarse run had them (more than {:.1} mm): they had already \
             folded or bridged there. Take an earlier `start_time`, or a smaller `start_bend`, of the boundary",
            1e3 * shift,
            1e3 * LARGEST_SHIFT
        )
    })
}

/// Brings a run that begins late to its start. Gives how far (m) nodes of plies that are not placed have gone there by themselves, 99.9 %
/// quantile: what fine shells do that coarse membranes did not until then. `None` for a run that begins with the process.
///
/// # Errors
/// When a component failed, or the start is unstable; or the observer stops it.
pub fn begin(
    forming: &mut Forming,
    control: &Control,
    observer: &mut dyn Observer,
) -> Result<Option<f64>> {
    let Some(start) = forming.start.take() else {
        return Ok(None);
    };
    let interval = start.time / (start.path.len() as f64 * f64::from(STEPS));
    for (s, state) in start.path.iter().enumerate() {
        let from = forming.model.x().to_vec();
        for k in 1..=STEPS {
            let share = f64::from(k) / f64::from(STEPS);
            let to = |(a, b): (&Vec3, &Vec3)| add(*a, scale(sub(*b, *a), share));
            let x = from.iter().zip(state).map(to).collect();
            let arrives = s + 1 == start.path.len() && k == STEPS;
            let normals = if arrives { &start.normals[..] } else { &[] };
            forming.model.lead(x, interval, normals)?;
        }
    }
    // Straight coarse edges have led nodes into the rigid parts.
    forming.model.clear_rigid();
    let placed = forming.model.x().to_vec();
    // What the coarse run's places have wrong by now shall not pull to the end: held nodes are held from where they are in balance with
    // its forces.
    forming.model.loosen();
    settle(forming, control, observer)?;
    forming.model.anchor();
    // Nodes that were driven meanwhile have their velocity from the next step on.
    forming.model.v_mut().copy_from_slice(&start.velocity);
    Ok(Some(shift(forming, &placed)))
}

/// 99.9 % quantile of how far (m) nodes of plies are from where they were `placed`.
fn shift(forming: &Forming, placed: &[Vec3]) -> f64 {
    let nodes = (forming.plies()).flat_map(|(body, _)| body.sheet.nodes(&forming.model));
    let way = |n: usize| norm(sub(forming.model.x()[n], placed[n]));
    let mut ways: Vec<f64> = nodes.map(|n| way(*n as usize)).collect();
    ways.sort_by(f64::total_cmp);
    let at = (0.999 * ways.len() as f64) as usize;
    ways.get(at.min(ways.len().saturating_sub(1)))
        .copied()
        .unwrap_or(0.0)
}

/// Steps at the time of the start, the nodes of the cut at rest. Contacts that get their whole load at once must not swing through
/// each other: first nothing swings at all, for as long as multipliers take to follow; then all nodes are stopped whenever the
/// kinetic energy has passed a peak.
fn settle(forming: &mut Forming, control: &Control, observer: &mut dyn Observer) -> Result<()> {
    let model = &mut forming.model;
    let damping = model.damping();
    model.set_step(
        control
            .target_step
            .min(control.safety * model.critical_step()?),
    );
    model.set_damping(1.0 / model.dt());
    model.halt();
    // The coarse run's sheets, interpolated, may reach into each other where they fold.
    let clear = |model: &mut Model, on: bool| {
        let contacts = model.sheet_contacts_mut().iter_mut();
        contacts.for_each(|c| c.clearing = on);
    };
    clear(model, true);
    let augmentation = forming.model.contact_augmentation();
    let creeping = if augmentation > 0.0 {
        (FOLLOWING / augmentation).clamp(CREEPING[0], CREEPING[1])
    } else {
        CREEPING[0]
    };
    for _ in 0..creeping.round() as u32 {
        stand(forming)?;
        observer.settling(forming)?;
    }
    clear(&mut forming.model, false);
    forming.model.set_damping(damping);
    forming.model.halt();
    let mut before = 0.0;
    for _ in 0..SETTLING {
        stand(forming)?;
        observer.settling(forming)?;
        let model = &mut forming.model;
        let kinetic = model.kinetic();
        if kinetic >= before {
            before = kinetic;
            continue;
        }
        model.halt();
        if before < SETTLED * model.energies().internal() {
            break;
        }
        before = 0.0;
    }
    Ok(())
}

/// A step with the loads of the start, to the time of the start: before it nothing moves, so neither do held nodes go with the cut.
fn stand(forming: &mut Forming) -> Result<()> {
    let start = forming.load.start();
    forming.load_at(start);
    let before = start - forming.model.dt();
    Ok(forming.model.step_from(before, false)?)
}
