//! What a driver needs of whatever computes the motion of a model: the door for a second back-end beside the CPU's [`Model`].
//!
//! A driver builds a model, hands its [`Load`] over with every stretch of steps, and looks between stretches. It never touches what lives
//! only within a step, so that a back-end may keep its state where it likes, such as on a device, and bring back what is asked for.

use crate::MechanicsError;
use crate::archive::{Archive, ArchiveError};
use crate::contact::RigidMotion;
use crate::energy::Ledger;
use crate::model::{Clock, Model, Pressures};
use crate::vec3::Vec3;
use std::ops::Range;

/// What a load reads and sets before a step.
pub trait Loaded {
    /// The step (s).
    fn step_size(&self) -> f64;

    /// Sets the pressures (Pa).
    fn set_pressures(&mut self, pressures: Pressures);

    /// Sets the acceleration of free fall (m/s2), global axes.
    fn set_body_acceleration(&mut self, acceleration: Vec3);

    /// Sets what the nodal loads are multiplied by.
    fn set_load_factor(&mut self, factor: f64);

    /// Volume (m3) between the sheets that the cavity presses from below and the plane z = 0.
    fn volume_below(&mut self) -> f64;

    /// Force (N) of the sheets on the rigid surface of a contact in the last step.
    fn rigid_force(&self, contact: usize) -> Vec3;

    /// How the rigid surface of a contact moves.
    fn rigid_motion(&self, contact: usize) -> RigidMotion;

    /// Moves the rigid surface of a contact.
    fn set_rigid_motion(&mut self, contact: usize, motion: RigidMotion);

    /// Position (m) of a node.
    fn position(&self, node: u32) -> Vec3;

    /// Sets the nodal load (N, global axes) of a node, in the place of what it was.
    fn set_load(&mut self, node: u32, force: Vec3);
}

/// What acts on a model from outside.
pub trait Load {
    /// Sets what acts in the step that begins at `time` (s).
    fn apply(&mut self, on: &mut dyn Loaded, time: f64);
}

/// Equal steps, counted: step `k` begins at `start + k dt`. Times come from the count, not from a sum, so that frames fall on the same
/// instants in every run.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Begin of step 0 (s).
    pub start: f64,
    /// Which steps.
    pub steps: Range<u64>,
}

/// Computes the motion of a model.
pub trait Backend: Loaded {
    /// Time (s) of the positions.
    fn time(&self) -> f64;

    /// Steps done.
    fn cycle(&self) -> u64;

    /// Largest stable step of the elements at present (s).
    ///
    /// # Errors
    /// When a component fails.
    fn critical_step(&self) -> Result<f64, MechanicsError>;

    /// Sets the step (s).
    fn set_step(&mut self, dt: f64);

    /// Takes the model through a stretch of steps under a load. With `fields`, the elements' fields at the begin of its last step are kept.
    ///
    /// # Errors
    /// When the motion becomes unstable, an element is none any more, or a component fails. The steps before have been done.
    fn run(
        &mut self,
        stretch: &Stretch,
        fields: bool,
        load: &mut dyn Load,
    ) -> Result<(), MechanicsError>;

    /// `[n]` positions (m).
    fn positions(&self) -> &[Vec3];

    /// `[n]` velocities at the half step (m/s).
    fn velocities(&self) -> &[Vec3];

    /// Where the work of the load has gone (J).
    fn energies(&self) -> Ledger;

    /// Writes the state between two steps, or takes it up.
    ///
    /// # Errors
    /// When the bytes cannot be written or are not those of such a model.
    fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError>;
}

impl Loaded for Model {
    fn step_size(&self) -> f64 {
        self.dt()
    }

    fn set_pressures(&mut self, pressures: Pressures) {
        Model::set_pressures(self, pressures);
    }

    fn set_body_acceleration(&mut self, acceleration: Vec3) {
        Model::set_body_acceleration(self, acceleration);
    }

    fn set_load_factor(&mut self, factor: f64) {
        Model::set_load_factor(self, factor);
    }

    fn volume_below(&mut self) -> f64 {
        Model::volume_below(self)
    }

    fn rigid_force(&self, contact: usize) -> Vec3 {
        self.rigid_contacts()[contact].resultant()
    }

    fn rigid_motion(&self, contact: usize) -> RigidMotion {
        self.rigid_contacts()[contact].motion
    }

    fn set_rigid_motion(&mut self, contact: usize, motion: RigidMotion) {
        self.rigid_contacts_mut()[contact].motion = motion;
    }

    fn position(&self, node: u32) -> Vec3 {
        self.x()[node as usize]
    }

    fn set_load(&mut self, node: u32, force: Vec3) {
        Model::set_load(self, node, force);
    }
}

impl Backend for Model {
    fn time(&self) -> f64 {
        Model::time(self)
    }

    fn cycle(&self) -> u64 {
        Model::cycle(self)
    }

    fn critical_step(&self) -> Result<f64, MechanicsError> {
        Model::critical_step(self)
    }

    fn set_step(&mut self, dt: f64) {
        Model::set_step(self, dt);
    }

    fn run(
        &mut self,
        stretch: &Stretch,
        fields: bool,
        load: &mut dyn Load,
    ) -> Result<(), MechanicsError> {
        for k in stretch.steps.clone() {
            let at = stretch.start + self.dt() * k as f64;
            let clock = Clock::of_step(Model::cycle(self));
            load.apply(self, at);
            self.count_loads(clock);
            self.step_from(at, fields && k + 1 == stretch.steps.end)?;
        }
        Ok(())
    }

    fn positions(&self) -> &[Vec3] {
        self.x()
    }

    fn velocities(&self) -> &[Vec3] {
        self.v()
    }

    fn energies(&self) -> Ledger {
        Model::energies(self)
    }

    fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        Model::archive(self, a)
    }
}
