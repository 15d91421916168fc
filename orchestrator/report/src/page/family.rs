//! The page of a study: its table, its responses over what was varied, and every point in its place.

pub(super) mod costs;
mod failed;
pub(crate) mod gathered;
mod map;
mod pictures;
mod places;
mod sensitivity;
pub(super) mod shown;
mod slices;
mod statistics;
mod table;

use crate::draw::Drawn;
use crate::family::{Origin, Response};
use crate::page::family::shown::{Shown, is_same, range_of};
use crate::units::{plural, quantity};
use maud::{Markup, html};

/// Responses that are drawn.
const RESPONSES: usize = 12;

/// The whole of what is told of the study.
///
/// # Errors
/// When a picture cannot be encoded.
pub(super) fn sections(shown: &Shown<'_>) -> Drawn {
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

fn response(shown: &Shown<'_>, r: usize) -> Drawn {
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
