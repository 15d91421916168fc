//! The forming process of a scene: forming under one film or between two, a press, or stamping between any rigid parts.

use crate::stamping::Stamping;
use crate::units::{Force, Length, Number, Pressure, Time};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Process {
    /// Double-diaphragm forming.
    DoubleDiaphragm(DoubleDiaphragm),
    /// Single-diaphragm forming: one film over plies that lie on the tool.
    SingleDiaphragm(SingleDiaphragm),
    /// Press forming: punch, die and blank holder.
    Press(Press),
    /// Stamping between any rigid parts.
    Stamping(Stamping),
}

impl Process {
    /// Height over the tool's highest point at which the lowest sheet starts (m).
    pub fn clearance(&self) -> f64 {
        match self {
            Self::DoubleDiaphragm(p) => p.clearance.si(),
            // The plies lie on the tool; the clearance is that of the film over them.
            Self::SingleDiaphragm(_) | Self::Press(_) | Self::Stamping(_) => 0.0,
        }
    }

    /// Whether there is no machine bed under the tool: what hangs beside it hangs in the air.
    pub fn is_without_bed(&self) -> bool {
        match self {
            Self::DoubleDiaphragm(_) => false,
            Self::SingleDiaphragm(p) => !p.bed,
            Self::Press(_) | Self::Stamping(_) => true,
        }
    }

    /// Length and width (m) of the opening of the frame that clamps films, of a process that has one.
    pub fn frame(&self) -> Option<[f64; 2]> {
        match self {
            Self::DoubleDiaphragm(p) => Some([p.frame_length.si(), p.frame_width.si()]),
            Self::SingleDiaphragm(p) => Some([p.frame_length.si(), p.frame_width.si()]),
            Self::Press(_) | Self::Stamping(_) => None,
        }
    }

    /// The word for it in a scene file.
    pub fn word(&self) -> &'static str {
        match self {
            Self::DoubleDiaphragm(_) => "double_diaphragm",
            Self::SingleDiaphragm(_) => "single_diaphragm",
            Self::Press(_) => "press",
            Self::Stamping(_) => "stamping",
        }
    }
}

/// Press forming: the scene's tool is the punch, drawn where it ends. It starts `stroke` below, in touch with
/// the lowest ply, and rises through the opening of the die, a plate over the plies; a blank holder below them,
/// when given, keeps them from folding. Upside down to most presses; nothing depends on that but the weight,
/// which is left out unless `weight` says where it pulls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Press {
    /// Way of the punch, from its first touch.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub stroke: Length,
    /// Simulated duration of the stroke.
    #[schemars(extend("x-exclusive-minimum" = "0 s"))]
    pub forming_time: Time,
    /// Share of that time in which the punch gathers speed, and in which it loses it.
    #[serde(default = "Press::default_ramp_share")]
    #[schemars(extend("exclusiveMinimum" = 0, "maximum" = 0.5))]
    pub ramp_share: Number,
    /// Simulated duration after the stroke, for the motion to die out.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub settling_time: Time,
    /// The die.
    pub die: PressPlate,
    /// The blank holder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub holder: Option<Holder>,
    /// Where the weight of the plies pulls them; left out: they have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<Towards>,
}

impl Press {
    fn default_ramp_share() -> Number {
        Number(0.1)
    }
}

/// A direction in a press.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Towards {
    /// Upwards, onto the die.
    Die,
    /// Downwards, onto the holder.
    Holder,
}

/// A flat plate with a round opening about the tool's axis x = y = 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressPlate {
    /// Radius of the opening.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub opening_radius: Length,
    /// Radius of the rounding of its edge.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub edge_radius: Length,
}

/// The blank holder: a plate that keeps a distance from the die, or one that a force presses towards it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Holder {
    /// Its opening; that of the die unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub opening_radius: Option<Length>,
    /// Radius of the rounding of its edge; that of the die unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub edge_radius: Option<Length>,
    /// How it is held.
    pub hold: Hold,
}

