//! A response over one variable: every point, lines through points that differ in it alone, bars where several stand at one value.

use crate::draw::{Axis, CHARACTER, MARKERS, VariableAxis, Zero, extent, px};
use crate::family::Fate;
use crate::page::family::shown::{LINKED, Shown};
use crate::plain::COLOURS;
use crate::units::{number, plural, shown as unit_of};
use maud::{Markup, html};
use std::collections::HashMap;
use std::fmt::Write;

/// Variables over which a response is drawn.
const VARIABLES: usize = 10;
/// Lines of one plot.
const LINES: usize = COLOURS;

const SIZE: [f64; 2] = [480.0, 290.0];
const LEFT: f64 = 54.0;
const RIGHT: f64 = 14.0;
/// Above the field stand the points that have no value, if there are any.
const TOP: [f64; 2] = [16.0, 30.0];
const BOTTOM: f64 = 42.0;
/// Height of the marks of points without a value (px).
const FAILED: f64 = 12.0;
const NOT_RUN: f64 = 24.0;
/// Half a cap of a bar (px).
const CAP: f64 = 4.0;

/// One plot for each variable that differs among the points.
pub(super) fn slices(shown: &Shown<'_>, response: usize, values: &[Option<f64>]) -> Markup {
    let n = shown.varied.len();
    html! {
        div class="plots" {
            @for v in shown.varied.iter().take(VARIABLES) { (Slice::new(shown, response, *v, values).svg()) }
        }
        @if n > VARIABLES { p class="note" { "Drawn over the first " (VARIABLES) " of " (n) " variables." } }
    }
}

struct Slice<'a> {
    shown: &'a Shown<'a>,
    variable: usize,
    scale: &'a VariableAxis,
    /// In the unit of the axis; by point.
    values: Vec<Option<f64>>,
    /// Variables that differ besides this one.
    others: Vec<usize>,
    /// For each point the number of those that differ from it in this variable alone.
    group: Vec<usize>,
    /// First point of each group.
    groups: Vec<usize>,
    /// For each value of the variable the points with a value.
    at: Vec<Vec<usize>>,
    title: String,
    y: Axis,
    left: f64,
    top: f64,
}

impl<'a> Slice<'a> {
    fn new(shown: &'a Shown<'a>, response: usize, variable: usize, values: &[Option<f64>]) -> Self {
        let response = &shown.family.responses[response];
        let factor = unit_of(&response.unit).0;
        let values: Vec<Option<f64>> = values.iter().map(|v| v.map(|v| v * factor)).collect();
        let others = shown.others(&[variable]);
        let mut known: HashMap<Vec<usize>, usize> = HashMap::new();
        let mut groups = Vec::new();
        let group = (0..values.len()).map(|p| {
            let key: Vec<usize> = others.iter().map(|v| shown.levels[*v].of[p]).collect();
            *known.entry(key).or_insert_with(|| {
                groups.push(p);
                groups.len() - 1
            })
        });
        let group: Vec<usize> = group.collect();
        let levels = &shown.levels[variable];
        let mut at = vec![Vec::new(); levels.values.len()];
        for p in (0..values.len()).filter(|p| values[*p].is_some()) {
            at[levels.of[p]].push(p);
        }
        let [low, high] = extent(values.iter().flatten().copied(), Zero::Near(0.4));
        let air = 0.06 * (high - low);
        let beyond = |end: f64, air: f64| if end == 0.0 { 0.0 } else { end + air };
        let range = [beyond(low, -air), beyond(high, air)];
        let top = TOP[usize::from(values.iter().any(Option::is_none))];
        let y = Axis::new(range, 6, [SIZE[1] - BOTTOM, top]);
        Self {
            left: LEFT.max(32.0 + CHARACTER * y.widest() as f64),
            scale: &shown.scales[variable],
            title: response.titled(),
            shown,
            variable,
            values,
            others,
            group,
            groups,
            at,
            y,
            top,
        }
    }

    fn x(&self, level: usize) -> f64 {
        self.across(self.scale.at[level])
    }

    fn across(&self, place: f64) -> f64 {
        self.left + place * (SIZE[0] - RIGHT - self.left)
    }

    fn level(&self, point: usize) -> usize {
        self.shown.levels[self.variable].of[point]
    }

    /// Whether each group has a colour and a line of its own.
    fn lined(&self) -> bool {
        self.scale.ordered && self.groups.len() <= LINES && self.groups.len() < self.values.len()
    }

