//! The kind `measurement`: what a metrologist measures on formed plies and on a scan of one.

use crate::artifact::attributes::Attributes;
use crate::artifact::comparison::{Defect, DefectKind};
use crate::artifact::shown::{Map, Plot, Series, Table};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Attributes of the kind `measurement`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Measurement {
    /// Of the plies from the tool upwards, then of the scan: wrinkles by their length, then bridging by its area.
    pub defects: Vec<MeasuredDefect>,
    /// In the order in which they were asked for.
    #[serde(default)]
    pub sections: Vec<Section>,
    /// How a scan was moved onto the tool; `null` where it lies as it was given, and without one.
    #[serde(default)]
    pub alignment: Option<ScanAlignment>,
    /// Which defects a scan and its ply have; `null` without a scan.
    #[serde(default)]
    pub agreement: Option<ScanAgreement>,
    /// `null` where the run does not tell the strains of its fibres.
    #[serde(default)]
    pub fibre_compression: Option<FibreCompression>,
    /// Of the uppermost ply, by the names of the results: `wrinkle_count` (1), `wrinkle_length`, `wrinkle_length_max`, `wrinkle_amplitude` (m).
    #[serde(default)]
    pub uppermost: BTreeMap<String, f64>,
    /// Between plies; `null` of a single one, and where not all are meshes of quads.
    #[serde(default)]
    pub slip: Option<PlySlip>,
    /// Of sections, distributions and slip.
    #[serde(default)]
    pub plots: Vec<Plot>,
    /// Of plies and scan.
    #[serde(default)]
    pub maps: Vec<Map>,
    /// Of defects and of all that is summed up.
    #[serde(default)]
    pub tables: Vec<Table>,
}

impl Attributes for Measurement {
    const KIND: &'static str = "measurement";
}

/// A defect that was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeasuredDefect {
    /// Name of its body.
    pub on: String,
    /// Its number among those of the body, from 1: that of its nodes in the field `defect`.
    pub number: usize,
    /// What a comparison tells of it too.
    #[serde(flatten)]
    pub found: Defect,
    /// Length of a wrinkle's ridge over the surface (m); `null` for bridging.
    #[serde(default)]
    pub length: Option<f64>,
    /// Largest turn of a ply over a wrinkle's crest from one cell to the next (rad); `null` for bridging.
    #[serde(default)]
    pub crest_sharpness: Option<f64>,
    /// `[min, max]` (rad), of the shear angle of the cells it touches; `null` where that is not known.
    #[serde(default)]
    pub shear: Option<[f64; 2]>,
    /// `[k][3]` (m), a wrinkle's crest on the formed ply, from one end to the other; empty for bridging.
    #[serde(default)]
    pub ridge: Vec<[f64; 3]>,
}

/// What the places of a section are told in.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SectionOn {
    /// As they are seen from above on what is formed.
    #[default]
    FromAbove,
    /// In the flat ply.
    FlatPly,
}

/// Where tool, plies and scan are cut along a path.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Section {
    /// Its name.
    pub label: String,
    /// `[x, y]` (m), where the path begins.
    pub from: [f64; 2],
    /// `[x, y]` (m), where the path ends.
    pub to: [f64; 2],
    /// `[[x, y], ..]` (m), its corners, both ends among them.
    pub path: Vec<[f64; 2]>,
    /// What these are told in.
    pub on: SectionOn,
    /// The lines in which it cuts them: arrays of stations and heights (m).
    pub lines: Vec<Series>,
}

/// How a scan was moved from where it was given onto the tool: turned, then shifted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanAlignment {
    /// `[i, j, k, w]`, the turn.
    pub quaternion: [f64; 4],
    /// `[x, y, z]` (m), the shift.
    pub shift: [f64; 3],
    /// Root mean square distance of its points from the tool's surface that counts (m).
    pub rms: f64,
    /// Number of passes.
    pub passes: usize,
    /// How many of the six freedoms of motion the tool decides.
    pub freedoms: usize,
}

/// Which defects a scan and its ply have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanAgreement {
    /// Name of the ply.
    pub ply: String,
    /// Those of both first, then those that the scan alone has, then those that the ply alone has.
    pub defects: Vec<ScanDefect>,
}

