//! Line plots and bars as SVG.

use crate::units::number;
use crate::view::px;
use maud::{Markup, html};
use std::fmt::Write;

/// Round numbers between `low` and `high`, about `count` of them.
pub(crate) fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    if high <= low || !(high - low).is_finite() {
        return vec![low];
    }
    let raw = (high - low) / count.max(1) as f64;
    let power = 10f64.powf(raw.log10().floor());
    let step = [1.0, 2.0, 2.5, 5.0, 10.0]
        .into_iter()
        .find(|s| s * power >= raw * 0.999);
    let step = step.unwrap_or(10.0) * power;
    let (first, last) = (
        (low / step - 1e-6).ceil() as i64,
        (high / step + 1e-6).floor() as i64,
    );
    (first..=last).map(|i| i as f64 * step).collect()
}

/// One line of a plot.
#[derive(Debug, Clone)]
pub(crate) struct Line<'a> {
    pub(crate) name: &'a str,
    /// 0..8: the colour.
    pub(crate) colour: usize,
    /// One value per time.
    pub(crate) values: Vec<f64>,
}

/// A plot of lines over time.
#[derive(Debug, Clone)]
pub(crate) struct Plot<'a> {
    pub(crate) title: &'a str,
    /// Label of the vertical axis, with its unit.
    pub(crate) label: &'a str,
    /// Times (s).
    pub(crate) time: &'a [f64],
    pub(crate) lines: Vec<Line<'a>>,
    /// A horizontal line with its name.
    pub(crate) bound: Option<(f64, &'a str)>,
    /// Values above this are cut off.
    pub(crate) ceiling: Option<f64>,
    pub(crate) size: [f64; 2],
}

const LEFT: f64 = 58.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 26.0;
const BOTTOM: f64 = 36.0;
/// A line is drawn with at most this many pairs of smallest and largest value.
const BUCKETS: usize = 240;

impl Plot<'_> {
    /// The plot, with a legend when it has several lines.
    pub(crate) fn svg(&self) -> Markup {
        let [w, h] = self.size;
        let (t0, t1) = match (self.time.first(), self.time.last()) {
            // The first row comes a little after the start.
            (Some(a), Some(b)) if b > a => (if *a < 0.05 * b { a.min(0.0) } else { *a }, *b),
            _ => return html! {},
        };
        let [low, high] = self.range();
        let x = |t: f64| LEFT + (t - t0) / (t1 - t0) * (w - LEFT - RIGHT);
        let y = |v: f64| h - BOTTOM - (v - low) / (high - low) * (h - TOP - BOTTOM);
        html! {
            figure class="plot" {
                svg viewBox={ "0 0 " (px(w)) " " (px(h)) } role="img" aria-label=(self.title) {
                    text class="plot-title" x=(px(LEFT)) y="14" { (self.title) }
                    @for t in ticks(low, high, 5) {
                        path class="grid" d={ "M" (px(LEFT)) " " (px(y(t))) "H" (px(w - RIGHT)) } {}
                        text class="tick" x=(px(LEFT - 6.0)) y=(px(y(t) + 4.0)) text-anchor="end" { (number(t, 4)) }
                    }
                    @for t in ticks(t0, t1, 6) {
                        path class="axis" d={ "M" (px(x(t))) " " (px(h - BOTTOM)) "v4" } {}
                        text class="tick" x=(px(x(t))) y=(px(h - BOTTOM + 16.0)) text-anchor="middle" { (number(t, 4)) }
                    }
                    path class="axis" d={ "M" (px(LEFT)) " " (px(TOP)) "V" (px(h - BOTTOM)) "H" (px(w - RIGHT)) } {}
                    text class="tick" x=(px((LEFT + w - RIGHT) / 2.0)) y=(px(h - 4.0)) text-anchor="middle" { "time (s)" }
                    text class="tick" x="12" y=(px((TOP + h - BOTTOM) / 2.0)) text-anchor="middle"
                        transform={ "rotate(-90 12 " (px((TOP + h - BOTTOM) / 2.0)) ")" } { (self.label) }
                    @if let Some((value, name)) = self.bound {
                        path class="bound" d={ "M" (px(LEFT)) " " (px(y(value))) "H" (px(w - RIGHT)) } {}
                        text class="tick bound-name" x=(px(w - RIGHT - 4.0)) y=(px(y(value) - 5.0)) text-anchor="end" { (name) }
                    }
                    @for line in &self.lines {
                        path class={ "line c" (line.colour) } d=(self.path(line, high, &x, &y)) {}
                    }
                }
                @if self.lines.len() > 1 { (self.legend()) }
            }
        }
    }

    fn legend(&self) -> Markup {
        html! {
            figcaption class="legend" {
                @for line in &self.lines {
                    span { svg width="18" height="8" aria-hidden="true" {
                        path class={ "line c" (line.colour) } d="M0 4H18" {}
                    } " " (line.name) }
                }
            }
        }
    }

    /// Smallest and largest value shown.
    fn range(&self) -> [f64; 2] {
        let values = self.lines.iter().flat_map(|l| &l.values).copied();
        let values = values
            .chain(self.bound.map(|b| b.0))
            .filter(|v| v.is_finite());
        let [low, high] = values.fold([0.0, 0.0], |[a, b]: [f64; 2], v| [a.min(v), b.max(v)]);
        let high = self.ceiling.map_or(high, |c| high.min(c));
        if high > low {
            [low, high + 0.04 * (high - low)]
        } else {
            [low, low + 1.0]
        }
    }

    /// A line thinned to what a screen shows: of each stretch of time the smallest and largest value, in order.
    fn path(
        &self,
        line: &Line<'_>,
        high: f64,
        x: &dyn Fn(f64) -> f64,
        y: &dyn Fn(f64) -> f64,
    ) -> String {
        let mut path = String::new();
        for i in thinned(&line.values, BUCKETS) {
            let pen = if path.is_empty() { 'M' } else { 'L' };
            let _ = write!(
                path,
                "{pen}{} {}",
                px(x(self.time[i])),
                px(y(line.values[i].min(high)))
            );
        }
        path
    }
}

