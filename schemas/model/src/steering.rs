//! Steered fibres: directions of a ply's first fibre family that depend on the place, as tailored fibre placement and steered tape have them.
//!
//! **Between the points** of a table the direction follows from their Delaunay triangulation: in each triangle the cosine and the sine of the doubled
//! angle are linear. A fibre has no head, so 0 and 180 degrees are one direction, and doubled they are one angle. **Beyond the points** it is
//! that of the nearest place of the triangulation. Points on one line are joined along that line, and one point alone counts everywhere.
//! **The second family** lies a quarter turn counter-clockwise of the first at each place.

use crate::outline::{Millimetres, Point, Region, cross, segment_distance, sides};
use crate::units::{Angle, Length};
use plyflow_fixed::FixedBits;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use spade::{DelaunayTriangulation, HasPosition, Point2, PositionInTriangulation, Triangulation};
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

/// Most points of a table.
pub const MOST_POINTS: usize = 5000;

/// Neighbouring points of a table whose directions differ by this (rad) or more do not tell which way the fibres turn between them. Below it the
/// doubled angles of a triangle lie within less than half a turn, so that no mixture of them is without a direction.
pub const MOST_TURN: f64 = PI / 3.0;

/// Points nearer to each other are one (m).
const SAME_PLACE: f64 = 1e-9;

/// Direction of a ply's first fibre family.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum FibreDirection {
    /// The same everywhere.
    Straight(Angle),
    /// By place.
    Steered(Steering),
}

impl Default for FibreDirection {
    fn default() -> Self {
        Self::Straight(Angle::default())
    }
}

/// Directions by place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Steering {
    /// Those of a table in a file.
    Table(SteeringTable),
    /// Points, each with its direction.
    Points(Vec<SteeredPoint>),
}

/// A table of directions in a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SteeringTable {
    /// Path of a CSV table with the columns `x`, `y` and `angle`, relative to the scene file. Angles without a unit are in degrees.
    pub file: String,
    /// One unit of `x` and `y`, where the table does not say it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub unit: Option<Length>,
}

/// A point of a ply with the direction of its fibres there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SteeredPoint {
    /// Along the scene's x, relative to the ply's `centre`.
    pub x: Length,
    /// Along y.
    pub y: Length,
    /// Direction of fibre family 1 there, from x, counter-clockwise seen from above.
    pub angle: Angle,
}

/// Why points tell no directions.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SteeringError {
    /// The table is in a file that nobody has read.
    #[error(
        "the directions stand in `{0}`, and nobody has read that file; expected its points, which are read when a workflow is"
    )]
    NotRead(String),
    /// No point, or too many.
    #[error("there are {0} points; expected 1 to {MOST_POINTS}")]
    Count(usize),
    /// A coordinate or an angle is no number, or out of all bounds.
    #[error("point {0} has no place or no direction; expected finite numbers")]
    NoNumber(usize),
    /// Two points are at one place.
    #[error("points {first} and {second} are both at {at}; name every place once")]
    Same {
        /// Number of a point from 0.
        first: usize,
        /// Number of a later one.
        second: usize,
        /// Where.
        at: Millimetres,
    },
}

impl Steering {
    /// `[x, y, angle]` (m, m, rad) of its points over the tool, for a ply whose centre is at `centre` (m).
    ///
    /// # Errors
    /// When they stand in a file that has not been read.
    pub fn points(&self, centre: Point) -> Result<Vec<[f64; 3]>, SteeringError> {
        match self {
            Self::Table(table) => Err(SteeringError::NotRead(table.file.clone())),
            Self::Points(points) => Ok(points
                .iter()
                .map(|p| [p.x.si() + centre[0], p.y.si() + centre[1], p.angle.si()])
                .collect()),
        }
    }
}

/// A corner of the triangulation: number of its point.
#[derive(Debug, Clone, Copy)]
struct Corner {
    at: Point,
    point: usize,
}

impl HasPosition for Corner {
    type Scalar = f64;
    fn position(&self) -> Point2<f64> {
        Point2::new(self.at[0], self.at[1])
    }
}

