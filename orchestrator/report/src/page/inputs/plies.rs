//! Sketches of flat plies, all on one scale.

use crate::draw::{px, spot};
use crate::units::{number, quantity};
use maud::{Markup, html};
use plyflow_export::{Field, pieces};
use plyflow_model::artifact::Sheet;
use plyflow_model::outline::{Point, Region, signed_area};
use plyflow_model::steering::Laid;

/// Width on the page of the largest ply (px), and the most of its height.
const ROOM: [f64; 2] = [330.0, 250.0];
/// Around a sketch, for dimensions (px): left, top, right, below.
const AROUND: [f64; 4] = [44.0, 14.0, 14.0, 34.0];
/// Sketches; of more plies the table tells.
const MOST: usize = 24;

/// Smallest and largest x and y of the outline (m).
fn bounds(outline: &[Point]) -> [f64; 4] {
    let none = [
        f64::INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
    ];
    outline.iter().fold(none, |b, p| {
        [
            b[0].min(p[0]),
            b[1].min(p[1]),
            b[2].max(p[0]),
            b[3].max(p[1]),
        ]
    })
}

/// Length and width: `480 x 300 mm`.
pub(super) fn size(sheet: &Sheet) -> Option<String> {
    let [x0, y0, x1, y1] = bounds(sheet.outline.as_ref()?);
    let mm = |v: f64| number(v * 1e3, 5);
    Some(format!("{} × {} mm", mm(x1 - x0), mm(y1 - y0)))
}

/// Without its holes (m2).
pub(super) fn area(sheet: &Sheet) -> Option<f64> {
    let holes: f64 = sheet.holes.iter().map(|h| signed_area(h).abs()).sum();
    Some(signed_area(sheet.outline.as_ref()?).abs() - holes)
}

/// A sketch of each ply; of those that are alike in all, one.
pub(super) fn sketches(sheets: &[Sheet]) -> Markup {
    let mut all: Vec<(&Sheet, Vec<&str>)> = Vec::new();
    for sheet in sheets.iter().filter(|s| s.is_ply() && s.outline.is_some()) {
        let alike = |(s, _): &&mut (&Sheet, Vec<&str>)| {
            let flat = |s: &Sheet| (s.fibre_1, s.fibre_2);
            (
                &s.outline,
                &s.holes,
                &s.regions,
                &s.tied_to,
                &s.steering,
                flat(s),
            ) == (
                &sheet.outline,
                &sheet.holes,
                &sheet.regions,
                &sheet.tied_to,
                &sheet.steering,
                flat(sheet),
            )
        };
        match all.iter_mut().find(alike) {
            Some((_, names)) => names.push(&sheet.name),
            None => all.push((sheet, vec![&sheet.name])),
        }
    }
    let spans = all
        .iter()
        .filter_map(|(s, _)| s.outline.as_deref())
        .map(bounds);
    let largest = spans.fold([1e-9; 2], |m: [f64; 2], b| {
        [m[0].max(b[2] - b[0]), m[1].max(b[3] - b[1])]
    });
    // Pixels for a metre, for all of them.
    let scale = (ROOM[0] / largest[0]).min(ROOM[1] / largest[1]);
    html! {
        @if !all.is_empty() {
            div class="sketches" { @for (sheet, names) in all.iter().take(MOST) { (sketch(sheet, names, scale)) } }
            p class="note" { "All on one scale, seen from above, x to the right; dimensions in mm, angles of fibres from x. "
                @if all.len() > MOST { "The first " (MOST) " of " (all.len()) " that differ." } }
        }
    }
}

