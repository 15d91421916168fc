//! The revised cantilever test (thesis 3.2.2, eqs 3.2-3.4): the profile of a strip gives moment and curvature at
//! all places along it, and a law; the strip that hangs by a law through all points gives the law that is told.

use crate::confidence::{of_curve, of_mean, student};
use crate::profile::{Choice, Hanging, Profile, ProfileFit, Stations, fit, identify};
use crate::voce::{Saturation, Voce, VoceFit, fit_voce, relative_misfit};
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
    /// The law of all specimens; `rms`, `relative_rms` are those of the moments and curvatures along the fitted profiles.
    pub voce: VoceFit,
    /// Curvatures (1/m) at which the law's error is told.
    pub curvature: Vec<f64>,
    /// Error of the law's moment (N) there, at a confidence of 95 %: from the scatter of the profiles' points, or from the spread
    /// over the specimens where that tells more.
    pub moment_error: Vec<f64>,
    /// Of the root mean square of the moment's error over the moment, at 95 %.
    pub relative_error: f64,
    /// Errors of `linear`, `asymptote` and `scale` over their values, at 95 %; `None` for one that is held by a
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
    /// Stations that its first law is fitted to.
    pub used: Range<usize>,
    /// The strip that hangs through its points.
    pub hanging: Hanging,
}

impl Specimen {
    /// Fits the profile, then the strip.
    fn new(measured: &Profile, weight: f64, choice: &Choice) -> Result<Self, String> {
        let profile = fit(measured, choice)?;
        let arms = &profile.stations.moment_arm;
        let moment: Vec<f64> = arms.iter().map(|a| weight * a).collect();
        let used = profile.stations.inner(choice.trim);
        let start = law(std::iter::once(&points(
            &profile.stations,
            &moment,
            used.clone(),
        )))?;
        let hanging = identify(measured, weight, &start, profile.length, choice.overhang)?;
        Ok(Self {
            profile,
            moment,
            used,
            hanging,
        })
    }

    /// Largest curvature (1/m) and moment (N) of its strip: those at the clamp.
    pub fn largest(&self) -> [f64; 2] {
        let k = (self.hanging.curvature.iter()).fold(0.0f64, |m, k| m.max(*k));
        [k, self.hanging.law.moment(k)]
    }

    /// Curvatures and moments along its strip.
    fn along(&self) -> Points {
        let h = &self.hanging;
        h.curvature.iter().map(|k| [*k, h.law.moment(*k)]).collect()
    }

    /// How the law's moments at `curvature`, then its three parameters, change by one standard error in each direction.
    fn changes(&self, curvature: &[f64]) -> Vec<Vec<f64>> {
        let all = |change: &[f64; 3]| -> Vec<f64> {
            let moments = curvature
                .iter()
                .map(|k| self.hanging.law.moment_change(*k, *change));
            moments.chain(*change).collect()
        };
        self.hanging.spread.iter().map(all).collect()
    }
}

/// Curvatures (1/m) and moments (N).
type Points = Vec<[f64; 2]>;

/// Points of a profile's fit that count for its law.
fn points(s: &Stations, moment: &[f64], used: Range<usize>) -> Points {
    used.map(|i| [s.curvature[i], moment[i]])
        // A fit may bend the wrong way near the ends; the law is not defined there.
        .filter(|p| p[0] >= 0.0)
        .collect()
}

/// The law of points of several strips.
fn law<'a>(strips: impl Iterator<Item = &'a Points>) -> Result<VoceFit, String> {
    let (k, m): (Vec<f64>, Vec<f64>) = strips.flatten().map(|[k, m]| (*k, *m)).unzip();
    fit_voce(&k, &m)
}

