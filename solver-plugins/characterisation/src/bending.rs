//! The revised cantilever test (thesis 3.2.2, eqs 3.2-3.4): the profile of a strip gives moment and curvature at
//! all places along it; the points of all specimens together give the law M(k).

use crate::cantilever::mean_and_deviation;
use crate::profile::{Choice, Profile, ProfileFit, Stations, fit};
use crate::voce::{Saturation, Voce, VoceFit, fit_voce, rms};
use std::ops::Range;

/// Places over the curvature at which the law's error is told: from this part of the largest curvature ..
pub const LEAST_CURVATURE: f64 = 0.05;
/// .. to the largest, at so many places.
const PLACES: usize = 60;

/// What a revised cantilever test tells.
#[derive(Debug, Clone)]
pub struct Bending {
    /// The specimens, in the order given.
    pub specimens: Vec<Specimen>,
    /// The law of all specimens.
    pub voce: VoceFit,
    /// Curvatures (1/m) at which the law's error is told.
    pub curvature: Vec<f64>,
    /// Standard error of the law's moment (N) there, from the scatter of the profiles' points and from the spread
    /// over the specimens.
    pub moment_error: Vec<f64>,
    /// Root mean square of that error over the law's moment.
    pub relative_error: f64,
    /// Standard errors of `linear`, `asymptote` and `scale` over their values; `None` for one that is held by a
    /// bound, where a small change of the data moves nothing.
    pub parameter_error: [Option<f64>; 3],
}

/// One strip.
#[derive(Debug, Clone)]
pub struct Specimen {
    /// The fitted profile.
    pub profile: ProfileFit,
    /// Moment per width (N) at the stations of the profile.
    pub moment: Vec<f64>,
    /// Stations that the law is fitted to.
    pub used: Range<usize>,
}

impl Specimen {
    /// Fits the profile.
    fn new(profile: &Profile, weight: f64, choice: &Choice) -> Result<Self, String> {
        let profile = fit(profile, choice)?;
        let arms = &profile.stations.moment_arm;
        Ok(Self {
            moment: arms.iter().map(|a| weight * a).collect(),
            used: profile.stations.inner(choice.trim),
            profile,
        })
    }

    /// Largest curvature (1/m) and moment (N) that the law is fitted to.
    pub fn largest(&self) -> [f64; 2] {
        [&self.profile.stations.curvature, &self.moment]
            .map(|v| v[self.used.clone()].iter().fold(0.0f64, |m, v| m.max(*v)))
    }
}

/// Curvatures (1/m) and moments (N).
type Points = Vec<[f64; 2]>;

/// Points of a strip that count for the law.
fn points(s: &Stations, weight: f64, trim: f64) -> Points {
    s.inner(trim)
        .map(|i| [s.curvature[i], weight * s.moment_arm[i]])
        // A fit may bend the wrong way near the ends; the law is not defined there.
        .filter(|p| p[0] >= 0.0)
        .collect()
}

/// The law of points of several strips.
fn law<'a>(strips: impl Iterator<Item = &'a Points>) -> Result<VoceFit, String> {
    let (k, m): (Vec<f64>, Vec<f64>) = strips.flatten().map(|[k, m]| (*k, *m)).unzip();
    fit_voce(&k, &m)
}

/// Fits a profile to each specimen, and one law to the points of all; `weight` is per area (N/m2).
///
/// Each strip hangs in a curve of its own, as stiffness and overhang differ; what they share is the law. The
/// moment at an arc length is that of the weight of the part that hangs beyond it, each piece at its own horizontal
/// distance (eq. 3.2). Errors are carried from the scatter of the points through both fits by differences over
/// changes of one standard error; the points' errors are taken as independent. With several specimens the
/// standard error of the mean of their own laws is added.
///
/// # Errors
/// As [`fit`] and [`fit_voce`], with the number of the specimen when there are several.
pub fn characterise(profiles: &[Profile], weight: f64, choice: &Choice) -> Result<Bending, String> {
    let one = |(i, profile): (usize, &Profile)| {
        Specimen::new(profile, weight, choice).map_err(|e| match profiles.len() {
            1 => e,
            n => format!("profile {} of {n}: {e}", i + 1),
        })
    };
    let specimens: Vec<Specimen> = (profiles.iter().enumerate())
        .map(one)
        .collect::<Result<_, _>>()?;
    let measured: Vec<Points> = (specimens.iter())
        .map(|s| points(&s.profile.stations, weight, choice.trim))
        .collect();
    let voce = law(measured.iter())?;
    let largest = specimens.iter().fold(0.0f64, |m, s| m.max(s.largest()[0]));
    let part =
        |i: usize| LEAST_CURVATURE + (1.0 - LEAST_CURVATURE) * i as f64 / (PLACES - 1) as f64;
    let curvature: Vec<f64> = (0..PLACES).map(|i| largest * part(i)).collect();
    let told = |v: &VoceFit| -> Vec<f64> {
        let l = v.law;
        let moments = curvature.iter().map(|k| l.moment(*k));
        moments.chain([l.linear, l.asymptote, l.scale]).collect()
    };
    // Of the moments, then of the three parameters.
    let mut squares = vec![0.0; PLACES + 3];
    for (i, s) in specimens.iter().enumerate() {
        for change in &s.profile.spread {
            let moved = |sign: f64| {
                let unknowns: Vec<f64> = (s.profile.unknowns.iter().zip(change))
                    .map(|(b, c)| b + sign * c)
                    .collect();
                let own = points(&s.profile.stations_of(&unknowns), weight, choice.trim);
                law((measured.iter().enumerate()).map(|(j, p)| if j == i { &own } else { p }))
            };
            let (up, down) = (told(&moved(1.0)?), told(&moved(-1.0)?));
            for (sum, (a, b)) in squares.iter_mut().zip(up.iter().zip(&down)) {
                *sum += (0.5 * (a - b)).powi(2);
            }
        }
    }
    if measured.len() > 1 {
        let own: Vec<Vec<f64>> = (measured.iter())
            .map(|p| Ok(told(&law(std::iter::once(p))?)))
            .collect::<Result<_, String>>()?;
        for (i, sum) in squares.iter_mut().enumerate() {
            let values: Vec<f64> = own.iter().map(|o| o[i]).collect();
            *sum += mean_and_deviation(&values)[1].powi(2) / values.len() as f64;
        }
    }
    let errors: Vec<f64> = squares.iter().map(|s| s.sqrt()).collect();
    let (moment_error, parameters) = errors.split_at(PLACES);
    let relative: Vec<f64> = (curvature.iter().zip(moment_error))
        .map(|(k, e)| e / voce.law.moment(*k))
        .collect();
    Ok(Bending {
        relative_error: rms(&relative),
        parameter_error: over(parameters, &voce),
        moment_error: moment_error.to_vec(),
        specimens,
        voce,
        curvature,
    })
}

/// Errors of the parameters over their values.
fn over(errors: &[f64], voce: &VoceFit) -> [Option<f64>; 3] {
    let Voce {
        linear,
        asymptote,
        scale,
    } = voce.law;
    let free = [
        linear > 0.0,
        asymptote > 0.0,
        voce.saturation == Saturation::Determined,
    ];
    let values = [linear, asymptote, scale];
    std::array::from_fn(|i| free[i].then(|| errors[i] / values[i]))
}
