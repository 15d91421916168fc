//! Step plugin `defect-detection`: flags over-sheared and badly conforming places of formed plies.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod along;
mod buckling;
mod compressed;
mod detect;
mod laws;
mod ruck;
mod shear;

pub use along::Stretch;
pub use compressed::{Carrying, Law, excess};
pub use detect::{Detection, Ply, Thresholds, detect};
pub use ruck::{Harmonic, Ruck};

use buckling::Buckling;
use plyflow_geometry::vec3::Vec3;
use plyflow_model::artifact::{self, Defects, Forming, Map, Panel, PlainBody, PlyDefects, Sheet};
use plyflow_model::scene::Scene;
use plyflow_sdk::{Host, Input, Log, On, Progress, Step, StepError, export_step};
use plyflow_surface::draped::{DRAPED, DrapedPart, Formed};
use plyflow_surface::of_run::{self, check_quads};
use plyflow_surface::{Surface, Topology};
use serde::Deserialize;

/// Field of cells: excess length of compressed fibres over that which a ruck needs.
const EXCESS: &str = "buckling_excess";

/// Most panels of a map.
const MOST_PANELS: usize = 12;

/// The step.
pub struct DefectDetection;

export_step!(DefectDetection);

/// Parameters of the step, SI.
#[derive(Debug, Deserialize)]
struct Parameters {
    #[serde(flatten)]
    thresholds: Thresholds,
    /// With it compressed fibres are judged.
    scene: Option<Box<Scene>>,
    /// Height from which a ruck of compressed fibres counts (m).
    ruck_height: f64,
}

impl Parameters {
    /// For the artifact.
    fn told(&self, plies: &[Judged]) -> artifact::Thresholds {
        let limits = shear::common(plies.iter().map(|p| p.found.summary.over_shear));
        artifact::Thresholds {
            over_shear_positive: limits.positive,
            over_shear_negative: limits.negative,
            distance_threshold: Some(self.thresholds.distance_threshold),
            foot_margin: Some(self.thresholds.foot_margin),
            ruck_height: self.scene.as_ref().map(|_| self.ruck_height),
            other: serde_json::Map::new(),
        }
    }
}

struct Judged {
    name: String,
    /// Name of its material.
    material: Option<String>,
    /// Undeformed area of what is judged (m2).
    area: f64,
    points: Vec<Vec3>,
    cells: Vec<u32>,
    undeformed: Vec<Vec3>,
    shear_angle: Vec<f64>,
    found: Detection,
    /// `[cells]` whether a net reaches the cell; `None`: all are formed.
    draped: Option<Vec<bool>>,
    /// `[cells]` excess length of compressed fibres over that which a ruck needs; `None`: not judged.
    buckling: Option<Vec<f64>>,
}

impl Step for DefectDetection {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let input = host.input("formed")?;
        let formed: Forming = host.attributes(&input)?;
        let plies: Vec<&Sheet> = formed.plies().collect();
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
            let bed = !formed.without_bed;
            judged.push(judge(
                host,
                (&input, frame),
                sheet,
                (&tool, bed),
                &p.thresholds,
            )?);
        }
        if let Some(scene) = &p.scene {
            let found = buckling::judge(host, &input, frame, scene, p.ruck_height)?;
            for (ply, buckling) in judged.iter_mut().zip(found) {
                ply.add(buckling);
            }
        }
        for text in judged.iter().filter_map(over_sheared) {
            host.log(Log::Warn, &text);
        }
        let limits = judged.iter().map(|ply| {
            let material = ply.material.as_deref();
            (ply.name.as_str(), material, ply.found.summary.over_shear)
        });
        for text in shear::not_judged(limits) {
            host.log(Log::Warn, &text);
        }
        write(host, meshes.times[frame], &judged, &p)
    }
}

