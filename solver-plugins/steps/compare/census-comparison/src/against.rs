//! Runs held against one of them: their distributions as ratios, their sections as distances.

use crate::run::{Field, Run};
use plyflow_model::artifact::CensusCurve;
use plyflow_sdk::{Host, StepError};
use plyflow_surface::weighted_mean;

/// Reports each run's mean deviation and bending moment over the reference's, and how far its sections lie from the
/// reference's.
///
/// # Errors
/// When there is no such run, or a curve cannot be read.
pub fn results(host: &Host, runs: &[Run], reference: &str) -> Result<(), StepError> {
    let Some(first) = runs.iter().find(|r| r.name == reference) else {
        let there: Vec<&str> = runs.iter().map(|r| r.name.as_str()).collect();
        return Err(format!(
            "reference: given step '{reference}'; wired to the step are: {}",
            there.join(", ")
        )
        .into());
    };
    for run in runs.iter().filter(|r| r.name != reference) {
        for (what, of, to) in [
            ("deviation", &run.deviation, &first.deviation),
            ("bending_moment", &run.bending_moment, &first.bending_moment),
        ] {
            if let Some(ratio) = ratio(of.as_ref(), to.as_ref()) {
                host.result(&format!("{what}_ratio.{}", run.name), ratio, "1")?;
            }
        }
        for curve in first.curves.iter().filter(|c| c.plot == "cross_sections") {
            let Some(own) = run.curves.iter().find(|c| c.is(curve)) else {
                continue;
            };
            let (a, b) = (profile(host, first, curve)?, profile(host, run, own)?);
            let section = first.sections.iter().find(|s| s.label == curve.label);
            if let (Some(error), Some(section)) = (relative_distance(&a, &b), section) {
                let name = format!("section_error.{}.{}", run.name, section.result);
                host.result(&name, error, "1")?;
            }
        }
    }
    Ok(())
}

/// Mean of one field over that of another; `None` without both, or when the other is nought.
fn ratio(of: Option<&Field>, to: Option<&Field>) -> Option<f64> {
    let mean = |f: &Field| weighted_mean(&f.values, &f.weights);
    let (of, to) = (mean(of?), mean(to?));
    (to > 0.0).then(|| of / to)
}

/// Distance along the section and height (m), in the order of the distance.
fn profile(host: &Host, run: &Run, curve: &CensusCurve) -> Result<Vec<[f64; 2]>, StepError> {
    let x = host.array_f64(&run.input, &curve.x)?.0;
    let y = host.array_f64(&run.input, &curve.y)?.0;
    Ok(x.into_iter().zip(y).map(|(x, y)| [x, y]).collect())
}

/// Root mean square of the difference of two profiles at the places of the first that the second reaches, over the height
/// of the first from its lowest to its highest place. `None` when they share no place, or the first is level.
pub fn relative_distance(reference: &[[f64; 2]], other: &[[f64; 2]]) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0);
    for [x, y] in reference {
        let k = other.partition_point(|q| q[0] < *x);
        let at = match (k.checked_sub(1).map(|i| other[i]), other.get(k)) {
            (_, Some(q)) if q[0] == *x => q[1],
            (Some(a), Some(b)) => a[1] + (b[1] - a[1]) * (x - a[0]) / (b[0] - a[0]),
            _ => continue,
        };
        sum += (at - y) * (at - y);
        count += 1;
    }
    let heights = || reference.iter().map(|q| q[1]);
    let range =
        heights().fold(f64::NEG_INFINITY, f64::max) - heights().fold(f64::INFINITY, f64::min);
    (count > 0 && range > 0.0).then(|| f64::sqrt(sum / f64::from(count)) / range)
}