/// Directions between points.
#[derive(Debug, Clone)]
pub struct SteeredField {
    /// `[x, y, angle]` (m, m, rad).
    points: Vec<[f64; 3]>,
    triangles: DelaunayTriangulation<Corner>,
}

impl PartialEq for SteeredField {
    fn eq(&self, other: &Self) -> bool {
        self.points == other.points
    }
}

/// Neighbouring points between which fibres turn too far.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharpTurn {
    /// Number of a point from 0.
    pub first: usize,
    /// Number of a later one.
    pub second: usize,
    /// Angle between their directions (rad).
    pub apart: f64,
}

/// Angle between two directions without a head (rad, 0 to pi / 2).
pub fn directions_apart(a: f64, b: f64) -> f64 {
    let d = (a - b).rem_euclid(PI);
    d.min(PI - d)
}

impl SteeredField {
    /// Of points `[x, y, angle]` (m, m, rad), in any order: the directions do not depend on it.
    ///
    /// # Errors
    /// When there are none or too many, one is no number, or two are at one place. Numbers of points are those of `points`.
    pub fn new(points: Vec<[f64; 3]>) -> Result<Self, SteeringError> {
        if !(1..=MOST_POINTS).contains(&points.len()) {
            return Err(SteeringError::Count(points.len()));
        }
        let sound = |p: &[f64; 3]| p.iter().all(|v| v.abs() < 1e9);
        if let Some(bad) = points.iter().position(|p| !sound(p)) {
            return Err(SteeringError::NoNumber(bad));
        }
        // In an order of their own, so that four points on a circle are parted the same way however they are listed.
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.sort_by(|a, b| {
            let [p, q] = [points[*a], points[*b]];
            p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1]))
        });
        same_place(&points, &order)?;
        let mut triangles = DelaunayTriangulation::new();
        for point in order {
            let [x, y, _] = points[point];
            // What is too small to be told from 0 is 0.
            let at = [x, y].map(|v| if v.abs() < 1e-12 { 0.0 } else { v });
            let corner = Corner { at, point };
            if triangles.insert(corner).is_err() {
                return Err(SteeringError::NoNumber(point));
            }
        }
        Ok(Self { points, triangles })
    }

    /// `[x, y, angle]` (m, m, rad).
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// Direction of family 1 at a place (rad, from x).
    pub fn angle_at(&self, at: Point) -> f64 {
        let place = Point2::new(at[0], at[1]);
        match self.triangles.locate(place) {
            PositionInTriangulation::OnVertex(v) => {
                let corner = *self.triangles.vertex(v).data();
                self.points[corner.point][2]
            }
            PositionInTriangulation::OnFace(face) => {
                let face = self.triangles.face(face);
                let mut corners = face.vertices().map(|v| *v.data());
                corners.sort_unstable_by_key(|c| c.point);
                let [a, b, c] = corners.map(|c| c.at);
                let weights = [cross(b, c, at), cross(c, a, at), cross(a, b, at)];
                let whole = cross(a, b, c);
                self.mixed(&[0, 1, 2].map(|k| (corners[k].point, weights[k] / whole)))
            }
            PositionInTriangulation::OnEdge(edge) => {
                let edge = self.triangles.directed_edge(edge);
                self.on_edge(edge.vertices().map(|v| *v.data()), at)
            }
            _ => self.beyond(at),
        }
    }

    /// That of the nearest place of the triangulation's edge.
    fn beyond(&self, at: Point) -> f64 {
        let edges = self.triangles.convex_hull();
        let edges = edges.map(|e| {
            let mut ends = e.vertices().map(|v| *v.data());
            ends.sort_unstable_by_key(|c| c.point);
            ends
        });
        let off = |ends: &[Corner; 2]| segment_distance(at, ends[0].at, ends[1].at);
        // The first of equal ones, by the numbers of their points.
        let nearest = edges.min_by(|a, b| {
            let by_point = |c: &[Corner; 2]| c.map(|c| c.point);
            off(a)
                .total_cmp(&off(b))
                .then(by_point(a).cmp(&by_point(b)))
        });
        match nearest {
            Some(ends) => self.on_edge(ends, at),
            // One point alone.
            None => self.points[0][2],
        }
    }

    /// At the place of an edge that is nearest to `at`.
    fn on_edge(&self, mut ends: [Corner; 2], at: Point) -> f64 {
        ends.sort_unstable_by_key(|c| c.point);
        let [a, b] = ends.map(|c| c.at);
        let d = [b[0] - a[0], b[1] - a[1]];
        let along = (at[0] - a[0]) * d[0] + (at[1] - a[1]) * d[1];
        let share = (along / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
        self.mixed(&[(ends[0].point, 1.0 - share), (ends[1].point, share)])
    }

    /// Directions of points, by their shares. It is counted from the first of them: so equal directions give that direction, to the bit.
    fn mixed(&self, of: &[(usize, f64)]) -> f64 {
        let first = self.points[of[0].0][2];
        let (mut sine, mut cosine) = (0.0, 0.0);
        for (point, share) in of {
            let (s, c) = (2.0 * (self.points[*point][2] - first)).fixed_sin_cos();
            sine += share * s;
            cosine += share * c;
        }
        first + 0.5 * sine.fixed_atan2(cosine)
    }

    /// Neighbouring points whose directions differ by [`MOST_TURN`] or more, where a ply lies between them (`ply`: over the tool; left out: anywhere).
    /// The pair of the smallest numbers.
    pub fn sharp_turn(&self, ply: Option<&Region>) -> Option<SharpTurn> {
        let turn = |pair: [usize; 2]| {
            let (first, second) = (pair[0].min(pair[1]), pair[0].max(pair[1]));
            let apart = directions_apart(self.points[first][2], self.points[second][2]);
            // To rounding of degrees in radians.
            (apart > MOST_TURN - 1e-9).then_some(SharpTurn {
                first,
                second,
                apart,
            })
        };
        let mut found: Vec<SharpTurn> = Vec::new();
        for face in self.triangles.inner_faces() {
            let corners = face.vertices().map(|v| *v.data());
            let pairs = [[0, 1], [1, 2], [2, 0]].map(|p| p.map(|k| corners[k].point));
            let sharp: Vec<SharpTurn> = pairs.into_iter().filter_map(turn).collect();
            let there = || ply.is_none_or(|ply| overlaps(corners.map(|c| c.at), ply));
            if !sharp.is_empty() && there() {
                found.extend(sharp);
            }
        }
        let covered = ply.is_some_and(|ply| ply.contours().flatten().all(|p| self.holds(*p)));
        if !covered {
            let hull = self.triangles.convex_hull();
            let pairs = hull.map(|e| e.vertices().map(|v| v.data().point));
            found.extend(pairs.filter_map(turn));
        }
        found.into_iter().min_by_key(|t| [t.second, t.first])
    }

    /// Whether a place lies between the points, and not beyond them.
    fn holds(&self, [x, y]: Point) -> bool {
        !matches!(
            self.triangles.locate(Point2::new(x, y)),
            PositionInTriangulation::OutsideOfConvexHull(_)
                | PositionInTriangulation::NoTriangulation
        )
    }
}