/// Indices that keep the smallest and largest value of each of `buckets` stretches, and both ends.
fn thinned(values: &[f64], buckets: usize) -> Vec<usize> {
    let n = values.len();
    if n <= 2 * buckets {
        return (0..n).filter(|i| values[*i].is_finite()).collect();
    }
    let mut kept = vec![0];
    for b in 0..buckets {
        let stretch = b * n / buckets..(b + 1) * n / buckets;
        let by = |i: &usize, j: &usize| values[*i].total_cmp(&values[*j]);
        let low = stretch.clone().min_by(by).unwrap_or(0);
        let high = stretch.max_by(by).unwrap_or(0);
        kept.extend([low.min(high), low.max(high)]);
    }
    kept.push(n - 1);
    kept.dedup();
    kept.retain(|i| values[*i].is_finite());
    kept
}

/// Horizontal bars: name, value, text behind the bar.
pub(crate) fn bars(title: &str, rows: &[(String, f64, String)]) -> Markup {
    let top = rows.iter().map(|r| r.1).fold(0.0, f64::max);
    let (row, left, width) = (24.0, 170.0, 400.0);
    let h = row * rows.len() as f64 + 28.0;
    html! {
        figure class="plot" {
            svg class="bars" viewBox={ "0 0 720 " (px(h)) } role="img" aria-label=(title) {
                text class="plot-title" x="0" y="14" { (title) }
                @for (i, (name, value, text)) in rows.iter().enumerate() {
                    @let y = 24.0 + row * i as f64;
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
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_lie_inside() {
        let close = |a: Vec<f64>, b: &[f64]| {
            assert_eq!(a.len(), b.len(), "{a:?}");
            assert!(a.iter().zip(b).all(|(x, y)| (x - y).abs() < 1e-9), "{a:?}");
        };
        close(ticks(0.0, 1.0, 5), &[0.0, 0.2, 0.4, 0.6, 0.8, 1.0]);
        close(ticks(-35.0, 35.0, 6), &[-20.0, 0.0, 20.0]);
        close(ticks(3.0, 3.0, 5), &[3.0]);
    }

    #[test]
    fn thinning_keeps_peaks_and_ends_of_long_histories() {
        let mut values: Vec<f64> = (0..10_000).map(|i| (f64::from(i) * 0.01).sin()).collect();
        values[4321] = 99.0;
        values[8765] = -99.0;
        let kept = thinned(&values, 100);
        assert!(kept.len() <= 202 && kept.contains(&4321) && kept.contains(&8765));
        assert!(kept.windows(2).all(|w| w[0] < w[1]));
        assert_eq!((kept[0], *kept.last().unwrap()), (0, 9_999));
    }

    #[test]
    fn the_bound_is_drawn_inside_even_when_all_values_are_far_below() {
        let plot = Plot {
            title: "t",
            label: "l",
            time: &[0.0, 1.0],
            lines: vec![Line {
                name: "a",
                colour: 0,
                values: vec![0.0, 0.001],
            }],
            bound: Some((5.0, "bound")),
            ceiling: None,
            size: [400.0, 200.0],
        };
        assert!(plot.range()[1] >= 5.0);
        assert!(plot.svg().into_string().contains("class=\"bound\""));
    }
}
