//! Energies, loads and contact over time.

use crate::page::content::Content;
use crate::plain::{Plot, Series, Style};
use crate::read::Run;
use crate::units::{fixed, number, plural};
use maud::{Markup, html};
use plyflow_model::artifact::PenetrationPeak;

/// A column of a history, its name in the legend, its colour, and what makes the plot's unit of SI.
type Column = (&'static str, &'static str, usize, f64);

/// Energies of a run's history; the internal one is summed.
const ENERGIES: [Column; 6] = [
    ("external", "external work", 0, 1.0),
    ("kinetic", "kinetic", 2, 1.0),
    ("contact", "contact", 3, 1.0),
    ("friction", "friction loss", 4, 1.0),
    ("damping", "damping loss", 5, 1.0),
    ("drift", "drift", 6, 1.0),
];

/// A plot of loads: title, label of its values, and what is drawn.
type Loads = (&'static str, &'static str, &'static [Column]);

/// Runs whose courses are printed too. Those of the zones of a part would fill a page each.
const ON_PAPER: usize = 1;

/// Loads of a press.
const PRESS: [Loads; 2] = [
    (
        "Force of the punch",
        "force (N)",
        &[("punch_force", "punch", 0, 1.0)],
    ),
    (
        "Travel of punch and holder",
        "travel (mm)",
        &[
            ("frame_height", "punch, from its end", 0, 1e3),
            ("holder_travel", "holder", 1, 1e3),
        ],
    ),
];

/// Loads of a forming by membranes.
const MEMBRANE: [Loads; 2] = [
    (
        "Pressures",
        "pressure (kPa)",
        &[
            ("cavity_pressure", "cavity", 0, 1e-3),
            ("bag_pressure", "bag", 1, 1e-3),
        ],
    ),
    (
        "Frame height",
        "height (mm)",
        &[("frame_height", "frame", 0, 1e3)],
    ),
];

/// Whether any run tells of its energies.
pub(super) fn has(content: &Content<'_>) -> bool {
    !runs(content).is_empty()
}

/// All forming runs and coupons, and whether they are whole: driven by pressure and frame, not by their edges. Last come those that no
/// study draws.
fn runs<'a>(content: &'a Content<'_>) -> Vec<(bool, &'a Run)> {
    let studies = &content.material.studies;
    let mut runs: Vec<(bool, &Run)> = Vec::new();
    for study in studies {
        let whole = study.global.iter().chain(&study.reference);
        runs.extend(whole.map(|r| (true, r)));
        runs.extend(study.locals.iter().map(|l| (false, &l.run)));
    }
    let coupons = content.shown.iter().filter_map(|s| s.run.as_ref());
    runs.extend(coupons.map(|r| (false, r)));
    for run in studies.iter().flat_map(|s| &s.further) {
        if runs.iter().all(|(_, r)| r.instance != run.instance) {
            runs.push((false, run));
        }
    }
    runs
}

/// Energies and contact of all runs.
pub(super) fn section(content: &Content<'_>) -> Markup {
    let runs = runs(content);
    html! {
        @if !runs.is_empty() {
            section id="energy" {
                h2 { "Energy and contact" }
                (health(&runs))
                p class="note" { "Kinetic over internal energy counts while the internal one is above 5 % of its largest; curves end at three times the bound." }
                @let shown = courses(&runs);
                @for (k, (whole, run)) in shown.iter().enumerate() {
                    div class=[(k >= ON_PAPER).then_some("on-screen")] {
                        h3 { code { (run.label) } }
                        div class="plots" { (plots(run, *whole)) }
                    }
                }
                p class="on-paper note" {
                    @if shown.len() > ON_PAPER { "The courses of " (plural(shown.len() - ON_PAPER, "further run", "further runs")) ", and the tables of penetration and depth" }
                    @else { "The tables of penetration and depth" }
                    " stand in this report on the screen. What is beyond a bound is among the warnings."
                }
                div class="on-screen" { (penetrations(&runs)) (watched(&runs)) }
            }
        }
    }
}

/// The runs that have a history, those of the whole first.
fn courses<'a>(runs: &[(bool, &'a Run)]) -> Vec<(bool, &'a Run)> {
    let told = runs.iter().filter(|(_, r)| r.history.get("time").is_some());
    let mut told: Vec<(bool, &Run)> = told.copied().collect();
    told.sort_by_key(|(whole, _)| !whole);
    told
}

