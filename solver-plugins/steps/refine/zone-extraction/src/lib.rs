//! Step plugin `zone-extraction`: boxes around connected defects, where finer runs look closer.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod across;
mod extract;
mod grow;

pub use across::{Across, across};
pub use extract::{ExtractError, FlaggedCell, Settings, extract};
pub use grow::{AtCut, grow};

use extract::tidy;
use plyflow_geometry::{Vec3, rectangle};
use plyflow_model::artifact::{
    ComparedDefect, Comparison, Rectangle, Zone, Zones, area, current_zones,
};
use plyflow_sdk::{Host, Log, Step, StepError, export_step};
use plyflow_surface::Topology;

/// The step.
pub struct ZoneExtraction;

export_step!(ZoneExtraction);

impl Step for ZoneExtraction {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let settings: Settings = host.parameters()?;
        let wired = |port: &str| Ok::<_, StepError>(!host.inputs_of(port)?.is_empty());
        match [wired("defects")?, wired("zones")?, wired("comparison")?] {
            [true, false, false] => first(host, &settings),
            [false, true, true] => again(host, &settings),
            _ => Err("give either `defects`, for the zones of a run, or `zones` and `comparison`, to draw those again that are too small".into()),
        }
    }
}

/// Zones around the defects of a run.
fn first(host: &Host, settings: &Settings) -> Result<(), StepError> {
    let (plies, cells, blank) = read(host)?;
    let zones = extract(&cells, &plies, blank, settings)?;
    if zones.is_empty() {
        host.log(Log::Info, "no defect is large enough for a zone");
    }
    for cut in across(&cells, &zones, blank, settings) {
        tell_across(host, &cut, &zones[cut.zone], &plies[cut.ply]);
    }
    write(host, settings, blank, zones)
}

/// Along its cut a zone goes as the coarse run has it, which shows a wrinkle badly.
fn tell_across(host: &Host, cut: &Across, zone: &Zone, ply: &str) {
    let axis = ["x", "y"];
    let (normal, along) = (axis[cut.side % 2], axis[1 - cut.side % 2]);
    let mm = |length: f64| (1e4 * length).round() / 10.0;
    let text = format!(
        "zone {} is cut across a defect: on ply '{ply}' both sides of its cut {normal} = {} mm are flagged over {} mm, between {along} = {} and {} mm. There the fine run \
         goes as the coarse one has it, which shows no wrinkle well. Move that side to {normal} = {} mm or beyond, or draw the zone around the whole defect",
        zone.name,
        mm(zone.bounds[cut.side]),
        mm(cut.length),
        mm(cut.from_to[0]),
        mm(cut.from_to[1]),
        mm(cut.free_at),
    );
    host.log(Log::Warn, &text);
}

/// Those of the zones again, larger, whose local runs show a defect at the cut.
fn again(host: &Host, settings: &Settings) -> Result<(), StepError> {
    let (zones, blank) = drawn_before(host)?;
    let compared: Comparison = host.attributes(&host.input("comparison")?)?;
    let at_cut = |d: &ComparedDefect| AtCut {
        id: d.id.clone(),
        zone: d.zone.clone(),
        cut_sides: d.cut_sides,
    };
    let defects: Vec<AtCut> = compared.local_defects().map(at_cut).collect();
    let known = |name: &&String| zones.iter().any(|z| z.name == **name);
    let missing: Vec<&str> = (compared.zones.iter())
        .filter(|n| !known(n))
        .map(String::as_str)
        .collect();
    if !missing.is_empty() {
        let text = format!(
            "zones: the comparison has {} too, which none of the lists given here holds: what grows may come to lie over them. Give all lists of zones that it has",
            missing.join(", ")
        );
        host.log(Log::Warn, &text);
    }
    for (name, compared) in compared.zones.iter().zip(&compared.zone_boxes) {
        let given = zones.iter().find(|z| z.name == *name);
        if let Some(given) = given.filter(|z| !z.has_box(*compared)) {
            let text = format!(
                "zones: zone {name} was compared with the box {:?} mm, of the lists given here the one that counts has it with {:?} mm: what reached the cut of the one says \
                 nothing of the other. Give all lists of zones that the comparison has, and no others",
                in_mm(*compared),
                in_mm(given.bounds)
            );
            host.log(Log::Warn, &text);
        }
    }
    let grown = grow(&zones, &defects, blank, settings);
    if grown.is_empty() {
        host.log(
            Log::Info,
            "no defect reaches a cut: every zone is large enough",
        );
    }
    let mut list = Vec::new();
    for (zone, why) in grown {
        let mm = in_mm(zone.bounds);
        let names: Vec<&str> = zone.replaces.iter().map(String::as_str).collect();
        let with = if names.is_empty() {
            String::new()
        } else {
            format!(" with {}", names.join(", "))
        };
        let text = format!(
            "zone {}{with} is drawn again as {mm:?} mm: {why} reached its cut",
            zone.name
        );
        host.log(Log::Info, &text);
        list.push(zone);
    }
    write(host, settings, blank, list)
}

