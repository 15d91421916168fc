//! The words by which a scene puts a tool from a file, or from another step, in its place. What they come to is in [`super::placed`].

use crate::fault::{Fault, Path, Rule};
use crate::units::{Angle, Dimension, Length, Number, QUANTITY_PATTERN, parse_quantity};
use plyflow_fixed::FixedBits;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::f64::consts::FRAC_PI_2;

/// A direction: an axis by its name, or a vector of any length.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(extend("x-expected" = "an axis such as `+y`, or a vector such as `[0, 0.5, 1]`"))]
pub enum Direction {
    /// An axis.
    Axis(Axis),
    /// A vector.
    Vector([Number; 3]),
}

/// An axis with its sense.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Axis {
    /// Along x.
    #[serde(rename = "+x")]
    PlusX,
    /// Against x.
    #[serde(rename = "-x")]
    MinusX,
    /// Along y.
    #[serde(rename = "+y")]
    PlusY,
    /// Against y.
    #[serde(rename = "-y")]
    MinusY,
    /// Along z.
    #[serde(rename = "+z")]
    PlusZ,
    /// Against z.
    #[serde(rename = "-z")]
    MinusZ,
}

impl Axis {
    /// All of them, z first: where several do, the first is taken.
    pub const ALL: [Self; 6] = [
        Self::PlusZ,
        Self::MinusZ,
        Self::PlusY,
        Self::MinusY,
        Self::PlusX,
        Self::MinusX,
    ];

    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            Self::PlusX => "+x",
            Self::MinusX => "-x",
            Self::PlusY => "+y",
            Self::MinusY => "-y",
            Self::PlusZ => "+z",
            Self::MinusZ => "-z",
        }
    }

    /// Its unit vector.
    pub fn vector(self) -> [f64; 3] {
        match self {
            Self::PlusX => [1.0, 0.0, 0.0],
            Self::MinusX => [-1.0, 0.0, 0.0],
            Self::PlusY => [0.0, 1.0, 0.0],
            Self::MinusY => [0.0, -1.0, 0.0],
            Self::PlusZ => [0.0, 0.0, 1.0],
            Self::MinusZ => [0.0, 0.0, -1.0],
        }
    }
}

impl Direction {
    /// Its unit vector; `None` for one without length.
    pub fn unit(&self) -> Option<[f64; 3]> {
        let v = match self {
            Self::Axis(axis) => return Some(axis.vector()),
            Self::Vector(v) => v.map(|c| c.0),
        };
        let length = v[0].fixed_hypot(v[1]).fixed_hypot(v[2]);
        (length > 0.0 && length.is_finite()).then(|| v.map(|c| c / length))
    }
}

/// How a tool is turned once its `up` points up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(extend("x-expected" = "an angle about z such as `90 deg`, or a list of turns, [{axis: +x, angle: 90 deg}, ..]"))]
pub enum Rotation {
    /// About z, counter-clockwise seen from above.
    AboutZ(Angle),
    /// About axes of the scene, one after the other.
    Turns(Vec<Turn>),
}

/// A turn about an axis of the scene through the origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Turn {
    /// The axis.
    pub axis: Direction,
    /// The angle, counter-clockwise for who looks against the axis.
    pub angle: Angle,
}

/// The word `auto`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Auto {
    /// Found from the box around the tool.
    Auto,
}

/// Where the middle of the box around the tool comes to in the plane.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
#[schemars(extend("x-expected" = "`auto`, or a place of the scene, `[x, y]`"))]
pub enum Centre {
    /// To x = y = 0.
    Auto(Auto),
    /// To this place.
    At([Length; 2]),
}

impl Centre {
    /// The place (m).
    pub fn at(&self) -> [f64; 2] {
        match self {
            Self::Auto(_) => [0.0; 2],
            Self::At(at) => at.map(|c| c.si()),
        }
    }
}

/// The height that the lowest point of the tool comes to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Foot {
    /// The bed, z = 0.
    Auto,
    /// This one.
    At(Length),
}

impl Foot {
    /// The height (m).
    pub fn at(self) -> f64 {
        match self {
            Self::Auto => 0.0,
            Self::At(z) => z.si(),
        }
    }
}

impl Serialize for Foot {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Auto => s.serialize_str("auto"),
            Self::At(z) => z.serialize(s),
        }
    }
}

impl<'de> Deserialize<'de> for Foot {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let text = String::deserialize(d)?;
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let z = parse_quantity(&text, Dimension::Length).map_err(D::Error::custom)?;
        Ok(Self::At(Length(z)))
    }
}

impl JsonSchema for Foot {
    fn schema_name() -> Cow<'static, str> {
        "Foot".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "pattern": format!("^auto$|{QUANTITY_PATTERN}"),
            "description": "`auto` for the bed, or a height with its unit, such as `5 mm`.",
            "examples": ["auto", "5 mm"],
            "x-dimension": "length",
            "x-words": ["auto"],
        })
    }
}

