//! Shear angles from which a ply counts as over-sheared.

use crate::material::OverShear;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Shear angles from which a ply counts as over-sheared (rad). A sign without one is not judged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ShearLimits {
    /// Larger angles are too large (rad).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub positive: Option<f64>,
    /// Smaller angles are too small (rad).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub negative: Option<f64>,
}

impl From<OverShear> for ShearLimits {
    fn from(of: OverShear) -> Self {
        Self {
            positive: of.positive.map(|a| a.si()),
            negative: of.negative.map(|a| a.si()),
        }
    }
}

impl ShearLimits {
    /// With those of `other` for the signs that it says nothing of.
    ///
    /// ```
    /// use plyflow_model::artifact::ShearLimits;
    /// let material = ShearLimits { positive: Some(0.14), negative: Some(-0.87) };
    /// let asked = ShearLimits { positive: Some(0.24), negative: None };
    /// let limits = asked.or(material);
    /// assert!(limits.exceeded(0.25) && !limits.exceeded(0.2) && limits.exceeded(-0.9));
    /// assert!(!ShearLimits::default().exceeded(1.5));
    /// ```
    #[must_use]
    pub fn or(self, other: Self) -> Self {
        Self {
            positive: self.positive.or(other.positive),
            negative: self.negative.or(other.negative),
        }
    }

    /// Itself where it judges one sign at least.
    pub fn judged(self) -> Option<Self> {
        (self != Self::default()).then_some(self)
    }

    /// Whether a shear angle (rad) is beyond one of the limits.
    pub fn exceeded(&self, angle: f64) -> bool {
        self.positive.is_some_and(|limit| angle > limit)
            || self.negative.is_some_and(|limit| angle < limit)
    }
}
