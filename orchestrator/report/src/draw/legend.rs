//! The quantities that are mapped, and their colour scales.

use crate::draw::colour::{Palette, Scale, end_of_scale};
use crate::draw::colour_bar::bar;
use crate::plain::{Other, Ply, at_points, range_of};
use crate::units::{number, quantity, shown};
use maud::{Markup, html};
use plyflow_model::artifact::Defects;

/// A sheet that moved less than this (m) lies flat.
const LEAST_DEFLECTION: f64 = 1e-5;

/// What a deviation of fibres is.
const TURNED: &str = "Angle from the direction as laid to the fibres of the formed ply, counter-clockwise seen from above the ply. On the formed \
                      ply the direction as laid counts from the x axis, which is projected onto it; grey where the ply stands across that axis.";

/// A mapped quantity.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Field {
    Shear,
    Distance,
    Curvature,
    /// Of coupons, which have no tool.
    Deflection,
    /// At constant volume.
    Thickness,
    /// Of the first and the second fibre family: how far it has turned from the direction as laid.
    Deviation1,
    Deviation2,
}

impl Field {
    /// Those of a forming run.
    pub(crate) const ALL: [Self; 3] = [Self::Shear, Self::Distance, Self::Curvature];
    /// What follows from the shape, and what of a run is known in every frame.
    pub(crate) const OF_SHAPE: [Self; 3] = [Self::Thickness, Self::Deviation1, Self::Deviation2];

    /// Whether it is known in every frame of a run, and not only in the last one.
    pub(crate) fn is_known_on_the_way(self) -> bool {
        self == Self::Shear || Self::OF_SHAPE.contains(&self)
    }

    /// Title, SI unit and explanation.
    fn about(self) -> [&'static str; 3] {
        match self {
            Self::Shear => [
                "Shear angle",
                "rad",
                "Change of the angle between the fibre families; positive stretches the stitch. \
                 Element values, averaged at the nodes for drawing.",
            ],
            Self::Distance => [
                "Nodal distance",
                "m",
                "Distance of the ply from where it would lie on the tool; large where it bridges or wrinkles. Grey where there is no tool to lie on: \
                 at its foot, past an edge of it, over a hole in it.",
            ],
            Self::Curvature => [
                "Curvature",
                "1/m",
                "Principal curvature of largest magnitude of the formed ply; the sign tells to which side it bends.",
            ],
            Self::Deflection => [
                "Deflection along z",
                "m",
                "How far the sheet moved out of its plane.",
            ],
            Self::Thickness => [
                "Thickness",
                "m",
                "Of the sheared and stretched ply at constant volume: that of the flat ply over the ratio of areas.",
            ],
            Self::Deviation1 => ["Fibre deviation, family 1", "rad", TURNED],
            Self::Deviation2 => ["Fibre deviation, family 2", "rad", TURNED],
        }
    }

    /// Values at the points of a ply; cell values are averaged there.
    fn at_points(self, ply: &Ply) -> Option<Vec<f64>> {
        match self {
            Self::Distance => ply.distance.clone(),
            Self::Curvature => ply.curvature.clone(),
            Self::Deflection => ply.deflection.clone(),
            Self::Shear | Self::Thickness | Self::Deviation1 | Self::Deviation2 => {
                let nodes = ply.cells.as_flattened();
                Some(at_points(self.stored(ply)?, nodes, 4, ply.flat.len()))
            }
        }
    }

    fn stored(self, ply: &Ply) -> Option<&[f64]> {
        match self {
            Self::Shear => ply.shear.as_deref(),
            Self::Distance => ply.distance.as_deref(),
            Self::Curvature => ply.curvature.as_deref(),
            Self::Deflection => ply.deflection.as_deref(),
            Self::Thickness => ply.shape.thickness.as_deref(),
            Self::Deviation1 => ply.shape.deviation.as_ref().map(|d| d[0].as_slice()),
            Self::Deviation2 => ply.shape.deviation.as_ref().map(|d| d[1].as_slice()),
        }
    }