/// Whether a triangle has a part of a region in it. One that touches its edge from outside has none: it is made smaller by a thousandth.
fn overlaps(corners: [Point; 3], region: &Region) -> bool {
    let [a, b, c] = corners;
    let middle = [0, 1].map(|k| (a[k] + b[k] + c[k]) / 3.0);
    let corners = corners.map(|p| [0, 1].map(|k| p[k] + 1e-3 * (middle[k] - p[k])));
    let [a, b, c] = corners;
    if corners.iter().chain([&middle]).any(|p| region.contains(*p)) {
        return true;
    }
    let inside = |p: &Point| {
        let turns = [cross(a, b, *p), cross(b, c, *p), cross(c, a, *p)];
        turns.iter().all(|t| *t > 0.0) || turns.iter().all(|t| *t < 0.0)
    };
    let crosses = |(p, q): (Point, Point)| {
        let apart = |r: Point, s: Point, t: Point, u: Point| {
            (cross(r, s, t) > 0.0) != (cross(r, s, u) > 0.0)
        };
        sides(&corners).any(|(r, s)| apart(r, s, p, q) && apart(p, q, r, s))
    };
    let mut contours = region.contours();
    contours.any(|contour| contour.iter().any(inside) || sides(contour).any(crosses))
}

/// Two of the points, in the order of their x, are at one place.
fn same_place(points: &[[f64; 3]], order: &[usize]) -> Result<(), SteeringError> {
    for (k, a) in order.iter().enumerate() {
        let p = points[*a];
        for b in &order[k + 1..] {
            let q = points[*b];
            if q[0] - p[0] > SAME_PLACE {
                break;
            }
            if (q[1] - p[1]).abs() <= SAME_PLACE {
                return Err(SteeringError::Same {
                    first: *a.min(b),
                    second: *a.max(b),
                    at: Millimetres([p[0], p[1]]),
                });
            }
        }
    }
    Ok(())
}

