//! Inflated disc: a round film, clamped at its rim, under pressure from below.
//!
//! The pressure rises smoothly to its end value and is held there. A film has a limit point: beyond that
//! pressure there is no equilibrium near by and the disc runs away. The test then stops and says so.

use crate::distortion;
use crate::output::Output;
use crate::reference::{Curve, rising};
use crate::run::{Finished, Test, run, with_threads};
use crate::specimen::{Common, Specimen};
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::model::{Drive, Pressures};
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::artifact::Style;
use plyflow_model::units::Dimension;
use plyflow_sdk::{Host, Step, StepError};
use serde::Deserialize;

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    /// Of the clamped rim (m).
    radius: f64,
    /// At the end of the ramp (Pa).
    pressure: f64,
    /// Of the ramp (s).
    ramp_time: f64,
    /// At the end pressure (s).
    hold_time: f64,
    /// Height of the centre (m) at which the test ends; 1.2 radii when absent.
    #[serde(default)]
    stop_height: Option<f64>,
    /// CSV with columns centre_height, pressure.
    #[serde(default)]
    reference: Option<String>,
}

/// The rim stays where it is.
struct Rim(Vec<Vec3>);

impl Drive for Rim {
    fn position(&self, k: usize, _t: f64) -> Vec3 {
        self.0[k]
    }
}

struct Inflation {
    pressure: f64,
    ramp: f64,
    hold: f64,
    stop_height: f64,
    /// Node in the centre.
    centre: usize,
    /// Height (m), pressure (Pa), steps since the last sample.
    sum: (f64, f64, f64),
    height: Vec<f64>,
    applied: Vec<f64>,
    stretch: f64,
    /// Force of the rim on the film along z (N), mean since the last sample.
    rim: (f64, f64),
    ran_away: bool,
}

impl Inflation {
    fn at(&self, t: f64) -> f64 {
        self.pressure * smooth_step(t, 0.0, self.ramp)
    }
}

impl Test for Inflation {
    fn duration(&self) -> f64 {
        self.ramp + self.hold
    }

    fn apply(&mut self, specimen: &mut Specimen, t: f64) {
        specimen.model.set_pressures(Pressures {
            below: self.at(t),
            ..specimen.model.pressures()
        });
    }

    fn stepped(&mut self, specimen: &Specimen) {
        let height = specimen.model.x()[self.centre][2];
        let pressure = specimen.model.pressures().below;
        let rim: f64 = specimen.model.reactions().iter().map(|r| r[2]).sum();
        self.sum = (self.sum.0 + height, self.sum.1 + pressure, self.sum.2 + 1.0);
        self.rim.0 += rim;
        self.ran_away |= height > self.stop_height;
    }

    fn sample(&mut self, specimen: &Specimen, _t: f64) {
        let (height, pressure, steps) = std::mem::take(&mut self.sum);
        if steps > 1.0 {
            self.height.push(height / steps);
            self.applied.push(pressure / steps);
            self.rim = (0.0, self.rim.0 / steps);
        }
        self.rim.0 = 0.0;
        if let Some(stretch) = specimen.field("principal_stretch") {
            self.stretch = stretch.into_iter().fold(0.0, f64::max);
        }
    }

    fn done(&self) -> bool {
        self.ran_away
    }

    fn phase(&self) -> &'static str {
        "inflating"
    }
}

/// A disc of quads: a square core whose sides are bent outwards, and four blocks from its sides to the rim;
/// the centre is node 0. Edges are near `size` (m).
pub fn disc(radius: f64, size: f64) -> QuadMesh {
    let half = ((0.55 * radius / size).round() as i32).max(1);
    let layers = ((0.43 * radius / size).round() as usize).max(1);
    let QuadMesh {
        mut points,
        mut cells,
    } = core(half, 0.6 * radius);
    let mut ring: Vec<(i32, i32)> = Vec::new();
    ring.extend((-half..half).map(|j| (half, j)));
    ring.extend((-half + 1..=half).rev().map(|i| (i, half)));
    ring.extend((-half + 1..=half).rev().map(|j| (-half, j)));
    ring.extend((-half..half).map(|i| (i, -half)));
    let mut inner: Vec<u32> = ring.iter().map(|(i, j)| number(half, *i, *j)).collect();
    let start: Vec<Vec3> = inner.iter().map(|n| points[*n as usize]).collect();
    for layer in 1..=layers {
        let s = layer as f64 / layers as f64;
        let outer: Vec<u32> = (ring.iter().zip(&start))
            .map(|((i, j), from)| {
                let [x, y] = round(
                    f64::from(*i) / f64::from(half),
                    f64::from(*j) / f64::from(half),
                );
                let to = [radius * x, radius * y];
                points.push([
                    from[0] + s * (to[0] - from[0]),
                    from[1] + s * (to[1] - from[1]),
                    0.0,
                ]);
                points.len() as u32 - 1
            })
            .collect();
        for k in 0..ring.len() {
            let next = (k + 1) % ring.len();
            cells.push([inner[k], outer[k], outer[next], inner[next]]);
        }
        inner = outer;
    }
    QuadMesh { points, cells }
}

