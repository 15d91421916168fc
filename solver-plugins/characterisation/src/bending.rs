//! The revised cantilever test (thesis 3.2.2, eqs 3.2-3.4): one profile gives moment and curvature at all
//! places along the strip, and so the law M(k).

use crate::profile::{Choice, Profile, ProfileFit, fit};
use crate::voce::{Voce, VoceFit, fit_voce, rms};

/// Places over the curvature at which the law's error is told: from this part of the largest curvature ..
pub const LEAST_CURVATURE: f64 = 0.05;
/// .. to the largest, at so many places.
const PLACES: usize = 60;

/// What a revised cantilever test tells.
#[derive(Debug, Clone)]
pub struct Bending {
    /// The fitted profile.
    pub profile: ProfileFit,
    /// Moment per width (N) at the stations of the profile.
    pub moment: Vec<f64>,
    /// Stations that the law is fitted to.
    pub used: std::ops::Range<usize>,
    /// The law.
    pub voce: VoceFit,
    /// Curvatures (1/m) at which the law's error is told.
    pub curvature: Vec<f64>,
    /// Standard error of the law's moment (N) there, from the scatter of the profile's points.
    pub moment_error: Vec<f64>,
    /// Root mean square of that error over the law's moment.
    pub relative_error: f64,
    /// Standard errors of `linear`, `asymptote` and `scale` over their values.
    pub parameter_error: [f64; 3],
}

/// Fits profile and law; `weight` is per area (N/m2).
///
/// The moment at an arc length is that of the weight of the part that hangs beyond it, each piece at its own
/// horizontal distance (eq. 3.2). Errors are carried from the scatter of the points through both fits by
/// differences over changes of one standard error; the points' errors are taken as independent.
///
/// # Errors
/// As [`fit`] and [`fit_voce`].
pub fn characterise(profiles: &[Profile], weight: f64, choice: &Choice) -> Result<Bending, String> {
    let profile = fit(profiles, choice)?;
    let moment: Vec<f64> = profile
        .stations
        .moment_arm
        .iter()
        .map(|a| weight * a)
        .collect();
    let used = profile.stations.inner(choice.trim);
    let law_of = |unknowns: &[f64]| -> Result<VoceFit, String> {
        let s = profile.stations_of(unknowns);
        let (mut k, mut m) = (Vec::new(), Vec::new());
        for i in s.inner(choice.trim) {
            // A fit may bend the wrong way near the ends; the law is not defined there.
            if s.curvature[i] >= 0.0 {
                k.push(s.curvature[i]);
                m.push(weight * s.moment_arm[i]);
            }
        }
        fit_voce(&k, &m)
    };
    let voce = law_of(&profile.unknowns)?;
    let largest = profile.stations.curvature[used.clone()]
        .iter()
        .fold(0.0f64, |m, k| m.max(*k));
    let part =
        |i: usize| LEAST_CURVATURE + (1.0 - LEAST_CURVATURE) * i as f64 / (PLACES - 1) as f64;
    let curvature: Vec<f64> = (0..PLACES).map(|i| largest * part(i)).collect();
    let (moment_error, parameter_error) = propagate(&profile, &law_of, &curvature, &voce.law)?;
    let relative: Vec<f64> = curvature
        .iter()
        .zip(&moment_error)
        .map(|(k, e)| e / voce.law.moment(*k))
        .collect();
    Ok(Bending {
        relative_error: rms(&relative),
        profile,
        moment,
        used,
        voce,
        curvature,
        moment_error,
        parameter_error,
    })
}

/// Standard errors of the law's moments and of its parameters (relative).
fn propagate(
    profile: &ProfileFit,
    law_of: &impl Fn(&[f64]) -> Result<VoceFit, String>,
    curvature: &[f64],
    law: &Voce,
) -> Result<(Vec<f64>, [f64; 3]), String> {
    let told = |v: &VoceFit| -> Vec<f64> {
        let l = v.law;
        let moments = curvature.iter().map(|k| l.moment(*k));
        moments.chain([l.linear, l.asymptote, l.scale]).collect()
    };
    let mut squares = vec![0.0; curvature.len() + 3];
    for change in &profile.spread {
        let moved = |sign: f64| {
            let unknowns: Vec<f64> = profile
                .unknowns
                .iter()
                .zip(change)
                .map(|(b, c)| b + sign * c)
                .collect();
            law_of(&unknowns)
        };
        let (up, down) = (told(&moved(1.0)?), told(&moved(-1.0)?));
        for (sum, (a, b)) in squares.iter_mut().zip(up.iter().zip(&down)) {
            *sum += (0.5 * (a - b)).powi(2);
        }
    }
    let error = |i: usize| squares[i].sqrt();
    let places = curvature.len();
    let over = |i: usize, value: f64| {
        if value > 0.0 {
            error(places + i) / value
        } else {
            0.0
        }
    };
    let parameters = [
        over(0, law.linear),
        over(1, law.asymptote),
        over(2, law.scale),
    ];
    Ok(((0..places).map(error).collect(), parameters))
}
