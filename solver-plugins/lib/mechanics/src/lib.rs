//! Explicit dynamics of stacked sheets.
//!
//! One page of how it fits together:
//!
//! - [`mesh`]: quad meshes (graded grids, adjacency, node patches);
//! - [`mirror`]: halves and quarters that mirror planes bound;
//! - [`component`]: instances of element formulations and materials behind the C ABI;
//! - [`sheet`]: a meshed sheet cut into batches of [`LANES`] elements, and its node patches;
//! - [`contact`]: node-to-surface contact between neighbouring sheets of the stack, and of sheet nodes
//!   with rigid surfaces;
//! - [`model`]: nodes, sheets, contacts and loads; one central-difference step;
//! - [`backend`]: the small interface that a driver sees, and a second back-end could have;
//! - [`relax`]: static equilibrium by explicit steps with kinetic damping;
//! - [`energy`]: the ledger that says where the work went;
//! - [`archive`]: what changes during a run as bytes, for checkpoints;
//! - [`history`]: smooth ramps and cubic interpolation in time.
//!
//! All quantities are SI. Results are identical for any number of threads: parallel passes write to their
//! own slots, and every sum runs in a fixed order.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod archive;
pub mod backend;
pub mod component;
pub mod contact;
pub mod crossed;
pub mod energy;
pub mod history;
pub mod mesh;
pub mod mirror;
pub mod model;
pub mod relax;
pub mod sheet;
pub mod team;

/// Elements per batch.
pub const LANES: usize = 32;

/// Why a model cannot be built or cannot go on.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MechanicsError {
    /// A component refused its parameters or failed.
    #[error("{what}: {reason}")]
    Component {
        /// Which component, for which sheet.
        what: String,
        /// Its own text.
        reason: String,
    },
    /// Input that makes no model.
    #[error("{0}")]
    Input(String),
    /// The simulation left the range where its numbers mean anything.
    #[error(
        "the run became unstable at t = {time:.6} s (cycle {cycle}): {what}. \
         Likely cause: {cause}. What to try: {remedy}"
    )]
    Unstable {
        /// Simulated time (s).
        time: f64,
        /// Cycle.
        cycle: u64,
        /// Which node or element, and what was seen.
        what: String,
        /// Likely cause.
        cause: String,
        /// What to change.
        remedy: String,
    },
    /// An element is in a state for which it was not made, in which it may rest without force.
    #[error(
        "element {cell} of sheet '{sheet}', at ({:.1}, {:.1}, {:.1}) mm, is no element any more at t = {time:.6} s (cycle {cycle}): {what}. \
         What it carries there means nothing, so the run stops. Likely cause: the sheet bends or is compressed more sharply than its \
         elements can show, or it is pushed through something. What to try: a smaller element_size there, a larger hourglass_floor \
         (of s4 hourglass_director, such as 0.5), a slower process",
        1e3 * place[0], 1e3 * place[1], 1e3 * place[2]
    )]
    Distorted {
        /// Simulated time (s).
        time: f64,
        /// Cycle.
        cycle: u64,
        /// Name of the sheet.
        sheet: String,
        /// Its cell.
        cell: usize,
        /// Middle of the cell (m).
        place: vec3::Vec3,
        /// What has become of it.
        what: String,
    },
}

pub(crate) use plyflow_geometry::vec3;
