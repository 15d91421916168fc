//! Why there is no export.

use plyflow_artifact::ArtifactError;

/// Why there is no export. Nothing is written then.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The artifact cannot be read.
    #[error(transparent)]
    Artifact(#[from] ArtifactError),
    /// Its attributes are not those of its kind.
    #[error("the attributes of the artifact are not those of the kind 'forming': {0}")]
    Attributes(#[from] serde_json::Error),
    /// There is nothing to export.
    #[error(
        "the artifact of kind '{0}' has no bodies, so there is nothing to export; what it holds: plyflow inspect"
    )]
    NoBodies(String),
    /// There are bodies, and none is a ply.
    #[error(
        "the artifact of kind '{kind}' tells of no ply, and {format} is written of plies; --format vtu writes its bodies with their fields{}",
        if .bodies.is_empty() { String::new() } else { format!(", and --body NAME writes the mesh of one: {}", .bodies.join(", ")) }
    )]
    NoPlies {
        /// Kind of the artifact.
        kind: String,
        /// The format that was asked for.
        format: &'static str,
        /// Names of its bodies, where the format takes them.
        bodies: Vec<String>,
    },
    /// A body that is asked for is not there.
    #[error("--body {name}: the artifact has no such body; there are: {}", .there.join(", "))]
    NoBody {
        /// What was given.
        name: String,
        /// Names of the bodies.
        there: Vec<String>,
    },
    /// A body that is asked for is not a ply.
    #[error("--body {name}: {format} is written of plies, and it is none; the plies are: {}", .plies.join(", "))]
    NotAPly {
        /// What was given.
        name: String,
        /// The format that was asked for.
        format: &'static str,
        /// Names of the plies.
        plies: Vec<String>,
    },
    /// A frame that is asked for is not there.
    #[error("--frame {given}: the artifact has {frames} frames, from 0 to {}", .frames.saturating_sub(1))]
    NoFrame {
        /// What was given.
        given: u64,
        /// Number of frames.
        frames: u64,
    },
    /// A frame is asked for, and there are none.
    #[error("--frame {0}: the artifact has no frames; leave --frame out")]
    Still(String),
    /// Only one format has series.
    #[error(
        "--frame all is for vtu; {0} holds one frame: give its number, or leave --frame out for the last one"
    )]
    OneFrame(&'static str),
    /// Too many lines in the net.
    #[error(
        "--net {given} m: ply '{ply}' would have {lines:.0} fibre lines; expected at most {most}: give a larger distance, such as --net '{would} m'"
    )]
    Net {
        /// What was given (m).
        given: f64,
        /// The ply.
        ply: String,
        /// How many lines there would be.
        lines: f64,
        /// The bound.
        most: usize,
        /// A distance that would do (m).
        would: f64,
    },
}
