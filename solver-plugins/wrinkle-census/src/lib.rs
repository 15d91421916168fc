//! Step plugin `wrinkle-census`: wrinkles of a formed ply on circles about a vertical axis, and sections through it.
//!
//! Made for parts pressed by an axisymmetric punch (thesis chapter 4): there wrinkles run outwards, and a circle crosses
//! each of them once.

mod surface;
mod waves;

pub use surface::{Cut, Hit};
pub use waves::{Wave, median, waves};

use plyflow_sdk::{Host, Input, Step, StepError, export_step};
use plyflow_surface::vector::Vec3;
use serde::Deserialize;
use serde_json::{Value, json};
use std::f64::consts::TAU;

/// The step.
pub struct WrinkleCensus;

export_step!(WrinkleCensus);

#[derive(Deserialize)]
struct Parameters {
    ply: Option<String>,
    centre: Vec<f64>,
    circles: Vec<f64>,
    inner_circles: Vec<f64>,
    sections: Vec<f64>,
    threshold: f64,
    samples: usize,
}

#[derive(Deserialize)]
struct Formed {
    sheets: Vec<Sheet>,
}

#[derive(Deserialize)]
struct Sheet {
    name: String,
    kind: String,
}

/// A ply in its last frame.
struct Ply {
    points: Vec<Vec3>,
    cells: Vec<u32>,
    shear: Vec<f64>,
}

impl Step for WrinkleCensus {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let [x, y] = p.centre[..] else {
            return Err(format!(
                "centre: given {} numbers; expected two, [x, y]",
                p.centre.len()
            )
            .into());
        };
        if p.circles.is_empty() {
            return Err("circles: given none; expected at least one radius".into());
        }
        let ply = read(host, &host.input("formed")?, p.ply.as_deref())?;
        let cut = Cut::new(&ply.points, &ply.cells, &ply.shear);
        let around = |radius: f64| -> Vec<Option<Hit>> {
            let place = |i: usize| {
                let (s, c) = (TAU * i as f64 / p.samples as f64).sin_cos();
                cut.top([x + radius * c, y + radius * s])
            };
            (0..p.samples).map(place).collect()
        };
        let mut plots = Vec::new();
        let counted = circles(host, &p, &around, &mut plots)?;
        let inner = inner_deviation(&p, &around)?;
        sections(host, &p, &cut, [x, y], &mut plots)?;
        let list: Vec<Value> = (p.circles.iter().zip(&counted))
            .map(|(radius, waves)| json!({"radius": radius, "wrinkles": waves}))
            .collect();
        host.write_attributes(&json!({
            "circles": list, "threshold": p.threshold, "plots": plots,
        }))?;
        results(host, &counted[0], inner)
    }
}

fn read(host: &Host, input: &Input, wanted: Option<&str>) -> Result<Ply, StepError> {
    let formed: Formed = host.attributes(input)?;
    let plies: Vec<&str> = (formed.sheets.iter().filter(|s| s.kind == "ply"))
        .map(|s| s.name.as_str())
        .collect();
    let name = match wanted {
        Some(name) if plies.contains(&name) => name,
        Some(name) => {
            let there = plies.join(", ");
            return Err(format!("ply: given '{name}'; expected one of {there}").into());
        }
        None => plies
            .first()
            .copied()
            .ok_or_else(|| format!("'{}' has no ply", input.step))?,
    };
    let meshes = host.meshes(input)?;
    let frame = meshes.times.len().checked_sub(1);
    let frame = frame.ok_or_else(|| format!("'{}' has no frame to measure", input.step))?;
    let body = meshes.body(name)?;
    let (_, cells) = host.mesh(input, body)?;
    Ok(Ply {
        points: host.frame_points(input, body, frame)?,
        cells,
        shear: host.frame_field(input, body, frame, "shear_angle")?,
    })
}

/// Counts the wrinkles of every circle and writes its profile.
fn circles(
    host: &Host,
    p: &Parameters,
    around: &dyn Fn(f64) -> Vec<Option<Hit>>,
    plots: &mut Vec<Value>,
) -> Result<Vec<Vec<Wave>>, StepError> {
    let (mut counted, mut series) = (Vec::new(), Vec::new());
    for (k, radius) in p.circles.iter().enumerate() {
        let hits = around(*radius);
        let Some(middle) = median(&hits) else {
            return Err(format!(
                "circles: a radius of {:.1} mm lies all beside the ply; take a smaller one, or another centre",
                1e3 * radius
            )
            .into());
        };
        counted.push(waves(&hits, *radius, p.threshold));
        let on = hits
            .iter()
            .enumerate()
            .filter_map(|(i, h)| Some((i, (*h)?)));
        let (angle, height): (Vec<f64>, Vec<f64>) = on
            .map(|(i, h)| (TAU * i as f64 / p.samples as f64, h.height - middle))
            .unzip();
        let label = format!("radius {:.0} mm", 1e3 * radius);
        series.push(curve(
            host,
            &format!("circle_{k}"),
            &label,
            ["angle", "rad"],
            &angle,
            &height,
        )?);
    }
    plots.push(json!({
        "name": "circles", "title": "Height around the axis, less its median",
        "x": {"label": "angle from x", "unit": "deg"}, "y": {"label": "height", "unit": "mm"},
        "series": series,
    }));
    Ok(counted)
}