fn sketch(sheet: &Sheet, names: &[&str], scale: f64) -> Markup {
    let outline = sheet.outline.as_deref().unwrap_or_default();
    let b = bounds(outline);
    let [left, top, right, below] = AROUND;
    let (w, h) = ((b[2] - b[0]) * scale, (b[3] - b[1]) * scale);
    let page = |p: Point| [left + (p[0] - b[0]) * scale, top + (b[3] - p[1]) * scale];
    let open = |line: &[Point]| -> String {
        let mut text = String::new();
        for (i, p) in line.iter().enumerate() {
            text += if i == 0 { "M" } else { "L" };
            text += &spot(page(*p));
        }
        text
    };
    let path = |line: &[Point]| open(line) + "Z";
    let laid = sheet.laid();
    let whole: String = std::iter::once(outline)
        .chain(sheet.holes.iter().map(Vec::as_slice))
        .map(path)
        .collect();
    let middle = [0.5 * (b[0] + b[2]), 0.5 * (b[1] + b[3])];
    let what = format!(
        "Flat ply {}, {}",
        names.join(", "),
        size(sheet).unwrap_or_default()
    );
    html! {
        figure class="sketch" {
            svg viewBox={ "0 0 " (px(w + left + right)) " " (px(h + top + below)) } width=(px(w + left + right)) height=(px(h + top + below)) role="img" aria-label=(what) {
                path class="sketch-ply" fill-rule="evenodd" d=(whole) {}
                @for region in &sheet.regions {
                    path class="sketch-region" d=(path(&region.outline)) {}
                    @let at = page(centre(&region.outline));
                    text class="tick" x=(px(at[0])) y=(px(at[1] + 4.0)) text-anchor="middle" { (region.name) }
                }
                @if let Some(Laid::Straight(fibres)) = &laid {
                    @for (family, angle) in fibres.iter().enumerate() { (direction(page(middle), w.min(h), family, *angle)) }
                }
                @if let Some(laid @ Laid::Steered(_)) = &laid {
                    @for family in 0..2 {
                        path class=(format!("line c{family}")) d=(curves(sheet, laid, family).iter().map(|l| open(l)).collect::<String>()) {}
                    }
                }
                (dimensions([left, top, w, h], b))
            }
            figcaption { (names.join(", ")) @if let Some(below) = &sheet.tied_to { ", tied to " (below) } @for r in &sheet.regions { "; " (r.name) ": " (region_text(r)) } }
        }
    }
}

/// Places across the longer side of a ply that curves are begun from.
const PLACES: usize = 40;
/// Curves of a family across the longer side of a ply, about.
const CURVES: f64 = 9.0;

/// Lines of a family of steered fibres on the flat ply (m).
fn curves(sheet: &Sheet, laid: &Laid, family: usize) -> Vec<Vec<Point>> {
    let region = Region {
        outline: sheet.outline.clone().unwrap_or_default(),
        holes: sheet.holes.clone(),
    };
    let [x0, y0, x1, y1] = bounds(&region.outline);
    let room = (x1 - x0).max(y1 - y0);
    let at = |i: usize, low: f64| low + room * (i as f64 + 0.5) / PLACES as f64;
    let all = (0..PLACES).flat_map(|i| (0..PLACES).map(move |j| [at(i, x0), at(j, y0)]));
    let mut places: Vec<Point> = all.filter(|p| region.contains(*p)).collect();
    let off = |p: &Point| (p[0] - 0.5 * (x0 + x1)).hypot(p[1] - 0.5 * (y0 + y1));
    places.sort_by(|a, b| off(a).total_cmp(&off(b)));
    let field = Field {
        laid,
        scale: 1.0,
        step: room / 150.0,
        inside: &|p| region.contains(p),
        places: &places,
    };
    let found = field.curves(family, room / CURVES).unwrap_or_default();
    let inside = |p: Point| region.contains(p).then_some(p);
    found.iter().flat_map(|c| pieces(c, inside)).collect()
}

fn centre(line: &[Point]) -> Point {
    let n = line.len().max(1) as f64;
    [0, 1].map(|d| line.iter().map(|p| p[d]).sum::<f64>() / n)
}

fn region_text(r: &plyflow_model::artifact::RegionFacts) -> String {
    let mut parts = Vec::new();
    if !r.friction.is_empty() {
        parts.push(format!("other friction against {}", r.friction.join(", ")));
    }
    parts.extend(r.stitches.map(|_| "stitches removed".to_owned()));
    parts.join(", ")
}

/// A line with an arrow along a fibre family, and its angle.
fn direction(at: [f64; 2], room: f64, family: usize, angle: f64) -> Markup {
    let (sin, cos) = angle.sin_cos();
    let length = 0.36 * room;
    let end = |s: f64| [at[0] + s * length * cos, at[1] - s * length * sin];
    let (tail, head) = (end(-1.0), end(1.0));
    // Both barbs of the head.
    let barb = |turn: f64| {
        let (s, c) = (angle + turn).sin_cos();
        [head[0] - 8.0 * c, head[1] + 8.0 * s]
    };
    let name = end(1.0 + 15.0 / length.max(1.0));
    let class = format!("line c{family}");
    html! {
        path class=(class) d={ "M" (spot(tail)) "L" (spot(head)) "M" (spot(barb(0.4))) "L" (spot(head)) "L" (spot(barb(-0.4))) } {}
        text class="over" x=(px(name[0])) y=(px(name[1] + 4.0)) text-anchor=(if cos < -0.3 { "end" } else if cos > 0.3 { "start" } else { "middle" }) {
            (family + 1) ": " (quantity(angle, "rad", 4)) }
    }
}

