//! The yarns' part of the shear law: a polynomial that `material-fabric` takes, or a table where none is.

use crate::linear::{Polynomial, bayes_criterion, fit_polynomial};
use crate::material::significant;
use crate::picture_frame::{FEWEST_ROWS, LIMITS, MAXIMUM_DEGREE};
use crate::voce::rms;
use plyflow_kernels::fabric::Fabric;
use plyflow_sdk::Material;
use serde_json::json;

/// Points of a table after the one at zero shear; `material-fabric` takes 64 in all.
const TABLE_POINTS: usize = 40;
/// Least rise of a table over its whole range, over its largest force: its forces must rise.
const LEAST_RISE: f64 = 1e-3;
/// A polynomial is said to follow the data worse than another when its residual is so many times larger.
pub const MUCH_WORSE: f64 = 1.5;

/// Force (N/m) over the shear angle's size (rad), 0 at 0.
#[derive(Debug, Clone, PartialEq)]
pub enum Yarns {
    /// A polynomial that rises.
    Polynomial(Polynomial),
    /// Points that rise, where no polynomial does.
    Table {
        /// Shear angles (rad), the first 0.
        angles: Vec<f64>,
        /// Forces (N/m), the first 0.
        forces: Vec<f64>,
    },
}

impl Yarns {
    /// Its value; a table's is straight between the points, and level beyond the last.
    pub fn value(&self, g: f64) -> f64 {
        let (angles, forces) = match self {
            Self::Polynomial(p) => return p.value(g),
            Self::Table { angles, forces } => (angles, forces),
        };
        let (last, i) = (angles.len() - 1, angles.partition_point(|a| *a < g));
        if i == 0 || i > last {
            return forces[i.min(last)];
        }
        let part = (g - angles[i - 1]) / (angles[i] - angles[i - 1]);
        forces[i - 1] + part * (forces[i] - forces[i - 1])
    }

    /// Value of the odd extension.
    pub fn odd(&self, g: f64) -> f64 {
        self.value(g.abs()).copysign(g) * f64::from(u8::from(g != 0.0))
    }
}

/// What `material-fabric` did not take of the degrees tried.
#[derive(Debug, Clone, PartialEq)]
pub struct Refused {
    /// Degree of the polynomial that follows the data best.
    pub degree: usize,
    /// Root mean square residual of it (N/m).
    pub rms: f64,
    /// What the material says to it.
    pub why: String,
    /// Angles (rad) between which a table differs from it; `None` when another degree is taken.
    pub table_differs: Option<[f64; 2]>,
}

/// A fit.
#[derive(Debug, Clone, PartialEq)]
pub struct YarnsFit {
    /// The law.
    pub yarns: Yarns,
    /// Root mean square residual (N/m).
    pub rms: f64,
    /// Condition of the polynomial's fit; of a table's, that of the polynomial it is made of.
    pub condition: f64,
    /// The polynomial with the least criterion, where the material does not take it.
    pub refused: Option<Refused>,
}

/// Fits the yarns' law to points of shear angle (rad) and force (N/m).
///
/// Of the degrees that the material takes up to the largest angle, the one with the least Bayesian information
/// criterion. When it takes none of them: a table from the one with the least criterion, its falling parts
/// levelled out.
///
/// # Errors
/// With too few points, or points that do not determine a polynomial.
pub fn fit_yarns(angle: &[f64], force: &[f64], degree: Option<usize>) -> Result<YarnsFit, String> {
    if angle.len() < FEWEST_ROWS {
        return Err(format!(
            "{} points of shear lie in the range of the fit; at least {FEWEST_ROWS} are needed",
            angle.len()
        ));
    }
    let limit = angle.iter().fold(0.0f64, |m, g| m.max(*g));
    let floor = 1e-6 * rms(force);
    let mut tried = Vec::new();
    for d in degree.map_or(2..=MAXIMUM_DEGREE, |d| d..=d) {
        let (polynomial, solution) = fit_polynomial(angle, force, d)?;
        let criterion = bayes_criterion(solution.rms, floor, angle.len(), d);
        tried.push((criterion, d, polynomial, solution));
    }
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut refused: Option<Refused> = None;
    for (_, degree, polynomial, solution) in &tried {
        match accepted(&polynomial.coefficients, limit) {
            Ok(()) => {
                return Ok(YarnsFit {
                    yarns: Yarns::Polynomial(polynomial.clone()),
                    rms: solution.rms,
                    condition: solution.condition,
                    refused,
                });
            }
            Err(why) => {
                refused.get_or_insert(Refused {
                    degree: *degree,
                    rms: solution.rms,
                    why,
                    table_differs: None,
                });
            }
        }
    }
    let (Some((_, _, polynomial, solution)), Some(refused)) = (tried.first(), refused) else {
        return Err("no degree was tried".into());
    };
    let (yarns, differs) = rising_table(polynomial, limit)?;
    let rest: Vec<f64> = (angle.iter().zip(force))
        .map(|(g, f)| f - yarns.value(*g))
        .collect();
    Ok(YarnsFit {
        yarns,
        rms: rms(&rest),
        condition: solution.condition,
        refused: Some(Refused {
            table_differs: Some(differs),
            ..refused
        }),
    })
}

