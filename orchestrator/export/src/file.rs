//! A file that was made.

/// A file, ready to be written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct File {
    /// Its name in the folder that the user gave.
    pub name: String,
    /// What is in it.
    pub content: Vec<u8>,
}

impl File {
    /// Of a text.
    pub(crate) fn of_text(name: String, text: String) -> Self {
        let content = text.into_bytes();
        Self { name, content }
    }
}