/// Fits a profile to each specimen, a strip with a law of its own through its points, and one law to those of all; `weight` is per area (N/m2).
///
/// Each strip hangs in a curve of its own, as stiffness and overhang differ; what they share is the law. The
/// moment at an arc length is that of the weight of the part that hangs beyond it, each piece at its own horizontal
/// distance (eq. 3.2). The polynomial gives moments and curvatures that know of no law, and the first guess of one; the law that is told is that
/// of the strips that hang through the points ([`identify`]).
///
/// # Errors
/// As [`fit`], [`fit_voce`] and [`identify`], with the number of the specimen when there are several.
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
    let mut voce = common(&specimens)?;
    let measured: Vec<Points> = (specimens.iter())
        .map(|s| points(&s.profile.stations, &s.moment, s.used.clone()))
        .collect();
    [voce.rms, voce.relative_rms] = relative_misfit(&voce.law, measured.iter().flatten());
    let largest = specimens.iter().fold(0.0f64, |m, s| m.max(s.largest()[0]));
    let part =
        |i: usize| LEAST_CURVATURE + (1.0 - LEAST_CURVATURE) * i as f64 / (PLACES - 1) as f64;
    let curvature: Vec<f64> = (0..PLACES).map(|i| largest * part(i)).collect();
    let (changes, freedom) = uncertain(&specimens, &curvature);
    let size = |i: usize| changes.iter().map(|c| c[i] * c[i]).sum::<f64>().sqrt();
    let errors: Vec<f64> = (0..PLACES + 3)
        .map(|i| student(freedom) * size(i))
        .collect();
    let (moment_error, parameters) = errors.split_at(PLACES);
    let relative: Vec<Vec<f64>> = (changes.iter())
        .map(|c| {
            let root = (PLACES as f64).sqrt();
            (curvature.iter().zip(c))
                .map(|(k, c)| c / (voce.law.moment(*k) * root))
                .collect()
        })
        .collect();
    Ok(Bending {
        relative_error: of_curve(&relative, freedom),
        parameter_error: over(parameters, &voce, &specimens),
        moment_error: moment_error.to_vec(),
        specimens,
        voce,
        curvature,
    })
}

/// Strips count alike where the least bent reaches this part of the largest curvature; else each counts as far as it is bent.
const ALIKE: f64 = 0.5;
/// Curvatures at which the mean of the strips' laws is taken.
const MEANS: usize = 200;

/// The law of all specimens: of one its own; of several that of the mean of their moments, or, where some are bent much less than others, that of the
/// points along their strips.
fn common(specimens: &[Specimen]) -> Result<VoceFit, String> {
    let reach = |s: &Specimen| s.largest()[0];
    let most = specimens.iter().map(reach).fold(0.0, f64::max);
    let least = specimens.iter().map(reach).fold(f64::INFINITY, f64::min);
    let pooled = if least >= ALIKE * most {
        let at = |i: usize| {
            let k = most * i as f64 / MEANS as f64;
            let moments = specimens.iter().map(|s| s.hanging.law.moment(k));
            [k, moments.sum::<f64>() / specimens.len() as f64]
        };
        law(std::iter::once(&(0..=MEANS).map(at).collect()))?
    } else {
        let along: Vec<Points> = specimens.iter().map(Specimen::along).collect();
        law(along.iter())?
    };
    let [only] = specimens else {
        return Ok(pooled);
    };
    let law = only.hanging.law;
    Ok(VoceFit {
        law,
        saturation: match (only.hanging.free, pooled.saturation) {
            ([_, true, true], _) => Saturation::Determined,
            (_, Saturation::Determined) => Saturation::NotReached,
            (_, told) => told,
        },
        ..pooled
    })
}

/// Independent changes of the law's moments and parameters, each one standard error large, and the degrees of freedom that they are told with.
///
/// The law of several strips is taken for the mean of their own.
fn uncertain(specimens: &[Specimen], curvature: &[f64]) -> (Vec<Vec<f64>>, usize) {
    let n = specimens.len();
    let scaled = |v: Vec<f64>, by: f64| -> Vec<f64> { v.iter().map(|c| c * by).collect() };
    let noise: Vec<Vec<f64>> = (specimens.iter())
        .flat_map(|s| s.changes(curvature))
        .map(|c| scaled(c, 1.0 / n as f64))
        .collect();
    let freedom: usize = specimens.iter().map(|s| s.hanging.freedom).sum();
    let own: Vec<Vec<f64>> = (specimens.iter())
        .map(|s| {
            let l = s.hanging.law;
            let moments = curvature.iter().map(|k| l.moment(*k));
            moments.chain([l.linear, l.asymptote, l.scale]).collect()
        })
        .collect();
    // Each moment by its own size, as it is told.
    let count = own.len() as f64;
    let mean = |i: usize| own.iter().map(|o| o[i]).sum::<f64>() / count;
    let sizes: Vec<f64> = (0..curvature.len()).map(mean).collect();
    of_mean(&own, noise, freedom, &sizes)
}

/// Errors of the parameters over their values.
fn over(errors: &[f64], voce: &VoceFit, specimens: &[Specimen]) -> [Option<f64>; 3] {
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
    std::array::from_fn(|i| {
        let all = free[i] && specimens.iter().all(|s| s.hanging.free[i]);
        all.then(|| errors[i] / values[i])
    })
}
