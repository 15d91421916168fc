//! The kind `geometry`: tools and outlines that a scene may name.

use super::attributes::Attributes;
use super::shown::CarriedFile;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Attributes of the kind `geometry`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Geometry {
    /// Names of the outlines. An error that finds no outline lists them; nothing else needs them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub outlines: Vec<String>,
    /// What it was made of, for people: the name of a file, say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// What `plyflow extract` writes.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<CarriedFile>,
}

impl Attributes for Geometry {
    const KIND: &'static str = "geometry";
}
