//! Bias extension kept in the plane, with element meshes at any angle to the fibres.
//!
//! A rectangle with fibres at +-45 degrees to its length is gripped at both ends and pulled; it cannot leave
//! its plane. A fabric with stiff fibres and a soft shear response tempts elements whose edges are not along
//! the fibres to lock, so the force must not depend on how the mesh lies. Runs with other meshes,
//! wired to the port `others`, are compared with this one at equal displacements.

use crate::drives::Ends;
use crate::output::Output;
use crate::rotated_mesh::{least_jacobian, turned_rectangle};
use crate::run::{Finished, Test, run, with_threads};
use crate::specimen::{Common, Specimen};
use crate::strip::fibre_strain;
use plyflow_fixed::FixedBits;
use plyflow_geometry::vec3::Vec3;
use plyflow_mechanics::history::{linear, smooth_step};
use plyflow_mechanics::mesh::QuadMesh;
use plyflow_mechanics::sheet::Pressed;
use plyflow_model::artifact::Style;
use plyflow_sdk::{Host, Step, StepError};
use serde::Deserialize;

/// Parameters (SI).
#[derive(Debug, Clone, Deserialize)]
pub struct Parameters {
    #[serde(flatten)]
    common: Common,
    /// Between the grips, along the pull (m).
    length: f64,
    /// Across (m).
    width: f64,
    /// Displacement of the cross-head (m).
    extension: f64,
    /// Time of the pull (s).
    time: f64,
    /// Between element edges and fibres (rad).
    mesh_angle: f64,
}

struct BiasPlane {
    time: f64,
    extension: f64,
    /// -1 on the left grip, +1 on the right one.
    side: Vec<f64>,
    /// Cells in the middle of the specimen.
    middle: Vec<usize>,
    sum: (f64, f64, f64),
    displacement: Vec<f64>,
    force: Vec<f64>,
    shear: Vec<f64>,
    fibre_strain: f64,
}

impl Test for BiasPlane {
    fn duration(&self) -> f64 {
        self.time
    }

    fn stepped(&mut self, specimen: &Specimen) {
        let t = specimen.model.time() - specimen.model.dt();
        let reactions = specimen.model.reactions().iter();
        let force: f64 = reactions.zip(&self.side).map(|(r, s)| 0.5 * s * r[0]).sum();
        let displacement = self.extension * smooth_step(t, 0.0, self.time);
        self.sum = (
            self.sum.0 + force,
            self.sum.1 + displacement,
            self.sum.2 + 1.0,
        );
    }

    fn sample(&mut self, specimen: &Specimen, _t: f64) {
        let (force, displacement, steps) = std::mem::take(&mut self.sum);
        if steps <= 1.0 {
            return;
        }
        self.displacement.push(displacement / steps);
        self.force.push(force / steps);
        if let Some(shear) = specimen.field("shear_angle") {
            let sum: f64 = self.middle.iter().map(|c| shear[*c]).sum();
            self.shear.push(sum / self.middle.len() as f64);
        }
        self.fibre_strain = self.fibre_strain.max(fibre_strain(specimen));
    }

    fn phase(&self) -> &'static str {
        "pulling"
    }
}

/// The step plugin `coupon-bias-plane`.
pub struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = include_str!("bias_plane/manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        with_threads(host, || test(host, &p))
    }
}

/// Cells whose centre lies within an eighth of the width from the specimen's; at least the nearest.
fn middle(mesh: &QuadMesh, length: f64, width: f64) -> Vec<usize> {
    let away: Vec<f64> = mesh
        .cells
        .iter()
        .map(|c| {
            let mean = |k: usize| c.iter().map(|n| mesh.points[*n as usize][k]).sum::<f64>() / 4.0;
            (mean(0) - 0.5 * length).abs().max(mean(1).abs())
        })
        .collect();
    let least = away.iter().copied().fold(f64::INFINITY, f64::min);
    let limit = (0.125 * width).max(least);
    (0..away.len()).filter(|c| away[*c] <= limit).collect()
}

