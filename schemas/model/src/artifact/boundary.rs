//! The kind `boundary`: what drives a fine run of a zone, or a coarse run of the whole again.

use crate::artifact::attributes::Attributes;
use crate::artifact::forming::Sheet;
use crate::artifact::zones::Zone;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Attributes of the kind `boundary`, of a zone.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Boundary {
    /// The zone.
    pub zone: Zone,
    /// Name of the scene that the coarse run formed; `null` when that does not tell it.
    #[serde(default)]
    pub scene: Option<String>,
    /// Number of frames.
    #[serde(default)]
    pub frames: usize,
    /// When the fine run begins (s).
    #[serde(default)]
    pub start_time: f64,
    /// How many times slower than in the coarse run the process goes on: the times of this artifact are those of the coarse run times this; left out: 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub slower: Option<f64>,
    /// Of the plies (m).
    #[serde(default)]
    pub element_size: f64,
    /// Of the films (m).
    #[serde(default)]
    pub film_element_size: f64,
    /// The sheets in the zone, as the coarse run tells them, in the order of the stack.
    #[serde(default)]
    pub sheets: Vec<Sheet>,
    /// Largest distance, where lines of the coarse mesh cross the cut, between fine edges and the coarse surface (m).
    #[serde(default)]
    pub interpolation_error: f64,
}

impl Attributes for Boundary {
    const KIND: &'static str = "boundary";
}

/// Attributes of the kind `boundary`, of what fine runs feed back to a coarse one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Feedback {
    /// `null`: it drives the whole.
    pub zone: Option<Zone>,
    /// Name of the scene that the coarse run formed; `null` when that does not tell it.
    pub scene: Option<String>,
    /// Number of frames.
    pub frames: usize,
    /// Of the coarse plies (m).
    pub element_size: f64,
    /// Width of the strip along the cuts in which the coarse run is left free (m).
    pub overlap: f64,
    /// Names of the zones whose motion is fed back.
    pub fed_back: Vec<String>,
}

impl Attributes for Feedback {
    const KIND: &'static str = "boundary";
}
