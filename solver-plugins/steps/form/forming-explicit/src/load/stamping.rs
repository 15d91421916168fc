//! What moves and pulls in a stamping: rigid parts that follow a table or are pressed, grippers on plies.
//!
//! The way of a part counts away from the sheets, from where the part is drawn. A part that is pressed is a mass on a straight line: its force
//! and its spring press it towards the sheets up to its stop, and the plies push it back.

use crate::load::guide::Guide;
use crate::stack::RigidName;
use plyflow_geometry::vec3::{Vec3, dot, scale, sub};
use plyflow_mechanics::archive::{Archive, ArchiveError};
use plyflow_mechanics::backend::Loaded;
use plyflow_mechanics::contact::RigidMotion;
use plyflow_mechanics::history::{MonotoneCubic, smooth_step};
use plyflow_mechanics::model::Model;

/// Rate (1/s) at which the motion of a part that is pressed dies out, as that of the plies' own damping is by default.
const PRESSED_DAMPING: f64 = 50.0;
/// Share of the forming time over which a force that is a single value grows.
const RISE: f64 = 0.05;

/// A force over time.
#[derive(Debug, Clone, PartialEq)]
pub enum ForceInTime {
    /// It grows to this (N) and stays.
    Grown(f64),
    /// (N) over time (s).
    Course(MonotoneCubic),
}

impl ForceInTime {
    fn at(&self, t: f64, forming: f64) -> f64 {
        match self {
            Self::Grown(force) => force * smooth_step(t, 0.0, RISE * forming),
            Self::Course(course) => course.at(t),
        }
    }
}

/// How a part moves.
#[derive(Debug, Clone, PartialEq)]
pub enum Motion {
    /// It stands where it is drawn.
    Still,
    /// Its way (m) over time (s).
    Table(MonotoneCubic),
    /// It is pressed towards the sheets.
    Pressed(PressedPart),
}

/// What presses a part.
#[derive(Debug, Clone, PartialEq)]
pub struct PressedPart {
    /// Towards the sheets where the part is drawn (N); of the part that is computed beside mirror planes.
    pub force: ForceInTime,
    /// What a spring adds for each length that it is pushed back (N/m); likewise.
    pub spring: f64,
    /// How far it may go beyond the place where it is drawn (m).
    pub travel: f64,
    /// (kg); likewise.
    pub mass: f64,
    /// In a zone.
    pub guide: Option<Guide>,
}

impl PressedPart {
    /// What presses it (N) at time `t` (s) and where it is `way` (m) off its place.
    fn pressing(&self, t: f64, forming: f64, way: f64) -> f64 {
        let whole = (self.force.at(t, forming) + self.spring * way).max(0.0);
        match &self.guide {
            None => whole,
            Some(guide) => guide.force(whole, way - guide.way.at(t)),
        }
    }
}

/// A rigid part and how it moves.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedPart {
    /// Which.
    pub name: RigidName,
    /// Unit vector in which its way counts.
    pub outwards: Vec3,
    /// Numbers of its contacts in [`Model::rigid_contacts`].
    pub contacts: Vec<usize>,
    /// How it moves.
    pub motion: Motion,
    /// Its way now (m).
    pub way: f64,
    /// Rate of the way (m/s), of one that is pressed.
    pub rate: f64,
    /// The largest force (N) that it has put on plies, of what is computed.
    pub largest: f64,
}

impl MovedPart {
    /// At the time `begin` (s).
    pub fn new(
        name: RigidName,
        outwards: Vec3,
        contacts: Vec<usize>,
        motion: Motion,
        begin: f64,
    ) -> Self {
        let mut part = Self {
            name,
            outwards,
            contacts,
            motion,
            way: 0.0,
            rate: 0.0,
            largest: 0.0,
        };
        part.way = part.drawn_at(begin);
        part
    }

    /// Its way at a time (s) as far as that is known before; of one that is pressed, that where it is drawn (m).
    pub fn drawn_at(&self, t: f64) -> f64 {
        match &self.motion {
            Motion::Table(table) => table.at(t),
            Motion::Pressed(pressed) => pressed.guide.as_ref().map_or(0.0, |g| g.way.at(t)),
            Motion::Still => 0.0,
        }
    }

    /// How far it may go beyond the place where it is drawn (m), of one that is pressed.
    pub fn travel(&self) -> Option<f64> {
        match &self.motion {
            Motion::Pressed(pressed) => Some(pressed.travel),
            Motion::Still | Motion::Table(_) => None,
        }
    }

    /// Puts it where it is at time `t` (s).
    fn apply(&mut self, on: &mut dyn Loaded, t: f64, forming: f64) {
        let (dt, before) = (on.step_size(), self.way);
        let push = |c: &usize| dot(on.rigid_force(*c), self.outwards);
        // What the plies push back with: the opposite of what acts on them.
        let back: f64 = -self.contacts.iter().map(push).sum::<f64>();
        self.largest = self.largest.max(back);
        match &self.motion {
            Motion::Still => return,
            Motion::Table(table) => self.way = table.at(t),
            Motion::Pressed(pressed) => {
                let force = pressed.pressing(t, forming, self.way);
                let drag = PRESSED_DAMPING * pressed.mass * self.rate;
                self.rate += (back - force - drag) / pressed.mass * dt;
                self.way += self.rate * dt;
                if self.way <= -pressed.travel {
                    (self.way, self.rate) = (-pressed.travel, 0.0);
                }
            }
        }
        let rate = if dt > 0.0 {
            (self.way - before) / dt
        } else {
            0.0
        };
        let motion = RigidMotion {
            shift: scale(self.outwards, self.way),
            velocity: scale(self.outwards, rate),
        };
        for c in &self.contacts {
            on.set_rigid_motion(*c, motion);
        }
    }

