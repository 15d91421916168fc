//! The kind `coupon`: a run of a test on a coupon.

use crate::artifact::attributes::Attributes;
use crate::artifact::forming::Energy;
use crate::artifact::shown::Plot;
use crate::scene::SheetKind;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// Attributes of the kind `coupon`. Beside what every test tells each test tells some of what it was given, and leaves out the rest.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Coupon {
    /// What the test is called.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub title: Option<String>,
    /// Plots of its curves.
    pub plots: Vec<Plot>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Plugin of the elements.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub element: Option<String>,
    /// Name of the material.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub material: Option<String>,
    /// Edge of the elements (m); 0 where the test says it otherwise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub element_size: Option<f64>,
    /// How many elements there are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub elements: Option<ElementCount>,
    /// Number of steps in time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycles: Option<u64>,
    /// The smallest that was used (s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_step: Option<f64>,
    /// How far to trust the run by its energies, where it has a history of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<Energy>,
    /// Of a picture frame: its side (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub side: Option<f64>,
    /// Of an inflation: radius of the clamped rim (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius: Option<f64>,
    /// Of a bias extension in the plane: angle between the elements' edges and the fibres (rad).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mesh_angle: Option<f64>,
    /// Of a bias extension and of buckling: length between the clamps (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub length: Option<f64>,
    /// Of a bias extension and of buckling: width (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub width: Option<f64>,
    /// Of a bias extension: time in which the moving clamp goes its way (s).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pull_time: Option<f64>,
    /// Of a bias extension: how far the undeformed specimen is out of its plane at most (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub imperfection: Option<f64>,
    /// Of a bias extension: which random shape that is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Of a cantilever: how far the strip stands out of the clamp (m).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub overhang: Option<f64>,
    /// Of a cantilever, of pure bending and of buckling: the fibre family along the strip, 1 or 2.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub family: Option<u32>,
    /// Of pure bending: shear of the strip before it is bent (rad).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shear_angle: Option<f64>,
    /// Of pure bending: whether the nodes of the element rotate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rotations: Option<bool>,
    /// What a test of somebody else tells besides.
    #[serde(flatten)]
    pub other: Map<String, Value>,
}

impl Attributes for Coupon {
    const KIND: &'static str = "coupon";
}

/// How many elements a specimen has: all together, or along its two sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "expected a whole number, or two: along the longer and along the shorter side"
)]
pub enum ElementCount {
    /// All.
    All(u64),
    /// Of a grid: along the longer and along the shorter side.
    Along([u64; 2]),
}

impl ElementCount {
    /// All together.
    pub fn all(self) -> u64 {
        match self {
            Self::All(count) => count,
            Self::Along([a, b]) => a.saturating_mul(b),
        }
    }
}

/// Attributes of the body of a specimen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SpecimenBody {
    /// What it is; of films a ply, too.
    pub kind: SheetKind,
    /// (m).
    pub thickness: f64,
}

impl SpecimenBody {
    /// Of a sheet of that thickness (m).
    pub fn new(thickness: f64) -> Self {
        Self {
            kind: SheetKind::Ply,
            thickness,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_coupon_tells_what_it_has_and_keeps_what_a_stranger_tells() {
        let written = json!({
            "plots": [], "warnings": ["w"], "element": "m4", "elements": 1600, "cycles": 5000, "element_size": 0.0025, "side": 0.1,
            "energy": {"peak_drift_ratio": 0.01, "peak_kinetic_ratio": null, "kinetic_bound_kept": true, "hourglass_ratio": 0.0},
            "humidity": 0.5,
        });
        let coupon: Coupon = serde_json::from_value(written.clone()).unwrap();
        assert_eq!(coupon.elements.map(ElementCount::all), Some(1600));
        assert_eq!(coupon.other["humidity"], 0.5);
        assert_eq!(serde_json::to_value(&coupon).unwrap(), written);
        let none: Coupon = serde_json::from_value(json!({})).unwrap();
        assert_eq!(none, Coupon::default());
    }

    #[test]
    fn elements_are_counted_all_together_or_along_two_sides() {
        let read = |v: Value| serde_json::from_value::<ElementCount>(v);
        assert_eq!(read(json!([16, 2])).unwrap(), ElementCount::Along([16, 2]));
        assert_eq!(ElementCount::Along([16, 2]).all(), 32);
        assert_eq!(
            serde_json::to_value(ElementCount::Along([16, 2])).unwrap(),
            json!([16, 2])
        );
        let wrong = read(json!("many")).unwrap_err().to_string();
        assert!(wrong.contains("a whole number"), "{wrong}");
    }
}
