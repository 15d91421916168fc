//! The rigid tool of a scene, in its words. What a parametric one must be to have a surface is told by [`rules`]; [`shape`] is that of
//! the swept ones.

pub mod place;
pub mod placed;
pub mod ramp;
pub mod rules;
pub mod shape;
pub mod spar;
pub mod stand;

use crate::tool::place::{Centre, Direction, Foot, Place, Rotation};
use crate::units::{Angle, Length};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The rigid tool: one of the parametric generators, an STL file, or what another step makes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Tool {
    /// U-shaped spar with two joggles.
    JoggleSpar(JoggleSpar),
    /// A block with a flat top that lies just above the bed.
    Flat(FlatTool),
    /// U-shaped spar with a recess in its top and sides.
    RampedSpar(RampedSpar),
    /// Half a sphere on the bed.
    Hemisphere(HemisphereTool),
    /// Two domes joined by a waist.
    DoubleDome(DoubleDomeTool),
    /// A tetrahedron with a rounded top and edges.
    Tetrahedron(TetrahedronTool),
    /// A triangulated surface.
    Stl(StlTool),
    /// A surface that another step makes.
    Input(InputTool),
}

/// The spar of thesis chapter 5: a male tool of trapezoidal section whose height steps twice along its
/// length (two ramps in z), the ramps slanted in plan so that they are asymmetric about the width.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct JoggleSpar {
    /// Length along x, measured at the foot on the bed.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Width of the top face between the theoretical corners, before the first joggle.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub top_width: Length,
    /// Height of the top face over the bed before the first joggle.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub height: Length,
    /// Angle of the side and end walls from the vertical.
    #[schemars(extend("x-minimum" = "0 deg", "x-maximum" = "57 deg"))]
    pub draft: Angle,
    /// Radius of the fillets between top and walls, in the section square to the edge where a joggle's ramp is steepest. One radius is
    /// swept along the whole spar: on the ramp the edge climbs and its section is sharper, so in the plane square to x it is larger
    /// by 1 + the square of the ramp's largest slope, everywhere. Where a slanted ramp
    /// runs into this edge both bend the surface: there it is sharper than either, by up to 1 + sin(skew).
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub fillet: Length,
    /// Radius in plan of the vertical edges between side and end walls, at the top. Twice the fillet
    /// unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corner: Option<Length>,
    /// The joggles, in order of `start`.
    pub joggles: Vec<Joggle>,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// One ramp of the top face.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Joggle {
    /// x (from the tool's centre) where the ramp begins, on the centre line y = 0.
    pub start: Length,
    /// Length of the ramp along x, its fillets included.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Change of height over the ramp, positive upwards with growing x.
    pub rise: Length,
    /// Slant in plan: the ramp begins at x = start + y tan(skew).
    #[schemars(extend("x-minimum" = "-45 deg", "x-maximum" = "45 deg"))]
    pub skew: Angle,
    /// How far the ramp also steps each side wall outwards (y < 0 side, y > 0 side), positive outwards.
    pub side_step: [Length; 2],
    /// Radius of the fillets where the ramp begins and ends, in the section square to it; on an edge that also
    /// steps sideways, of the step and rise together.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub fillet: Length,
}

/// A spar of trapezoidal section whose top and side walls fall back over a ramp, stay back, and return over a ramp of
/// the same length: the kind of tool of thesis chapter 6. With a ramp of 180 mm a depth of 10 mm is its ratio of 1:18 for
/// the top, and a side depth of 5 mm its 1:36 for the sides; the other sizes are not in the thesis.
// The section's keys stand again as in `JoggleSpar`: put into one struct by `flatten`, unknown keys would no longer be refused.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RampedSpar {
    /// Length along x, measured at the foot on the bed.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Width of the top face between the theoretical corners, outside of the recess.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub top_width: Length,
    /// Height of the top face over the bed outside of the recess.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub height: Length,
    /// Angle of the side and end walls from the vertical.
    #[schemars(extend("x-minimum" = "0 deg", "x-maximum" = "57 deg"))]
    pub draft: Angle,
    /// Radius of the fillets between top and walls, and where the ramps begin and end.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub fillet: Length,
    /// Length of the recess's bottom along x, in the middle of the spar.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub recess: Length,
    /// Length of each ramp along x, its fillets included.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub ramp: Length,
    /// How far the top falls back.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub depth: Length,
    /// How far each side wall falls back.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub side_depth: Length,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// A pyramid over an equilateral triangle, one edge of which is parallel to x at y < 0, with its axis on z. Its three
