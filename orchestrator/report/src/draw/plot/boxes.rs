//! Box plots: the spread of many values at each of a few places along the axis.

use crate::draw::plot::axis::Frame;
use crate::draw::svg::px;
use crate::plain::{Boxes, COLOURS, LARGEST, Spread};
use maud::{Markup, html};

/// Boxes are so wide, over the least distance of two places.
const WIDTH: f64 = 0.55;
/// And on the page between these (px).
const NARROWEST: f64 = 5.0;
const WIDEST: f64 = 34.0;

impl Boxes<'_> {
    /// Ends of the boxes along the axis.
    pub(super) fn across(&self) -> impl Iterator<Item = f64> {
        let half = 0.5 * self.pitch();
        self.x.iter().flat_map(move |x| [x - half, x + half])
    }

    /// Least distance of two places; of one alone a tenth of its value.
    fn pitch(&self) -> f64 {
        let mut sorted: Vec<f64> = (self.x.iter().copied())
            .filter(|x| x.abs() < LARGEST)
            .collect();
        sorted.sort_by(f64::total_cmp);
        sorted.dedup();
        let apart = sorted.windows(2).map(|w| w[1] - w[0]);
        let least = apart.fold(f64::INFINITY, f64::min);
        if least.is_finite() {
            least
        } else {
            sorted.first().map_or(1.0, |x| 0.1 * x.abs()).max(1e-12)
        }
    }

    pub(super) fn description(&self) -> String {
        if self.name.is_empty() {
            "box plots".to_owned()
        } else {
            format!("{} (box plots)", self.name)
        }
    }

    pub(super) fn drawn(&self, f: &Frame) -> Markup {
        let pixels = (f.x.at(self.pitch()) - f.x.at(0.0)).abs();
        let half = 0.5 * (WIDTH * pixels).clamp(NARROWEST, WIDEST);
        let colour = self.colour % COLOURS;
        let sound =
            |(x, all): &(&f64, &Spread)| x.abs() < LARGEST && all.iter().all(|y| y.abs() < LARGEST);
        html! {
            @for (x, all) in self.x.iter().zip(&self.spread).filter(sound) {
                @let [low, foot, first, median, third, head, high] = all.map(|y| f.y.at(y));
                @let (x, cap) = (f.x.at(*x), 0.5 * half);
                g class={ "box c" (colour) } {
                    path class="whisker" d={
                        "M" (px(x)) " " (px(first)) "V" (px(foot)) "M" (px(x - cap)) " " (px(foot)) "h" (px(2.0 * cap))
                        "M" (px(x)) " " (px(third)) "V" (px(head)) "M" (px(x - cap)) " " (px(head)) "h" (px(2.0 * cap))
                    } {}
                    rect x=(px(x - half)) y=(px(third)) width=(px(2.0 * half)) height=(px((first - third).max(0.0))) {}
                    path class="median" d={ "M" (px(x - half)) " " (px(median)) "h" (px(2.0 * half)) } {}
                    @for y in [low, high] { circle cx=(px(x)) cy=(px(y)) r="2.2" {} }
                }
            }
        }
    }

    /// Its entry in the legend.
    pub(super) fn key(&self) -> Markup {
        html! {
            span { svg width="26" height="10" viewBox="0 0 26 10" aria-hidden="true" {
                g class={ "box c" (self.colour % COLOURS) } {
                    path class="whisker" d="M0 5H26" {}
                    rect x="7" y="1" width="12" height="8" {}
                    path class="median" d="M13 1V9" {}
                }
            } " " (self.name) }
        }
    }
}
