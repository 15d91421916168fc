//! The parts of a stamping as they are drawn, and how they move.

use crate::error::{FormingError, Result};
use crate::request::Parameters;
use crate::stack::RigidName;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::MonotoneCubic;
use plyflow_model::scene::{PartMotion, Pressed, Side, Stamping, StampingPart};
use plyflow_model::stamping::TOOL;
use plyflow_tooling::{FieldError, PartField, SignedDistanceGrid, ToolMesh, part};
use std::sync::Arc;

/// A part as it is drawn, and how it moves.
pub struct Drawn {
    /// Which it is.
    pub name: RigidName,
    /// On which side of the plies.
    pub side: Side,
    /// Its triangles.
    pub mesh: ToolMesh,
    /// What contacts see.
    pub field: PartField,
    /// By how much both differ at most.
    pub error: FieldError,
    /// What the scene says of its motion.
    pub words: Option<StampingPart>,
}

impl Drawn {
    /// Unit vector in which its way counts.
    pub fn outwards(&self) -> Vec3 {
        let away = [0.0, 0.0, self.side.away()];
        self.words.as_ref().map_or(away, StampingPart::outwards)
    }

    /// What presses it, of one that is pressed.
    pub fn pressed(&self) -> Option<&Pressed> {
        match self.words.as_ref()?.motion.as_ref()? {
            PartMotion::Pressed(pressed) => Some(pressed),
            PartMotion::Table(_) => None,
        }
    }

    /// Whether what the plies do decides where it is.
    pub fn is_pressed(&self) -> bool {
        self.pressed().is_some()
    }

    /// Its table, of one that follows one: way (m) over time (s), in a process that is `slower` by that factor.
    pub fn table(&self, slower: f64) -> Option<MonotoneCubic> {
        match self.words.as_ref()?.motion.as_ref()? {
            PartMotion::Table(rows) => {
                let rows = rows.iter().map(|r| (slower * r.time.si(), r.way.si()));
                let (times, ways) = rows.unzip();
                Some(MonotoneCubic::new(times, ways))
            }
            PartMotion::Pressed(_) => None,
        }
    }

    /// Times (s) of its table; none of one that has none.
    pub fn times(&self) -> Vec<f64> {
        match self.words.as_ref().and_then(|w| w.motion.as_ref()) {
            Some(PartMotion::Table(rows)) => rows.iter().map(|r| r.time.si()).collect(),
            _ => Vec::new(),
        }
    }

    /// Where it is at a time (s), as far as that is known before (m).
    pub fn shift(&self, t: f64) -> Vec3 {
        let way = self.table(1.0).map_or(0.0, |table| table.at(t));
        self.outwards().map(|c| c * way)
    }
}

/// All parts, the scene's tool first.
///
/// # Errors
/// When one has no surface, or its field cannot follow it.
pub fn drawn(
    p: &Parameters,
    stamping: &Stamping,
    (mesh, field, error): (&ToolMesh, SignedDistanceGrid, FieldError),
) -> Result<Vec<Drawn>> {
    let mut all = vec![Drawn {
        name: RigidName::Tool,
        side: Side::Below,
        mesh: mesh.clone(),
        field: PartField::standing(field),
        error,
        words: stamping.parts.iter().find(|w| w.name == TOOL).cloned(),
    }];
    let others = stamping.parts.iter().enumerate();
    for (k, words) in others.filter(|(_, w)| w.name != TOOL) {
        let made = part::rigid(&p.scene, stamping, k, p.tool_grid).map_err(FormingError::Tool)?;
        all.push(Drawn {
            name: RigidName::Part(Arc::from(words.name.as_str())),
            side: words.side,
            mesh: made.mesh,
            field: made.field,
            error: made.error,
            words: Some(words.clone()),
        });
    }
    Ok(all)
}
