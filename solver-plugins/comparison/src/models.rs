//! Reading the models that are compared.

use plyflow_defects::of_run::{self, Sheet};
use plyflow_defects::{Ply, Settings, Tool};
use plyflow_model::scene::first_axis;
use plyflow_sdk::{Host, Input, Meshes, StepError};
use plyflow_surface::flat_bounds;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// Places on the side of a zone lie in it, however they were rounded (m).
const ROUNDING: f64 = 1e-6;

/// A zone, as its step wrote it.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Zone {
    /// A, B, ..
    pub name: String,
    /// `[x0, y0, x1, y1]` (m).
    #[serde(rename = "box")]
    pub bounds: [f64; 4],
    /// Left, right, bottom, top.
    pub free_sides: [bool; 4],
    /// Zones that it takes the place of.
    #[serde(default)]
    pub replaces: Vec<String>,
}

impl Zone {
    /// Whether a place of the flat ply (m) lies in it or on its sides.
    pub fn holds(&self, at: &[f64]) -> bool {
        let [low, high] = [&self.bounds[..2], &self.bounds[2..]];
        (0..2).all(|d| at[d] > low[d] - ROUNDING && at[d] < high[d] + ROUNDING)
    }

    /// Left, right, bottom, top: whether a ply that fills `whole` (`[x0, y0, x1, y1]`, m) in the whole and `own` in the zone's run is cut there. Not so
    /// at a free side, nor where the ply ends at the side or inside of it, nor where the zone's mesh, which goes on to the next line, has come to the ply's end:
    /// that is its own edge.
    pub fn cuts(&self, whole: [f64; 4], own: [f64; 4]) -> [bool; 4] {
        [0, 1, 2, 3].map(|side| {
            let k = side / 2 + 2 * (side % 2);
            let outward = if side % 2 == 0 { -1.0 } else { 1.0 };
            let goes_on = |from: f64| outward * (whole[k] - from) > ROUNDING;
            !self.free_sides[side] && goes_on(self.bounds[k]) && goes_on(own[k])
        })
    }

    fn area(&self) -> f64 {
        let [x0, y0, x1, y1] = self.bounds;
        (x1 - x0) * (y1 - y0)
    }

    /// Whether an attribute `zone` is this one: of its name and, if it tells one, its box.
    fn is(&self, told: &Value) -> bool {
        let bounds: Option<[f64; 4]> = serde_json::from_value(told["box"].clone()).ok();
        let near = |b: [f64; 4]| b.iter().zip(self.bounds).all(|(a, b)| (a - b).abs() < 1e-9);
        told["name"] == self.name.as_str() && bounds.is_none_or(near)
    }
}

/// The zones that count, by name, and those in whose places they are: of one name the largest counts, and none that
/// another one replaces.
pub fn read_zones(host: &Host) -> Result<(Vec<Zone>, Vec<Zone>), StepError> {
    let mut all = Vec::new();
    for input in host.inputs_of("zones")? {
        let attributes: Value = host.attributes(&input)?;
        let zones: Vec<Zone> = serde_json::from_value(attributes["zones"].clone())
            .map_err(|e| format!("attribute `zones` of '{}': {e}", input.step))?;
        all.extend(zones);
    }
    let replaced: Vec<String> = all.iter().flat_map(|z| z.replaces.clone()).collect();
    // One name after the other, the largest first; A to Z before AA.
    all.sort_by(|a, b| {
        let by_name = (a.name.len(), &a.name).cmp(&(b.name.len(), &b.name));
        by_name.then(b.area().total_cmp(&a.area()))
    });
    let (mut current, mut superseded) = (Vec::<Zone>::new(), Vec::new());
    for zone in all {
        let taken = current.last().is_some_and(|z| z.name == zone.name);
        if taken || replaced.contains(&zone.name) {
            superseded.push(zone);
        } else {
            current.push(zone);
        }
    }
    Ok((current, superseded))
}