/// edges and its top are rounded; on the bed it ends sharply.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TetrahedronTool {
    /// Edge of the triangle on the bed, between the theoretical corners.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub edge: Length,
    /// Height of the theoretical top over the bed, before rounding; edge * sqrt(2/3) for a regular tetrahedron.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub height: Length,
    /// Radius of the edges and of the top.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub radius: Length,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// A flat block.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlatTool {
    /// Length along x.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Width along y.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub width: Length,
    /// Height of the flat top above the bed.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub height: Length,
    /// Radius of the rounding between top and bed; at most the height.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub fillet: Length,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// Half a sphere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HemisphereTool {
    /// Radius.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub radius: Length,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// Two domes along x, joined by a waist: the kind of tool of the double-dome forming benchmark of woven composites. An outline of two
/// circles and the two arcs between them, hollow and tangent to both, is turned about the x axis; its upper half stands on a
/// vertical wall with the same outline. For example `dome_radius: 60 mm`, `dome_distance: 180 mm`, `waist_radius: 150 mm`: 300 mm
/// long, 120 mm wide and 79.5 mm at the waist. The benchmark's own drawing was not at hand: take its sizes from there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DoubleDomeTool {
    /// Radius of the domes.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub dome_radius: Length,
    /// Distance of their centres.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub dome_distance: Length,
    /// Radius of the hollow arcs between them.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub waist_radius: Length,
    /// Height of the vertical wall under the domes.
    #[serde(default)]
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub wall: Length,
    /// Largest edge of the triangulation.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub facet_size: Length,
}

/// A tool from an STL file (binary or ASCII).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StlTool {
    /// Path, relative to the scene file.
    pub file: String,
    /// Length of one unit of the file, e.g. `1 mm`.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub unit: Length,
    /// Moves the file's origin, after scaling and before anything else.
    #[serde(default)]
    pub translate: [Length; 3],
    /// Which direction of the file becomes z, by the smallest turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<Direction>,
    /// Turns it then, about z or one after the other about axes of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<Rotation>,
    /// Moves the middle of the box around it to x = y = 0, or to another place of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre: Option<Centre>,
    /// Moves its lowest point to the bed, or to another height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foot: Option<Foot>,
}

impl StlTool {
    /// Where its words put it.
    pub fn place(&self) -> Place {
        Place {
            translate: self.translate.map(|t| t.si()),
            up: self.up,
            rotate: self.rotate.clone(),
            centre: self.centre,
            foot: self.foot,
        }
    }
}

/// A tool that another step makes: a body of an artifact at the input `geometry`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InputTool {
    /// Name of the body.
    pub body: String,
    /// Moves the body, before anything else.
    #[serde(default)]
    pub translate: [Length; 3],
    /// Which direction of the body becomes z, by the smallest turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<Direction>,
    /// Turns it then, about z or one after the other about axes of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<Rotation>,
    /// Moves the middle of the box around it to x = y = 0, or to another place of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre: Option<Centre>,
    /// Moves its lowest point to the bed, or to another height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foot: Option<Foot>,
    /// Its triangles, once they have been read ([`crate::given::fill`]). They are no words of the scene.
    #[serde(skip)]
    pub given: Option<Arc<GivenSurface>>,
}

impl InputTool {
    /// Where its words put it.
    pub fn place(&self) -> Place {
        Place {
            translate: self.translate.map(|t| t.si()),
            up: self.up,
            rotate: self.rotate.clone(),
            centre: self.centre,
            foot: self.foot,
        }
    }
}

/// Triangles that a step has made.
#[derive(Debug, Clone, PartialEq)]
pub struct GivenSurface {
    /// Name of the step.
    pub step: String,
    /// Positions (m), one row per point: x, y, z.
    pub points: Vec<[f64; 3]>,
    /// Indices into `points`, one row per triangle, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}
