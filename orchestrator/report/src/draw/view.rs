//! Pictures of plies: the flat map and the formed view, with zones, marks and axes drawn over them.

use crate::draw::colour::Rgb;
use crate::draw::error::{DrawError, Drawn};
use crate::draw::legend::Legend;
use crate::draw::plot::axis::ticks;
use crate::draw::raster::{Camera, Canvas, Paint, Surface, Triangles};
use crate::draw::sharpness::Sharpness;
use crate::draw::svg::{px, spot};
use crate::plain::{Locator, Marked, Place, Ply, Tool, Vec3, bounds, outline};
use crate::units::number;
use maud::{Markup, html};
use plyflow_model::artifact::Zone;
use std::collections::BTreeMap;

/// A text at a place of the flat ply (m).
#[derive(Debug, Clone)]
pub(crate) struct Mark {
    pub(crate) text: String,
    pub(crate) at: [f64; 2],
    /// The defect that it names, on the page.
    pub(crate) id: String,
}

/// The side from which a formed ply is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Side {
    /// From -y, x to the right.
    Front,
    /// From +y, x to the left.
    Back,
}

impl Side {
    /// The side to which most of the marked cells face (of all cells when none is marked).
    pub(crate) fn facing(ply: &Ply) -> Self {
        if faces_back(ply) {
            Self::Back
        } else {
            Self::Front
        }
    }
}

/// How a formed ply is shown.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FormedView<'a> {
    pub(crate) side: Side,
    pub(crate) tool: Option<&'a Tool>,
    /// Whether all of the tool must be on the picture, or the ply fills it.
    pub(crate) whole_tool: bool,
    /// Width on the page (px).
    pub(crate) width: f64,
}

/// What is drawn over a ply.
#[derive(Debug, Clone, Default)]
pub(crate) struct Overlay<'a> {
    pub(crate) zones: &'a [Zone],
    pub(crate) marks: &'a [Mark],
    /// Defects that can be selected on the flat ply.
    pub(crate) places: &'a [&'a Place],
}

/// Left and bottom margin of the flat map's axes (px).
const AXES: [f64; 2] = [34.0, 22.0];
/// Right margin, for the half of the last number that reaches out (px).
const RIGHT: f64 = 8.0;
/// Points along zone outlines on the formed ply are this far apart (m).
const OUTLINE_STEP: f64 = 2e-3;
/// Outlines that lie this far (m) behind what is drawn still show.
const OUTLINE_TOLERANCE: f64 = 3e-3;
/// The ply is drawn at least this far (m) before the tool, which its mid-plane touches within the contact's play.
const LEAST_BIAS: f64 = 1.5e-3;
/// And by this part of an element's side: its straight sides cut through the fillets.
const BIAS_OF_SIDE: f64 = 0.25;
/// Grey of the tool, unlike the light middle of the diverging scales.
const TOOL: Rgb = [128.0, 136.0, 146.0];

/// Size of the image and the view onto it, for a camera that fits a page of `size`.
fn fit(
    camera: Camera,
    points: &[Vec3],
    more: &[Vec3],
    size: [f64; 2],
    sharp: Sharpness,
) -> (Camera, [usize; 2]) {
    let margin = 8.0 * sharp.0;
    camera.fit(points.iter().chain(more), size.map(|s| s * sharp.0), margin)
}

