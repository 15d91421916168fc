//! The process over time: its phases, and what is prescribed in each.

use crate::draw::{Axis, CHARACTER, px, spot};
use crate::read::History;
use crate::units::{number, quantity};
use maud::{Markup, html};
use plyflow_model::scene::{
    DoubleDiaphragm, Hold, Press, PressureCourse, Process, SingleDiaphragm, Towards,
    WeightDirection,
};
use plyflow_model::stamping::{ForceCourse, PartMotion, Stamping, StampingPart, TOOL, Vertical};

/// Size of the diagram (px), and its margins: left, top, right, below.
const SIZE: [f64; 2] = [860.0, 300.0];
const AROUND: [f64; 4] = [58.0, 34.0, 58.0, 40.0];
/// Places along a curve.
const PLACES: usize = 400;

/// A curve of the history, with its name and what makes the unit of its axis of SI.
struct Curve<'a> {
    name: String,
    values: &'a [f64],
    factor: f64,
    /// Whether its axis is that at the right.
    right: bool,
}

/// The process in words and as a diagram; without a history, as of a drape, in words alone.
pub(super) fn drawn(process: &Process, history: Option<&History>) -> Markup {
    let (phases, told) = match process {
        Process::DoubleDiaphragm(p) => (bag(p), bag_words(p)),
        Process::SingleDiaphragm(p) => (single(p), single_words(p)),
        Process::Press(p) => (press(p), press_words(p)),
        Process::Stamping(p) => (stamping(p), stamping_words(p)),
    };
    let time = history.and_then(|h| h.get("time"));
    let curves = history.map(|h| curves(process, h)).unwrap_or_default();
    html! {
        h4 { "Process: " (title(process)) }
        @match time {
            Some(time) if !curves.is_empty() => { (diagram(&phases, time, &curves)) }
            _ => { p class="note" { "Phases: " (phases.iter().map(|(name, t)| format!("{name} {}", quantity(*t * 1e3, "ms", 4))).collect::<Vec<_>>().join(", ")) ". This run has followed none of them: a drape is geometry alone." } }
        }
        p class="note" { @if time.is_some() { (over(process)) } (told.join("; ")) "." }
    }
}

fn title(process: &Process) -> &'static str {
    match process {
        Process::DoubleDiaphragm(_) => "double-diaphragm forming",
        Process::SingleDiaphragm(_) => "single-diaphragm forming",
        Process::Press(_) => "press",
        Process::Stamping(_) => "stamping between rigid parts",
    }
}

/// What the pressures of the diagram are counted from.
fn over(process: &Process) -> &'static str {
    match process {
        Process::DoubleDiaphragm(_) => "Pressures are over the vacuum between the films. ",
        Process::SingleDiaphragm(_) => "Pressures are absolute. ",
        Process::Press(_) | Process::Stamping(_) => "",
    }
}

/// Phases with their durations (s).
fn bag(p: &DoubleDiaphragm) -> Vec<(&'static str, f64)> {
    let all = [
        ("bagging", p.bagging_time.si()),
        ("lowering", p.lowering_time.si()),
        ("drawing", p.drawing_time.si()),
        ("settling", p.settling_time.si()),
    ];
    all.into_iter().filter(|(_, t)| *t > 0.0).collect()
}

fn single(p: &SingleDiaphragm) -> Vec<(&'static str, f64)> {
    let all = [
        ("stretching", p.stretching_time.si()),
        ("lowering", p.lowering_time.si()),
        ("drawing", p.drawing_time.si()),
        ("settling", p.settling_time.si()),
    ];
    all.into_iter().filter(|(_, t)| *t > 0.0).collect()
}

fn stamping(p: &Stamping) -> Vec<(&'static str, f64)> {
    let all = [
        ("forming", p.forming_time.si()),
        ("settling", p.settling_time.si()),
    ];
    all.into_iter().filter(|(_, t)| *t > 0.0).collect()
}

