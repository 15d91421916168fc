//! Step plugin `zone-extraction`: boxes around connected defects, where finer runs look closer.

mod extract;

pub use extract::{ExtractError, FlaggedCell, Rectangle, Settings, Zone, area, extract};

use extract::tidy;
use plyflow_sdk::{Host, Log, Step, StepError, export_step};
use plyflow_surface::Topology;
use plyflow_surface::vector::Vec3;
use serde_json::{Value, json};

/// The step.
pub struct ZoneExtraction;

export_step!(ZoneExtraction);

impl Step for ZoneExtraction {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let settings: Settings = host.parameters()?;
        let (plies, cells, blank) = read(host)?;
        let zones = extract(&cells, blank, &settings)?;
        let covered = zones.iter().fold(0.0, |sum, z| sum + area(z.bounds));
        let fraction = covered / area(blank);
        if fraction > settings.maximum_fraction {
            host.log(
                Log::Warn,
                &format!(
                    "the zones cover {:.0} % of the blank (warning above {:.0} %): local runs will cost nearly as much \
                     as a fine run of everything; raise the thresholds of the detection or draw `boxes` by hand",
                    100.0 * fraction,
                    100.0 * settings.maximum_fraction
                ),
            );
        }
        if zones.is_empty() {
            host.log(Log::Info, "no defect is large enough for a zone");
        }
        let mut list = Vec::new();
        for zone in &zones {
            let mut entry = serde_json::to_value(zone)?;
            entry["plies"] = zone
                .plies
                .iter()
                .map(|&p| Value::from(plies[p].as_str()))
                .collect();
            list.push(entry);
        }
        host.write_attributes(&json!({
            "zones": list, "scale": settings.scale, "blank": blank, "ply_fraction": fraction,
        }))?;
        let names: Vec<String> = zones.iter().map(|z| z.name.clone()).collect();
        host.collection(&names)?;
        host.result("zone_count", zones.len() as f64, "1")?;
        host.result("ply_fraction", fraction, "1")
    }
}

/// Names of the plies, their flagged cells, and the box around all of them.
fn read(host: &Host) -> Result<(Vec<String>, Vec<FlaggedCell>, Rectangle), StepError> {
    let input = host.input("defects")?;
    let meshes = host.meshes(&input)?;
    let Some(frame) = meshes.times.len().checked_sub(1) else {
        return Err(format!("'{}' has no frame", input.step).into());
    };
    let (mut names, mut cells) = (Vec::new(), Vec::new());
    let mut blank = [
        f64::INFINITY,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::NEG_INFINITY,
    ];
    for body in &meshes.bodies {
        let (points, nodes) = host.mesh(&input, body)?;
        let flat = host.frame_field(&input, body, frame, "undeformed")?;
        // Fields are kept in single precision: back to 0.1 um, so that an edge at 240 mm is one.
        let flat: Vec<Vec3> = flat
            .chunks_exact(3)
            .map(|p| [tidy(p[0]), tidy(p[1]), tidy(p[2])])
            .collect();
        let flags = host.frame_field(&input, body, frame, "flag")?;
        let topology = Topology::new(points.len(), body.nodes_per_cell, &nodes);
        let around = |nodes: &mut dyn Iterator<Item = usize>| {
            let none = [
                f64::INFINITY,
                f64::INFINITY,
                f64::NEG_INFINITY,
                f64::NEG_INFINITY,
            ];
            nodes.fold(none, |b, i| {
                let [x, y, _] = flat[i];
                [b[0].min(x), b[1].min(y), b[2].max(x), b[3].max(y)]
            })
        };
        let all = around(&mut (0..points.len()));
        blank = [
            blank[0].min(all[0]),
            blank[1].min(all[1]),
            blank[2].max(all[2]),
            blank[3].max(all[3]),
        ];
        let areas = topology.cell_areas(&flat);
        for c in (0..topology.cells()).filter(|&c| flags[c] > 0.5) {
            let bounds = around(&mut topology.cell(c).iter().map(|&i| i as usize));
            cells.push(FlaggedCell {
                ply: names.len(),
                bounds,
                area: areas[c],
            });
        }
        names.push(body.name.clone());
    }
    if names.is_empty() {
        return Err(format!("'{}' holds no ply", input.step).into());
    }
    Ok((names, cells, blank))
}
