//! The kind `comparison`: wrinkles, bridging and shear of coarse, fine and reference runs at the same places.

use crate::artifact::attributes::Attributes;
use crate::artifact::zones::Rectangle;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Attributes of the kind `comparison`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Comparison {
    /// Names of the zones that were compared.
    #[serde(default)]
    pub zones: Vec<String>,
    /// `[[x0, y0, x1, y1], ..]` (m), their boxes in the same order: a zone that is drawn again keeps its name.
    #[serde(default)]
    pub zone_boxes: Vec<Rectangle>,
    /// The runs: the global one, local ones by their zones, others, the reference.
    pub models: Vec<ComparedModel>,
    /// Their defects in the zones: first those of the local runs.
    pub defects: Vec<ComparedDefect>,
    /// By model and ply.
    #[serde(default)]
    pub shear: Vec<PlyShear>,
    /// Shares (1) of the cells at which [`PlyShear::quantiles`] are told, in their order.
    #[serde(default)]
    pub quantiles: Vec<f64>,
    /// What passes through the cuts of the zones, and how far they reach in.
    #[serde(default)]
    pub cut: Cut,
    /// What the errors among the results are against; `null` where nothing was refined.
    #[serde(default)]
    pub measured_by: Option<Yardstick>,
    /// The ways to the answer, and what measures them.
    #[serde(default)]
    pub ways: Vec<Way>,
}

impl Attributes for Comparison {
    const KIND: &'static str = "comparison";
}

impl Comparison {
    /// The part that a model plays; `None` when there is none of that name.
    pub fn role(&self, model: &str) -> Option<Role> {
        let mut models = self.models.iter();
        models.find(|m| m.name == model).map(|m| m.role)
    }

    /// The local run of a zone.
    pub fn local_of(&self, zone: &str) -> Option<&ComparedModel> {
        let of_zone = |m: &&ComparedModel| m.is_local() && m.zone.as_deref() == Some(zone);
        self.models.iter().find(of_zone)
    }

    /// Defects of the local runs.
    pub fn local_defects(&self) -> impl Iterator<Item = &ComparedDefect> {
        let is_local = |d: &&ComparedDefect| self.role(&d.model) == Some(Role::Local);
        self.defects.iter().filter(is_local)
    }
}

/// Which part a model plays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Coarse run of the whole scene.
    Global,
    /// Fine run of a zone.
    Local,
    /// Another run of the whole scene.
    Other,
    /// Fine run of the whole scene.
    Reference,
}

impl Role {
    /// Its name in artifacts.
    pub fn name(self) -> &'static str {
        match self {
            Self::Global => "global",
            Self::Local => "local",
            Self::Other => "other",
            Self::Reference => "reference",
        }
    }
}

/// A run that is compared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ComparedModel {
    /// `global`, `local.A`, `other.drape`, `reference`.
    pub name: String,
    /// Its part.
    pub role: Role,
    /// Name of the zone of a local run; `null` for the whole.
    pub zone: Option<String>,
    /// Of its plies (m); 0 when the run does not tell it.
    pub element_size: f64,
    /// Number of cells of all sheets.
    pub elements: usize,
    /// Number of cells times number of steps in time, over all sheets; 0 when the run does not tell it.
    pub element_cycles: f64,
}

impl ComparedModel {
    /// Whether it is the fine run of a zone.
    pub fn is_local(&self) -> bool {
        self.role == Role::Local
    }
}

/// What a defect is.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "lowercase")]
pub enum DefectKind {
    /// A crest, curved beyond the threshold, that stands off the tool, with its flanks.
    Wrinkle,
    /// Standing off the tool without such a crest.
    Bridging,
}

impl DefectKind {
    /// Its name in artifacts.
    pub fn name(self) -> &'static str {
        match self {
            Self::Wrinkle => "wrinkle",
            Self::Bridging => "bridging",
        }
    }
}

/// Likely causes of a wrinkle, in the order in which they are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// The fabric is sheared beyond its limits along the crest (thesis 5.2.2).
    OverShear,
    /// Little shear, but the ply bridges close by: what it lacks there it has too much of here (thesis 5.5: AW2, BW2).
    Bridging,
    /// Little shear and no bridging; a ply with other fibre directions lies on or under it, and fibres are compressed on the crest
    /// (thesis chapter 6).
    InterPlyCompression,
    /// None of these, but fibres are compressed on the crest, of whichever family they are more: the ply has been pushed together along
    /// its yarns (thesis 4.4.3: where positive shear meets negative).
    FibreCompression,
    /// None of these.
    Undetermined,
}

