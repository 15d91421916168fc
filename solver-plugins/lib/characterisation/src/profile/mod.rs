//! The profile of a hanging strip: measured points, and clamped fits that give its curvature and the
//! moment arm of its weight along the arc.

mod angle;
mod deflection;
mod grid;
mod hanging;
mod terms;

use crate::linear::bayes_criterion;
use grid::Grid;
pub use hanging::{Hanging, identify};
pub use terms::{Choice, FEWEST_POINTS, Method, Profile, ProfileFit, RIPPLE, Stations};

/// Misfits below this part of the length do not ask for a higher degree.
const FLOOR: f64 = 1e-7;

/// Fits the profile of one strip.
///
/// Without a given degree: of the degrees from the least to `maximum_degree` whose curvature is positive and
/// falls from the clamp to the tip (`trim` left out at both ends; what gravity does to any strip whose
/// moment grows with curvature), the one with the least Bayesian information criterion; if no degree has
/// such a curvature, the one with the least criterion, and `monotone` is false.
///
/// # Errors
/// When there are fewer points than unknowns, the given overhang is shorter than the profile or the fit does
/// not converge.
pub fn fit(profile: &Profile, choice: &Choice) -> Result<ProfileFit, String> {
    let least = match choice.method {
        Method::TangentAngle => angle::LEAST_DEGREE,
        Method::Deflection => deflection::LEAST_DEGREE,
    };
    let points = profile.x.len();
    let (from, to) = match choice.degree {
        Some(d) if d < least => {
            let method = match choice.method {
                Method::TangentAngle => "tangent-angle",
                Method::Deflection => "deflection",
            };
            return Err(format!(
                "a degree of {d} is too low; the least of `fit: {method}` is {least}"
            ));
        }
        Some(d) => (d, d),
        None => (least, choice.maximum_degree.max(least)),
    };
    let grid = Grid::new();
    let mut best: Option<(bool, f64, ProfileFit)> = None;
    let mut failure = String::new();
    let mut start: Option<(Vec<f64>, f64)> = None;
    for degree in least..=to {
        let found = match choice.method {
            Method::TangentAngle => angle::fit(&grid, profile, degree, choice, start.as_ref()),
            Method::Deflection if degree < from => continue,
            Method::Deflection => deflection::fit(&grid, profile, degree, choice),
        };
        let found = match found {
            Ok(found) => found,
            Err(e) => {
                failure = e;
                break;
            }
        };
        start = Some((found.unknowns.clone(), found.length));
        if degree < from {
            continue;
        }
        let criterion = bayes_criterion(
            found.rms,
            FLOOR * found.length,
            points,
            found.unknowns.len(),
        );
        let better = best.as_ref().is_none_or(|(monotone, least, _)| {
            (found.monotone && !monotone) || (found.monotone == *monotone && criterion < *least)
        });
        if better {
            best = Some((found.monotone, criterion, found));
        }
    }
    best.map(|b| b.2).ok_or(failure)
}
