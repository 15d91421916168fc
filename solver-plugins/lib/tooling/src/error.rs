//! What can be wrong with a tool.

use plyflow_model::fault::Fault;
use std::path::PathBuf;

/// A tool that cannot be built: where, what was given, what was expected, what to do.
#[derive(Debug, thiserror::Error)]
pub enum ToolError {
    /// Its words make no surface.
    #[error("scene.{0}")]
    Words(#[from] Fault),
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
    /// What another step makes has not been read.
    #[error(
        "scene.tool.input.body: `{0}` is a body of another step, and nothing gives it; expected a step that gives `geometry`, wired to the input \
         `geometry`"
    )]
    NotRead(String),
    /// The triangles of another step do not make a usable surface.
    #[error("scene.tool.input: body `{body}` of step `{step}`: {problem}; {remedy}")]
    Input {
        /// Name of the body.
        body: String,
        /// Name of the step.
        step: String,
        /// What is wrong, with the place of the first offence.
        problem: String,
        /// What to change.
        remedy: String,
    },
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
