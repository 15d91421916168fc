//! Lines of steered fibres: curves that follow the directions of a flat ply, and where the formed ply carries them.
//!
//! A curve starts at each multiple of a distance along the one that crosses all of them, square to them, through the middle of the ply. From there on
//! it follows its direction both ways: curves come nearer to each other where steering brings them together. Where they leave a gap, or a hole of the ply
//! does, more begin.

use crate::net::{Fibre, MOST, Net, TooMany, fibres, rounded_up};
use crate::vec3::{Vec3, add_scaled, scaled};
use plyflow_fixed::FixedBits;
use plyflow_model::outline::{Point, cross};
use plyflow_model::steering::Laid;
use std::collections::BTreeMap;

/// Most steps of a curve to one side: one that turns about a point goes round it for ever.
const MOST_STEPS: usize = 20_000;

/// Halvings by which the place is found where a curve leaves the ply.
const HALVINGS: usize = 40;

/// Where curves are drawn.
pub struct Field<'a> {
    /// Directions of the families, by place in metres.
    pub laid: &'a Laid,
    /// Units of the places here in a metre.
    pub scale: f64,
    /// How far a step along a curve goes.
    pub step: f64,
    /// Whether a place lies on the ply.
    pub inside: &'a dyn Fn(Point) -> bool,
    /// Places all over the ply, the first of them in its middle.
    pub places: &'a [Point],
}

