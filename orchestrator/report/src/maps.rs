//! Maps of fields that an artifact carries in its attributes, for every kind of artifact (`maps` in the data model): bodies
//! seen from above, side by side in the colours of one scale.
//!
//! As with plots, what is wrong with a map is a warning of the report, and the rest is drawn.

use crate::colour::{Palette, Scale, end_of_scale};
use crate::field::bar;
use crate::plots::{in_words, pretty, to_si, without_list};
use crate::raster::{Camera, Canvas, Paint, Triangles, Vec3};
use crate::units::number;
use crate::view::{Sharpness, px};
use maud::{Markup, html};
use plyflow_artifact::{Artifact, On};
use plyflow_model::artifact;
use serde::Deserialize;
use serde_json::Value;

/// Panels of a map; more would be stamps.
const PANELS: usize = 12;
/// Width of a panel that is alone, and of one among others (px).
const WIDTHS: [f64; 2] = [430.0, 300.0];
/// The scale shows this share of the values.
const SHOWN: f64 = 0.998;

/// A map that can be drawn.
#[derive(Debug)]
pub(crate) struct Map {
    title: String,
    /// Unit as printed, and the factor to it from SI.
    unit: String,
    factor: f64,
    scale: Scale,
    /// Smallest and largest value (SI).
    range: [f64; 2],
    panels: Vec<Panel>,
}

/// A body with a field.
#[derive(Debug)]
struct Panel {
    label: String,
    points: Vec<Vec3>,
    mesh: Triangles,
    /// At the points (SI).
    values: Vec<f64>,
}

/// Reads the maps that the attributes of an artifact describe, of at most `room` panels together. What is wrong is said in `wrong`.
pub(crate) fn read(
    attributes: &Value,
    artifact: &Artifact,
    room: usize,
    wrong: &mut Vec<String>,
) -> Vec<Map> {
    let all = match &attributes["maps"] {
        Value::Null => return Vec::new(),
        Value::Array(all) => all,
        other => {
            let what = in_words(other);
            wrong.push(format!(
                "its attribute 'maps' is {what}; expected a list of maps"
            ));
            return Vec::new();
        }
    };
    let (mut maps, mut room) = (Vec::new(), room);
    for (i, value) in all.iter().enumerate() {
        match without_list::<artifact::Map>(value, "panels") {
            Ok((given, panels)) if panels.len() > room => {
                wrong.push(format!(
                    "map '{}': it is not drawn: the page is full",
                    given.name
                ));
            }
            Ok((given, panels)) => {
                let map = map(&given, &panels, artifact, wrong);
                room -= map.as_ref().map_or(0, |m| m.panels.len());
                maps.extend(map);
            }
            Err(e) => {
                let name = value["name"].as_str().unwrap_or_default();
                wrong.push(format!("map {} '{name}' of its attributes: {e}", i + 1));
            }
        }
    }
    maps
}

fn map(
    given: &artifact::Map,
    told: &[Value],
    artifact: &Artifact,
    wrong: &mut Vec<String>,
) -> Option<Map> {
    let of = |text: String| format!("map '{}': {text}", given.name);
    if told.len() > PANELS {
        let all = told.len();
        wrong.push(of(format!(
            "the first {PANELS} of its {all} panels are drawn"
        )));
    }
    let (mut panels, mut factor) = (Vec::new(), 1.0);
    for (i, value) in told.iter().enumerate().take(PANELS) {
        match panel(value, &given.unit, artifact) {
            Ok((panel, per)) => {
                factor = per;
                panels.push(panel);
            }
            Err(e) => wrong.push(of(format!("panel {}: {e}", i + 1))),
        }
    }
    let values = || panels.iter().flat_map(|p: &Panel| p.values.iter().copied());
    let range = values().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| {
        [a.min(v), b.max(v)]
    });
    if range[0] > range[1] {
        wrong.push(of("it is not drawn: no panel has a value".into()));
        return None;
    }
    let end = end_of_scale(values(), SHOWN, 0.0, factor);
    // A few values a little below zero are rounding, not a second sign.
    let scale = if range[0] < -0.02 * range[1].abs() {
        Scale {
            palette: Palette::BlueRed,
            low: -end,
            high: end,
        }
    } else {
        Scale {
            palette: Palette::Viridis,
            low: 0.0,
            high: end,
        }
    };
    Some(Map {
        title: given.title.clone().unwrap_or_else(|| given.name.clone()),
        unit: pretty(&given.unit),
        factor,
        scale,
        range,
        panels,
    })
}

