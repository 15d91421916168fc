//! Outlines of blanks: polygons with holes, checked and brought to one form.

use plyflow_fixed::FixedBits;
use std::fmt;

/// A point in the plane (m).
pub type Point = [f64; 2];

/// Most corners of a contour: what is checked grows with their square.
pub const MOST_CORNERS: usize = 5000;

/// A flat region: a polygon with holes.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Corners of the outline (m), counter-clockwise seen from above, the first not repeated at the end.
    pub outline: Vec<Point>,
    /// Corners of the holes (m), clockwise.
    pub holes: Vec<Vec<Point>>,
}

/// Which contour of a sheet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ContourName {
    /// `outline`
    Outline,
    /// `holes[i]`
    Hole(usize),
}

impl fmt::Display for ContourName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Outline => write!(f, "outline"),
            Self::Hole(i) => write!(f, "holes[{i}]"),
        }
    }
}

/// Why contours bound no region.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OutlineError {
    /// A contour has fewer than three or too many corners.
    #[error("{contour} has {given} points; expected 3 to {MOST_CORNERS}")]
    Corners {
        /// Where.
        contour: ContourName,
        /// Number of points.
        given: usize,
    },
    /// Two neighbouring corners are the same.
    #[error(
        "points {first} and {second} of {contour} are the same; name every corner once (the contour closes by itself)"
    )]
    Repeated {
        /// Where.
        contour: ContourName,
        /// Number of a point from 0.
        first: usize,
        /// Number of the next one.
        second: usize,
    },
    /// A contour crosses or touches itself.
    #[error(
        "{contour} crosses or touches itself: its sides from point {first} and from point {second} meet at {at}; order the points \
         along the contour"
    )]
    Crossing {
        /// Where.
        contour: ContourName,
        /// Number, from 0, of the point where a side begins.
        first: usize,
        /// The same of the other side.
        second: usize,
        /// Where they meet.
        at: Millimetres,
    },
    /// A hole reaches beyond the outline.
    #[error(
        "{hole} crosses or touches the outline, or lies outside of it, at {at}; expected a hole inside of it"
    )]
    Outside {
        /// Which hole.
        hole: ContourName,
        /// A place where it does.
        at: Millimetres,
    },
    /// Two holes meet.
    #[error(
        "{hole} crosses, touches or lies within {other} at {at}; expected holes apart from each other"
    )]
    Holes {
        /// Which hole.
        hole: ContourName,
        /// The other one, of a lower number.
        other: ContourName,
        /// A place where they meet.
        at: Millimetres,
    },
    /// A contour is made by another step or drawn in a file, and has not been read.
    #[error("{contour} {why}")]
    NotRead {
        /// Where.
        contour: ContourName,
        /// What it is ([`crate::contour::Contour::unread`]).
        why: String,
    },
    /// Holes without an outline.
    #[error(
        "`holes` stand without `outline`; give a rectangle with holes as an outline of four points"
    )]
    HolesAlone,
    /// The sheet has a size twice.
    #[error(
        "`outline` stands beside `length` or `width`; expected an outline, or length and width of a rectangle"
    )]
    TwoSizes,
}

impl OutlineError {
    /// The contour to look at, when it is one.
    pub fn contour(&self) -> Option<ContourName> {
        match self {
            Self::Corners { contour, .. }
            | Self::NotRead { contour, .. }
            | Self::Repeated { contour, .. }
            | Self::Crossing { contour, .. } => Some(*contour),
            Self::Outside { hole, .. } | Self::Holes { hole, .. } => Some(*hole),
            Self::HolesAlone | Self::TwoSizes => None,
        }
    }
}

/// A point (m) that shows itself in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Millimetres(pub Point);

impl fmt::Display for Millimetres {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Adding 0 makes of -0 a 0.
        let [x, y] = self.0.map(|v| (1e5 * v).round() / 1e2 + 0.0);
        write!(f, "({x}, {y}) mm")
    }
}

/// The mirror image of a point in the plane x = 0 (`axis` 0) or y = 0 (1).
pub fn mirrored(mut point: Point, axis: usize) -> Point {
    point[axis] = -point[axis];
    point
}

/// How far (m) an edge may lie from its mirror image: what decimals of a scene leave.
pub const APART: f64 = 1e-7;

