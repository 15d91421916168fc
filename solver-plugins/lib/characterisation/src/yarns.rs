//! The yarns' part of the shear law: a polynomial that `material-fabric` takes, or a table where none is.

use crate::confidence::{autocorrelation, of_curve, of_mean, student};
use crate::linear::{Polynomial, Solution, bayes_criterion, fit_polynomial};
use crate::material::significant;
use crate::voce::rms;
use plyflow_fixed::FixedBits;
use plyflow_kernels::fabric::Fabric;
use plyflow_sdk::Material;
use serde_json::json;

/// Highest degree of a shear polynomial that `material-fabric` takes.
pub const MAXIMUM_DEGREE: usize = 9;
/// What `material-fabric` takes as the end of the fitted range (rad).
pub const LIMITS: [f64; 2] = [
    5.0 * std::f64::consts::PI / 180.0,
    80.0 * std::f64::consts::PI / 180.0,
];
/// A test with fewer rows is refused.
pub const FEWEST_ROWS: usize = 20;

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

    /// Slope at no shear (N/m), which is the shear stiffness at rest.
    pub fn stiffness(&self) -> f64 {
        match self {
            Self::Polynomial(p) => p.coefficients.get(1).copied().unwrap_or(0.0),
            Self::Table { angles, forces } => forces[1] / angles[1],
        }
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

/// Shear angles over which the law's error is told: from this part of the largest ..
const LEAST_ANGLE: f64 = 0.05;
/// .. to the largest, at so many places.
const PLACES: usize = 60;
/// What a coefficient costs in Akaike's criterion, and in the weights of degrees that may be right: between Akaike's and the Bayesian one, which takes
/// a law of no polynomial for one of a low degree.
const AKAIKE: f64 = 2.0;
const MODEL: f64 = 3.0;
/// Residuals of which so many say as much as one that is independent of all others are those of a law that does not follow the data.
const SYSTEMATIC: f64 = 1.6;
/// Parts of the range that these are taken over.
const PARTS: usize = 20;
/// Rows that a coefficient needs.
const ROWS_PER_COEFFICIENT: usize = 4;

/// How far a law is uncertain, at a confidence of 95 %.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct YarnsError {
    /// Shear angles (rad), from 5 to 100 % of the largest.
    pub angle: Vec<f64>,
    /// Error of the force there (N/m).
    pub force: Vec<f64>,
    /// Of the root mean square of the force's error over that of the force.
    pub relative: f64,
    /// Of the stiffness at rest (N/m).
    pub stiffness: f64,
}

/// A fit.
#[derive(Debug, Clone, PartialEq)]
pub struct YarnsFit {
    /// Error of the law.
    pub error: YarnsError,
    /// The law.
    pub yarns: Yarns,
    /// Root mean square residual (N/m).
    pub rms: f64,
    /// Condition of the polynomial's fit; of a table's, that of the polynomial it is made of.
    pub condition: f64,
    /// The polynomial with the least criterion, where the material does not take it.
    pub refused: Option<Refused>,
}

/// One test that a law is fitted to.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Points {
    /// Shear angle (rad).
    pub angle: Vec<f64>,
    /// Force (N/m).
    pub force: Vec<f64>,
    /// By what standard error the force (N/m), and the angle (rad), of all of its points may be off, since the zero was found by them.
    pub zero_error: [f64; 2],
}

/// A polynomial that was tried.
struct Tried {
    criterion: f64,
    /// That, without what it counts for the degree.
    misfit: f64,
    degree: usize,
    polynomial: Polynomial,
    solution: Solution,
}

/// Polynomials of all degrees that the points determine, the one with the least criterion first. `degree`: one that is asked for.
fn tried(
    tests: &[Points],
    (angle, force): (&[f64], &[f64]),
    degree: Option<usize>,
) -> Result<Vec<Tried>, String> {
    let floor = 1e-6 * rms(force);
    let most = MAXIMUM_DEGREE.min(angle.len() / ROWS_PER_COEFFICIENT);
    let mut tried = Vec::new();
    for d in (2..=most).chain(degree.filter(|d| !(2..=most).contains(d))) {
        let (polynomial, solution) = match fit_polynomial(angle, force, d) {
            Ok(found) => found,
            Err(_) if degree.is_some_and(|g| g != d) => continue,
            Err(e) => return Err(e),
        };
        let left = rms_within(tests, d).unwrap_or(solution.rms);
        tried.push(Tried {
            criterion: bayes_criterion(left, floor, angle.len(), d),
            misfit: bayes_criterion(left, floor, angle.len(), 0),
            degree: d,
            polynomial,
            solution,
        });
    }
    tried.sort_by(|a, b| a.criterion.total_cmp(&b.criterion));
    Ok(tried)
}

