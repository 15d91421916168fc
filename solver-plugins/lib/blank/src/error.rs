//! Why a blank has no mesh.

use plyflow_model::outline::{Millimetres, OutlineError};

/// Why a blank has no mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// The sheet has no size.
    #[error("ply '{0}' needs length and width, or an outline")]
    Size(String),
    /// Its outline bounds no region.
    #[error("ply '{0}': {1}")]
    Outline(String, OutlineError),
    /// Something is smaller than the elements can follow. Lengths in mm.
    #[error(
        "{what} at {at} measures {given:.3} mm, too small for elements of {size:.3} mm; take an element size of at most \
         {wanted:.3} mm, or leave that feature out of the outline"
    )]
    Small {
        /// What it is.
        what: &'static str,
        /// Where.
        at: Millimetres,
        /// Its size (mm).
        given: f64,
        /// The elements' (mm).
        size: f64,
        /// Largest elements that follow it (mm).
        wanted: f64,
    },
    /// The edge cannot be followed at this size.
    #[error(
        "the outline cannot be followed with elements of {size:.3} mm near {at}: {why}; take smaller elements"
    )]
    Coarse {
        /// Element size (mm).
        size: f64,
        /// Where.
        at: Millimetres,
        /// What happened.
        why: &'static str,
    },
    /// It would have too many elements; the sentence says how many, and what would do.
    #[error("{0}")]
    TooMany(String),
}