impl Region {
    /// A rectangle from x0, y0 to x1, y1 (m).
    pub fn rectangle([x0, y0, x1, y1]: [f64; 4]) -> Self {
        Self {
            outline: vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]],
            holes: Vec::new(),
        }
    }

    /// Checks the contours and turns them the right way round.
    ///
    /// # Errors
    /// When they bound no region.
    pub fn new(outline: Vec<Point>, holes: Vec<Vec<Point>>) -> Result<Self, OutlineError> {
        let mut region = Self { outline, holes };
        for (name, corners) in region.named() {
            check_contour(name, corners)?;
        }
        check_holes(&region)?;
        if signed_area(&region.outline) < 0.0 {
            region.outline.reverse();
        }
        for hole in &mut region.holes {
            if signed_area(hole) > 0.0 {
                hole.reverse();
            }
        }
        Ok(region)
    }

    /// Outline, then holes.
    pub fn contours(&self) -> impl Iterator<Item = &Vec<Point>> {
        std::iter::once(&self.outline).chain(&self.holes)
    }

    fn named(&self) -> impl Iterator<Item = (ContourName, &Vec<Point>)> {
        let holes = self.holes.iter().enumerate();
        std::iter::once((ContourName::Outline, &self.outline))
            .chain(holes.map(|(i, h)| (ContourName::Hole(i), h)))
    }

    /// The box around it: x0, y0, x1, y1 (m).
    pub fn bounds(&self) -> [f64; 4] {
        let none = [
            f64::INFINITY,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NEG_INFINITY,
        ];
        self.outline.iter().fold(none, |b, p| {
            [
                b[0].min(p[0]),
                b[1].min(p[1]),
                b[2].max(p[0]),
                b[3].max(p[1]),
            ]
        })
    }

    /// Area without the holes (m2).
    pub fn area(&self) -> f64 {
        // Holes run clockwise: theirs is negative.
        self.contours().map(|c| signed_area(c)).sum()
    }

    /// Whether a point lies inside (even-odd rule).
    pub fn contains(&self, p: Point) -> bool {
        self.contours().fold(false, |odd, c| odd != winds(c, p))
    }

    /// The corner whose mirror image in the plane x = 0 (`axis` 0) or y = 0 (1) lies furthest off all edges, and how far (m); `None` for a
    /// region that is its own image.
    pub fn asymmetry(&self, axis: usize) -> Option<(Point, f64)> {
        let off = |p: &Point| (*p, self.distance_to_edge(mirrored(*p, axis)));
        let worst = self.contours().flatten().map(off);
        let worst = worst.max_by(|a, b| a.1.total_cmp(&b.1));
        worst.filter(|(_, apart)| *apart > APART)
    }

    /// Distance of a point from the nearest contour (m).
    pub fn distance_to_edge(&self, p: Point) -> f64 {
        self.contours()
            .flat_map(|c| sides(c))
            .map(|(a, b)| segment_distance(p, a, b))
            .fold(f64::INFINITY, f64::min)
    }
}

/// Sides of a contour.
pub fn sides(corners: &[Point]) -> impl Iterator<Item = (Point, Point)> + '_ {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(a, b)| (*a, *b))
}

/// Area inside a contour (m2), positive when it runs counter-clockwise.
pub fn signed_area(corners: &[Point]) -> f64 {
    // About the first corner: small contours far from the origin keep their digits.
    let o = corners.first().copied().unwrap_or_default();
    0.5 * sides(corners).map(|(a, b)| cross(o, a, b)).sum::<f64>()
}

/// Whether a point lies inside a contour (even-odd rule).
pub fn winds(corners: &[Point], [x, y]: Point) -> bool {
    sides(corners).fold(false, |odd, ([ax, ay], [bx, by])| {
        let crosses = (ay > y) != (by > y) && x < ax + (y - ay) / (by - ay) * (bx - ax);
        odd != crosses
    })
}

/// Distance of a point from a segment (m).
pub fn segment_distance(p: Point, a: Point, b: Point) -> f64 {
    let d = [b[0] - a[0], b[1] - a[1]];
    let square = d[0] * d[0] + d[1] * d[1];
    let along = (p[0] - a[0]) * d[0] + (p[1] - a[1]) * d[1];
    let t = if square > 0.0 {
        (along / square).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (p[0] - a[0] - t * d[0]).fixed_hypot(p[1] - a[1] - t * d[1])
}

/// Twice the area of a triangle, positive counter-clockwise (m2).
pub fn cross(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// Lengths below this share of a contour's size are rounding.
const ROUNDING: f64 = 1e-9;

/// Where two segments come together, when they do.
fn meeting((a, b): (Point, Point), (c, d): (Point, Point), near: f64) -> Option<Point> {
    let apart =
        |k: usize| a[k].min(b[k]) > c[k].max(d[k]) + near || c[k].min(d[k]) > a[k].max(b[k]) + near;
    if apart(0) || apart(1) {
        return None;
    }
    for (p, q, r) in [(a, c, d), (b, c, d), (c, a, b), (d, a, b)] {
        if segment_distance(p, q, r) <= near {
            return Some(p);
        }
    }
    let (c1, c2) = (cross(a, b, c), cross(a, b, d));
    let (d1, d2) = (cross(c, d, a), cross(c, d, b));
    if (c1 > 0.0) == (c2 > 0.0) || (d1 > 0.0) == (d2 > 0.0) {
        return None;
    }
    let t = d1 / (d1 - d2);
    Some([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])])
}

fn size(corners: &[Point]) -> f64 {
    let o = corners[0];
    corners
        .iter()
        .map(|p| (p[0] - o[0]).fixed_hypot(p[1] - o[1]))
        .fold(0.0, f64::max)
}

