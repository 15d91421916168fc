//! DXF drawings in text: the curves of the model space, with those of its blocks in their places, and closed contours of them.
//!
//! Read are lines, arcs, circles, ellipses, splines and polylines, in drawings of R12 or later. Texts, dimensions, points and hatches are passed
//! over. What else lies on the layer that is asked for is refused with its line, so that no edge is left out in silence.

mod curve;
mod join;
mod read;
mod spline;
mod unit;
mod walk;

use crate::flaw::Flaw;
use crate::text::shown;

pub use join::{Closed, Contours, Fineness, nested};
pub use read::{Drawing, MOST_DRAWN};
pub use unit::Unit;

/// Most corners of all curves of a layer, before they are joined.
const MOST_POINTS: usize = 100_000;

/// What is drawn with a pen.
const CURVES: [&str; 7] = [
    "LINE",
    "ARC",
    "CIRCLE",
    "ELLIPSE",
    "SPLINE",
    "LWPOLYLINE",
    "POLYLINE",
];

impl Drawing<'_> {
    /// The layers that have curves, sorted, as the file spells them.
    ///
    /// # Errors
    /// As [`Drawing::contours`], where blocks cannot be put into their places.
    pub fn layers(&self) -> Result<Vec<String>, Flaw> {
        let all = self.all(Unit::Metres(1.0))?;
        let curves = all.into_iter().filter(|e| CURVES.contains(&e.kind));
        let mut layers: Vec<String> = curves.map(|e| e.layer).collect();
        layers.sort();
        layers.dedup();
        Ok(layers)
    }

    /// The closed contours of a layer (m); of the one layer that has curves, where none is given.
    ///
    /// # Errors
    /// The first thing that is wrong, with its place.
    pub fn contours(
        &self,
        layer: Option<&str>,
        unit: Unit,
        fine: Fineness,
    ) -> Result<Contours, Flaw> {
        let chosen = self.chosen(layer)?;
        let same = |a: &str| a.to_lowercase() == chosen.to_lowercase();
        let (mut curves, mut corners) = (Vec::new(), 0);
        for entity in self.all(unit)?.iter().filter(|e| same(&e.layer)) {
            if !CURVES.contains(&entity.kind) {
                let problem = format!(
                    "a {} on the layer `{}` is not read",
                    shown(entity.kind),
                    shown(&entity.layer)
                );
                return Err(Flaw::at(entity.span.clone(), problem)
                    .expected(format!("some of {}", CURVES.join(", ")))
                    .help("explode it, or put what is no edge on another layer"));
            }
            let curve = self.curve(entity, unit, fine.chord)?;
            corners += curve.points.len();
            if corners > MOST_POINTS {
                let problem =
                    format!("the curves of the layer have more than {MOST_POINTS} corners");
                return Err(Flaw::at(entity.span.clone(), problem)
                    .help("give a larger `chord`, or leave out what is no outline"));
            }
            curves.push(curve);
        }
        join::contours(curves, fine.tolerance)
    }

    /// The layer that is meant.
    fn chosen(&self, layer: Option<&str>) -> Result<String, Flaw> {
        let layers = self.layers()?;
        let there = || {
            layers
                .iter()
                .take(12)
                .map(|l| format!("`{}`", shown(l)))
                .collect::<Vec<_>>()
                .join(", ")
        };
        let same = |a: &str, b: &str| a.to_lowercase() == b.to_lowercase();
        match (layer, layers.as_slice()) {
            (_, []) => Err(Flaw::whole("the drawing has no curve in its model space")
                .expected(format!("some of {}", CURVES.join(", ")))),
            (None, [one]) => Ok(one.clone()),
            (None, all) => {
                let problem = format!("curves lie on {} layers: {}", all.len(), there());
                Err(Flaw::whole(problem).expected("`layer`, the layer of the outline"))
            }
            (Some(layer), all) => match all.iter().find(|l| same(l, layer)) {
                Some(_) => Ok(layer.to_owned()),
                None => {
                    let problem = format!(
                        "there is no curve on the layer `{}`; curves lie on {}",
                        shown(layer),
                        there()
                    );
                    Err(Flaw::whole(problem).expected("one of these layers"))
                }
            },
        }
    }
}
