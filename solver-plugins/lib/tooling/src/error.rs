//! What can be wrong with a tool.

use std::path::PathBuf;

/// A tool that cannot be built: where, what was given, what was expected, what to do.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    /// A parameter of a generator is out of range.
    #[error("tool `{tool}`: {parameter} is {given}, but {expected}; {remedy}")]
    Parameter {
        /// Generator, e.g. `joggle_spar`.
        tool: &'static str,
        /// Parameter, e.g. `joggles[1].length`.
        parameter: String,
        /// Its value with unit.
        given: String,
        /// The bound and its reason.
        expected: String,
        /// What to change.
        remedy: String,
    },
    /// It would have too many facets; the sentence says how many, and what would do.
    #[error("tool: {0}")]
    TooMany(String),
    /// The file cannot be read.
    #[error("tool file {}: {source}; give a binary or ASCII STL file, with a path relative to the scene file", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The cause.
        source: plyflow_files::open::FileError,
    },
    /// The file is no STL, or not all of it: `file:line: problem; remedy`.
    #[error("tool file {0}")]
    Stl(String),
    /// The file's facets do not make a usable surface.
    #[error("tool file {}: {problem}; {remedy}", path.display())]
    Surface {
        /// The file.
        path: PathBuf,
        /// What is wrong, with the place of the first offence.
        problem: String,
        /// What to change.
        remedy: String,
    },
}

impl ToolError {
    /// A length out of range; `given` in metres is shown in mm.
    pub(crate) fn length(
        tool: &'static str,
        parameter: impl Into<String>,
        given: f64,
        expected: String,
        remedy: &str,
    ) -> Self {
        Self::Parameter {
            tool,
            parameter: parameter.into(),
            given: mm(given),
            expected,
            remedy: remedy.into(),
        }
    }
}

/// A length as text in mm, rounded to 0.001 mm.
pub(crate) fn mm(metres: f64) -> String {
    format!("{} mm", (metres * 1e6).round() / 1e3)
}