fn press(p: &Press) -> Vec<(&'static str, f64)> {
    let all = [
        ("stroke", p.forming_time.si()),
        ("settling", p.settling_time.si()),
    ];
    all.into_iter().filter(|(_, t)| *t > 0.0).collect()
}

/// A pressure at its end, and whether a table tells its course.
fn course(c: &PressureCourse) -> String {
    let how = match c {
        PressureCourse::Course(_) => ", by a table",
        PressureCourse::Value(_) => "",
    };
    format!("{}{how}", quantity(c.last(), "Pa", 4))
}

fn weight_words(weight: Option<WeightDirection>) -> Option<String> {
    let towards = match weight? {
        WeightDirection::Tool => "weight towards the tool",
        WeightDirection::Away => "weight away from the tool",
    };
    Some(towards.to_owned())
}

fn single_words(p: &SingleDiaphragm) -> Vec<String> {
    let mm = |v: f64| quantity(v, "m", 5);
    let mut all = vec![
        format!(
            "frame {} by {}",
            mm(p.frame_length.si()),
            mm(p.frame_width.si())
        ),
        format!("forming pressure {}", course(&p.forming_pressure)),
        format!("surroundings at {}", quantity(p.surroundings.si(), "Pa", 4)),
        format!("clearance at the start {}", mm(p.clearance.si())),
        format!(
            "film stretched by {} % before",
            number(p.film_pre_stretch.0 * 100.0, 3)
        ),
    ];
    if !p.bed {
        let height = p.frame_height.map_or(0.0, |h| h.si());
        all.push(format!("no bed, the frame ends at z = {}", mm(height)));
    }
    all.extend(weight_words(p.weight));
    all
}

fn bag_words(p: &DoubleDiaphragm) -> Vec<String> {
    let mm = |v: f64| quantity(v, "m", 5);
    let mut all = vec![
        format!(
            "frame {} by {}",
            mm(p.frame_length.si()),
            mm(p.frame_width.si())
        ),
        format!("bag pressure {}", course(&p.bag_pressure)),
        format!("forming pressure {}", course(&p.forming_pressure)),
        format!("clearance at the start {}", mm(p.clearance.si())),
        format!(
            "films stretched by {} % before",
            number(p.film_pre_stretch.0 * 100.0, 3)
        ),
        format!(
            "films joined from {} around the plies",
            mm(p.film_joint_margin.si())
        ),
    ];
    all.extend(weight_words(p.weight));
    all
}

fn press_words(p: &Press) -> Vec<String> {
    let mm = |v: f64| quantity(v, "m", 5);
    let mut all = vec![
        format!("stroke {}", mm(p.stroke.si())),
        format!(
            "die with an opening of {} radius and an edge of {}",
            mm(p.die.opening_radius.si()),
            mm(p.die.edge_radius.si())
        ),
    ];
    all.push(match p.holder.as_ref().map(|h| &h.hold) {
        None => "no blank holder".to_owned(),
        Some(Hold::Gap(gap)) => format!("blank holder with a gap of {}", mm(gap.si())),
        Some(Hold::Force(force)) => format!("blank holder with {} N", number(force.si(), 4)),
    });
    all.extend(p.weight.map(|w| match w {
        Towards::Die => "weight towards the die".to_owned(),
        Towards::Holder => "weight towards the holder".to_owned(),
    }));
    all
}