fn judge(
    host: &Host,
    (input, frame): (&Input, usize),
    sheet: &Sheet,
    (tool, bed): (&Surface, bool),
    thresholds: &Thresholds,
) -> Result<Judged, StepError> {
    let meshes = host.meshes(input)?;
    let body = meshes.body(&sheet.name)?;
    check_quads(&format!("ply '{}'", sheet.name), body)?;
    let (undeformed, cells) = host.mesh(input, body)?;
    let points = host.frame_points(input, body, frame)?;
    let part = Formed::read(host, input, body, frame)?;
    let shear_angle = part.of_cells(host.frame_field(input, body, frame, "shear_angle")?);
    let topology = Topology::new(part.flat.len(), 4, &part.cells);
    let missing = of_run::missing_below(host, input, &sheet.name)?.map(|m| part.at_nodes(m));
    let ply = Ply {
        name: &sheet.name,
        missing: missing.as_deref(),
        topology: &topology,
        undeformed: &part.flat,
        formed: &part.points,
        shear_angle: &shear_angle,
        over_shear: shear::limits(sheet, thresholds.asked()),
        offset: sheet.offset,
        bed,
    };
    let found = detect(tool, &ply, thresholds);
    let area = topology.cell_areas(&part.flat).iter().sum();
    let mut judged = Judged {
        area,
        name: sheet.name.clone(),
        material: sheet.material.clone(),
        points,
        cells,
        undeformed,
        shear_angle,
        found,
        draped: None,
        buckling: None,
    };
    if let Some(part) = part.part {
        judged.spread(part);
    }
    Ok(judged)
}

impl Judged {
    /// Flags where compressed fibres have length enough for a ruck.
    fn add(&mut self, buckling: Buckling) {
        let f = &mut self.found;
        for (flag, buckles) in f.flag.iter_mut().zip(&buckling.buckles) {
            *flag |= *buckles;
        }
        f.summary.flagged_area = buckling.area(&f.flag);
        f.summary.buckling_area = Some(buckling.area(&buckling.buckles));
        f.summary.buckling_excess = Some(buckling.largest());
        self.buckling = Some(buckling.excess);
    }

    /// From the part that is draped to the whole ply, of which the rest has no values; where the fabric locks it is flagged, since it cannot lie
    /// there as the tool asks.
    fn spread(&mut self, part: DrapedPart) {
        let nodes = self.undeformed.len();
        let f = &mut self.found;
        self.shear_angle = part.to_cells(&self.shear_angle, 0.0);
        f.nodal_distance = part.to_nodes(nodes, &f.nodal_distance, 0.0);
        f.judged = part.to_nodes(nodes, &f.judged, false);
        f.curvature_max = part.to_nodes(nodes, &f.curvature_max, 0.0);
        f.poor_conformity = part.to_nodes(nodes, &f.poor_conformity, false);
        f.over_shear = part.to_cells(&f.over_shear, false);
        f.flag = part.to_cells(&f.flag, false);
        let areas = Topology::new(nodes, 4, &self.cells).cell_areas(&self.undeformed);
        let (mut undraped, mut locked) = (0.0, 0.0);
        for (c, area) in areas.iter().enumerate() {
            if !part.draped[c] {
                undraped += area;
                if part.locked[c] {
                    locked += area;
                    f.flag[c] = true;
                }
            }
        }
        f.summary.undraped_area = Some(undraped);
        f.summary.locked_area = Some(locked);
        self.draped = Some(part.draped);
    }
}

/// Share of a ply's area from which on over-shear is no local matter: the limit is probably another fabric's.
const MUCH: f64 = 0.4;

/// What to say of a ply of which most counts as over-sheared.
fn over_sheared(ply: &Judged) -> Option<String> {
    let of = &ply.found.summary;
    let share = of.over_shear_area? / ply.area;
    let limits = of.over_shear?;
    (share > MUCH).then(|| {
        format!(
            "{:.0} % of ply '{}' counts as over-sheared (shear from {:.1} to {:.1} deg; {}): are these the angles from which this fabric \
             wrinkles? A non-crimp fabric may wrinkle at 8 deg, where its stitch is stretched, and a woven one at 50 deg of either sign; a \
             bias-extension test tells",
            100.0 * share,
            ply.name,
            of.shear_min.to_degrees(),
            of.shear_max.to_degrees(),
            shear::told(limits)
        )
    })
}

