//! The kind `characterisation`: a law fitted to test data.

use crate::artifact::attributes::Attributes;
use crate::artifact::shown::{CarriedFile, Plot};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Attributes of the kind `characterisation`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Characterisation {
    /// What the test is called.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Plots of the data and of the law.
    pub plots: Vec<Plot>,
    /// The material file with the law in it, or the fragment of a material or of a scene that tells it.
    pub files: Vec<CarriedFile>,
    /// Of the profiles of hanging strips: names of the files, or of the step, that they are from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sources: Option<Vec<String>>,
    /// Of a cantilever test: name of the file with the overhangs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Of a law of bending: `positive` or `negative`, the bend that was tested.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bending: Option<String>,
    /// Of friction: the pair, as a scene names it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pair: Option<String>,
    /// What a step of somebody else tells besides.
    #[serde(flatten)]
    pub other: Map<String, Value>,
}

impl Attributes for Characterisation {
    const KIND: &'static str = "characterisation";
}
