//! A clamped polynomial of the tangent's angle over the arc:
//! `d theta / d xi = (1 - xi)^2 sum b_j P_j(2 xi - 1)`, `xi = s / L`, `theta(0) = 0`.
//!
//! The curve has length L exactly, may hang as steeply as it likes, and ends as a free tip must: no moment
//! and no shear force there, so neither curvature nor its slope. Gauss-Newton on the distances normal to the
//! curve; the length is the arc at the last point, unless the overhang is given.

use super::grid::{Grid, legendre};
use super::terms::{Choice, Profile, ProfileFit, Stations, overhang_reaches, spread};
use crate::linear::{Solution, least_squares};
use nalgebra::DMatrix;
use plyflow_fixed::FixedBits;

pub const LEAST_DEGREE: usize = 4;
const ITERATIONS: usize = 60;
/// Chords from which the first guess is made.
const CHORDS: usize = 16;
/// Stations searched to each side for the foot of a point.
const WINDOW: usize = 12;

/// The curve for some unknowns, with its derivatives, at stations evenly over the arc.
pub struct Curve {
    pub length: f64,
    pub angle: Vec<f64>,
    pub curvature: Vec<f64>,
    pub place: Vec<[f64; 2]>,
    /// `[term][station]`: derivative of the place with respect to an unknown.
    pub change: Vec<Vec<[f64; 2]>>,
}

/// `[term][station]`: derivative of angle and of curvature times length with respect to an unknown.
struct Basis {
    angle: Vec<Vec<f64>>,
    curvature: Vec<Vec<f64>>,
}

fn shape(j: usize, t: f64) -> f64 {
    (1.0 - t) * (1.0 - t) * legendre(j, t)[0]
}

fn basis(grid: &Grid, terms: usize) -> Basis {
    Basis {
        angle: (0..terms)
            .map(|j| grid.integral_of(|t| shape(j, t)))
            .collect(),
        curvature: (0..terms)
            .map(|j| grid.at.iter().map(|t| shape(j, *t)).collect())
            .collect(),
    }
}

fn combine(rows: &[Vec<f64>], unknowns: &[f64], stations: usize) -> Vec<f64> {
    (0..stations)
        .map(|i| unknowns.iter().zip(rows).map(|(b, row)| b * row[i]).sum())
        .collect()
}

fn curve(grid: &Grid, basis: &Basis, unknowns: &[f64], length: f64) -> Curve {
    let n = grid.at.len();
    let angle = combine(&basis.angle, unknowns, n);
    let curvature = combine(&basis.curvature, unknowns, n)
        .iter()
        .map(|k| k / length)
        .collect();
    let along = |f: &dyn Fn(usize) -> f64| -> Vec<f64> {
        let values: Vec<f64> = (0..n).map(|i| length * f(i)).collect();
        grid.integral(&values)
    };
    let pair = |a: Vec<f64>, b: Vec<f64>| -> Vec<[f64; 2]> {
        a.into_iter().zip(b).map(|(a, b)| [a, b]).collect()
    };
    let place = pair(
        along(&|i| angle[i].fixed_cos()),
        along(&|i| angle[i].fixed_sin()),
    );
    let change = (basis.angle.iter())
        .map(|phi| {
            pair(
                along(&|i| -angle[i].fixed_sin() * phi[i]),
                along(&|i| angle[i].fixed_cos() * phi[i]),
            )
        })
        .collect();
    Curve {
        length,
        angle,
        curvature,
        place,
        change,
    }
}

/// Where a point's normal meets the curve.
pub struct Foot {
    /// Arc length; before 0 and beyond the length on the straight continuations.
    arc: f64,
    /// Distance normal to the curve, signed (m).
    pub distance: f64,
    normal: [f64; 2],
    station: usize,
    weight: f64,
}

impl Foot {
    /// What the distance to the curve falls by where its stations move so (m).
    pub fn normal_part(&self, change: &[[f64; 2]]) -> f64 {
        let [a, b] = [change[self.station], change[self.station + 1]];
        let blend = |d: usize| (1.0 - self.weight) * a[d] + self.weight * b[d];
        blend(0) * self.normal[0] + blend(1) * self.normal[1]
    }
}

