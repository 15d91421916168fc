//! The plies of a ply book, as a scene names it.

use crate::contour::Contour;
use crate::material::MaterialEntry;
use crate::units::Length;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A ply book: a table with a row for each ply, in the order of the layup, the one nearest the tool first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlyBook {
    /// Path of the table (CSV), relative to the scene file. Its columns: `name`, `angle`, and where they are needed `material`, `outline`, `layer`,
    /// `x`, `y`, `rotation`, `tied`, `note`. Paths in it are relative to the table.
    pub book: String,
    /// The material of rows that have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<MaterialEntry>,
    /// What the names of materials in the book stand for. A name that is not here is the path of a material file.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub materials: BTreeMap<String, MaterialEntry>,
    /// Length of plies whose row has no outline.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Option<Length>,
    /// Width of plies whose row has no outline.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub width: Option<Length>,
    /// Outline of plies whose row has none, instead of length and width.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-expected" = "a list of points, [[x, y], ..], {circle: {radius: ..}}, {drawing: {file: ..}}, or {input: NAME} from another step"))]
    pub outline: Option<Contour>,
    /// Holes in that outline.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub holes: Vec<Contour>,
    /// Moves all plies of the book: the place over the tool of the book's (0, 0).
    #[serde(default)]
    pub centre: [Length; 2],
    /// One unit of the outlines' files, where a file does not say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub unit: Option<Length>,
    /// Of the outlines' files: how far the ends of two curves may lie apart that go on in each other. 0.01 mm where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub tolerance: Option<Length>,
    /// Of the outlines' files: how far a side may lie off a round curve. 0.05 mm where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub chord: Option<Length>,
}
