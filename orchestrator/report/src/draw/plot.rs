//! Plots over two axes and bars, as SVG.

pub(crate) mod axis;
mod boxes;
mod thin;

use crate::draw::plot::axis::{Axis, Frame, Zero, extent};
use crate::draw::svg::{px, spot};
use crate::plain::{Boxes, COLOURS, LARGEST, Plot, Series, Style};
use crate::units::number;
use maud::{Markup, html};

const RIGHT: f64 = 14.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 38.0;
/// Left margin: at least this, and else what the texts of the ticks need at this width per character (px).
const LEFT: f64 = 50.0;
pub(crate) const CHARACTER: f64 = 6.6;
/// Marks on the lines of further series are this far apart (px).
const MARK_EVERY: f64 = 60.0;

/// Markers about a place, told apart without colour.
pub(crate) const MARKERS: [&str; 6] = [
    "m-2.8 0a2.8 2.8 0 1 0 5.6 0a2.8 2.8 0 1 0-5.6 0",
    "m-2.5-2.5h5v5h-5z",
    "m0-3.5l3.5 3.5l-3.5 3.5l-3.5-3.5z",
    "m0-3.4l3.2 5.6h-6.4z",
    "m0 3.4l3.2-5.6h-6.4z",
    "m-2.6-2.6l5.2 5.2m0-5.2l-5.2 5.2",
];

