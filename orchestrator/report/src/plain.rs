//! What is read and what is drawn, as plain structs: they know neither files nor pictures.

pub(crate) mod chart;
pub(crate) mod field_map;
pub(crate) mod locate;
pub(crate) mod place;
pub(crate) mod ply;
