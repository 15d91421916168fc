//! Arguments of `new`.

use camino::Utf8PathBuf;
use clap::{Args, ValueEnum};

pub const NEW_EXAMPLES: &str = "\
Examples:
  plyflow new study my-part --tool hat.stl --unit mm --ply '400 x 200 mm' --material woven-38616
  plyflow new study my-part                    # on a terminal: asks for what it needs
  plyflow new step count-sheared --python
  plyflow new element my-membrane --c
  plyflow new material my-sheet --rust --into plugins

The folder of a study has a scene and a workflow that run. The folder of a plugin has the source, a README and a small workflow that runs with it.
Nothing that is there is overwritten.";

/// `new`
#[derive(Debug, Args)]
pub struct NewArgs {
    /// What to begin
    #[arg(value_enum)]
    pub kind: NewKind,
    /// Name of the study or plugin and of its folder, such as my-part: small letters and digits, with hyphens between words
    pub name: String,
    /// Folder to make it in, made if need be [default: the current one]
    #[arg(long, value_name = "DIR")]
    pub into: Option<Utf8PathBuf>,
    #[command(flatten)]
    /// Of a study.
    pub study: StudyWords,
    /// In Python: needs no compiler
    #[arg(long, group = "language", help_heading = "A plugin")]
    pub python: bool,
    /// In Rust: needs cargo, and Plyflow's crates
    #[arg(long, group = "language", help_heading = "A plugin")]
    pub rust: bool,
    /// In C: needs make and a compiler
    #[arg(long, group = "language", help_heading = "A plugin")]
    pub c: bool,
    /// Plyflow's source, for --rust [default: the crates beside this program, or the source tree in which it was built]
    #[arg(long, value_name = "DIR", requires = "rust", help_heading = "A plugin")]
    pub source: Option<Utf8PathBuf>,
}

/// What a study is of. What is left out is asked for on a terminal.
#[derive(Debug, Default, Args)]
pub struct StudyWords {
    /// The tool: an STL file, drawn anywhere and any way up
    #[arg(long, value_name = "FILE", help_heading = "A study")]
    pub tool: Option<Utf8PathBuf>,
    /// Length of one unit of the tool's file: mm, cm, m, in, ft or such as '0.1 mm'
    #[arg(long, value_name = "UNIT", help_heading = "A study")]
    pub unit: Option<String>,
    /// Length and width of the plies: '400 x 200 mm'; beside --plies those of plies whose row has no outline
    #[arg(long, value_name = "SIZE", help_heading = "A study")]
    pub ply: Option<String>,
    /// A DXF drawing (or a CSV table of corners) with the outline of the plies
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with = "ply",
        help_heading = "A study"
    )]
    pub dxf: Option<Utf8PathBuf>,
    /// The layer of the drawing with the outline, where several have curves
    #[arg(long, value_name = "LAYER", requires = "dxf", help_heading = "A study")]
    pub layer: Option<String>,
    /// A ply book: a CSV table with a row for each ply, from the tool upwards: name, angle, material, outline, layer, x, y, rotation
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = ["dxf", "angles"],
        help_heading = "A study"
    )]
    pub plies: Option<Utf8PathBuf>,
    /// A material file, or the name of one that comes along, such as woven-38616: it is copied
    #[arg(long, value_name = "NAME|FILE", help_heading = "A study")]
    pub material: Option<String>,
    /// A ply for each angle of the first fibres from x, in degrees, from the tool upwards; the second fibres lie 90 degrees further [default: 0]
    #[arg(
        long,
        value_name = "ANGLES",
        value_delimiter = ',',
        allow_hyphen_values = true,
        help_heading = "A study"
    )]
    pub angles: Vec<f64>,
    /// How it is formed
    #[arg(long, value_enum, help_heading = "A study")]
    pub process: Option<StudyProcess>,
}

impl StudyWords {
    /// The first of its options that is given.
    pub fn given(&self) -> Option<&'static str> {
        [
            (self.tool.is_some(), "--tool"),
            (self.unit.is_some(), "--unit"),
            (self.ply.is_some(), "--ply"),
            (self.dxf.is_some(), "--dxf"),
            (self.layer.is_some(), "--layer"),
            (self.plies.is_some(), "--plies"),
            (self.material.is_some(), "--material"),
            (!self.angles.is_empty(), "--angles"),
            (self.process.is_some(), "--process"),
        ]
        .into_iter()
        .find_map(|(is, word)| is.then_some(word))
    }
}

/// A process for which a study can be begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum StudyProcess {
    /// Between two films under vacuum
    DoubleDiaphragm,
    /// Under one film, which vacuum draws over tool and plies
    SingleDiaphragm,
    /// With punch, die and blank holder
    Press,
}

impl StudyProcess {
    /// Whether films form the plies.
    pub fn has_films(self) -> bool {
        self != Self::Press
    }
}

/// What can be begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum NewKind {
    /// A scene and a workflow for a part of your own
    Study,
    /// Reads artifacts, writes one
    Step,
    /// Forces of the elements of a mesh
    Element,
    /// Law of a sheet
    Material,
}
