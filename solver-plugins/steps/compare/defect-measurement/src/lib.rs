//! Step plugin `defect-measurement`: what a metrologist measures on a preform, on a simulated one and on a scan alike.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod agreement;
mod compression;
mod output;
mod read;
mod region;
mod sections;
mod slip;
mod slipping;
mod symmetry;

use agreement::Agreement;
use output::Output;
use plyflow_defects::of_run::neighbours;
use plyflow_defects::{Defect, Limits, Ply, Settings, find_causes, measure};
use plyflow_model::artifact::{Column, SectionOn, Sheet};
use plyflow_sdk::{Host, Log, Progress, Step, StepError, export_step};
use serde::Deserialize;
use slipping::{Asked, Slipping};

/// The step.
pub struct DefectMeasurement;

export_step!(DefectMeasurement);

/// What the manifest has beside [`Settings`] and [`Limits`].
#[derive(Deserialize)]
struct Parameters {
    compressed_below: f64,
    sections: Vec<Section>,
    shear_regions: Vec<region::Asked>,
    scan: Option<String>,
    scan_unit: Option<f64>,
    scan_offset: Option<f64>,
    scan_align: Align,
    scan_kept: f64,
    scan_ply: Option<String>,
}

#[derive(Deserialize)]
struct Section {
    label: String,
    /// `[x, y]` (m).
    from: Option<Vec<f64>>,
    /// `[x, y]` (m).
    to: Option<Vec<f64>>,
    /// `[x, y]` (m) each, instead of both ends.
    path: Option<Vec<Vec<f64>>>,
    #[serde(default)]
    on: SectionOn,
}

impl Section {
    /// The corners of its path (m).
    fn corners(&self) -> Result<Vec<[f64; 2]>, StepError> {
        let given = match (&self.path, &self.from, &self.to) {
            (Some(path), None, None) => path.clone(),
            (None, Some(from), Some(to)) => vec![from.clone(), to.clone()],
            _ => {
                let what = "either both ends, `from` and `to`, or a `path`";
                return Err(format!("sections: '{}': expected {what}", self.label).into());
            }
        };
        let place = |p: &Vec<f64>| <[f64; 2]>::try_from(&p[..]).ok();
        let corners: Option<Vec<[f64; 2]>> = given.iter().map(place).collect();
        let moves = |c: &Vec<[f64; 2]>| c.windows(2).any(|w| w[0] != w[1]);
        corners.filter(moves).ok_or_else(|| {
            format!(
                "sections: '{}' goes along {given:?} m; expected two or more different places [x, y]",
                self.label
            )
            .into()
        })
    }
}

#[derive(Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case")]
enum Align {
    ClosestPoints,
    None,
}

/// A ply or a scan, with what was found on it.
struct Measured {
    ply: Ply,
    defects: Vec<Defect>,
    /// Whether it is a ply of the run.
    simulated: bool,
}

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
        let phase = |phase, fraction| {
            host.progress(&Progress {
                phase,
                fraction,
                ..Default::default()
            });
            host.check_cancelled()
        };
        phase("reading", 0.0)?;
        let run = read::Run::read(host)?;
        let mut plies = Vec::new();
        for (k, sheet) in run.plies.iter().enumerate() {
            phase(&sheet.name, 0.1 + 0.4 * k as f64 / run.plies.len() as f64)?;
            plies.push(run.ply(host, sheet, settings.foot_margin)?);
        }
        phase("plies", 0.5)?;
        // All are there first: a cause may lie in the next ply.
        let found = |(k, sheet): (usize, &Sheet)| {
            let mut defects = everywhere(&plies[k], &settings);
            let others = neighbours(&run.plies, &plies, k);
            find_causes(&plies[k], &mut defects, sheet.fibres(), &others, &limits);
            defects
        };
        let found: Vec<Vec<Defect>> = run.plies.iter().enumerate().map(found).collect();
        let with = |(ply, defects)| Measured {
            ply,
            defects,
            simulated: true,
        };
        let mut measured: Vec<Measured> = plies.into_iter().zip(found).map(with).collect();
        let (mut alignment, mut agreement) = (None, None);
        if p.scan.is_some() {
            phase("scan", 0.6)?;
            let shown = run.shown(p.scan_ply.as_deref())?;
            let plies: Vec<&Ply> = measured.iter().map(|m| &m.ply).collect();
            let scan = read::Scan::read(host, &run, (&plies, shown), &p, settings.foot_margin)?;
            phase("scan and ply", 0.8)?;
            let above = scan.offset - run.plies[shown].offset;
            let ply = &measured[shown].ply;
            let found = Agreement::of(ply, &scan.ply, &run.tool, above, &settings)?;
            if let Some(text) = found.partial() {
                host.log(Log::Warn, &text);
            }
            agreement = Some(found);
            let mut defects = everywhere(&scan.ply, &settings);
            find_causes(&scan.ply, &mut defects, None, &[], &limits);
            measured.push(Measured {
                ply: scan.ply,
                defects,
                simulated: false,
            });
            alignment = scan.alignment;
        }
        phase("writing", 0.9)?;
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

fn everywhere(ply: &Ply, settings: &Settings) -> Vec<Defect> {
    measure(ply, &vec![true; ply.formed.len()], settings)
}

/// Columns of a table: label, SI unit.
fn columns(of: &[(&str, &str)]) -> Vec<Column> {
    let column = |(label, unit): &(&str, &str)| Column::new(*label, *unit);
    of.iter().map(column).collect()
}

/// Names are parts of results' names, and what they name is told apart by them.
fn check_names<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), StepError> {
    let mut seen: Vec<&str> = Vec::new();
    for (k, name) in names.enumerate() {
        let begins = name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        let goes_on = |c: char| c.is_ascii_alphanumeric() || "_-".contains(c);
        if !begins || !name.chars().all(goes_on) {
            return Err(format!(
                "{what}[{k}].name: '{name}' cannot be a part of a result's name; expected letters, digits, _ and -, the first a letter, such as A-A"
            )
            .into());
        }
        if seen.contains(&name) {
            return Err(format!(
                "{what}[{k}].name: there is another one '{name}'; give each a name of its own"
            )
            .into());
        }
        seen.push(name);
    }
    Ok(())
}
