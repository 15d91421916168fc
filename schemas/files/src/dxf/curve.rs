//! Curves as corners.

use super::read::{Drawing, Pair, span};
use super::unit::Unit;
use super::walk::{Curve, Entity, degrees};
use crate::flaw::Flaw;
use crate::turn::sin_cos;
use plyflow_fixed::FixedBits;
use plyflow_model::outline::{MOST_CORNERS, Point};
use std::f64::consts::TAU;

/// How many sides stand for an arc of this radius (m) and angle (rad), none of which lies farther off it than `chord` (m).
fn sides(radius: f64, angle: f64, chord: f64) -> usize {
    // A chord longer than the radius would leave no polygon.
    let off = (chord / radius).min(0.1);
    let side = 2.0 * (1.0 - off).fixed_acos();
    let count = (angle.abs() / side).ceil();
    // Not a number where the arc is far too large for the chord: as many as are read.
    if count.is_finite() {
        (count as usize).clamp(1, MOST_CORNERS + 1)
    } else {
        MOST_CORNERS + 1
    }
}

impl Drawing<'_> {
    /// The corners of an entity.
    pub(super) fn curve(&self, entity: &Entity<'_>, unit: Unit, chord: f64) -> Result<Curve, Flaw> {
        self.flat(entity, unit, chord)?;
        // What is enlarged later is to be as fine then.
        let fine = entity.placed.map_or(chord, |p| chord / p.scale().max(1e-3));
        let (mut points, closed) = match entity.kind {
            "LINE" => (self.line(entity, unit)?, false),
            "ARC" | "CIRCLE" => self.arc(entity, unit, fine)?,
            "ELLIPSE" => self.ellipse(entity, unit, fine)?,
            "SPLINE" => self.spline(entity, unit, fine)?,
            "LWPOLYLINE" => self.light_polyline(entity, unit, fine)?,
            _ => self.polyline(entity, unit, fine)?,
        };
        // Coordinates of these are those of the plane that they are drawn in.
        let of_plane = !matches!(entity.kind, "LINE" | "ELLIPSE" | "SPLINE");
        if of_plane && self.mirrored(entity)? {
            points.iter_mut().for_each(|p| p[0] = -p[0]);
        }
        if let Some(place) = entity.placed {
            points.iter_mut().for_each(|p| *p = place.of(*p));
        }
        if points
            .iter()
            .flatten()
            .any(|v| !v.is_finite() || v.abs() > 1e7)
        {
            return Err(self.wrong(entity, "lies farther off than any ply"));
        }
        Ok(Curve {
            points,
            closed,
            kind: entity.kind.to_owned(),
            span: entity.span.clone(),
        })
    }

    /// Refuses what has a height of its own.
    fn flat(&self, entity: &Entity<'_>, unit: Unit, chord: f64) -> Result<(), Flaw> {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let own = std::iter::once(&entity.pairs).chain(&entity.corners);
        for pair in own.flat_map(|r| &self.pairs[r.clone()]) {
            let of_polyline = entity.kind == "POLYLINE" && pair.code != 30;
            if matches!(pair.code, 30..=31) && !of_polyline {
                let z = self.length_of(pair, unit)?;
                (low, high) = (low.min(z), high.max(z));
            }
        }
        // The second z of an ellipse is of its axis, which begins at 0.
        if entity.kind == "ELLIPSE" {
            return Ok(());
        }
        match high - low > chord {
            true => Err(self.wrong(
                entity,
                &format!(
                    "is not flat: its z spans {} mm; expected a drawing in the x-y plane",
                    (1e6 * (high - low)).round() / 1e3
                ),
            )),
            false => Ok(()),
        }
    }

    /// A point of two codes (m).
    fn point(&self, entity: &Entity<'_>, codes: [i32; 2], unit: Unit) -> Result<Point, Flaw> {
        let [x, y] = codes.map(|code| self.length(&entity.pairs, code, unit));
        match (x?, y?) {
            (Some(x), Some(y)) => Ok([x, y]),
            _ => Err(self.wrong(
                entity,
                &format!("has no point (groups {} and {})", codes[0], codes[1]),
            )),
        }
    }

    fn needed(&self, entity: &Entity<'_>, code: i32) -> Result<f64, Flaw> {
        let found = self.number(&entity.pairs, code)?;
        found.ok_or_else(|| self.wrong(entity, &format!("has no group {code}")))
    }

    fn line(&self, entity: &Entity<'_>, unit: Unit) -> Result<Vec<Point>, Flaw> {
        Ok(vec![
            self.point(entity, [10, 20], unit)?,
            self.point(entity, [11, 21], unit)?,
        ])
    }

    fn arc(&self, entity: &Entity<'_>, unit: Unit, chord: f64) -> Result<(Vec<Point>, bool), Flaw> {
        let [x, y] = self.point(entity, [10, 20], unit)?;
        let radius = self.length(&entity.pairs, 40, unit)?.filter(|r| *r > 0.0);
        let radius = radius.ok_or_else(|| self.wrong(entity, "has no radius"))?;
        let at = |angle: f64| {
            let (s, c) = sin_cos(angle);
            [x + radius * c, y + radius * s]
        };
        if entity.kind == "CIRCLE" {
            let n = sides(radius, TAU, chord).max(8);
            let turn = TAU / n as f64;
            return Ok(((0..n).map(|k| at(turn * k as f64)).collect(), true));
        }
        let [from, to] = [self.needed(entity, 50)?, self.needed(entity, 51)?].map(degrees);
        let angle = (to - from).rem_euclid(TAU);
        let angle = if angle > 0.0 { angle } else { TAU };
        let n = sides(radius, angle, chord);
        let point = |k: usize| match k {
            k if k == n => at(to),
            k => at(from + angle * (k as f64 / n as f64)),
        };
        Ok(((0..=n).map(point).collect(), false))
    }

    fn ellipse(
        &self,
        entity: &Entity<'_>,
        unit: Unit,
        chord: f64,
    ) -> Result<(Vec<Point>, bool), Flaw> {
        let [x, y] = self.point(entity, [10, 20], unit)?;
        let major = self.point(entity, [11, 21], unit)?;
        let ratio = self.needed(entity, 40)?;
        let radius = major[0].fixed_hypot(major[1]);
        if !(radius > 0.0 && ratio > 0.0 && ratio <= 1e3) {
            return Err(self.wrong(entity, "has no axes"));
        }
        let sense = if self.mirrored(entity)? { -1.0 } else { 1.0 };
        let minor = [-sense * ratio * major[1], sense * ratio * major[0]];
        let from = self.number(&entity.pairs, 41)?.unwrap_or(0.0);
        let to = self.number(&entity.pairs, 42)?.unwrap_or(TAU);
        let at = |t: f64| {
            let (s, c) = sin_cos(t);
            [
                x + c * major[0] + s * minor[0],
                y + c * major[1] + s * minor[1],
            ]
        };
        let angle = (to - from).rem_euclid(TAU);
        // A side of the circle that the ellipse is the image of lies no nearer to it.
        let n = sides(
            radius * ratio.max(1.0),
            TAU,
            chord.min(0.1 * radius * ratio),
        )
        .max(8);
        if angle < 1e-9 || TAU - angle < 1e-9 {
            let turn = TAU / n as f64;
            return Ok(((0..n).map(|k| at(from + turn * k as f64)).collect(), true));
        }
        let n = ((n as f64 * angle / TAU).ceil() as usize).max(1);
        Ok((
            (0..=n)
                .map(|k| at(from + angle * (k as f64 / n as f64)))
                .collect(),
            false,
        ))
    }

    fn light_polyline(
        &self,
        entity: &Entity<'_>,
        unit: Unit,
        chord: f64,
    ) -> Result<(Vec<Point>, bool), Flaw> {
        let mut corners: Vec<(Point, f64)> = Vec::new();
        let mut x: Option<f64> = None;
        for pair in &self.pairs[entity.pairs.clone()] {
            match pair.code {
                10 => x = Some(self.length_of(pair, unit)?),
                20 => {
                    let y = self.length_of(pair, unit)?;
                    let x = x.take().ok_or_else(|| no_x(pair))?;
                    corners.push(([x, y], 0.0));
                }
                42 => {
                    let bulge = self.number_of(pair)?;
                    corners.last_mut().ok_or_else(|| no_x(pair))?.1 = bulge;
                }
                _ => {}
            }
        }
        let flags = self.number(&entity.pairs, 70)?.unwrap_or(0.0) as i64;
        Ok(bulged(&corners, flags & 1 == 1, chord))
    }

    fn polyline(
        &self,
        entity: &Entity<'_>,
        unit: Unit,
        chord: f64,
    ) -> Result<(Vec<Point>, bool), Flaw> {
        let flags = self.number(&entity.pairs, 70)?.unwrap_or(0.0) as i64;
        if flags & (16 | 64) != 0 {
            return Err(self.wrong(entity, "is a mesh, and no line"));
        }
        let mut corners = Vec::new();
        for own in &entity.corners {
            let of_vertex = self.number(own, 70)?.unwrap_or(0.0) as i64;
            // The frame of a spline is not on the curve.
            if of_vertex & 16 != 0 {
                continue;
            }
            let [x, y] = [self.length(own, 10, unit)?, self.length(own, 20, unit)?];
            let (Some(x), Some(y)) = (x, y) else {
                return Err(self.wrong(entity, "has a corner without a place"));
            };
            corners.push(([x, y], self.number(own, 42)?.unwrap_or(0.0)));
        }
        Ok(bulged(&corners, flags & 1 == 1, chord))
    }
}

