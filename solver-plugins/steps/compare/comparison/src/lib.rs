//! Step plugin `comparison`: measures wrinkles, bridging and shear in the local runs, and in the global run
//! and a reference at the same places, with what each cost.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod cut;
mod fidelity;
mod models;
mod table;

pub use fidelity::{Measured, Way};
pub use models::{Model, PassedOver};
pub use table::{Entry, defect_table};

use plyflow_defects::sizes::SizeClasses;
use plyflow_defects::{Kind, Limits, Ply, QUANTILES, Settings, quantiles};
use plyflow_model::artifact::{self, ComparedBody, ComparedModel, Cut, PlyShear, Role, Zone};
use plyflow_sdk::{Host, Input, Log, On, Progress, Step, StepError, export_step};

/// The step.
pub struct Comparison;

export_step!(Comparison);

impl Step for Comparison {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let settings: Settings = host.parameters()?;
        let (zones, superseded) = models::read_zones(host)?;
        host.progress(&Progress {
            phase: "reading",
            ..Default::default()
        });
        let (models, passed_over) = models::read_models(host, &zones, &superseded, &settings)?;
        host.progress(&Progress {
            fraction: 0.5,
            phase: "measuring",
            ..Default::default()
        });
        let limits: Limits = host.parameters()?;
        let local = models.iter().find(|m| m.role == Role::Local);
        if let Some(text) = local.and_then(|m| limits.untold(m.sheets.iter())) {
            host.log(Log::Info, &text);
        }
        let table = defect_table(&models, &zones, &settings, &limits);
        for e in table.iter().filter(|e| e.touches_cut()) {
            let zone = &zones[e.zone].name;
            let text = format!(
                "{} reaches the cut of zone {zone}: the zone is too small for it; raise `scale`, or let zone-extraction draw it again (docs/guide/zones.md)",
                e.id
            );
            host.log(Log::Warn, &text);
        }
        if zones.is_empty() {
            host.log(
                Log::Info,
                "there is no zone: nothing was refined, the global run stands alone",
            );
        }
        let cut = Cut {
            work: cut::passages(host, &models, &zones)?,
            layers: cut::layers(&models, &zones),
        };
        let classes: SizeClasses = host.parameters()?;
        let measured =
            fidelity::measure_ways(host, &models, &passed_over, &zones, &settings, &classes)?;
        write_attributes(host, &models, &zones, &table, &cut, &measured.ways)?;
        write_bodies(host, &models, &table)?;
        write_results(host, &models, &zones, &table)?;
        write_reference_defects(host, &models, &table)?;
        if !measured.ways.is_empty() {
            for (name, value, unit) in classes.told() {
                host.result(&name, value, unit)?;
            }
        }
        fidelity::write(host, &measured.ways)?;
        fidelity::write(host, &measured.local)?;
        cut::write(host, &cut, &zones)?;
        write_costs(host, &models, &passed_over)
    }
}

fn write_attributes(
    host: &Host,
    models: &[Model],
    zones: &[Zone],
    table: &[Entry],
    cut: &Cut,
    ways: &[Way],
) -> Result<(), StepError> {
    let model = |m: &Model| ComparedModel {
        name: m.name.clone(),
        role: m.role,
        zone: m.zone.map(|z| zones[z].name.clone()),
        element_size: m.element_size,
        elements: m.elements,
        element_cycles: m.element_cycles,
    };
    let plies = |m: &Model| -> Vec<PlyShear> {
        let one = |p: &Ply| {
            let [min, max] = range(&p.shear_angle).map(|v| v.is_finite().then_some(v));
            PlyShear {
                model: m.name.clone(),
                ply: p.name.clone(),
                min,
                max,
                quantiles: quantiles(&p.shear_angle, &QUANTILES),
            }
        };
        m.plies.iter().map(one).collect()
    };
    host.write_attributes(&artifact::Comparison {
        zones: zones.iter().map(|z| z.name.clone()).collect(),
        zone_boxes: zones.iter().map(|z| z.bounds).collect(),
        models: models.iter().map(model).collect(),
        defects: table.iter().map(|e| e.told(models, zones)).collect(),
        shear: models.iter().flat_map(plies).collect(),
        quantiles: QUANTILES.to_vec(),
        cut: cut.clone(),
        measured_by: fidelity::yardstick(models),
        ways: ways.iter().map(Way::told).collect(),
    })
}

