//! Pictures: plots, rasters and maps as SVG and PNG, and the data of the rotatable view. What is drawn comes as plain structs.

pub(crate) mod colour;
pub(crate) mod colour_bar;
pub(crate) mod error;
pub(crate) mod field_map;
pub(crate) mod legend;
pub(crate) mod plane;
pub(crate) mod plot;
pub(crate) mod raster;
pub(crate) mod scale;
pub(crate) mod scene;
pub(crate) mod sharpness;
pub(crate) mod small;
pub(crate) mod svg;
pub(crate) mod view;
