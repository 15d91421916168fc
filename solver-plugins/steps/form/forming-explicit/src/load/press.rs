//! What moves in a press: a rising punch, and a blank holder that a force presses towards the die.

use crate::load::guide::Guide;
use plyflow_mechanics::archive::{Archive, ArchiveError};
use plyflow_mechanics::backend::Loaded;
use plyflow_mechanics::contact::RigidMotion;
use plyflow_mechanics::history::{constant_speed_way, smooth_step};
use plyflow_mechanics::model::Model;

/// Rate (1/s) at which the motion of a holder that a force presses dies out.
const HOLDER_DAMPING: f64 = 300.0;
/// Share of the stroke's duration over which the holder's force grows.
const HOLD_RISE: f64 = 0.05;

/// The punch's stroke in time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stroke {
    /// Its length (m).
    pub way: f64,
    /// Its duration (s).
    pub forming: f64,
    /// Time in which it gathers speed, and in which it loses it (s).
    pub ramp: f64,
    /// What follows (s).
    pub settling: f64,
}

impl Stroke {
    /// Makes all of it take `factor` times as long.
    pub fn slow(&mut self, factor: f64) {
        self.forming *= factor;
        self.ramp *= factor;
        self.settling *= factor;
    }

    /// Way still to go (m) at time t (s).
    pub fn left(&self, t: f64) -> f64 {
        self.way - constant_speed_way(t, self.way, self.forming, self.ramp)
    }
}

/// A blank holder that a force presses towards the die: a mass that moves along z.
#[derive(Debug, Clone, PartialEq)]
pub struct HeldByForce {
    /// What presses it (N).
    pub force: f64,
    /// (kg).
    pub mass: f64,
    /// Height at which it meets the die (m): nothing else stops it once the plies have left it.
    pub most: f64,
    /// In a zone.
    pub guide: Option<Guide>,
    /// Its way towards the die (m).
    pub height: f64,
    /// (m/s).
    pub velocity: f64,
}

impl HeldByForce {
    /// What presses it (N) at time `t` (s), of its whole force there.
    fn pressing(&self, whole: f64, t: f64) -> f64 {
        match &self.guide {
            None => whole,
            Some(guide) => guide.force(whole, guide.way.at(t) - self.height),
        }
    }
}

/// Mean speed (m/s) of what was at `before` (m) a step of `dt` (s) ago: none of what has not moved yet.
fn speed(at: f64, before: f64, dt: f64) -> f64 {
    if dt > 0.0 { (at - before) / dt } else { 0.0 }
}

/// What moves in a press.
#[derive(Debug, Clone, PartialEq)]
pub struct PressLoad {
    /// When the run begins (s).
    pub begin: f64,
    /// The punch.
    pub stroke: Stroke,
    /// Numbers of its contacts in [`Model::rigid_contacts`].
    pub punch: Vec<usize>,
    /// Those of the holder.
    pub holder: Vec<usize>,
    /// The holder, when a force presses it.
    pub held: Option<HeldByForce>,
}

impl PressLoad {
    /// Moves punch and holder to where they are at time `t` (s).
    pub fn apply(&mut self, on: &mut dyn Loaded, t: f64) {
        let dt = on.step_size();
        let at = |t: f64| -self.stroke.left(t);
        let height = at(t);
        let before = self
            .punch
            .first()
            .map_or(height, |c| on.rigid_motion(*c).shift[2]);
        let moved = |height: f64, before: f64| RigidMotion {
            shift: [0.0, 0.0, height],
            velocity: [0.0, 0.0, speed(height, before, dt)],
        };
        for c in &self.punch {
            on.set_rigid_motion(*c, moved(height, before));
        }
        let Some(held) = &mut self.held else { return };
        // The sheets' resistance of the last step: a holder many times their mass barely moves in one.
        let resistance: f64 = (self.holder.iter()).map(|c| on.rigid_force(*c)[2]).sum();
        let whole = held.force * smooth_step(t, 0.0, HOLD_RISE * self.stroke.forming);
        let force = held.pressing(whole, t);
        let drag = HOLDER_DAMPING * held.mass * held.velocity;
        held.velocity += (force - resistance - drag) / held.mass * dt;
        let before = held.height;
        held.height += held.velocity * dt;
        if held.height >= held.most {
            (held.height, held.velocity) = (held.most, 0.0);
        }
        for c in &self.holder {
            on.set_rigid_motion(*c, moved(held.height, before));
        }
    }

    /// Where the holder is that a force presses.
    pub fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        if let Some(held) = &mut self.held {
            a.value(&mut held.height)?;
            a.value(&mut held.velocity)?;
        }
        Ok(())
    }

    /// Force of the punch on the plies, upwards (N).
    pub fn punch_force(&self, model: &Model) -> f64 {
        let lift = |c: &usize| model.rigid_contacts()[*c].resultant()[2];
        self.punch.iter().map(lift).sum()
    }

    /// Whether a holder that a force presses has met the die: the plies have left it.
    pub fn holder_is_bare(&self) -> bool {
        self.held.as_ref().is_some_and(|h| h.height >= h.most)
    }

    /// How far the holder has moved towards the die (m).
    pub fn holder_travel(&self) -> f64 {
        self.held.as_ref().map_or(0.0, |h| h.height)
    }
}
