//! The kind `export`: files for other programs.

use super::attributes::Attributes;
use super::shown::CarriedFile;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Attributes of the kind `export`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Export {
    /// What `plyflow extract` writes.
    pub files: Vec<CarriedFile>,
}

impl Attributes for Export {
    const KIND: &'static str = "export";
}