/// To 0.1 mm, for people.
fn in_mm(bounds: Rectangle) -> Rectangle {
    bounds.map(|b| (1e4 * b).round() / 10.0)
}

/// The zones that count of all lists given, and the box around the blank (m).
fn drawn_before(host: &Host) -> Result<(Vec<Zone>, Rectangle), StepError> {
    let (mut zones, mut blank) = (Vec::new(), None);
    for input in host.inputs_of("zones")? {
        let previous: Zones = host.attributes(&input)?;
        zones.extend(previous.zones);
        let step = input.step;
        let given = previous.blank.ok_or_else(|| {
            format!("zones: '{step}' does not tell the box around the blank (attribute `blank`), in which zones may grow")
        })?;
        match &blank {
            None => blank = Some((step, given)),
            Some((first, expected)) if *expected != given => {
                return Err(format!(
                    "zones: '{step}' is of a blank {given:?} m, '{first}' of one {expected:?} m; give lists of zones of one coarse run"
                )
                .into());
            }
            Some(_) => {}
        }
    }
    let (_, blank) = blank.ok_or("zones: no list arrives")?;
    Ok((current_zones(zones).0, blank))
}

fn write(
    host: &Host,
    settings: &Settings,
    blank: Rectangle,
    zones: Vec<Zone>,
) -> Result<(), StepError> {
    let covered = zones.iter().fold(0.0, |sum, z| sum + z.area());
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
    let names: Vec<String> = zones.iter().map(|z| z.name.clone()).collect();
    host.write_attributes(&Zones {
        zones,
        scale: Some(settings.scale),
        wider: Some(settings.wider).filter(|w| *w != 1.0),
        blank: Some(blank),
        ply_fraction: Some(fraction),
    })?;
    host.collection(&names)?;
    host.result("zone_count", names.len() as f64, "1")?;
    host.result("ply_fraction", fraction, "1")
}

/// Tells what of a ply has no shape: there are no defects to draw zones around, but where the fabric locks, which is flagged.
fn tell_undraped(host: &Host, ply: &str, areas: &[f64], draped: &[f64], flags: &[f64]) {
    let area = |of: &dyn Fn(usize) -> bool| -> f64 {
        let chosen = (0..areas.len()).filter(|c| draped[*c] < 0.5 && of(*c));
        chosen.map(|c| areas[c]).sum()
    };
    let (all, locked) = (area(&|_| true), area(&|c| flags[c] > 0.5));
    if all == 0.0 {
        return;
    }
    let share = |of: f64| (100.0 * of / areas.iter().sum::<f64>()).clamp(0.1, 100.0);
    let flagged = if locked > 0.0 {
        format!(
            "; {:.1} % of its area is flagged there because the fabric locks",
            share(locked)
        )
    } else {
        String::new()
    };
    host.log(
        Log::Warn,
        &format!(
            "ply '{ply}' is not draped on {:.1} % of its area: what forms there is not known, and no zone looks for it{flagged}",
            share(all)
        ),
    );
}

/// Names of the plies, their flagged cells, and the box around all of them.
fn read(host: &Host) -> Result<(Vec<String>, Vec<FlaggedCell>, Rectangle), StepError> {
    let input = host.input("defects")?;
    let meshes = host.meshes(&input)?;
    let Some(frame) = meshes.times.len().checked_sub(1) else {
        return Err(format!("'{}' has no frame", input.step).into());
    };
    let (mut names, mut cells) = (Vec::new(), Vec::new());
    let mut blank = rectangle::NOTHING;
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
            rectangle::around(nodes.map(|i| [flat[i][0], flat[i][1]]))
        };
        blank = rectangle::hull(blank, around(&mut (0..points.len())));
        let areas = topology.cell_areas(&flat);
        if body.fields.iter().any(|f| f.name == "draped") {
            let draped = host.frame_field(&input, body, frame, "draped")?;
            tell_undraped(host, &body.name, &areas, &draped, &flags);
        }
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