impl Cause {
    /// Its name in artifacts.
    pub fn name(self) -> &'static str {
        match self {
            Self::OverShear => "over-shear",
            Self::Bridging => "bridging",
            Self::InterPlyCompression => "inter-ply-compression",
            Self::FibreCompression => "fibre-compression",
            Self::Undetermined => "undetermined",
        }
    }
}

/// What is told of a defect wherever it was found: of a comparison and of a measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Defect {
    /// What it is.
    #[serde(rename = "type")]
    pub kind: DefectKind,
    /// What most likely brought a wrinkle about; `null` for bridging.
    #[serde(default)]
    pub cause: Option<Cause>,
    /// Largest distance from the tool (m).
    pub amplitude: f64,
    /// Undeformed area (m2), to where the ply is the distance threshold from the tool.
    pub area: f64,
    /// `[x, y]` (m), its centre in the undeformed plane.
    pub centre: [f64; 2],
    /// Least radius of curvature (m); `null` where it is flat.
    #[serde(default)]
    pub radius: Option<f64>,
    /// Direction of a wrinkle's ridge in the undeformed plane, from x, in (-pi/2, pi/2] (rad); `null` for bridging.
    #[serde(default)]
    pub direction: Option<f64>,
    /// Mean shear angle along a wrinkle's crest, over the nodes along it (rad); `null` for bridging, and where shear is not known.
    #[serde(default)]
    pub ridge_shear: Option<f64>,
    /// The smallest there (rad), or `null`.
    #[serde(default)]
    pub ridge_shear_min: Option<f64>,
    /// The largest there (rad), or `null`.
    #[serde(default)]
    pub ridge_shear_max: Option<f64>,
    /// `[[s, angle], ..]` (m, rad), by node along the crest: the place along it, from its first end over the surface, and the shear angle; or
    /// `null`.
    #[serde(default)]
    pub ridge_shear_profile: Option<Vec<[f64; 2]>>,
}

impl Defect {
    /// Whether it is a wrinkle; else it is bridging.
    pub fn is_wrinkle(&self) -> bool {
        self.kind == DefectKind::Wrinkle
    }
}

/// A defect of a model. The same defect has the same `id` in every model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ComparedDefect {
    /// Such as `AW1`: zone, W (wrinkle) or B (bridging), number.
    pub id: String,
    /// Name of the model.
    pub model: String,
    /// Name of the zone.
    pub zone: String,
    /// Name of the ply.
    pub ply: String,
    /// What a measurement tells of it too.
    #[serde(flatten)]
    pub found: Defect,
    /// Length of a wrinkle's ridge over the surface (m); 0 for bridging.
    pub length: f64,
    /// Largest magnitude of the principal curvatures (1/m).
    #[serde(default)]
    pub curvature_max: f64,
    /// Smallest shear angle of the cells it touches (rad); `null` where it touches none.
    #[serde(default)]
    pub shear_min: Option<f64>,
    /// The largest there (rad), or `null`.
    #[serde(default)]
    pub shear_max: Option<f64>,
    /// Of a local run: whether it reaches the zone's cut, so that the zone is too small.
    pub touches_cut: bool,
    /// `[left, right, bottom, top]`: the sides of the cut that it reaches. Never a free side, nor one at which the ply ends.
    pub cut_sides: [bool; 4],
}

/// Shear angles of the cells of a ply of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlyShear {
    /// Name of the model.
    pub model: String,
    /// Name of the ply.
    pub ply: String,
    /// Smallest (rad); `null` where there is no cell.
    pub min: Option<f64>,
    /// Largest (rad); `null` where there is no cell.
    pub max: Option<f64>,
    /// `[q]` (rad), at the shares [`Comparison::quantiles`].
    pub quantiles: Vec<f64>,
}

/// The cut between coarse and fine.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Cut {
    /// By zone and ply; empty when the runs hold no membrane forces.
    pub work: Vec<Passage>,
    /// By zone; empty without a reference.
    pub layers: Vec<Layer>,
}

/// Work through the cut of one ply, from the first frame to the last (J).
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Work {
    /// Done on the zone.
    pub net: f64,
    /// Sum of the sizes of what passes by place and time, either way: what the net work is small or large against.
    pub gross: f64,
}