impl Plot<'_> {
    /// The plot with its title above and its legend below; nothing when no series has a value.
    pub(crate) fn svg(&self) -> Markup {
        let Some(frame) = self.frame() else {
            return html! {};
        };
        let [w, h] = self.size;
        html! {
            figure class="plot" {
                p class="plot-title" { (self.title) }
                svg viewBox={ "0 0 " (px(w)) " " (px(h)) } role="img" aria-label=(self.description(&frame)) {
                    (self.axes(&frame))
                    @if let Some((value, name)) = self.bound {
                        @let y = frame.y.at(value);
                        path class="bound" d={ "M" (px(frame.left)) " " (px(y)) "H" (px(frame.right)) } {}
                        text class="tick bound-name" x=(px(frame.right - 4.0)) y=(px(y - 5.0)) text-anchor="end" { (name) }
                    }
                    @for boxes in &self.boxes { (boxes.drawn(&frame)) }
                    @for (i, series) in self.series.iter().enumerate() { (self.drawn(i, series, &frame)) }
                }
                @if self.series.len() + self.boxes.len() > 1 || self.legend_of_one { (self.legend()) }
            }
        }
    }

    /// For those who do not see it.
    fn description(&self, frame: &Frame) -> String {
        let range = |a: &Axis| {
            let text = |v: f64| number(v, 3);
            format!("from {} to {}", text(a.low), text(a.high))
        };
        let named = |s: &Series<'_>| {
            let how = match s.style {
                Style::Line => "line",
                Style::Dashed => "dashed line",
                Style::Points => "points",
            };
            format!("{} ({how})", s.name)
        };
        let boxes = self.boxes.iter().map(Boxes::description);
        let all: Vec<String> = boxes.chain(self.series.iter().map(named)).collect();
        format!(
            "{}: {}, {}, over {}, {}. Series: {}.",
            self.title,
            self.y_label,
            range(&frame.y),
            self.x_label,
            range(&frame.x),
            all.join(", ")
        )
    }

    fn frame(&self) -> Option<Frame> {
        self.places().next()?;
        let near = if self.from_zero { 0.05 } else { 0.25 };
        // Also where only the other value is no number: plots of one history then lie below each other.
        let across = self.series.iter().flat_map(|s| s.x.iter().copied());
        let across = across.chain(self.boxes.iter().flat_map(Boxes::across));
        let across = extent(across, Zero::Near(near));
        let [w, h] = self.size;
        let bottom = h - BOTTOM;
        let y = Axis::new(self.range(self.places().map(|p| p.1)), 7, [bottom, TOP]);
        let left = LEFT.max(30.0 + CHARACTER * y.widest() as f64);
        let right = w - RIGHT;
        let x = Axis::new(across, 8, [left, right]);
        Some(Frame {
            x,
            y,
            left,
            right,
            bottom,
        })
    }

    /// Smallest and largest value shown, with some air.
    fn range(&self, values: impl Iterator<Item = f64>) -> [f64; 2] {
        let values = values.chain(self.bound.map(|b| b.0));
        let zero = if self.from_zero {
            Zero::Always
        } else {
            Zero::Near(0.4)
        };
        let [low, high] = extent(values, zero);
        let high = self.ceiling.map_or(high, |c| high.min(c)).max(low);
        let air = 0.04 * (high - low);
        match (high > low, self.from_zero || low == 0.0) {
            (false, _) => [low, low + 1.0],
            (true, true) => [low, high + air],
            (true, false) => [low - air, if high == 0.0 { 0.0 } else { high + air }],
        }
    }

    fn axes(&self, f: &Frame) -> Markup {
        let h = self.size[1];
        let middle = (TOP + f.bottom) / 2.0;
        html! {
            @for t in &f.y.ticks {
                @let y = f.y.at(*t);
                path class="grid" d={ "M" (px(f.left)) " " (px(y)) "H" (px(f.right)) } {}
                text class="tick" x=(px(f.left - 6.0)) y=(px(y + 4.0)) text-anchor="end" { (f.y.text(*t)) }
            }
            @for t in &f.x.ticks {
                @let x = f.x.at(*t);
                path class="grid" d={ "M" (px(x)) " " (px(TOP)) "V" (px(f.bottom)) } {}
                path class="axis" d={ "M" (px(x)) " " (px(f.bottom)) "v4" } {}
                text class="tick" x=(px(x)) y=(px(f.bottom + 16.0)) text-anchor="middle" { (f.x.text(*t)) }
            }
            @if f.y.low < 0.0 && f.y.high > 0.0 {
                path class="nought" d={ "M" (px(f.left)) " " (px(f.y.at(0.0))) "H" (px(f.right)) } {}
            }
            @if f.x.low < 0.0 && f.x.high > 0.0 {
                path class="nought" d={ "M" (px(f.x.at(0.0))) " " (px(TOP)) "V" (px(f.bottom)) } {}
            }
            path class="axis" d={ "M" (px(f.left)) " " (px(TOP)) "V" (px(f.bottom)) "H" (px(f.right)) } {}
            text class="tick" x=(px((f.left + f.right) / 2.0)) y=(px(h - 5.0)) text-anchor="middle" { (self.x_label) }
            text class="tick" x="12" y=(px(middle)) text-anchor="middle"
                transform={ "rotate(-90 12 " (px(middle)) ")" } { (self.y_label) }
            @if let Some(power) = f.y.power() { text class="tick" x=(px(f.left)) y="10" { (power) } }
            @if let Some(power) = f.x.power() {
                text class="tick" x=(px(f.right)) y=(px(h - 5.0)) text-anchor="end" { (power) }
            }
        }
    }

    /// The series on the page, thinned to what a screen shows.
    fn drawn(&self, number: usize, series: &Series<'_>, f: &Frame) -> Markup {
        let place = |(x, y): (&f64, &f64)| {
            let shown = x.abs() < LARGEST && y.abs() < LARGEST;
            shown.then(|| [f.x.at(*x), f.y.at(y.min(f.y.high))])
        };
        let places: Vec<_> = series.x.iter().zip(series.y.iter()).map(place).collect();
        let colour = series.colour % COLOURS;
        if series.style == Style::Points {
            let at = thin::markers(&places);
            return html! { path class={ "points c" (colour) } d=(marked(&at, self.shape(number))) {} };
        }
        let runs = thin::line(&places);
        let class = line_class(series.style);
        html! {
            path class={ (class) " c" (colour) } d=(joined(&runs)) {}
            @if series.colour >= COLOURS {
                path class={ "points c" (colour) } d=(marked(&along(&runs), self.shape(number))) {}
            }
        }
    }

    /// Shape of a series' markers: each series that has markers its own, as long as there are shapes.
    fn shape(&self, number: usize) -> &'static str {
        let before = &self.series[..number];
        let with = |s: &&Series<'_>| s.style == Style::Points || s.colour >= COLOURS;
        MARKERS[before.iter().filter(with).count() % MARKERS.len()]
    }

    fn legend(&self) -> Markup {
        html! {
            figcaption class="legend" {
                @for b in self.boxes.iter().filter(|b| !b.name.is_empty()) { (b.key()) }
                @for (i, s) in self.series.iter().enumerate() {
                    @let colour = s.colour % COLOURS;
                    span { svg width="26" height="10" viewBox="0 0 26 10" aria-hidden="true" {
                        @if s.style != Style::Points {
                            path class={ (line_class(s.style)) " c" (colour) } d="M0 5H26" {}
                        }
                        @if s.style == Style::Points || s.colour >= COLOURS {
                            path class={ "points c" (colour) } d={ "M13 5" (self.shape(i)) } {}
                        }
                    } " " (s.name) }
                }
            }
        }
    }
}