impl Curve {
    /// `near`: a station to search from.
    fn foot(&self, p: [f64; 2], near: usize) -> Foot {
        let n = self.place.len();
        let h = self.length / (n - 1) as f64;
        let square =
            |i: usize| (self.place[i][0] - p[0]).powi(2) + (self.place[i][1] - p[1]).powi(2);
        let (mut nearest, mut least) = (0, f64::INFINITY);
        let mut search = |stations: std::ops::RangeInclusive<usize>| {
            for i in stations {
                let d = square(i);
                if d < least {
                    (nearest, least) = (i, d);
                }
            }
            nearest
        };
        // The nearest station within a window, which grows to one side while the nearest is its last there.
        let (first, mut to) = (near.saturating_sub(WINDOW), (near + WINDOW).min(n - 1));
        let mut found = search(first..=to);
        while found == to && to < n - 1 {
            let from = to;
            to = (to + WINDOW).min(n - 1);
            found = search(from..=to);
        }
        let mut from = first;
        while found == from && from > 0 {
            let last = from;
            from = from.saturating_sub(WINDOW);
            found = search(from..=last);
        }
        let mut s = nearest as f64 * h;
        for _ in 0..4 {
            let (c, angle, k) = self.at(s);
            let (t, normal) = (
                [angle.fixed_cos(), angle.fixed_sin()],
                [-angle.fixed_sin(), angle.fixed_cos()],
            );
            let away = [c[0] - p[0], c[1] - p[1]];
            let slope = 1.0 + k * (away[0] * normal[0] + away[1] * normal[1]);
            s -= (away[0] * t[0] + away[1] * t[1]) / slope.max(0.2);
        }
        let (c, angle, _) = self.at(s);
        let normal = [-angle.fixed_sin(), angle.fixed_cos()];
        let along = (s / h).clamp(0.0, (n - 1) as f64);
        let station = (along as usize).min(n - 2);
        Foot {
            arc: s,
            distance: (p[0] - c[0]) * normal[0] + (p[1] - c[1]) * normal[1],
            normal,
            station,
            weight: along - station as f64,
        }
    }

    /// Place, angle and curvature at an arc length.
    fn at(&self, s: f64) -> ([f64; 2], f64, f64) {
        let n = self.place.len();
        if s <= 0.0 {
            return ([s, 0.0], 0.0, 0.0);
        }
        if s >= self.length {
            let (c, a) = (self.place[n - 1], self.angle[n - 1]);
            let beyond = s - self.length;
            return (
                [c[0] + beyond * a.fixed_cos(), c[1] + beyond * a.fixed_sin()],
                a,
                0.0,
            );
        }
        let h = self.length / (n - 1) as f64;
        let i = ((s / h) as usize).min(n - 2);
        let t = s / h - i as f64;
        let (t2, t3) = (t * t, t * t * t);
        let w = [
            2.0 * t3 - 3.0 * t2 + 1.0,
            t3 - 2.0 * t2 + t,
            3.0 * t2 - 2.0 * t3,
            t3 - t2,
        ];
        let hermite =
            |a: f64, da: f64, b: f64, db: f64| w[0] * a + w[2] * b + h * (w[1] * da + w[3] * db);
        let ends = [i, i + 1].map(|i| [self.angle[i].fixed_cos(), self.angle[i].fixed_sin()]);
        let c = [0, 1].map(|d| {
            hermite(
                self.place[i][d],
                ends[0][d],
                self.place[i + 1][d],
                ends[1][d],
            )
        });
        let (k0, k1) = (self.curvature[i], self.curvature[i + 1]);
        (
            c,
            hermite(self.angle[i], k0, self.angle[i + 1], k1),
            k0 + t * (k1 - k0),
        )
    }
}

/// Unknowns, and what their curve misses of the points.
struct Trial {
    unknowns: Vec<f64>,
    length: f64,
    feet: Vec<Foot>,
    /// Arc at the last point (m).
    arc: f64,
    /// Sum of the squared distances (m2).
    left: f64,
}

impl Trial {
    fn new(grid: &Grid, basis: &Basis, profile: &Profile, unknowns: Vec<f64>, length: f64) -> Self {
        let (feet, arc) = misfit(&curve(grid, basis, &unknowns, length), profile);
        Self {
            left: squares(&feet),
            unknowns,
            length,
            feet,
            arc,
        }
    }

    /// The change of the unknowns that lessens the distances most, were they linear. `shape`: the curve.
    fn change(&self, shape: &Curve) -> Result<Solution, String> {
        let matrix = DMatrix::from_fn(self.feet.len(), self.unknowns.len(), |i, j| {
            self.feet[i].normal_part(&shape.change[j])
        });
        let right: Vec<f64> = self.feet.iter().map(|f| f.distance).collect();
        least_squares(&matrix, &right)
    }

    /// As far along a change of the unknowns and towards another length as the sum of squares allows. `at` tries.
    fn moved(&self, change: &[f64], longer: f64, at: impl Fn(Vec<f64>, f64) -> Self) -> Self {
        let mut factor = 1.0;
        loop {
            let parts = self.unknowns.iter().zip(change);
            let unknowns = parts.map(|(b, d)| b + factor * d).collect();
            let tried = at(unknowns, self.length + factor * (longer - self.length));
            // The length follows the last point, so the sum may rise a little on the way.
            if tried.left <= self.left * 1.05 + 1e-20 || factor < 0.05 {
                return tried;
            }
            factor *= 0.5;
        }
    }
}

