//! Rules of the regions of plies: each lies on its ply, does something, and does not contradict another one.

use crate::fault::{Fault, Path, Rule};
use crate::material::MaterialEntry;
use crate::nearest::nearest;
use crate::outline::{Millimetres, Point, cross, mirrored, segment_distance, sides, winds};
use crate::process::Process;
use crate::regions::{ALL, CLASSES, PlyRegion, RegionError, SAME_PLACE, Stitches, edge_distance};
use crate::rules::known::Known;
use crate::rules::surfaces::rigid_parts;
use crate::scene::{Sheet, SheetKind};

/// Inside, and not on a side.
fn within(corners: &[Point], at: Point) -> bool {
    winds(corners, at) && edge_distance(corners, at) > SAME_PLACE
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
    let off = |p: &Point| !winds(outline, *p) && edge_distance(outline, *p) > SAME_PLACE;
    let middles: Vec<Point> = sides(corners).map(middle).collect();
    let crossed = || sides(corners).find_map(|s| sides(outline).find_map(|t| crossing(s, t)));
    // What the outline cuts out of it has a corner of the outline inside of it.
    let notched = || outline.iter().copied().find(|p| within(corners, *p));
    (corners.iter().copied().chain(middles).find(off)).or_else(|| crossed().or_else(notched))
}

/// Corners of a ply's outline over the tool (m); `None` where it has none that is one (which others tell).
fn outline(sheet: &Sheet) -> Option<Vec<Point>> {
    sheet.footprint().ok()?.map(|region| region.outline)
}

/// What a ply may touch, with the class of each: its name in a region's friction.
fn partners(known: &Known<'_>) -> Vec<(String, &'static str)> {
    let sheet = |s: &&Sheet| {
        let class = match s.kind {
            SheetKind::Ply => CLASSES[0],
            SheetKind::Diaphragm => CLASSES[1],
        };
        (s.name.clone(), class)
    };
    let mut all: Vec<(String, &'static str)> = known.sheets.iter().flatten().map(sheet).collect();
    // In a bag no ply touches what is rigid.
    let rigid = known
        .process
        .filter(|p| !matches!(p, Process::DoubleDiaphragm(_)));
    if let Some(process) = rigid {
        let rigid = rigid_parts(process).into_iter();
        all.extend(rigid.map(|n| (n.to_owned(), CLASSES[2])));
    }
    all
}

/// A region with its corners over the tool (m).
type Placed<'a> = (&'a PlyRegion, Vec<Point>);

/// All that is wrong with the regions of a scene.
pub fn check(known: &Known<'_>) -> Vec<Fault> {
    let mut found = Vec::new();
    let partners = partners(known);
    // A name that could not be read is no partner that anybody could miss.
    let named = known.whole_stack().is_some() && known.process.is_some();
    for (s, sheet) in known.plies() {
        let mut before: Vec<Placed<'_>> = Vec::new();
        for (r, region) in sheet.regions.iter().enumerate() {
            let mut texts = Vec::new();
            if sheet.regions[..r].iter().any(|o| o.name == region.name) {
                texts.push(
                    "has the name of another region of the ply; give each a name of its own".into(),
                );
            }
            texts.extend(effects(sheet, region, named.then_some(&partners[..])));
            match region.corners(sheet.centre.map(|c| c.si())) {
                // What another step makes is looked at once it is there.
                Err(RegionError::NotRead(_)) => {}
                Err(why) => texts.push(why.to_string()),
                Ok(corners) => {
                    texts.extend(places(sheet, (region, &corners), &before, &partners));
                    before.push((region, corners));
                }
            }
            let path = Path::to("sheets").item(s).key("regions").item(r);
            found.extend(texts.into_iter().map(|text| {
                let text = format!("region '{}' of '{}' {text}", region.name, sheet.name);
                Fault::text(Rule::Region, path.clone(), text)
                    .help("places of a region are relative to its ply's `centre`")
            }));
        }
    }
    found
}

/// What is wrong with where a region lies: beyond its ply, or over one of those `before` that tells the same friction.
fn places(
    sheet: &Sheet,
    (region, corners): (&PlyRegion, &[Point]),
    before: &[Placed<'_>],
    partners: &[(String, &'static str)],
) -> Vec<String> {
    let mut wrong = Vec::new();
    if let Some(at) = outline(sheet).and_then(|o| beyond(corners, &o)) {
        wrong.push(format!(
            "reaches beyond the ply at {} (over the tool); expected a region on the ply",
            Millimetres(at)
        ));
    }
    for (other, theirs) in before {
        let shared = partners.iter().find(|(name, class)| {
            [region, other]
                .iter()
                .all(|r| r.coefficient(name, class).is_some())
        });
        let at = shared.and_then(|_| common(corners, theirs));
        if let (Some((name, _)), Some(at)) = (shared, at) {
            wrong.push(format!(
                "overlaps region '{}' at {} (over the tool), and both tell its friction with {name}; expected regions apart from each other, \
                 or with other partners",
                other.name,
                Millimetres(at)
            ));
        }
    }
    wrong
}

/// What is wrong with what a region does; `partners`: all that its ply may touch, if that is known.
fn effects(
    sheet: &Sheet,
    region: &PlyRegion,
    partners: Option<&[(String, &'static str)]>,
) -> Vec<String> {
    let mut wrong = Vec::new();
    if region.friction.is_empty() && region.stitches.is_none() {
        wrong.push("does nothing; expected `friction`, `stitches: removed` or both".into());
    }
    for key in region.friction.keys() {
        let Some(partners) = partners else { break };
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
    }
    if let (Some(Stitches::Removed), MaterialEntry::Inline(material)) =
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

/// The first region of a ply without a mirror image in the plane x = 0 (`axis` 0) or y = 0 (1): one, itself perhaps, of the same shape that
/// does the same.
pub fn asymmetric(sheet: &Sheet, axis: usize) -> Option<&PlyRegion> {
    let centre = sheet.centre.map(|c| c.si());
    let placed: Vec<Placed<'_>> = (sheet.regions.iter())
        .filter_map(|r| Some((r, r.corners(centre).ok()?)))
        .collect();
    let lie_on = |points: &[Point], other: &[Point]| {
        points
            .iter()
            .all(|p| edge_distance(other, *p) <= SAME_PLACE)
    };
    let alone = |(region, corners): &&Placed<'_>| {
        let image: Vec<Point> = corners.iter().map(|p| mirrored(*p, axis)).collect();
        !placed.iter().any(|(other, theirs)| {
            other.friction == region.friction
                && other.stitches == region.stitches
                && lie_on(&image, theirs)
                && lie_on(theirs, &image)
        })
    };
    placed.iter().find(alone).map(|(region, _)| *region)
}

#[cfg(test)]
mod tests;
