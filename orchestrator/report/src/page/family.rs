//! The page of a study: its table, its responses over what was varied, and every point in its place.

mod costs;
mod failed;
mod map;
mod places;
mod sensitivity;
mod slices;
mod table;

pub(super) use costs::section as costs;

use crate::family::pictures::{MOST, Pictures};
use crate::family::scale::Scale;
use crate::family::{Family, Levels, Origin, Response};
use crate::input::ReportInput;
use crate::units::{number, plural, quantity, shown};
use maud::{Markup, html};

/// Rows of the table, and places of points.
const LISTED: usize = 1000;
/// Of more points the marks in a plot are not links, each of which has its length.
const LINKED: usize = 600;
/// Values that differ by no more than this part of them are the same.
const ROUNDING: f64 = 1e-9;
/// Responses that are drawn.
const RESPONSES: usize = 12;

/// A study with what is worked out of it once.
pub(super) struct Shown<'a> {
    pub(super) input: &'a ReportInput,
    pub(super) family: &'a Family,
    levels: Vec<Levels>,
    scales: Vec<Scale>,
    /// Variables with more than one value.
    varied: Vec<usize>,
    /// For each point what its steps warn of.
    pub(super) warnings: &'a [Vec<(String, String)>],
    pub(super) pictures: Option<&'a Pictures>,
}

impl<'a> Shown<'a> {
    pub(super) fn new(
        input: &'a ReportInput,
        family: &'a Family,
        warnings: &'a [Vec<(String, String)>],
        pictures: Option<&'a Pictures>,
    ) -> Self {
        let levels = family.levels();
        let scales = family.variables.iter().zip(&levels);
        let scales = scales.map(|(v, l)| Scale::new(v, l)).collect();
        let varied = (0..levels.len()).filter(|v| levels[*v].values.len() > 1);
        Self {
            input,
            family,
            varied: varied.collect(),
            scales,
            levels,
            warnings,
            pictures,
        }
    }

    fn values(&self, response: usize) -> Vec<Option<f64>> {
        self.family
            .points
            .iter()
            .map(|p| p.responses[response])
            .collect()
    }

    /// Variables that differ among the points besides some.
    fn others(&self, than: &[usize]) -> Vec<usize> {
        let others = self.varied.iter().filter(|v| !than.contains(v));
        others.copied().collect()
    }

    fn names(&self, variables: &[usize]) -> String {
        let names: Vec<&str> = variables
            .iter()
            .map(|v| self.family.variables[*v].name.as_str())
            .collect();
        match names.as_slice() {
            [] => String::new(),
            [one] => (*one).to_owned(),
            [first @ .., last] => format!("{} and {last}", first.join(", ")),
        }
    }

    /// The address of a point's place on the page; none where there is no room for it.
    fn address(&self, point: usize) -> Option<String> {
        let place = || format!("#{}", self.family.points[point].place());
        (point < LISTED).then(place)
    }

    /// A link to the place of a point.
    fn link(&self, point: usize) -> Markup {
        let name = parted(&self.family.points[point].name);
        html! { a href=[self.address(point)] { (name) } }
    }
}

/// A name that may go on in the next line behind each of its values.
fn parted(name: &str) -> Markup {
    html! { @for part in name.split_inclusive(',') { (part) wbr; } }
}

/// The whole of what is told of the study.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn sections(shown: &Shown<'_>) -> Result<Markup, String> {
    let family = shown.family;
    let mut responses = Vec::new();
    for r in 0..family.responses.len().min(RESPONSES) {
        responses.push(response(shown, r)?);
    }
    Ok(html! {
        section id="points" {
            h2 { "Table of points" }
            (table::table(shown))
        }
        @if family.count("failed") > 0 { (failed::section(shown)) }
        @if !family.responses.is_empty() {
            section id="responses" {
                h2 { "Responses over what was varied" }
                @if responses.len() > 1 {
                    div class="controls with-script" hidden {
                        label for="response" { "Show" }
                        select id="response" {
                            option value="" { "all responses" }
                            @for r in family.responses.iter().take(RESPONSES) { option value=(r.name) { (r.name) } }
                        }
                    }
                }
                (legend(shown))
                @for r in &responses { (r) }
                @if family.responses.len() > RESPONSES {
                    p class="note" { "Drawn are the first " (RESPONSES) " of " (family.responses.len()) " responses; the table has all." }
                }
            }
        }
        (places::section(shown))
    })
}