impl Field<'_> {
    /// Direction of a family at a place, turned to that side of `before` that is nearer.
    fn direction(&self, at: Point, family: usize, before: Point) -> Point {
        let angle = self.laid.at(at.map(|v| v / self.scale))[family];
        let (sin, cos) = angle.fixed_sin_cos();
        match cos * before[0] + sin * before[1] < 0.0 {
            true => [-cos, -sin],
            false => [cos, sin],
        }
    }

    /// Where a step along a family leads, and with which direction, by the fourth order rule of Runge and Kutta. `before`: the direction so far.
    fn stepped(&self, at: Point, before: Point, family: usize, step: f64) -> (Point, Point) {
        let ahead = |d: Point, share: f64| [0, 1].map(|i| at[i] + share * step * d[i]);
        let a = self.direction(at, family, before);
        let b = self.direction(ahead(a, 0.5), family, a);
        let c = self.direction(ahead(b, 0.5), family, b);
        let d = self.direction(ahead(c, 1.0), family, c);
        let mean = [0, 1].map(|i| (a[i] + 2.0 * (b[i] + c[i]) + d[i]) / 6.0);
        (ahead(mean, 1.0), d)
    }

    /// From a place along a family, to the side of `towards`: up to the edge of the ply, or round to the beginning. And whether it came to the edge.
    fn followed(&self, from: Point, family: usize, towards: Point) -> (Vec<Point>, bool) {
        let mut line = vec![from];
        let (mut at, mut before) = (from, self.direction(from, family, towards));
        for k in 0..MOST_STEPS {
            let (next, direction) = self.stepped(at, before, family, self.step);
            if !(self.inside)(next) {
                let (mut short, mut long) = (0.0, self.step);
                for _ in 0..HALVINGS {
                    let step = 0.5 * (short + long);
                    match (self.inside)(self.stepped(at, before, family, step).0) {
                        true => short = step,
                        false => long = step,
                    }
                }
                if short > 0.0 {
                    line.push(self.stepped(at, before, family, short).0);
                }
                return (line, true);
            }
            (at, before) = (next, direction);
            let back = (at[0] - from[0]).fixed_hypot(at[1] - from[1]);
            if k > 3 && back < 0.6 * self.step {
                line.push(from);
                break;
            }
            line.push(at);
        }
        (line, false)
    }

    /// Both ways from a place, as one line.
    fn through(&self, from: Point, family: usize) -> Vec<Point> {
        let along = self.direction(from, family, [1.0, 0.0]);
        let (ahead, ends) = self.followed(from, family, along);
        if !ends {
            // Round to its beginning, or on for ever.
            return ahead;
        }
        let (back, _) = self.followed(from, family, along.map(|v| -v));
        let mut line: Vec<Point> = back.into_iter().rev().collect();
        line.pop();
        line.extend(ahead);
        line
    }

    /// Curves of a family: at multiples of `distance` along the curve that crosses them in the middle of the ply, and then through each place that is farther
    /// than that from all curves before it.
    ///
    /// # Errors
    /// When there would be too many.
    pub fn curves(&self, family: usize, distance: f64) -> Result<Vec<Vec<Point>>, TooMany> {
        let Some(middle) = self.places.first() else {
            return Ok(Vec::new());
        };
        let along = self.direction(*middle, family, [1.0, 0.0]);
        let across = [-along[1], along[0]];
        let sides = [across, across.map(|v| -v)].map(|t| self.followed(*middle, 1 - family, t).0);
        let lengths = sides.each_ref().map(|s| self.step * (s.len() - 1) as f64);
        let too_many = |lines: f64| TooMany {
            lines,
            most: MOST,
            would: rounded_up(lines / MOST as f64 * distance),
        };
        let lines = (lengths[0] + lengths[1]) / distance;
        if lines > MOST as f64 {
            return Err(too_many(lines));
        }
        let [ahead, back] = &sides;
        let mut starts: Vec<Point> = self.starts(back, distance).into_iter().skip(1).collect();
        starts.reverse();
        starts.extend(self.starts(ahead, distance));
        starts.retain(|p| (self.inside)(*p));
        let mut near = Near::new(distance);
        let mut all = Vec::new();
        for (k, place) in starts.iter().chain(self.places).enumerate() {
            if k >= starts.len() && near.any(*place) {
                continue;
            }
            if all.len() >= MOST {
                return Err(too_many(2.0 * MOST as f64));
            }
            let line = self.through(*place, family);
            line.iter().for_each(|p| near.add(*p));
            all.push(line);
        }
        Ok(all)
    }

    /// Places at multiples of a distance along a curve.
    fn starts(&self, curve: &[Point], distance: f64) -> Vec<Point> {
        let count = (self.step * (curve.len() - 1) as f64 / distance) as usize;
        let place = |k: usize| {
            let steps = k as f64 * distance / self.step;
            let i = (steps as usize).min(curve.len().saturating_sub(2));
            let share = steps - i as f64;
            let next = curve[(i + 1).min(curve.len() - 1)];
            [0, 1].map(|d| curve[i][d] + share * (next[d] - curve[i][d]))
        };
        (0..=count).map(place).collect()
    }
}

/// Whether there are places nearer than a distance.
struct Near {
    distance: f64,
    bins: BTreeMap<[i64; 2], Vec<Point>>,
}

impl Near {
    fn new(distance: f64) -> Self {
        let bins = BTreeMap::new();
        Self { distance, bins }
    }

    fn bin(&self, p: Point) -> [i64; 2] {
        p.map(|v| (v / self.distance).floor() as i64)
    }

    fn add(&mut self, p: Point) {
        let bin = self.bin(p);
        self.bins.entry(bin).or_default().push(p);
    }

    fn any(&self, p: Point) -> bool {
        let [i, j] = self.bin(p);
        let around = (i - 1..=i + 1).flat_map(|i| (j - 1..=j + 1).map(move |j| [i, j]));
        let mut places = around.filter_map(|b| self.bins.get(&b)).flatten();
        places.any(|q| (q[0] - p[0]).fixed_hypot(q[1] - p[1]) < self.distance)
    }
}

