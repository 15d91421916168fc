//! What can go wrong with an artifact.

/// Class of an [`ArtifactError`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// No such array, body, frame or field.
    NotFound,
    /// Sizes of a buffer and of the data differ.
    BadShape,
    /// NaN, infinite, or a name or text that is not allowed.
    BadValue,
    /// The call does not fit what was called before (a frame left open, a name taken).
    BadOrder,
    /// The file is not an artifact of this data model, or it is damaged.
    NotAnArtifact,
    /// HDF5 or the file system refused.
    Io,
}

/// An error of reading or writing an artifact: what, where, what was expected.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{message}")]
pub struct ArtifactError {
    /// Class.
    pub kind: ErrorKind,
    /// Text for the user.
    pub message: String,
}

impl ArtifactError {
    pub(crate) fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        Self {
            kind,
            message: message.into(),
        }
    }
}

/// Result of this crate.
pub type Result<T> = std::result::Result<T, ArtifactError>;

pub(crate) fn bad_shape<T>(message: impl Into<String>) -> Result<T> {
    Err(ArtifactError::new(ErrorKind::BadShape, message))
}

pub(crate) fn bad_value<T>(message: impl Into<String>) -> Result<T> {
    Err(ArtifactError::new(ErrorKind::BadValue, message))
}

pub(crate) fn bad_order<T>(message: impl Into<String>) -> Result<T> {
    Err(ArtifactError::new(ErrorKind::BadOrder, message))
}

pub(crate) fn not_found<T>(message: impl Into<String>) -> Result<T> {
    Err(ArtifactError::new(ErrorKind::NotFound, message))
}
