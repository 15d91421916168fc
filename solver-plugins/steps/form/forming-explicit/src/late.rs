//! A local run that begins late: at a state that the coarse run had on its way. Until something stands off or folds a zone of
//! fine shells does what coarse membranes do, and need not be computed again.

use crate::assembly::StackSheet;
use crate::local::LocalSheet;
use crate::run::{Forming, Observer};
use plyflow_mechanics::model::{Clock, Model};
use plyflow_mechanics::vec3::{V, add, norm, scale, sub};
use plyflow_model::scene::SheetKind;
use plyflow_sdk::StepError;

/// Where a sheet is when its zone begins late, and how it came there.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// `[states][n]` positions (m) on the way from the undeformed state, in time; the last is the one to begin at.
    pub path: Vec<Vec<V>>,
    /// `[n]` velocities (m/s) there.
    pub velocity: Vec<V>,
}

/// The same of a whole model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Beginning {
    /// `[states][n]`, as [`Start::path`].
    path: Vec<Vec<V>>,
    /// `[n]`, as [`Start::velocity`].
    velocity: Vec<V>,
    /// Nodes of the cut, and the normals (of any length) that the coarse surface has there: the zone's own elements are only on one
    /// side of them.
    normals: Vec<(u32, V)>,
    /// When it begins (s).
    time: f64,
}

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
pub(crate) fn too_late(shift: f64) -> Option<String> {
    (shift > LARGEST_SHIFT).then(|| {
        format!(
            "at the start fine plies went {:.2} mm by themselves from where the coarse run had them (more than {:.1} mm): they had already \
             folded or bridged there. Take an earlier `start_time`, or a smaller `start_bend`, of the boundary",
            1e3 * shift,
            1e3 * LARGEST_SHIFT
        )
    })
}

/// The start of a whole zone whose sheets begin at `time` (s): none at 0.
///
/// # Errors
/// A text for the user: sheets that do not tell their start.
pub(crate) fn of_model(
    stack: &[StackSheet],
    sheets: &[LocalSheet],
    time: f64,
) -> Result<Option<Beginning>, String> {
    if time == 0.0 {
        return Ok(None);
    }
    let mut start = Beginning {
        path: Vec::new(),
        velocity: Vec::new(),
        normals: Vec::new(),
        time,
    };
    for sheet in stack {
        let name = &sheet.scene.name;
        let told = |s: &&LocalSheet| &s.name == name && s.start.is_some();
        let found = sheets
            .iter()
            .find(told)
            .and_then(|s| Some((s, s.start.as_ref()?)));
        let (cut, own) = found.ok_or_else(|| {
            format!("the boundary begins at {time} s and does not tell where sheet '{name}' is then; run its step again")
        })?;
        start.path.resize_with(own.path.len(), Vec::new);
        for (all, part) in start.path.iter_mut().zip(&own.path) {
            all.extend_from_slice(part);
        }
        let first = start.velocity.len() as u32;
        let normals = cut.normal.first().into_iter().flatten();
        let of_cut = cut.driven.iter().zip(normals);
        start
            .normals
            .extend(of_cut.map(|(n, normal)| (first + n, *normal)));
        start.velocity.extend_from_slice(&own.velocity);
    }
    let n = start.velocity.len();
    if start.path.is_empty() || start.path.iter().any(|p| p.len() != n) {
        return Err("the sheets of the boundary tell ways of different lengths to where they begin; run its step again".into());
    }
    Ok(Some(start))
}

/// Brings a run that begins late to its start. Gives how far (m) nodes of plies that are not placed have gone there by themselves, 99.9 %
/// quantile: what fine shells do that coarse membranes did not until then. `None` for a run that begins with the process.
///
/// # Errors
/// A text for the user: a component failed, or the start is unstable; or the observer stops it.
pub(crate) fn begin(
    forming: &mut Forming,
    step: f64,
    safety: f64,
    observer: &mut dyn Observer,
) -> Result<Option<f64>, StepError> {
    let Some(start) = forming.start.take() else {
        return Ok(None);
    };
    let text = |e: plyflow_mechanics::MechanicsError| e.to_string();
    let interval = start.time / (start.path.len() as f64 * f64::from(STEPS));
    for (s, state) in start.path.iter().enumerate() {
        let from = forming.model.x().to_vec();
        for k in 1..=STEPS {
            let share = f64::from(k) / f64::from(STEPS);
            let to = |(a, b): (&V, &V)| add(*a, scale(sub(*b, *a), share));
            let x = from.iter().zip(state).map(to).collect();
            let arrives = s + 1 == start.path.len() && k == STEPS;
            let normals = if arrives { &start.normals[..] } else { &[] };
            forming.model.lead(x, interval, normals).map_err(text)?;
        }
    }
    clear_tool(forming);
    let placed = forming.model.x().to_vec();
    // What the coarse run's places have wrong by now shall not pull to the end: held nodes are held from where they are in balance with
    // its forces.
    forming.model.loosen();
    settle(forming, step, safety, observer)?;
    forming.model.anchor();
    // Nodes that were driven meanwhile have their velocity from the next step on.
    forming.model.v_mut().copy_from_slice(&start.velocity);
    Ok(Some(shift(forming, &placed)))
}

/// 99.9 % quantile of how far (m) nodes of plies are from where they were `placed`.
fn shift(forming: &Forming, placed: &[V]) -> f64 {
    let of_plies = (forming.model.sheets().iter().zip(&forming.stack))
        .filter(|(_, sheet)| sheet.scene.kind == SheetKind::Ply)
        .flat_map(|(s, _)| s.nodes.iter().map(|n| *n as usize));
    let mut ways: Vec<f64> = of_plies
        .map(|n| norm(sub(forming.model.x()[n], placed[n])))
        .collect();
    ways.sort_by(f64::total_cmp);
    let at = (0.999 * ways.len() as f64) as usize;
    ways.get(at.min(ways.len().saturating_sub(1)))
        .copied()
        .unwrap_or(0.0)
}

/// Puts nodes that straight coarse edges have led into the rigid parts onto them.
fn clear_tool(forming: &mut Forming) {
    forming.model.clear_rigid();
}

/// Steps at the time of the start, the nodes of the cut at rest. Contacts that get their whole load at once must not swing through
/// each other: first nothing swings at all, for as long as multipliers take to follow; then all nodes are stopped whenever the
/// kinetic energy has passed a peak.
fn settle(
    forming: &mut Forming,
    step: f64,
    safety: f64,
    observer: &mut dyn Observer,
) -> Result<(), StepError> {
    let model = &mut forming.model;
    let damping = model.damping();
    model.set_step(step.min(safety * model.critical_step().map_err(|e| e.to_string())?));
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
fn stand(forming: &mut Forming) -> Result<(), String> {
    let start = forming.load.start();
    let clock = Clock::of_step(forming.model.cycle());
    forming.load.apply(&mut forming.model, start);
    forming.model.count_loads(clock);
    let before = start - forming.model.dt();
    forming
        .model
        .step_from(before, false)
        .map_err(|e| e.to_string())
}
