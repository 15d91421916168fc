//! Colour bars.

use crate::draw::colour::Scale;
use crate::draw::plot::axis::ticks;
use crate::units::number;
use maud::{Markup, html};

/// A colour bar with ticks in SI times `factor`, and marks at the `limits` (SI) that lie on it.
pub(crate) fn bar(id: &str, scale: Scale, factor: f64, limits: &[f64], what: &str) -> Markup {
    let Scale { palette, low, high } = scale;
    let (x0, width) = (20.0, 380.0);
    let x = |v: f64| format!("{:.1}", x0 + width * scale.place(v).clamp(0.0, 1.0));
    let ticks = ticks(low * factor, high * factor, 6);
    let inside = |v: &&f64| (low..=high).contains(*v);
    html! {
        svg class="bar" viewBox="0 0 420 60" width="420" height="60" role="img" aria-label=(what) {
            defs { linearGradient id=(id) {
                @for (at, colour) in palette.css() {
                    stop offset={ (format!("{:.1}", at * 100.0)) "%" } stop-color=(colour) {}
                }
            } }
            rect x=(x0) y="20" width=(width) height="14" fill={ "url(#" (id) ")" } class="frame" {}
            @for limit in limits.iter().filter(inside) {
                path class="limit" d={ "M" (x(*limit)) " 15V38" } {}
                text x=(x(*limit)) y="12" class="tick" text-anchor="middle" { "limit" }
            }
            @for t in &ticks {
                path class="axis" d={ "M" (x(t / factor)) " 34v4" } {}
                text x=(x(t / factor)) y="50" class="tick" text-anchor="middle" { (number(*t, 4)) }
            }
        }
    }
}