    /// The values from which its scale follows: of both families there is one scale.
    fn on_scale(self, ply: &Ply) -> Vec<&[f64]> {
        match self {
            Self::Deviation1 | Self::Deviation2 => {
                let both = ply.shape.deviation.iter().flatten();
                both.map(Vec::as_slice).collect()
            }
            _ => self.stored(ply).into_iter().collect(),
        }
    }

    /// Limits of the detection (SI), drawn on the scale.
    fn limits(self, detection: Option<&Defects>) -> Vec<f64> {
        let Some(d) = detection else {
            return Vec::new();
        };
        let t = &d.thresholds;
        match self {
            Self::Shear => {
                // Plies of different fabrics have different limits.
                let of_plies = d.plies.iter().filter_map(|p| p.over_shear);
                let mut all: Vec<f64> = of_plies
                    .flat_map(|s| [s.negative, s.positive])
                    .chain([t.over_shear_negative, t.over_shear_positive])
                    .flatten()
                    .collect();
                all.sort_by(f64::total_cmp);
                all.dedup();
                all
            }
            Self::Distance => t.distance_threshold.into_iter().collect(),
            _ => Vec::new(),
        }
    }

    /// The scale of all maps of this quantity on these plies, global and local, so that colours compare; `None` when no ply has it.
    pub(crate) fn legend(self, plies: &[&Ply], detection: Option<&Defects>) -> Option<Legend> {
        let values = || {
            (plies.iter())
                .filter_map(|p| self.stored(p))
                .flatten()
                .copied()
        };
        let limits = self.limits(detection);
        let [title, unit, _] = self.about();
        let (factor, _) = shown(unit);
        let shown = || {
            plies
                .iter()
                .flat_map(|p| self.on_scale(p))
                .flatten()
                .copied()
        };
        let end = |part, least| end_of_scale(shown(), part, least, factor);
        let scale = match self {
            Self::Shear => Scale::about_zero(Palette::BlueRed, end(0.995, 0.02)),
            Self::Deviation1 | Self::Deviation2 => {
                Scale::about_zero(Palette::BlueRed, end(0.995, 0.02))
            }
            Self::Thickness => Scale::fitted(range_of(values())?, factor),
            Self::Deflection => {
                Scale::about_zero(Palette::PurpleOrange, end(1.0, LEAST_DEFLECTION))
            }
            // Crests of the finest mesh are narrow; a scale that shows their peaks leaves the part pale.
            Self::Curvature => Scale::about_zero(Palette::PurpleOrange, end(0.985, 10.0)),
            Self::Distance => {
                // Edges that hang in the air stand centimetres off; a scale that shows them hides all else.
                let threshold = limits.first().copied().unwrap_or(1e-3);
                let end = end(0.995, 2.0 * threshold);
                Scale::from_zero(end.min(8.0 * threshold))
            }
        };
        Some(Legend {
            field: Some(self),
            title: title.to_owned(),
            si: unit.to_owned(),
            scale,
            range: range_of(values())?,
            limits,
        })
    }
}

/// A colour scale with what it must tell.
#[derive(Debug, Clone)]
pub(crate) struct Legend {
    /// Absent: one of the other fields of the plies.
    pub(crate) field: Option<Field>,
    title: String,
    /// SI unit.
    si: String,
    pub(crate) scale: Scale,
    /// Smallest and largest value (SI).
    range: [f64; 2],
    limits: Vec<f64>,
}

/// Of the other fields of the plies.
#[derive(Debug, Default)]
pub(crate) struct Others {
    /// Those with something to see, in the order in which the plies have them.
    pub(crate) legends: Vec<Legend>,
    /// Titles of those that are the same everywhere, with that value.
    pub(crate) even: Vec<String>,
}

impl Others {
    /// Those of plies, each with one scale for all of them.
    pub(crate) fn of(plies: &[&Ply]) -> Self {
        let mut all = Self::default();
        let mut seen: Vec<(&str, &str)> = Vec::new();
        for other in plies.iter().flat_map(|p| &p.others) {
            let name = (other.title.as_str(), other.unit.as_str());
            if seen.contains(&name) {
                continue;
            }
            seen.push(name);
            let fields = plies.iter().flat_map(|p| &p.others);
            let same = fields.filter(|o| (o.title.as_str(), o.unit.as_str()) == name);
            let values: Vec<f64> = same.flat_map(|o| o.values.iter().copied()).collect();
            match range_of(values.iter().copied()) {
                Some([low, high]) if low == high => {
                    let value = quantity(low, name.1, 4);
                    all.even.push(format!("{} ({value})", other.title));
                }
                Some(range) => all.legends.push(Legend::of_other(other, &values, range)),
                None => {}
            }
        }
        all
    }
}