/// Which part a model plays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Coarse run of the whole scene.
    Global,
    /// Fine run of a zone.
    Local,
    /// Another run of the whole scene.
    Other,
    /// Fine run of the whole scene.
    Reference,
}

/// A formed model.
#[derive(Debug, Clone)]
pub struct Model {
    /// `global`, `local.A`, `other.drape`, `reference`.
    pub name: String,
    /// Its part.
    pub role: Role,
    /// Local models: index of the zone.
    pub zone: Option<usize>,
    /// (m).
    pub element_size: f64,
    /// Cells of all sheets.
    pub elements: usize,
    /// Cells times cycles, over all sheets.
    pub element_cycles: f64,
    /// Time of its first frame, of several, if that is not 0: it began late (s).
    pub began_late: Option<f64>,
    /// Plies in the order of the stack.
    pub plies: Vec<Ply>,
    /// As many: what the run tells of them.
    pub sheets: Vec<Sheet>,
    /// Direction of the first fibres of each ply that tells it, in the flat ply (rad), by its name.
    pub axes: BTreeMap<String, f64>,
    /// Where it came from, for its cost.
    pub input: Input,
}

/// The box around a ply in the flat mesh of the global run (`[x0, y0, x1, y1]`, m); without end when that has no such ply.
pub fn bounds_in_whole(models: &[Model], ply: &str) -> [f64; 4] {
    let global = models.iter().find(|m| m.role == Role::Global);
    let found = global.and_then(|m| m.plies.iter().find(|p| p.name == ply));
    found.map_or(
        [-f64::INFINITY, -f64::INFINITY, f64::INFINITY, f64::INFINITY],
        bounds_of,
    )
}

/// The box around a ply in its flat mesh (`[x0, y0, x1, y1]`, m).
pub fn bounds_of(ply: &Ply) -> [f64; 4] {
    flat_bounds(ply.undeformed.iter().map(|p| [p[0], p[1]]))
}

#[derive(Deserialize)]
struct Formed {
    sheets: Vec<Sheet>,
    #[serde(default)]
    element_size: f64,
    #[serde(default)]
    element_cycles: f64,
    #[serde(default)]
    zone: Value,
}

/// Runs that are not measured, and cost.
#[derive(Debug, Clone, Default)]
pub struct PassedOver {
    /// Local runs of zones that were drawn again.
    pub superseded: Vec<Input>,
    /// Coarse and fine runs of earlier passes, on which the global run stands.
    pub earlier: Vec<Input>,
    /// How many of the latter are coarse.
    pub earlier_coarse: usize,
    /// Whether one of them is a run of the whole from the beginning of the process.
    pub earlier_from_start: bool,
    /// Cells times cycles of the superseded.
    pub superseded_cycles: f64,
    /// Cells times cycles of the earlier.
    pub earlier_cycles: f64,
}

impl PassedOver {
    /// When the process that the global run tells began for what is in its cost, if that was late (s): what it began from is in it where a
    /// run of the whole from the beginning is among the earlier ones.
    pub fn global_began_late(&self, models: &[Model]) -> Option<f64> {
        let global = models.iter().find(|m| m.role == Role::Global)?;
        global.began_late.filter(|_| !self.earlier_from_start)
    }

    /// All of them.
    pub fn all(&self) -> impl Iterator<Item = &Input> {
        self.superseded.iter().chain(&self.earlier)
    }
}

