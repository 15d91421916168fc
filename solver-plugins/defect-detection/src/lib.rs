//! Step plugin `defect-detection`: flags over-sheared and badly conforming places of formed plies.

mod detect;

pub use detect::{Detection, Ply, Summary, Thresholds, detect};

use plyflow_sdk::{Host, Input, Log, On, Progress, Step, StepError, export_step};
use plyflow_surface::vector::Vec3;
use plyflow_surface::{Surface, Topology, of_run};
use serde::Deserialize;
use serde_json::{Value, json};

/// The step.
pub struct DefectDetection;

export_step!(DefectDetection);

#[derive(Deserialize)]
struct Formed {
    sheets: Vec<Sheet>,
}

#[derive(Deserialize)]
struct Sheet {
    name: String,
    kind: String,
    offset: f64,
}

struct Judged {
    name: String,
    /// Undeformed area (m2).
    area: f64,
    points: Vec<Vec3>,
    cells: Vec<u32>,
    undeformed: Vec<Vec3>,
    shear_angle: Vec<f64>,
    found: Detection,
}

impl Step for DefectDetection {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let thresholds: Thresholds = host.parameters()?;
        let input = host.input("formed")?;
        let formed: Formed = host.attributes(&input)?;
        let plies: Vec<&Sheet> = formed.sheets.iter().filter(|s| s.kind == "ply").collect();
        let meshes = host.meshes(&input)?;
        let Some(frame) = meshes.times.len().checked_sub(1) else {
            return Err(format!(
                "'{}' has no frame: there is nothing formed to judge",
                input.step
            )
            .into());
        };
        if plies.is_empty() {
            return Err(format!(
                "'{}' lists no sheet of kind 'ply' in its attributes",
                input.step
            )
            .into());
        }
        let tool = of_run::rigid(host, &input, "tool")?;
        let mut judged = Vec::new();
        for (i, sheet) in plies.iter().enumerate() {
            host.check_cancelled()?;
            let fraction = i as f64 / plies.len() as f64;
            host.progress(&Progress {
                fraction,
                phase: &sheet.name,
                ..Default::default()
            });
            judged.push(judge(host, &input, frame, sheet, &tool, &thresholds)?);
        }
        for text in judged.iter().filter_map(|p| over_sheared(p, &thresholds)) {
            host.log(Log::Warn, &text);
        }
        write(host, meshes.times[frame], &judged, &thresholds)
    }
}

fn judge(
    host: &Host,
    input: &Input,
    frame: usize,
    sheet: &Sheet,
    tool: &Surface,
    thresholds: &Thresholds,
) -> Result<Judged, StepError> {
    let meshes = host.meshes(input)?;
    let body = meshes.body(&sheet.name)?;
    if body.nodes_per_cell != 4 {
        let n = body.nodes_per_cell;
        return Err(format!(
            "ply '{}' has cells of {n} nodes; quads are expected",
            sheet.name
        )
        .into());
    }
    let (undeformed, cells) = host.mesh(input, body)?;
    let points = host.frame_points(input, body, frame)?;
    let shear_angle = host.frame_field(input, body, frame, "shear_angle")?;
    let topology = Topology::new(undeformed.len(), 4, &cells);
    let missing = of_run::missing_below(host, input, &sheet.name)?;
    let ply = Ply {
        missing: missing.as_deref(),
        topology: &topology,
        undeformed: &undeformed,
        formed: &points,
        shear_angle: &shear_angle,
        offset: sheet.offset,
    };
    let found = detect(tool, &ply, thresholds);
    let area = topology.cell_areas(&undeformed).iter().sum();
    Ok(Judged {
        area,
        name: sheet.name.clone(),
        points,
        cells,
        undeformed,
        shear_angle,
        found,
    })
}

/// Share of a ply's area from which on over-shear is no local matter: the limit is probably another fabric's.
const MUCH: f64 = 0.4;

/// What to say of a ply of which most counts as over-sheared.
fn over_sheared(ply: &Judged, limits: &Thresholds) -> Option<String> {
    let of = &ply.found.summary;
    let share = of.over_shear_area / ply.area;
    (share > MUCH).then(|| {
        format!(
            "{:.0} % of ply '{}' counts as over-sheared (shear from {:.1} to {:.1} deg; over_shear_positive: {:.1} deg, over_shear_negative: {:.1} deg): \
             are these the angles from which this fabric wrinkles? The defaults are those of a non-crimp fabric; the thesis' woven one begins \
             to wrinkle at 50 deg of either sign (a bias extension test tells)",
            100.0 * share,
            ply.name,
            of.shear_min.to_degrees(),
            of.shear_max.to_degrees(),
            limits.over_shear_positive.to_degrees(),
            limits.over_shear_negative.to_degrees()
        )
    })
}

fn write(
    host: &Host,
    time: f64,
    plies: &[Judged],
    thresholds: &Thresholds,
) -> Result<(), StepError> {
    for p in plies {
        host.define_mesh(&p.name, &p.points, 4, &p.cells, &json!({}))?;
    }
    host.begin_frame(time)?;
    for p in plies {
        let number = |flags: &[bool]| -> Vec<f64> {
            flags.iter().map(|&f| f64::from(u8::from(f))).collect()
        };
        let f = &p.found;
        host.write_points(&p.name, &p.points)?;
        host.write_field(&p.name, On::Cells, "shear_angle", 1, "rad", &p.shear_angle)?;
        host.write_field(
            &p.name,
            On::Points,
            "nodal_distance",
            1,
            "m",
            &f.nodal_distance,
        )?;
        host.write_field(
            &p.name,
            On::Points,
            "curvature_max",
            1,
            "1/m",
            &f.curvature_max,
        )?;
        host.write_field(
            &p.name,
            On::Cells,
            "over_shear",
            1,
            "1",
            &number(&f.over_shear),
        )?;
        let poor = number(&f.poor_conformity);
        host.write_field(&p.name, On::Points, "poor_conformity", 1, "1", &poor)?;
        host.write_field(&p.name, On::Cells, "flag", 1, "1", &number(&f.flag))?;
        host.write_field(
            &p.name,
            On::Points,
            "undeformed",
            3,
            "m",
            p.undeformed.as_flattened(),
        )?;
    }
    host.end_frame()?;
    let mut list = Vec::new();
    for p in plies {
        let mut entry = serde_json::to_value(p.found.summary)?;
        entry["name"] = Value::from(p.name.as_str());
        list.push(entry);
    }
    host.write_attributes(&json!({"thresholds": thresholds, "plies": list}))?;
    let all = |get: fn(&Summary) -> f64| plies.iter().map(move |p| get(&p.found.summary));
    host.result("flagged_area", all(|s| s.flagged_area).sum(), "m2")?;
    host.result("over_shear_area", all(|s| s.over_shear_area).sum(), "m2")?;
    host.result(
        "poor_conformity_area",
        all(|s| s.poor_conformity_area).sum(),
        "m2",
    )?;
    host.result(
        "shear_max",
        all(|s| s.shear_max).fold(f64::NEG_INFINITY, f64::max),
        "rad",
    )?;
    host.result(
        "shear_min",
        all(|s| s.shear_min).fold(f64::INFINITY, f64::min),
        "rad",
    )?;
    host.result(
        "distance_max",
        all(|s| s.distance_max).fold(f64::NEG_INFINITY, f64::max),
        "m",
    )
}
