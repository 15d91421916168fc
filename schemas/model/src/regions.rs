//! Regions of plies: places on the flat ply with another friction, or without stitches.

use crate::friction::Coefficient;
use crate::nearest::nearest;
use crate::outline::{Millimetres, OutlineError, Point, cross, segment_distance, sides, winds};
use crate::outline::{Region, signed_area};
use crate::scene::{Contour, Process, Scene, Sheet, SheetKind};
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
    #[schemars(extend("x-expected" = "a list of points, [[x, y], ..], or {circle: {radius: ..}}"))]
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

impl PlyRegion {
    /// Its corners over the tool (m), for a ply of this centre (m), counter-clockwise.
    ///
    /// # Errors
    /// When it is no region: without a shape, with two, or with one that crosses itself.
    pub fn corners(&self, centre: Point) -> Result<Vec<Point>, String> {
        let own = match (&self.polygon, &self.rectangle) {
            (Some(polygon), None) => polygon.corners(),
            (None, Some(r)) => {
                let ([x, y], (s, c)) = (r.centre.map(|v| v.si()), r.angle.si().fixed_sin_cos());
                let (l, w) = (0.5 * r.length.si(), 0.5 * r.width.si());
                let corner = |[u, v]: Point| [x + c * u - s * v, y + s * u + c * v];
                [[-l, -w], [l, -w], [l, w], [-l, w]].map(corner).to_vec()
            }
            (None, None) => {
                return Err("has no shape; expected a `polygon` or a `rectangle`".into());
            }
            (Some(_), Some(_)) => {
                return Err("has a `polygon` and a `rectangle`; expected one of the two".into());
            }
        };
        let placed = own.iter().map(|p| [p[0] + centre[0], p[1] + centre[1]]);
        let region = Region::new(placed.collect(), Vec::new());
        region.map(|r| r.outline).map_err(|e| in_words(&e))
    }

    /// The coefficient that it has for the surface `partner` of the class `class`.
    pub fn coefficient(&self, partner: &str, class: &str) -> Option<&Coefficient> {
        let of = |key: &str| self.friction.get(key);
        of(partner).or_else(|| of(class)).or_else(|| of(ALL))
    }
}

/// What an outline's error says of a region's polygon.
fn in_words(error: &OutlineError) -> String {
    let text = error.to_string();
    format!(
        "has no area of its own: {}",
        text.replace("outline", "polygon")
    )
}

/// Whether a region of these corners (m) holds a place of the flat ply (m).
pub fn holds(corners: &[Point], at: Point) -> bool {
    winds(corners, at) || distance(corners, at) <= SAME_PLACE
}

/// From the nearest side (m).
fn distance(corners: &[Point], at: Point) -> f64 {
    let apart = sides(corners).map(|(a, b)| segment_distance(at, a, b));
    apart.fold(f64::INFINITY, f64::min)
}

/// Inside, and not on a side.
fn within(corners: &[Point], at: Point) -> bool {
    winds(corners, at) && distance(corners, at) > SAME_PLACE
}

fn middle((a, b): (Point, Point)) -> Point {
    [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])]
}