    /// Force (N) that it puts on the plies, towards them.
    fn force(&self, model: &Model) -> f64 {
        let push = |c: &usize| dot(model.rigid_contacts()[*c].resultant(), self.outwards);
        -self.contacts.iter().map(push).sum::<f64>()
    }
}

/// A gripper on some nodes of a ply.
#[derive(Debug, Clone, PartialEq)]
pub struct Grip {
    /// Nodes, each with its share of the force and its place at the start (m); none where it holds no part of a zone.
    pub nodes: Vec<(u32, f64, Vec3)>,
    /// Unit vector of its pull.
    pub pull: Vec3,
    /// Its force at the start of the ply (N).
    pub force: f64,
    /// What a spring adds for each length that the ply is drawn against the pull (N/m).
    pub spring: f64,
}

impl Grip {
    /// How far (m) a node has been drawn against the pull.
    fn drawn(&self, at: Vec3, start: Vec3) -> f64 {
        -dot(sub(at, start), self.pull)
    }

    fn apply(&self, on: &mut dyn Loaded, t: f64, forming: f64) {
        let force = self.force * smooth_step(t, 0.0, RISE * forming);
        for (node, share, start) in &self.nodes {
            let drawn = self.drawn(on.position(*node), *start);
            // It does not push.
            let force = (share * (force + self.spring * drawn)).max(0.0);
            on.set_load(*node, scale(self.pull, force));
        }
    }

    /// Force on the ply (N), and how far its middle has been drawn against the pull (m).
    fn state(&self, model: &Model, t: f64, forming: f64) -> [f64; 2] {
        let force = self.force * smooth_step(t, 0.0, RISE * forming);
        self.nodes
            .iter()
            .fold([0.0; 2], |sum, (node, share, start)| {
                let drawn = self.drawn(model.x()[*node as usize], *start);
                let force = (share * (force + self.spring * drawn)).max(0.0);
                [sum[0] + force, sum[1] + share * drawn]
            })
    }
}

/// What moves and pulls in a stamping.
#[derive(Debug, Clone, PartialEq)]
pub struct StampingLoad {
    /// When the run begins (s).
    pub begin: f64,
    /// Duration of what moves (s).
    pub forming: f64,
    /// What follows (s).
    pub settling: f64,
    /// Its parts, the scene's tool first.
    pub parts: Vec<MovedPart>,
    /// Its grippers.
    pub grips: Vec<Grip>,
    /// What is told of the stops of parts that the scene leaves out.
    pub stops: Vec<String>,
}

impl StampingLoad {
    /// Moves parts to where they are at time `t` (s), and pulls.
    pub fn apply(&mut self, on: &mut dyn Loaded, t: f64) {
        for part in &mut self.parts {
            part.apply(on, t, self.forming);
        }
        for grip in &self.grips {
            grip.apply(on, t, self.forming);
        }
    }

    /// How far the scene's tool is over where it is drawn at `t` (m), as far as that is known before.
    pub fn tool_height(&self, t: f64) -> f64 {
        let tool = self.parts.iter().find(|p| p.name == RigidName::Tool);
        tool.map_or(0.0, |p| p.drawn_at(t) * p.outwards[2])
    }

    /// Where the history has each part and gripper.
    pub fn names(&self) -> impl Iterator<Item = String> {
        let parts = self
            .parts
            .iter()
            .map(|p| format!("parts/{}", p.name.word()));
        let grips = (1..=self.grips.len()).map(|k| format!("grippers/{k}"));
        parts.chain(grips)
    }

    /// Force on the plies (N) and way (m) of each part and gripper, in that order. `copies`: how often the whole holds what is computed.
    pub fn ways(&self, model: &Model, copies: f64) -> Vec<[f64; 2]> {
        let parts = self.parts.iter().map(|p| [copies * p.force(model), p.way]);
        let grips = self.grips.iter();
        let grips = grips.map(|g| g.state(model, model.time(), self.forming));
        parts.chain(grips).collect()
    }

    /// What to say of parts that have never touched a ply.
    pub fn never_touched(&self) -> Vec<String> {
        let never = self.parts.iter().filter(|p| p.largest <= 0.0);
        never
            .map(|p| {
                format!(
                    "the part '{}' has never touched a ply: look at its place and its motion, or leave it out",
                    p.name.word()
                )
            })
            .collect()
    }

    /// What it remembers of the run.
    ///
    /// # Errors
    /// When the bytes cannot be written, or are not those of such a stamping.
    pub fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        for part in &mut self.parts {
            a.value(&mut part.way)?;
            a.value(&mut part.rate)?;
            a.value(&mut part.largest)?;
        }
        Ok(())
    }
}
