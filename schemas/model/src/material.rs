//! A material file: a law (a material plugin with its parameters) and the sheet's thickness and mass.

use crate::units::{Angle, ArealMass, Length};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Version of the material format that this crate reads.
pub const VERSION: u32 = 1;

/// A material file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Version of the material format: 1.
    #[schemars(extend("const" = 1))]
    pub plyflow_material: u32,
    /// Name, used in reports.
    pub name: String,
    /// Where the numbers come from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// Material plugin: name or path of a library.
    pub plugin: String,
    /// Thickness of the sheet.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub thickness: Length,
    /// Mass per area.
    #[schemars(extend("x-exclusive-minimum" = "0 g/m2"))]
    pub areal_mass: ArealMass,
    /// Plies: the shear angles from which the fabric wrinkles, as a bias-extension test shows. Without them no step judges its shear.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_shear: Option<OverShear>,
    /// The plugin's parameters, checked against its manifest.
    #[serde(default)]
    pub with: serde_json::Map<String, serde_json::Value>,
}

impl Material {
    /// Angle (rad) at which the fibre families of its law cross, counter-clockwise from the first to the second, where its `with` says it as
    /// `crossing`: as a number (rad), or with a unit.
    pub fn crossing(&self) -> Option<f64> {
        let given = self.with.get("crossing")?;
        let of_text = || {
            given
                .as_str()?
                .parse::<Angle>()
                .ok()
                .map(|angle| angle.si())
        };
        given.as_f64().or_else(of_text)
    }
}

/// Shear angles from which a fabric wrinkles. A sign without one is not judged.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("minProperties" = 1))]
pub struct OverShear {
    /// Of positive shear, which stretches the stitch.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 deg", "x-maximum" = "90 deg"))]
    pub positive: Option<Angle>,
    /// Of negative shear, as a negative angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "-90 deg", "x-maximum" = "0 deg"))]
    pub negative: Option<Angle>,
}

/// A material where a scene names one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum MaterialEntry {
    /// Path of a material file, relative to the scene file.
    File(String),
    /// A material file with some of its parameters replaced.
    Varied(VariedMaterial),
    /// The material itself.
    Inline(Box<Material>),
}

/// A material file with some of its parameters replaced.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VariedMaterial {
    /// Path of a material file, relative to the scene file.
    pub file: String,
    /// Parameters that take the place of the file's own; `null` removes one.
    #[serde(default)]
    pub with: serde_json::Map<String, serde_json::Value>,
    /// Any value of the file by its path, such as `thickness: 0.4 mm` or `with.shear.stiffness: 112 N/m`.
    #[serde(default, skip_serializing_if = "serde_json::Map::is_empty")]
    pub set: serde_json::Map<String, serde_json::Value>,
}
