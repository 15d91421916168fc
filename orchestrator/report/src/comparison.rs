//! What a comparison found: its models and their defects.

use crate::units::plural;
use plyflow_model::job::NamedResult;
use serde::Deserialize;

/// Attributes of a comparison.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Comparison {
    pub(crate) models: Vec<Model>,
    pub(crate) defects: Vec<Defect>,
    /// Its step, for people.
    #[serde(skip)]
    pub(crate) label: String,
    /// Wrinkles and places of bridging that the reference has, wherever, and no local run.
    #[serde(skip)]
    pub(crate) missed: [usize; 2],
    /// What else compares the same zones, for people.
    #[serde(skip)]
    pub(crate) others: Vec<String>,
}

/// A model that was compared.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Model {
    pub(crate) name: String,
    pub(crate) role: String,
    pub(crate) zone: Option<String>,
}

/// A defect in one model.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default)]
pub(crate) struct Defect {
    pub(crate) id: String,
    pub(crate) model: String,
    pub(crate) zone: String,
    pub(crate) ply: String,
    #[serde(rename = "type")]
    pub(crate) kind: String,
    pub(crate) length: f64,
    pub(crate) amplitude: f64,
    pub(crate) area: f64,
    pub(crate) centre: [f64; 2],
    /// Least radius of curvature (m).
    pub(crate) radius: Option<f64>,
    /// Of a ridge in the flat ply, from x (rad).
    pub(crate) direction: Option<f64>,
    /// Likely cause of a wrinkle.
    pub(crate) cause: Option<String>,
    /// Mean, smallest and largest shear angle along the crest (rad).
    pub(crate) ridge_shear: Option<f64>,
    pub(crate) ridge_shear_min: Option<f64>,
    pub(crate) ridge_shear_max: Option<f64>,
    pub(crate) shear_min: f64,
    pub(crate) shear_max: f64,
    pub(crate) touches_cut: bool,
}

impl Defect {
    /// Whether it is a wrinkle; else it is bridging.
    pub(crate) fn is_wrinkle(&self) -> bool {
        self.kind == "wrinkle"
    }
}

impl Comparison {
    /// Role of a model by name: `global`, `local`, `reference`.
    pub(crate) fn role(&self, model: &str) -> &str {
        self.models
            .iter()
            .find(|m| m.name == model)
            .map_or("", |m| m.role.as_str())
    }

    /// Whether the local run of a zone was compared.
    pub(crate) fn has_local(&self, zone: &str) -> bool {
        let is = |m: &Model| m.role == "local" && m.zone.as_deref() == Some(zone);
        self.models.iter().any(is)
    }

    /// Defects of the local runs.
    pub(crate) fn local(&self) -> impl Iterator<Item = &Defect> {
        self.defects
            .iter()
            .filter(|d| self.role(&d.model) == "local")
    }

    /// What its step reported of the defects that the local runs have not; nought without a reference.
    pub(crate) fn missed_by(results: &[NamedResult]) -> [usize; 2] {
        let count = |name: &str| results.iter().find(|r| r.name == name);
        ["missed_wrinkles", "missed_bridging"].map(|n| count(n).map_or(0, |r| r.value as usize))
    }

    /// What the reference has and no local run, in words.
    pub(crate) fn missed_text(&self) -> Option<String> {
        let [wrinkles, bridging] = self.missed;
        let mut parts = Vec::new();
        if wrinkles > 0 {
            parts.push(plural(wrinkles, "wrinkle", "wrinkles"));
        }
        if bridging > 0 {
            parts.push(plural(bridging, "bridging area", "bridging areas"));
        }
        (!parts.is_empty()).then(|| parts.join(" and "))
    }
}
