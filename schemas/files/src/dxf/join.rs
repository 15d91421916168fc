//! Curves that go on in each other, as closed contours.

use super::walk::Curve;
use crate::flaw::Flaw;
use plyflow_fixed::FixedBits;
use plyflow_model::outline::{MOST_CORNERS, Millimetres, OutlineError, Point, Region, signed_area};
use std::ops::Range;

/// Corners nearer to each other than this (m) are one.
const SAME: f64 = 1e-9;

/// Most corners of an outline and its holes together: how long it takes to see whether they cross grows with their square.
const MOST_IN_ALL: usize = 4 * MOST_CORNERS;

/// How curves become corners.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fineness {
    /// How far the ends of two curves may lie apart that go on in each other (m).
    pub tolerance: f64,
    /// How far a side may lie off a round curve (m).
    pub chord: f64,
}

impl Default for Fineness {
    fn default() -> Self {
        Self {
            tolerance: plyflow_model::contour::TOLERANCE.si(),
            chord: plyflow_model::contour::CHORD.si(),
        }
    }
}

/// An outline and its holes (m), in the order in which the file has their corners.
#[derive(Debug, Clone, PartialEq)]
pub struct Contours {
    /// The largest contour.
    pub outline: Vec<Point>,
    /// Those inside of it, in the order of the file.
    pub holes: Vec<Vec<Point>>,
}

impl Contours {
    /// With the middle of the box around the outline at (0, 0).
    #[must_use]
    pub fn centred(mut self) -> Self {
        let [low, high] = self.bounds();
        let middle = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
        for p in self
            .outline
            .iter_mut()
            .chain(self.holes.iter_mut().flatten())
        {
            *p = [p[0] - middle[0], p[1] - middle[1]];
        }
        self
    }

    /// The least and the largest x and y of the outline (m).
    pub fn bounds(&self) -> [Point; 2] {
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for p in &self.outline {
            for k in 0..2 {
                (low[k], high[k]) = (low[k].min(p[k]), high[k].max(p[k]));
            }
        }
        [low, high]
    }
}

/// A closed contour, and where it begins in its file.
pub struct Closed {
    /// Its corners (m).
    pub points: Vec<Point>,
    /// Where it begins.
    pub span: Range<usize>,
}

fn apart(a: Point, b: Point) -> f64 {
    (a[0] - b[0]).fixed_hypot(a[1] - b[1])
}

/// Without corners that repeat the one before.
fn distinct(mut points: Vec<Point>) -> Vec<Point> {
    points.dedup_by(|a, b| apart(*a, *b) <= SAME);
    while points.len() > 1 && apart(points[0], points[points.len() - 1]) <= SAME {
        points.pop();
    }
    points
}

/// The contours of curves.
pub(super) fn contours(curves: Vec<Curve>, tolerance: f64) -> Result<Contours, Flaw> {
    let (mut closed, mut open) = (Vec::new(), Vec::new());
    for mut curve in curves {
        curve.points.dedup_by(|a, b| apart(*a, *b) <= SAME);
        let [Some(first), Some(last)] = [curve.points.first(), curve.points.last()] else {
            continue;
        };
        let ends = apart(*first, *last);
        if curve.closed {
            closed.push(Closed {
                points: distinct(curve.points),
                span: curve.span,
            });
        } else if ends <= tolerance && curve.points.len() > 3 {
            closed.push(Closed {
                points: ring(&[&curve.points]),
                span: curve.span,
            });
        } else if curve.points.len() > 1 {
            open.push(curve);
        }
    }
    let (begin, count) = (open.first().map(|c| c.span.clone()), open.len());
    if count > MOST_CORNERS {
        let problem = format!("{count} curves are to be joined to contours");
        return Err(Flaw::at(begin.unwrap_or(0..0), problem)
            .expected(format!("at most {MOST_CORNERS}"))
            .help("join them in the drawing, or leave out what is no outline"));
    }
    closed.extend(joined(&open, tolerance)?);
    // In the order of the file, so that a hole keeps its number.
    closed.sort_by_key(|c| c.span.start);
    nested(closed)
}

/// The rings that open curves make.
fn joined(open: &[Curve], tolerance: f64) -> Result<Vec<Closed>, Flaw> {
    let partner = partners(open, tolerance)?;
    let mut used = vec![false; open.len()];
    let mut rings = Vec::new();
    for begin in 0..open.len() {
        if used[begin] {
            continue;
        }
        let (mut parts, mut end): (Vec<Vec<Point>>, usize) = (Vec::new(), 2 * begin + 1);
        loop {
            let curve = end / 2;
            used[curve] = true;
            let mut points = open[curve].points.clone();
            // Left at its last point, a curve is passed as it was drawn.
            if end % 2 == 0 {
                points.reverse();
            }
            parts.push(points);
            let entered = partner[end];
            if entered / 2 == begin {
                break;
            }
            end = entered ^ 1;
        }
        let parts: Vec<&Vec<Point>> = parts.iter().collect();
        rings.push(Closed {
            points: ring(&parts),
            span: open[begin].span.clone(),
        });
    }
    Ok(rings)
}

/// One contour of parts that follow each other; where two meet, their middle.
fn ring(parts: &[&Vec<Point>]) -> Vec<Point> {
    let mut points = Vec::new();
    for (k, part) in parts.iter().enumerate() {
        let before = parts[(k + parts.len() - 1) % parts.len()];
        let (end, begin) = (before[before.len() - 1], part[0]);
        points.push([0, 1].map(|c| 0.5 * (end[c] + begin[c])));
        points.extend(&part[1..part.len() - 1]);
    }
    distinct(points)
}