/// Fits the yarns' law to points of shear angle and force of tests that share it.
///
/// Of the degrees that the material takes up to the largest angle, the one with the least Bayesian information
/// criterion; a degree needs four rows for each coefficient. When it takes none of them: a table from the one with the least criterion, its falling parts
/// levelled out.
///
/// # Errors
/// With too few points, or points that do not determine a polynomial.
pub fn fit_yarns(tests: &[Points], degree: Option<usize>) -> Result<YarnsFit, String> {
    let (angle, force) = joined(tests);
    if angle.len() < FEWEST_ROWS {
        return Err(format!(
            "{} points of shear lie in the range of the fit; at least {FEWEST_ROWS} are needed",
            angle.len()
        ));
    }
    let limit = angle.iter().fold(0.0f64, |m, g| m.max(*g));
    let tried = tried(tests, (&angle, &force), degree)?;
    let mut refused: Option<Refused> = None;
    let asked = |t: &&Tried| degree.is_none_or(|d| d == t.degree);
    for t in tried.iter().filter(asked) {
        match accepted(&t.polynomial.coefficients, limit) {
            Ok(()) => {
                let yarns = Yarns::Polynomial(t.polynomial.clone());
                return Ok(YarnsFit {
                    error: uncertain(&yarns, t, &tried, tests),
                    yarns,
                    rms: t.solution.rms,
                    condition: t.solution.condition,
                    refused,
                });
            }
            Err(why) => {
                refused.get_or_insert(Refused {
                    degree: t.degree,
                    rms: t.solution.rms,
                    why,
                    table_differs: None,
                });
            }
        }
    }
    let (Some(best), Some(refused)) = (tried.iter().find(asked), refused) else {
        return Err("no degree was tried".into());
    };
    let (yarns, differs) = rising_table(&best.polynomial, limit)?;
    let rest: Vec<f64> = (angle.iter().zip(&force))
        .map(|(g, f)| f - yarns.value(*g))
        .collect();
    Ok(YarnsFit {
        error: uncertain(&yarns, best, &tried, tests),
        yarns,
        rms: rms(&rest),
        condition: best.solution.condition,
        refused: Some(Refused {
            table_differs: Some(differs),
            ..refused
        }),
    })
}

/// Root mean square of what polynomials of each of several tests leave: how well a degree follows does not hang on how much specimens differ. `None` of one test, or where
/// one of them does not determine its polynomial.
fn rms_within(tests: &[Points], degree: usize) -> Option<f64> {
    let (mut squares, mut rows) = (0.0, 0);
    for t in tests {
        let (_, own) = fit_polynomial(&t.angle, &t.force, degree).ok()?;
        squares += own.rms * own.rms * t.angle.len() as f64;
        rows += t.angle.len();
    }
    (tests.len() > 1).then(|| (squares / rows as f64).sqrt())
}

/// Angles and forces of all tests.
pub fn joined(tests: &[Points]) -> (Vec<f64>, Vec<f64>) {
    let all = tests.iter().flat_map(|t| t.angle.iter().zip(&t.force));
    all.map(|(g, f)| (*g, *f)).unzip()
}

