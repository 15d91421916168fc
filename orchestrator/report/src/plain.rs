//! What is read and what is drawn, as plain structs: they know neither files nor pictures.

pub(crate) mod chart;
mod field_map;
mod frames;
mod laid;
mod locate;
mod place;
mod ply;
mod shape;

pub(crate) use chart::{Boxes, COLOURS, LARGEST, Plot, Series, Spread, Style};
pub(crate) use field_map::{FieldMap, Panel};
pub(crate) use frames::{Frame, FramePly, Frames};
pub(crate) use locate::{Locator, bounds, outline};
pub(crate) use place::{Line, Place, cells_of, id_of, id_of_row, normal, of_cells, ring};
pub(crate) use ply::{Cells, Marked, Other, Ply, Shade, Sheet, Tool, Vec3, at_points, range_of};
pub(crate) use shape::Shape as PlyShape;
