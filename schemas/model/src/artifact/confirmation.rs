//! The kind `confirmation`: which defects stay when the zones are run in other ways, and between which bounds their sizes lie.

use crate::artifact::attributes::Attributes;
use crate::artifact::comparison::DefectKind;
use crate::artifact::shown::Table;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Attributes of the kind `confirmation`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Confirmation {
    /// Share of a size (1) up to which a change counts as none.
    pub tolerance: f64,
    /// The ways in which the zones were run again.
    pub variants: Vec<ConfirmVariant>,
    /// The ways in which they were not.
    #[serde(default)]
    pub left_out: Vec<Variation>,
    /// The defects of the runs that are confirmed, by zone, numbered as a comparison numbers them.
    pub defects: Vec<ConfirmedDefect>,
    /// Defects that variants show and the runs that are confirmed do not.
    #[serde(default)]
    pub new: Vec<NewDefect>,
    /// What becomes of the answer as a whole.
    pub verdict: ConfirmedVerdict,
    /// How the bounds stand against the whole in smaller elements; `null`: none was given.
    #[serde(default)]
    pub judged: Option<JudgedBounds>,
    /// Defects with their bounds, and new ones.
    #[serde(default)]
    pub tables: Vec<Table>,
}

impl Attributes for Confirmation {
    const KIND: &'static str = "confirmation";
}

/// In what a variant differs.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Variation {
    /// Smaller elements.
    Finer,
    /// A slower process.
    Slower,
    /// A smaller step in time.
    HalfStep,
    /// Wider margins between defects and the cuts of their zones.
    Wider,
}

impl Variation {
    /// All of them, in the order in which they are told.
    pub const ALL: [Self; 4] = [Self::Finer, Self::Slower, Self::HalfStep, Self::Wider];

    /// Its name in artifacts and on the command line, and that of its input.
    pub fn name(self) -> &'static str {
        match self {
            Self::Finer => "finer",
            Self::Slower => "slower",
            Self::HalfStep => "half_step",
            Self::Wider => "wider",
        }
    }

    /// What a defect hangs on that it changes.
    pub fn of_what(self) -> &'static str {
        match self {
            Self::Finer => "element size",
            Self::Slower => "speed",
            Self::HalfStep => "time step",
            Self::Wider => "margin",
        }
    }

    /// What was done, in words.
    pub fn how(self) -> &'static str {
        match self {
            Self::Finer => "with smaller elements",
            Self::Slower => "in a slower process",
            Self::HalfStep => "with a smaller step",
            Self::Wider => "with a wider margin",
        }
    }
}

/// A way in which the zones were run again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ConfirmVariant {
    /// In what it differs.
    pub variant: Variation,
    /// Names of its steps.
    pub steps: Vec<String>,
    /// Number of its runs.
    pub runs: usize,
    /// Wrinkles that it shows; of several element sizes the finest.
    pub wrinkles: usize,
    /// Places of bridging that it shows.
    pub bridging: usize,
}

/// Whether a defect stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Stands {
    /// Every variant has it, and none changes its sizes by more than the tolerance.
    Stays,
    /// Every variant has it, and one of them changes a size by more.
    Hangs,
    /// A variant has it not.
    Gone,
}

/// What becomes of a defect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ConfirmedDefect {
    /// Such as `AW1`: zone, W (wrinkle) or B (bridging), number.
    pub id: String,
    /// Name of the zone.
    pub zone: String,
    /// Name of the ply.
    pub ply: String,
    /// What it is.
    #[serde(rename = "type")]
    pub kind: DefectKind,
    /// `[x, y]` (m), its centre in the undeformed plane.
    pub centre: [f64; 2],
    /// Whether it stays.
    pub stands: Stands,
    /// In words, such as `46 to 48 mm, stays`.
    pub text: String,
    /// On what it hangs; empty where it stays.
    #[serde(default)]
    pub hangs_on: Vec<HangsOn>,
    /// By name (`length`, `amplitude`, `area`): a wrinkle's three sizes, the last two of bridging (m, m, m2).
    pub sizes: BTreeMap<String, ConfirmedSize>,
}

/// A size of a defect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ConfirmedSize {
    /// In the run that is confirmed (m, area: m2).
    pub value: f64,
    /// Its lower bound (m, area: m2).
    pub low: f64,
    /// Its upper bound (m, area: m2).
    pub high: f64,
    /// Order of convergence that was observed over three or more element sizes, kept between 1 and 2; `null` where none was.
    #[serde(default)]
    pub order: Option<f64>,
    /// By the name of the variant that has the defect (of several element sizes the finest): the size there (m, area: m2).
    pub by: BTreeMap<String, f64>,
    /// In the whole by which the bounds are judged; `null`: none was given, or it has the defect not (m, area: m2).
    #[serde(default)]
    pub reference: Option<f64>,
}

/// How bounds stand against the whole in smaller elements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct JudgedBounds {
    /// Name of the step that is the whole.
    pub step: String,
    /// Mean edge of its plies' elements in the flat ply (m).
    pub element_size: f64,
    /// Bounds that were judged: those of all sizes of the defects that the whole has too.
    pub bounds: usize,
    /// Those that the whole's size lies within.
    pub held: usize,
    /// Defects of the runs that are confirmed that the whole has not.
    pub gone: usize,
    /// Defects of the whole, in the zones, that the runs that are confirmed have not.
    pub missed: usize,
}

/// A variant that changes a defect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct HangsOn {
    /// The variant.
    pub variant: Variation,
    /// The size that it changes by more than the tolerance; `null`: it has the defect not.
    #[serde(default)]
    pub size: Option<String>,
    /// Change of the size over its value (1); `null`: it has the defect not.
    #[serde(default)]
    pub change: Option<f64>,
    /// Of a defect that is gone: what the variant has in its place, if it has the other kind of defect there.
    #[serde(default)]
    pub instead: Option<DefectKind>,
}

/// A defect of a variant that the run that is confirmed has not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct NewDefect {
    /// The variant.
    pub variant: Variation,
    /// Name of its step.
    pub step: String,
    /// Name of the zone whose box it lies in; `null`: outside of the zones that are confirmed, where only a wider one looks.
    #[serde(default)]
    pub zone: Option<String>,
    /// Name of the ply.
    pub ply: String,
    /// What it is.
    #[serde(rename = "type")]
    pub kind: DefectKind,
    /// `[x, y]` (m), its centre in the undeformed plane.
    pub centre: [f64; 2],
    /// Length of a wrinkle's ridge (m); 0 for bridging.
    pub length: f64,
    /// Largest distance from the tool (m).
    pub amplitude: f64,
    /// Undeformed area (m2).
    pub area: f64,
}

/// What becomes of the answer as a whole: whether there are wrinkles, and whether there is bridging.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ConfirmedVerdict {
    /// Wrinkles of the runs that are confirmed.
    pub wrinkles: usize,
    /// Their places of bridging.
    pub bridging: usize,
    /// Whether every variant answers as they do.
    pub stays: bool,
    /// The variants that answer otherwise.
    #[serde(default)]
    pub hangs_on: Vec<Variation>,
    /// In words.
    pub text: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variants_are_called_in_artifacts_as_their_inputs_are() {
        for variant in Variation::ALL {
            let written = serde_json::to_value(variant).unwrap();
            assert_eq!(written, variant.name());
        }
    }
}