/// Number of a node of the core, `half` elements on either side of its centre, which comes first: 0.
fn number(half: i32, i: i32, j: i32) -> u32 {
    let (k, c) = (
        (j + half) * (2 * half + 1) + i + half,
        half * (2 * half + 1) + half,
    );
    match k.cmp(&c) {
        std::cmp::Ordering::Less => k as u32 + 1,
        std::cmp::Ordering::Equal => 0,
        std::cmp::Ordering::Greater => k as u32,
    }
}

/// The core of a disc, `width` (m) to the middles of its sides.
fn core(half: i32, width: f64) -> QuadMesh {
    let side = 2 * half + 1;
    let mut points = vec![[0.0; 3]; (side * side) as usize];
    let mut cells = Vec::new();
    for j in -half..=half {
        for i in -half..=half {
            let (u, v) = (
                f64::from(i) / f64::from(half),
                f64::from(j) / f64::from(half),
            );
            let [x, y] = round(u, v);
            // Between the straight square and the disc.
            let straight = std::f64::consts::FRAC_1_SQRT_2;
            let blend = |square: f64, disc: f64| width * (0.6 * straight * square + 0.4 * disc);
            points[number(half, i, j) as usize] = [blend(u, x), blend(v, y), 0.0];
        }
    }
    for j in -half..half {
        for i in -half..half {
            cells.push([
                number(half, i, j),
                number(half, i + 1, j),
                number(half, i + 1, j + 1),
                number(half, i, j + 1),
            ]);
        }
    }
    QuadMesh { points, cells }
}

/// The concentric map of the square [-1, 1]^2 on the unit disc.
fn round(u: f64, v: f64) -> [f64; 2] {
    let quarter = 0.25 * std::f64::consts::PI;
    if u == 0.0 && v == 0.0 {
        [0.0, 0.0]
    } else if u.abs() >= v.abs() {
        let angle = quarter * v / u;
        [u * angle.fixed_cos(), u * angle.fixed_sin()]
    } else {
        let angle = quarter * u / v;
        [v * angle.fixed_sin(), v * angle.fixed_cos()]
    }
}

/// The step plugin `coupon-inflation`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("inflation/manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        with_threads(host, || test(host, &p))
    }
}

fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    let (x, y) = (
        ("centre_height", Dimension::Length),
        ("pressure", Dimension::Pressure),
    );
    let reference = Curve::given(p.reference.as_ref(), x, y)?;
    if p.common.element_size > 0.5 * p.radius {
        return Err(format!(
            "element_size: given {} m; expected at most half the radius, {} m",
            p.common.element_size,
            0.5 * p.radius
        )
        .into());
    }
    p.common.allow(std::f64::consts::PI * p.radius * p.radius)?;
    let mut mesh = disc(p.radius, p.common.element_size);
    // The height is that of the node in the centre.
    distortion::scatter(&mut mesh, p.common.distortion, |n| n == 0)?;
    let rim: Vec<u32> = (mesh.on_boundary().iter().enumerate())
        .filter(|(_, on)| **on)
        .map(|(n, _)| n as u32)
        .collect();
    let at = rim.iter().map(|n| mesh.points[*n as usize]).collect();
    let mut specimen = Specimen::new(host, &p.common, mesh, [1.0, 0.0, 0.0], Pressed::Below)?;
    specimen.model.set_driven(rim, Box::new(Rim(at)));
    let mut inflation = Inflation {
        pressure: p.pressure,
        ramp: p.ramp_time,
        hold: p.hold_time,
        stop_height: p.stop_height.unwrap_or(1.2 * p.radius),
        centre: 0,
        sum: (0.0, 0.0, 0.0),
        height: Vec::new(),
        applied: Vec::new(),
        stretch: 1.0,
        rim: (0.0, 0.0),
        ran_away: false,
    };
    let outcome = run(host, &p.common, &mut specimen, &mut inflation)?;
    let done = Finished {
        p,
        specimen: &specimen,
        test: &inflation,
        outcome: &outcome,
    };
    write(host, &done, reference.as_ref())
}

