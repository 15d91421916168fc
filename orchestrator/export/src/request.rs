//! What is asked of an export.

use crate::error::ExportError;
use plyflow_artifact::Artifact;

/// A format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// XML files of VTK with all fields, and a `.vtm` that joins the bodies.
    Vtu,
    /// A table of the points and one of the cells of each body.
    Csv,
    /// Input of Abaqus: S4 and S3 shells, orientations as distributions.
    Abaqus,
    /// Input of CalculiX: S8R and S6 shells, a section for each element.
    Calculix,
    /// Bulk data of Nastran: two CQUAD4 for each cell, one for each family.
    Nastran,
    /// Drawings: the flat plies, and the draped boundaries.
    Dxf,
}

impl Format {
    /// Its name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Vtu => "vtu",
            Self::Csv => "csv",
            Self::Abaqus => "abaqus",
            Self::Calculix => "calculix",
            Self::Nastran => "nastran",
            Self::Dxf => "dxf",
        }
    }
}

/// Which frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Frames {
    /// The last one.
    #[default]
    Last,
    /// This one, from 0.
    At(u64),
    /// All of them.
    All,
}

impl Frames {
    /// The frames of an artifact; one `None` where it has none, so that its bodies are as they were defined.
    pub(crate) fn of(self, artifact: &Artifact) -> Result<Vec<Option<u64>>, ExportError> {
        let frames = artifact.contents().frames;
        match self {
            Self::Last => Ok(vec![frames.checked_sub(1)]),
            Self::At(given) if frames == 0 => Err(ExportError::Still(given.to_string())),
            Self::All if frames == 0 => Err(ExportError::Still("all".into())),
            Self::At(given) if given >= frames => Err(ExportError::NoFrame { given, frames }),
            Self::At(given) => Ok(vec![Some(given)]),
            Self::All => Ok((0..frames).map(Some).collect()),
        }
    }
}

/// In what lengths are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LengthUnit {
    /// Metres.
    #[default]
    Metre,
    /// Millimetres.
    Millimetre,
    /// Inches.
    Inch,
}

impl LengthUnit {
    /// Its symbol.
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::Metre => "m",
            Self::Millimetre => "mm",
            Self::Inch => "in",
        }
    }

    /// How many of it are a metre.
    #[must_use]
    pub fn per_metre(self) -> f64 {
        match self {
            Self::Metre => 1.0,
            Self::Millimetre => 1000.0,
            Self::Inch => 1.0 / 0.0254,
        }
    }
}

/// What is asked.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// What is written.
    pub format: Format,
    /// Of which frames; [`Frames::All`] for VTU alone.
    pub frames: Frames,
    /// Names of bodies; empty: all bodies for VTU, all plies for the others.
    pub bodies: Vec<String>,
    /// Of lengths. All else is in SI units.
    pub unit: LengthUnit,
    /// Distance of the fibre lines of a DXF drawing in the flat ply (m).
    pub net: f64,
    /// With what the names of files begin.
    pub stem: String,
}
