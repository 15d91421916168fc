//! Buckling: a strip between two clamps that come together, free or on springs.
//!
//! Alone it is Euler's column and, further on, the elastica ([`elastica`]). On springs that hold every place of it to its plane with a
//! stiffness k per area (Winkler's foundation) it buckles into waves of length `2 pi (B / k)^(1/4)` under a load per width of `2 sqrt(B k)`
//! (Hetenyi, Beams on Elastic Foundation, section 40), whatever its length: the model of a ply that wrinkles between others.
//!
//! A weak pressure puts the strip off its plane: even on a free strip, uneven on springs, with a sum of waves of every length down
//! to the elements'. It fades in, and out again while the shortening goes from 1 to 2 %.
//!
//! Every node stays in its plane across the strip: closed forms are plane, and a strip that twists as easily as a fabric's sways to a side
//! and folds there when it stands high.
//!
//! Load per width: the mean over the steps between two samples of the clamps' reactions along the strip.

pub mod elastica;

use crate::drives::Ends;
use crate::output::Output;
use crate::run::{Outcome, Test, run, with_threads};
use crate::specimen::{Common, Specimen};
use crate::strip::{self, CLAMPED, Grid, axis_of_family, check_family, fibre_strain, rows};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::model::{Fixed, NodalLoad};
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::artifact::Style;
use plyflow_sdk::{Host, Step, StepError};
use serde::Deserialize;
use std::f64::consts::{PI, TAU};

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    /// Length between the clamps (m).
    length: f64,
    /// Width (m).
    width: f64,
    /// Fibre family along the strip: 1 or 2.
    family: u32,
    /// End shortening at the end, over the length.
    shortening: f64,
    /// Time in which the clamps come together (s).
    time: f64,
    /// Time at rest after it (s).
    settling_time: f64,
    /// Modulus of elastic layers that hold the strip to its plane (Pa).
    #[serde(default)]
    foundation_modulus: Option<f64>,
    /// Their thickness (m).
    foundation_thickness: f64,
    /// Pressure that puts the strip off its plane (Pa).
    disturbance: f64,
    /// Bending stiffness per width at rest (N m) that the closed forms are to have.
    #[serde(default)]
    stiffness: Option<f64>,
}

impl Parameters {
    /// Stiffness of the springs per area (N/m3); none: a free strip.
    fn foundation(&self) -> Option<f64> {
        (self.foundation_modulus).map(|modulus| modulus / self.foundation_thickness)
    }
}

/// What was measured at a sample.
#[derive(Debug, Clone, Copy, Default)]
struct Sample {
    /// End shortening over the length.
    shortening: f64,
    /// Load per width (N/m).
    load: f64,
    /// Largest distance from the plane (m).
    amplitude: f64,
}

struct Buckling<'a> {
    p: &'a Parameters,
    grid: Grid,
    /// Waves of the disturbance by column, of root mean square 1.
    waves: Vec<f64>,
    /// Tributary areas of the nodes (m2); empty until the first step.
    areas: Vec<f64>,
    /// Sums over the steps since the last sample: load per width, shortening, number.
    sum: [f64; 3],
    samples: Vec<Sample>,
    /// Profile (z, by column) of the middle row at the largest load so far.
    at_peak: Vec<f64>,
    peak: f64,
    fibre_strain: f64,
}

/// Waves of a disturbance by column: even on a free strip; on springs the sum of standing waves of every length down to four
/// elements, with phases that do not repeat (multiples of the golden ratio), so that no mode is left out and none preferred.
fn waves(p: &Parameters, xs: &[f64]) -> Vec<f64> {
    if p.foundation().is_none() {
        return vec![1.0; xs.len()];
    }
    let most = (0.5 * p.length / p.common.element_size).clamp(4.0, 256.0) as usize;
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let scale = (2.0 / most as f64).sqrt();
    let at = |x: &f64| {
        let wave = |m: usize| {
            let phase = TAU * (golden * m as f64).fract();
            (PI * m as f64 * x / p.length + phase).fixed_cos()
        };
        scale * (1..=most).map(wave).sum::<f64>()
    };
    xs.iter().map(at).collect()
}

impl Buckling<'_> {
    fn middle(&self, specimen: &Specimen) -> Vec<Vec3> {
        let row = self.grid.ys.len() / 2;
        let node = |i| self.grid.node(i, row) as usize;
        (0..self.grid.xs.len())
            .map(|i| specimen.model.x()[node(i)])
            .collect()
    }
}

