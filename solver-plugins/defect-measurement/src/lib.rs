//! Step plugin `defect-measurement`: what a metrologist measures on a preform, on a simulated one and on a scan alike.

mod output;
mod read;

use output::Output;
use plyflow_defects::of_run::neighbours;
use plyflow_defects::{Defect, Limits, Ply, Settings, find_causes, measure};
use plyflow_sdk::{Host, Progress, Step, StepError, export_step};
use serde::Deserialize;

/// The step.
pub struct DefectMeasurement;

export_step!(DefectMeasurement);

/// What the manifest has beside [`Settings`] and [`Limits`].
#[derive(Deserialize)]
struct Parameters {
    sections: Vec<Section>,
    scan: Option<String>,
    scan_unit: f64,
    scan_offset: Option<f64>,
    scan_align: Align,
    scan_kept: f64,
}

#[derive(Deserialize)]
struct Section {
    label: String,
    /// `[x, y]` (m).
    from: Vec<f64>,
    /// `[x, y]` (m).
    to: Vec<f64>,
}

impl Section {
    /// Both ends (m).
    fn ends(&self) -> Result<[[f64; 2]; 2], StepError> {
        match (&self.from[..], &self.to[..]) {
            (&[a, b], &[c, d]) if (a, b) != (c, d) => Ok([[a, b], [c, d]]),
            _ => Err(format!(
                "sections: '{}' goes from {:?} to {:?} m; expected two different places [x, y]",
                self.label, self.from, self.to
            )
            .into()),
        }
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
        let sections: Vec<_> = p
            .sections
            .iter()
            .map(Section::ends)
            .collect::<Result<_, _>>()?;
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
        let mut measured = Vec::new();
        for (k, sheet) in run.plies.iter().enumerate() {
            phase(&sheet.name, 0.1 + 0.5 * k as f64 / run.plies.len() as f64)?;
            let ply = run.ply(host, sheet, settings.foot_margin)?;
            let mut defects = everywhere(&ply, &settings);
            let others = neighbours(&run.plies, k);
            find_causes(&ply, &mut defects, sheet.fibres(), &others, &limits);
            measured.push(Measured {
                ply,
                defects,
                simulated: true,
            });
        }
        let mut alignment = None;
        if let Some(path) = &p.scan {
            phase("scan", 0.6)?;
            let scan = read::Scan::read(&run, path, &p, settings.foot_margin)?;
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
        let mut output = Output::new(host, &run, &measured);
        output.bodies()?;
        output.distances()?;
        for (section, [from, to]) in p.sections.iter().zip(sections) {
            output.section(&section.label, from, to)?;
        }
        output.finish(alignment.as_ref())
    }
}

fn everywhere(ply: &Ply, settings: &Settings) -> Vec<Defect> {
    measure(ply, &vec![true; ply.formed.len()], settings)
}
