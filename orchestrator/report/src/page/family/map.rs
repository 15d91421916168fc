//! A response over two variables: colours and lines of equal value between the computed points, which are drawn on top.

use crate::draw::{
    CHARACTER, Camera, Canvas, Corner, DrawError, Drawn, LEAST, Paint, Palette, Plane,
    Scale as Colours, Surface, Triangles, bar, contour, px, spot, ticks,
};
use crate::family::Fate;
use crate::page::family::shown::{LINKED, Shown, range_of};
use crate::plain::Cells;
use crate::units::{number, plural, shown as unit_of};
use maud::{Markup, html};
use std::fmt::Write;

/// Maps of one pair of variables, one for each combination of what the others are.
const PANELS: usize = 6;
/// Pairs of variables of which maps are drawn.
const PAIRS: usize = 6;
/// Lines of equal value, about.
const LEVELS: usize = 8;

const SIZE: [f64; 2] = [440.0, 350.0];
const RIGHT: f64 = 16.0;
const TOP: f64 = 12.0;
const BOTTOM: f64 = 42.0;
/// A text on a line is this far from every other (px).
const APART: f64 = 46.0;
/// And from every point, across and up.
const CLEAR: [f64; 2] = [13.0, 10.0];

/// The maps of a response, or why there is none.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn maps(shown: &Shown<'_>, response: usize, values: &[Option<f64>]) -> Drawn {
    let numeric: Vec<usize> = (shown.varied.iter().copied())
        .filter(|v| shown.levels[*v].numbers().is_some())
        .collect();
    let pairs = (0..numeric.len()).flat_map(|i| (i + 1..numeric.len()).map(move |j| [i, j]));
    let pairs: Vec<[usize; 2]> = pairs.map(|p| p.map(|i| numeric[i])).collect();
    let Some(colours) = colours(values) else {
        return Ok(html! {});
    };
    let (mut drawn, mut not) = (Vec::new(), Vec::new());
    for pair in &pairs {
        match of_pair(shown, response, *pair, values, colours)? {
            Ok(map) if drawn.len() < PAIRS => drawn.push(map),
            Ok(_) => not.push((pair, "there is no room for more".to_owned())),
            Err(why) => not.push((pair, why)),
        }
    }
    let response = &shown.family.responses[response];
    let (factor, _) = unit_of(&response.unit);
    let hash = plyflow_artifact::seal::hash(response.name.as_bytes());
    let id = format!("map-scale-{}", hash.split_at(10).0);
    // Of many pairs that have no map for one reason it is told once.
    let mut whys: Vec<(String, Vec<String>)> = Vec::new();
    for (pair, why) in not {
        let names = shown.names(pair);
        match whys.iter_mut().find(|w| w.0 == why) {
            Some(w) => w.1.push(names),
            None => whys.push((why, vec![names])),
        }
    }
    Ok(html! {
        @if !drawn.is_empty() {
            (bar(&id, colours, factor, &[], &format!("Scale of the maps: {}", response.titled())))
            @for map in &drawn { (map) }
        }
        @for (why, pairs) in &whys {
            p class="note" { "No map over " @if pairs.len() > 3 { (plural(pairs.len(), "pair", "pairs")) " of variables" } @else { (pairs.join("; ")) } ": " (why) "." }
        }
    })
}

/// The colours of all maps of a response; `None` when it is the same everywhere.
fn colours(values: &[Option<f64>]) -> Option<Colours> {
    let [low, high] = range_of(values);
    let size = low.abs().max(high.abs());
    if low >= high || low.is_infinite() {
        return None;
    }
    Some(if low < 0.0 && high > 0.0 {
        Colours::about_zero(Palette::PurpleOrange, size)
    } else {
        let palette = Palette::Viridis;
        Colours { palette, low, high }
    })
}

/// The maps over a pair of variables, or why not.
fn of_pair(
    shown: &Shown<'_>,
    response: usize,
    pair: [usize; 2],
    values: &[Option<f64>],
    colours: Colours,
) -> Result<Result<Markup, String>, DrawError> {
    let others = shown.others(&pair);
    let planes = Plane::all(&shown.levels, pair);
    let kept: Vec<&Plane> = (planes.iter())
        .filter(|p| p.is_mapped(values).is_ok())
        .collect();
    if kept.is_empty() {
        let known = |p: &&Plane| p.points.iter().filter(|i| values[**i].is_some()).count();
        let best = planes.iter().max_by_key(known);
        let why = match best.filter(|p| others.is_empty() || known(p) >= LEAST) {
            Some(plane) => plane.is_mapped(values).err().unwrap_or_default(),
            None => {
                "points that differ in these two alone are too few, as other variables differ too"
                    .into()
            }
        };
        return Ok(Err(why));
    }
    let mut panels = Vec::new();
    for plane in kept.iter().take(PANELS) {
        let map = Map {
            shown,
            pair,
            plane,
            values,
            colours,
            factor: unit_of(&shown.family.responses[response].unit).0,
        };
        panels.push((
            map.svg(response)?,
            shown.family.said(plane.points[0], &others),
        ));
    }
    let [a, b] = pair.map(|v| &shown.family.variables[v].name);
    Ok(Ok(html! {
        h4 { (shown.family.responses[response].titled()) " over " (a) " and " (b) }
        div class="plots" {
            @for (svg, said) in &panels {
                figure class="plot" { @if !said.is_empty() { p class="plot-title" { (said) } } (svg) }
            }
        }
        @if kept.len() > PANELS { p class="note" { "The first " (PANELS) " of " (kept.len()) " planes." } }
        @if kept.len() < planes.len() { p class="note" { "On " (plural(planes.len() - kept.len(), "other plane", "other planes")) " there are too few points for a map." } }
    }))
}