    /// Whether several points stand at one value.
    fn repeated(&self) -> bool {
        self.at.iter().any(|a| a.len() > 1)
    }

    fn svg(&self) -> Markup {
        let [w, h] = SIZE;
        let variable = &self.shown.family.variables[self.variable];
        html! {
            figure class="plot" {
                p class="plot-title" { (self.title) " over " (variable.name) }
                svg viewBox={ "0 0 " (px(w)) " " (px(h)) } role="img" aria-label=(self.description()) {
                    (self.axes())
                    @if self.repeated() { (self.bars()) }
                    @if self.lined() { @for g in 0..self.groups.len() { (self.line(g)) } }
                    (self.marks())
                    (self.without_value())
                }
                @if self.lined() && self.groups.len() > 1 { (self.legend()) }
                @if let Some(text) = self.note() { p class="note" { (text) } }
            }
        }
    }

    /// For those who do not see it.
    fn description(&self) -> String {
        let known: Vec<f64> = self.values.iter().flatten().copied().collect();
        let low = known.iter().copied().fold(f64::INFINITY, f64::min);
        let high = known.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        format!(
            "{} over {}: {} with values from {} to {}. The numbers are in the table of points.",
            self.title,
            self.scale.title,
            plural(known.len(), "point", "points"),
            number(low, 4),
            number(high, 4)
        )
    }

    /// What bars and lines mean, and which variables differ where points stand at one value.
    fn note(&self) -> Option<String> {
        let name = &self.shown.family.variables[self.variable].name;
        if self.others.is_empty() {
            return None;
        }
        let mut text = String::new();
        if self.repeated() {
            let most = self.at.iter().map(Vec::len).max().unwrap_or(0);
            let differ: Vec<usize> = (self.others.iter().copied())
                .filter(|o| {
                    let of = &self.shown.levels[*o].of;
                    (self.at.iter()).any(|all| all.iter().any(|p| of[*p] != of[all[0]]))
                })
                .collect();
            text += &format!(
                "Up to {most} points have the same {name} and differ in {}. Bars reach from the smallest of them to the largest; the cross-line is their mean.",
                self.shown.names(&differ)
            );
        } else {
            text += &format!(
                "No two points with a value have the same {name}. They differ in {} too.",
                self.shown.names(&self.others)
            );
        }
        if self.lined() {
            text += &format!(" Lines join points that differ in {name} alone.");
        }
        Some(text)
    }

    fn axes(&self) -> Markup {
        let [w, h] = SIZE;
        let (right, bottom) = (w - RIGHT, h - BOTTOM);
        let middle = (self.top + bottom) / 2.0;
        html! {
            @for t in &self.y.ticks {
                @let y = px(self.y.at(*t));
                path class="grid" d={ "M" (px(self.left)) " " (y) "H" (px(right)) } {}
                text class="tick" x=(px(self.left - 6.0)) y=(px(self.y.at(*t) + 4.0)) text-anchor="end" { (self.y.text(*t)) }
            }
            @for (place, text) in &self.scale.ticks {
                @let x = px(self.across(*place));
                path class="axis" d={ "M" (x) " " (px(bottom)) "v4" } {}
                text class="tick" x=(x) y=(px(bottom + 16.0)) text-anchor="middle" { (text) }
            }
            @if self.y.low < 0.0 && self.y.high > 0.0 {
                path class="nought" d={ "M" (px(self.left)) " " (px(self.y.at(0.0))) "H" (px(right)) } {}
            }
            path class="axis" d={ "M" (px(self.left)) " " (px(self.top)) "V" (px(bottom)) "H" (px(right)) } {}
            text class="tick" x=(px((self.left + right) / 2.0)) y=(px(h - 6.0)) text-anchor="middle" { (self.scale.title) }
            text class="tick" x="12" y=(px(middle)) text-anchor="middle" transform={ "rotate(-90 12 " (px(middle)) ")" } { (self.title) }
            @if let Some(power) = self.y.power() { text class="tick" x=(px(self.left)) y=(px(self.top - 6.0)) { (power) } }
        }
    }

