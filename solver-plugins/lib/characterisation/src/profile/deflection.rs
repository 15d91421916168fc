//! A clamped polynomial y(x): `y = xi^2 sum c_j P_j(2 xi - 1)`, `xi = x / reach`.

use super::grid::{Grid, legendre};
use super::terms::{Choice, Profile, ProfileFit, Stations, overhang_reaches, spread};
use crate::linear::least_squares;
use nalgebra::DMatrix;
use plyflow_fixed::FixedBits;

pub const LEAST_DEGREE: usize = 3;

pub fn fit(
    grid: &Grid,
    profile: &Profile,
    degree: usize,
    choice: &Choice,
) -> Result<ProfileFit, String> {
    let reach = profile.x.iter().fold(0.0f64, |m, x| m.max(*x));
    if reach <= 0.0 {
        return Err("no point of the profile lies outside the clamp".into());
    }
    let terms = degree - 1;
    let points: Vec<[f64; 2]> = (profile.x.iter().zip(&profile.deflection))
        .map(|(x, y)| [x / reach, *y])
        .collect();
    let matrix = DMatrix::from_fn(points.len(), terms, |i, j| {
        let t = points[i][0];
        t * t * legendre(j, t)[0]
    });
    let right: Vec<f64> = points.iter().map(|p| p[1]).collect();
    let solution = least_squares(&matrix, &right)?;
    let curve = stations(grid, &solution.unknowns, reach, None);
    let arc = curve.arc[curve.arc.len() - 1];
    if let Some(overhang) = choice.overhang {
        overhang_reaches(overhang, arc)?;
    }
    let length = choice.overhang.map_or(arc, |o| o.max(arc));
    let curve = stations(grid, &solution.unknowns, reach, Some(length));
    // Vertical misfits seen normal to the curve, so that both methods report the same thing.
    let mut squares = 0.0;
    for [t, y] in &points {
        let (value, slope) = value_and_slope(&solution.unknowns, *t);
        squares += (y - value).powi(2) / (1.0 + (slope / reach).powi(2));
    }
    let n = points.len() as f64;
    let variance = solution.rms.powi(2) * n / (n - terms as f64).max(1.0);
    Ok(ProfileFit {
        degree,
        spread: spread(&solution, variance.sqrt()),
        unknowns: solution.unknowns,
        rms: (squares / n).sqrt(),
        condition: solution.condition,
        length,
        monotone: curve.bends_monotonically(choice.trim),
        stations: curve,
    })
}

fn value_and_slope(unknowns: &[f64], t: f64) -> (f64, f64) {
    let mut sums = (0.0, 0.0);
    for (j, c) in unknowns.iter().enumerate() {
        let [p, d, _] = legendre(j, t);
        sums.0 += c * t * t * p;
        sums.1 += c * (2.0 * t * p + t * t * d);
    }
    sums
}

/// Curvature `y'' / (1 + y'^2)^(3/2)` (thesis eq. 3.3) and moment arm by integration along the arc; what is
/// longer than the arc goes on straight.
pub fn stations(grid: &Grid, unknowns: &[f64], reach: f64, length: Option<f64>) -> Stations {
    let mut slope = Vec::new();
    let mut out = Stations::default();
    for &t in &grid.at {
        let (y, d) = value_and_slope(unknowns, t);
        let mut second = 0.0;
        for (j, c) in unknowns.iter().enumerate() {
            let [p, d, dd] = legendre(j, t);
            second += c * (2.0 * p + 4.0 * t * d + t * t * dd);
        }
        let (d, second) = (d / reach, second / (reach * reach));
        slope.push(d);
        out.x.push(t * reach);
        out.deflection.push(y);
        out.curvature.push(second / (1.0 + d * d).fixed_powf(1.5));
    }
    let stretch: Vec<f64> = slope.iter().map(|d| reach * (1.0 + d * d).sqrt()).collect();
    out.arc = grid.integral(&stretch);
    let weighted: Vec<f64> = stretch.iter().zip(&out.x).map(|(s, x)| s * x).collect();
    let first_moment = grid.integral(&weighted);
    let last = grid.at.len() - 1;
    let rest = length.map_or(0.0, |l| (l - out.arc[last]).max(0.0));
    let centre = out.x[last] + 0.5 * rest / (1.0 + slope[last] * slope[last]).sqrt();
    for i in 0..=last {
        let near = first_moment[last] - first_moment[i] - out.x[i] * (out.arc[last] - out.arc[i]);
        out.moment_arm.push(near + rest * (centre - out.x[i]));
    }
    out
}