fn percent(v: Option<f64>) -> String {
    v.map_or("–".into(), |v| format!("{} %", fixed(100.0 * v, 2)))
}

fn health(runs: &[(bool, &Run)]) -> Markup {
    html! {
        div class="scroll" { table {
            thead { tr { th { "run" } th class="n" { "peak kinetic / internal" } th class="n" { "bound" } th { "kept" }
                th class="n" { "peak drift / external work" } th class="n" { "hourglass / internal" } } }
            tbody { @for (_, r) in runs {
                @let e = r.facts.energy.unwrap_or_default();
                tr { th { (r.label) } td class="n" { (percent(e.peak_kinetic_ratio)) } td class="n" { (percent(r.kinetic_bound)) }
                    @match e.kinetic_bound_kept {
                        Some(true) => td class="met" { "✓ kept" },
                        Some(false) => td class="missed" { "✗ missed" },
                        None => td { "–" },
                    }
                    td class="n" { (percent(e.peak_drift_ratio)) } td class="n" { (percent(e.hourglass_ratio)) } }
            } }
        } }
    }
}

/// A series over the times of a history.
fn over<'a>(time: &'a [f64], name: &'a str, colour: usize, values: Vec<f64>) -> Series<'a> {
    Series {
        name: name.into(),
        colour,
        style: Style::Line,
        x: time.into(),
        y: values.into(),
    }
}

/// A plot over the time of a run.
fn plot<'a>(title: &'a str, y_label: &'a str, series: Vec<Series<'a>>) -> Plot<'a> {
    Plot {
        title: title.into(),
        x_label: "time (s)".into(),
        y_label: y_label.into(),
        series,
        from_zero: true,
        size: [560.0, 290.0],
        ..Plot::default()
    }
}

fn plots(run: &Run, whole: bool) -> Markup {
    let h = &run.history;
    let time = h.get("time").unwrap_or_default();
    let scaled = |(name, shown, colour, factor): &Column| {
        let values = h.get(name)?.iter().map(|v| v * factor).collect();
        Some(over(time, shown, *colour, values))
    };
    let mut energies: Vec<Series<'_>> = ENERGIES.iter().filter_map(scaled).collect();
    let internal = h.internal();
    if let Some(values) = &internal {
        let at = 1.min(energies.len());
        energies.insert(at, over(time, "internal", 1, values.clone()));
    }
    let is_press = h.get("punch_force").is_some();
    let loads = if is_press { &PRESS } else { &MEMBRANE };
    html! {
        (plot("Energies", "energy (J)", energies).svg())
        @if let (Some(kinetic), Some(internal)) = (h.get("kinetic"), &internal) { (ratio_plot(run, kinetic, internal).svg()) }
        @if whole { @for (title, y_label, columns) in loads { (plot(title, y_label, columns.iter().filter_map(scaled).collect()).svg()) } }
    }
}

/// Kinetic over internal energy in per cent; left out while the internal energy is below 5 % of its peak, where
/// the ratio says nothing.
fn ratio_plot<'a>(run: &'a Run, kinetic: &[f64], internal: &[f64]) -> Plot<'a> {
    let peak = internal.iter().copied().fold(0.0, f64::max);
    let ratio = |(k, i): (&f64, &f64)| {
        if *i > 0.05 * peak {
            100.0 * k / i
        } else {
            f64::NAN
        }
    };
    let values = kinetic.iter().zip(internal).map(ratio).collect();
    let bound = run.kinetic_bound.map(|b| (100.0 * b, "bound"));
    let time = run.history.get("time").unwrap_or_default();
    let series = vec![over(time, "ratio", 2, values)];
    Plot {
        ceiling: bound.map(|b| 3.0 * b.0),
        bound,
        ..plot("Kinetic over internal energy", "ratio (%)", series)
    }
}

