//! Regions of plies: places on the flat ply with another friction, or without stitches.

use crate::contour::Contour;
use crate::friction::Coefficient;
use crate::outline::{OutlineError, Point, Region, segment_distance, sides, signed_area, winds};
use crate::units::{Angle, Length};
use plyflow_fixed::FixedBits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A region holds what is nearer to it than this (m): whether a node on its side counts must not hang on rounding.
pub const SAME_PLACE: f64 = 1e-6;

/// The key of [`PlyRegion::friction`] that stands for all that the ply touches.
pub const ALL: &str = "all";

/// The keys of [`PlyRegion::friction`] that stand for a class of surfaces.
pub const CLASSES: [&str; 3] = ["fabric_fabric", "fabric_diaphragm", "tool_fabric"];

/// A part of a flat ply where it rubs otherwise, or has no stitches.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlyRegion {
    /// Its name, told apart from those of the ply's other regions.
    pub name: String,
    /// A polygon (or circle) on the flat ply, relative to the ply's `centre`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-expected" = "a list of points, [[x, y], ..], {circle: {radius: ..}}, {drawing: {file: ..}}, or {input: NAME} from another step"))]
    pub polygon: Option<Contour>,
    /// A rectangle instead, each of whose sizes is one number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rectangle: Option<RegionRectangle>,
    /// Coefficients of friction there, in the place of those of `friction`: by what the ply touches, a name, a class such as `fabric_fabric`,
    /// or `all`. A name counts before its class, and that before `all`. Left out: friction is as elsewhere.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub friction: BTreeMap<String, Coefficient>,
    /// `removed`: elements whose middle lies in the region are without the stitch of the ply's material. Left out: they have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stitches: Option<Stitches>,
}

/// A rectangle on a flat ply.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RegionRectangle {
    /// Its middle, relative to the ply's `centre`.
    #[serde(default)]
    pub centre: [Length; 2],
    /// Size along x before it is turned.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Size along y before it is turned.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub width: Length,
    /// By how much it is turned about its middle, counter-clockwise seen from above.
    #[serde(default)]
    pub angle: Angle,
}

/// What becomes of the stitches in a region.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Stitches {
    /// There are none.
    Removed,
}

/// Why a region of a ply has no corners. The sentences go on from "region 'name'".
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RegionError {
    /// It has neither a polygon nor a rectangle.
    #[error("has no shape; expected a `polygon` or a `rectangle`")]
    Shapeless,
    /// It has both.
    #[error("has a `polygon` and a `rectangle`; expected one of the two")]
    TwoShapes,
    /// Its shape is made by another step or drawn in a file, and has not been read.
    #[error("{0}")]
    NotRead(String),
    /// Its shape bounds nothing.
    #[error("has no area of its own: {}", .0.to_string().replace("outline", "polygon"))]
    NoArea(OutlineError),
}

impl PlyRegion {
    /// Its corners over the tool (m), for a ply of this centre (m), counter-clockwise.
    ///
    /// # Errors
    /// When it is no region: without a shape, with two, with one that crosses itself, or with one that another step makes or a file has and
    /// that has not been read.
    pub fn corners(&self, centre: Point) -> Result<Vec<Point>, RegionError> {
        let own = match (&self.polygon, &self.rectangle) {
            (Some(polygon), None) => match polygon.unread() {
                Some(why) => return Err(RegionError::NotRead(why)),
                None => polygon.corners(),
            },
            (None, Some(r)) => {
                let ([x, y], (s, c)) = (r.centre.map(|v| v.si()), r.angle.si().fixed_sin_cos());
                let (l, w) = (0.5 * r.length.si(), 0.5 * r.width.si());
                let corner = |[u, v]: Point| [x + c * u - s * v, y + s * u + c * v];
                [[-l, -w], [l, -w], [l, w], [-l, w]].map(corner).to_vec()
            }
            (None, None) => return Err(RegionError::Shapeless),
            (Some(_), Some(_)) => return Err(RegionError::TwoShapes),
        };
        let placed = own.iter().map(|p| [p[0] + centre[0], p[1] + centre[1]]);
        let region = Region::new(placed.collect(), Vec::new());
        region.map(|r| r.outline).map_err(RegionError::NoArea)
    }

    /// The coefficient that it has for the surface `partner` of the class `class`.
    pub fn coefficient(&self, partner: &str, class: &str) -> Option<&Coefficient> {
        let of = |key: &str| self.friction.get(key);
        of(partner).or_else(|| of(class)).or_else(|| of(ALL))
    }
}

/// Whether a region of these corners (m) holds a place of the flat ply (m).
pub fn holds(corners: &[Point], at: Point) -> bool {
    winds(corners, at) || edge_distance(corners, at) <= SAME_PLACE
}

/// From the nearest side (m).
pub fn edge_distance(corners: &[Point], at: Point) -> f64 {
    let apart = sides(corners).map(|(a, b)| segment_distance(at, a, b));
    apart.fold(f64::INFINITY, f64::min)
}

/// Area of a polygon (m2).
pub fn area(corners: &[Point]) -> f64 {
    signed_area(corners).abs()
}