/// What a tool's words say about its place.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Place {
    /// Moves what was given, along its own axes, before anything else (m).
    pub translate: [f64; 3],
    /// What direction of it becomes z.
    pub up: Option<Direction>,
    /// How it is turned then.
    pub rotate: Option<Rotation>,
    /// Where the middle of the box around it comes to.
    pub centre: Option<Centre>,
    /// Where its lowest point comes to.
    pub foot: Option<Foot>,
}

/// Directions that differ by less are the same axis.
const SAME_AXIS: f64 = 1e-14;

/// Angles that differ by less (rad) from a whole number of quarter turns are one.
const SAME_ANGLE: f64 = 1e-12;

impl Place {
    /// Whether nothing but `translate` is said.
    pub fn only_moves(&self) -> bool {
        self.up.is_none() && self.rotate.is_none() && self.centre.is_none() && self.foot.is_none()
    }

    /// The first of its words that makes no sense; `at`: where the tool's words stand.
    ///
    /// # Errors
    /// A direction without length.
    pub fn check(&self, at: &Path) -> Result<(), Fault> {
        let none = |path: Path| {
            Fault::text(Rule::Tool, path, "the vector has no length")
                .expected("an axis such as `+y`, or a vector such as `[0, 0.5, 1]`")
                .help("give the direction that is to be meant")
        };
        if self.up.is_some_and(|up| up.unit().is_none()) {
            return Err(none(at.key("up")));
        }
        let Some(Rotation::Turns(turns)) = &self.rotate else {
            return Ok(());
        };
        match turns.iter().position(|t| t.axis.unit().is_none()) {
            Some(k) => Err(none(at.key("rotate").item(k).key("axis"))),
            None => Ok(()),
        }
    }

    /// The turn that it comes to, by rows: first that of `up`, then those of `rotate`.
    pub fn turn(&self) -> [[f64; 3]; 3] {
        let up = self.up.and_then(|up| up.unit());
        let mut all = up.map_or(UNTURNED, upright);
        match &self.rotate {
            None => {}
            Some(Rotation::AboutZ(angle)) => all = times(about([0.0, 0.0, 1.0], angle.si()), all),
            Some(Rotation::Turns(turns)) => {
                for turn in turns {
                    let axis = turn.axis.unit().unwrap_or([0.0, 0.0, 1.0]);
                    all = times(about(axis, turn.angle.si()), all);
                }
            }
        }
        all
    }
}

type Matrix = [[f64; 3]; 3];

const UNTURNED: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

fn times(a: Matrix, b: Matrix) -> Matrix {
    a.map(|row| std::array::from_fn(|k| (0..3).map(|j| row[j] * b[j][k]).sum()))
}

/// A turn about a unit vector. Quarter turns about axes are exact.
fn about([x, y, z]: [f64; 3], angle: f64) -> Matrix {
    let (s, c) = quarter_turns(angle).unwrap_or_else(|| angle.fixed_sin_cos());
    let v = 1.0 - c;
    [
        [c + x * x * v, x * y * v - z * s, x * z * v + y * s],
        [y * x * v + z * s, c + y * y * v, y * z * v - x * s],
        [z * x * v - y * s, z * y * v + x * s, c + z * z * v],
    ]
}

/// The smallest turn that brings a unit vector to z; of the many from -z the half turn about x.
fn upright([x, y, z]: [f64; 3]) -> Matrix {
    let across = x.fixed_hypot(y);
    if across < SAME_AXIS {
        return match z > 0.0 {
            true => UNTURNED,
            false => about([1.0, 0.0, 0.0], std::f64::consts::PI),
        };
    }
    // About the horizontal direction square to it, by the angle between it and z: both as they are, without an angle of their own.
    let [ax, ay] = [y / across, -x / across];
    let (s, c, v) = (across, z, 1.0 - z);
    [
        [c + ax * ax * v, ax * ay * v, ay * s],
        [ay * ax * v, c + ay * ay * v, -ax * s],
        [-ay * s, ax * s, c],
    ]
}

/// Sine and cosine of a whole number of quarter turns, exact; `None` of another angle (rad).
fn quarter_turns(angle: f64) -> Option<(f64, f64)> {
    let turns = angle / FRAC_PI_2;
    let whole = turns.round();
    if (turns - whole).abs() > SAME_ANGLE || whole.abs() > 1e9 {
        return None;
    }
    Some(match (whole as i64).rem_euclid(4) {
        0 => (0.0, 1.0),
        1 => (1.0, 0.0),
        2 => (0.0, -1.0),
        _ => (-1.0, 0.0),
    })
}
