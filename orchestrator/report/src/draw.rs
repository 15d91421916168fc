//! Pictures: plots, rasters and maps as SVG and PNG, and the data of the rotatable view. What is drawn comes as plain structs.

mod colour;
mod colour_bar;
mod error;
mod field_map;
mod legend;
mod plane;
mod plot;
mod raster;
mod scene;
mod sharpness;
mod small;
mod svg;
mod variable_axis;
mod view;

pub(crate) use colour::{Palette, Scale};
pub(crate) use colour_bar::bar;
pub use error::DrawError;
pub(crate) use error::Drawn;
pub(crate) use legend::{Field, Legend};
pub(crate) use plane::{Corner, LEAST, Plane, contour};
pub(crate) use plot::axis::{Axis, Zero, extent, ticks};
pub(crate) use plot::{CHARACTER, MARKERS, bars};
pub(crate) use raster::{Camera, Canvas, Paint, Surface, Triangles};
pub(crate) use scene::{Scene, Shown, scene};
pub(crate) use sharpness::Sharpness;
pub(crate) use small::{Look, Series};
pub(crate) use svg::{px, spot};
pub(crate) use variable_axis::VariableAxis;
pub(crate) use view::{FormedView, Mark, Overlay, Side, flat, formed, tool_picture};
