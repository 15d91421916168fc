//! The kind `mesh-study`: how results settle as a mesh is refined, and which element size does for a target error.

use crate::artifact::attributes::Attributes;
use crate::artifact::shown::{Plot, Table};
use crate::artifact::zones::Rectangle;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Attributes of the kind `mesh-study`: of runs of a whole, or of runs of zones.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeshStudy {
    /// Error that the advice is for (1).
    pub target_error: f64,
    /// Of runs of a whole: name of the step of the finest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finest: Option<String>,
    /// Of runs of a whole: estimated error of the finest (1).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub finest_error: Option<f64>,
    /// Of runs of a whole: the element size that is advised (m).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub advised_element_size: Option<f64>,
    /// Of runs of zones: what is advised for each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub zones: Vec<ZoneAdvice>,
    /// Of the runs.
    #[serde(default)]
    pub tables: Vec<Table>,
    /// Of runs of a whole: shear angles over the element size.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub plots: Vec<Plot>,
}

impl Attributes for MeshStudy {
    const KIND: &'static str = "mesh-study";
}

/// What is advised for a zone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ZoneAdvice {
    /// Its name.
    pub name: String,
    /// `[x0, y0, x1, y1]` (m), its box in the flat ply.
    #[serde(rename = "box")]
    pub bounds: Rectangle,
    /// The element size that is advised (m).
    pub element_size: f64,
    /// Estimated error of its finest run (1).
    pub finest_error: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_study_of_zones_tells_nothing_of_a_whole() {
        let told = json!({
            "target_error": 0.1, "tables": [],
            "zones": [{"name": "A", "box": [0.0, 0.0, 1.0, 1.0], "element_size": 0.004, "finest_error": 0.02}],
        });
        let read: MeshStudy = serde_json::from_value(told.clone()).unwrap();
        assert_eq!(read.advised_element_size, None);
        assert_eq!(serde_json::to_value(&read).unwrap(), told);
    }
}