impl Test for Buckling<'_> {
    fn duration(&self) -> f64 {
        self.p.time + self.p.settling_time
    }

    fn apply(&mut self, specimen: &mut Specimen, t: f64) {
        let model = &mut specimen.model;
        if self.areas.is_empty() {
            let per_area = self.p.common.areal_mass();
            self.areas = model.own_masses().iter().map(|m| m / per_area).collect();
        }
        let springs = self.p.foundation().unwrap_or(0.0);
        let shortening = self.p.shortening * smooth_step(t, 0.0, self.p.time);
        let left = smooth_step(t, 0.0, 0.05 * self.p.time) - smooth_step(shortening, 0.01, 0.01);
        let pressure = self.p.disturbance * left.max(0.0);
        // Springs are loads that are set anew before each step; they are far softer than what bounds the step.
        let load = |(n, x): (usize, &Vec3)| {
            let wave = self.waves[self.grid.place(n as u32).0];
            let force = self.areas[n] * (pressure * wave - springs * x[2]);
            NodalLoad {
                node: n as u32,
                force: [0.0, 0.0, force],
                moment: [0.0; 3],
            }
        };
        let loads = model.x().iter().enumerate().map(load).collect();
        model.set_loads(loads);
    }

    fn stepped(&mut self, specimen: &Specimen) {
        // Reactions belong to the positions before the step.
        let model = &specimen.model;
        let t = model.time() - model.dt();
        let half = model.reactions().len() / 2;
        let (left, right) = model.reactions().split_at(half);
        let along = |r: &[Vec3]| r.iter().map(|r| r[0]).sum::<f64>();
        self.sum[0] += 0.5 * (along(left) - along(right)) / self.p.width;
        self.sum[1] += self.p.shortening * smooth_step(t, 0.0, self.p.time);
        self.sum[2] += 1.0;
    }

    fn sample(&mut self, specimen: &Specimen, _t: f64) {
        self.fibre_strain = self.fibre_strain.max(fibre_strain(specimen));
        let [load, shortening, n] = std::mem::take(&mut self.sum);
        // The first sample's sum holds a single step from rest.
        if n < 2.0 {
            return;
        }
        let profile: Vec<f64> = self.middle(specimen).iter().map(|x| x[2]).collect();
        self.samples.push(Sample {
            shortening: shortening / n,
            load: load / n,
            amplitude: profile.iter().map(|z| z.abs()).fold(0.0, f64::max),
        });
        if load / n > self.peak {
            self.peak = load / n;
            self.at_peak = profile;
        }
    }

    fn done(&self) -> bool {
        // On springs the load falls once it buckles: what comes after is a place that folds, not the waves.
        self.p.foundation().is_some()
            && (self.samples.last()).is_some_and(|s| s.load < 0.8 * self.peak)
    }

    fn phase(&self) -> &'static str {
        "buckling"
    }
}

/// The step plugin `coupon-buckling`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("buckling/manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        with_threads(host, || test(host, &p))
    }
}

/// Columns and rows: [`CLAMPED`] columns at each end, the clamp lines at half the length to both sides of x = 0.
fn grid(p: &Parameters, rotates: bool) -> Grid {
    let size = p.common.element_size;
    // An even number: a column of nodes lies in the middle, where the amplitude is.
    let elements = 2 * (0.5 * p.length / size).round().max(2.0) as usize;
    let h = p.length / elements as f64;
    // Where the element holds a slope only between two columns, one of them lies inside of the clamp line, half an element off: the
    // columns are moved so far, and there is one more.
    let (columns, line) = if rotates {
        (elements + 2 * CLAMPED - 1, (CLAMPED - 1) as f64)
    } else {
        (elements + 2 * CLAMPED - 2, CLAMPED as f64 - 1.5)
    };
    Grid {
        xs: (0..columns)
            .map(|i| h * (i as f64 - line - 0.5 * elements as f64))
            .collect(),
        ys: rows(p.width, size),
    }
}

fn check(p: &Parameters) -> Result<(), StepError> {
    check_family(p.family)?;
    if p.shortening > 0.7 {
        return Err(format!(
            "shortening: given {:.3} of the length; beyond 0.7 the strip would touch itself, which this test does not see. Expected less",
            p.shortening
        )
        .into());
    }
    if p.length < 8.0 * p.common.element_size {
        return Err(format!(
            "element_size: given {:.3} mm, of which {:.1} fit into the length; expected at least 8",
            1e3 * p.common.element_size,
            p.length / p.common.element_size
        )
        .into());
    }
    Ok(())
}

fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    check(p)?;
    p.common.allow(p.length * p.width)?;
    let grid = grid(p, strip::rotates(host, &p.common)?);
    let axis = axis_of_family(p.family);
    let mut specimen = Specimen::new(host, &p.common, grid.mesh(), axis, Pressed::No)?;
    let columns = grid.xs.len();
    let mut driven = grid.columns(0..CLAMPED);
    driven.extend(grid.columns(columns - CLAMPED..columns));
    let clamps = Ends {
        places: (driven.iter())
            .map(|n| specimen.mesh.points[*n as usize])
            .collect(),
        middle: 0.0,
        way: -p.shortening * p.length,
        time: p.time,
        clamped: true,
    };
    specimen.model.set_driven(driven, Box::new(clamps));
    let plane = Fixed {
        translations: [false, true, false],
        rotations: [true, false, true],
    };
    for n in 0..specimen.mesh.points.len() as u32 {
        specimen.model.fix(n, plane);
    }
    let mut test = Buckling {
        p,
        waves: waves(p, &grid.xs),
        grid,
        areas: Vec::new(),
        sum: [0.0; 3],
        samples: Vec::new(),
        at_peak: Vec::new(),
        peak: 0.0,
        fibre_strain: 0.0,
    };
    let outcome = run(host, &p.common, &mut specimen, &mut test)?;
    write(host, &specimen, &test, &outcome)
}

/// Euler's load per width (N/m): the mean of the loads from 2.5 to 5 % of end shortening, where the disturbance is gone, each over what the
/// elastica's load has risen by (1.3 to 2.6 %).
fn critical_load(samples: &[Sample]) -> Option<f64> {
    let early: Vec<f64> = (samples.iter())
        .filter(|s| (0.025..=0.05).contains(&s.shortening))
        .map(|s| s.load / elastica::at(s.shortening).load)
        .collect();
    (!early.is_empty()).then(|| early.iter().sum::<f64>() / early.len() as f64)
}

/// Wave length (m) of a profile in the inner half of the strip: twice the mean distance of the places where it changes sides; none
/// with fewer than three such places.
fn wavelength(xs: &[f64], z: &[f64], length: f64) -> Option<f64> {
    let mut crossings = Vec::new();
    for i in 1..xs.len() {
        let (a, b) = (z[i - 1], z[i]);
        if a * b < 0.0 && xs[i].abs() < 0.25 * length {
            crossings.push(xs[i - 1] + (xs[i] - xs[i - 1]) * a / (a - b));
        }
    }
    let n = crossings.len();
    (n >= 3).then(|| 2.0 * (crossings[n - 1] - crossings[0]) / (n - 1) as f64)
}

fn write(
    host: &Host,
    specimen: &Specimen,
    test: &Buckling<'_>,
    outcome: &Outcome,
) -> Result<(), StepError> {
    let p = test.p;
    let mut out = Output::new(host);
    let column = |f: fn(&Sample) -> f64| test.samples.iter().map(f).collect::<Vec<_>>();
    let shortening = out.curve("run/shortening", "1", &column(|s| s.shortening))?;
    let load = out.curve("run/load", "N/m", &column(|s| s.load))?;
    let amplitude = out.curve("run/amplitude", "m", &column(|s| s.amplitude))?;
    let (x, z): (Vec<f64>, Vec<f64>) = (test.middle(specimen).iter().map(|x| (x[0], x[2]))).unzip();
    let x = out.curve("profile/x", "m", &x)?;
    let z = out.curve("profile/z", "m", &z)?;
    let form = (p.stiffness.filter(|_| p.foundation().is_none())).map(|b| Elastica::of(b, p));
    let closed = (form.as_ref())
        .map(|form| form.curves(&mut out, p))
        .transpose()?;
    let closed = closed.as_ref();
    let axis = ("end shortening over length", "1");
    let label = "load per width over end shortening";
    out.plot("load", label, axis, ("load per width", "N/mm"))
        .series("this run", &shortening, &load, Style::Line)
        .also("elastica", closed.map(|c| (&*c.0, &*c.1)), Style::Dashed)
        .done();
    let label = "amplitude over end shortening";
    out.plot("amplitude", label, axis, ("amplitude", "mm"))
        .series("this run", &shortening, &amplitude, Style::Line)
        .also("elastica", closed.map(|c| (&*c.0, &*c.2)), Style::Dashed)
        .done();
    out.plot(
        "profile",
        "middle line at the end",
        ("x", "mm"),
        ("z", "mm"),
    )
    .series("this run", &x, &z, Style::Line)
    .done();
    results(host, test, form.as_ref())?;
    out.about.length = Some(p.length);
    out.about.width = Some(p.width);
    out.about.family = Some(p.family);
    out.finish(&p.common, specimen, outcome)
}

/// The free strip's closed form.
struct Elastica {
    /// Euler's load per width between clamps (N/m).
    euler: f64,
}

