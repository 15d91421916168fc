//! What is wrong with a part of a study.

/// Why a part of a study is not what it must be: a sentence, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Problem {
    /// What is wrong.
    pub message: String,
    /// What was expected.
    pub expected: Option<String>,
    /// What to do.
    pub help: Option<String>,
}

impl Problem {
    /// A sentence alone.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            expected: None,
            help: None,
        }
    }

    /// Names what it is about.
    #[must_use]
    pub fn of(mut self, text: &str) -> Self {
        let shown = plyflow_model::text::shortened(text, 80);
        self.message = format!("`{shown}`: {}", self.message);
        self
    }

    /// States what was expected.
    #[must_use]
    pub fn expected(mut self, text: impl Into<String>) -> Self {
        self.expected = Some(text.into());
        self
    }

    /// States what to do.
    #[must_use]
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.help = Some(text.into());
        self
    }
}
