//! The kind `defects`: what a detection flags on the plies of a formed run.

use crate::artifact::attributes::Attributes;
use crate::artifact::shear_limits::ShearLimits;
use crate::artifact::shown;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Attributes of the kind `defects`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Defects {
    /// From where on something is flagged.
    pub thresholds: Thresholds,
    /// What was found, in the order of the stack.
    pub plies: Vec<PlyDefects>,
    /// Of the excess length of compressed fibres, where it was judged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub maps: Vec<shown::Map>,
}

impl Attributes for Defects {
    const KIND: &'static str = "defects";
}

/// From where on something is flagged. A detection with other criteria tells its own.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Thresholds {
    /// Cells above this shear angle are flagged (rad). Left out where plies differ in it, or none is judged by one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_shear_positive: Option<f64>,
    /// Cells below this shear angle are flagged (rad). Left out as `over_shear_positive` is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_shear_negative: Option<f64>,
    /// Nodes above this distance do not conform (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_threshold: Option<f64>,
    /// Nodes whose closest point is nearer to the tool's foot are not judged (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foot_margin: Option<f64>,
    /// Height from which a ruck of compressed fibres counts (m); left out where they were not judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ruck_height: Option<f64>,
    /// What a step of somebody else tells besides (SI).
    #[serde(flatten)]
    pub other: Map<String, Value>,
}

/// What was found on a ply.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlyDefects {
    /// Its name.
    pub name: String,
    /// Undeformed flagged area (m2).
    pub flagged_area: f64,
    /// Shear angles from which its cells are flagged (rad). Left out: its shear was not judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_shear: Option<ShearLimits>,
    /// Undeformed area that is sheared too far (m2). Left out where shear was not judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_shear_area: Option<f64>,
    /// Undeformed area that does not conform to the tool (m2).
    pub poor_conformity_area: f64,
    /// Smallest shear angle (rad).
    pub shear_min: f64,
    /// Largest shear angle (rad).
    pub shear_max: f64,
    /// Largest distance of a judged node from the tool, less the ply's offset (m).
    pub distance_max: f64,
    /// Share of the ply's undeformed area whose distance from the tool is judged (1): there is tool to lie on. Left out: not told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub judged_share: Option<f64>,
    /// Of a ply that is not draped everywhere: undeformed area that has no shape (m2), of which nothing is in the other numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub undraped_area: Option<f64>,
    /// What of that lies where the fabric locks, or behind (m2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub locked_area: Option<f64>,
    /// Where compressed fibres were judged: undeformed area where they have length enough for a ruck (m2).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub buckling_area: Option<f64>,
    /// The largest excess length of compressed fibres, over that which a ruck needs (1).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub buckling_excess: Option<f64>,
}
