//! Speed against error.

use crate::fidelity::{Way, advice, ways};
use crate::input::ReportInput;
use crate::plot::{Plot, Series, Style};
use crate::units::{duration, fixed};
use maud::{Markup, html};

/// Errors for which the cheapest way is told.
const TARGETS: [f64; 3] = [0.2, 0.1, 0.05];

/// Whether something was compared with a reference.
pub(super) fn has(input: &ReportInput) -> bool {
    !ways(input).is_empty()
}

/// Table, plot and advice; nothing without a reference.
pub(super) fn section(input: &ReportInput) -> Markup {
    let ways = ways(input);
    html! {
        @if !ways.is_empty() {
            section id="fidelity" {
                h2 { "Speed against error" }
                p {
                    "Error: the mean over all defects of the reference of the relative error of a wrinkle's length or a bridging's area; a missed one counts as 100 %. "
                    "A mark: no other way is both cheaper and better."
                }
                div class="scroll" { table {
                    thead { tr {
                        th { "way" } th {}
                        @for head in ["CPU", "wall", "CPU of the reference's", "error", "length", "amplitude", "bridging area", "missed", "false"] {
                            th class="n" { (head) }
                        }
                    } }
                    tbody { @for way in &ways { (row(way)) } }
                } }
                (plot(&ways))
                @for text in advice(&ways, &TARGETS) { p { (text) } }
            }
        }
    }
}

fn row(way: &Way) -> Markup {
    let percent = |v: f64| format!("{} %", fixed(100.0 * v, 1));
    let error = |v: Option<f64>| v.map_or("–".to_owned(), percent);
    let sum = |a: usize, b: usize| way.counts.map_or("–".to_owned(), |c| fixed(c[a] + c[b], 0));
    html! {
        tr {
            th { (way.name) } td { @if way.on_front { "●" } }
            td class="n" { (duration(way.cpu)) } td class="n" { (duration(way.wall)) }
            td class="n" { (percent(way.share)) } td class="n" { (percent(way.error)) }
            @for v in way.errors { td class="n" { (error(v)) } }
            td class="n" { (sum(0, 2)) } td class="n" { (sum(1, 3)) }
        }
    }
}

fn plot(ways: &[Way]) -> Markup {
    let percent =
        |of: fn(&Way) -> f64, w: &[&Way]| w.iter().map(|w| 100.0 * of(w)).collect::<Vec<_>>();
    let front: Vec<&Way> = ways.iter().filter(|w| w.on_front).collect();
    let series = |name: &str, colour: usize, style: Style, of: &[&Way]| Series {
        name: name.to_owned().into(),
        colour,
        style,
        x: percent(|w| w.share, of).into(),
        y: percent(|w| w.error, of).into(),
    };
    let mut all = vec![series("front", 0, Style::Dashed, &front)];
    all.extend((ways.iter().enumerate()).map(|(k, w)| series(&w.name, k + 1, Style::Points, &[w])));
    Plot {
        title: "Error over CPU time",
        x_label: "CPU time over the reference's (%)",
        y_label: "error (%)",
        series: all,
        from_zero: true,
        bound: None,
        ceiling: None,
        legend_of_one: true,
        size: [640.0, 300.0],
    }
    .svg()
}