fn line_class(style: Style) -> &'static str {
    if style == Style::Dashed {
        "line dashed"
    } else {
        "line"
    }
}

/// Lines through places, as an SVG path. A place of its own becomes a dot.
fn joined(runs: &[Vec<[f64; 2]>]) -> String {
    let mut path = String::new();
    for run in runs {
        let mut last = String::new();
        for (i, p) in run.iter().enumerate() {
            let text = spot(*p);
            if i == 0 || text != last {
                path.push(if i == 0 { 'M' } else { 'L' });
                path += &text;
                last = text;
            }
        }
        if run.len() == 1 {
            path += "h0";
        }
    }
    path
}

/// Markers at places, as an SVG path.
fn marked(places: &[[f64; 2]], shape: &str) -> String {
    let mut path = String::new();
    for p in places {
        path += &format!("M{}{shape}", spot(*p));
    }
    path
}

/// Places along lines, some way apart.
fn along(runs: &[Vec<[f64; 2]>]) -> Vec<[f64; 2]> {
    let mut found = Vec::new();
    let mut gone = 0.5 * MARK_EVERY;
    for run in runs {
        for w in run.windows(2) {
            gone += (w[1][0] - w[0][0]).hypot(w[1][1] - w[0][1]);
            if gone >= MARK_EVERY {
                found.push(w[1]);
                gone = 0.0;
            }
        }
    }
    found
}

/// Horizontal bars: name, value, text behind the bar.
pub(crate) fn bars(title: &str, rows: &[(String, f64, String)]) -> Markup {
    let top = rows.iter().map(|r| r.1).fold(0.0, f64::max);
    let (row, left, width) = (24.0, 170.0, 400.0);
    let h = row * rows.len() as f64 + 8.0;
    html! {
        figure class="plot" {
            p class="plot-title" { (title) }
            svg class="bars" viewBox={ "0 0 720 " (px(h)) } role="img" aria-label=(title) {
                @for (i, (name, value, text)) in rows.iter().enumerate() {
                    @let y = 4.0 + row * i as f64;
                    @let w = if top > 0.0 { value / top * width } else { 0.0 };
                    text class="tick" x=(px(left - 8.0)) y=(px(y + 14.0)) text-anchor="end" { (name) }
                    rect class="bar-fill" x=(px(left)) y=(px(y + 3.0)) width=(px(w.max(1.0))) height="16" {}
                    text class="tick" x=(px(left + w + 6.0)) y=(px(y + 15.0)) { (text) }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests;