/// The undeformed ply in colours, `width` px wide, with axes in mm.
///
/// # Errors
/// When the picture cannot be encoded.
pub(crate) fn flat(
    ply: &Ply,
    legend: &Legend,
    overlay: &Overlay<'_>,
    width: f64,
    sharp: Sharpness,
) -> Drawn {
    let Some(values) = legend.at_points(ply) else {
        return Ok(html! {});
    };
    let room = [width - AXES[0] - RIGHT, 0.85 * width];
    let (camera, size) = fit(Camera::plan(), &ply.flat, &[], room, sharp);
    let mut canvas = Canvas::new(size);
    let paint = Paint::Field(&values, legend.scale);
    canvas.surface(&camera, &Surface::new(&ply.flat, &triangles(ply), paint));
    let image = canvas.data_url()?;
    let page = |p: [f64; 2]| {
        let [x, y, _] = camera.project([p[0], p[1], 0.0]);
        [AXES[0] + x / sharp.0, y / sharp.0]
    };
    let (w, h) = (size[0] as f64 / sharp.0, size[1] as f64 / sharp.0);
    let marks = [
        (Marked::Other, "marked"),
        (Marked::Wrinkle, "marked wrinkle"),
    ];
    let marks = marks.map(|(kind, class)| (class, marked_outline(ply, kind, &page)));
    let what = format!("{}, flat ply {}", legend.title(), ply.name);
    Ok(html! {
        svg viewBox={ "0 0 " (px(width)) " " (px(h + AXES[1])) } role="img" aria-label=(what) {
            image href=(image) x=(AXES[0]) y="0" width=(px(w)) height=(px(h)) {}
            (plan_axes(ply, &page, h))
            @for (class, path) in marks.iter().filter(|m| !m.1.is_empty()) {
                path class="marked-halo" d=(path) {}
                path class=(class) d=(path) {}
            }
            @for zone in overlay.zones {
                @let [x0, y1] = page([zone.bounds[0], zone.bounds[1]]);
                @let [x1, y0] = page([zone.bounds[2], zone.bounds[3]]);
                rect class="zone-halo" x=(px(x0)) y=(px(y0)) width=(px(x1 - x0)) height=(px(y1 - y0)) {}
                rect class="zone" x=(px(x0)) y=(px(y0)) width=(px(x1 - x0)) height=(px(y1 - y0)) {}
                (label(&zone.name, [x0 + 5.0, y0 + 16.0], "zone-name", "start"))
            }
            @for place in overlay.places { (selectable(place, &page)) }
            @for mark in overlay.marks {
                @let [x, y] = page(mark.at);
                g data-defect=(mark.id) { (label(&mark.text, [x, (y + 4.0).clamp(13.0, h - 3.0)], "defect-name", "middle")) }
            }
        }
    })
}

/// A defect on the flat ply: unseen until it is pointed at or selected, here or in the table.
fn selectable(place: &Place, page: &dyn Fn([f64; 2]) -> [f64; 2]) -> Markup {
    let mut path = String::new();
    for line in place.lines.iter().filter(|l| !l.flat.is_empty()) {
        for (i, at) in line.flat.iter().enumerate() {
            path += if i == 0 { "M" } else { "L" };
            path += &spot(page(*at));
        }
    }
    html! {
        @if !path.is_empty() {
            g class="place" data-defect=(place.id) { title { "Defect " (place.label) } path d=(path) {} }
        }
    }
}

/// Numbers along the lower and left edge of the flat map, in mm.
fn plan_axes(ply: &Ply, page: &dyn Fn([f64; 2]) -> [f64; 2], h: f64) -> Markup {
    let [low, high] = bounds(&ply.flat);
    let of = |d: usize, n| ticks(low[d] * 1e3, high[d] * 1e3, n);
    html! {
        @for t in of(0, 7) {
            @let x = px(page([t * 1e-3, 0.0])[0]);
            path class="axis" d={ "M" (x) " " (px(h)) "v4" } {}
            text class="tick" x=(x) y=(px(h + 16.0)) text-anchor="middle" { (number(t, 4)) }
        }
        @for t in of(1, 5) {
            @let y = page([0.0, t * 1e-3])[1];
            path class="axis" d={ "M" (px(AXES[0])) " " (px(y)) "h-4" } {}
            text class="tick" x=(px(AXES[0] - 7.0)) y=(px(y + 4.0)) text-anchor="end" { (number(t, 4)) }
        }
    }
}

/// The formed ply on the tool.
///
/// # Errors
/// When the picture cannot be encoded.
pub(crate) fn formed(
    ply: &Ply,
    legend: &Legend,
    overlay: &Overlay<'_>,
    how: FormedView<'_>,
    sharp: Sharpness,
) -> Drawn {
    let Some(values) = legend.at_points(ply) else {
        return Ok(html! {});
    };
    let front = how.side == Side::Front;
    let (view, image) = View::of(ply, Paint::Field(&values, legend.scale), how, sharp)?;
    let all = bounds(&ply.flat).as_flattened().try_into();
    let edge = Zone::new("", all.unwrap_or_default());
    let [w, h] = view.size;
    let what = format!("{}, formed ply {}", legend.title(), ply.name);
    Ok(html! {
        svg viewBox={ "0 0 " (px(w)) " " (px(h)) } role="img" aria-label=(what) {
            image href=(image) x="0" y="0" width=(px(w)) height=(px(h)) {}
            path class="ply-edge" d=(view.outline(&edge).0) {}
            @for zone in overlay.zones {
                @let (path, corner) = view.outline(zone);
                path class="zone-halo" d=(path) {}
                path class="zone" d=(path) {}
                @if let Some(c) = corner { (label(&zone.name, c, "zone-name", "middle")) }
            }
            @for mark in overlay.marks {
                @if let Some((at, true)) = view.place(mark.at) {
                    (label(&mark.text, at, "defect-name", "middle"))
                }
            }
            (triad(&view.camera, [if front { 34.0 } else { w - 34.0 }, h - 26.0]))
            @if front {
                text class="over" x=(px(w - 4.0)) y="14" text-anchor="end" { "seen from −y" }
            } @else {
                text class="over" x="4" y="14" { "seen from +y" }
            }
        }
    })
}

