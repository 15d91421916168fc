//! A global run with what it led to: its defects and zones, its local runs, their comparison.

use crate::plain::{Frames, Place, Ply, Tool};
use crate::read::comparison::Comparison;
use crate::read::history::History;
use plyflow_model::artifact::{Confirmation, Defects, Forming, Zone};

/// What one global run led to.
#[derive(Debug, Default)]
pub(crate) struct Study {
    /// Items of the global run, when there are several.
    pub(crate) title: String,
    /// The global run.
    pub(crate) global: Option<Run>,
    /// Its tool.
    pub(crate) tool: Option<Tool>,
    /// Its plies, formed, with what the detection found.
    pub(crate) plies: Vec<Ply>,
    /// Its plies on their way, where the run has kept frames.
    pub(crate) frames: Option<Frames>,
    /// What the detection tells of itself; absent without one.
    pub(crate) detection: Option<Defects>,
    /// The instance of the detection.
    pub(crate) detected_by: Option<usize>,
    /// Zones; absent when no step looked for them.
    pub(crate) zones: Option<Vec<Zone>>,
    /// One entry per zone with something to show.
    pub(crate) locals: Vec<Local>,
    /// What the comparison found; of several of the same zones, the first.
    pub(crate) comparison: Option<Comparison>,
    /// Whether that stays when the zones are run in other ways, where they were.
    pub(crate) confirmed: Option<Confirmation>,
    /// Local runs that only the other comparisons of these zones have, without plies and histories.
    pub(crate) further: Vec<Run>,
    /// A fine run of the whole scene.
    pub(crate) reference: Option<Run>,
    /// Where the defects lie that were measured on the plies of the global run.
    pub(crate) measured: Vec<Place>,
}

/// A forming run without its meshes.
#[derive(Debug)]
pub(crate) struct Run {
    /// Name for people.
    pub(crate) label: String,
    /// Index of its instance.
    pub(crate) instance: usize,
    /// Key of its artifact.
    pub(crate) key: String,
    /// Its attributes.
    pub(crate) facts: Forming,
    /// Bound on kinetic over internal energy that it was given.
    pub(crate) kinetic_bound: Option<f64>,
    /// Its history.
    pub(crate) history: History,
}

/// A local run.
#[derive(Debug)]
pub(crate) struct Local {
    /// Name of its zone.
    pub(crate) zone: String,
    /// The run.
    pub(crate) run: Run,
    /// Its plies, formed.
    pub(crate) plies: Vec<Ply>,
}

impl Study {
    /// Its plies and those of its local runs.
    pub(crate) fn all_plies(&self) -> Vec<&Ply> {
        let locals = self.locals.iter().flat_map(|l| &l.plies);
        self.plies.iter().chain(locals).collect()
    }

    /// Takes over for the plies of the global run what that tells of the flat ones.
    pub(crate) fn laid(&mut self) {
        let sheets = self.global.as_ref().map(|g| g.facts.sheets.as_slice());
        for ply in &mut self.plies {
            ply.laid_as(sheets.unwrap_or_default());
        }
    }

    /// Its runs: the global one, the local ones, and the reference, which may be one of them.
    pub(crate) fn runs(&self) -> impl Iterator<Item = &Run> {
        let locals = self.locals.iter().map(|l| &l.run);
        self.global.iter().chain(locals).chain(&self.reference)
    }

    /// What is said of a defect of the local runs when the zones are run in other ways.
    pub(crate) fn confirmed_text(&self, id: &str) -> Option<&str> {
        let defects = &self.confirmed.as_ref()?.defects;
        defects.iter().find(|d| d.id == id).map(|d| d.text.as_str())
    }
}