/// Whether `material-fabric` takes coefficients (N/m), as they are written, up to an angle (rad): by its own check. What
/// else a fabric needs stands in for that of the material file.
fn accepted(coefficients: &[f64], limit: f64) -> Result<(), String> {
    let written: Vec<f64> = (coefficients.iter())
        .map(|c| significant(*c).parse().unwrap_or(*c))
        .collect();
    let limit = limit.clamp(LIMITS[0], LIMITS[1]);
    let fabric = json!({
        "fibre_modulus": 1e9, "thickness": 1e-3, "areal_mass": 0.1,
        "shear": {"coefficients": written, "limit": limit},
    });
    Fabric::create(&fabric.to_string()).map(drop)
}

/// Points of a polynomial up to an angle (rad), with means in place of what falls; and the angles between which they
/// differ from it.
fn rising_table(polynomial: &Polynomial, limit: f64) -> Result<(Yarns, [f64; 2]), String> {
    let last = limit.clamp(LIMITS[0], LIMITS[1]);
    let angles: Vec<f64> = (0..=TABLE_POINTS)
        .map(|i| last * i as f64 / TABLE_POINTS as f64)
        .collect();
    let given: Vec<f64> = angles.iter().map(|g| polynomial.value(*g)).collect();
    let largest = given.iter().fold(0.0f64, |m, f| m.max(*f));
    if largest <= 0.0 {
        return Err(
            "the fitted shear force is positive nowhere: is the sign of the load cell that of a pull?"
                .into(),
        );
    }
    // Pooled neighbours that fall: the nearest points that do not (isotonic regression). Sum and number of each pool.
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for f in &given[1..] {
        let mut pool = (f.max(0.0), 1);
        while let Some(before) = pools.last().copied() {
            if before.0 / (before.1 as f64) < pool.0 / pool.1 as f64 {
                break;
            }
            pools.pop();
            pool = (before.0 + pool.0, before.1 + pool.1);
        }
        pools.push(pool);
    }
    let level = pools
        .iter()
        .flat_map(|(sum, n)| std::iter::repeat_n(sum / *n as f64, *n));
    let level: Vec<f64> = std::iter::once(0.0).chain(level).collect();
    let differs: Vec<usize> = (0..=TABLE_POINTS)
        .filter(|&i| (level[i] - given[i]).abs() > 1e-9 * largest)
        .collect();
    let ends = [differs.first(), differs.last()].map(|i| i.map_or(0.0, |i| angles[*i]));
    let rise = |i: usize| LEAST_RISE * largest * i as f64 / TABLE_POINTS as f64;
    let forces = (level.iter().enumerate())
        .map(|(i, f)| f + rise(i))
        .collect();
    Ok((Yarns::Table { angles, forces }, ends))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(law: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
        let g: Vec<f64> = (1..=300).map(|i| i as f64 / 300.0).collect();
        let f = g.iter().map(|g| law(*g)).collect();
        (g, f)
    }

    #[test]
    fn a_degree_that_rises_is_preferred_to_one_that_follows_better_and_falls() {
        // A shallow dip between 0.48 and 0.52 rad: degree 3 follows exactly, the material does not take it.
        let (g, f) = points(|g| 100.0 * (g * (0.48 * 0.52) - 0.5 * g * g + g.powi(3) / 3.0));
        let free = fit_yarns(&g, &f, None).unwrap();
        let Yarns::Polynomial(p) = &free.yarns else {
            panic!("{free:?}")
        };
        assert!(accepted(&p.coefficients, 1.0).is_ok());
        let refused = free.refused.unwrap();
        assert!(
            refused.degree == 3 && refused.why.contains("falls"),
            "{refused:?}"
        );
        assert_eq!(refused.table_differs, None);
    }

    #[test]
    fn where_no_degree_rises_a_table_does_and_the_material_takes_it() {
        // Up to a peak at 0.5 rad, and down to a half.
        let law = |g: f64| {
            if g < 0.5 {
                200.0 * g
            } else {
                150.0 - 100.0 * g
            }
        };
        let (g, f) = points(law);
        let fit = fit_yarns(&g, &f, Some(9)).unwrap();
        let Yarns::Table { angles, forces } = &fit.yarns else {
            panic!("{fit:?}")
        };
        let fabric = json!({
            "fibre_modulus": 1e9, "thickness": 1e-3, "areal_mass": 0.1,
            "shear": {"table": {"angles": angles, "forces": forces}},
        });
        Fabric::create(&fabric.to_string()).map(drop).unwrap();
        let [from, to] = fit.refused.unwrap().table_differs.unwrap();
        assert!(from < 0.5 && from > 0.3 && to > 0.95, "{from} {to}");
        // Before the peak the data are followed, and the mean is that of the data.
        assert!((fit.yarns.value(0.2) / law(0.2) - 1.0).abs() < 0.1);
        let mean = |f: &dyn Fn(f64) -> f64| g.iter().map(|g| f(*g)).sum::<f64>() / 300.0;
        let means = [mean(&|g| fit.yarns.value(g)), mean(&law)];
        assert!((means[0] / means[1] - 1.0).abs() < 0.03, "{means:?}");
        assert_eq!(fit.yarns.odd(-0.3), -fit.yarns.value(0.3));
        assert_eq!(fit.yarns.odd(0.0), 0.0);
    }

    #[test]
    fn a_force_that_is_positive_nowhere_is_refused() {
        let (g, f) = points(|g| -g);
        assert!(fit_yarns(&g, &f, None).unwrap_err().contains("load cell"));
    }
}
