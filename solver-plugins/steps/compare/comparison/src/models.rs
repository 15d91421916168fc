//! Reading the models that are compared.

use plyflow_defects::{Ply, Settings, Tool, of_run};
use plyflow_geometry::rectangle;
use plyflow_model::artifact::{Forming, Rectangle, Role, Sheet, Zone, Zones, current_zones};
use plyflow_model::steering::Laid;
use plyflow_sdk::{Host, Input, Meshes, StepError};
use plyflow_surface::of_run::check_quads;
use std::collections::BTreeMap;

/// The zones that count, by name, and those in whose places they are ([`current_zones`]).
pub fn read_zones(host: &Host) -> Result<(Vec<Zone>, Vec<Zone>), StepError> {
    let mut all = Vec::new();
    for input in host.inputs_of("zones")? {
        all.extend(host.attributes::<Zones>(&input)?.zones);
    }
    Ok(current_zones(all))
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
    /// How many times slower than the scene says the process went on.
    pub slower: f64,
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
    /// Directions of the fibres of each flat ply, whose first axis is that of its membrane forces, where the run tells them, by its name.
    pub laid: BTreeMap<String, Laid>,
    /// Where it came from, for its cost.
    pub input: Input,
}

/// The box around a ply in the flat mesh of the global run (`[x0, y0, x1, y1]`, m); without end when that has no such ply.
pub fn bounds_in_whole(models: &[Model], ply: &str) -> Rectangle {
    let global = models.iter().find(|m| m.role == Role::Global);
    let found = global.and_then(|m| m.plies.iter().find(|p| p.name == ply));
    found.map_or(
        [-f64::INFINITY, -f64::INFINITY, f64::INFINITY, f64::INFINITY],
        bounds_of,
    )
}

/// The box around a ply in its flat mesh (`[x0, y0, x1, y1]`, m).
pub fn bounds_of(ply: &Ply) -> Rectangle {
    rectangle::around(ply.undeformed.iter().map(|p| [p[0], p[1]]))
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

    /// Counts what a run of an earlier pass took.
    fn add_earlier(
        &mut self,
        host: &Host,
        input: &Input,
        formed: &Forming,
    ) -> Result<(), StepError> {
        self.earlier_cycles += cycles(formed);
        self.earlier_from_start |= is_from_start(host, input, formed)?;
        Ok(())
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
    let mut passed_over = PassedOver::default();
    let mut earlier = host.inputs_of("global")?;
    let global = earlier.pop().ok_or("global: no run arrives")?;
    for input in &earlier {
        passed_over.add_earlier(host, input, &host.attributes(input)?)?;
    }
    passed_over.earlier_coarse = earlier.len();
    passed_over.earlier = earlier;
    let passes = 1 + passed_over.earlier.len();
    let tool = of_run::tool(host, &global)?;
    let mut models = vec![read(host, global, Role::Global, None, &tool, settings)?];
    let mut local: Vec<Model> = Vec::new();
    let mut runs_of = vec![0; zones.len()];
    for input in host.inputs_of("local")? {
        host.check_cancelled()?;
        let Some(zone) = zone_of(host, &input, zones, superseded)? else {
            passed_over.superseded_cycles += cycles(&host.attributes(&input)?);
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
        let formed: Forming = host.attributes(&input)?;
        passed_over.earlier_coarse += usize::from(formed.zone.is_none());
        passed_over.add_earlier(host, &input, &formed)?;
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

/// Cells times cycles of a run, as far as it tells them.
fn cycles(formed: &Forming) -> f64 {
    formed.element_cycles.unwrap_or_default()
}

/// When a run began, if that was late (s).
fn began_late(meshes: &Meshes) -> Option<f64> {
    let first = meshes.times.first().copied();
    first.filter(|&t| meshes.times.len() > 1 && t > 0.0)
}

/// Whether a run is one of the whole from the beginning of the process.
fn is_from_start(host: &Host, input: &Input, formed: &Forming) -> Result<bool, StepError> {
    Ok(formed.zone.is_none() && began_late(&host.meshes(input)?).is_none())
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
    let formed: Forming = host.attributes(input)?;
    let named = formed.zone.as_ref();
    let index = match named {
        Some(own) => zones.iter().position(|z| z.is(own)),
        None => match input.item[..] {
            [i] => Some(i as usize).filter(|&i| i < zones.len()),
            // Which of several places is that of the zone the run would have to tell.
            _ => None,
        },
    };
    if index.is_none() && named.is_some_and(|own| superseded.iter().any(|z| z.is(own))) {
        return Ok(None);
    }
    index.map(Some).ok_or_else(|| {
        let names: Vec<&str> = zones.iter().map(|z| z.name.as_str()).collect();
        let what = named.map_or(
            "names no zone (attribute `zone`), and its item is no place in a fan-out over the zones alone".to_owned(),
            |own| format!("is of zone '{}' (or of a box that no zone of that name has)", own.name),
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
    let formed: Forming = host.attributes(&input)?;
    let meshes = host.meshes(&input)?;
    let frame = of_run::last_frame(&input, &meshes)?;
    let mut plies = Vec::new();
    let sheets: Vec<Sheet> = formed.plies().cloned().collect();
    for sheet in &sheets {
        let body = meshes.body(&sheet.name)?;
        check_quads(&format!("ply '{}' of '{}'", sheet.name, input.step), body)?;
        let margin = settings.foot_margin;
        let of = of_run::Frame {
            host,
            input: &input,
            frame,
        };
        plies.push(of_run::strained_ply(of, sheet, tool, margin)?);
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
        slower: formed.slower.unwrap_or(1.0),
        elements: meshes
            .bodies
            .iter()
            .filter(|b| b.name != "tool")
            .map(|b| b.cells)
            .sum(),
        element_cycles: cycles(&formed),
        began_late: began_late(&meshes),
        laid: (formed.sheets.iter())
            .filter_map(|s| Some((s.name.clone(), s.laid()?)))
            .collect(),
        plies,
        sheets,
        input,
    })
}
