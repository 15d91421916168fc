//! What workflows and studies share: failure policy, and what a number is expected to be.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Failure policy.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OnFailure {
    /// Independent branches finish.
    #[default]
    KeepGoing,
    /// Running steps are stopped.
    FailFast,
}

/// What a number is expected to be, with its unit.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Stated {
    /// Expected value, with the unit of the result (`argmax`, `argmin` of a response: of the variable).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<ResultValue>,
    /// Allowed absolute deviation from `value`; of a response also from zero, from symmetry, or against the direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<ResultValue>,
    /// Lower bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimum: Option<ResultValue>,
    /// Upper bound.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maximum: Option<ResultValue>,
    /// Where the expectation comes from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
}

/// A value of a result: a plain number when the result has no unit, else text with a unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum ResultValue {
    /// Dimensionless.
    Number(f64),
    /// With a unit.
    Quantity(String),
}