/// Where two sides cross, each well inside of the other.
fn crossing((a, b): (Point, Point), (c, d): (Point, Point)) -> Option<Point> {
    let ends = [
        segment_distance(a, c, d),
        segment_distance(b, c, d),
        segment_distance(c, a, b),
        segment_distance(d, a, b),
    ];
    let opposite = |p: f64, q: f64| (p > 0.0) != (q > 0.0);
    let (p, q) = (cross(c, d, a), cross(c, d, b));
    let meet = opposite(p, q) && opposite(cross(a, b, c), cross(a, b, d));
    (meet && ends.iter().all(|e| *e > SAME_PLACE)).then(|| {
        let t = p / (p - q);
        [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
    })
}

/// A place of a polygon that lies in another one too, not only on its sides.
fn common(a: &[Point], b: &[Point]) -> Option<Point> {
    let of = |from: &[Point], to: &[Point]| {
        let middles = sides(from).map(middle).collect::<Vec<_>>();
        let found = from.iter().copied().chain(middles);
        found.chain(inner(from)).find(|p| within(to, *p))
    };
    let crossed = || sides(a).find_map(|s| sides(b).find_map(|t| crossing(s, t)));
    crossed().or_else(|| of(a, b)).or_else(|| of(b, a))
}

/// A place inside of a polygon: the middle of a triangle of three corners that lies in it.
fn inner(corners: &[Point]) -> Option<Point> {
    let n = corners.len();
    let ear = |k: usize| {
        let [a, b, c] = [0, 1, 2].map(|d| corners[(k + d) % n]);
        [0, 1].map(|d| (a[d] + b[d] + c[d]) / 3.0)
    };
    (0..n).map(ear).find(|p| within(corners, *p))
}

/// A place of a polygon that does not lie on a ply of this outline.
fn beyond(corners: &[Point], outline: &[Point]) -> Option<Point> {
    let off = |p: &Point| !winds(outline, *p) && distance(outline, *p) > SAME_PLACE;
    let middles: Vec<Point> = sides(corners).map(middle).collect();
    let crossed = || sides(corners).find_map(|s| sides(outline).find_map(|t| crossing(s, t)));
    // What the outline cuts out of it has a corner of the outline inside of it.
    let notched = || outline.iter().copied().find(|p| within(corners, *p));
    (corners.iter().copied().chain(middles).find(off)).or_else(|| crossed().or_else(notched))
}

/// What is wrong with a region of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Number of the sheet.
    pub sheet: usize,
    /// Number of its region.
    pub region: usize,
    /// What is wrong, and what is expected.
    pub text: String,
}

/// Corners of a ply's outline over the tool (m); `None` where it has none that is one (which others tell).
fn outline(sheet: &Sheet) -> Option<Vec<Point>> {
    if let Ok(Some(region)) = sheet.region() {
        return Some(region.outline);
    }
    let (l, w) = (0.5 * sheet.length?.si(), 0.5 * sheet.width?.si());
    let [x, y] = sheet.centre.map(|c| c.si());
    Some(vec![
        [x - l, y - w],
        [x + l, y - w],
        [x + l, y + w],
        [x - l, y + w],
    ])
}

