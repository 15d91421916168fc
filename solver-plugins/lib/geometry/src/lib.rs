//! Geometry that knows nothing of plies, tools or runs: vectors, rectangles, the closest of many triangles, cells of a flat mesh by place.
//!
//! Lengths are in m. Everything is deterministic: of two that are equally near, the one of lower index is taken.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

pub mod bins;
pub mod locate;
pub mod rectangle;
pub mod triangle_tree;
pub mod vec3;

pub use bins::Bins;
pub use locate::{Location, QuadLocator};
pub use rectangle::Rectangle;
pub use triangle_tree::{Feature, TriangleTree, closest_on_triangle};
pub use vec3::Vec3;