impl Legend {
    fn of_other(other: &Other, values: &[f64], range: [f64; 2]) -> Self {
        let (factor, _) = shown(&other.unit);
        let end = |part| end_of_scale(values.iter().copied(), part, 0.0, factor);
        // What is nought nearly everywhere is shown to its largest.
        let most = values.iter().map(|v| v.abs()).fold(0.0, f64::max);
        let usual = end(0.995);
        let high = if usual < 1e-3 * most { end(1.0) } else { usual };
        let scale = if range[0] < 0.0 {
            Scale::about_zero(Palette::PurpleOrange, high)
        } else {
            Scale::from_zero(high)
        };
        Self {
            field: None,
            title: other.title.clone(),
            si: other.unit.clone(),
            scale,
            range,
            limits: Vec::new(),
        }
    }

    /// What it is a scale of.
    pub(crate) fn title(&self) -> &str {
        &self.title
    }

    /// The title with the unit of its numbers: `Shear angle (deg)`.
    pub(crate) fn titled(&self) -> String {
        match self.unit() {
            "" => self.title.clone(),
            unit => format!("{} ({unit})", self.title),
        }
    }

    /// Its SI unit.
    pub(crate) fn si_unit(&self) -> &str {
        &self.si
    }

    /// Values at the points of a ply; cell values are averaged there. `None` when the ply does not have the field.
    pub(crate) fn at_points(&self, ply: &Ply) -> Option<Vec<f64>> {
        let Some(field) = self.field else {
            let is = |o: &&Other| o.title == self.title && o.unit == self.si;
            return ply.others.iter().find(is).map(|o| o.values.clone());
        };
        field.at_points(ply)
    }

    /// Whether nothing is to be seen: all values are nought, but for rounding.
    pub(crate) fn is_flat(&self) -> bool {
        let least = match self.field {
            Some(Field::Deflection) => LEAST_DEFLECTION,
            _ => 1e-6,
        };
        self.range.iter().all(|v| v.abs() < least)
    }

    /// The colour bar with ticks and limits.
    pub(crate) fn bar(&self, id: &str) -> Markup {
        let (factor, unit) = shown(&self.si);
        let what = format!("{} scale, {unit}", self.title);
        bar(id, self.scale, factor, &self.limits, &what)
    }

    /// Unit of its numbers.
    pub(crate) fn unit(&self) -> &str {
        shown(&self.si).1
    }

    /// What the bar is about, for the text under it.
    pub(crate) fn note(&self) -> Markup {
        self.note_over(self.range)
    }

    /// The same where only these plies are shown, of all that share the scale.
    pub(crate) fn note_of(&self, plies: &[Ply]) -> Markup {
        let is = |o: &&Other| o.title == self.title && o.unit == self.si;
        let values = plies.iter().filter_map(|p| match self.field {
            Some(field) => field.stored(p),
            None => p.others.iter().find(is).map(|o| o.values.as_slice()),
        });
        self.note_over(range_of(values.flatten().copied()).unwrap_or(self.range))
    }

    fn note_over(&self, range: [f64; 2]) -> Markup {
        let (factor, unit) = shown(&self.si);
        let Scale { low, high, .. } = self.scale;
        // No more digits than the scale can show.
        let step = 10f64.powf(((high - low) * factor * 1e-3).log10().floor());
        let value = |v: f64| number((v * factor / step).round() * step, 3);
        html! {
            p class="note" {
                @if unit.is_empty() { "Values" } @else { b { (unit) } "; values" } " from " (value(range[0])) " to " (value(range[1]))
                @if range[0] < low || range[1] > high { " (colours end where the bar ends)" }
                ". " @if let Some(field) = self.field { (field.about()[2]) } @else { "Plies that do not have it are grey." }
            }
        }
    }
}