/// Direction (rad, from x) of the first axis of a ply whose fibre families lie at `fibre_1` and `fibre_2` (rad): that of the family
/// which the other follows counter-clockwise, so that the stitch lies between the first axis and the second. Elements and their
/// membrane forces have these axes, whichever way round the scene names the families.
///
/// ```
/// use plyflow_model::scene::first_axis;
/// let deg = f64::to_radians;
/// assert_eq!(first_axis(deg(-45.0), deg(45.0)), deg(-45.0));
/// assert_eq!(first_axis(deg(45.0), deg(-45.0)), deg(-45.0));
/// ```
pub fn first_axis(fibre_1: f64, fibre_2: f64) -> f64 {
    if (fibre_2 - fibre_1).fixed_sin() >= 0.0 {
        fibre_1
    } else {
        fibre_2
    }
}

/// How far (rad) the angle between the fibre families may be from a right one, or from another that a material tells: rounding of angles that are
/// written in degrees.
pub const SQUARE: f64 = 1e-6;

/// Directions of both fibre families of a flat ply.
#[derive(Debug, Clone, PartialEq)]
pub enum Laid {
    /// The same everywhere (rad, from x).
    Straight([f64; 2]),
    /// By place.
    Steered(Arc<SteeredField>),
}

impl Laid {
    /// Of points `[x, y, angle]` (m, m, rad) over the tool.
    ///
    /// # Errors
    /// As [`SteeredField::new`].
    pub fn steered(points: Vec<[f64; 3]>) -> Result<Self, SteeringError> {
        SteeredField::new(points).map(|field| Self::Steered(Arc::new(field)))
    }

    /// Directions of both families at a place of the flat ply (m, over the tool), from x (rad).
    pub fn at(&self, place: Point) -> [f64; 2] {
        match self {
            Self::Straight(fibres) => *fibres,
            Self::Steered(field) => {
                let first = field.angle_at(place);
                [first, first + FRAC_PI_2]
            }
        }
    }

    /// Direction of the first of the axes of elements and membrane forces at a place (rad, from x): [`first_axis`].
    pub fn axis_at(&self, place: Point) -> f64 {
        let [first, second] = self.at(place);
        first_axis(first, second)
    }

    /// Angle (rad, 0 to pi) from the first family to the second, counter-clockwise; `None` where they cross at a right angle.
    pub fn crossing(&self) -> Option<f64> {
        let Self::Straight([first, second]) = self else {
            return None;
        };
        let between = (second - first).rem_euclid(PI);
        ((between - FRAC_PI_2).abs() > SQUARE).then_some(between)
    }

    /// In the middle of a cell with these corners (m): the mean of them. Of the corners, x and y count.
    pub fn in_cell(&self, corners: &[[f64; 3]]) -> [f64; 2] {
        self.at(middle(corners))
    }

    /// As [`Laid::axis_at`], in the middle of a cell.
    pub fn axis_in_cell(&self, corners: &[[f64; 3]]) -> f64 {
        self.axis_at(middle(corners))
    }

    /// Those of a ply that is not steered.
    pub fn straight(&self) -> Option<[f64; 2]> {
        match self {
            Self::Straight(fibres) => Some(*fibres),
            Self::Steered(_) => None,
        }
    }
}

/// Mean of the corners of a cell (m).
fn middle(corners: &[[f64; 3]]) -> Point {
    let n = corners.len().max(1) as f64;
    [0, 1].map(|k| corners.iter().map(|c| c[k]).sum::<f64>() / n)
}

#[cfg(test)]
mod tests;
