//! The kind `conformance`: how far a component keeps the contract of its kind.

use crate::artifact::attributes::Attributes;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Marks a log line of the step that holds a [`ConformanceLine`].
pub const CONFORMANCE_MARK: &str = "conformance: ";

/// Attributes of the kind `conformance`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Conformance {
    /// What was judged, one after the other.
    pub subjects: Vec<ConformanceSubject>,
}

impl Attributes for Conformance {
    const KIND: &'static str = "conformance";
}

/// What a component was judged as, and how.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ConformanceSubject {
    /// Such as an element with one material.
    pub subject: String,
    /// In the order in which they were made.
    pub checks: Vec<ConformanceCheck>,
}

/// What a check demands.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ConformanceRule {
    /// Name of the check, such as `batch-independence`.
    pub name: String,
    /// What a component that keeps the contract does.
    pub expected: String,
    /// What to do when it does not.
    pub remedy: String,
}

/// A check that has ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ConformanceCheck {
    /// What was demanded.
    #[serde(flatten)]
    pub rule: ConformanceRule,
    /// How it ended.
    pub outcome: CheckOutcome,
    /// What was seen, in a sentence.
    pub seen: String,
    /// The measured number, or `null` where the check has none.
    #[serde(default)]
    pub measured: Option<f64>,
    /// The largest that is allowed, or `null`.
    #[serde(default)]
    pub limit: Option<f64>,
}

/// How a check ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum CheckOutcome {
    /// As demanded.
    Passed,
    /// Not as demanded.
    Failed,
    /// There was nothing to check, or an earlier failure makes it meaningless.
    Skipped,
}

/// Told as a check begins, and again as it ends: so it is known even when the component ends the process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ConformanceLine {
    /// As in [`ConformanceSubject`].
    pub subject: String,
    /// A check that begins.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub begins: Option<ConformanceRule>,
    /// A check that has ended.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ends: Option<ConformanceCheck>,
}