fn less(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// The fit of the degree that Akaike's criterion would take, from that of `best` on: what a degree that is too low leaves is no scatter, so that
/// and its directions are those of this one.
fn wide<'a>(best: &'a Tried, tried: &'a [Tried]) -> &'a Tried {
    let by_akaike = |t: &&Tried| t.misfit + AKAIKE * t.degree as f64;
    (tried.iter().filter(|t| t.degree >= best.degree))
        .min_by(|a, b| by_akaike(a).total_cmp(&by_akaike(b)))
        .unwrap_or(best)
}

/// What is `told` of a law of its own for each specimen, of the degree `best`, and what those of the degree `wide` leave over: specimens that differ are no scatter
/// within one. `None` of one test, or where one of them does not determine its polynomial.
fn by_specimen(
    tests: &[Points],
    [best, wide]: [usize; 2],
    told: &dyn Fn(&Polynomial) -> Vec<f64>,
) -> Option<(Vec<Vec<f64>>, Vec<f64>)> {
    let (mut own, mut within) = (Vec::new(), Vec::new());
    for t in tests {
        if let Ok((p, _)) = fit_polynomial(&t.angle, &t.force, wide) {
            within.extend(t.angle.iter().zip(&t.force).map(|(g, f)| f - p.value(*g)));
        }
        let (p, _) = fit_polynomial(&t.angle, &t.force, best).ok()?;
        own.push(told(&p));
    }
    (tests.len() > 1).then_some((own, within))
}

/// What is `told` of changes by one standard error each, where the forces scatter by `deviation` (N/m). `unit`: the largest angle (rad).
fn of_scatter(
    wide: &Tried,
    (deviation, unit): (f64, f64),
    told: &dyn Fn(&Polynomial) -> Vec<f64>,
) -> Vec<Vec<f64>> {
    let of_powers = |v: &Vec<f64>| -> Vec<f64> {
        let scaled = v.iter().enumerate();
        let c = scaled.map(|(j, c)| deviation * c / unit.powi(j as i32 + 1));
        told(&Polynomial {
            coefficients: std::iter::once(0.0).chain(c).collect(),
        })
    };
    wide.solution.spread.iter().map(of_powers).collect()
}

/// Angles (rad) at which the error is told, as far as all tests reach.
fn places(tests: &[Points]) -> Vec<f64> {
    let largest = |t: &Points| t.angle.iter().fold(0.0f64, |m, g| m.max(*g));
    let limit = tests.iter().map(largest).fold(f64::INFINITY, f64::min);
    let part = |i: usize| LEAST_ANGLE + (1.0 - LEAST_ANGLE) * i as f64 / (PLACES - 1) as f64;
    (0..PLACES).map(|i| limit * part(i)).collect()
}

/// What is `told` of the laws that follow when the zero of a test is moved by its error.
fn zero_moved(
    test: &Points,
    tests: &[Points],
    degree: usize,
    told: &dyn Fn(&Polynomial) -> Vec<f64>,
) -> impl Iterator<Item = Vec<f64>> {
    shifted(test, tests).into_iter().filter_map(move |moved| {
        let (angle, force) = joined(&moved);
        let (p, _) = fit_polynomial(&angle, &force, degree).ok()?;
        Some(told(&p))
    })
}

/// The fits of other degrees than these that may be right, each with the root of its weight.
fn other_degrees<'a>(tried: &'a [Tried], [best, wide]: [&Tried; 2]) -> Vec<(f64, &'a Tried)> {
    let weight = |t: &Tried| {
        let apart = best.misfit - t.misfit + MODEL * (best.degree as f64 - t.degree as f64);
        (0.5 * apart).fixed_exp()
    };
    let sum: f64 = tried.iter().map(weight).sum();
    (tried.iter())
        .filter(|t| t.degree != best.degree && t.degree != wide.degree)
        .filter(|t| weight(t) > 1e-3 * sum)
        .map(|t| ((weight(t) / sum).sqrt(), t))
        .collect()
}

/// The error of a law that comes of the fit `best`.
///
/// What moves it: the scatter of the forces, as far as they are independent of their neighbours; where the zero was found, its error; which degree is
/// right, each of the others by the root of its weight (model averaging, Hoeting et al., Stat. Sci. 14 (1999) 382); what the law
/// leaves of the data where they do not scatter about it; what a table levels; and, with several tests, their spread where that is more.
fn uncertain(yarns: &Yarns, best: &Tried, tried: &[Tried], tests: &[Points]) -> YarnsError {
    let places = places(tests);
    // The forces there, then the stiffness at rest.
    let told = |p: &Polynomial| -> Vec<f64> {
        let forces = places.iter().map(|g| p.value(*g));
        forces.chain([p.coefficients[1]]).collect()
    };
    let law: Vec<f64> = (places.iter().map(|g| yarns.value(*g)))
        .chain([yarns.stiffness()])
        .collect();
    let central = told(&best.polynomial);
    let (angle, force) = joined(tests);
    let unit = angle.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    let rest = |t: &Tried| -> Vec<f64> {
        // In the order of the rows, test by test.
        let all = angle.iter().zip(&force);
        all.map(|(g, f)| f - t.polynomial.value(*g)).collect()
    };
    let wide = wide(best, tried);
    let left = rest(best);
    let (own, within) = by_specimen(tests, [best.degree, wide.degree], &told)
        .unwrap_or_else(|| (Vec::new(), rest(wide)));
    let time = autocorrelation(if own.is_empty() { &left } else { &within });
    let freedom = (left.len() - wide.degree).max(1) as f64;
    let deviation = rms(&within) * (left.len() as f64 / freedom * time).sqrt();
    let mut changes = of_scatter(wide, (deviation, unit), &told);
    for t in tests {
        changes.extend(zero_moved(t, tests, best.degree, &told).map(|p| less(&p, &central)));
    }
    let (mut changes, freedom) = of_mean(
        &own,
        changes,
        (freedom / time).max(1.0) as usize,
        &[1.0; PLACES],
    );
    let others = other_degrees(tried, [best, wide]);
    changes.extend(others.into_iter().map(|(root, t)| {
        let apart = less(&told(&t.polynomial), &central);
        apart.into_iter().map(|c| c * root).collect()
    }));
    if time > SYSTEMATIC {
        changes.push(systematic(&angle, &left, &places));
    }
    if matches!(yarns, Yarns::Table { .. }) {
        changes.push(less(&law, &central));
    }
    let size =
        |i: usize| student(freedom) * changes.iter().map(|c| c[i] * c[i]).sum::<f64>().sqrt();
    let forces: Vec<Vec<f64>> = changes.iter().map(|c| c[..PLACES].to_vec()).collect();
    let root = (PLACES as f64).sqrt() * rms(&law[..PLACES]);
    YarnsError {
        force: (0..PLACES).map(size).collect(),
        relative: of_curve(&forces, freedom) / root,
        stiffness: size(PLACES),
        angle: places,
    }
}

