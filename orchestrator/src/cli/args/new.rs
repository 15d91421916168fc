//! Arguments of `new`.

use camino::Utf8PathBuf;
use clap::{Args, ValueEnum};

pub const NEW_EXAMPLES: &str = "\
Examples:
  plyflow new step count-sheared --python
  plyflow new element my-membrane --c
  plyflow new material my-sheet --rust --into plugins

The folder has the source, a README and a small workflow that runs with it. Nothing that is there is overwritten.";

/// `new`
#[derive(Debug, Args)]
pub struct NewArgs {
    /// What to begin
    #[arg(value_enum)]
    pub kind: NewKind,
    /// Name of the plugin and of the folder, such as my-step: small letters and digits, with hyphens between words
    pub name: String,
    /// In Python: needs no compiler
    #[arg(long, group = "language")]
    pub python: bool,
    /// In Rust: needs cargo, and Plyflow's crates
    #[arg(long, group = "language")]
    pub rust: bool,
    /// In C: needs make and a compiler
    #[arg(long, group = "language")]
    pub c: bool,
    /// Folder to make it in, made if need be [default: the current one]
    #[arg(long, value_name = "DIR")]
    pub into: Option<Utf8PathBuf>,
    /// Plyflow's source, for --rust [default: the crates beside this program, or the source tree in which it was built]
    #[arg(long, value_name = "DIR", requires = "rust")]
    pub source: Option<Utf8PathBuf>,
}

/// What can be begun.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum NewKind {
    /// Reads artifacts, writes one
    Step,
    /// Forces of the elements of a mesh
    Element,
    /// Law of a sheet
    Material,
}
