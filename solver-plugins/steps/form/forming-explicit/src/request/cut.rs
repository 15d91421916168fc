//! What other runs give: how the cut of a zone moves, and where nodes of a whole scene go.

use crate::error::{FormingError, Result};
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::MonotoneCubic;
use plyflow_model::artifact::Zone;

/// Where a sheet is when its zone begins late, and how it came there.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    /// `[states][n]` positions (m) on the way from the undeformed state, in time; the last is the one to begin at.
    pub path: Vec<Vec<Vec3>>,
    /// `[n]` velocities (m/s) there.
    pub velocity: Vec<Vec3>,
}

/// A sheet of the zone as the boundary artifact holds it.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalSheet {
    /// Name, as in the scene.
    pub name: String,
    /// `[n]` undeformed points (m).
    pub points: Vec<Vec3>,
    /// `[m]` cells.
    pub cells: Vec<[u32; 4]>,
    /// `[k]` driven nodes.
    pub driven: Vec<u32>,
    /// `[frames][k]` positions (m).
    pub position: Vec<Vec<Vec3>>,
    /// `[frames][k]` velocities (m/s).
    pub velocity: Vec<Vec<Vec3>>,
    /// `[frames][k]` normals of the coarse surface; empty when the artifact has none, and then rotations are free.
    pub normal: Vec<Vec<Vec3>>,
    /// `[frames][k]` their rates (1/s); as `normal`.
    pub normal_rate: Vec<Vec<Vec3>>,
    /// `[frames][k]` forces of the surroundings on them (N); empty when the cut gives no way.
    pub pull: Vec<Vec<Vec3>>,
    /// `[k]` how stiffly they hold (N/m); as `pull`.
    pub stiffness: Vec<f64>,
    /// Where a run that begins late begins; `None` for one that begins with the process.
    pub start: Option<Start>,
}

/// Where a rigid part was in the run that drives a zone.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordedWay {
    /// Its name.
    pub name: String,
    /// Times (s), which ascend.
    pub time: Vec<f64>,
    /// Its way there, as its motion counts it (m).
    pub way: Vec<f64>,
}

/// What a boundary artifact gives.
#[derive(Debug, Clone)]
pub struct LocalInput {
    /// Times of the frames (s).
    pub time: Vec<f64>,
    /// Sheets, any order.
    pub sheets: Vec<LocalSheet>,
    /// Cavity pressure (Pa) at the times.
    pub cavity: Vec<f64>,
    /// Bag pressure (Pa).
    pub bag: Vec<f64>,
    /// Frame height (m).
    pub frame: Vec<f64>,
    /// Of a press and a stamping: ways of the parts that are pressed.
    pub ways: Vec<RecordedWay>,
    /// The zone, as its artifact describes it.
    pub zone: Zone,
    /// Element size (m).
    pub element_size: f64,
    /// How many times slower than the scene says the process goes on; the times are stretched already.
    pub slower: f64,
}

impl LocalInput {
    /// How the part of that name, which is pressed, moved in the run of the whole.
    ///
    /// # Errors
    /// When that is not told, or at one time alone.
    pub fn way_of(&self, name: &str) -> Result<MonotoneCubic> {
        let told = self.ways.iter().find(|w| w.name == name);
        let told = told.filter(|w| w.time.len() > 1 && w.time.len() == w.way.len());
        let told = told.ok_or_else(|| {
            FormingError::Input(format!(
                "the part '{name}' is pressed, and the boundary does not tell how it moved in the run of the whole, as it does in a zone; expected its way over \
                 time. Run the run of the whole and the boundary's step again, with this version"
            ))
        })?;
        Ok(MonotoneCubic::new(told.time.clone(), told.way.clone()))
    }
}

/// What an artifact feeds back: where nodes of the coarse plies go.
pub struct Feedback {
    /// Times of the frames (s).
    pub time: Vec<f64>,
    /// Plies, any order, with the meshes of the coarse run.
    pub sheets: Vec<LocalSheet>,
}
