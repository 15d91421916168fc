//! Tension tests of films: uniaxial, equibiaxial, planar.
//!
//! - `uniaxial`: a strip whose ends are gripped and pulled apart along x; its sides are free. Strain is that of
//!   the middle half, where the grips are not felt.
//! - `equibiaxial`: a rectangle whose four edges move apart alike in x and y.
//! - `planar`: a rectangle pulled along x whose other edges keep their distance (pure shear).
//!
//! Nominal stress is the mean force of both ends over the undeformed section.

use crate::output::Output;
use crate::reference::Curve;
use crate::run::{Finished, Test, run, with_threads};
use crate::specimen::{Common, Specimen};
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::smooth_step;
use plyflow_mechanics::mesh::{QuadMesh, even_axis};
use plyflow_mechanics::model::Drive;
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::artifact::Style;
use plyflow_model::units::Dimension;
use plyflow_sdk::{Host, Step, StepError};
use serde::Deserialize;

/// How the film is pulled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// A strip with free sides.
    Uniaxial,
    /// The same stretch in both directions.
    Equibiaxial,
    /// Stretched in one direction, held in the other.
    Planar,
}

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    mode: Mode,
    /// Along x (m).
    length: f64,
    /// Along y (m).
    width: f64,
    /// Largest nominal strain.
    strain: f64,
    /// Time of the pull (s).
    time: f64,
    /// CSV with columns nominal_strain, nominal_stress: what the law says.
    #[serde(default)]
    closed_form: Option<String>,
    /// CSV with the same columns: what was measured.
    #[serde(default)]
    measured: Option<String>,
}

struct Edges {
    /// Material coordinates (m), origin in the centre.
    points: Vec<[f64; 2]>,
    strain: f64,
    time: f64,
    both: bool,
}

impl Drive for Edges {
    fn position(&self, k: usize, t: f64) -> Vec3 {
        let stretch = 1.0 + self.strain * smooth_step(t, 0.0, self.time);
        let [x, y] = self.points[k];
        [x * stretch, if self.both { y * stretch } else { y }, 0.0]
    }
}

struct Film {
    time: f64,
    /// Undeformed section (m2).
    section: f64,
    /// -1, 0, +1 by driven node: left end, none, right end.
    side: Vec<f64>,
    /// Nodes between which strain is measured, their distance at the start (m).
    gauge: ([usize; 2], f64),
    sum: (f64, f64, f64),
    strain: Vec<f64>,
    stress: Vec<f64>,
}

impl Test for Film {
    fn duration(&self) -> f64 {
        self.time
    }

    fn stepped(&mut self, specimen: &Specimen) {
        let reactions = specimen.model.reactions().iter();
        let force: f64 = reactions.zip(&self.side).map(|(r, s)| 0.5 * s * r[0]).sum();
        let ([a, b], at_start) = self.gauge;
        let strain = (specimen.model.x()[b][0] - specimen.model.x()[a][0]) / at_start - 1.0;
        self.sum = (self.sum.0 + force, self.sum.1 + strain, self.sum.2 + 1.0);
    }

    fn sample(&mut self, _specimen: &Specimen, _t: f64) {
        let (force, strain, steps) = std::mem::take(&mut self.sum);
        if steps > 1.0 {
            self.strain.push(strain / steps);
            self.stress.push(force / steps / self.section);
        }
    }

    fn phase(&self) -> &'static str {
        "pulling"
    }
}

/// The step plugin `coupon-film`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("film/manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        with_threads(host, || test(host, &p))
    }
}

fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    let x = ("nominal_strain", Dimension::Dimensionless);
    let y = ("nominal_stress", Dimension::Pressure);
    let closed_form = Curve::given(p.closed_form.as_ref(), x, y)?;
    let measured = Curve::given(p.measured.as_ref(), x, y)?;
    p.common.allow(p.length * p.width)?;
    let xs = even_axis(-0.5 * p.length, 0.5 * p.length, p.common.element_size);
    let ys = even_axis(-0.5 * p.width, 0.5 * p.width, p.common.element_size);
    let mesh = QuadMesh::grid(&xs, &ys);
    let at_end = |x: f64| (x.abs() - 0.5 * p.length).abs() < 1e-9 * p.length;
    let driven: Vec<u32> = (mesh.on_boundary().iter().zip(&mesh.points).enumerate())
        .filter(|(_, (on, x))| **on && (p.mode != Mode::Uniaxial || at_end(x[0])))
        .map(|(n, _)| n as u32)
        .collect();
    let points: Vec<[f64; 2]> = driven
        .iter()
        .map(|n| [mesh.points[*n as usize][0], mesh.points[*n as usize][1]])
        .collect();
    let side = points
        .iter()
        .map(|x| if at_end(x[0]) { x[0].signum() } else { 0.0 })
        .collect();
    let gauge = gauge(&xs, &ys);
    let mut specimen = Specimen::new(host, &p.common, mesh, [1.0, 0.0, 0.0], Pressed::No)?;
    specimen.keep_flat();
    let edges = Edges {
        points,
        strain: p.strain,
        time: p.time,
        both: p.mode == Mode::Equibiaxial,
    };
    specimen.model.set_driven(driven, Box::new(edges));
    let mut film = Film {
        time: p.time,
        section: p.width * p.common.thickness(),
        side,
        gauge,
        sum: (0.0, 0.0, 0.0),
        strain: Vec::new(),
        stress: Vec::new(),
    };
    let outcome = run(host, &p.common, &mut specimen, &mut film)?;
    let references = (closed_form.as_ref(), measured.as_ref());
    let done = Finished {
        p,
        specimen: &specimen,
        test: &film,
        outcome: &outcome,
    };
    write(host, &done, references)
}

/// Nodes near a quarter of the length from the centre on both sides, on the grid line nearest the axis, and
/// their distance (m).
fn gauge(xs: &[f64], ys: &[f64]) -> ([usize; 2], f64) {
    let middle = ys.len() / 2;
    let last = xs.len() - 1;
    let (a, b) = (last / 4, last - last / 4);
    let row = middle * xs.len();
    ([row + a, row + b], xs[b] - xs[a])
}

fn write(
    host: &Host,
    done: &Finished<'_, Parameters, Film>,
    (closed_form, measured): (Option<&Curve>, Option<&Curve>),
) -> Result<(), StepError> {
    let (p, film) = (done.p, done.test);
    let mut out = Output::new(host);
    let x = out.curve("run/nominal_strain", "1", &film.strain)?;
    let y = out.curve("run/nominal_stress", "Pa", &film.stress)?;
    let mut series = vec![("this run", x, y, Style::Line)];
    let others = [
        ("closed_form", "closed form", Style::Dashed, closed_form),
        ("measured", "measured", Style::Points, measured),
    ];
    for (name, label, style, curve) in others {
        let Some(curve) = curve else { continue };
        let x = out.curve(&format!("{name}/nominal_strain"), "1", &curve.x)?;
        let y = out.curve(&format!("{name}/nominal_stress"), "Pa", &curve.y)?;
        series.push((label, x, y, style));
        let outside =
            || format!("{name}: fewer than two points of the run lie in its range of strains");
        let error = curve
            .relative_rms(&film.strain, &film.stress)
            .ok_or_else(outside)?;
        host.result(&format!("{name}_error"), error, "1")?;
        if name == "measured" {
            let difference = curve
                .rms_difference(&film.strain, &film.stress)
                .ok_or_else(outside)?;
            let largest = curve.y.iter().copied().fold(0.0, f64::max);
            host.result("measured_error_of_peak", difference / largest, "1")?;
        }
    }
    let title = match p.mode {
        Mode::Uniaxial => "Film: uniaxial tension",
        Mode::Equibiaxial => "Film: equibiaxial tension",
        Mode::Planar => "Film: planar tension",
    };
    let mut plot = out.plot(
        "stress",
        title,
        ("nominal strain", "1"),
        ("nominal stress", "MPa"),
    );
    for (label, x, y, style) in &series {
        plot = plot.series(label, x, y, *style);
    }
    plot.done();
    let last = |v: &[f64]| v.last().copied().unwrap_or(0.0);
    host.result("strain_end", last(&film.strain), "1")?;
    host.result("stress_end", last(&film.stress), "Pa")?;
    out.finish(&p.common, done.specimen, done.outcome)
}
