//! Artifacts: one HDF5 file per step. The only user of HDF5.
//!
//! What a file holds is described in `schemas/data-model.md`. [`ArtifactWriter`] makes one,
//! [`Artifact`] reads one. Meshes follow VTKHDF 2.2: a `MultiBlockDataSet` with one temporal
//! `UnstructuredGrid` per body, which VTK 9.4 to 9.7 (and ParaView of the same age) read as they are.
//! Points are doubles, fields are singles.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod contents;
mod difference;
mod error;
mod h5;
mod mesh;
mod reader;
pub mod seal;
mod small;
pub mod whole;
mod writer;

pub use contents::{ArrayInfo, BodyInfo, Contents, DATA_MODEL, FieldInfo, NamedValue, On};
pub use difference::{Difference, How, differences};
pub use error::{ArtifactError, ErrorKind, Result};
pub use h5::DType;
pub use reader::Artifact;
pub use writer::{ArtifactWriter, MAX_RANK, check_result};