/// What a blank holder keeps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Hold {
    /// Distance between the faces of die and holder.
    Gap(#[schemars(extend("x-exclusive-minimum" = "0 mm"))] Length),
    /// Force towards the die.
    Force(#[schemars(extend("x-minimum" = "0 N"))] Force),
}

/// Double-diaphragm forming: the frame is lowered with the bag under vacuum until the lower film meets
/// the bed, then the air under it is drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DoubleDiaphragm {
    /// Length of the frame's opening along x.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub frame_length: Length,
    /// Width of the frame's opening along y.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub frame_width: Length,
    /// Height of the lower film over the tool's highest point at the start.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub clearance: Length,
    /// Vacuum in the bag: pressure of the surroundings over that between the films. A single value comes in the second half of
    /// bagging; a table tells its course over all of bagging.
    #[schemars(extend("x-minimum" = "0 Pa"))]
    pub bag_pressure: PressureCourse,
    /// Pressure drawn under the lower film. A single value is that at the end, reached smoothly; a table tells its course over drawing.
    #[schemars(extend("x-minimum" = "0 Pa"))]
    pub forming_pressure: PressureCourse,
    /// Simulated duration of evacuating the bag.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub bagging_time: Time,
    /// Simulated duration of lowering the frame.
    #[schemars(extend("x-exclusive-minimum" = "0 s"))]
    pub lowering_time: Time,
    /// Simulated duration of drawing the air.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub drawing_time: Time,
    /// Simulated duration at full pressure, for the motion to die out.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub settling_time: Time,
    /// Strain by which the frame stretches the films before the bag is evacuated. Slack films have nothing to
    /// carry the in-plane compression of a stack under vacuum.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "maximum" = 0.2))]
    pub film_pre_stretch: Number,
    /// Distance around the plies beyond which the two films are taken as joined (they stick under the bag
    /// pressure; their seal lies at the frame).
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub film_joint_margin: Length,
    /// Where the weight of plies and films pulls them; left out: they have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<WeightDirection>,
}

/// Single-diaphragm forming: the plies lie on the tool, and one film above them is clamped in a frame. The frame comes down onto the bed
/// around the tool, or, without a bed, onto the tool itself. Then the air under the film is drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SingleDiaphragm {
    /// Length of the frame's opening along x.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub frame_length: Length,
    /// Width of the frame's opening along y.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub frame_width: Length,
    /// Height of the film over the plies at the start.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub clearance: Length,
    /// Pressure drawn under the film. A single value is that at the end, reached smoothly; a table tells its course over drawing.
    #[schemars(extend("x-minimum" = "0 Pa"))]
    pub forming_pressure: PressureCourse,
    /// Pressure of the surroundings on the film, and under it before air is drawn.
    #[serde(default = "SingleDiaphragm::default_surroundings")]
    #[schemars(extend("x-exclusive-minimum" = "0 Pa"))]
    pub surroundings: Pressure,
    /// Simulated duration in which the frame stretches the film, and the weight comes.
    #[schemars(extend("x-exclusive-minimum" = "0 s"))]
    pub stretching_time: Time,
    /// Simulated duration of lowering the frame.
    #[schemars(extend("x-exclusive-minimum" = "0 s"))]
    pub lowering_time: Time,
    /// Simulated duration of drawing the air.
    #[schemars(extend("x-exclusive-minimum" = "0 s"))]
    pub drawing_time: Time,
    /// Simulated duration at full pressure, for the motion to die out.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub settling_time: Time,
    /// Strain by which the frame stretches the film before it is lowered.
    #[serde(default)]
    #[schemars(extend("minimum" = 0, "maximum" = 0.2))]
    pub film_pre_stretch: Number,
    /// Whether there is a bed around the tool, the plane z = 0, onto which the frame comes down. Without one the film hangs between frame and tool.
    #[serde(default = "SingleDiaphragm::with_bed")]
    pub bed: bool,
    /// Without a bed: height over z = 0 of the face on which the frame ends; 0 mm unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub frame_height: Option<Length>,
    /// Where the weight of plies and film pulls them, which can only be onto the tool; left out: they have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<WeightDirection>,
}

impl SingleDiaphragm {
    fn default_surroundings() -> Pressure {
        Pressure(1e5)
    }

    fn with_bed() -> bool {
        true
    }
}

/// A pressure that comes in one phase of the process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(extend("x-expected" = "a pressure such as `1 bar`, or {table: [{share: 0, pressure: 0 kPa}, .., {share: 1, pressure: ..}]}"))]
pub enum PressureCourse {
    /// What it is at the end of the phase; it grows smoothly.
    Value(Pressure),
    /// Its course over the phase.
    Course(PressureTable),
}

impl PressureCourse {
    /// What it is at the end of the phase (Pa); 0 for a table without rows.
    pub fn last(&self) -> f64 {
        match self {
            Self::Value(p) => p.si(),
            Self::Course(c) => c.table.last().map_or(0.0, |row| row.pressure.si()),
        }
    }
}

/// The course of a pressure over a phase.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureTable {
    /// Two or more rows, from share 0 with no pressure to share 1. Between them a monotone cubic without kinks.
    pub table: Vec<PressureAt>,
}

/// A row of the course of a pressure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureAt {
    /// Share of the phase that is over: growing from 0 to 1.
    #[schemars(extend("minimum" = 0, "maximum" = 1))]
    pub share: Number,
    /// Pressure then.
    #[schemars(extend("x-minimum" = "0 Pa"))]
    pub pressure: Pressure,
}

/// A direction in forming under films.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum WeightDirection {
    /// Downwards, onto the tool and the bed.
    Tool,
    /// Upwards, away from them: a machine whose tool hangs over the films.
    Away,
}
