//! Step plugin `census-comparison`: the wrinkle censuses of several runs side by side.
//!
//! A step of its own and no part of `comparison`: that one sets local runs against a global one, zone by zone and defect by
//! defect; here whole runs of one part stand beside each other, and what is asked is how a census changes with the material.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod against;
mod output;
mod run;
mod table;

pub use against::relative_distance;
pub use run::{Choice, Run};
pub use table::{never_falls, never_rises};

use plyflow_model::artifact;
use plyflow_sdk::{Host, Step, StepError, export_step};
use serde::Deserialize;

/// The step.
pub struct CensusComparison;

export_step!(CensusComparison);

#[derive(Deserialize)]
struct Parameters {
    runs: Vec<Choice>,
    /// The step of the run that the others are held against.
    reference: Option<String>,
}

impl Step for CensusComparison {
    const MANIFEST: &'static str = include_str!("../manifest.json");

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let runs = run::read(host, &p.runs)?;
        let mut plots = output::overlaid(host, &runs)?;
        let (densities, maps) = output::fields(host, &runs)?;
        plots.extend(densities);
        let table = table::table(&runs);
        host.write_attributes(&artifact::CensusComparison {
            runs: table::list(&runs),
            tables: vec![table],
            plots,
            maps,
        })?;
        table::results(host, &runs)?;
        p.reference
            .map_or(Ok(()), |r| against::results(host, &runs, &r))
    }
}
