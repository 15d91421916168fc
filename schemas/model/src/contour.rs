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
#[schemars(extend("x-expected" = "a list of points, [[x, y], ..], or {circle: {radius: ..}}"))]
pub enum Contour {
    /// Corners `[x, y]`, at least three.
    Polygon(Vec<[Length; 2]>),
    /// A circle.
    Round(RoundContour),
}

/// A round contour.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RoundContour {
    /// The circle.
    pub circle: Circle,
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
    /// Corners relative to the sheet's centre (m), as given.
    pub fn corners(&self) -> Vec<Point> {
        match self {
            Self::Polygon(points) => points.iter().map(|p| p.map(|c| c.si())).collect(),
            Self::Round(round) => {
                let ([x, y], r) = (
                    round.circle.centre.map(|c| c.si()),
                    round.circle.radius.si(),
                );
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
