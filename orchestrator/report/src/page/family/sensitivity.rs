//! Which variables a response depends on, by what the points allow to say.

use crate::family::Sampled;
use crate::page::family::shown::Shown;
use crate::page::family::statistics::{
    Effects, Estimate, LEAST, LEAST_SAMPLE, effects, first_order, grid_indices, rank_correlation,
};
use crate::units::{fixed, plural, quantity};
use maud::{Markup, html};
use std::collections::HashMap;

/// Of a sample at most this part may be without a value, so that the rest stands for it.
const MISSING: f64 = 0.05;
/// And this part of a variable's values must differ: it is drawn, not set.
const DRAWN: f64 = 0.9;

/// What is known of a variable.
struct Row {
    variable: usize,
    correlation: Option<Estimate>,
    /// First-order index.
    first: Option<Estimate>,
    /// Total index of a grid.
    total: Option<f64>,
    effects: Option<Effects>,
}

/// Whether Sobol indices can be told.
enum Indices {
    /// Exactly: every combination of the values is there once.
    Grid,
    /// Of a sample, as an estimate.
    Sample,
    /// Not, and why.
    None(String),
}

pub(super) fn section(shown: &Shown<'_>, response: usize, values: &[Option<f64>]) -> Markup {
    let with: Vec<usize> = (0..values.len()).filter(|p| values[*p].is_some()).collect();
    if shown.varied.is_empty() {
        return html! {};
    }
    let indices = indices(shown, &with);
    let rows = rows(shown, values, &with, &indices);
    let unit = &shown.family.responses[response].unit;
    let some = |f: &dyn Fn(&Row) -> bool| rows.iter().any(f);
    let (ranks, first) = (
        some(&|r| r.correlation.is_some()),
        some(&|r| r.first.is_some()),
    );
    let (total, effects) = (some(&|r| r.total.is_some()), some(&|r| r.effects.is_some()));
    html! {
        h4 { @if shown.varied.len() > 1 { "Which variables matter" } @else { "Whether it grows" } }
        @if ranks || first || effects {
            div class="scroll" role="region" tabindex="0" aria-label="Sensitivity" { table class="sensitivity" {
                thead { tr { th scope="col" { "variable" }
                    @if first { th scope="col" class="n" { "first-order index (Sobol)" } }
                    @if total { th scope="col" class="n" { "total index (Sobol)" } }
                    @if ranks { th scope="col" class="n" { "rank correlation (Spearman)" } th scope="col" { "−1 … 1" } }
                    @if effects { th scope="col" class="n" { "effect over the whole range (Morris)" } th scope="col" class="n" { "its deviation" } th scope="col" class="n" { "pairs" } }
                } }
                tbody { @for r in &rows { tr {
                    th scope="row" { (shown.family.variables[r.variable].name) }
                    @if first { td class="n" { (told(r.first, matches!(indices, Indices::Grid))) } }
                    @if total { td class="n" { @if let Some(t) = r.total { (fixed(t, 2)) } } }
                    @if ranks { td class="n" { (told(r.correlation, false)) } td { @if let Some(e) = r.correlation { (whisker(e)) } } }
                    @if effects { (effect_cells(r.effects, unit)) }
                } } }
            } }
        }
        @for text in notes(shown, &rows, &indices, [with.len(), values.len()]) { p class="note" { (text) } }
    }
}

fn told(estimate: Option<Estimate>, exact: bool) -> String {
    match estimate {
        None => "–".into(),
        Some(e) if exact => fixed(e.value, 2),
        Some(e) => format!(
            "{} ({} to {})",
            fixed(e.value, 2),
            fixed(e.low, 2),
            fixed(e.high, 2)
        ),
    }
}

fn effect_cells(effects: Option<Effects>, unit: &str) -> Markup {
    let said = |v: f64| quantity(v, unit, 3);
    html! {
        @match effects {
            Some(e) => {
                td class="n" { (said(e.size.value)) " (" (said(e.size.low)) " to " (said(e.size.high)) ")" }
                td class="n" { (said(e.deviation)) } td class="n" { (e.pairs) }
            },
            None => { td class="n" { "–" } td {} td {} }
        }
    }
}

