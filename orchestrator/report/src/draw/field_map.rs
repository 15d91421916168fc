//! Maps of a field that a step carries, as pictures.

use crate::draw::colour::{Palette, Scale, end_of_scale};
use crate::draw::colour_bar::bar;
use crate::draw::error::Drawn;
use crate::draw::raster::{Camera, Canvas, Paint, Surface, Triangles};
use crate::draw::sharpness::Sharpness;
use crate::draw::svg::px;
use crate::plain::FieldMap;
use crate::units::number;
use maud::html;

/// Width of a panel that is alone, and of one among others (px).
const WIDTHS: [f64; 2] = [430.0, 300.0];
/// The scale shows this share of the values.
const SHOWN: f64 = 0.998;

impl FieldMap {
    /// Colours of all panels. A few values a little below zero are rounding, not a second sign.
    fn scale(&self, [low, high]: [f64; 2]) -> Scale {
        let end = end_of_scale(self.values(), SHOWN, 0.0, self.factor);
        if low < -0.02 * high.abs() {
            Scale::about_zero(Palette::BlueRed, end)
        } else {
            Scale::from_zero(end)
        }
    }

    /// The panels with their scale; `id` is one of its own on the page.
    ///
    /// # Errors
    /// When a picture cannot be encoded.
    pub(crate) fn drawn(&self, id: &str, sharp: Sharpness) -> Drawn {
        let Some(range) = self.range() else {
            return Ok(html! {});
        };
        let scale = self.scale(range);
        let width = WIDTHS[usize::from(self.panels.len() > 1)];
        let points = || self.panels.iter().flat_map(|p| &p.points);
        // One scale of lengths for all, too.
        let size = [width * sharp.0, width * sharp.0];
        let (camera, size) = Camera::plan().fit(points(), size, 4.0 * sharp.0);
        let mut figures = Vec::new();
        for panel in &self.panels {
            let mut canvas = Canvas::new(size);
            let mesh = Triangles::new(panel.points.len(), &panel.cells);
            let paint = Paint::Field(&panel.values, scale);
            canvas.surface(&camera, &Surface::new(&panel.points, &mesh, paint));
            let image = canvas.data_url()?;
            let [w, h] = size.map(|s| px(s as f64 / sharp.0));
            let what = format!("{}, {}", self.title, panel.label);
            figures.push(html! {
                figure class="map" {
                    svg viewBox={ "0 0 " (w) " " (h) } role="img" aria-label=(what) {
                        image href=(image) x="0" y="0" width=(w) height=(h) {}
                    }
                    figcaption { (panel.label) }
                }
            });
        }
        let unit = if self.unit.is_empty() {
            String::new()
        } else {
            format!(" ({})", self.unit)
        };
        let value = |v: f64| number(v * self.factor, 3);
        let beyond = range[1] > scale.high || range[0] < scale.low;
        Ok(html! {
            div class="field" {
                p class="plot-title" { (self.title) (unit) }
                (bar(id, scale, self.factor, &[], &format!("{} scale{unit}", self.title)))
                p class="note" { "From above, x to the right; values from " (value(range[0])) " to " (value(range[1]))
                    @if beyond { " (colours end where the bar ends)" } "." }
                div class="row" { @for figure in &figures { (figure) } }
            }
        })
    }
}