fn range(values: &[f64]) -> [f64; 2] {
    values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], &v| {
            [a.min(v), b.max(v)]
        })
}

/// One body per ply of a local run, named `local_A_<ply>`, formed, with what was measured at its nodes.
fn write_bodies(host: &Host, models: &[Model], table: &[Entry]) -> Result<(), StepError> {
    let local: Vec<(usize, &Model)> = models
        .iter()
        .enumerate()
        .filter(|(_, m)| m.role == Role::Local)
        .collect();
    let name = |m: &Model, p: &Ply| format!("{}_{}", m.name.replace('.', "_"), p.name);
    for (_, m) in &local {
        for p in &m.plies {
            let (_, cells) = p.topology.connectivity();
            let about = ComparedBody {
                model: m.name.clone(),
                ply: p.name.clone(),
            };
            host.define_mesh(&name(m, p), &p.formed, 4, cells, &about)?;
        }
    }
    if local.iter().all(|(_, m)| m.plies.is_empty()) {
        return Ok(());
    }
    host.begin_frame(0.0)?;
    for (index, m) in &local {
        for p in &m.plies {
            let of_ply = table
                .iter()
                .filter(|e| e.model == *index && e.ply == p.name);
            write_ply(host, &name(m, p), p, of_ply)?;
        }
    }
    host.end_frame()
}

/// Places of a ply's nodes and what was measured there.
fn write_ply<'a>(
    host: &Host,
    body: &str,
    p: &Ply,
    defects: impl Iterator<Item = &'a Entry>,
) -> Result<(), StepError> {
    let field = |what: &str, components: u32, unit: &str, values: &[f64]| {
        host.write_field(body, On::Points, what, components, unit, values)
    };
    host.write_points(body, &p.formed)?;
    let distance: Vec<f64> = p.distance.iter().map(|d| d.value).collect();
    field("nodal_distance", 1, "m", &distance)?;
    field("judged", 1, "1", &p.judged())?;
    let curvature: Vec<f64> = p.curvature.iter().map(|k| k.max).collect();
    field("curvature_max", 1, "1/m", &curvature)?;
    let mut kind = vec![0.0; p.formed.len()];
    for e in defects {
        let value = match e.defect.kind {
            Kind::Wrinkle => 1.0,
            Kind::Bridging => 2.0,
        };
        e.defect
            .nodes
            .iter()
            .for_each(|&i| kind[i as usize] = value);
    }
    field("defect", 1, "1", &kind)?;
    field("undeformed", 3, "m", p.undeformed.as_flattened())?;
    host.write_field(body, On::Cells, "shear_angle", 1, "rad", &p.shear_angle)
}

fn write_results(
    host: &Host,
    models: &[Model],
    zones: &[Zone],
    table: &[Entry],
) -> Result<(), StepError> {
    let local: Vec<&Entry> = table
        .iter()
        .filter(|e| models[e.model].role == Role::Local)
        .collect();
    let count = |kind| local.iter().filter(|e| e.defect.kind == kind).count() as f64;
    host.result("zone_count", zones.len() as f64, "1")?;
    host.result("wrinkle_count", count(Kind::Wrinkle), "1")?;
    host.result("bridging_count", count(Kind::Bridging), "1")?;
    let angles = (models.iter())
        .filter(|m| matches!(m.role, Role::Global | Role::Local))
        .flat_map(|m| m.plies.iter().flat_map(|p| p.shear_angle.iter().copied()));
    let [min, max] = range(&angles.collect::<Vec<_>>());
    if min <= max {
        host.result("shear_max", max, "rad")?;
        host.result("shear_min", min, "rad")?;
    }
    for e in &local {
        match e.defect.kind {
            Kind::Wrinkle => {
                host.result(&format!("wrinkle_length.{}", e.id), e.defect.length, "m")?;
                host.result(
                    &format!("wrinkle_amplitude.{}", e.id),
                    e.defect.amplitude,
                    "m",
                )?;
            }
            Kind::Bridging => {
                host.result(&format!("bridging_area.{}", e.id), e.defect.area, "m2")?
            }
        }
    }
    Ok(())
}