/// Points and fields of a ply in the open frame.
fn write_ply(host: &Host, p: &Judged) -> Result<(), StepError> {
    let number =
        |flags: &[bool]| -> Vec<f64> { flags.iter().map(|&f| f64::from(u8::from(f))).collect() };
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
    let judged = number(&f.judged);
    host.write_field(&p.name, On::Points, "judged", 1, "1", &judged)?;
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
    if let Some(draped) = &p.draped {
        host.write_field(&p.name, On::Cells, DRAPED, 1, "1", &number(draped))?;
    }
    if let Some(excess) = &p.buckling {
        host.write_field(&p.name, On::Cells, EXCESS, 1, "1", excess)?;
    }
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
    )
}

/// Maps of the excess length of compressed fibres, by as many plies as a map shows.
fn maps(plies: &[Judged]) -> Vec<Map> {
    let judged: Vec<&Judged> = plies.iter().filter(|p| p.buckling.is_some()).collect();
    let panel = |p: &&Judged| Panel {
        label: p.name.clone(),
        body: p.name.clone(),
        field: EXCESS.into(),
    };
    let map = |plies: &[&Judged]| Map {
        name: EXCESS.into(),
        title: Some("Excess length of compressed fibres over that of a ruck".into()),
        unit: "1".into(),
        panels: plies.iter().map(panel).collect(),
    };
    judged.chunks(MOST_PANELS).map(map).collect()
}

/// The over-sheared area of the plies whose shear is judged; none where none is.
fn shear_area(host: &Host, plies: &[Judged]) -> Result<(), StepError> {
    let judged = (plies.iter()).filter_map(|p| p.found.summary.over_shear_area);
    match judged.reduce(|sum, a| sum + a) {
        Some(area) => host.result("over_shear_area", area, "m2"),
        None => Ok(()),
    }
}

/// By ply, the share whose distance from the tool is judged.
fn judged_shares(host: &Host, plies: &[Judged]) -> Result<(), StepError> {
    for p in plies {
        let share = p.found.summary.judged_share.unwrap_or(0.0);
        host.result(&format!("judged_share.{}", p.name), share, "1")?;
    }
    Ok(())
}

fn write(
    host: &Host,
    time: f64,
    plies: &[Judged],
    parameters: &Parameters,
) -> Result<(), StepError> {
    for p in plies {
        host.define_mesh(&p.name, &p.points, 4, &p.cells, &PlainBody {})?;
    }
    host.begin_frame(time)?;
    for p in plies {
        write_ply(host, p)?;
    }
    host.end_frame()?;
    host.write_attributes(&Defects {
        thresholds: parameters.told(plies),
        plies: plies.iter().map(|p| p.found.summary.clone()).collect(),
        maps: maps(plies),
    })?;
    let all = |get: fn(&PlyDefects) -> f64| plies.iter().map(move |p| get(&p.found.summary));
    host.result("flagged_area", all(|s| s.flagged_area).sum(), "m2")?;
    if plies.iter().any(|p| p.draped.is_some()) {
        let sum = |of: fn(&PlyDefects) -> Option<f64>| {
            let each = plies.iter().map(|p| of(&p.found.summary).unwrap_or(0.0));
            each.sum()
        };
        host.result("undraped_area", sum(|s| s.undraped_area), "m2")?;
        host.result("locked_area", sum(|s| s.locked_area), "m2")?;
    }
    if parameters.scene.is_some() {
        let area = all(|s| s.buckling_area.unwrap_or(0.0)).fold(0.0, |sum, a| sum + a);
        let most = all(|s| s.buckling_excess.unwrap_or(0.0)).fold(0.0, f64::max);
        host.result("buckling_area", area, "m2")?;
        host.result("buckling_excess", most, "1")?;
    }
    shear_area(host, plies)?;
    judged_shares(host, plies)?;
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
