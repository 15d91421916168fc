//! The words of `export`.

use super::places::Places;
use camino::Utf8PathBuf;
use clap::{Args, ValueEnum};

pub(super) const EXPORT_EXAMPLES: &str = "\
Examples:
  plyflow export workflow.yaml coarse --format vtu --to out           # all bodies, all fields
  plyflow export workflow.yaml 'local[A]' --format vtu,csv --to out
  plyflow export workflow.yaml draped --format abaqus --unit mm --to out
  plyflow export workflow.yaml draped --format dxf --unit mm --net '10 mm' --to out
  plyflow export result.vtkhdf --format vtu --frame all --to out      # an artifact, as a series

Besides the fields of the artifact, files of plies have the fibre directions of both families, the
angle between them, the thickness at constant volume, the areal mass and the number of the ply.
Lengths are in metres unless --unit says otherwise; all else is in SI units.";

/// `export`
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The workflow file; or an artifact, without a step
    #[arg(value_name = "WORKFLOW|ARTIFACT")]
    pub file: Utf8PathBuf,
    /// A step, or one of its items: local[A]
    pub step: Option<String>,
    /// What to write; several with commas between them
    #[arg(long, value_enum, value_delimiter = ',', required = true)]
    pub format: Vec<ExportFormat>,
    /// Folder to write into, made if need be [default: the current one]
    #[arg(long, value_name = "DIR")]
    pub to: Option<Utf8PathBuf>,
    /// Which frame, from 0, or `all` (vtu) [default: the last one]
    #[arg(long, value_name = "NUMBER|all", allow_hyphen_values = true)]
    pub frame: Option<String>,
    /// Only this body; may be repeated [default: all bodies for vtu, all plies for the others]
    #[arg(long, value_name = "NAME")]
    pub body: Vec<String>,
    /// In what lengths are written
    #[arg(long, value_enum, default_value = "m")]
    pub unit: ExportUnit,
    /// Distance of the fibre lines of dxf in the flat ply
    #[arg(long, value_name = "LENGTH", default_value = "20 mm")]
    pub net: String,
    /// Replace files that are there with another content
    #[arg(long)]
    pub force: bool,
    /// How it is told what was written
    #[arg(long, value_enum, default_value = "text")]
    pub print: Printed,
    #[command(flatten)]
    /// Where things are.
    pub places: Places,
    /// Use another value for a parameter, written as in YAML; may be repeated
    #[arg(long = "set", value_name = "STEP.PARAMETER=VALUE")]
    pub set: Vec<String>,
}

/// What is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ExportFormat {
    /// VTK's XML files with all fields, also of other artifacts than formed ones
    Vtu,
    /// Tables of points and of cells
    Csv,
    /// S4 shells of two layers, with orientations and thickness as distributions
    Abaqus,
    /// S8R shells of two layers, with a section for each element
    Calculix,
    /// CQUAD4 elements with a material angle, one for each fibre family
    Nastran,
    /// Flat plies with their fibre lines, and the draped boundaries
    Dxf,
}

/// A unit of lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ExportUnit {
    /// Metres
    M,
    /// Millimetres
    Mm,
    /// Inches
    In,
}

/// How it is told what was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Printed {
    /// A line for each file, and notes
    Text,
    /// {"files": [{"path", "bytes", "new"}], "notes": [..]}
    Json,
}