/// A correlation and its range on a line from -1 to 1.
fn whisker(e: Estimate) -> Markup {
    let x = |v: f64| format!("{:.1}", 60.0 + 56.0 * v.clamp(-1.0, 1.0));
    html! {
        svg class="whisker" viewBox="0 0 120 16" width="120" height="16" aria-hidden="true" {
            path class="axis" d="M4 8H116M60 3V13" {}
            path class="spread" d={ "M" (x(e.low)) " 8H" (x(e.high)) } {}
            path class="dot c0" d={ "M" (x(e.value)) " 8h0" } {}
        }
    }
}

fn indices(shown: &Shown<'_>, with: &[usize]) -> Indices {
    let family = shown.family;
    let n = family.points.len();
    let combinations = shown.varied.iter().fold(1usize, |a, v| {
        a.saturating_mul(shown.levels[*v].values.len())
    });
    if combinations == n && shown.varied.len() > 1 {
        return match n - with.len() {
            0 => Indices::Grid,
            m => Indices::None(format!(
                "Sobol indices of a grid need a value at every point; {} none.",
                plural(m, "point has", "points have")
            )),
        };
    }
    let is_sample = |s: &Sampled| s.method != "grid" && s.count as usize == n;
    // A variable that takes few values was set; and what a condition left out is no sample of independent variables.
    let drawn = |v: &usize| {
        shown.levels[*v].numbers().is_some()
            && shown.levels[*v].values.len() as f64 >= DRAWN * n as f64
    };
    let one_sample = family.samples.len() == 1 && family.samples.iter().all(is_sample);
    if one_sample && shown.varied.iter().all(drawn) {
        let missing = (n - with.len()) as f64;
        if with.len() < LEAST_SAMPLE {
            return Indices::None(format!(
                "Sobol indices of a sample need {LEAST_SAMPLE} points with a value; there are {}.",
                with.len()
            ));
        }
        if missing > MISSING * n as f64 {
            return Indices::None(
                "There are no Sobol indices: too many points of the sample have no value.".into(),
            );
        }
        return Indices::Sample;
    }
    if shown.varied.len() == 1 {
        return Indices::None(String::new());
    }
    Indices::None("There are no Sobol indices: they need every combination of the values once (a grid), or one sample in which all variables are numbers drawn by themselves.".into())
}

fn rows(shown: &Shown<'_>, values: &[Option<f64>], with: &[usize], indices: &Indices) -> Vec<Row> {
    let y: Vec<f64> = with.iter().filter_map(|p| values[*p]).collect();
    let of = |v: usize| -> Vec<usize> { with.iter().map(|p| shown.levels[v].of[*p]).collect() };
    let on_grid = matches!(indices, Indices::Grid).then(|| {
        let levels: Vec<Vec<usize>> = shown.varied.iter().map(|v| of(*v)).collect();
        let levels: Vec<&[usize]> = levels.iter().map(Vec::as_slice).collect();
        grid_indices(&levels, &y)
    });
    let on_grid = on_grid.flatten();
    let one = |(k, v): (usize, &usize)| {
        let numbers = shown.levels[*v].numbers();
        let x = numbers.map(|all| of(*v).iter().map(|l| all[*l]).collect::<Vec<f64>>());
        let correlation = x.as_ref().and_then(|x| rank_correlation(x, &y));
        let exact = |value: f64| Estimate {
            value,
            low: value,
            high: value,
        };
        let first = match indices {
            Indices::Grid => on_grid.as_ref().map(|g| exact(g[k][0])),
            Indices::Sample => x.as_ref().and_then(|x| first_order(x, &y)),
            Indices::None(_) => None,
        };
        // Of one variable alone the plot tells more.
        let effects = x.as_ref().filter(|_| shown.varied.len() > 1);
        let effects = effects.and_then(|_| of_pairs(shown, *v, with, &y));
        Row {
            variable: *v,
            correlation,
            first,
            total: on_grid.as_ref().map(|g| g[k][1]),
            effects,
        }
    };
    let mut rows: Vec<Row> = shown.varied.iter().enumerate().map(one).collect();
    let weight = |r: &Row| {
        let size = |e: Option<Estimate>| e.map(|e| e.value.abs());
        let effect = r.effects.map_or(0.0, |e| e.size.value);
        (
            r.total
                .or(size(r.first))
                .or(size(r.correlation))
                .unwrap_or(-1.0),
            effect,
        )
    };
    rows.sort_by(|a, b| {
        let (x, y) = (weight(a), weight(b));
        y.0.total_cmp(&x.0).then(y.1.total_cmp(&x.1))
    });
    rows
}

