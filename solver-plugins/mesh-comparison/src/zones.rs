//! Local runs of zones with meshes of different fineness: how far their distances from the tool are from those of the finest.

use crate::Formed;
use crate::advice::{Advice, advise};
use plyflow_defects::{FieldErrors, Ply, of_run};
use plyflow_sdk::{Host, Input, Log, StepError};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// A run of a zone.
struct Run {
    input: Input,
    /// The zone's box in the undeformed plane, as its list has it.
    bounds: Value,
    element_size: f64,
    elements: u64,
    plies: Vec<Ply>,
}

/// Whether the runs are of zones.
///
/// # Errors
/// When some are and others are of the whole.
pub fn given(host: &Host, inputs: &[Input]) -> Result<bool, StepError> {
    let mut of_zones = Vec::new();
    for input in inputs {
        of_zones.push(zone_of(host, input)?.is_some());
    }
    if of_zones.windows(2).any(|w| w[0] != w[1]) {
        return Err("some of the runs are of zones and others of the whole scene; compare them in two steps".into());
    }
    Ok(of_zones.first() == Some(&true))
}

fn zone_of(host: &Host, input: &Input) -> Result<Option<String>, StepError> {
    let formed: Formed = host.attributes(input)?;
    Ok(formed.zone["name"].as_str().map(str::to_owned))
}

/// Compares the runs of every zone and advises an element size for each. `target`: the relative error that it is for. `foot_margin`: nodes nearer to the
/// tool's foot are not judged (m), they hang between tool and machine bed.
///
/// # Errors
/// When a zone has fewer than two sizes or not one box, or a run cannot be read.
pub fn compare(
    host: &Host,
    inputs: Vec<Input>,
    target: f64,
    foot_margin: f64,
) -> Result<(), StepError> {
    let mut by_zone: BTreeMap<(usize, String), Vec<Run>> = BTreeMap::new();
    for input in inputs {
        host.check_cancelled()?;
        // A to Z before AA.
        if let Some(zone) = zone_of(host, &input)? {
            let runs = by_zone.entry((zone.len(), zone)).or_default();
            runs.push(read(host, input, foot_margin)?);
        }
    }
    let (mut rows, mut advised) = (Vec::new(), Vec::new());
    for ((_, zone), runs) in &mut by_zone {
        host.check_cancelled()?;
        runs.sort_by(|a, b| a.element_size.total_cmp(&b.element_size));
        let advice = one(host, zone, runs, target, &mut rows)?;
        advised.push(
            json!({"name": zone, "box": runs[0].bounds, "element_size": advice.size,
            "finest_error": advice.finest_error}),
        );
    }
    let head = [
        ("run", ""),
        ("zone", ""),
        ("element size", "m"),
        ("elements", ""),
        ("error", ""),
        ("error of position", "m"),
        ("advised size", "m"),
    ];
    let mut columns = head
        .map(|(label, unit)| json!({"label": label, "unit": unit}))
        .to_vec();
    columns.insert(
        4,
        json!({"label": "CPU", "unit": "s", "measured": "cost.{0}.{1}.cpu_seconds"}),
    );
    host.write_attributes(&json!({
        "target_error": target,
        "zones": advised,
        "tables": [{"name": "meshes", "title": "Distances from the tool in zones over the element size", "columns": columns, "rows": rows}],
    }))
}

/// The runs of one zone, the finest first; gives the advice for it.
fn one(
    host: &Host,
    zone: &str,
    runs: &[Run],
    target: f64,
    rows: &mut Vec<Value>,
) -> Result<Advice, StepError> {
    let [finest, next, ..] = runs else {
        return Err(format!(
            "zone {zone} has one run; a comparison needs two or more of different sizes"
        )
        .into());
    };
    if let Some(other) = runs.iter().find(|r| r.bounds != finest.bounds) {
        let (a, b) = (&finest.input.step, &other.input.step);
        return Err(format!(
            "zone {zone} of '{a}' has the box {}, that of '{b}' {}; take runs of one list of zones",
            finest.bounds, other.bounds
        )
        .into());
    }
    if next.element_size == finest.element_size {
        let (a, b) = (&finest.input.step, &next.input.step);
        let mm = 1e3 * finest.element_size;
        return Err(format!(
            "'{a}' and '{b}' are both the finest of zone {zone}, with {mm} mm; leave one out"
        )
        .into());
    }
    let mut measured = Vec::new();
    for run in runs {
        let found = FieldErrors::of(&[&run.plies], &[&finest.plies], |_, _| true);
        let told = found.and_then(|e| Some((e.position, e.distance? / e.standing_off?)));
        let Some((position, error)) = told.filter(|t| t.1.is_finite()) else {
            let step = &run.input.step;
            return Err(format!(
                "'{step}' of zone {zone} lies nowhere where '{}' stands off the tool, as far as both are judged (`foot_margin`)",
                finest.input.step
            )
            .into());
        };
        let step = &run.input.step;
        host.result(&format!("zone_error.{step}.{zone}"), error, "1")?;
        measured.push((run.element_size, error));
        for (what, seconds) in [
            ("cpu_seconds", run.input.cost.cpu_seconds),
            ("wall_seconds", run.input.cost.wall_seconds),
        ] {
            host.measured(&format!("cost.{step}.{zone}.{what}"), seconds, "s")?;
        }
        let elements = run.elements;
        rows.push(json!([
            step,
            zone,
            run.element_size,
            elements,
            null,
            error,
            position,
            null
        ]));
    }
    let advice = advise(&measured, target);
    host.result(&format!("finest_error.{zone}"), advice.finest_error, "1")?;
    host.result(&format!("advised_element_size.{zone}"), advice.size, "m")?;
    if let Some(text) = &advice.doubt {
        host.log(Log::Warn, &format!("zone {zone}: {text}"));
    }
    rows.push(json!([
        null,
        zone,
        null,
        null,
        null,
        null,
        null,
        advice.size
    ]));
    Ok(advice)
}

fn read(host: &Host, input: Input, foot_margin: f64) -> Result<Run, StepError> {
    let formed: Formed = host.attributes(&input)?;
    let frame = of_run::last_frame(&input, &host.meshes(&input)?)?;
    let tool = of_run::tool(host, &input)?;
    let mut plies = Vec::new();
    for sheet in formed.sheets.iter().filter(|s| s.kind == "ply") {
        let (name, step) = (sheet.name.as_str(), &input.step);
        let offset = sheet.offset;
        let offset = offset
            .ok_or_else(|| format!("ply '{name}' of '{step}' has no offset from the tool"))?;
        let place = (name, offset);
        plies.push(of_run::ply(host, &input, frame, place, &tool, foot_margin)?);
    }
    Ok(Run {
        plies,
        bounds: formed.zone["box"].clone(),
        element_size: formed.element_size,
        elements: formed.elements,
        input,
    })
}
