//! Why a step stopped.

/// Why a step stopped.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StepError {
    /// The host asked to stop.
    Cancelled,
    /// Anything else: what was wrong, where, and what to do.
    Failed(String),
}

impl StepError {
    /// What a user reads of it.
    pub fn text(&self) -> &str {
        match self {
            Self::Cancelled => "the host asked to stop",
            Self::Failed(text) => text,
        }
    }
}

/// By its text. What wraps a [`StepError::Cancelled`] loses it here, and the step ends as cancelled all the same: the
/// [`crate::Host`] knows that it has asked the step to stop.
impl<T: std::fmt::Display> From<T> for StepError {
    fn from(value: T) -> Self {
        Self::Failed(value.to_string())
    }
}

/// The text of a caught panic.
pub(crate) fn panic_text(payload: &(dyn std::any::Any + Send)) -> String {
    payload
        .downcast_ref::<&str>()
        .map(|s| (*s).to_owned())
        .or_else(|| payload.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "a panic without a text".to_owned())
}