fn test(host: &Host, p: &Parameters) -> Result<(), StepError> {
    p.common.allow(p.length * p.width)?;
    let eighth = 0.25 * std::f64::consts::PI;
    let turn = eighth - p.mesh_angle;
    let mesh = turned_rectangle(p.length, p.width, p.common.element_size, turn);
    let jacobian = least_jacobian(&mesh);
    if jacobian < 0.2 {
        return Err(format!(
            "mesh_angle, element_size: the mesh at {:.2} deg with {} m has a cell of scaled Jacobian {jacobian:.2}; \
             expected at least 0.2. Try a slightly other element_size",
            p.mesh_angle.to_degrees(),
            p.common.element_size
        )
        .into());
    }
    let at_end = |x: f64| x < 1e-9 * p.length || x > (1.0 - 1e-9) * p.length;
    let driven: Vec<u32> = (mesh.points.iter().enumerate())
        .filter(|(_, x)| at_end(x[0]))
        .map(|(n, _)| n as u32)
        .collect();
    let places: Vec<Vec3> = driven.iter().map(|n| mesh.points[*n as usize]).collect();
    let side = (places.iter())
        .map(|x| if x[0] > 0.5 * p.length { 1.0 } else { -1.0 })
        .collect();
    let middle = middle(&mesh, p.length, p.width);
    let axis = [eighth.fixed_cos(), -eighth.fixed_sin(), 0.0];
    let mut specimen = Specimen::new(host, &p.common, mesh, axis, Pressed::No)?;
    specimen.keep_flat();
    let grips = Ends {
        places,
        middle: 0.5 * p.length,
        way: p.extension,
        time: p.time,
        clamped: false,
    };
    specimen.model.set_driven(driven, Box::new(grips));
    let mut test = BiasPlane {
        time: p.time,
        extension: p.extension,
        side,
        middle,
        sum: (0.0, 0.0, 0.0),
        displacement: Vec::new(),
        force: Vec::new(),
        shear: Vec::new(),
        fibre_strain: 0.0,
    };
    let outcome = run(host, &p.common, &mut specimen, &mut test)?;
    let done = Finished {
        p,
        specimen: &specimen,
        test: &test,
        outcome: &outcome,
    };
    write(host, &done, jacobian)
}

/// Displacement, force and centre shear of one run.
struct Record {
    label: String,
    displacement: Vec<f64>,
    force: Vec<f64>,
    shear: Vec<f64>,
}

fn others(host: &Host) -> Result<Vec<Record>, StepError> {
    let mut records = Vec::new();
    for input in host.inputs_of("others")? {
        records.push(Record {
            label: input.step.clone(),
            displacement: host.array_f64(&input, "curves/run/displacement")?.0,
            force: host.array_f64(&input, "curves/run/force")?.0,
            shear: host.array_f64(&input, "curves/run/centre_shear")?.0,
        });
    }
    Ok(records)
}

/// Spread of the forces of several runs, at equal displacements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    /// Up to the displacement of the largest mean force: root mean square of largest less smallest over that of the
    /// mean.
    pub before: f64,
    /// Beyond it; `None` when the mean force is largest at the end.
    pub after: Option<f64>,
    /// Largest difference at any displacement over the largest mean force.
    pub largest: f64,
}

/// Displacements at which forces are compared.
const PLACES: usize = 400;

