//! Sketches of flat plies, all on one scale.

use crate::draw::{px, spot};
use crate::units::{number, quantity};
use maud::{Markup, html};
use plyflow_model::artifact::Sheet;
use plyflow_model::outline::{Point, signed_area};

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
            (&s.outline, &s.holes, &s.regions, s.fibres())
                == (&sheet.outline, &sheet.holes, &sheet.regions, sheet.fibres())
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
    let path = |line: &[Point]| -> String {
        let mut text = String::new();
        for (i, p) in line.iter().enumerate() {
            text += if i == 0 { "M" } else { "L" };
            text += &spot(page(*p));
        }
        text + "Z"
    };
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
                @for (family, angle) in sheet.fibres().into_iter().flatten().enumerate() { (direction(page(middle), w.min(h), family, angle)) }
                (dimensions([left, top, w, h], b))
            }
            figcaption { (names.join(", ")) @for r in &sheet.regions { "; " (r.name) ": " (region_text(r)) } }
        }
    }
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