fn stamping_words(p: &Stamping) -> Vec<String> {
    let part = |part: &StampingPart| {
        let how = match &part.motion {
            None => "stands still".to_owned(),
            Some(PartMotion::Table(rows)) => {
                let ways = rows.iter().map(|r| r.way.si());
                format!("moves by {}", quantity(range_of(ways), "m", 4))
            }
            Some(PartMotion::Pressed(by)) => {
                let spring = match by.spring {
                    Some(k) => format!(" and a spring of {} N/mm", number(k.si() * 1e-3, 4)),
                    None => String::new(),
                };
                match &by.force {
                    ForceCourse::Value(f) => {
                        format!("is pressed with {} N{spring}", number(f.si(), 4))
                    }
                    ForceCourse::Course(_) => format!("is pressed with a force by a table{spring}"),
                }
            }
        };
        format!("'{}', {} the plies, {how}", part.name, part.side.word())
    };
    let mut all: Vec<String> = p.parts.iter().map(part).collect();
    if !p.parts.iter().any(|part| part.name == TOOL) {
        all.insert(0, "the tool stands still".to_owned());
    }
    all.extend(p.grippers.iter().map(|g| {
        format!(
            "a gripper pulls '{}' with {} N",
            g.ply,
            number(g.force.si(), 4)
        )
    }));
    all.extend(p.weight.map(|w| match w {
        Vertical::Down => "weight downwards".to_owned(),
        Vertical::Up => "weight upwards".to_owned(),
    }));
    all
}

/// Between the largest and the smallest of them.
fn range_of(values: impl Iterator<Item = f64>) -> f64 {
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| {
        [a.min(v), b.max(v)]
    });
    (high - low).max(0.0)
}

/// How far the parts of a stamping are off their places, and at the right what they press with: those that move at all.
fn of_parts<'a>(p: &Stamping, history: &'a History) -> Vec<Curve<'a>> {
    let mut all = Vec::new();
    for (name, _) in p.sides() {
        for (column, what, factor, right) in [
            ("way", "way (mm)", 1e3, false),
            ("force", "force (N)", 1.0, true),
        ] {
            let Some(values) = history.get(&format!("parts/{name}/{column}")) else {
                continue;
            };
            if values.iter().any(|v| *v != 0.0) {
                all.push(Curve {
                    name: format!("{name}: {what}"),
                    values,
                    factor,
                    right,
                });
            }
        }
    }
    all
}

fn curves<'a>(process: &Process, history: &'a History) -> Vec<Curve<'a>> {
    type Columns = &'static [(&'static str, &'static str, f64, bool)];
    let all: Columns = match process {
        Process::DoubleDiaphragm(_) => &[
            ("bag_pressure", "pressure on the bag (kPa)", 1e-3, false),
            (
                "cavity_pressure",
                "pressure in the cavity (kPa)",
                1e-3,
                false,
            ),
            ("frame_height", "height of the frame (mm)", 1e3, true),
        ],
        // What presses on the film until the cavity is sealed is on both of its faces.
        Process::SingleDiaphragm(_) => &[
            (
                "cavity_pressure",
                "pressure under the film (kPa)",
                1e-3,
                false,
            ),
            ("frame_height", "height of the frame (mm)", 1e3, true),
        ],
        Process::Press(_) => &[("frame_height", "punch, from its end (mm)", 1e3, true)],
        Process::Stamping(p) => return of_parts(p, history),
    };
    let one = |(column, name, factor, right): &(&str, &'static str, f64, bool)| {
        Some(Curve {
            name: (*name).to_owned(),
            values: history.get(column)?,
            factor: *factor,
            right: *right,
        })
    };
    all.iter().filter_map(one).collect()
}

