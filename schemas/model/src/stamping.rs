//! Forming between any rigid parts: what a scene says of them.
//!
//! A part is drawn where it stands when it is closed. Its `way` tells how far off that place it is, away from the sheets.

use crate::tool::Tool;
use crate::tool::place::{Centre, Direction, Foot, Place, Rotation};
use crate::units::{Angle, Force, ForcePerLength, Length, Mass, Time};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Stamping: plies between rigid parts, each of which stands still, moves after a table, or is pressed by a force. The scene's tool is one
/// of them, below the plies, and stands still unless `parts` has an entry with the name `tool`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Stamping {
    /// Simulated duration of everything that moves.
    #[schemars(extend("x-exclusive-minimum" = "0 s"))]
    pub forming_time: Time,
    /// Simulated duration after that, for the motion to die out.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub settling_time: Time,
    /// Height of the lower face of the lowest ply at the start; left out: the plies lie on the part below them that reaches highest then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blank_height: Option<Length>,
    /// Where the weight of the plies pulls them; left out: they have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<Vertical>,
    /// The rigid parts besides the tool, and how the tool moves.
    pub parts: Vec<StampingPart>,
    /// Grippers that pull at places of plies.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub grippers: Vec<Gripper>,
}

impl Stamping {
    /// Names of the rigid parts, `tool` first, with their sides.
    pub fn sides(&self) -> Vec<(&str, Side)> {
        let others = self.parts.iter().filter(|p| p.name != TOOL);
        let others = others.map(|p| (p.name.as_str(), p.side));
        std::iter::once((TOOL, Side::Below)).chain(others).collect()
    }
}

/// Name of the scene's tool among the parts.
pub const TOOL: &str = "tool";

/// A direction along z.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Vertical {
    /// Against z.
    Down,
    /// Along z.
    Up,
}

/// On which side of the plies a part is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// It touches the lower faces of plies.
    Below,
    /// It touches their upper faces.
    Above,
}

impl Side {
    /// The word for it in a scene file.
    pub fn word(self) -> &'static str {
        match self {
            Self::Below => "below",
            Self::Above => "above",
        }
    }

    /// Away from the sheets along z: -1 of a part below them, 1 of one above.
    pub fn away(self) -> f64 {
        match self {
            Self::Below => -1.0,
            Self::Above => 1.0,
        }
    }
}

/// A rigid part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StampingPart {
    /// Name of its body in artifacts; `tool` for the scene's own tool.
    pub name: String,
    /// On which side of the plies it is.
    pub side: Side,
    /// Its surface: a parametric tool, a file, or what another step makes. The scene's own tool has none here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tool: Option<Tool>,
    /// Instead of `tool`: the die that closes over the scene's tool, a `double_dome`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub matching: Option<MatchingDie>,
    /// Moves what `tool` makes, before anything else.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub translate: [Length; 3],
    /// Which direction of what `tool` makes becomes z, by the smallest turn: `-z` turns it over.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<Direction>,
    /// Turns it then, about z or one after the other about axes of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate: Option<Rotation>,
    /// Moves the middle of the box around it to x = y = 0, or to another place of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre: Option<Centre>,
    /// Moves its lowest point to z = 0, or to another height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub foot: Option<Foot>,
    /// The direction in which `way` counts; left out: away from the sheets, down of a part below them and up of one above.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Direction>,
    /// How it moves; left out: it stands still.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<PartMotion>,
}

fn is_zero(translate: &[Length; 3]) -> bool {
    translate.iter().all(|t| t.si() == 0.0)
}

impl StampingPart {
    /// Where its own words put it, besides those of its tool.
    pub fn place(&self) -> Place {
        Place {
            translate: self.translate.map(|t| t.si()),
            up: self.up,
            rotate: self.rotate.clone(),
            centre: self.centre,
            foot: self.foot,
        }
    }

    /// Unit vector in which its way counts.
    pub fn outwards(&self) -> [f64; 3] {
        let away = [0.0, 0.0, self.side.away()];
        self.direction.and_then(|d| d.unit()).unwrap_or(away)
    }
}

/// A block with a hollow that is the scene's `double_dome` and `gap` all around it, open downwards, with a rounded edge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MatchingDie {
    /// Distance from the tool when the die is closed.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub gap: Length,
    /// Radius of the rounding between hollow and face.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub edge_radius: Length,
    /// Height of the flat face around the hollow over the foot of the tool when the die is closed.
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub face: Length,
    /// Length of the block along x.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Width of the block along y.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub width: Length,
}

/// How a part moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PartMotion {
    /// After a table: two or more rows, from time 0 on. At rest in the first and the last row; between them a monotone cubic without kinks.
    Table(Vec<WayAt>),
    /// By a force towards the sheets.
    Pressed(Pressed),
}

/// A row of the table of a motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WayAt {
    /// When.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub time: Time,
    /// How far the part is off the place where it is drawn, away from the sheets.
    pub way: Length,
}

/// A force that presses a part towards the sheets, with a spring behind it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Pressed {
    /// The force where the part is drawn; a single value grows over the first twentieth of the forming time.
    pub force: ForceCourse,
    /// What a spring adds to it for each length that the part is pushed back from there; left out: nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 N/m"))]
    pub spring: Option<ForcePerLength>,
    /// How far the part may go beyond the place where it is drawn, towards the sheets. There is its stop. Left out: until it meets a part on the other
    /// side of the plies, where that one ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 mm"))]
    pub travel: Option<Length>,
    /// Its mass; left out: five times that of the plies, shared by all parts that are pressed, and at least once that of the plies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-exclusive-minimum" = "0 kg"))]
    pub mass: Option<Mass>,
}

/// A force over time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(extend("x-expected" = "a force such as `100 N`, or {table: [{time: 0 s, force: 0 N}, .., {time: .., force: ..}]}"))]
pub enum ForceCourse {
    /// The same once it has grown.
    Value(Force),
    /// Its course.
    Course(ForceTable),
}

/// The course of a force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceTable {
    /// Two or more rows, from time 0 on. Between them a monotone cubic without kinks.
    pub table: Vec<ForceAt>,
}

/// A row of the course of a force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceAt {
    /// When.
    #[schemars(extend("x-minimum" = "0 s"))]
    pub time: Time,
    /// The force then.
    #[schemars(extend("x-minimum" = "0 N"))]
    pub force: Force,
}

/// A gripper: it pulls a place of a ply along a direction in the plane, with a spring behind it, and follows the ply up and down.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gripper {
    /// Name of the ply.
    pub ply: String,
    /// Middle of the rectangle that is gripped, on the flat ply over the tool.
    pub centre: [Length; 2],
    /// Its length along x.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub length: Length,
    /// Its width along y.
    #[schemars(extend("x-exclusive-minimum" = "0 mm"))]
    pub width: Length,
    /// Direction of the pull from x, counter-clockwise seen from above.
    pub pull: Angle,
    /// The pull where the ply starts; it grows over the first twentieth of the forming time.
    #[schemars(extend("x-minimum" = "0 N"))]
    pub force: Force,
    /// What a spring adds to it for each length that the place is drawn against the pull; left out: nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("x-minimum" = "0 N/m"))]
    pub spring: Option<ForcePerLength>,
}
