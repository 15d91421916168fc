//! The text of a file that people write.

use plyflow_files::text::decode;

/// Why bytes are no text.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum EncodingError {
    /// They begin as UTF-16 and are none; the sentence says where.
    #[error("{0}")]
    Utf16(String),
    /// They are no UTF-8.
    #[error("the file is not text in UTF-8, from line {line}: save it as UTF-8")]
    Utf8 {
        /// The first line (from 1) that is none.
        line: usize,
    },
}

/// Names in such a file are compared and shown, so that its encoding must be certain: UTF-8, or UTF-16 with its mark.
///
/// # Errors
/// When it is in neither.
pub fn written(bytes: Vec<u8>) -> Result<String, EncodingError> {
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        let text = decode(&bytes).map_err(EncodingError::Utf16)?;
        return Ok(text.into_owned());
    }
    String::from_utf8(bytes).map_err(|e| {
        let good = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = good.iter().filter(|b| **b == b'\n').count() + 1;
        EncodingError::Utf8 { line }
    })
}