/// The spread of curves `(displacement, force)`.
pub fn spread(curves: &[(&[f64], &[f64])]) -> Spread {
    let last = |d: &[f64]| d.last().copied().unwrap_or(0.0);
    let end = (curves.iter())
        .map(|(d, _)| last(d))
        .fold(f64::INFINITY, f64::min);
    let at: Vec<(f64, f64)> = (1..=PLACES)
        .map(|k| {
            let d = end * k as f64 / PLACES as f64;
            let forces = curves.iter().map(|(x, y)| linear(x, y, d));
            let (mut low, mut high, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
            for f in forces {
                (low, high, sum) = (low.min(f), high.max(f), sum + f);
            }
            (high - low, sum / curves.len() as f64)
        })
        .collect();
    let peak = (0..PLACES)
        .max_by(|a, b| at[*a].1.total_cmp(&at[*b].1))
        .unwrap_or(0);
    let ratio = |part: &[(f64, f64)]| {
        let squares = |f: fn(&(f64, f64)) -> f64| part.iter().map(|v| f(v) * f(v)).sum::<f64>();
        (squares(|v| v.0) / squares(|v| v.1)).sqrt()
    };
    let difference = at.iter().map(|v| v.0).fold(0.0, f64::max);
    Spread {
        before: ratio(&at[..=peak]),
        after: (peak + 1 < PLACES).then(|| ratio(&at[peak + 1..])),
        largest: difference / at[peak].1,
    }
}

fn write(
    host: &Host,
    done: &Finished<'_, Parameters, BiasPlane>,
    jacobian: f64,
) -> Result<(), StepError> {
    let (p, test) = (done.p, done.test);
    let mut out = Output::new(host);
    let x = out.curve("run/displacement", "m", &test.displacement)?;
    let force = out.curve("run/force", "N", &test.force)?;
    let shear = out.curve("run/centre_shear", "rad", &test.shear)?;
    let others = others(host)?;
    let own = format!("mesh at {:.1} deg to the fibres", p.mesh_angle.to_degrees());
    let mut series = vec![(own, x, force, shear, Style::Line)];
    for r in &others {
        let at = |name: &str| format!("{}/{name}", r.label);
        series.push((
            r.label.clone(),
            out.curve(&at("displacement"), "m", &r.displacement)?,
            out.curve(&at("force"), "N", &r.force)?,
            out.curve(&at("centre_shear"), "rad", &r.shear)?,
            Style::Dashed,
        ));
    }
    let axis = ("displacement", "mm");
    let mut plot = out.plot(
        "force",
        "Bias extension in the plane: force",
        axis,
        ("force", "N"),
    );
    for (label, x, y, _, style) in &series {
        plot = plot.series(label, x, y, *style);
    }
    plot.done();
    let label = ("shear angle", "deg");
    let mut plot = out.plot(
        "shear",
        "Bias extension in the plane: shear in the middle",
        axis,
        label,
    );
    for (label, x, _, y, style) in &series {
        plot = plot.series(label, x, y, *style);
    }
    plot.done();
    spreads(host, test, &others)?;
    let last = |v: &[f64]| v.last().copied().unwrap_or(0.0);
    let peak = crate::reference::largest_between(&test.force);
    host.result("force_peak", peak, "N")?;
    host.result("force_end", last(&test.force), "N")?;
    host.result("centre_shear_end", last(&test.shear), "rad")?;
    host.result("fibre_strain_largest", test.fibre_strain, "1")?;
    host.result("least_jacobian", jacobian, "1")?;
    out.about.mesh_angle = Some(p.mesh_angle);
    out.finish(&p.common, done.specimen, done.outcome)
}

/// Tells how far the forces of other meshes are from the run's own.
fn spreads(host: &Host, test: &BiasPlane, others: &[Record]) -> Result<(), StepError> {
    if others.is_empty() {
        return Ok(());
    }
    let mut curves: Vec<(&[f64], &[f64])> = vec![(&test.displacement, &test.force)];
    curves.extend(others.iter().map(|r| (&*r.displacement, &*r.force)));
    let s = spread(&curves);
    host.result("force_spread_before_peak", s.before, "1")?;
    if let Some(after) = s.after {
        host.result("force_spread_after_peak", after, "1")?;
    }
    host.result("force_spread_largest", s.largest, "1")?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_is_measured_at_equal_displacements_before_and_after_the_peak() {
        let x: Vec<f64> = (0..=100).map(|k| f64::from(k) * 0.01).collect();
        let rise = |x: f64| if x < 0.6 { x } else { 1.2 - x };
        let one: Vec<f64> = x.iter().map(|x| rise(*x)).collect();
        let stiffer: Vec<f64> = one.iter().map(|f| 1.02 * f).collect();
        let s = spread(&[(&x, &one), (&x, &stiffer)]);
        let expected = 0.02 / 1.01;
        assert!((s.before - expected).abs() < 1e-12, "{s:?}");
        assert!((s.after.unwrap() - expected).abs() < 1e-12, "{s:?}");
        assert!((s.largest - expected).abs() < 1e-12, "{s:?}");
        // Apart from 0.7 on by up to 0.06 of a peak of 0.6.
        let later: Vec<f64> = (x.iter().zip(&one))
            .map(|(x, f)| f + 0.2 * (x - 0.7).max(0.0))
            .collect();
        let s = spread(&[(&x, &one), (&x, &later)]);
        assert_eq!(s.before, 0.0);
        assert!(s.after.unwrap() > 0.05, "{s:?}");
        assert!((s.largest - 0.1).abs() < 1e-9, "{s:?}");
        assert!(spread(&[(&x, &x), (&x, &x)]).after.is_none());
    }
}
