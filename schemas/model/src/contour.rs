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
#[schemars(extend("x-expected" = "a list of points, [[x, y], ..], {circle: {radius: ..}}, or {input: NAME} from another step"))]
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

    /// Corners relative to the sheet's centre (m), as given; none of a contour that another step makes ([`Contour::input`]).
    pub fn corners(&self) -> Vec<Point> {
        match self {
            Self::Polygon(points) => points.iter().map(|p| p.map(|c| c.si())).collect(),
            Self::Named(NamedContour::Input(_)) => Vec::new(),
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
