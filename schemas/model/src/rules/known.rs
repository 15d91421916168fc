//! What of a scene can be looked at.

use crate::friction::Friction;
use crate::process::Process;
use crate::scene::{MirrorPlane, Scene, Sheet, SheetKind};
use crate::tool::Tool;

/// A scene, or what could be read of one: rules that need more say nothing, so that a slip in one part does not hide what is wrong in another.
#[derive(Debug, Clone, Default)]
pub struct Known<'a> {
    /// The tool.
    pub tool: Option<&'a Tool>,
    /// Every sheet, from the tool upwards.
    pub sheets: Vec<Option<&'a Sheet>>,
    /// Coefficients.
    pub friction: Option<&'a Friction>,
    /// The process.
    pub process: Option<&'a Process>,
    /// Mirror planes.
    pub symmetry: &'a [MirrorPlane],
}

impl<'a> From<&'a Scene> for Known<'a> {
    fn from(scene: &'a Scene) -> Self {
        Self {
            tool: Some(&scene.tool),
            sheets: scene.sheets.iter().map(Some).collect(),
            friction: Some(&scene.friction),
            process: Some(&scene.process),
            symmetry: &scene.symmetry,
        }
    }
}

impl<'a> Known<'a> {
    /// All sheets, when there is one and all could be read.
    pub fn whole_stack(&self) -> Option<Vec<&'a Sheet>> {
        let all: Option<Vec<&Sheet>> = self.sheets.iter().copied().collect();
        all.filter(|sheets| !sheets.is_empty())
    }

    /// The sheets that could be read, with their numbers.
    pub fn numbered(&self) -> impl Iterator<Item = (usize, &'a Sheet)> {
        let sheets = self.sheets.iter().enumerate();
        sheets.filter_map(|(k, sheet)| sheet.map(|s| (k, s)))
    }

    /// The plies among them.
    pub fn plies(&self) -> impl Iterator<Item = (usize, &'a Sheet)> {
        self.numbered().filter(|(_, s)| s.kind == SheetKind::Ply)
    }
}