/// The pieces of a curve that lie where `place` finds something, cut where that begins and ends.
pub fn pieces<T: Clone>(curve: &[Point], place: impl Fn(Point) -> Option<T>) -> Vec<Vec<T>> {
    let mut found: Vec<Vec<T>> = Vec::new();
    let mut open: Vec<T> = Vec::new();
    let mut before: Option<(Point, bool)> = None;
    // The last place that is found on the way from one that is to one that is not.
    let edge = |mut inside: Point, mut outside: Point| {
        for _ in 0..HALVINGS {
            let middle = [0, 1].map(|d| 0.5 * (inside[d] + outside[d]));
            match place(middle).is_some() {
                true => inside = middle,
                false => outside = middle,
            }
        }
        place(inside)
    };
    for &p in curve {
        let here = place(p);
        match (before, &here) {
            (Some((q, false)), Some(_)) => open.extend(edge(p, q)),
            (Some((q, true)), None) => open.extend(edge(q, p)),
            _ => {}
        }
        before = Some((p, here.is_some()));
        match here {
            Some(found) => open.push(found),
            None if !open.is_empty() => found.push(std::mem::take(&mut open)),
            None => {}
        }
    }
    found.push(open);
    found.retain(|line| line.len() > 1);
    found
}

/// Finds the cell that a place of the flat ply lies in.
struct Locator<'a> {
    net: &'a Net<'a>,
    size: f64,
    bins: BTreeMap<[i64; 2], Vec<usize>>,
}

/// Shares of a triangle's corners that are this far below 0 are rounding.
const ROUNDING: f64 = 1e-9;

impl<'a> Locator<'a> {
    fn new(net: &'a Net<'a>, size: f64) -> Self {
        let mut bins: BTreeMap<[i64; 2], Vec<usize>> = BTreeMap::new();
        let bin = |v: f64| (v / size).floor() as i64;
        for &cell in net.through {
            let [x0, y0, x1, y1] = around(net, [cell].iter());
            for i in bin(x0)..=bin(x1) {
                for j in bin(y0)..=bin(y1) {
                    bins.entry([i, j]).or_default().push(cell);
                }
            }
        }
        Self { net, size, bins }
    }

    /// The place in the flat and in the formed ply, in the two triangles of a cell of four corners.
    fn locate(&self, p: Point) -> Option<[Vec3; 2]> {
        let key = p.map(|v| (v / self.size).floor() as i64);
        let cells = self.bins.get(&key)?;
        cells.iter().find_map(|cell| {
            let corners = self.net.corners(*cell);
            (1..corners.len() - 1).find_map(|k| {
                let of = [corners[0], corners[k], corners[k + 1]];
                let [a, b, c] = of.map(|i| {
                    let q = self.net.flat[i as usize];
                    [q[0], q[1]]
                });
                let whole = cross(a, b, c);
                let shares = [cross(b, c, p), cross(c, a, p), cross(a, b, p)].map(|w| w / whole);
                let inside = whole != 0.0 && shares.iter().all(|w| *w > -ROUNDING);
                let at = |points: &[Vec3]| {
                    let [x, y, z] = of.map(|i| points[i as usize]);
                    add_scaled(add_scaled(scaled(shares[0], x), shares[1], y), shares[2], z)
                };
                inside.then(|| [at(self.net.flat), at(self.net.formed)])
            })
        })
    }
}

/// The box around cells: x0, y0, x1, y1.
fn around<'c>(net: &Net<'_>, cells: impl Iterator<Item = &'c usize>) -> [f64; 4] {
    let none = [
        f64::INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
    ];
    let nodes = cells.flat_map(|c| net.corners(*c));
    nodes.fold(none, |b, i| {
        let p = net.flat[*i as usize];
        [
            b[0].min(p[0]),
            b[1].min(p[1]),
            b[2].max(p[0]),
            b[3].max(p[1]),
        ]
    })
}

/// Lines of a family (0 or 1) as a ply was laid: straight ones as [`fibres()`] has them, and curves where the fibres are steered. `scale`: units of
/// the points in a metre.
///
/// # Errors
/// When there would be too many.
pub fn laid_fibres(
    net: &Net<'_>,
    (laid, scale): (&Laid, f64),
    family: usize,
    distance: f64,
) -> Result<Vec<Fibre>, TooMany> {
    match laid {
        Laid::Straight(angles) => fibres(net, angles[family], distance),
        Laid::Steered(_) => steered(net, (laid, scale), family, distance),
    }
}