/// For each end (2 k: the first point of curve k, 2 k + 1: its last) the one that it meets.
fn partners(open: &[Curve], tolerance: f64) -> Result<Vec<usize>, Flaw> {
    let ends: Vec<Point> = open
        .iter()
        .flat_map(|c| [c.points[0], c.points[c.points.len() - 1]])
        .collect();
    // Ends in the order of x: only neighbours in it are looked at.
    let mut order: Vec<usize> = (0..ends.len()).collect();
    order.sort_by(|a, b| ends[*a][0].total_cmp(&ends[*b][0]).then(a.cmp(b)));
    let mut near: Vec<Vec<usize>> = vec![Vec::new(); ends.len()];
    for (i, &a) in order.iter().enumerate() {
        for &b in order[i + 1..]
            .iter()
            .take_while(|b| ends[**b][0] - ends[a][0] <= tolerance)
        {
            if near[a].len() < 12 && apart(ends[a], ends[b]) <= tolerance {
                near[a].push(b);
                near[b].push(a);
            }
        }
    }
    let mut partner = vec![0; ends.len()];
    for (k, all) in near.iter().enumerate() {
        let curve = &open[k / 2];
        let at = Millimetres(ends[k]);
        match all.as_slice() {
            [one] => partner[k] = *one,
            [] => {
                let others = (0..ends.len()).filter(|j| *j != k);
                let nearest = others
                    .min_by(|a, b| apart(ends[*a], ends[k]).total_cmp(&apart(ends[*b], ends[k])));
                let gap = nearest.map_or(String::new(), |j| {
                    format!(
                        "; the nearest other end is {} mm away",
                        (1e6 * apart(ends[j], ends[k])).round() / 1e3
                    )
                });
                let problem = format!(
                    "the contour is open: the {} that begins here ends at {at}{gap}",
                    curve.kind
                );
                return Err(Flaw::at(curve.span.clone(), problem)
                    .expected("closed contours")
                    .help("close it, or give a larger `tolerance`"));
            }
            several => {
                let problem = format!(
                    "{} curves meet at {at}, one of them the {} that begins here",
                    several.len() + 1,
                    curve.kind
                );
                return Err(Flaw::at(curve.span.clone(), problem)
                    .expected("two at each corner")
                    .help("remove what is drawn twice, put it on a layer of its own, or give a smaller `tolerance`"));
            }
        }
    }
    Ok(partner)
}

/// The largest of some contours with the others as its holes.
///
/// # Errors
/// When they bound no region.
pub fn nested(all: Vec<Closed>) -> Result<Contours, Flaw> {
    let count: usize = all.iter().map(|c| c.points.len()).sum();
    for one in &all {
        if !(3..=MOST_CORNERS).contains(&one.points.len()) {
            let problem = format!(
                "the contour that begins here has {} corners",
                one.points.len()
            );
            return Err(Flaw::at(one.span.clone(), problem)
                .expected(format!("3 to {MOST_CORNERS}"))
                .help("remove it, or give a larger `chord` where round curves have too many"));
        }
    }
    if count > MOST_IN_ALL {
        return Err(
            Flaw::whole(format!("the outline and its holes have {count} corners"))
                .expected(format!("at most {MOST_IN_ALL}")),
        );
    }
    let size = |c: &Closed| signed_area(&c.points).abs();
    let mut largest: Option<usize> = None;
    for (k, one) in all.iter().enumerate() {
        if largest.is_none_or(|l| size(one) > size(&all[l])) {
            largest = Some(k);
        }
    }
    let Some(largest) = largest else {
        return Err(Flaw::whole("there is no contour").expected("an outline"));
    };
    let spans: Vec<Range<usize>> = std::iter::once(largest)
        .chain((0..all.len()).filter(|k| *k != largest))
        .map(|k| all[k].span.clone())
        .collect();
    let mut found = Contours {
        outline: Vec::new(),
        holes: Vec::new(),
    };
    for (k, one) in all.into_iter().enumerate() {
        match k == largest {
            true => found.outline = one.points,
            false => found.holes.push(one.points),
        }
    }
    Region::new(found.outline.clone(), found.holes.clone()).map_err(|e| no_region(&e, &spans))?;
    Ok(found)
}

/// `spans`: of the outline, then of its holes.
fn no_region(error: &OutlineError, spans: &[Range<usize>]) -> Flaw {
    use plyflow_model::outline::ContourName::{Hole, Outline};
    let of = |c| match c {
        Outline => spans[0].clone(),
        Hole(i) => spans.get(i + 1).cloned().unwrap_or(0..0),
    };
    let span = error.contour().map_or(0..0, of);
    match error {
        OutlineError::Crossing { at, .. } => Flaw::at(span, format!("the contour that begins here crosses or touches itself at {at}")).help("draw it again without"),
        OutlineError::Outside { at, .. } => Flaw::at(span, format!("the contour that begins here crosses or touches the largest one, or lies outside of it, at {at}"))
            .expected("one outline with its holes")
            .help("put the outlines of other plies on layers, or into files, of their own"),
        OutlineError::Holes { at, .. } => Flaw::at(span, format!("the contour that begins here crosses or touches another hole, or lies within it, at {at}")).expected("holes apart from each other"),
        other => Flaw::at(span, format!("the contour that begins here: {other}")),
    }
}