/// Length below and width at the left, with their lines; where the ply lies over the tool.
fn dimensions([left, top, w, h]: [f64; 4], b: [f64; 4]) -> Markup {
    let mm = |v: f64| number(v * 1e3, 5);
    let (y, x) = (top + h + 12.0, left - 10.0);
    let middle = top + h / 2.0;
    html! {
        path class="axis" d={ "M" (px(left)) " " (px(y - 4.0)) "v8M" (px(left + w)) " " (px(y - 4.0)) "v8M" (px(left)) " " (px(y)) "h" (px(w)) } {}
        text class="tick" x=(px(left + w / 2.0)) y=(px(y + 15.0)) text-anchor="middle" { (mm(b[2] - b[0])) " (x " (mm(b[0])) " … " (mm(b[2])) ")" }
        path class="axis" d={ "M" (px(x - 4.0)) " " (px(top)) "h8M" (px(x - 4.0)) " " (px(top + h)) "h8M" (px(x)) " " (px(top)) "v" (px(h)) } {}
        text class="tick" x=(px(x - 8.0)) y=(px(middle)) text-anchor="middle" transform={ "rotate(-90 " (px(x - 8.0)) " " (px(middle)) ")" } {
            (mm(b[3] - b[1])) " (y " (mm(b[1])) " … " (mm(b[3])) ")" }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_model::scene::SheetKind;

    /// A ply of 200 x 100 mm with a hole, whose fibres lie on circles about (-0.15, 0) m.
    fn steered() -> Sheet {
        let corner = |x: f64, y: f64| [0.1 * x, 0.05 * y];
        let at = |k: i32| f64::from(k) * 0.01;
        let places = (-11..=11).flat_map(|i| (-6..=6).map(move |j| [at(i), at(j)]));
        let across = std::f64::consts::FRAC_PI_2;
        let points = places.map(|[x, y]| [x, y, y.atan2(x + 0.15) + across]);
        Sheet {
            outline: Some(vec![
                corner(-1.0, -1.0),
                corner(1.0, -1.0),
                corner(1.0, 1.0),
                corner(-1.0, 1.0),
            ]),
            holes: vec![vec![[0.0, 0.0], [0.0, 0.02], [0.02, 0.02], [0.02, 0.0]]],
            steering: Some(points.collect()),
            ..Sheet::new("ply_1", SheetKind::Ply, 4e-4, 2e-4)
        }
    }

    #[test]
    fn curves_of_a_steered_ply_follow_its_fibres_and_stay_on_it() {
        let sheet = steered();
        let laid = sheet.laid().unwrap();
        for family in 0..2 {
            let lines = curves(&sheet, &laid, family);
            assert!(lines.len() > 5, "{}", lines.len());
            for line in &lines {
                let polar = |p: &Point| [(p[0] + 0.15).hypot(p[1]), p[1].atan2(p[0] + 0.15)];
                let tolerance = [0.02 * polar(&line[0])[0], 0.02][family];
                for p in line {
                    assert!(p[0].abs() < 0.1 + 1e-9 && p[1].abs() < 0.05 + 1e-9, "{p:?}");
                    let in_hole = [0, 1].iter().all(|d| (1e-6..0.02 - 1e-6).contains(&p[*d]));
                    assert!(!in_hole, "{p:?}");
                    // On a circle the radius stays, on a ray the angle.
                    let off = polar(p)[family] - polar(&line[0])[family];
                    assert!(off.abs() < tolerance, "family {family}: {off}");
                }
            }
        }
        let drawn = sketches(&[
            sheet.clone(),
            Sheet {
                name: "ply_2".into(),
                ..sheet
            },
        ])
        .into_string();
        assert!(drawn.contains("line c0") && drawn.contains("line c1"));
        assert!(
            drawn.contains("ply_1, ply_2"),
            "alike in all, and drawn once"
        );
        let mut other = steered();
        other.steering.as_mut().unwrap()[0][2] += 0.1;
        other.name = "ply_2".into();
        let drawn = sketches(&[steered(), other]).into_string();
        assert!(!drawn.contains("ply_1, ply_2"));
    }
}