    /// From the smallest to the largest value of points that stand at one value of the variable, with their mean.
    fn bars(&self) -> Markup {
        let mut bars = String::new();
        for (level, all) in self.at.iter().enumerate().filter(|(_, a)| a.len() > 1) {
            let known: Vec<f64> = all.iter().filter_map(|p| self.values[*p]).collect();
            let end =
                |a: f64, f: fn(f64, f64) -> f64| px(self.y.at(known.iter().copied().fold(a, f)));
            let (low, high) = (
                end(f64::INFINITY, f64::min),
                end(f64::NEG_INFINITY, f64::max),
            );
            let mean = px(self.y.at(known.iter().sum::<f64>() / known.len() as f64));
            let x = self.x(level);
            let (a, b) = (px(x - CAP), px(x + CAP));
            let (c, d) = (px(x - 2.0 * CAP), px(x + 2.0 * CAP));
            let _ = write!(
                bars,
                "M{a} {low}H{b}M{a} {high}H{b}M{} {low}V{high}M{c} {mean}H{d}",
                px(x)
            );
        }
        html! { path class="spread" d=(bars) {} }
    }

    /// Points of a group in the order of the variable, joined; a point without a value parts the line.
    fn line(&self, group: usize) -> Markup {
        let mut all: Vec<usize> = (0..self.values.len())
            .filter(|p| self.group[*p] == group)
            .collect();
        all.sort_by_key(|p| self.level(*p));
        let (mut path, mut down) = (String::new(), false);
        for p in all {
            let Some(v) = self.values[p] else {
                down = false;
                continue;
            };
            let pen = if down { 'L' } else { 'M' };
            let _ = write!(
                path,
                "{pen}{} {}",
                px(self.x(self.level(p))),
                px(self.y.at(v))
            );
            down = true;
        }
        html! { path class={ "line thin c" (group % COLOURS) } d=(path) {} }
    }

    fn marks(&self) -> Markup {
        let lined = self.lined() && self.groups.len() > 1;
        let shape = |p: usize| match lined {
            true => (
                self.group[p] % COLOURS,
                "points",
                MARKERS[self.group[p] % MARKERS.len()],
            ),
            false => (0, "dot", "h0"),
        };
        let places: Vec<(usize, String)> = (self.values.iter().enumerate())
            .filter_map(|(p, v)| {
                let place = format!("M{} {}", px(self.x(self.level(p))), px(self.y.at((*v)?)));
                Some((p, place))
            })
            .collect();
        if places.len() > LINKED {
            let mut by: Vec<(usize, &str, String)> = Vec::new();
            for (p, place) in &places {
                let (colour, class, shape) = shape(*p);
                match by.iter_mut().find(|b| b.0 == colour) {
                    Some(b) => b.2 += &(place.clone() + shape),
                    None => by.push((colour, class, place.clone() + shape)),
                }
            }
            return html! { @for (colour, class, d) in &by { path class={ (class) " c" (colour) } d=(d) {} } };
        }
        html! {
            @for (p, place) in &places {
                @let (colour, class, shape) = shape(*p);
                a href=[self.shown.address(*p)] tabindex="-1" { path class={ (class) " c" (colour) } d={ (place) (shape) } {} }
            }
        }
    }

    /// Points without a value, above the field at their place: never at zero.
    fn without_value(&self) -> Markup {
        let (mut failed, mut open) = (String::new(), String::new());
        for (p, point) in self.shown.family.points.iter().enumerate() {
            if self.values[p].is_some() {
                continue;
            }
            let x = px(self.x(self.level(p)));
            let _ = match point.fate {
                Fate::Failed { .. } => write!(failed, "M{x} {}m-3.5-3.5l7 7m0-7l-7 7", px(FAILED)),
                _ => write!(
                    open,
                    "M{x} {}m-3 0a3 3 0 1 0 6 0a3 3 0 1 0-6 0",
                    px(NOT_RUN)
                ),
            };
        }
        html! {
            @if !failed.is_empty() { path class="cross" d=(failed) {} }
            @if !open.is_empty() { path class="open-point" d=(open) {} }
        }
    }

    fn legend(&self) -> Markup {
        html! {
            figcaption class="legend" {
                @for (g, first) in self.groups.iter().enumerate() {
                    @let colour = g % COLOURS;
                    span { svg width="26" height="10" viewBox="0 0 26 10" aria-hidden="true" {
                        path class={ "line thin c" (colour) } d="M0 5H26" {}
                        path class={ "points c" (colour) } d={ "M13 5" (MARKERS[g % MARKERS.len()]) } {}
                    } " " (self.shown.family.said(*first, &self.others)) }
                }
            }
        }
    }
}