impl Elastica {
    fn of(stiffness: f64, p: &Parameters) -> Self {
        let wave = TAU / p.length;
        Self {
            euler: stiffness * wave * wave,
        }
    }

    /// Writes its curves: paths of shortening, load and amplitude.
    fn curves(
        &self,
        out: &mut Output<'_>,
        p: &Parameters,
    ) -> Result<(String, String, String), StepError> {
        let at: Vec<f64> = (0..=200)
            .map(|i| p.shortening * f64::from(i) / 200.0)
            .collect();
        let states: Vec<elastica::State> = at.iter().map(|s| elastica::at(*s)).collect();
        let loads: Vec<f64> = states.iter().map(|s| s.load * self.euler).collect();
        let heights: Vec<f64> = states.iter().map(|s| s.amplitude * p.length).collect();
        Ok((
            out.curve("elastica/shortening", "1", &at)?,
            out.curve("elastica/load", "N/m", &loads)?,
            out.curve("elastica/amplitude", "m", &heights)?,
        ))
    }
}

fn results(host: &Host, test: &Buckling<'_>, form: Option<&Elastica>) -> Result<(), StepError> {
    let p = test.p;
    let last = (test.samples.last()).ok_or("time: no sample was taken; expected a longer time")?;
    host.result("load_largest", test.peak, "N/m")?;
    host.result("load_at_end", last.load, "N/m")?;
    host.result("amplitude_at_end", last.amplitude, "m")?;
    host.result("fibre_strain_largest", test.fibre_strain, "1")?;
    if let Some(springs) = p.foundation() {
        let missing = "shortening: the strip did not buckle into waves that can be counted; expected more shortening or a longer strip";
        // A strip that has not buckled still carries its largest load, and what waves it shows are the disturbance's.
        if last.load > 0.995 * test.peak {
            return Err(missing.into());
        }
        let waves = wavelength(&test.grid.xs, &test.at_peak, p.length).ok_or(missing)?;
        host.result("wavelength", waves, "m")?;
        if let Some(b) = p.stiffness {
            let load = 2.0 * (b * springs).sqrt();
            let length = TAU * (b / springs).sqrt().sqrt();
            host.result("critical_load_error", (test.peak / load - 1.0).abs(), "1")?;
            host.result("wavelength_error", (waves / length - 1.0).abs(), "1")?;
        }
        return Ok(());
    }
    let critical = critical_load(&test.samples);
    if let Some(load) = critical {
        host.result("critical_load", load, "N/m")?;
    }
    let Some(form) = form else { return Ok(()) };
    if let Some(load) = critical {
        host.result("critical_load_error", (load / form.euler - 1.0).abs(), "1")?;
    }
    host.result("load_ratio_at_end", last.load / form.euler, "1")?;
    host.result("amplitude_ratio_at_end", last.amplitude / p.length, "1")?;
    let off = |s: &Sample| {
        let state = elastica::at(s.shortening);
        let load = s.load / (state.load * form.euler) - 1.0;
        let amplitude = s.amplitude / (state.amplitude * p.length) - 1.0;
        [load.abs(), amplitude.abs()]
    };
    let [load, amplitude] = off(last);
    host.result("load_error_at_end", load, "1")?;
    host.result("amplitude_error_at_end", amplitude, "1")?;
    // Where the disturbance counted the strip is not yet an elastica.
    let (mut load, mut amplitude) = (0.0, 0.0);
    for [l, a] in test
        .samples
        .iter()
        .filter(|s| s.shortening >= 0.02)
        .map(off)
    {
        (load, amplitude) = (f64::max(load, l), f64::max(amplitude, a));
    }
    host.result("load_error", load, "1")?;
    host.result("amplitude_error", amplitude, "1")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_has_its_length() {
        let xs: Vec<f64> = (0..=400).map(|i| 0.001 * f64::from(i) - 0.2).collect();
        let z: Vec<f64> = xs.iter().map(|x| (TAU * x / 0.03 + 0.4).sin()).collect();
        let length = wavelength(&xs, &z, 0.4).unwrap();
        assert!((length - 0.03).abs() < 1e-5, "{length}");
        assert!(wavelength(&xs, &vec![1.0; xs.len()], 0.4).is_none());
    }

    #[test]
    fn the_load_of_euler_is_what_the_elastica_begins_with() {
        let sample = |i: u32| {
            let shortening = 0.001 * f64::from(i);
            Sample {
                shortening,
                load: 5.0 * elastica::at(shortening).load,
                amplitude: 0.0,
            }
        };
        let load = critical_load(&(0..100).map(sample).collect::<Vec<_>>()).unwrap();
        assert!((load - 5.0).abs() < 1e-9, "{load}");
        assert!(critical_load(&[sample(10)]).is_none());
    }
}
