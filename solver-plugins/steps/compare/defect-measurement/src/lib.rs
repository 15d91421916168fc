//! Step plugin `defect-measurement`: what a metrologist measures on a preform, on a simulated one and on a scan alike.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod agreement;
mod compression;
mod measured;
mod output;
mod parameters;
mod read;
mod region;
mod sections;
mod slip;
mod slipping;
mod symmetry;

use agreement::Agreement;
use measured::Measured;
use output::Output;
use parameters::{Parameters, Section};
use plyflow_defects::align::Alignment;
use plyflow_defects::of_run::neighbours;
use plyflow_defects::{Defect, Limits, Ply, Settings, find_causes, measure};
use plyflow_model::artifact::Sheet;
use plyflow_sdk::{Host, Log, Progress, Step, StepError, export_step};
use slipping::{Asked, Slipping};

/// The step.
pub struct DefectMeasurement;

export_step!(DefectMeasurement);

impl Step for DefectMeasurement {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let settings: Settings = host.parameters()?;
        let limits: Limits = host.parameters()?;
        let p: Parameters = host.parameters()?;
        let asked: Asked = host.parameters()?;
        region::check(&p.shear_regions)?;
        let corners = p.sections.iter().map(Section::corners);
        let sections = corners.collect::<Result<Vec<_>, _>>()?;
        phase(host, "reading", 0.0)?;
        let run = read::Run::read(host)?;
        if let Some(text) = limits.untold(run.plies.iter()) {
            host.log(Log::Info, &text);
        }
        let mut measured = of_run(host, &run, &settings, &limits)?;
        let (mut alignment, mut agreement) = (None, None);
        if p.scan.is_some() {
            phase(host, "scan", 0.6)?;
            let (scan, aligned, agrees) = of_scan(host, &run, &measured, &p, (&settings, &limits))?;
            measured.push(scan);
            (alignment, agreement) = (aligned, Some(agrees));
        }
        phase(host, "writing", 0.9)?;
        let beside = read::Beside::read(host)?;
        let slipping = Slipping::of(host, &measured, &asked)?;
        let mut output = Output::new(host, &run, &measured, agreement.as_ref());
        output.slipping = slipping;
        output.axis = asked.direction();
        output.bodies()?;
        output.compression(compression::of(&measured, p.compressed_below))?;
        output.regions(region::Regions::of(&measured, &p.shear_regions)?)?;
        output.distances()?;
        for (section, path) in p.sections.iter().zip(&sections) {
            output.section(&section.label, path, section.on, &beside)?;
        }
        output.agreement()?;
        output.finish(alignment.as_ref())
    }
}

fn phase(host: &Host, phase: &str, fraction: f64) -> Result<(), StepError> {
    host.progress(&Progress {
        phase,
        fraction,
        ..Default::default()
    });
    host.check_cancelled()
}

/// The plies of a run, with what was found on them.
fn of_run(
    host: &Host,
    run: &read::Run,
    settings: &Settings,
    limits: &Limits,
) -> Result<Vec<Measured>, StepError> {
    let mut plies = Vec::new();
    for (k, sheet) in run.plies.iter().enumerate() {
        let done = k as f64 / run.plies.len() as f64;
        phase(host, &sheet.name, 0.1 + 0.4 * done)?;
        plies.push(run.ply(host, sheet, settings.foot_margin)?);
    }
    phase(host, "plies", 0.5)?;
    // All are there first: a cause may lie in the next ply.
    let found = |(k, sheet): (usize, &Sheet)| {
        let mut defects = everywhere(&plies[k], settings);
        let others = neighbours(&run.plies, &plies, k);
        let limits = limits.of_ply(sheet.over_shear);
        find_causes(
            &plies[k],
            &mut defects,
            sheet.laid().as_ref(),
            &others,
            &limits,
        );
        defects
    };
    let found: Vec<Vec<Defect>> = run.plies.iter().enumerate().map(found).collect();
    let with = |(ply, defects)| Measured {
        ply,
        defects,
        simulated: true,
    };
    Ok(plies.into_iter().zip(found).map(with).collect())
}

/// A scan, with what was found on it, how it was aligned, and how well the ply that it shows agrees.
fn of_scan(
    host: &Host,
    run: &read::Run,
    measured: &[Measured],
    p: &Parameters,
    (settings, limits): (&Settings, &Limits),
) -> Result<(Measured, Option<Alignment>, Agreement), StepError> {
    let shown = run.shown(p.scan_ply.as_deref())?;
    let plies: Vec<&Ply> = measured.iter().map(|m| &m.ply).collect();
    let scan = read::Scan::read(host, run, (&plies, shown), p, settings.foot_margin)?;
    phase(host, "scan and ply", 0.8)?;
    let above = scan.offset - run.plies[shown].offset;
    let agreement = Agreement::of(plies[shown], &scan.ply, &run.tool, above, settings)?;
    if let Some(text) = agreement.partial() {
        host.log(Log::Warn, &text);
    }
    let mut defects = everywhere(&scan.ply, settings);
    find_causes(&scan.ply, &mut defects, None, &[], limits);
    let found = Measured {
        ply: scan.ply,
        defects,
        simulated: false,
    };
    Ok((found, scan.alignment, agreement))
}

fn everywhere(ply: &Ply, settings: &Settings) -> Vec<Defect> {
    measure(ply, &vec![true; ply.formed.len()], settings)
}
