//! A workflow with a block `study`: its points, what of it depends on which variable, and every step at every point.
//!
//! A step of the file becomes one step for every combination of the values that it, or what arrives at it, depends on. What depends on no
//! variable is there once. Wires are those of the file, within a point.

mod cells;
mod family;
mod optimise;
mod points;
mod responses;
mod space;
mod told;

pub(crate) use family::Asked;
pub use optimise::PointsOf;
pub(crate) use responses::at_all_points;
pub(crate) use space::Family;
