//! Why a picture cannot be drawn.

use maud::Markup;

/// Why a picture cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum DrawError {
    /// The encoder of PNG refuses, for instance a picture without pixels.
    #[error(transparent)]
    Png(#[from] png::EncodingError),
    /// The data of the rotatable view cannot be written.
    #[error(transparent)]
    Data(#[from] serde_json::Error),
    /// Nor be deflated.
    #[error(transparent)]
    Deflate(#[from] std::io::Error),
}

/// A picture.
pub(crate) type Drawn = Result<Markup, DrawError>;