fn write_reference_defects(
    host: &Host,
    models: &[Model],
    table: &[Entry],
) -> Result<(), StepError> {
    let Some(index) = models.iter().position(|m| m.role == Role::Reference) else {
        return Ok(());
    };
    for e in table.iter().filter(|e| e.model == index) {
        let (name, value, unit) = match e.defect.kind {
            Kind::Wrinkle => ("wrinkle_length", e.defect.length, "m"),
            Kind::Bridging => ("bridging_area", e.defect.area, "m2"),
        };
        host.result(&format!("reference_{name}.{}", e.id), value, unit)?;
    }
    Ok(())
}

/// What the runs cost; those `passed_over` count in the whole, and earlier passes in the global run that stands on them.
fn write_costs(host: &Host, models: &[Model], passed_over: &PassedOver) -> Result<(), StepError> {
    let sum = |of: &[Input], get: fn(&Input) -> f64| of.iter().map(get).fold(0.0, |s, c| s + c);
    let costs = |of: &[Input]| {
        let wall = sum(of, |i| i.cost.wall_seconds);
        [wall, sum(of, |i| i.cost.cpu_seconds)]
    };
    let (before, redrawn) = (costs(&passed_over.earlier), costs(&passed_over.superseded));
    let largest = |of: &[Input]| of.iter().map(|i| i.cost.peak_memory).fold(0.0, f64::max);
    let [mut wall, mut cpu] = [0, 1].map(|k| before[k] + redrawn[k]);
    let mut memory = largest(&passed_over.earlier).max(largest(&passed_over.superseded));
    if passed_over.all().next().is_some() {
        host.measured("cost.superseded.wall_seconds", wall, "s")?;
        host.measured("cost.superseded.cpu_seconds", cpu, "s")?;
    }
    if passed_over.earlier_coarse > 0 {
        host.result("passes", (1 + passed_over.earlier_coarse) as f64, "1")?;
    }
    for m in models {
        let c = &m.input.cost;
        let (on_the_way, memory_before) = match m.role {
            Role::Global => (before, largest(&passed_over.earlier)),
            _ => ([0.0; 2], 0.0),
        };
        let of = |what: &str| format!("cost.{}.{what}_seconds", m.name);
        host.measured(&of("wall"), c.wall_seconds + on_the_way[0], "s")?;
        host.measured(&of("cpu"), c.cpu_seconds + on_the_way[1], "s")?;
        let peak = c.peak_memory.max(memory_before);
        host.measured(&format!("peak_memory.{}", m.name), peak, "1")?;
        if matches!(m.role, Role::Global | Role::Local) {
            wall += c.wall_seconds;
            cpu += c.cpu_seconds;
            memory = memory.max(c.peak_memory);
        }
    }
    host.measured("cost.total.wall_seconds", wall, "s")?;
    host.measured("cost.total.cpu_seconds", cpu, "s")?;
    host.measured("peak_memory.total", memory, "1")?;
    // One that began late did a part of the process only: nothing is saved by that or against that, and its cost is not that of a whole.
    let global_late = passed_over.global_began_late(models);
    if let Some(time) = global_late {
        host.result("start_time.global", time, "s")?;
        host.result("start_time.total", time, "s")?;
    }
    for m in (models.iter()).filter(|m| matches!(m.role, Role::Other | Role::Reference)) {
        if let Some(time) = m.began_late {
            host.result(&format!("start_time.{}", m.name), time, "s")?;
        }
    }
    let reference = (models.iter()).find(|m| m.role == Role::Reference && m.began_late.is_none());
    if let Some(full) = reference
        .map(|m| m.input.cost.cpu_seconds)
        .filter(|&s| s > 0.0 && global_late.is_none())
    {
        host.measured("cost_saving", 1.0 - cpu / full, "1")?;
    }
    Ok(())
}
