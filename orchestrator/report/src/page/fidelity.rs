//! Speed against error.

use crate::input::ReportInput;
use crate::plain::{Plot, Series, Style};
use crate::read::{Measure, OfClass, TARGETS, Way, Ways, advice, ways};
use crate::units::{bytes, duration, fixed, shown};
use maud::{Markup, html};

/// Errors that have a mean over defects and a total, with what stands over both in the table.
const BOTH: [(Measure, &str); 4] = [
    (Measure::Defects, "error"),
    (Measure::Length, "length"),
    (Measure::Amplitude, "amplitude"),
    (Measure::BridgingArea, "bridging area"),
];

/// Errors that are plotted, and whether the plot is open when the page is; the others open with a click on their names.
const PLOTTED: [(Measure, bool); Measure::COUNT] = [
    (Measure::Defects, true),
    (Measure::TotalDefects, true),
    (Measure::Length, false),
    (Measure::TotalLength, false),
    (Measure::Amplitude, false),
    (Measure::TotalAmplitude, false),
    (Measure::BridgingArea, false),
    (Measure::TotalBridgingArea, false),
    (Measure::Position, true),
    (Measure::Distance, false),
    (Measure::Shear, false),
];

/// Whether something was compared with a reference, or with fine runs of zones.
pub(super) fn has(input: &ReportInput) -> bool {
    !ways(input).list.is_empty()
}

/// Table, plots and advice; nothing where nothing was refined.
pub(super) fn section(input: &ReportInput) -> Markup {
    let ways = ways(input);
    html! {
        @if !ways.list.is_empty() {
            section id="fidelity" {
                h2 { "Speed against error" }
                p {
                    "Error: the mean over all defects of the " (ways.yardstick()) ", and false ones, of the relative error of a wrinkle's length or a bridging's area; a missed and a false one count as 100 %. "
                    "Times of several runs are added up, also of those that ran side by side. Position, distance: root mean square over the plies; shear: of its quantiles. A mark ●: no other way is both cheaper and better."
                }
                @if ways.list.iter().any(|w| w.error(Measure::TotalDefects).is_some()) {
                    p { "In the mean a short wrinkle counts as much as a long one. The total counts every defect by its size: it is all that differs, with what is missed or false, over what the " (ways.yardstick()) " has. The mark ○ is of the total error." }
                }
                @if !ways.of_the_whole {
                    p { "Nobody ran the whole in fine elements here, so the fine runs of the zones are the measure, in these zones: how wrong they are themselves, and what lies outside of them, is not told." }
                }
                @if ways.list.iter().any(|w| w.start_time.is_some()) {
                    p { "A run that began late (from …) did a part of the process: what it began from is not in its cost, so it is not marked and not advised. Shares of the CPU time of such a reference are of that part." }
                }
                @let groups = ways.by_reference();
                @if groups.len() > 1 {
                    p { "Ways are held against those of the same reference alone: a way that one reference measured says nothing of the error by another." }
                }
                @for (of, ways) in &groups {
                    @if groups.len() > 1 { h3 { "By the reference of " code { (of) } } }
                    (group(ways))
                }
                p class="note" { "The same as data, with the front of every error: " code { (input.command("results")) " --front --format csv" } }
            }
        }
    }
}

/// Table, plots and advice of the ways that one reference measured.
fn group(ways: &Ways) -> Markup {
    html! {
        div class="scroll" { table {
            thead {
                tr { th colspan="6" {}
                    @for (_, name) in BOTH { th class="group" colspan="2" { (name) } }
                    th colspan="5" {} }
                tr {
                    th { "way" } th {}
                    @for head in ["CPU", "wall, added up", "memory", "CPU share"] { th class="n" { (head) } }
                    @for _ in BOTH { th class="n" { "mean" } th class="n" { "total" } }
                    @for head in ["missed", "false", "position, mm", "distance, mm", "shear, deg"] { th class="n" { (head) } }
                }
            }
            tbody { @for way in &ways.list { (row(way)) } }
        } }
        (by_size(ways))
        p { "Error over CPU time, for the error that you choose:" }
        @for (measure, open) in PLOTTED {
            @if ways.list.iter().any(|w| w.error(measure).is_some()) {
                details class="error-plot" open[open] {
                    summary { (measure.title()) }
                    (plot(ways, measure))
                }
            }
        }
        @for text in advice(ways, &TARGETS) { p { (text) } }
    }
}

fn percent(v: f64) -> String {
    format!("{} %", fixed(100.0 * v, 1))
}

/// A dash for what is not known.
fn told(v: Option<f64>, write: impl Fn(f64) -> String) -> String {
    v.map_or("–".to_owned(), write)
}

fn row(way: &Way) -> Markup {
    // A drape costs a ten-thousandth.
    let share = format!(
        "{} %",
        fixed(100.0 * way.share, if way.share < 0.01 { 2 } else { 1 })
    );
    let sum = |a: usize, b: usize| told(way.counts.map(|c| c[a] + c[b]), |v| fixed(v, 0));
    let millimetres = |m: Measure| told(way.error(m), |v| fixed(1e3 * v, 2));
    let shear = told(way.error(Measure::Shear), |v| fixed(v.to_degrees(), 2));
    html! {
        tr {
            th { (way.label()) }
            td { @if way.is_on_front(Measure::Defects) { "●" } @if way.is_on_front(Measure::TotalDefects) { "○" } }
            td class="n" { (duration(way.cpu_seconds)) } td class="n" { (duration(way.wall_seconds)) }
            td class="n" { (told(way.peak_memory, |v| bytes(v as u64))) }
            td class="n" { (share) }
            @for (mean, _) in BOTH {
                td class="n" { (told(way.error(mean), percent)) }
                td class="n" { (told(mean.total().and_then(|m| way.error(m)), percent)) }
            }
            td class="n" { (sum(0, 2)) } td class="n" { (sum(1, 3)) }
            td class="n" { (millimetres(Measure::Position)) } td class="n" { (millimetres(Measure::Distance)) }
            td class="n" { (shear) }
        }
    }
}