/// Lines of a family of steered fibres on a ply, `distance` apart where they cross the one through its middle. `scale`: units of the points in a metre.
///
/// # Errors
/// When there would be too many.
fn steered(
    net: &Net<'_>,
    (laid, scale): (&Laid, f64),
    family: usize,
    distance: f64,
) -> Result<Vec<Fibre>, TooMany> {
    if net.through.is_empty() {
        return Ok(Vec::new());
    }
    let area: f64 = net.through.iter().map(|c| flat_area(net, *c)).sum();
    let size = (area / net.through.len() as f64).sqrt();
    if size <= 0.0 {
        return Ok(Vec::new());
    }
    let locator = Locator::new(net, size);
    let field = Field {
        laid,
        scale,
        step: 0.5 * size.min(distance),
        inside: &|p| locator.locate(p).is_some(),
        places: &middles(net),
    };
    let mut lines = Vec::new();
    for curve in field.curves(family, distance)? {
        for piece in pieces(&curve, |p| locator.locate(p)) {
            lines.push(Fibre {
                flat: piece.iter().map(|p| p[0]).collect(),
                formed: piece.iter().map(|p| p[1]).collect(),
            });
        }
    }
    Ok(lines)
}

/// Middles of all cells, that nearest to the middle of the ply first.
fn middles(net: &Net<'_>) -> Vec<Point> {
    let middle = |cell: &usize| {
        let corners = net.corners(*cell);
        let sum = |d: usize| {
            corners
                .iter()
                .map(|i| net.flat[*i as usize][d])
                .sum::<f64>()
        };
        [0, 1].map(|d| sum(d) / corners.len() as f64)
    };
    let mut all: Vec<Point> = net.through.iter().map(middle).collect();
    let [x0, y0, x1, y1] = around(net, net.through.iter());
    let off = |p: &Point| (p[0] - 0.5 * (x0 + x1)).fixed_hypot(p[1] - 0.5 * (y0 + y1));
    let first = (0..all.len()).min_by(|a, b| off(&all[*a]).total_cmp(&off(&all[*b])));
    if let Some(first) = first {
        all.swap(0, first);
    }
    all
}

