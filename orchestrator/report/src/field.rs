//! The quantities that are mapped, and their colour scales.

use crate::colour::{Palette, Scale, end_of_scale};
use crate::read::Ply;
use crate::study::Study;
use crate::units::{number, shown};
use maud::{Markup, html};

/// A sheet that moved less than this (m) lies flat.
const LEAST_DEFLECTION: f64 = 1e-5;

/// A mapped quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Field {
    Shear,
    Distance,
    Curvature,
    /// Of coupons, which have no tool.
    Deflection,
}

impl Field {
    /// Those of a forming run.
    pub(crate) const ALL: [Self; 3] = [Self::Shear, Self::Distance, Self::Curvature];

    pub(crate) fn title(self) -> &'static str {
        match self {
            Self::Shear => "Shear angle",
            Self::Distance => "Nodal distance",
            Self::Curvature => "Curvature",
            Self::Deflection => "Deflection along z",
        }
    }

    /// SI unit.
    pub(crate) fn unit(self) -> &'static str {
        match self {
            Self::Shear => "rad",
            Self::Distance | Self::Deflection => "m",
            Self::Curvature => "1/m",
        }
    }

    pub(crate) fn explanation(self) -> &'static str {
        match self {
            Self::Shear => {
                "Change of the angle between the fibre families; positive stretches the stitch. \
                 Element values, averaged at the nodes for drawing."
            }
            Self::Distance => {
                "Distance of the ply from where it would lie on the tool; large where it bridges or wrinkles."
            }
            Self::Deflection => "How far the sheet moved out of its plane.",
            Self::Curvature => {
                "Principal curvature of largest magnitude of the formed ply; the sign tells to which side it bends."
            }
        }
    }

    /// Values at the points of a ply; cell values are averaged there.
    pub(crate) fn at_points(self, ply: &Ply) -> Option<Vec<f64>> {
        match self {
            Self::Distance => ply.distance.clone(),
            Self::Curvature => ply.curvature.clone(),
            Self::Deflection => ply.deflection.clone(),
            Self::Shear => {
                let cells = ply.shear.as_ref()?;
                let mut sum = vec![0.0; ply.flat.len()];
                let mut count = vec![0.0; ply.flat.len()];
                for (cell, value) in ply.cells.iter().zip(cells) {
                    for i in cell {
                        sum[*i as usize] += value;
                        count[*i as usize] += 1.0;
                    }
                }
                Some(
                    sum.iter()
                        .zip(count)
                        .map(|(s, n): (&f64, f64)| s / n.max(1.0))
                        .collect(),
                )
            }
        }
    }

    fn stored(self, ply: &Ply) -> Option<&[f64]> {
        match self {
            Self::Shear => ply.shear.as_deref(),
            Self::Distance => ply.distance.as_deref(),
            Self::Curvature => ply.curvature.as_deref(),
            Self::Deflection => ply.deflection.as_deref(),
        }
    }

    /// Limits of the detection (SI), drawn on the scale.
    fn limits(self, study: &Study) -> Vec<f64> {
        let names: &[&str] = match self {
            Self::Shear => &["over_shear_negative", "over_shear_positive"],
            Self::Distance => &["distance_threshold"],
            Self::Curvature | Self::Deflection => &[],
        };
        let Some(d) = &study.detection else {
            return Vec::new();
        };
        names
            .iter()
            .filter_map(|n| d.thresholds.get(*n))
            .copied()
            .collect()
    }

    /// The scale of all maps of this quantity in a study, global and local, so that colours compare; `None`
    /// when no ply has it.
    pub(crate) fn legend(self, study: &Study) -> Option<Legend> {
        let plies = || {
            study
                .plies
                .iter()
                .chain(study.locals.iter().flat_map(|l| &l.plies))
        };
        let mut range: Option<[f64; 2]> = None;
        for v in plies().filter_map(|p| self.stored(p)).flatten() {
            let [a, b] = range.unwrap_or([*v, *v]);
            range = Some([a.min(*v), b.max(*v)]);
        }
        let values = plies().filter_map(|p| self.stored(p)).flatten().copied();
        let (factor, _) = shown(self.unit());
        let limits = self.limits(study);
        let scale = match self {
            Self::Shear => {
                let end = end_of_scale(values, 0.995, 0.02, factor);
                Scale {
                    palette: Palette::BlueRed,
                    low: -end,
                    high: end,
                }
            }
            Self::Deflection => {
                let end = end_of_scale(values, 1.0, LEAST_DEFLECTION, factor);
                Scale {
                    palette: Palette::PurpleOrange,
                    low: -end,
                    high: end,
                }
            }
            Self::Curvature => {
                // Crests of the finest mesh are narrow; a scale that shows their peaks leaves the part pale.
                let end = end_of_scale(values, 0.985, 10.0, factor);
                Scale {
                    palette: Palette::PurpleOrange,
                    low: -end,
                    high: end,
                }
            }
            Self::Distance => {
                // Edges that hang in the air stand centimetres off; a scale that shows them hides all else.
                let threshold = limits.first().copied().unwrap_or(1e-3);
                let end = end_of_scale(values, 0.995, 2.0 * threshold, factor).min(8.0 * threshold);
                Scale {
                    palette: Palette::Viridis,
                    low: 0.0,
                    high: end,
                }
            }
        };
        Some(Legend {
            field: self,
            scale,
            range: range?,
            limits,
        })
    }
}

/// A colour scale with what it must tell.
#[derive(Debug, Clone)]
pub(crate) struct Legend {
    pub(crate) field: Field,
    pub(crate) scale: Scale,
    /// Smallest and largest value (SI).
    range: [f64; 2],
    limits: Vec<f64>,
}

impl Legend {
    /// Whether nothing is to be seen: all values are nought, but for rounding.
    pub(crate) fn is_flat(&self) -> bool {
        let least = match self.field {
            Field::Deflection => LEAST_DEFLECTION,
            _ => 1e-6,
        };
        self.range.iter().all(|v| v.abs() < least)
    }

    /// The colour bar with ticks and limits.
    pub(crate) fn bar(&self, id: &str) -> Markup {
        let (factor, unit) = shown(self.field.unit());
        let what = format!("{} scale, {unit}", self.field.title());
        bar(id, self.scale, factor, &self.limits, &what)
    }

    /// Unit of its numbers.
    pub(crate) fn unit(&self) -> &'static str {
        shown(self.field.unit()).1
    }

    /// What the bar is about, for the text under it.
    pub(crate) fn note(&self) -> Markup {
        let (factor, unit) = shown(self.field.unit());
        let Scale { low, high, .. } = self.scale;
        // No more digits than the scale can show.
        let step = 10f64.powf(((high - low) * factor * 1e-3).log10().floor());
        let value = |v: f64| number((v * factor / step).round() * step, 3);
        html! {
            p class="note" {
                b { (unit) } "; values from " (value(self.range[0])) " to " (value(self.range[1]))
                @if self.range[0] < low || self.range[1] > high { " (colours end where the bar ends)" }
                ". " (self.field.explanation())
            }
        }
    }
}

/// A colour bar with ticks in SI times `factor`, and marks at the `limits` (SI) that lie on it.
pub(crate) fn bar(id: &str, scale: Scale, factor: f64, limits: &[f64], what: &str) -> Markup {
    let Scale { palette, low, high } = scale;
    let (x0, width) = (20.0, 380.0);
    let x = |v: f64| format!("{:.1}", x0 + width * scale.place(v).clamp(0.0, 1.0));
    let ticks = crate::plot::ticks(low * factor, high * factor, 6);
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