fn penetrations(runs: &[(bool, &Run)]) -> Markup {
    let any =
        (runs.iter()).any(|(_, r)| r.facts.penetration.as_ref().is_some_and(|p| !p.is_empty()));
    let bound = runs.iter().find_map(|(_, r)| r.facts.overlap_bound);
    let on_the_way = |r: &Run| r.facts.overlap_peak_bound.or(r.facts.overlap_bound);
    let later = runs.iter().find_map(|(_, r)| r.facts.overlap_peak_bound);
    html! {
        @if any {
            h3 { "Penetration" }
            p { "The quantile is that of the nodes in touch; the overlap is what the bodies themselves share of the thinner one, by the quantile" @if let Some(b) = bound { " (bound " (fixed(100.0 * b, 0)) " %" @if let Some(b) = later { " at the end, " (fixed(100.0 * b, 0)) " % on the way" } ")" } ". Over the whole run the quantile is that of the times with 100 nodes in touch and more, where there are any." }
            div class="scroll" { table {
                thead {
                    tr { th rowspan="2" { "run" } th rowspan="2" { "pair" } th class="group" colspan="3" { "at the end" } th class="group" colspan="4" { "over the whole run" } }
                    tr {
                        @for _ in 0..2 { th class="n" { "largest (mm)" } th class="n" { "99.9 % (mm)" } th class="n" { "overlap" } }
                        th class="n" { "largest at (s)" }
                    }
                }
                tbody { @for (_, r) in runs { @for (i, (pair, p)) in r.facts.penetration.iter().flatten().enumerate() {
                    tr { th { @if i == 0 { (r.label) } } td { (pair) } (depths(p.max, p.q999, p.overlap, r.facts.overlap_bound)) (peak(p.peak.as_ref(), on_the_way(r))) }
                } } }
            } }
        }
    }
}

/// What the watch found, by pair.
fn watched(runs: &[(bool, &Run)]) -> Markup {
    let any = (runs.iter()).any(|(_, r)| r.facts.depth.as_ref().is_some_and(|d| !d.is_empty()));
    let place = |at: Option<[f64; 3]>| {
        at.map_or("–".into(), |at| at.map(|c| fixed(1e3 * c, 1)).join(", "))
    };
    html! {
        @if any {
            h3 { "Depth" }
            p { "How much nearer to each other bodies are than their thicknesses allow, found from the tool's triangles and the sheets' cells without asking the contacts; of every row of the history, not of frames alone. Pairs that never came into each other are left out. Between nodes of plies films hang through: that carries no load. "
                "Shares are of the thinner sheet." }
            div class="scroll" { table {
                thead {
                    tr { th rowspan="2" { "run" } th rowspan="2" { "pair" } th class="group" colspan="3" { "at the end" } th class="group" colspan="4" { "over the whole run" } }
                    tr {
                        @for _ in 0..2 { th class="n" { "deepest (mm)" } th class="n" { "share" } th class="n" { "at (mm)" } }
                        th class="n" { "at (s)" }
                    }
                }
                tbody { @for (_, r) in runs { @for (i, (pair, d)) in r.facts.depth.iter().flatten().enumerate() {
                    @let class = if d.bound.is_some_and(|b| d.end > b) { "n missed" } else { "n" };
                    tr { th { @if i == 0 { (r.label) } } td { (pair) }
                        td class=(class) { (number(d.end * 1e3, 3)) } td class="n" { (percent(Some(d.share))) } td class="n" { (place(d.place)) }
                        td class="n" { (number(d.peak.depth * 1e3, 3)) } td class="n" { (percent(Some(d.peak.share))) } td class="n" { (place(d.peak.place)) }
                        td class="n" { (fixed(d.peak.time, 3)) } }
                } } }
            } }
        }
    }
}

/// Cells of depths (m) and of the share of the thinner body.
fn depths(max: f64, q999: f64, overlap: Option<f64>, bound: Option<f64>) -> Markup {
    let class = match (overlap, bound) {
        (Some(o), Some(b)) if o > b => "n missed",
        _ => "n",
    };
    html! {
        td class="n" { (number(max * 1e3, 3)) } td class="n" { (number(q999 * 1e3, 3)) } td class=(class) { (percent(overlap)) }
    }
}

/// Cells of the largest over a run, and when it was.
fn peak(peak: Option<&PenetrationPeak>, bound: Option<f64>) -> Markup {
    html! {
        @match peak {
            Some(p) => { (depths(p.max, p.q999, p.overlap, bound)) td class="n" { (fixed(p.max_time, 3)) } }
            None => @for _ in 0..4 { td class="n" { "–" } },
        }
    }
}