/// Area of a flat cell.
fn flat_area(net: &Net<'_>, cell: usize) -> f64 {
    let corners = net.corners(cell);
    let at = |k: usize| {
        let p = net.flat[corners[k] as usize];
        [p[0], p[1]]
    };
    let triangles = (1..corners.len() - 1).map(|k| cross(at(0), at(k), at(k + 1)));
    0.5 * triangles.sum::<f64>().abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    /// A ring of cells from 0.1 to 0.2 m about (0, 0), formed into a cone; fibres on circles.
    struct Ring {
        flat: Vec<Vec3>,
        formed: Vec<Vec3>,
        cells: Vec<u32>,
        laid: Laid,
    }

    const ACROSS: u32 = 10;
    const ROUND: u32 = 72;

    impl Ring {
        fn new() -> Self {
            let at = |i: u32, j: u32| {
                let turn = std::f64::consts::TAU * f64::from(j) / f64::from(ROUND);
                let r = 0.1 + 0.1 * f64::from(i) / f64::from(ACROSS);
                [r * turn.cos(), r * turn.sin(), 0.0]
            };
            let flat: Vec<Vec3> = (0..=ACROSS)
                .flat_map(|i| (0..ROUND).map(move |j| at(i, j)))
                .collect();
            let node = |i: u32, j: u32| i * ROUND + j % ROUND;
            let cells = (0..ACROSS).flat_map(|i| {
                (0..ROUND).flat_map(move |j| {
                    [
                        node(i, j),
                        node(i + 1, j),
                        node(i + 1, j + 1),
                        node(i, j + 1),
                    ]
                })
            });
            let formed = flat.iter().map(|p| [p[0], p[1], 2.0 * p[0].hypot(p[1])]);
            let points = flat
                .iter()
                .map(|p| [p[0], p[1], p[1].atan2(p[0]) + FRAC_PI_2]);
            Self {
                formed: formed.collect(),
                cells: cells.collect(),
                laid: Laid::steered(points.collect()).unwrap(),
                flat,
            }
        }

        fn lines(&self, family: usize, distance: f64) -> Vec<Fibre> {
            let through: Vec<usize> = (0..self.cells.len() / 4).collect();
            let net = Net {
                flat: &self.flat,
                formed: &self.formed,
                cells: &self.cells,
                corners: 4,
                through: &through,
            };
            steered(&net, (&self.laid, 1.0), family, distance).unwrap()
        }
    }

    /// The table has a point each 5 degrees: by the bound of its interpolation (`plyflow_model::steering`) directions are off by less than
    /// 0.56 (0.01 / 0.1)2 = 0.006 rad. On a quarter of a circle that makes a radius that changes by less than 1 %.
    #[test]
    fn fibres_on_circles_are_drawn_as_circles_and_their_neighbours_as_rays() {
        let ring = Ring::new();
        let rings = ring.lines(0, 0.02);
        assert!(rings.len() >= 4, "{}", rings.len());
        for line in &rings {
            let radius = |p: &Vec3| p[0].hypot(p[1]);
            let first = radius(&line.flat[0]);
            // A turn of it, 6.3 times the radius, by less than 1 % for each quarter.
            assert!(
                line.flat
                    .iter()
                    .all(|p| (radius(p) / first - 1.0).abs() < 0.04)
            );
            let length: f64 = line
                .flat
                .windows(2)
                .map(|w| (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]))
                .sum();
            assert!(length < 6.5 * first, "it goes round more than once");
            for (flat, formed) in line.flat.iter().zip(&line.formed) {
                // On the facets of the cone.
                assert!((formed[2] - 2.0 * radius(flat)).abs() < 0.01 * radius(flat));
            }
        }
    }

    #[test]
    fn lines_that_all_points_lay_straight_are_straight_and_leave_no_gap() {
        let mut ring = Ring::new();
        let points = ring.flat.iter().map(|p| [p[0], p[1], 0.3]).collect();
        ring.laid = Laid::steered(points).unwrap();
        let lines = ring.lines(0, 0.02);
        let (sin, cos) = 0.3f64.sin_cos();
        let height = |p: &Vec3| cos * p[1] - sin * p[0];
        for line in &lines {
            let off = |p: &Vec3| (height(p) - height(&line.flat[0])).abs();
            assert!(line.flat.iter().all(|p| off(p) < 1e-12));
            // To the edge of the ring, which has 72 corners, and not beyond it.
            let ends = [line.flat[0], line.flat[line.flat.len() - 1]];
            for end in ends.map(|p| p[0].hypot(p[1])) {
                let near = |r: f64| (end - r).abs() < 1e-3 * r;
                assert!(near(0.1) || near(0.2), "{end}");
            }
        }
        for p in &ring.flat {
            let near = |q: &Vec3| (q[0] - p[0]).hypot(q[1] - p[1]) < 0.027;
            assert!(lines.iter().any(|l| l.flat.iter().any(near)), "{p:?}");
        }
    }

    #[test]
    fn more_lines_than_there_may_be_are_refused() {
        let ring = Ring::new();
        let field = Field {
            laid: &ring.laid,
            scale: 1.0,
            step: 0.005,
            inside: &|p| (0.1..0.2).contains(&p[0].hypot(p[1])),
            places: &[[0.15, 0.0]],
        };
        assert!(field.curves(0, 1e-6).unwrap_err().would > 1e-6);
    }
}
