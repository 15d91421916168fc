//! A forming run, ready to go: what all that follows looks at.

use crate::boundary::Beginning;
use crate::load::Load;
use crate::stack::{Body, RigidBody, RigidName, StackSheet};
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::MechanicsError;
use plyflow_mechanics::archive::{Archive, ArchiveError};
use plyflow_mechanics::backend::{Backend, Load as _, Stretch};
use plyflow_mechanics::component::ElementField;
use plyflow_mechanics::contact::RigidContact;
use plyflow_mechanics::model::{Clock, Model};
use plyflow_model::artifact::{ToolPlacement, Zone};
use plyflow_tooling::{FieldError, ToolMesh};
use std::sync::Arc;

/// A forming run, ready to go.
pub struct Forming {
    /// The model.
    pub model: Model,
    /// Its loads.
    pub load: Load,
    /// The stack, bottom to top.
    pub stack: Vec<StackSheet>,
    /// Bodies of the artifact, bottom to top.
    pub bodies: Vec<Body>,
    /// `[n]` points at the start (m).
    pub reference: Arc<[Vec3]>,
    /// The tool.
    pub tool: ToolMesh,
    /// What else is rigid, to be looked at.
    pub rigid: Vec<RigidBody>,
    /// By rigid part: by how much (m) and where what contacts see differs most from the triangles that are
    /// written of it.
    pub field_errors: Vec<(RigidName, FieldError)>,
    /// How the tool has been put in its place, by more than `translate`.
    pub placement: Option<ToolPlacement>,
    /// What the user should know of the tool.
    pub tool_warnings: Vec<String>,
    /// The zone of a local run.
    pub zone: Option<Zone>,
    /// How many times slower than the scene says its process goes on.
    pub slower: f64,
    /// Where a run that begins late begins.
    pub start: Option<Beginning>,
    /// Edge of the plies' elements (m).
    pub element_size: f64,
}

impl Forming {
    /// The plies, from the tool upwards.
    pub fn plies(&self) -> impl Iterator<Item = (&Body, &StackSheet)> {
        let all = self.bodies.iter().zip(&self.stack);
        all.filter(|(_, sheet)| sheet.is_ply())
    }

    /// Positions (m) of a body's points now.
    pub fn points(&self, body: &Body) -> Vec<Vec3> {
        self.whole_points(body, self.model.x())
    }

    /// Reference points (m) of a body.
    pub fn reference_points(&self, body: &Body) -> Vec<Vec3> {
        self.whole_points(body, &self.reference)
    }

    fn whole_points(&self, body: &Body, x: &[Vec3]) -> Vec<Vec3> {
        let nodes = body.sheet.nodes(&self.model);
        let part: Vec<Vec3> = nodes.iter().map(|n| x[*n as usize]).collect();
        match &body.mirrored {
            Some(m) => m.whole.points(&part),
            None => part,
        }
    }

    /// Values of a field of a body's elements, which have the fields `all`. Needs a step with fields.
    pub fn field(&self, body: &Body, f: &ElementField, all: &[ElementField]) -> Vec<f64> {
        let own =
            |name: &str| Some(self.own_field(body, all.iter().find(|f| f.name == name)?, all));
        let mut sheets = self.bodies.iter().zip(&self.stack);
        let sheet = sheets.find(|(b, _)| b.name == body.name);
        let crossed = sheet.and_then(|(_, sheet)| sheet.crossed());
        let of_families = crossed.and_then(|crossed| crossed.field(&f.name, own));
        of_families.unwrap_or_else(|| self.own_field(body, f, all))
    }

    /// The same as the elements tell it.
    fn own_field(&self, body: &Body, f: &ElementField, all: &[ElementField]) -> Vec<f64> {
        let of = |f: &ElementField| {
            if f.patch {
                self.model.patch_field(body.sheet.0, f.row)
            } else {
                self.model
                    .mixed_cell_field(body.sheet.0, f.row, f.elsewhere)
            }
        };
        match &body.mirrored {
            Some(m) => m.field(f, all, of),
            None => of(f),
        }
    }

    /// Takes the model through a stretch of steps under its loads. With `fields`, the elements' fields at the begin of its last step are kept.
    ///
    /// # Errors
    /// As [`Backend::run`].
    pub fn go(&mut self, stretch: &Stretch, fields: bool) -> Result<(), MechanicsError> {
        self.model.run(stretch, fields, &mut self.load)
    }

    /// Puts the loads of a time (s) on the model.
    pub fn load_at(&mut self, time: f64) {
        let clock = Clock::of_step(self.model.cycle());
        self.load.apply(&mut self.model, time);
        self.model.count_loads(clock);
    }

    /// How often the whole holds what is computed: 1, or with mirror planes 2 or 4.
    pub fn copies(&self) -> f64 {
        self.model.planes().copies() as f64
    }

    /// Where the part of that name has moved (m).
    pub fn shift(&self, part: &RigidName) -> Vec3 {
        let of = |c: &&RigidContact| part.is_of(&c.name);
        let found = self.model.rigid_contacts().iter().find(of);
        found.map_or([0.0; 3], |c| c.motion.shift)
    }

    /// What changes: the model, and what its loads remember.
    ///
    /// # Errors
    /// When the bytes cannot be written, or are not those of this model.
    pub fn archive(&mut self, a: &mut Archive<'_>) -> Result<(), ArchiveError> {
        self.model.archive(a)?;
        self.load.archive(a)
    }

    /// By how much (m) what contacts see of a rigid part differs at most from its triangles; none of a part that is a plane.
    pub fn field_error(&self, part: &RigidName) -> f64 {
        let of = self.field_errors.iter().find(|(name, _)| name == part);
        of.map_or(0.0, |(_, e)| e.largest)
    }
}