/// Largest deviation (m) from the median on the inner circles.
fn inner_deviation(
    p: &Parameters,
    around: &dyn Fn(f64) -> Vec<Option<Hit>>,
) -> Result<f64, StepError> {
    let mut largest: f64 = 0.0;
    for radius in &p.inner_circles {
        let hits = around(*radius);
        let Some(middle) = median(&hits).filter(|_| hits.iter().all(Option::is_some)) else {
            return Err(format!(
                "inner_circles: a radius of {:.1} mm does not lie all on the ply",
                1e3 * radius
            )
            .into());
        };
        let off = hits.iter().flatten().map(|h| (h.height - middle).abs());
        largest = off.fold(largest, f64::max);
    }
    Ok(largest)
}

/// Writes the sections.
fn sections(
    host: &Host,
    p: &Parameters,
    cut: &Cut<'_>,
    [x, y]: [f64; 2],
    plots: &mut Vec<Value>,
) -> Result<(), StepError> {
    let reach = p.circles.iter().copied().fold(0.0, f64::max);
    let mut series = Vec::new();
    for (k, angle) in p.sections.iter().enumerate() {
        let (s, c) = angle.sin_cos();
        let place = |i: usize| reach * (2.0 * i as f64 / (p.samples - 1) as f64 - 1.0);
        let hits = (0..p.samples).map(place);
        let (along, height): (Vec<f64>, Vec<f64>) = hits
            .filter_map(|d| Some((d, cut.top([x + d * c, y + d * s])?.height)))
            .unzip();
        let label = format!("section at {:.0} deg", angle.to_degrees());
        series.push(curve(
            host,
            &format!("section_{k}"),
            &label,
            ["distance", "m"],
            &along,
            &height,
        )?);
    }
    if !series.is_empty() {
        plots.push(json!({
            "name": "sections", "title": "Sections through the axis",
            "x": {"label": "distance from the axis", "unit": "mm"}, "y": {"label": "height", "unit": "mm"},
            "series": series,
        }));
    }
    Ok(())
}

/// Writes `curves/<name>/<what>` and `curves/<name>/height`; the series of a plot that shows them.
fn curve(
    host: &Host,
    name: &str,
    label: &str,
    [what, unit]: [&str; 2],
    x: &[f64],
    height: &[f64],
) -> Result<Value, StepError> {
    let (along, up) = (
        format!("curves/{name}/{what}"),
        format!("curves/{name}/height"),
    );
    host.write_f64(&along, &[x.len()], unit, x)?;
    host.write_f64(&up, &[height.len()], "m", height)?;
    Ok(json!({"label": label, "x": along, "y": up}))
}

fn results(host: &Host, waves: &[Wave], inner: f64) -> Result<(), StepError> {
    let count = |of: &dyn Fn(&Wave) -> bool| waves.iter().filter(|w| of(w)).count() as f64;
    host.result("wrinkles", count(&|_| true), "1")?;
    for k in 0..4 {
        let name = format!("wrinkles_q{}", k + 1);
        host.result(&name, count(&|w| w.quadrant() == k), "1")?;
    }
    let positive = |w: &Wave| w.shear > 0.0;
    let negative = |w: &Wave| w.shear <= 0.0;
    host.result("wrinkles_positive_shear", count(&positive), "1")?;
    host.result("wrinkles_negative_shear", count(&negative), "1")?;
    let highest = waves.iter().map(|w| w.height.abs()).fold(0.0, f64::max);
    host.result("height_largest", highest, "m")?;
    let width = |of: &dyn Fn(&Wave) -> bool| {
        let widths = waves.iter().filter(|w| of(w)).map(|w| w.width);
        widths.sum::<f64>() / count(of).max(1.0)
    };
    host.result("width_positive_shear", width(&positive), "m")?;
    host.result("width_negative_shear", width(&negative), "m")?;
    host.result("inner_deviation", inner, "m")
}