/// What a law leaves along the angle, where neighbours leave alike: means over equal parts of the range, at places; and the slope of that at rest.
fn systematic(angle: &[f64], left: &[f64], places: &[f64]) -> Vec<f64> {
    let limit = angle.iter().fold(0.0f64, |m, g| m.max(*g));
    let mut parts = [[0.0; 3]; PARTS];
    for (g, r) in angle.iter().zip(left) {
        let part = ((g / limit * PARTS as f64).max(0.0) as usize).min(PARTS - 1);
        parts[part][0] += g;
        parts[part][1] += r;
        parts[part][2] += 1.0;
    }
    let means: Vec<[f64; 2]> = (parts.iter())
        .filter(|p| p[2] >= 3.0)
        .map(|p| [p[0] / p[2], p[1] / p[2]])
        .collect();
    let Some(first) = means.first() else {
        return vec![0.0; places.len() + 1];
    };
    let at = |g: &f64| {
        let i = means.partition_point(|m| m[0] < *g);
        let Some((a, b)) = i.checked_sub(1).map(|a| means[a]).zip(means.get(i)) else {
            return means[i.min(means.len() - 1)][1];
        };
        a[1] + (g - a[0]) / (b[0] - a[0]) * (b[1] - a[1])
    };
    let slope = first[1] / first[0].max(f64::MIN_POSITIVE);
    places.iter().map(at).chain([slope]).collect()
}

/// All tests, with one of them moved by the errors of its zero, one after the other.
fn shifted(which: &Points, tests: &[Points]) -> Vec<Vec<Points>> {
    let moved = |k: usize| {
        let of = |t: &Points| {
            let mut t = t.clone();
            let column = if k == 0 { &mut t.force } else { &mut t.angle };
            column.iter_mut().for_each(|v| *v += which.zero_error[k]);
            t
        };
        let all = tests.iter();
        all.map(|t| {
            if std::ptr::eq(t, which) {
                of(t)
            } else {
                t.clone()
            }
        })
        .collect()
    };
    let told = (0..2).filter(|&k| which.zero_error[k] > 0.0);
    told.map(moved).collect()
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

    fn fit(g: &[f64], f: &[f64], degree: Option<usize>) -> Result<YarnsFit, String> {
        let points = Points {
            angle: g.to_vec(),
            force: f.to_vec(),
            ..Points::default()
        };
        fit_yarns(&[points], degree)
    }

    fn points(law: impl Fn(f64) -> f64) -> (Vec<f64>, Vec<f64>) {
        let g: Vec<f64> = (1..=300).map(|i| i as f64 / 300.0).collect();
        let f = g.iter().map(|g| law(*g)).collect();
        (g, f)
    }

    #[test]
    fn a_degree_that_rises_is_preferred_to_one_that_follows_better_and_falls() {
        // A shallow dip between 0.48 and 0.52 rad: degree 3 follows exactly, the material does not take it.
        let (g, f) = points(|g| 100.0 * (g * (0.48 * 0.52) - 0.5 * g * g + g.powi(3) / 3.0));
        let free = fit(&g, &f, None).unwrap();
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
        let fit = fit(&g, &f, Some(9)).unwrap();
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
        assert!(fit(&g, &f, None).unwrap_err().contains("load cell"));
    }
}