/// The tool alone, from the front and above, with its size along x, y and z (m).
///
/// # Errors
/// When the picture cannot be encoded.
pub(crate) fn tool_picture(
    tool: &Tool,
    width: f64,
    sharp: Sharpness,
) -> Result<(Markup, Vec3), DrawError> {
    let camera = Camera::oblique((-65f64).to_radians(), 38f64.to_radians());
    let (camera, size) = fit(camera, &tool.points, &[], [width, 0.72 * width], sharp);
    let mut canvas = Canvas::new(size);
    let mesh = Triangles::new(tool.points.len(), &tool.cells);
    canvas.surface(
        &camera,
        &Surface::new(&tool.points, &mesh, Paint::Plain(TOOL)).lit(0.0),
    );
    let image = canvas.data_url()?;
    let [w, h] = size.map(|s| s as f64 / sharp.0);
    let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    for p in &tool.points {
        for d in 0..3 {
            (low[d], high[d]) = (low[d].min(p[d]), high[d].max(p[d]));
        }
    }
    let extent = [0, 1, 2].map(|d| (high[d] - low[d]).max(0.0));
    let picture = html! {
        svg viewBox={ "0 0 " (px(w)) " " (px(h)) } role="img" aria-label="The tool" {
            image href=(image) x="0" y="0" width=(px(w)) height=(px(h)) {}
            (triad(&camera, [34.0, h - 26.0]))
        }
    };
    Ok((picture, extent))
}

/// A drawn view, for placing lines on what it shows.
struct View<'a> {
    camera: Camera,
    canvas: Canvas,
    sharp: Sharpness,
    locator: Locator<'a>,
    ply: &'a Ply,
    bias: f64,
    /// On the page (px).
    size: [f64; 2],
}

impl<'a> View<'a> {
    /// Of a ply on its tool, with the picture as an address.
    fn of(
        ply: &'a Ply,
        paint: Paint<'_>,
        how: FormedView<'_>,
        sharp: Sharpness,
    ) -> Result<(Self, String), DrawError> {
        let FormedView { side, width, .. } = how;
        let azimuth = if side == Side::Front { -65f64 } else { 65f64 };
        let camera = Camera::oblique(azimuth.to_radians(), 38f64.to_radians());
        let whole = how.tool.filter(|_| how.whole_tool);
        let around = whole.map_or(&[][..], |t| &t.points);
        let (camera, size) = fit(camera, &ply.formed, around, [width, 0.72 * width], sharp);
        let mut canvas = Canvas::new(size);
        if let Some(t) = how.tool {
            let mesh = Triangles::new(t.points.len(), &t.cells);
            let surface = Surface::new(&t.points, &mesh, Paint::Plain(TOOL));
            canvas.surface(&camera, &surface.lit(0.0));
        }
        let bias = lift(ply);
        let mesh = triangles(ply);
        let surface = Surface::new(&ply.formed, &mesh, paint);
        canvas.surface(&camera, &surface.lit(bias));
        let image = canvas.data_url()?;
        let view = Self {
            camera,
            canvas,
            sharp,
            locator: Locator::new(&ply.flat, &ply.cells),
            ply,
            bias,
            size: size.map(|s| s as f64 / sharp.0),
        };
        Ok((view, image))
    }

    /// Where a place of the flat ply (m) appears on the page (px), and whether it is seen.
    fn place(&self, at: [f64; 2]) -> Option<([f64; 2], bool)> {
        let p = self.locator.carried(at, &self.ply.formed)?;
        let mut on_image = self.camera.project(p);
        on_image[2] += self.bias;
        let seen = self.canvas.visible(on_image, OUTLINE_TOLERANCE);
        Some((
            [on_image[0] / self.sharp.0, on_image[1] / self.sharp.0],
            seen,
        ))
    }

