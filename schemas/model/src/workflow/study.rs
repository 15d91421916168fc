//! The block `study` of a workflow, its responses, and what is expected of them.

use crate::workflow::stated::{OnFailure, Stated};
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Points at which the steps of a workflow run: one of `vary`, `zip`, `points`, `sample`, `product`, `union`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// The points.
    #[serde(flatten)]
    pub set: PointSet,
    /// What a failed point does to the others; that of the workflow when not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub on_failure: Option<OnFailure>,
    /// So many failed points are borne: the run still ends well. One more stops the study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most_failures: Option<u32>,
}

/// A set of points: a study's, or a part of a product or a union.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PointSet {
    /// All combinations of the values of these variables.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vary: Option<IndexMap<String, Values>>,
    /// The values of these variables side by side: the first of each, the second of each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zip: Option<IndexMap<String, Values>>,
    /// The points one by one: a table (CSV, units in its head), relative to this file, or a list of mappings.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-expected" = "the path of a table (CSV), or a list of points"))]
    pub points: Option<PointsOf>,
    /// Points chosen in a region.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sample: Option<Sample>,
    /// Every point of each part with every point of the others; no variable in two parts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub product: Option<Vec<PointSet>>,
    /// The points of all parts, each once; the same variables in every part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub union: Option<Vec<PointSet>>,
    /// Keeps the points for which this holds, such as `fabric_fabric <= fabric_diaphragm and angle > 0 deg`.
    #[serde(default, rename = "where", skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
}

/// One value of a variable: a plain number, a text (with a unit: `45 deg`), `true` or `false`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(extend("x-expected" = "a value, such as `45 deg` or `0.1`"))]
pub enum Scalar {
    /// Yes or no.
    Bool(bool),
    /// A plain number.
    Number(f64),
    /// A quantity, or any text.
    Text(String),
}

/// The values of a variable: one, a list, or a range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(extend("x-expected" = "a value, a list of values, or a range {from: .., to: .., by: ..}"))]
pub enum Values {
    /// The same everywhere.
    One(Scalar),
    /// These.
    List(Vec<Scalar>),
    /// From one end to the other.
    Range(Span),
}

/// A range; both ends are values. A number of points is given by `by` or `count`, except in a sample.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Span {
    /// First value.
    pub from: Scalar,
    /// Last value.
    pub to: Scalar,
    /// Step; whole steps lead from `from` to `to`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<Scalar>,
    /// Number of values, instead of `by`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 1, "maximum" = 100_000))]
    pub count: Option<u32>,
    /// Whether equal steps are equal differences or equal ratios.
    #[serde(default)]
    pub scale: Scale,
}

/// What equal steps of a range are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// Equal differences.
    #[default]
    Linear,
    /// Equal ratios.
    Log,
}

/// Points one by one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum PointsOf {
    /// A table.
    File(String),
    /// A mapping of the variables for each.
    List(Vec<IndexMap<String, Scalar>>),
}

/// Points chosen in a region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// How.
    pub method: SampleMethod,
    /// How many points. Of `sobol` and `random` a larger number only adds points.
    #[schemars(extend("minimum" = 1, "maximum" = 65_536))]
    pub count: u32,
    /// Chooses the random numbers.
    #[serde(default)]
    pub seed: u32,
    /// The variables: a range (without `by` and `count`), or a list to choose from.
    pub of: IndexMap<String, Values>,
}

/// How points are chosen in a region.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SampleMethod {
    /// All combinations of equally many values of each variable.
    Grid,
    /// One value in each of `count` slices of every variable, in random company.
    LatinHypercube,
    /// Sobol numbers with Owen's scrambling: they fill the region evenly.
    Sobol,
    /// Independent random numbers.
    Random,
}

/// What is read from every point of a study: a result of a step, or what follows from the point's own values.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("dependentRequired" = {"step": ["result"], "result": ["step"]}, "minProperties" = 1, "not" = {"required": ["step", "value"]}))]
pub struct Response {
    /// Step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<String>,
    /// Name of its result.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub result: Option<String>,
    /// In the place of both: a number that is computed from the variables, such as `length * width`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<String>,
    /// What is taken of the items of a step that is fanned out; needed there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<ResponseOf>,
}

/// What is taken of several results of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ResponseOf {
    /// The largest.
    Max,
    /// The smallest.
    Min,
    /// Their mean.
    Mean,
    /// Their sum; of no item it is 0.
    Sum,
}

/// A stated expectation on a response of a study, over its points.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExpectResponse {
    /// Name of the response.
    pub response: String,
    /// What of the points is held against the value and the bounds.
    #[serde(default, skip_serializing_if = "FamilyOf::is_each")]
    pub of: FamilyOf,
    /// The variable along which is looked: for `argmax`, `argmin`, `monotone`, `symmetric_about`, and `best` where it is meant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over: Option<String>,
    /// For `symmetric_about`: the value of the variable at which the points mirror each other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub about: Option<Scalar>,
    /// For `monotone`: which way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Direction>,
    /// Only the points for which this holds; needed for `zero_where`.
    #[serde(default, rename = "where", skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// For `monotone`, `zero_where`, `symmetric_about`, instead of `tolerance`: as a part of the largest size of the response in the
    /// whole study.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub relative_tolerance: Option<f64>,
    /// What is expected of it.
    #[serde(flatten)]
    pub stated: Stated,
}

/// What of the points of a study is held against an expectation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FamilyOf {
    /// Each point.
    #[default]
    Each,
    /// The mean of the points.
    Mean,
    /// The largest.
    Max,
    /// The smallest.
    Min,
    /// The value of the variable `over` where the response is largest.
    Argmax,
    /// The value of the variable `over` where the response is smallest.
    Argmin,
    /// Grows (or falls) along the variable `over`, the others staying as they are.
    Monotone,
    /// Is zero at the points of `where`.
    ZeroWhere,
    /// Is the same at points that mirror each other in a value of the variable `over`.
    SymmetricAbout,
    /// Of an optimisation: at the best point that meets its constraints; with `over`, the value of that variable there.
    Best,
}

impl FamilyOf {
    /// Whether each point is meant.
    pub fn is_each(&self) -> bool {
        *self == Self::Each
    }

    /// As it is written.
    pub fn word(self) -> &'static str {
        match self {
            Self::Each => "each",
            Self::Mean => "mean",
            Self::Max => "max",
            Self::Min => "min",
            Self::Argmax => "argmax",
            Self::Argmin => "argmin",
            Self::Monotone => "monotone",
            Self::ZeroWhere => "zero_where",
            Self::SymmetricAbout => "symmetric_about",
            Self::Best => "best",
        }
    }
}

/// Which way a response goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// It grows, or stays.
    Increasing,
    /// It falls, or stays.
    Decreasing,
}
