//! Why no model is made of what is given, or why a run does not come to its end.

use plyflow_blank::MeshError;
use plyflow_mechanics::MechanicsError;
use plyflow_model::fault::Fault;
use plyflow_sdk::StepError;

/// What a function gives, or why not.
pub type Result<T> = std::result::Result<T, FormingError>;

/// What stops the step. Every text is for the user: what is given, where, what was expected and what to do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum FormingError {
    /// A value that is not possible.
    #[error("{place}: given {given}; expected {expected}")]
    Value {
        /// Where it is in the scene or among the parameters.
        place: String,
        /// It, with its unit.
        given: String,
        /// What would do.
        expected: String,
    },
    /// Something else of the scene, by itself or with the parameters.
    #[error("{0}")]
    Scene(String),
    /// A rule of scenes that is broken.
    #[error("scene.{0}")]
    Rule(#[from] Fault),
    /// What is not its own mirror image in the planes of the scene.
    #[error("{0}")]
    Symmetry(String),
    /// An element or a material that does not fit its sheet.
    #[error("{0}")]
    Element(String),
    /// What another step gave, and does not fit.
    #[error("{0}")]
    Input(String),
    /// The tool has no surface or no distance field.
    #[error("{0}")]
    Tool(String),
    /// A ply that cannot be meshed.
    #[error("ply '{ply}': {source}")]
    Mesh {
        /// Its name.
        ply: String,
        /// Why.
        source: MeshError,
    },
    /// A ply without a shape, which the text names.
    #[error(transparent)]
    Blank(#[from] MeshError),
    /// What would end well and mean nothing.
    #[error("{0}")]
    Absurd(String),
    /// What went wrong on the way, with its likely cause.
    #[error("{0}")]
    Run(String),
    /// The model failed.
    #[error(transparent)]
    Mechanics(#[from] MechanicsError),
    /// The host, or who follows the run, stopped it.
    #[error("{}", .0.text())]
    Host(StepError),
}

impl FormingError {
    /// A value that is not possible: where it is, it, and what would do.
    pub fn value(
        place: impl Into<String>,
        given: impl Into<String>,
        expected: impl Into<String>,
    ) -> Self {
        Self::Value {
            place: place.into(),
            given: given.into(),
            expected: expected.into(),
        }
    }

    /// What the host is told: its own word where it stopped the step, the text otherwise.
    pub fn at_the_door(self) -> StepError {
        match self {
            Self::Host(stopped) => stopped,
            other => StepError::Failed(other.to_string()),
        }
    }
}

impl From<StepError> for FormingError {
    fn from(stopped: StepError) -> Self {
        Self::Host(stopped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cancelled_step_is_told_as_cancelled_and_all_else_as_its_text() {
        let cancelled = FormingError::from(StepError::Cancelled);
        assert_eq!(cancelled.at_the_door(), StepError::Cancelled);
        let wrong = FormingError::value("tool_grid", "-1 m", "more than 0 m");
        let text = "tool_grid: given -1 m; expected more than 0 m";
        assert_eq!(wrong.at_the_door(), StepError::Failed(text.into()));
    }
}