/// The errors by kind and size of the defects; nothing where no comparison tells them.
fn by_size(ways: &Ways) -> Markup {
    let rows = |w: &Way| !w.classes.is_empty();
    let count = |v: f64| fixed(v, 0);
    let of = |c: &OfClass| {
        html! {
            td { (c.title) }
            @for v in [c.pairs, c.missed, c.wrong] { td class="n" { (count(v)) } }
            @for v in [c.mean, c.total] { td class="n" { (told(v, percent)) } }
        }
    };
    html! {
        @if ways.list.iter().any(rows) {
            details {
                summary { "Errors by size: short and long wrinkles, small and large bridging" }
                p class="note" { "A defect is of the class of its size in the " (ways.yardstick()) ", a false one of that of its own. Mean: of the relative errors of length or area over what both have. Total: all that differs, with what is missed or false, over what the " (ways.yardstick()) " has of the class." }
                div class="scroll" { table {
                    thead { tr { th { "way" } th { "defects" }
                        @for head in ["in both", "missed", "false", "mean error", "total error"] { th class="n" { (head) } } } }
                    tbody { @for way in ways.list.iter().filter(|w| rows(w)) {
                        @for (k, class) in way.classes.iter().enumerate() {
                            tr { @if k == 0 { th rowspan=(way.classes.len()) { (way.label()) } } (of(class)) }
                        }
                    } }
                } }
            }
        }
    }
}

/// An error of the ways over their cost, and its front.
fn plot(ways: &Ways, measure: Measure) -> Markup {
    let (factor, unit) = match measure.unit() {
        "1" => (100.0, "%"),
        unit => shown(unit),
    };
    let told: Vec<(&Way, f64)> = (ways.list.iter())
        .filter_map(|w| Some((w, factor * w.error(measure)?)))
        .collect();
    let on_front = |w: &&(&Way, f64)| w.0.is_on_front(measure);
    let front: Vec<(&Way, f64)> = told.iter().filter(on_front).copied().collect();
    let series = |name: &str, colour: usize, style: Style, of: &[(&Way, f64)]| Series {
        name: name.to_owned().into(),
        colour,
        style,
        x: of.iter().map(|(w, _)| 100.0 * w.share).collect(),
        y: of.iter().map(|(_, e)| *e).collect(),
    };
    let mut all = vec![series("front", 0, Style::Dashed, &front)];
    all.extend(
        (told.iter().enumerate()).map(|(k, w)| series(&w.0.label(), k + 1, Style::Points, &[*w])),
    );
    let x_label = format!("CPU time over that of the {} (%)", ways.yardstick());
    Plot {
        title: format!("{} over CPU time", measure.title()).into(),
        x_label: x_label.into(),
        y_label: format!("error ({unit})").into(),
        series: all,
        from_zero: true,
        legend_of_one: true,
        size: [640.0, 300.0],
        ..Plot::default()
    }
    .svg()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn way(model: &str, share: f64, error: f64, start_time: Option<f64>) -> Way {
        Way {
            comparison: "comparison".into(),
            model: model.into(),
            name: model.into(),
            cpu_seconds: 100.0 * share,
            wall_seconds: 100.0 * share,
            peak_memory: None,
            share,
            errors: [Some(error); Measure::COUNT],
            counts: None,
            classes: Vec::new(),
            is_reference: model == "reference",
            measured_by: "comparison".into(),
            start_time,
            on_front: [start_time.is_none(); Measure::COUNT],
        }
    }

    #[test]
    fn a_run_that_began_late_is_labelled_so_in_table_and_plot_and_stands_off_the_front() {
        let ways = Ways {
            list: vec![
                way("coarse run alone", 0.1, 0.8, None),
                way("late", 0.5, 0.02, Some(0.6)),
                way("reference", 1.0, 0.0, Some(0.7)),
                way("coarse run and zones", 1.2, 0.01, None),
            ],
            of_the_whole: true,
        };
        let table: String = ways.list.iter().map(|w| row(w).0).collect();
        let plot = plot(&ways, Measure::Defects).0;
        let (aria, legend) = plot.split_once("<figcaption").unwrap();
        for text in [&table[..], aria, legend] {
            for label in ["late (from 0.60 s)", "reference (from 0.70 s)"] {
                assert!(text.contains(label), "{label}: {text}");
            }
            assert!(!text.contains("alone (from"), "{text}");
        }
        // The front joins what did the whole process, the first and the last: one line of two places.
        let dashed = plot.split_once("class=\"line dashed c0\" d=\"").unwrap().1;
        let path = &dashed[..dashed.find('"').unwrap()];
        assert_eq!(path.matches(['M', 'L']).count(), 2, "{path}");
    }
}
