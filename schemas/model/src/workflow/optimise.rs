//! The block `optimise` of a workflow.

use crate::workflow::study::{Scalar, Values};
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A search for the point at which a response is smallest or largest.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Optimise {
    /// The response that is to be small; this or `maximise`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minimise: Option<String>,
    /// The response that is to be large.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maximise: Option<String>,
    /// The variables: a range (anything between its ends; with `by` or `count` only its steps), or a list to choose from.
    pub over: IndexMap<String, Values>,
    /// What must hold, in responses and variables, such as `coverage >= 1`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub subject_to: Vec<String>,
    /// How many points are run (`40`), or how much CPU time they may take (`2 h`).
    pub budget: Scalar,
    /// How points are chosen.
    pub method: OptimiseMethod,
    /// Members of the population of `evolution`; four for each variable, at least 8, when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 4, "maximum" = 1000))]
    pub population: Option<u32>,
    /// Chooses the random numbers.
    #[serde(default)]
    pub seed: u32,
    /// Where the search begins: a value for every variable; in the middle when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<IndexMap<String, Scalar>>,
}

/// How an optimisation chooses its points.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum OptimiseMethod {
    /// The simplex of Nelder and Mead: finds the next valley, one point after the other.
    Simplex,
    /// Differential evolution: looks everywhere, a population at once.
    Evolution,
}