fn write(
    host: &Host,
    done: &Finished<'_, Parameters, Inflation>,
    reference: Option<&Curve>,
) -> Result<(), StepError> {
    let (p, test) = (done.p, done.test);
    let mut out = Output::new(host);
    let x = out.curve("run/centre_height", "m", &test.height)?;
    let y = out.curve("run/pressure", "Pa", &test.applied)?;
    let mut theory = None;
    if let Some(curve) = reference {
        let x = out.curve("reference/centre_height", "m", &curve.x)?;
        theory = Some((x, out.curve("reference/pressure", "Pa", &curve.y)?));
        compare(host, test, curve)?;
    }
    let title = "Inflated disc: pressure over the height of its centre";
    let axes = (("height of the centre", "mm"), ("pressure", "kPa"));
    let known = theory.as_ref().map(|(x, y)| (&**x, &**y));
    out.plot("pressure", title, axes.0, axes.1)
        .series("this run", &x, &y, Style::Line)
        .also("membrane theory", known, Style::Dashed)
        .done();
    if test.ran_away {
        out.warn(format!(
            "the disc ran away: its centre passed {:.1} mm at {:.0} Pa of {:.0} Pa. There is no equilibrium \
             above the limit point of the film; take a lower pressure, or a larger stop_height when the \
             disc is still on its way",
            1e3 * test.stop_height,
            test.applied.last().copied().unwrap_or(0.0),
            p.pressure
        ));
    }
    let height = test.height.last().copied().unwrap_or(0.0);
    let pressure = test.applied.last().copied().unwrap_or(0.0);
    host.result("ran_away", f64::from(u8::from(test.ran_away)), "1")?;
    host.result("centre_height", height, "m")?;
    host.result("pressure_end", pressure, "Pa")?;
    host.result("largest_stretch", test.stretch, "1")?;
    // Vertical balance of the film: the rim carries the pressure on the plane disc below the dome.
    let carried = -test.rim.1 / (std::f64::consts::PI * p.radius * p.radius);
    host.result("rim_balance", carried / pressure, "1")?;
    distortion::tell(host, &done.specimen.mesh, p.common.distortion)?;
    out.about.radius = Some(p.radius);
    out.finish(&p.common, done.specimen, done.outcome)
}

/// Errors against the curve of equilibria.
fn compare(host: &Host, test: &Inflation, curve: &Curve) -> Result<(), StepError> {
    let n = curve
        .y
        .windows(2)
        .position(|w| w[1] <= w[0])
        .map_or(curve.y.len(), |i| i + 1);
    host.result("limit_pressure", curve.y[n - 1], "Pa")?;
    if test.ran_away {
        return Ok(());
    }
    // Along the ramp: heights increase there.
    let ramp = test.height.len() as f64 * test.ramp / (test.ramp + test.hold);
    let points = test
        .height
        .iter()
        .copied()
        .zip(test.applied.iter().copied())
        .take(ramp as usize);
    let (heights, pressures) = rising(points);
    let error = curve.relative_rms(&heights, &pressures).ok_or_else(|| {
        "reference: fewer than two points of the run lie in its range of heights".to_owned()
    })?;
    host.result("pressure_error", error, "1")?;
    // The height that the rising part of the curve has at the pressure of the end.
    let rising = Curve {
        x: curve.y[..n].to_vec(),
        y: curve.x[..n].to_vec(),
    };
    let last = |v: &[f64]| v.last().copied().unwrap_or(0.0);
    let expected = rising.at(last(&test.applied));
    let height = last(&test.height);
    host.result("height_error", (height / expected - 1.0).abs(), "1")
}