fn diagram(phases: &[(&str, f64)], time: &[f64], curves: &[Curve<'_>]) -> Markup {
    let [w, h] = SIZE;
    let [left, top, right, below] = AROUND;
    let (x0, x1, bottom) = (left, w - right, h - below);
    let whole: f64 = phases.iter().map(|p| p.1).sum();
    let end = time.last().copied().unwrap_or(0.0).max(whole).max(1e-9);
    let x = Axis::new([0.0, end * 1e3], 10, [x0, x1]);
    let axis = |is_right: bool| {
        let of = curves.iter().filter(|c| c.right == is_right);
        let values = of.flat_map(|c| c.values.iter().map(|v| v * c.factor));
        let [low, high] = values.fold([0.0f64, 0.0f64], |[a, b], v| [a.min(v), b.max(v)]);
        (high > low).then(|| {
            Axis::new(
                [low - 0.02 * (high - low), high + 0.06 * (high - low)],
                5,
                [bottom, top],
            )
        })
    };
    let axes = [axis(false), axis(true)];
    let mut from = 0.0;
    let bands: Vec<(&str, f64, f64)> = phases
        .iter()
        .map(|(name, t)| {
            let band = (*name, x.at(from * 1e3), x.at((from + t) * 1e3));
            from += t;
            band
        })
        .collect();
    let what = format!(
        "Process over time: {}",
        curves
            .iter()
            .map(|c| c.name.as_str())
            .collect::<Vec<_>>()
            .join(", ")
    );
    html! {
        figure class="plot process" {
            svg viewBox={ "0 0 " (px(w)) " " (px(h)) } role="img" aria-label=(what) {
                @for (k, (name, a, b)) in bands.iter().enumerate() {
                    rect class=(if k % 2 == 0 { "phase" } else { "phase odd" }) x=(px(*a)) y=(px(top)) width=(px(b - a)) height=(px(bottom - top)) {}
                    @let room = b - a > CHARACTER * name.len() as f64;
                    text class="tick" x=(px((a + b) / 2.0)) y=(px(if room { top - 6.0 } else { top - 20.0 })) text-anchor="middle" { (name) }
                }
                (ticks(&x, bottom))
                @for (side, axis) in axes.iter().enumerate() { @if let Some(axis) = axis { (scale(axis, side == 1, [x0, x1, bottom])) } }
                @for (k, c) in curves.iter().enumerate() { @if let Some(y) = &axes[usize::from(c.right)] {
                    path class={ "line c" (k) } d=(line(time, c, &x, y)) {}
                } }
                text class="tick" x=(px((x0 + x1) / 2.0)) y=(px(h - 5.0)) text-anchor="middle" { "time (ms)" }
            }
            figcaption class="legend" { @for (k, c) in curves.iter().enumerate() {
                span { svg width="26" height="10" viewBox="0 0 26 10" aria-hidden="true" { path class={ "line c" (k) } d="M0 5H26" {} }
                    " " (c.name) @if c.right { ", at the right" } }
            } }
        }
    }
}

fn ticks(x: &Axis, bottom: f64) -> Markup {
    html! { @for t in &x.ticks {
        path class="axis" d={ "M" (px(x.at(*t))) " " (px(bottom)) "v4" } {}
        text class="tick" x=(px(x.at(*t))) y=(px(bottom + 16.0)) text-anchor="middle" { (x.text(*t)) }
    } }
}

fn scale(y: &Axis, at_right: bool, [x0, x1, bottom]: [f64; 3]) -> Markup {
    let at = if at_right { x1 } else { x0 };
    html! {
        path class="axis" d={ "M" (px(at)) " " (px(AROUND[1])) "V" (px(bottom)) } {}
        @if !at_right { path class="axis" d={ "M" (px(x0)) " " (px(bottom)) "H" (px(x1)) } {} }
        @for t in &y.ticks {
            text class="tick" x=(px(if at_right { at + 6.0 } else { at - 6.0 })) y=(px(y.at(*t) + 4.0)) text-anchor=(if at_right { "start" } else { "end" }) { (y.text(*t)) }
        }
    }
}

fn line(time: &[f64], curve: &Curve<'_>, x: &Axis, y: &Axis) -> String {
    let every = time.len().div_ceil(PLACES).max(1);
    let last = time.len().saturating_sub(1);
    let mut path = String::new();
    for k in (0..time.len()).filter(|k| k % every == 0 || *k == last) {
        path.push(if path.is_empty() { 'M' } else { 'L' });
        path += &spot([x.at(time[k] * 1e3), y.at(curve.values[k] * curve.factor)]);
    }
    path
}