/// Fits; `start`: unknowns of a lower degree and the length found with them.
pub fn fit(
    grid: &Grid,
    profile: &Profile,
    degree: usize,
    choice: &Choice,
    start: Option<&(Vec<f64>, f64)>,
) -> Result<ProfileFit, String> {
    let terms = degree - 2;
    let basis = basis(grid, terms);
    let (mut unknowns, length) = match start {
        Some((unknowns, length)) => (unknowns.clone(), *length),
        None => guess(grid, profile, terms)?,
    };
    unknowns.resize(terms, 0.0);
    let given = choice.overhang;
    let at = |unknowns, length| Trial::new(grid, &basis, profile, unknowns, length);
    let mut now = at(unknowns, given.unwrap_or(length));
    let mut solved = None;
    for _ in 0..ITERATIONS {
        let shape = curve(grid, &basis, &now.unknowns, now.length);
        let solution = now.change(&shape)?;
        let longer = given.unwrap_or(now.arc);
        let step = solution.unknowns.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        let moved = (longer - now.length).abs() / now.length;
        now = now.moved(&solution.unknowns, longer, at);
        solved = Some(solution);
        if step < 1e-10 && moved < 1e-11 {
            break;
        }
    }
    let solution = solved.ok_or("the fit of the profile did not start")?;
    if !now.left.is_finite() || now.unknowns.iter().any(|b| !b.is_finite()) {
        return Err(format!(
            "the fit of degree {degree} to the profile does not converge"
        ));
    }
    if let Some(overhang) = given {
        overhang_reaches(overhang, now.arc)?;
    }
    let rows = now.feet.len() as f64;
    let variance = now.left / (rows - terms as f64).max(1.0);
    let stations = stations(grid, &now.unknowns, now.length);
    Ok(ProfileFit {
        degree,
        unknowns: now.unknowns,
        spread: spread(&solution, variance.sqrt()),
        rms: (now.left / rows).sqrt(),
        condition: solution.condition,
        length: now.length,
        monotone: stations.bends_monotonically(choice.trim),
        stations,
    })
}

pub fn squares(feet: &[Foot]) -> f64 {
    feet.iter().map(|f| f.distance * f.distance).sum()
}

/// Feet of all points, and the arc at the last.
pub fn misfit(curve: &Curve, profile: &Profile) -> (Vec<Foot>, f64) {
    let mut feet: Vec<Foot> = Vec::with_capacity(profile.x.len());
    for (x, y) in profile.x.iter().zip(&profile.deflection) {
        let near = feet.last().map_or(0, |f| f.station);
        feet.push(curve.foot([*x, *y], near));
    }
    let arc = feet.last().map_or(0.0, |f| f.arc);
    (feet, arc)
}

/// Unknowns and length from the angles of chords between points spread over the profile.
fn guess(grid: &Grid, profile: &Profile, terms: usize) -> Result<(Vec<f64>, f64), String> {
    let chords = CHORDS.min(profile.last());
    let knots: Vec<usize> = (0..=chords).map(|c| c * profile.last() / chords).collect();
    let (mut arc, mut rows) = (0.0, Vec::new());
    for pair in knots.windows(2) {
        let d = [
            profile.x[pair[1]] - profile.x[pair[0]],
            profile.deflection[pair[1]] - profile.deflection[pair[0]],
        ];
        let length = d[0].fixed_hypot(d[1]);
        if length > 0.0 {
            rows.push((arc + 0.5 * length, d[1].fixed_atan2(d[0])));
        }
        arc += length;
    }
    let basis = basis(grid, terms);
    let n = grid.at.len() - 1;
    let station = |i: usize| ((rows[i].0 / arc * n as f64).round() as usize).min(n);
    let matrix = DMatrix::from_fn(rows.len(), terms, |i, j| basis.angle[j][station(i)]);
    let right: Vec<f64> = rows.iter().map(|r| r.1).collect();
    Ok((least_squares(&matrix, &right)?.unknowns, arc))
}

/// The curve with its curvature and moment arm.
pub fn stations(grid: &Grid, unknowns: &[f64], length: f64) -> Stations {
    let shape = curve(grid, &basis(grid, unknowns.len()), unknowns, length);
    let x: Vec<f64> = shape.place.iter().map(|p| p[0]).collect();
    let weighted: Vec<f64> = x.iter().map(|x| length * x).collect();
    let first_moment = grid.integral(&weighted);
    let last = grid.at.len() - 1;
    let arc: Vec<f64> = grid.at.iter().map(|t| t * length).collect();
    let arm = |i: usize| first_moment[last] - first_moment[i] - x[i] * (length - arc[i]);
    Stations {
        moment_arm: (0..=last).map(arm).collect(),
        arc,
        x,
        deflection: shape.place.iter().map(|p| p[1]).collect(),
        curvature: shape.curvature,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_foot_of_a_point_is_found_wherever_the_search_begins() {
        let grid = Grid::new();
        let straight = curve(&grid, &basis(&grid, 2), &[0.0; 2], 1.0);
        let stations = grid.at.len() - 1;
        let at = grid.at[stations / 5];
        // Also from where the nearest station is the first or the last of a window.
        for near in 0..=stations {
            let foot = straight.foot([at, 0.01], near);
            assert!((foot.arc - at).abs() < 1e-12, "{near}: {}", foot.arc);
        }
    }
}