/// Global, local, other and reference models in that order, local ones in the order of their zones; and what was run on the way to them and is
/// not measured: local runs of zones that are `superseded`, and `earlier` passes. Of several global runs, and of several local runs of one zone, the
/// last is that of the last pass.
///
/// # Errors
/// When an input lacks something, or a local run belongs to no zone or to one that another run of the same pass has.
pub fn read_models(
    host: &Host,
    zones: &[Zone],
    superseded: &[Zone],
    settings: &Settings,
) -> Result<(Vec<Model>, PassedOver), StepError> {
    let mut passed_over = PassedOver {
        earlier: host.inputs_of("global")?,
        ..Default::default()
    };
    let global = passed_over.earlier.pop();
    let global = global.ok_or("global: no run arrives")?;
    passed_over.earlier_coarse = passed_over.earlier.len();
    for input in &passed_over.earlier {
        let formed: Formed = host.attributes(input)?;
        passed_over.earlier_cycles += formed.element_cycles;
        passed_over.earlier_from_start |= is_from_start(host, input, &formed)?;
    }
    let passes = 1 + passed_over.earlier.len();
    let tool = of_run::tool(host, &global)?;
    let mut models = vec![read(host, global, Role::Global, None, &tool, settings)?];
    let mut local: Vec<Model> = Vec::new();
    let mut runs_of = vec![0; zones.len()];
    for input in host.inputs_of("local")? {
        host.check_cancelled()?;
        let Some(zone) = zone_of(host, &input, zones, superseded)? else {
            passed_over.superseded_cycles += host.attributes::<Formed>(&input)?.element_cycles;
            passed_over.superseded.push(input);
            continue;
        };
        runs_of[zone] += 1;
        if let Some(k) = local.iter().position(|m| m.zone == Some(zone)) {
            if runs_of[zone] > passes || local[k].input.step == input.step {
                return Err(same_pass(&local[k].input, &input, &zones[zone].name, passes).into());
            }
            let before = local.remove(k);
            passed_over.earlier_cycles += before.element_cycles;
            passed_over.earlier.push(before.input);
        }
        let own = own_tool(host, &input)?;
        local.push(read(
            host,
            input,
            Role::Local,
            Some((zone, &zones[zone])),
            own.as_ref().unwrap_or(&tool),
            settings,
        )?);
    }
    local.sort_by_key(|m| m.zone);
    models.extend(local);
    models.extend(read_wholes(host, &tool, settings)?);
    for input in host.inputs_of("earlier")? {
        let formed: Formed = host.attributes(&input)?;
        passed_over.earlier_coarse += usize::from(formed.zone.is_null());
        passed_over.earlier_cycles += formed.element_cycles;
        passed_over.earlier_from_start |= is_from_start(host, &input, &formed)?;
        passed_over.earlier.push(input);
    }
    Ok((models, passed_over))
}

/// Why two runs of one zone are not of two passes. A pass is a step of its own, and has a global run.
fn same_pass(first: &Input, second: &Input, zone: &str, passes: usize) -> String {
    let [a, b] = [first, second].map(|i| format!("'{}' {:?}", i.step, i.item));
    let step = &second.step;
    let why = if first.step == *step {
        format!(
            "each item of '{step}' must be of another zone: fan it, and its boundary-interpolation, out over the zones"
        )
    } else {
        format!(
            "there are {passes} global runs, and a second run of a zone must be of a later pass, with one of its own: give runs that are not to be measured as `earlier`"
        )
    };
    format!("local: two local runs belong to zone {zone}, {a} and {b}; {why}")
}

/// When a run began, if that was late (s).
fn began_late(meshes: &Meshes) -> Option<f64> {
    let first = meshes.times.first().copied();
    first.filter(|&t| meshes.times.len() > 1 && t > 0.0)
}

/// Whether a run is one of the whole from the beginning of the process.
fn is_from_start(host: &Host, input: &Input, formed: &Formed) -> Result<bool, StepError> {
    Ok(formed.zone.is_null() && began_late(&host.meshes(input)?).is_none())
}

/// Others and the reference, in that order, with their own tools or the global run's.
fn read_wholes(host: &Host, tool: &Tool, settings: &Settings) -> Result<Vec<Model>, StepError> {
    let mut models = Vec::new();
    for (port, role) in [("others", Role::Other), ("reference", Role::Reference)] {
        let inputs = host.inputs_of(port)?;
        // A fan-out over one zone, the whole blank, may be the reference.
        if role == Role::Reference && inputs.len() > 1 {
            let steps: Vec<&str> = inputs.iter().map(|i| i.step.as_str()).collect();
            return Err(format!(
                "reference: given {} runs ({}); expected one, of the whole scene",
                inputs.len(),
                steps.join(", ")
            )
            .into());
        }
        for input in inputs {
            host.check_cancelled()?;
            let own = own_tool(host, &input)?;
            let tool = own.as_ref().unwrap_or(tool);
            models.push(read(host, input, role, None, tool, settings)?);
        }
    }
    Ok(models)
}

