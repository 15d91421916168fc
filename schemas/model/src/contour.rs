//! Closed contours in the plane, as a scene writes them.

use crate::outline::Point;
use crate::units::Length;
use plyflow_fixed::FixedBits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Corners of the polygon that stands for a circle. Its area is less than the circle's by 5e-5 of it.
pub const CIRCLE_CORNERS: usize = 360;

/// A closed contour in the plane. It may run either way round and closes by itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(extend("x-expected" = "a list of points, [[x, y], ..], {circle: {radius: ..}}, {drawing: {file: ..}}, or {input: NAME} from another step"))]
pub enum Contour {
    /// Corners `[x, y]`, at least three.
    Polygon(Vec<[Length; 2]>),
    /// One that a word tells.
    Named(NamedContour),
}

/// A contour that is told by a word.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NamedContour {
    /// A circle.
    Circle(Circle),
    /// An outline that another step makes: its name in an artifact at the input `geometry`.
    Input(String),
    /// One that is drawn in a file.
    Drawing(Drawing),
}

/// How far the ends of two curves of a drawing may lie apart that go on in each other (m), where a scene does not say.
pub const TOLERANCE: Length = Length(1e-5);

/// How far a side may lie off a round curve of a drawing (m), where a scene does not say.
pub const CHORD: Length = Length(5e-5);

/// A contour that is drawn in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Drawing {
    /// Path of a DXF drawing, or of a CSV table of corners with the columns `x` and `y`, relative to the scene file.
    pub file: String,
    /// The layer of a DXF drawing that it is drawn on. May be left out where one layer alone has curves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub layer: Option<String>,
    /// One unit of the file, where the file does not say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub unit: Option<Length>,
    /// How far the ends of two curves may lie apart that go on in each other: 0.01 mm where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub tolerance: Option<Length>,
    /// How far a side may lie off a round curve: 0.05 mm where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub chord: Option<Length>,
    /// Whether the middle of the box around it is moved to (0, 0).
    #[serde(default)]
    pub centred: bool,
}

/// A circle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Circle {
    /// Its centre.
    #[serde(default)]
    pub centre: [Length; 2],
    /// Its radius.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub radius: Length,
}

impl Contour {
    /// The contour of these corners (m).
    pub fn of(corners: &[Point]) -> Self {
        Self::Polygon(corners.iter().map(|p| p.map(Length)).collect())
    }

    /// The name of the outline of another step that it is to be, if its corners are not known yet.
    pub fn input(&self) -> Option<&str> {
        match self {
            Self::Named(NamedContour::Input(name)) => Some(name),
            _ => None,
        }
    }

    /// Why its corners are not known yet, if they are not. The sentence goes on from the name of the contour.
    pub fn unread(&self) -> Option<String> {
        match self {
            Self::Named(NamedContour::Input(name)) => Some(format!(
                "is `{name}` of another step, and nothing gives it; expected a step that gives `geometry`, wired to the input `geometry`"
            )),
            Self::Named(NamedContour::Drawing(drawing)) => Some(format!(
                "is drawn in `{}`, and nobody has read that file; expected its corners, which are read when a workflow is",
                drawing.file
            )),
            _ => None,
        }
    }

    /// Corners relative to the sheet's centre (m), as given; none of a contour whose corners are not known yet ([`Contour::unread`]).
    pub fn corners(&self) -> Vec<Point> {
        match self {
            Self::Polygon(points) => points.iter().map(|p| p.map(|c| c.si())).collect(),
            Self::Named(NamedContour::Input(_) | NamedContour::Drawing(_)) => Vec::new(),
            Self::Named(NamedContour::Circle(circle)) => {
                let ([x, y], r) = (circle.centre.map(|c| c.si()), circle.radius.si());
                let turn = std::f64::consts::TAU / CIRCLE_CORNERS as f64;
                (0..CIRCLE_CORNERS)
                    .map(|k| {
                        let (s, c) = (turn * k as f64).fixed_sin_cos();
                        [x + r * c, y + r * s]
                    })
                    .collect()
            }
        }
    }
}