    /// The visible part of a zone's outline as an SVG path, and where to write its name.
    fn outline(&self, zone: &Zone) -> (String, Option<[f64; 2]>) {
        let (mut path, mut pen_down, mut first) = (String::new(), false, None);
        for at in outline(zone.bounds, OUTLINE_STEP) {
            match self.place(at) {
                Some((p, true)) => {
                    path += if pen_down { "L" } else { "M" };
                    path += &spot(p);
                    pen_down = true;
                    first = first.or(Some(p));
                }
                _ => pen_down = false,
            }
        }
        let [x0, y0, x1, y1] = zone.bounds;
        let centre = self.place([0.5 * (x0 + x1), 0.5 * (y0 + y1)]);
        let name = match centre {
            Some((p, true)) => Some(p),
            _ => first,
        };
        (path, name)
    }
}

/// Whether more of the marked cells (of all cells when none is marked) face +y than -y.
fn faces_back(ply: &Ply) -> bool {
    let any = ply.marked.iter().any(|m| *m != Marked::No);
    let mut sum = 0.0;
    for (cell, marked) in ply.cells.iter().zip(&ply.marked) {
        if any && *marked == Marked::No {
            continue;
        }
        let [a, b, c, d] = cell.map(|i| ply.formed[i as usize]);
        let (e, f) = ([c[0] - a[0], c[2] - a[2]], [d[0] - b[0], d[2] - b[2]]);
        // The y component of the cell's normal times twice its area.
        sum += e[1] * f[0] - e[0] * f[1];
    }
    // A hair of preference for the front, so that rounding does not choose.
    sum > 1e-4
}

/// How far (m) a formed ply is drawn before the tool.
pub(crate) fn lift(ply: &Ply) -> f64 {
    LEAST_BIAS.max(BIAS_OF_SIDE * mean_side(ply))
}

/// Mean length of the formed elements' first sides (m).
fn mean_side(ply: &Ply) -> f64 {
    let side = |c: &[u32; 4]| {
        let [a, b] = [c[0], c[1]].map(|i| ply.formed[i as usize]);
        (0..3).map(|d| (a[d] - b[d]).powi(2)).sum::<f64>().sqrt()
    };
    ply.cells.iter().map(side).sum::<f64>() / ply.cells.len().max(1) as f64
}

/// Directions of the axes.
fn triad(camera: &Camera, at: [f64; 2]) -> Markup {
    let origin = camera.project([0.0; 3]);
    let axis = |d: usize| {
        let mut unit = [0.0; 3];
        unit[d] = 22.0 / camera.scale;
        let p = camera.project(unit);
        [at[0] + p[0] - origin[0], at[1] + p[1] - origin[1]]
    };
    html! {
        @for (d, name) in ["x", "y", "z"].into_iter().enumerate() {
            @let [x, y] = axis(d);
            path class="triad-halo" d={ "M" (px(at[0])) " " (px(at[1])) "L" (px(x)) " " (px(y)) } {}
            path class="triad" d={ "M" (px(at[0])) " " (px(at[1])) "L" (px(x)) " " (px(y)) } {}
            text class="over" x=(px(at[0] + 1.35 * (x - at[0]))) y=(px(at[1] + 1.35 * (y - at[1]) + 4.0))
                text-anchor="middle" { (name) }
        }
    }
}

fn label(text: &str, at: [f64; 2], class: &str, anchor: &str) -> Markup {
    html! { text class={ "label " (class) } x=(px(at[0])) y=(px(at[1])) text-anchor=(anchor) { (text) } }
}

/// The edges around the cells of a kind, as an SVG path.
fn marked_outline(ply: &Ply, kind: Marked, page: &dyn Fn([f64; 2]) -> [f64; 2]) -> String {
    let mut edges: BTreeMap<(u32, u32), u32> = BTreeMap::new();
    let cells = ply.cells.iter().zip(&ply.marked);
    for (cell, _) in cells.filter(|(_, m)| **m == kind) {
        for k in 0..4 {
            let (a, b) = (cell[k], cell[(k + 1) % 4]);
            *edges.entry((a.min(b), a.max(b))).or_default() += 1;
        }
    }
    let mut path = String::new();
    for ((a, b), _) in edges.into_iter().filter(|(_, n)| *n == 1) {
        let [p, q] = [a, b].map(|i| {
            let at = ply.flat[i as usize];
            page([at[0], at[1]])
        });
        path += &format!("M{}L{}", spot(p), spot(q));
    }
    path
}

fn triangles(ply: &Ply) -> Triangles {
    Triangles::of_quads(ply.flat.len(), &ply.cells)
}