fn no_x(pair: &Pair) -> Flaw {
    Flaw::at(span(pair), "a corner begins with its x (group 10)").help("export the drawing again")
}

/// Corners with the arcs between them: `bulge` is the tangent of a quarter of the arc's angle, counter-clockwise.
fn bulged(corners: &[(Point, f64)], closed: bool, chord: f64) -> (Vec<Point>, bool) {
    let n = corners.len();
    let mut points = Vec::with_capacity(n);
    for (k, (p, bulge)) in corners.iter().enumerate() {
        points.push(*p);
        let last = k + 1 == n;
        if bulge.abs() < 1e-12 || (last && !closed) || points.len() > 2 * MOST_CORNERS {
            continue;
        }
        let q = corners[(k + 1) % n].0;
        let d = [q[0] - p[0], q[1] - p[1]];
        // The centre lies to the left of the way by this part of it.
        let off = (1.0 - bulge * bulge) / (4.0 * bulge);
        let centre = [
            0.5 * (p[0] + q[0]) - off * d[1],
            0.5 * (p[1] + q[1]) + off * d[0],
        ];
        let from = [p[0] - centre[0], p[1] - centre[1]];
        let radius = from[0].fixed_hypot(from[1]);
        let angle = 4.0 * bulge.fixed_atan();
        if !(radius > 0.0 && radius.is_finite()) {
            continue;
        }
        let m = sides(radius, angle, chord);
        for i in 1..m {
            let (s, c) = (angle * (i as f64 / m as f64)).fixed_sin_cos();
            points.push([
                centre[0] + c * from[0] - s * from[1],
                centre[1] + s * from[0] + c * from[1],
            ]);
        }
    }
    (points, closed)
}
