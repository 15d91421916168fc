//! Parameters of the step.

use crate::waves::{Criteria, Side};
use plyflow_sdk::StepError;
use serde::Deserialize;

/// See the manifest.
#[derive(Deserialize)]
pub struct Parameters {
    pub ply: Option<String>,
    pub centre: Vec<f64>,
    pub circles: Vec<f64>,
    pub inner_circles: Vec<f64>,
    pub sections: Vec<f64>,
    pub cross_sections: Vec<CrossSection>,
    pub threshold: f64,
    pub prominence: Option<f64>,
    pub side: Side,
    pub trace_step: f64,
    pub surfaces: Option<Vec<String>>,
    pub dome_radius: Option<f64>,
    pub samples: usize,
}

/// A vertical plane beside the axis.
#[derive(Deserialize)]
pub struct CrossSection {
    pub label: String,
    /// Direction from the axis to the plane, which stands across it (rad).
    pub angle: f64,
    /// Its distance from the axis (m).
    pub offset: f64,
}

impl Parameters {
    /// What the manifest cannot say.
    ///
    /// # Errors
    /// A text for the user.
    pub fn check(&self) -> Result<(), StepError> {
        if self.centre.len() != 2 {
            return Err(format!(
                "centre: given {} numbers; expected two, [x, y]",
                self.centre.len()
            )
            .into());
        }
        if self.circles.is_empty() {
            return Err("circles: given none; expected at least one radius".into());
        }
        if self.surfaces.as_ref().is_some_and(Vec::is_empty) {
            return Err(
                "surfaces: given none; name at least one body, or leave the parameter out".into(),
            );
        }
        Ok(())
    }

    /// Whether the ply is looked at from below: from the side to which its wrinkles leave, so that one that lies over shows.
    pub fn looks_up(&self) -> bool {
        self.side == Side::Down
    }

    /// What is a wrinkle.
    pub fn criteria(&self) -> Criteria {
        Criteria {
            height: self.threshold,
            prominence: self.prominence.unwrap_or(self.threshold),
            side: self.side,
        }
    }
}