/// The tool that a run has with it. A run of a zone may leave it out; it is the global one's.
fn own_tool(host: &Host, input: &Input) -> Result<Option<Tool>, StepError> {
    match host.meshes(input)?.body("tool") {
        Ok(_) => Ok(Some(of_run::tool(host, input)?)),
        Err(_) => Ok(None),
    }
}

/// The zone that a local run names, or else the one at its place in a fan-out over the zones alone; `None` for a superseded one.
fn zone_of(
    host: &Host,
    input: &Input,
    zones: &[Zone],
    superseded: &[Zone],
) -> Result<Option<usize>, StepError> {
    let formed: Formed = host.attributes(input)?;
    let named = formed.zone["name"].as_str();
    let index = match named {
        Some(_) => zones.iter().position(|z| z.is(&formed.zone)),
        None => match input.item[..] {
            [i] => Some(i as usize).filter(|&i| i < zones.len()),
            // Which of several places is that of the zone the run would have to tell.
            _ => None,
        },
    };
    if index.is_none() && superseded.iter().any(|z| z.is(&formed.zone)) {
        return Ok(None);
    }
    index.map(Some).ok_or_else(|| {
        let names: Vec<&str> = zones.iter().map(|z| z.name.as_str()).collect();
        let what = named.map_or(
            "names no zone (attribute `zone`), and its item is no place in a fan-out over the zones alone".to_owned(),
            |n| format!("is of zone '{n}' (or of a box that no zone of that name has)"),
        );
        format!(
            "local run '{}' {:?} {what}; the zones are: {}",
            input.step,
            input.item,
            names.join(", ")
        )
        .into()
    })
}

fn read(
    host: &Host,
    input: Input,
    role: Role,
    zone: Option<(usize, &Zone)>,
    tool: &Tool,
    settings: &Settings,
) -> Result<Model, StepError> {
    let formed: Formed = host.attributes(&input)?;
    let meshes = host.meshes(&input)?;
    let frame = of_run::last_frame(&input, &meshes)?;
    let mut plies = Vec::new();
    let sheets: Vec<Sheet> = (formed.sheets.iter())
        .filter(|s| s.is_ply())
        .cloned()
        .collect();
    for sheet in &sheets {
        let body = meshes.body(&sheet.name)?;
        if body.nodes_per_cell != 4 {
            let (ply, n) = (&sheet.name, body.nodes_per_cell);
            let what = format!(
                "ply '{ply}' of '{}' has cells of {n} nodes; quads are expected",
                input.step
            );
            return Err(what.into());
        }
        let margin = settings.foot_margin;
        plies.push(of_run::strained_ply(
            host, &input, frame, sheet, tool, margin,
        )?);
    }
    let name = match (role, zone) {
        (Role::Local, Some((_, zone))) => format!("local.{}", zone.name),
        (Role::Reference, _) => "reference".to_owned(),
        (Role::Other, _) => {
            let item = input.item.iter().map(|i| format!("_{i}"));
            format!("other.{}{}", input.step, item.collect::<String>())
        }
        _ => "global".to_owned(),
    };
    Ok(Model {
        name,
        role,
        zone: zone.map(|(i, _)| i),
        element_size: formed.element_size,
        elements: meshes
            .bodies
            .iter()
            .filter(|b| b.name != "tool")
            .map(|b| b.cells)
            .sum(),
        element_cycles: formed.element_cycles,
        began_late: began_late(&meshes),
        axes: (formed.sheets.iter())
            .filter_map(|s| Some((s.name.clone(), first_axis(s.fibre_1?, s.fibre_2?))))
            .collect(),
        plies,
        sheets,
        input,
    })
}