/// Elementary effects of a variable between neighbours that differ in it alone.
fn of_pairs(shown: &Shown<'_>, variable: usize, with: &[usize], y: &[f64]) -> Option<Effects> {
    let places = &shown.scales[variable].at;
    let (first, last) = (places.first()?, places.last()?);
    let at = |p: &usize| (places[shown.levels[variable].of[*p]] - first) / (last - first);
    let at: Vec<f64> = with.iter().map(at).collect();
    let others = shown.others(&[variable]);
    let mut known: HashMap<Vec<usize>, usize> = HashMap::new();
    let group = with.iter().map(|p| {
        let key: Vec<usize> = others.iter().map(|o| shown.levels[*o].of[*p]).collect();
        let next = known.len();
        *known.entry(key).or_insert(next)
    });
    let group: Vec<usize> = group.collect();
    effects(&at, &group, y)
}

/// What the numbers mean, and why others are not there.
fn notes(
    shown: &Shown<'_>,
    rows: &[Row],
    indices: &Indices,
    [with, all]: [usize; 2],
) -> Vec<String> {
    let mut notes = Vec::new();
    let has = |f: &dyn Fn(&Row) -> bool| rows.iter().any(f);
    match indices {
        Indices::Grid if has(&|r| r.first.is_some()) => notes.push(
            "Sobol indices: the part of the response's variance that is due to the variable by itself (first order), and with all that it does together with others (total). They are exact for this grid, each of its values being as likely as the others; another range has others.".into(),
        ),
        Indices::Sample if has(&|r| r.first.is_some()) => notes.push(
            "First-order Sobol index: the part of the response's variance that is due to the variable by itself, estimated from the sample by cosines over the ranks of the variable (Plischke 2012), with a range of 95 % from random halves of it.".into(),
        ),
        Indices::None(why) if !why.is_empty() => notes.push(why.clone()),
        _ => {}
    }
    if has(&|r| r.correlation.is_some()) {
        notes.push("Rank correlation: 1 where the response only grows with the variable, −1 where it only falls; in brackets a range of 95 %, by drawing the points anew 1000 times (bootstrap). A hump, as over an angle, has none, however much it matters: look at the plots.".into());
    } else if with < LEAST {
        notes.push(format!(
            "{} a value: a rank correlation needs {LEAST}.",
            plural(with, "point has", "points have")
        ));
    }
    if has(&|r| r.effects.is_some()) {
        notes.push("Effect: between neighbours that differ in the variable alone, how much the response changes, as if it did so over the whole range of the variable; the mean of the sizes with a range of 95 %. A deviation as large as the effect says that it depends on where one is.".into());
    }
    let texts = (rows.iter()).filter(|r| shown.levels[r.variable].numbers().is_none());
    let texts: Vec<usize> = texts.map(|r| r.variable).collect();
    if !texts.is_empty() {
        notes.push(format!(
            "The values of {} have no order, and so no rank.",
            shown.names(&texts)
        ));
    }
    if with < all && with >= LEAST {
        notes.push(format!("Of {all} points {with} have a value. If it depends on the variables which have none, so do these numbers."));
    }
    notes
}