/// Both runs' work through the cut of one ply of a zone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Passage {
    /// Name of the zone.
    pub zone: String,
    /// Name of the ply.
    pub ply: String,
    /// In the global run.
    pub global: Work,
    /// In the local run.
    pub local: Work,
}

/// The strips of one zone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Layer {
    /// Name of the zone.
    pub zone: String,
    /// From the cut inwards.
    pub strips: Vec<Strip>,
}

/// How far a local run is from the reference in a strip along its cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Strip {
    /// Least distance from the cut in the flat ply (m).
    pub from: f64,
    /// Largest distance (m).
    pub to: f64,
    /// Root mean square distance of its nodes from where the reference has them (m).
    pub position: f64,
    /// The same of nodal distances from the tool (m), over nodes that are judged in both.
    pub standing_off: f64,
    /// Number of nodes.
    pub nodes: usize,
}

/// What the ways to the answer are measured by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Yardstick {
    /// A fine run of the whole scene.
    Reference,
    /// Without one: the fine runs of the zones, in these.
    Zones,
}

/// A way to the answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Way {
    /// Name of its model; `total` for global and local runs together.
    pub model: String,
    /// Number of cells of all sheets.
    pub elements: usize,
    /// Number of cells times number of steps in time; those of the earlier passes and of zones drawn again that it stands on among them.
    pub element_cycles: f64,
    /// When a whole began that began late (s), else `null`.
    pub start_time: Option<f64>,
    /// By the names of the results (`defect_error`, `position_error`, `missed_wrinkles` and so on; SI); empty for what measures the others.
    pub errors: BTreeMap<String, f64>,
}

/// Attributes of a body of a comparison: a ply of a local run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ComparedBody {
    /// Name of the model.
    pub model: String,
    /// Name of the ply.
    pub ply: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    #[test]
    fn names_are_the_words_of_the_artifacts() {
        use {Cause as C, DefectKind as D, Role as R};
        let word = |v: Result<Value, _>| v.unwrap();
        for role in [R::Global, R::Local, R::Other, R::Reference] {
            assert_eq!(word(serde_json::to_value(role)), role.name());
        }
        for kind in [D::Wrinkle, D::Bridging] {
            assert_eq!(word(serde_json::to_value(kind)), kind.name());
        }
        let causes = [C::OverShear, C::Bridging, C::InterPlyCompression];
        for cause in causes
            .into_iter()
            .chain([C::FibreCompression, C::Undetermined])
        {
            assert_eq!(word(serde_json::to_value(cause)), cause.name());
        }
    }

    #[test]
    fn a_defect_is_told_flat_and_what_bridging_has_not_is_null() {
        let told = json!({
            "id": "AB1", "model": "local.A", "zone": "A", "ply": "ply_1", "type": "bridging", "cause": null, "length": 0.0,
            "amplitude": 0.002, "area": 1e-4, "centre": [0.1, 0.2], "curvature_max": 0.0, "radius": null, "direction": null,
            "shear_min": -0.1, "shear_max": 0.1, "ridge_shear": null, "ridge_shear_min": null, "ridge_shear_max": null,
            "ridge_shear_profile": null, "touches_cut": false, "cut_sides": [false, false, false, false],
        });
        let read: ComparedDefect = serde_json::from_value(told.clone()).unwrap();
        assert!(!read.found.is_wrinkle());
        assert_eq!(serde_json::to_value(&read).unwrap(), told);
    }

    #[test]
    fn defects_of_local_runs_are_those_of_models_with_that_part() {
        let model = |name: &str, role, zone: Option<&str>| json!({"name": name, "role": role, "zone": zone, "element_size": 0.0, "elements": 0, "element_cycles": 0.0});
        let defect = |model: &str| {
            json!({"id": "AW1", "model": model, "zone": "A", "ply": "ply_1", "type": "wrinkle", "length": 0.1, "amplitude": 0.002, "area": 1e-4,
                "centre": [0.0, 0.0], "touches_cut": false, "cut_sides": [false, false, false, false]})
        };
        let told = json!({
            "models": [model("global", "global", None), model("local.A", "local", Some("A"))],
            "defects": [defect("local.A"), defect("global"), defect("gone")],
        });
        let read: Comparison = serde_json::from_value(told).unwrap();
        let local: Vec<&str> = read.local_defects().map(|d| d.model.as_str()).collect();
        assert_eq!(local, ["local.A"]);
        assert_eq!(read.role("gone"), None);
        assert_eq!(read.local_of("A").unwrap().name, "local.A");
        assert!(read.local_of("B").is_none());
    }
}