struct Map<'a> {
    shown: &'a Shown<'a>,
    pair: [usize; 2],
    plane: &'a Plane,
    values: &'a [Option<f64>],
    colours: Colours,
    factor: f64,
}

impl Map<'_> {
    fn svg(&self, response: usize) -> Drawn {
        let [w, h] = SIZE;
        let [across, up] = self.pair.map(|v| &self.shown.scales[v]);
        let widest = up.ticks.iter().map(|t| t.1.chars().count()).max();
        let left = 34.0 + CHARACTER * widest.unwrap_or(1) as f64;
        let field = [w - RIGHT - left, h - BOTTOM - TOP];
        let x = |place: f64| left + place * field[0];
        let y = |place: f64| TOP + (1.0 - place) * field[1];
        let place = [
            across.at.iter().map(|a| x(*a)).collect::<Vec<f64>>(),
            up.at.iter().map(|a| y(*a)).collect::<Vec<f64>>(),
        ];
        let triangles = self.plane.triangles(self.values, &place);
        let image = self.image(&triangles, left, field)?;
        let points = self.plane.points.iter();
        let known = points.filter(|p| self.values[**p].is_some()).count();
        let said = format!(
            "Map of {} over {} and {}: {} on it. The numbers are in the table of points.",
            self.shown.family.responses[response].name,
            across.title,
            up.title,
            plural(known, "computed point", "computed points")
        );
        let (bottom, right) = (h - BOTTOM, w - RIGHT);
        let middle = (TOP + bottom) / 2.0;
        Ok(html! {
            svg viewBox={ "0 0 " (px(w)) " " (px(h)) } role="img" aria-label=(said) {
                rect class="map-field" x=(px(left)) y=(px(TOP)) width=(px(field[0])) height=(px(field[1])) {}
                image href=(image) x=(px(left)) y=(px(TOP)) width=(px(field[0])) height=(px(field[1])) {}
                (self.lines(&triangles, &place))
                path class="axis" d={ "M" (px(left)) " " (px(TOP)) "V" (px(bottom)) "H" (px(right)) } {}
                @for (at, text) in &across.ticks {
                    path class="axis" d={ "M" (px(x(*at))) " " (px(bottom)) "v4" } {}
                    text class="tick" x=(px(x(*at))) y=(px(bottom + 16.0)) text-anchor="middle" { (text) }
                }
                @for (at, text) in &up.ticks {
                    path class="axis" d={ "M" (px(left)) " " (px(y(*at))) "h-4" } {}
                    text class="tick" x=(px(left - 7.0)) y=(px(y(*at) + 4.0)) text-anchor="end" { (text) }
                }
                text class="tick" x=(px((left + right) / 2.0)) y=(px(h - 6.0)) text-anchor="middle" { (across.title) }
                text class="tick" x="12" y=(px(middle)) text-anchor="middle" transform={ "rotate(-90 12 " (px(middle)) ")" } { (up.title) }
                (self.marks(&place))
            }
        })
    }

    /// The colours between the points.
    fn image(
        &self,
        triangles: &[[Corner; 3]],
        left: f64,
        field: [f64; 2],
    ) -> Result<String, DrawError> {
        // Of the page down, of the canvas up.
        let points: Vec<[f64; 3]> = (triangles.iter().flatten())
            .map(|c| [c[0] - left, TOP + field[1] - c[1], 0.0])
            .collect();
        let values: Vec<f64> = triangles.iter().flatten().map(|c| c[2]).collect();
        let cells = Cells {
            nodes: (0..points.len() as u32).collect(),
            each: 3,
        };
        let around = [[0.0, 0.0, 0.0], [field[0], field[1], 0.0]];
        let (camera, size) = Camera::plan().fit(around.iter(), field, 0.0);
        let mut canvas = Canvas::new(size);
        let mesh = Triangles::new(points.len(), &cells);
        let paint = Paint::Field(&values, self.colours);
        canvas.surface(&camera, &Surface::new(&points, &mesh, paint));
        Ok(canvas.data_url()?)
    }

    /// Lines of equal value, with their values where there is room.
    fn lines(&self, triangles: &[[Corner; 3]], place: &[Vec<f64>; 2]) -> Markup {
        let points = self.plane.points.iter();
        let points: Vec<[f64; 2]> = points.map(|p| self.at(place, *p)).collect();
        let known = || self.values.iter().flatten().map(|v| v * self.factor);
        let (low, high) = (
            known().fold(f64::INFINITY, f64::min),
            known().fold(f64::NEG_INFINITY, f64::max),
        );
        let levels = (ticks(low, high, LEVELS).into_iter()).filter(|l| *l > low && *l < high);
        let mut path = String::new();
        let mut texts: Vec<([f64; 2], String)> = Vec::new();
        for level in levels {
            let pieces = contour(triangles, level / self.factor);
            for [a, b] in &pieces {
                let _ = write!(path, "M{}L{}", spot(*a), spot(*b));
            }
            let far = |p: [f64; 2]| {
                let others = (texts.iter()).map(|(at, _)| (at[0] - p[0]).hypot(at[1] - p[1]));
                others.fold(f64::INFINITY, f64::min)
            };
            let inside = |p: [f64; 2]| {
                p[0] > 70.0
                    && p[0] < SIZE[0] - 40.0
                    && p[1] > TOP + 12.0
                    && p[1] < SIZE[1] - BOTTOM - 8.0
            };
            let middle = |[a, b]: &[[f64; 2]; 2]| [0, 1].map(|d| 0.5 * (a[d] + b[d]));
            let clear = |p: [f64; 2]| {
                let near = |at: &[f64; 2]| {
                    (at[0] - p[0]).abs() < CLEAR[0] && (at[1] - p[1]).abs() < CLEAR[1]
                };
                !points.iter().any(near)
            };
            let best = (pieces
                .iter()
                .map(middle)
                .filter(|p| inside(*p) && clear(*p)))
            .map(|p| (p, far(p).min(2.0 * APART)))
            .reduce(|a, b| if b.1 > a.1 { b } else { a });
            if let Some((at, _)) = best.filter(|b| b.1 >= APART) {
                texts.push((at, number(level, 4)));
            }
        }
        html! {
            @if !path.is_empty() { path class="contour-halo" d=(path) {} path class="contour" d=(path) {} }
            @for (at, text) in &texts { text class="over level" x=(px(at[0])) y=(px(at[1] + 4.0)) text-anchor="middle" { (text) } }
        }
    }

    /// The points: computed ones in the colour of their own value, failed ones as crosses.
    fn marks(&self, place: &[Vec<f64>; 2]) -> Markup {
        let family = self.shown.family;
        if self.plane.points.len() > LINKED {
            return self.small_marks(place);
        }
        html! {
            @for p in &self.plane.points {
                @let [x, y] = self.at(place, *p);
                a href=[self.shown.address(*p)] tabindex="-1" {
                    @match (self.values[*p], &family.points[*p].fate) {
                        (Some(v), _) => circle class="computed" cx=(px(x)) cy=(px(y)) r="4" fill=(self.colour(v)) {},
                        (None, Fate::Failed { .. }) => {
                            @let d = format!("M{} {}m-4.5-4.5l9 9m0-9l-9 9", px(x), px(y));
                            path class="cross-halo" d=(d) {} path class="cross" d=(d) {}
                        },
                        (None, _) => circle class="open-point" cx=(px(x)) cy=(px(y)) r="4" {},
                    }
                }
            }
        }
    }

    /// The same of so many that each has little room.
    fn small_marks(&self, place: &[Vec<f64>; 2]) -> Markup {
        let (mut known, mut failed, mut open) = (String::new(), String::new(), String::new());
        for p in &self.plane.points {
            let [x, y] = self.at(place, *p).map(px);
            let _ = match (self.values[*p], &self.shown.family.points[*p].fate) {
                (Some(_), _) => write!(known, "M{x} {y}h0"),
                (None, Fate::Failed { .. }) => write!(failed, "M{x} {y}m-2.5-2.5l5 5m0-5l-5 5"),
                (None, _) => write!(open, "M{x} {y}m-2 0h4"),
            };
        }
        html! {
            path class="computed-small" d=(known) {}
            @if !failed.is_empty() { path class="cross" d=(failed) {} }
            @if !open.is_empty() { path class="open-point" d=(open) {} }
        }
    }

    /// Where a point lies on the map (px).
    fn at(&self, place: &[Vec<f64>; 2], point: usize) -> [f64; 2] {
        [0, 1].map(|d| place[d][self.shown.levels[self.pair[d]].of[point]])
    }

    fn colour(&self, value: f64) -> String {
        let at = self.colours.place(value) as f32;
        let [r, g, b] = self.colours.palette.at(at).map(|c| c.round() as u8);
        format!("#{r:02x}{g:02x}{b:02x}")
    }
}