/// What a ply may touch, with the class of each: its name in a region's friction.
fn partners(scene: &Scene) -> Vec<(String, &'static str)> {
    let sheet = |s: &Sheet| {
        let class = match s.kind {
            SheetKind::Ply => CLASSES[0],
            SheetKind::Diaphragm => CLASSES[1],
        };
        (s.name.clone(), class)
    };
    let mut all: Vec<(String, &'static str)> = scene.sheets.iter().map(sheet).collect();
    if let Process::Press(press) = &scene.process {
        let holder = press.holder.as_ref().map(|_| "holder");
        let rigid = ["tool", "die"].into_iter().chain(holder);
        all.extend(rigid.map(|n| (n.to_owned(), CLASSES[2])));
    }
    all
}

/// All that is wrong with the regions of a scene.
pub fn faults(scene: &Scene) -> Vec<Fault> {
    let mut found = Vec::new();
    let partners = partners(scene);
    for (s, sheet) in scene.sheets.iter().enumerate() {
        let mut before: Vec<(&PlyRegion, Vec<Point>)> = Vec::new();
        for (r, region) in sheet.regions.iter().enumerate() {
            let mut fault = |text: String| {
                found.push(Fault {
                    sheet: s,
                    region: r,
                    text: format!("region '{}' of '{}' {text}", region.name, sheet.name),
                });
            };
            if sheet.kind != SheetKind::Ply {
                fault("belongs to a diaphragm; only plies have regions".into());
                continue;
            }
            if sheet.regions[..r].iter().any(|o| o.name == region.name) {
                fault(
                    "has the name of another region of the ply; give each a name of its own".into(),
                );
            }
            effects(sheet, region, &partners)
                .into_iter()
                .for_each(&mut fault);
            let corners = match region.corners(sheet.centre.map(|c| c.si())) {
                Ok(corners) => corners,
                Err(text) => {
                    fault(text);
                    continue;
                }
            };
            if let Some(at) = outline(sheet).and_then(|o| beyond(&corners, &o)) {
                fault(format!(
                    "reaches beyond the ply at {} (over the tool); expected a region on the ply. Its places are relative to the ply's `centre`",
                    Millimetres(at)
                ));
            }
            for (other, theirs) in &before {
                let shared = partners.iter().find(|(name, class)| {
                    [region, other]
                        .iter()
                        .all(|r| r.coefficient(name, class).is_some())
                });
                let at = shared.and_then(|_| common(&corners, theirs));
                if let (Some((name, _)), Some(at)) = (shared, at) {
                    fault(format!(
                        "overlaps region '{}' at {} (over the tool), and both tell its friction with {name}; expected regions apart from each other, \
                         or with other partners",
                        other.name,
                        Millimetres(at)
                    ));
                }
            }
            before.push((region, corners));
        }
    }
    found
}

/// What is wrong with what a region does.
fn effects(sheet: &Sheet, region: &PlyRegion, partners: &[(String, &'static str)]) -> Vec<String> {
    let mut wrong = Vec::new();
    if region.friction.is_empty() && region.stitches.is_none() {
        wrong.push("does nothing; expected `friction`, `stitches: removed` or both".into());
    }
    for (key, coefficient) in &region.friction {
        let words = || {
            [ALL]
                .into_iter()
                .chain(CLASSES)
                .filter(|w| *w == ALL || partners.iter().any(|p| p.1 == *w))
        };
        let names = || partners.iter().map(|p| p.0.as_str()).chain(words());
        if words().any(|w| w == key) && partners.iter().any(|p| p.0 == *key) {
            wrong.push(format!("has friction with '{key}', which is the name of a sheet and a word for several surfaces; give the sheet another name"));
        }
        if !names().any(|n| n == key) {
            let hint =
                nearest(key, names()).map_or(String::new(), |n| format!("; did you mean '{n}'?"));
            let all: Vec<&str> = names().collect();
            wrong.push(format!("has friction with '{key}', which no ply of this scene touches; expected some of: {}{hint}", all.join(", ")));
        }
        if let Coefficient::Constant(c) = coefficient
            && !(0.0..=2.0).contains(&c.0)
        {
            wrong.push(format!(
                "has a coefficient of {} with '{key}'; expected one from 0 to 2",
                c.0
            ));
        }
    }
    if let (Some(Stitches::Removed), crate::material::MaterialEntry::Inline(material)) =
        (region.stitches, &sheet.material)
        && material
            .with
            .get("stitch")
            .is_none_or(serde_json::Value::is_null)
    {
        wrong.push(format!(
            "removes stitches, and the material '{}' has no `stitch`; leave `stitches` out",
            material.name
        ));
    }
    wrong
}

/// Why the regions of a ply are not their own mirror image in the plane x = 0 (`axis` 0) or y = 0 (1), if they are not: for every region there must be
/// one, itself perhaps, that is its image and does the same.
pub fn asymmetry(sheet: &Sheet, axis: usize) -> Option<String> {
    let centre = sheet.centre.map(|c| c.si());
    let placed: Vec<(&PlyRegion, Vec<Point>)> = (sheet.regions.iter())
        .filter_map(|r| Some((r, r.corners(centre).ok()?)))
        .collect();
    let lie_on = |points: &[Point], other: &[Point]| {
        points.iter().all(|p| distance(other, *p) <= SAME_PLACE)
    };
    placed.iter().find_map(|(region, corners)| {
        let image: Vec<Point> = (corners.iter())
            .map(|p| {
                let mut q = *p;
                q[axis] = -q[axis];
                q
            })
            .collect();
        let same = |(other, theirs): &&(&PlyRegion, Vec<Point>)| {
            other.friction == region.friction
                && other.stitches == region.stitches
                && lie_on(&image, theirs)
                && lie_on(theirs, &image)
        };
        let plane = ["x", "y"][axis];
        placed.iter().find(same).is_none().then(|| {
            format!(
                "region '{}' of ply '{}' has no mirror image in the plane {plane} = 0 (a region of the same shape that does the same); move it, add its image, \
                 or leave `{plane}` out of `symmetry`",
                region.name, sheet.name
            )
        })
    })
}

/// Area of a polygon (m2).
pub fn area(corners: &[Point]) -> f64 {
    signed_area(corners).abs()
}

#[cfg(test)]
mod tests;
