//! Formed plies as files of other programs.
//!
//! [`export`] reads one artifact and nothing else. At one frame it computes for each ply what its flat and its formed mesh tell: the directions
//! of both fibre families, the angle between them, the thickness at constant volume and the areal mass. It gives the files as bytes, and
//! says what they do not hold. The report draws with the same computations ([`sheared`], [`deviations`], [`fibres()`]). The same artifact gives the same bytes on every machine (`plyflow_fixed`, sums and orders that are fixed, no clock).

#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod boundary;
mod csv;
mod curves;
mod deck;
mod dxf;
mod error;
mod fibres;
mod file;
mod names;
mod nastran;
mod net;
mod part;
mod request;
mod shells;
mod vec3;
mod vtu;

pub use curves::{Field, laid_fibres, pieces};
pub use error::ExportError;
pub use fibres::{Sheared, deviations, sheared};
pub use file::File;
pub use net::{Fibre, Net, TooMany, fibres};
pub use request::{Format, Frames, LengthUnit, Request};

use part::Part;
use plyflow_artifact::Artifact;
use std::collections::BTreeSet;

/// What an export gives.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Exported {
    /// The files, in a fixed order.
    pub files: Vec<File>,
    /// What a user should know of them, one sentence each: what is left out and why, what has to be added.
    pub told: Vec<String>,
}

/// Makes the files of one format from an artifact.
///
/// # Errors
/// When a body or frame that is asked for is not there, when the artifact has no bodies (or, of every format but VTU, no plies),
/// when the artifact cannot be read, or when the net has too many lines.
pub fn export(artifact: &Artifact, request: &Request) -> Result<Exported, ExportError> {
    let mut told = Vec::new();
    let frames = request.frames.of(artifact)?;
    let mut files = Vec::new();
    let mut series = Vec::new();
    for frame in &frames {
        let part = Part::read(artifact, request, *frame, &mut told)?;
        match request.format {
            Format::Vtu => {
                let stem = match frame {
                    Some(k) if frames.len() > 1 => format!("{}-{k:04}", request.stem),
                    _ => request.stem.clone(),
                };
                series.push((
                    part.time.unwrap_or(0.0),
                    vtu::write(&part, &stem, &mut files),
                ));
            }
            Format::Csv => csv::write(&part, &request.stem, &mut files),
            Format::Abaqus | Format::Calculix => {
                deck::write(&part, request, &mut files, &mut told);
            }
            Format::Nastran => nastran::write(&part, &request.stem, &mut files, &mut told),
            Format::Dxf => dxf::write(&part, request, &mut files, &mut told)?,
        }
    }
    if frames.len() > 1 {
        files.push(vtu::collection(&request.stem, &series));
    }
    // Each frame says the same of the same body.
    let mut seen = BTreeSet::new();
    told.retain(|t| seen.insert(t.clone()));
    Ok(Exported { files, told })
}
