//! Plies on their way to the formed state.

use crate::plain::ply::Vec3;

/// The way of the plies of a run.
#[derive(Debug, Clone, Default)]
pub(crate) struct Frames {
    /// From the first one on, without the last.
    pub(crate) all: Vec<Frame>,
    /// When the last one is (s).
    pub(crate) end: f64,
}

/// One moment.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    /// (s).
    pub(crate) time: f64,
    /// In the order of the plies of the run.
    pub(crate) plies: Vec<FramePly>,
    /// How far the tool is from where it is shown (m).
    pub(crate) tool: Vec3,
}

/// A ply at one moment, on the mesh of the formed one.
#[derive(Debug, Clone)]
pub(crate) struct FramePly {
    /// `[points]` (m).
    pub(crate) formed: Vec<Vec3>,
    /// `[cells]` (rad), where the artifact has it.
    pub(crate) shear: Option<Vec<f64>>,
}
