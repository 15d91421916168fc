//! Speed against error.

use crate::input::ReportInput;
use crate::plain::{Plot, Series, Style};
use crate::read::{Measure, Way, Ways, advice, ways};
use crate::units::{bytes, duration, fixed};
use maud::{Markup, html};

/// Errors for which the cheapest way is told.
const TARGETS: [f64; 3] = [0.2, 0.1, 0.05];

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
                    "Times of several runs are added up, also of those that ran side by side. Position, distance: root mean square over the plies; shear: of its quantiles. A mark: no other way is both cheaper and better."
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
            thead { tr {
                th { "way" } th {}
                @for head in ["CPU", "wall, added up", "memory", "CPU share", "error", "length", "amplitude", "bridging area", "missed", "false", "position, mm", "distance, mm", "shear, deg"] {
                    th class="n" { (head) }
                }
            } }
            tbody { @for way in &ways.list { (row(way)) } }
        } }
        (plot("Error of defects over CPU time", "error (%)", ways, Measure::Defects, 100.0))
        @if ways.list.iter().any(|w| w.error(Measure::Position).is_some()) {
            (plot("Error of position over CPU time", "error (mm)", ways, Measure::Position, 1e3))
        }
        @for text in advice(ways, &TARGETS) { p { (text) } }
    }
}

fn row(way: &Way) -> Markup {
    let percent = |v: f64| format!("{} %", fixed(100.0 * v, 1));
    // A drape costs a ten-thousandth.
    let share = format!(
        "{} %",
        fixed(100.0 * way.share, if way.share < 0.01 { 2 } else { 1 })
    );
    let told = |v: Option<f64>, write: &dyn Fn(f64) -> String| v.map_or("–".to_owned(), write);
    let sum = |a: usize, b: usize| told(way.counts.map(|c| c[a] + c[b]), &|v| fixed(v, 0));
    let [error, length, amplitude, area, position, distance, shear] = way.errors;
    let millimetres = |v: f64| fixed(1e3 * v, 2);
    html! {
        tr {
            th { (way.label()) } td { @if way.is_on_front(Measure::Defects) { "●" } }
            td class="n" { (duration(way.cpu_seconds)) } td class="n" { (duration(way.wall_seconds)) }
            td class="n" { (told(way.peak_memory, &|v| bytes(v as u64))) }
            td class="n" { (share) } td class="n" { (told(error, &percent)) }
            @for v in [length, amplitude, area] { td class="n" { (told(v, &percent)) } }
            td class="n" { (sum(0, 2)) } td class="n" { (sum(1, 3)) }
            td class="n" { (told(position, &millimetres)) } td class="n" { (told(distance, &millimetres)) }
            td class="n" { (told(shear, &|v| fixed(v.to_degrees(), 2))) }
        }
    }
}

/// An error of the ways, times `factor`, over their cost, and its front.
fn plot(title: &str, y_label: &str, ways: &Ways, measure: Measure, factor: f64) -> Markup {
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
        title: title.into(),
        x_label: x_label.into(),
        y_label: y_label.into(),
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
            errors: [Some(error); 7],
            counts: None,
            is_reference: model == "reference",
            measured_by: "comparison".into(),
            start_time,
            on_front: [start_time.is_none(); 7],
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
        let plot = plot("Error", "error (%)", &ways, Measure::Defects, 100.0).0;
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
