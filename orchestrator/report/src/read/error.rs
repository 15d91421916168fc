//! Why something of an artifact cannot be read.

use plyflow_artifact::ArtifactError;

/// Why something of an artifact cannot be read, as a sentence about that artifact.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ReadError {
    /// The file, or an array of it.
    #[error(transparent)]
    Artifact(#[from] ArtifactError),
    /// Its attributes or its provenance are not of their form.
    #[error("its {what}: {source}")]
    Form {
        what: &'static str,
        source: serde_json::Error,
    },
    /// It is of a kind that has frames, and has none.
    #[error("it has no frame")]
    NoFrame,
    /// A sheet is not made of quads.
    #[error("body '{body}' has cells of {nodes} nodes; sheets have 4")]
    NoQuads { body: String, nodes: u32 },
    /// A field that a kind of artifact has is not there.
    #[error("body '{body}' has no field '{field}'")]
    NoField { body: String, field: &'static str },
    /// The attributes name a ply that is no sheet among the bodies.
    #[error("its sheet '{0}' has no body with cells of 4 nodes")]
    NoBody(String),
    /// A body has no points, or some that are nowhere.
    #[error("body '{0}' has no place")]
    NoPlace(String),
}

/// For `map_err`: what has not the form that it should have.
pub(crate) fn form(what: &'static str) -> impl Fn(serde_json::Error) -> ReadError {
    move |source| ReadError::Form { what, source }
}