fn check_contour(contour: ContourName, corners: &[Point]) -> Result<(), OutlineError> {
    let n = corners.len();
    if !(3..=MOST_CORNERS).contains(&n) {
        return Err(OutlineError::Corners { contour, given: n });
    }
    let near = ROUNDING * size(corners);
    let all: Vec<_> = sides(corners).collect();
    for (i, (a, b)) in all.iter().enumerate() {
        if (a[0] - b[0]).fixed_hypot(a[1] - b[1]) <= near {
            return Err(OutlineError::Repeated {
                contour,
                first: i,
                second: (i + 1) % n,
            });
        }
    }
    let crossing = |first, second, at| OutlineError::Crossing {
        contour,
        first,
        second,
        at: Millimetres(at),
    };
    for i in 0..n {
        // Neighbours share a corner: they meet elsewhere only when the contour turns back on itself.
        let (a, b, c) = (all[i].0, all[i].1, all[(i + 1) % n].1);
        if segment_distance(c, a, b) <= near || segment_distance(a, b, c) <= near {
            return Err(crossing(i, (i + 1) % n, b));
        }
        for j in i + 2..n {
            if (j + 1) % n != i
                && let Some(at) = meeting(all[i], all[j], near)
            {
                return Err(crossing(i, j, at));
            }
        }
    }
    Ok(())
}

fn check_holes(region: &Region) -> Result<(), OutlineError> {
    let near = ROUNDING * size(&region.outline);
    let met = |a: &[Point], b: &[Point]| {
        sides(a).find_map(|s| sides(b).find_map(|t| meeting(s, t, near)))
    };
    for (i, hole) in region.holes.iter().enumerate() {
        let at = met(hole, &region.outline)
            .or_else(|| (!winds(&region.outline, hole[0])).then_some(hole[0]));
        if let Some(at) = at {
            return Err(OutlineError::Outside {
                hole: ContourName::Hole(i),
                at: Millimetres(at),
            });
        }
        for (j, other) in region.holes[..i].iter().enumerate() {
            let within = || {
                let of = |a: &[Point], b: &[Point]| winds(b, a[0]).then_some(a[0]);
                of(hole, other).or_else(|| of(other, hole))
            };
            if let Some(at) = met(hole, other).or_else(within) {
                return Err(OutlineError::Holes {
                    hole: ContourName::Hole(i),
                    other: ContourName::Hole(j),
                    at: Millimetres(at),
                });
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(centre: Point, half: f64) -> Vec<Point> {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
            .map(|p| [centre[0] + half * p[0], centre[1] + half * p[1]])
            .to_vec()
    }

    #[test]
    fn contours_are_turned_to_one_sense_whichever_way_they_are_given() {
        let hole = square([0.3, 0.2], 0.1);
        let given = Region::new(square([0.0; 2], 1.0), vec![hole.clone()]).unwrap();
        let turned = |mut c: Vec<Point>| {
            c.reverse();
            c
        };
        let other = Region::new(turned(square([0.0; 2], 1.0)), vec![turned(hole)]).unwrap();
        for region in [&given, &other] {
            assert!((region.area() - 3.96).abs() < 1e-12);
            assert!(signed_area(&region.outline) > 0.0 && signed_area(&region.holes[0]) < 0.0);
            assert!(region.contains([0.0; 2]) && !region.contains([0.3, 0.2]));
            assert!(!region.contains([1.1, 0.0]));
        }
        assert_eq!(given.bounds(), [-1.0, -1.0, 1.0, 1.0]);
        assert!((given.distance_to_edge([0.0, 0.2]) - 0.2).abs() < 1e-12);
    }

    #[test]
    fn what_bounds_no_region_is_refused_with_its_place() {
        let outline = || square([0.0; 2], 0.1);
        let text = |o: Vec<Point>, h: Vec<Vec<Point>>| Region::new(o, h).unwrap_err().to_string();
        let few = text(vec![[0.0; 2], [1.0, 0.0]], vec![]);
        assert!(
            few.contains("outline has 2 points") && few.contains("3 to"),
            "{few}"
        );
        let mut closed = outline();
        closed.push(closed[0]);
        let closed = text(closed, vec![]);
        assert!(
            closed.contains("points 4 and 0 of outline are the same"),
            "{closed}"
        );
        let bow = text(vec![[0.0, 0.0], [0.1, 0.1], [0.1, 0.0], [0.0, 0.1]], vec![]);
        assert!(bow.contains("from point 0 and from point 2"), "{bow}");
        assert!(bow.contains("(50, 50) mm"), "{bow}");
        let spike = text(
            vec![[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.1, 0.05]],
            vec![],
        );
        assert!(spike.contains("meet at (100, 100) mm"), "{spike}");
        let touching = vec![[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        assert!(text(touching, vec![]).contains("touches itself"));
        for place in [[0.1, 0.0], [0.3, 0.0]] {
            let out = text(outline(), vec![square([0.0; 2], 0.01), square(place, 0.01)]);
            assert!(out.contains("holes[1]") && out.contains("outline"), "{out}");
        }
        for (place, half) in [([0.01, 0.0], 0.01), ([0.0; 2], 0.005), ([0.0; 2], 0.05)] {
            let met = text(outline(), vec![square([0.0; 2], 0.02), square(place, half)]);
            assert!(
                met.contains("holes[1]") && met.contains("holes[0]"),
                "{met}"
            );
        }
    }
}