/// What the marks in the plots mean.
fn legend(shown: &Shown<'_>) -> Markup {
    let key = |path: &str, class: &str| {
        html! {
            svg width="18" height="14" viewBox="-9 -7 18 14" aria-hidden="true" { path class=(class) d=(path) {} }
        }
    };
    html! {
        p class="note keys" {
            span { (key("M0 0h0", "dot c0")) " a computed point; a click leads to it" }
            @if shown.family.count("failed") > 0 { span { (key("m-3.5-3.5l7 7m0-7l-7 7", "cross")) " a failed point, which has no value" } }
            @if shown.family.count("not run") > 0 { span { (key("m-3 0a3 3 0 1 0 6 0a3 3 0 1 0-6 0", "open-point")) " a point that has not been run" } }
        }
    }
}

fn response(shown: &Shown<'_>, r: usize) -> Result<Markup, String> {
    let response = &shown.family.responses[r];
    let values = shown.values(r);
    let maps = map::maps(shown, r, &values)?;
    let [low, high] = range_of(&values);
    Ok(html! {
        section class="response" data-response=(response.name) {
            h3 { (response.titled()) " " span class="note" { @match &response.from {
                Origin::Step { step, result } => { (result) " of the step " code { (step) } },
                Origin::Variables(expression) => { "computed: " code { (expression) } },
            } } }
            @if values.iter().all(Option::is_none) {
                p { "No point has a value of it." }
            } @else {
                (extremes(shown, response, &values))
                @if low < high {
                    (slices::slices(shown, r, &values))
                    (maps)
                    (sensitivity::section(shown, r, &values))
                }
            }
        }
    })
}

/// Smallest and largest of a response; the same where they differ by no more than rounding.
fn range_of(values: &[Option<f64>]) -> [f64; 2] {
    let known = || values.iter().flatten().copied();
    let low = known().fold(f64::INFINITY, f64::min);
    let high = known().fold(f64::NEG_INFINITY, f64::max);
    match is_same(low, high) {
        true => [low, low],
        false => [low, high],
    }
}

fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

/// Where a response is smallest and largest.
fn extremes(shown: &Shown<'_>, response: &Response, values: &[Option<f64>]) -> Markup {
    let [low, high] = range_of(values);
    let at = |value: f64| {
        let all = (0..values.len()).filter(|i| values[*i].is_some_and(|v| is_same(v, value)));
        let all: Vec<usize> = all.collect();
        html! {
            " at " (shown.link(all[0]))
            @if all.len() > 1 { " and " (plural(all.len() - 1, "other point", "other points")) }
        }
    };
    let known = values.iter().flatten().count();
    let missing = values.len() - known;
    html! {
        p {
            @if low == high {
                "It is " (quantity(low, &response.unit, 5)) " at " (plural(known, "point", "points")) ", so that there is nothing to plot."
            } @else {
                "Smallest: " b { (quantity(low, &response.unit, 5)) } (at(low)) ". Largest: " b { (quantity(high, &response.unit, 5)) } (at(high)) "."
            }
            @if missing > 0 { " " (plural(missing, "point has", "points have")) " no value; nothing is put in their place." }
        }
    }
}

/// A response as the page shows it, without its unit.
fn cell(value: f64, unit: &str) -> String {
    number(value * shown(unit).0, 5)
}

/// How many pictures of points there are, where not all have one.
fn pictures_note(shown: &Shown<'_>) -> Option<String> {
    let n = shown.family.points.len();
    (n > MOST).then(|| format!("Pictures are drawn of the first {MOST} of {n} points."))
}

/// At how many points something is warned of.
pub(super) fn warned(shown: &Shown<'_>) -> Markup {
    let n = shown.warnings.iter().filter(|w| !w.is_empty()).count();
    html! {
        @if n > 0 {
            section class="warnings" {
                h2 { "Warnings" }
                p { "Steps of " (n) " of " (shown.family.points.len()) " points warn of something. The table counts them; what they say stands in the place of each point." }
            }
        }
    }
}