/// A panel, and the factor from SI to the unit.
fn panel(value: &Value, unit: &str, artifact: &Artifact) -> Result<(Panel, f64), String> {
    let given = artifact::Panel::deserialize(value).map_err(|e| e.to_string())?;
    let text = |e: plyflow_artifact::ArtifactError| e.to_string();
    let body = artifact.body(&given.body).map_err(text)?;
    let frame = artifact.contents().frames.checked_sub(1);
    let frame = frame.ok_or("the artifact has no frame")?;
    let Some(field) = body.fields.iter().find(|f| f.name == given.field) else {
        let names: Vec<&str> = body.fields.iter().map(|f| f.name.as_str()).collect();
        return Err(format!(
            "body '{}' has no field '{}'; its fields are: {}",
            given.body,
            given.field,
            names.join(", ")
        ));
    };
    if field.components != 1 {
        return Err(format!(
            "the field '{}' has {} components; expected one",
            field.name, field.components
        ));
    }
    let (scale, _) = to_si(unit, &field.unit)
        .filter(|(_, o)| *o == 0.0)
        .ok_or_else(|| {
            format!(
                "the field '{}' is in '{}', which cannot be shown in '{unit}'",
                field.name, field.unit
            )
        })?;
    let (_, cells) = artifact.mesh(&given.body).map_err(text)?;
    let points = artifact.frame_points(&given.body, frame).map_err(text)?;
    let found = artifact.frame_field(&given.body, frame, field.on, &field.name);
    let mut values = found.map_err(text)?;
    let k = body.nodes_per_cell as usize;
    if field.on == On::Cells {
        values = at_points(points.len(), &cells, k, &values);
    }
    let panel = Panel {
        label: given.label,
        mesh: Triangles::new(points.len(), &cells, k),
        points,
        values,
    };
    Ok((panel, 1.0 / scale))
}

/// Means at the points of the values of the cells around them.
fn at_points(points: usize, cells: &[u32], k: usize, values: &[f64]) -> Vec<f64> {
    let (mut sum, mut count) = (vec![0.0; points], vec![0.0; points]);
    for (cell, value) in cells.chunks_exact(k).zip(values) {
        for i in cell {
            sum[*i as usize] += value;
            count[*i as usize] += 1.0;
        }
    }
    sum.iter()
        .zip(count)
        .map(|(s, n)| s / f64::max(n, 1.0))
        .collect()
}

impl Map {
    /// Number of its panels.
    pub(crate) fn panels(&self) -> usize {
        self.panels.len()
    }

    /// The panels with their scale; `id` is one of its own on the page.
    ///
    /// # Errors
    /// When a picture cannot be encoded.
    pub(crate) fn drawn(&self, id: &str, sharp: Sharpness) -> Result<Markup, String> {
        let width = WIDTHS[usize::from(self.panels.len() > 1)];
        let points = || self.panels.iter().flat_map(|p| &p.points);
        // One scale of lengths for all, too.
        let size = [width * sharp.0, width * sharp.0];
        let (camera, size) = Camera::plan().fit(points(), size, 4.0 * sharp.0);
        let mut figures = Vec::new();
        for panel in &self.panels {
            let mut canvas = Canvas::new(size);
            let paint = Paint::Field(&panel.values, self.scale);
            canvas.surface(&camera, &panel.points, &panel.mesh, paint, false, 0.0);
            let image = canvas.data_url().map_err(|e| e.to_string())?;
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
        let beyond = self.range[1] > self.scale.high || self.range[0] < self.scale.low;
        Ok(html! {
            div class="field" {
                p class="plot-title" { (self.title) (unit) }
                (bar(id, self.scale, self.factor, &[], &format!("{} scale{unit}", self.title)))
                p class="note" { "From above, x to the right; values from " (value(self.range[0])) " to " (value(self.range[1]))
                    @if beyond { " (colours end where the bar ends)" } "." }
                div class="row" { @for figure in &figures { (figure) } }
            }
        })
    }
}
