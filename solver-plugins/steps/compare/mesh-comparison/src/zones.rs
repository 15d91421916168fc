//! Local runs of zones with meshes of different fineness: how far their distances from the tool are from those of the finest.

use crate::advice::{Advice, advise};
use crate::column::measured;
use plyflow_defects::{FieldErrors, Ply, of_run};
use plyflow_model::artifact::{Cell, Column, Forming, MeshStudy, Table, Zone, ZoneAdvice};
use plyflow_sdk::{Host, Input, Log, StepError};
use std::collections::BTreeMap;

/// Columns of the table without the fifth, which is of what was measured: label, SI unit.
const COLUMNS: [(&str, &str); 7] = [
    ("run", ""),
    ("zone", ""),
    ("element size", "m"),
    ("elements", ""),
    ("error", ""),
    ("error of position", "m"),
    ("advised size", "m"),
];

/// Distance from the tool (m) of which errors are told in parts where the finest run has less: of plies that lie on the tool every difference would be large.
const LEAST_DISTANCE: f64 = 5e-5;

/// A run of a zone.
struct Run {
    input: Input,
    zone: Zone,
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
        of_zones.push(host.attributes::<Forming>(input)?.zone.is_some());
    }
    if of_zones.windows(2).any(|w| w[0] != w[1]) {
        return Err("some of the runs are of zones and others of the whole scene; compare them in two steps".into());
    }
    Ok(of_zones.first() == Some(&true))
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
        if let Some(run) = read(host, input, foot_margin)? {
            let name = run.zone.name.clone();
            let runs = by_zone.entry((name.len(), name)).or_default();
            runs.push(run);
        }
    }
    let (mut rows, mut advised) = (Vec::new(), Vec::new());
    for ((_, zone), runs) in &mut by_zone {
        host.check_cancelled()?;
        runs.sort_by(|a, b| a.element_size.total_cmp(&b.element_size));
        let advice = one(host, zone, runs, target, &mut rows)?;
        advised.push(ZoneAdvice {
            name: zone.clone(),
            bounds: runs[0].zone.bounds,
            element_size: advice.size,
            finest_error: advice.finest_error,
        });
    }
    let mut columns = COLUMNS
        .map(|(label, unit)| Column::new(label, unit))
        .to_vec();
    columns.insert(4, measured("CPU", "cost.{0}.{1}.cpu_seconds"));
    host.write_attributes(&MeshStudy {
        target_error: target,
        zones: advised,
        tables: vec![Table {
            name: "meshes".into(),
            title: Some("Distances from the tool in zones over the element size".into()),
            columns,
            rows,
        }],
        ..MeshStudy::default()
    })
}

/// Whether the runs are of one box and the finest finer than the next.
fn comparable(zone: &str, runs: &[Run], finest: &Run, next: &Run) -> Result<(), StepError> {
    if let Some(other) = runs.iter().find(|r| !finest.zone.is(&r.zone)) {
        let (a, b) = (&finest.input.step, &other.input.step);
        return Err(format!(
            "zone {zone} of '{a}' has the box {:?}, that of '{b}' {:?}; take runs of one list of zones",
            finest.zone.bounds, other.zone.bounds
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
    Ok(())
}

/// The runs of one zone, the finest first; gives the advice for it.
fn one(
    host: &Host,
    zone: &str,
    runs: &[Run],
    target: f64,
    rows: &mut Vec<Vec<Cell>>,
) -> Result<Advice, StepError> {
    let [finest, next, ..] = runs else {
        return Err(format!(
            "zone {zone} has one run; a comparison needs two or more of different sizes"
        )
        .into());
    };
    comparable(zone, runs, finest, next)?;
    let mut measured = Vec::new();
    for run in runs {
        let found = FieldErrors::of(&[&run.plies], &[&finest.plies], |_, _| true);
        let scale = |e: &FieldErrors| Some(e.standing_off?.max(LEAST_DISTANCE));
        let told = found.and_then(|e| Some((e.position, e.distance? / scale(&e)?)));
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
        rows.push(vec![
            step.into(),
            zone.into(),
            run.element_size.into(),
            run.elements.into(),
            Cell::Empty,
            error.into(),
            position.into(),
            Cell::Empty,
        ]);
    }
    let advice = advise(&measured, target);
    host.result(&format!("finest_error.{zone}"), advice.finest_error, "1")?;
    host.result(&format!("advised_element_size.{zone}"), advice.size, "m")?;
    if let Some(text) = &advice.doubt {
        host.log(Log::Warn, &format!("zone {zone}: {text}"));
    }
    let mut row = vec![Cell::Empty; COLUMNS.len() + 1];
    row[1] = zone.into();
    row[COLUMNS.len()] = advice.size.into();
    rows.push(row);
    Ok(advice)
}

/// `None`: it is of the whole.
fn read(host: &Host, input: Input, foot_margin: f64) -> Result<Option<Run>, StepError> {
    let formed: Forming = host.attributes(&input)?;
    let Some(zone) = formed.zone.clone() else {
        return Ok(None);
    };
    let frame = of_run::last_frame(&input, &host.meshes(&input)?)?;
    let tool = of_run::tool(host, &input)?;
    let of = of_run::Frame {
        host,
        input: &input,
        frame,
    };
    let mut plies = Vec::new();
    for sheet in formed.plies() {
        let place = (sheet.name.as_str(), sheet.offset);
        plies.push(of_run::ply(of, place, &tool, foot_margin)?);
    }
    Ok(Some(Run {
        zone,
        plies,
        element_size: formed.element_size,
        elements: formed.elements,
        input,
    }))
}
