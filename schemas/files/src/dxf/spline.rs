//! Splines: rational curves of any degree by de Boor's recursion (Piegl and Tiller, The NURBS Book, 1997, algorithm A4.1 in its form
//! of repeated interpolation).

use super::read::Drawing;
use super::unit::Unit;
use super::walk::Entity;
use crate::flaw::Flaw;
use plyflow_model::outline::{MOST_CORNERS, Point, segment_distance};

/// Highest degree.
const HIGHEST: usize = 25;

/// How often an interval may be halved.
const DEEPEST: u32 = 12;

struct Spline {
    degree: usize,
    knots: Vec<f64>,
    /// Weight times place, and weight.
    poles: Vec<[f64; 3]>,
}

impl Drawing<'_> {
    pub(super) fn spline(
        &self,
        entity: &Entity<'_>,
        unit: Unit,
        chord: f64,
    ) -> Result<(Vec<Point>, bool), Flaw> {
        let (mut knots, mut x, mut y, mut weights) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let mut fitted = false;
        for pair in &self.pairs[entity.pairs.clone()] {
            match pair.code {
                40 => knots.push(self.number_of(pair)?),
                41 => weights.push(self.number_of(pair)?),
                10 => x.push(self.length_of(pair, unit)?),
                20 => y.push(self.length_of(pair, unit)?),
                11 => fitted = true,
                _ => {}
            }
        }
        let degree = self.number(&entity.pairs, 71)?.unwrap_or(3.0) as usize;
        let flags = self.number(&entity.pairs, 70)?.unwrap_or(0.0) as i64;
        let n = x.len();
        if n == 0 && fitted {
            return Err(self
                .wrong(
                    entity,
                    "has points that it goes through, and no control points",
                )
                .help("export splines with control points, or as polylines"));
        }
        let spline = Spline::new(degree, knots, [x, y], &weights);
        let spline = spline.map_err(|what| self.wrong(entity, &what))?;
        let points = spline.corners(chord);
        let ends = [points.first(), points.last()];
        let meet = matches!(ends, [Some(a), Some(b)] if (a[0] - b[0]).abs().max((a[1] - b[1]).abs()) <= 1e-9);
        Ok((points, flags & 1 == 1 && meet))
    }
}

impl Spline {
    /// A spline of control points, whose weights are 1 where none are given.
    ///
    /// # Errors
    /// What it is instead of a spline.
    fn new(
        degree: usize,
        knots: Vec<f64>,
        [x, y]: [Vec<f64>; 2],
        weights: &[f64],
    ) -> Result<Self, String> {
        let n = x.len();
        let whole = (1..=HIGHEST).contains(&degree)
            && n > degree
            && y.len() == n
            && knots.len() == n + degree + 1;
        let ordered = knots.windows(2).all(|w| w[0] <= w[1]);
        if !whole
            || !ordered
            || !(weights.is_empty() || weights.len() == n)
            || weights.iter().any(|w| *w <= 0.0)
        {
            let what = format!(
                "is none: degree {degree}, {n} control points, {} knots, {} weights",
                knots.len(),
                weights.len()
            );
            return Err(what);
        }
        let pole = |k: usize| {
            let w = weights.get(k).copied().unwrap_or(1.0);
            [w * x[k], w * y[k], w]
        };
        Ok(Spline {
            degree,
            poles: (0..n).map(pole).collect(),
            knots,
        })
    }

    /// The point at `u` in the interval between the knots `k` and `k + 1`.
    fn at(&self, k: usize, u: f64) -> Point {
        let p = self.degree;
        let mut d: Vec<[f64; 3]> = self.poles[k - p..=k].to_vec();
        for r in 1..=p {
            for j in (r..=p).rev() {
                let i = j + k - p;
                let (low, high) = (self.knots[i], self.knots[i + p + 1 - r]);
                let t = if high > low {
                    (u - low) / (high - low)
                } else {
                    0.0
                };
                for c in 0..3 {
                    d[j][c] = (1.0 - t) * d[j - 1][c] + t * d[j][c];
                }
            }
        }
        let [x, y, w] = d[p];
        [x / w, y / w]
    }

    /// Corners none of whose sides lies farther off the curve than `chord` (m), as seen from the middle of each.
    fn corners(&self, chord: f64) -> Vec<Point> {
        const PARTS: usize = 8;
        let mut points = Vec::new();
        for k in self.degree..self.poles.len() {
            let (low, high) = (self.knots[k], self.knots[k + 1]);
            if high <= low {
                continue;
            }
            let u = |i: usize| low + (high - low) * (i as f64 / PARTS as f64);
            if points.is_empty() {
                points.push(self.at(k, low));
            }
            for i in 0..PARTS {
                self.halved(k, (u(i), u(i + 1)), chord, DEEPEST, &mut points);
            }
        }
        points
    }

    fn halved(
        &self,
        k: usize,
        (from, to): (f64, f64),
        chord: f64,
        depth: u32,
        points: &mut Vec<Point>,
    ) {
        let middle = 0.5 * (from + to);
        let [a, m, b] = [from, middle, to].map(|u| self.at(k, u));
        if depth == 0 || points.len() > 2 * MOST_CORNERS || segment_distance(m, a, b) <= chord {
            points.push(b);
        } else {
            self.halved(k, (from, middle), chord, depth - 1, points);
            self.halved(k, (middle, to), chord, depth - 1, points);
        }
    }
}