/// A defect of a scan, of its ply, or of both.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ScanDefect {
    /// What it is; of both as the scan has it.
    #[serde(rename = "type")]
    pub kind: DefectKind,
    /// Its number among those of the ply; `null` when it is not there, or below the least size.
    pub simulated: Option<usize>,
    /// Its number among those of the scan; `null` when it is not there, or below the least size.
    pub scanned: Option<usize>,
    /// `[simulated, scanned]` (m), of a wrinkle's ridge; `null` for bridging, and where it is not there.
    pub length: [Option<f64>; 2],
    /// `[simulated, scanned]` (m); `null` where it is not there.
    pub amplitude: [Option<f64>; 2],
    /// `[simulated, scanned]` (m2), on the formed face; `null` where it is not there.
    pub area: [Option<f64>; 2],
    /// `[x, y]` (m), its centre as seen from above on what is formed; of both as the scan has it.
    pub centre: [f64; 2],
}

/// On how much of the flat plies fibres are compressed, and by how much.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FibreCompression {
    /// Strain below which fibres are compressed (1).
    pub threshold: f64,
    /// Of all families of all plies together.
    pub all: Compressed,
    /// Of each family.
    pub families: Vec<FamilyCompression>,
}

/// Of the fibres of one family.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FamilyCompression {
    /// Name of the ply.
    pub ply: String,
    /// 1 or 2, as the fields `fibre_strain_1` and `fibre_strain_2` have them.
    pub family: usize,
    /// What is told of it.
    #[serde(flatten)]
    pub found: Compressed,
}

/// What is told of the fibres of a family, or of several together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Compressed {
    /// Undeformed compressed area (m2).
    pub area: f64,
    /// Mean strain over it (1), negative; 0 where nothing is compressed.
    pub strain_mean: f64,
    /// Least strain (1).
    pub strain_least: f64,
    /// Mean over the whole area of the compression (1): the strain below the threshold, with its sign turned; 0 elsewhere.
    pub compression: f64,
}

/// By how much places that lay on each other when flat have moved apart along the plies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PlySlip {
    /// Direction along which it is told, from x (rad).
    pub direction: f64,
    /// Names, from the tool upwards.
    pub plies: Vec<String>,
    /// Of plies that lie on each other.
    pub pairs: Vec<SlipPair>,
    /// Along sections, by section and pair.
    pub sections: Vec<SlipSection>,
}

/// Slip of a ply over another, wherever it lies on that one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SlipPair {
    /// Name of the one below.
    pub lower: String,
    /// Name of the one above.
    pub upper: String,
    /// Undeformed area over which they lie on each other (m2).
    pub area: f64,
    /// Largest slip (m).
    pub max: f64,
    /// Mean, by area (m).
    pub mean: f64,
    /// Largest magnitude of its part along the direction (m).
    pub along_max: f64,
    /// Largest magnitude of its part across (m).
    pub across_max: f64,
}

/// Slip of a ply over another along a section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SlipSection {
    /// Name of the section.
    pub name: String,
    /// Name of the ply below.
    pub lower: String,
    /// Name of the ply above.
    pub upper: String,
    /// Its part along the direction.
    pub along: SlipCourse,
    /// Its part across.
    pub across: SlipCourse,
}

/// A part of the slip along a section.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SlipCourse {
    /// Largest magnitude (m).
    pub max: f64,
    /// Mean, with its sign (m).
    pub mean: f64,
    /// Root mean square of half the sum with the mirror image about the middle (m); `null` where nothing has one.
    pub symmetric: Option<f64>,
    /// Root mean square of half the difference from it (m); `null` where nothing has one.
    pub antisymmetric: Option<f64>,
    /// Share of the antisymmetric part, 0 to 1; `null` where nothing has a mirror image or nothing slips.
    pub asymmetry: Option<f64>,
}

/// Attributes of a body of a measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct MeasuredBody {
    /// Name of the ply, or of the scan.
    pub ply: String,
    /// Whether it is a ply of the run, not the scan.
    pub simulated: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_measurement_tells_null_for_what_it_has_not() {
        let told = serde_json::to_value(Measurement::default()).unwrap();
        for key in ["alignment", "agreement", "fibre_compression", "slip"] {
            assert!(told.get(key).is_some_and(|v| v.is_null()), "{key}");
        }
        assert_eq!(told["uppermost"], json!({}));
    }

    #[test]
    fn numbers_of_a_family_lie_beside_its_name() {
        let told = json!({"ply": "ply_1", "family": 2, "area": 0.1, "strain_mean": -0.01, "strain_least": -0.02, "compression": 0.001});
        let read: FamilyCompression = serde_json::from_value(told.clone()).unwrap();
        assert_eq!(read.found.strain_least, -0.02);
        assert_eq!(serde_json::to_value(&read).unwrap(), told);
    }
}
