//! Friction in a scene: coefficients by class of surfaces, by named pair, by pressure and direction.

use crate::units::{Angle, Number, Pressure};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Coulomb friction coefficients.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Friction {
    /// Tool (and machine bed) against diaphragm; needed where the stack has diaphragms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 2))]
    pub tool_diaphragm: Option<Coefficient>,
    /// Tool (also bed, punch, die and blank holder) against fabric; needed in a press, in a stamping and under a single diaphragm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 2))]
    pub tool_fabric: Option<Coefficient>,
    /// Fabric against diaphragm; needed where the stack has diaphragms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 2))]
    pub fabric_diaphragm: Option<Coefficient>,
    /// Fabric against fabric; needed where plies lie on each other.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 2))]
    pub fabric_fabric: Option<Coefficient>,
    /// Diaphragm against diaphragm; needed where the stack has two diaphragms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 2))]
    pub diaphragm_diaphragm: Option<Coefficient>,
    /// Single pairs, each in the place of what its class says.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub pairs: Vec<FrictionPair>,
}

/// A coefficient: one number, or a law by pressure or direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Coefficient {
    /// The same everywhere.
    Constant(Number),
    /// By pressure, direction or both.
    Law(Box<FrictionLaw>),
}

/// A coefficient that depends on the pressure between the surfaces or on the way in which they slide.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrictionLaw {
    /// Coefficient; with a power law that at its reference pressure. Left out with a table of pressures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 2))]
    pub coefficient: Option<Number>,
    /// How it depends on the pressure (normal force over the area of a node); left out: not at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<PressureLaw>,
    /// How it depends on the angle between sliding and fibres; left out: not at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle: Option<AngleLaw>,
}

/// A pair of surfaces with its own coefficient or law.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrictionPair {
    /// Two names, in either order: of sheets, or of what is rigid: `tool`, `bed` (double diaphragm), `die`, `holder` (press).
    pub between: [String; 2],
    /// Coefficient; with a power law that at its reference pressure. Left out with a table of pressures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0, "maximum" = 2))]
    pub coefficient: Option<Number>,
    /// How it depends on the pressure (normal force over the area of a node); left out: not at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pressure: Option<PressureLaw>,
    /// How it depends on the angle between sliding and fibres; left out: not at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle: Option<AngleLaw>,
}

impl FrictionPair {
    /// Its two names, as given.
    pub fn names(&self) -> [&str; 2] {
        self.between.each_ref().map(String::as_str)
    }

    /// Its law.
    pub fn law(&self) -> FrictionLaw {
        FrictionLaw {
            coefficient: self.coefficient,
            pressure: self.pressure.clone(),
            angle: self.angle.clone(),
        }
    }
}

/// How a coefficient depends on pressure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PressureLaw {
    /// coefficient (p / reference)^exponent, at most 2.
    Power(PowerLaw),
    /// Coefficients by pressure, growing: linear between the rows, constant beyond them.
    Table(Vec<PressureRow>),
}

/// A power law of pressure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PowerLaw {
    /// Pressure at which the coefficient is what `coefficient` says.
    #[schemars(extend("x-exclusive-minimum" = "0 Pa"))]
    pub reference: Pressure,
    /// Exponent: more than -1, so that friction itself grows with pressure, and at most 1.
    #[schemars(extend("minimum" = -1, "maximum" = 1))]
    pub exponent: Number,
}

/// A row of a table by pressure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PressureRow {
    /// Pressure.
    #[schemars(extend("x-minimum" = "0 Pa"))]
    pub pressure: Pressure,
    /// Coefficient there.
    #[schemars(extend("minimum" = 0, "maximum" = 2))]
    pub coefficient: Number,
}

/// How a coefficient depends on the angle between the way in which the surfaces slide and the fibres of a ply, which turn
/// with it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AngleLaw {
    /// Whose fibres: of the lower or the upper of the two surfaces. Needed between two plies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub of: Option<Place>,
    /// Which fibre family: 1 or 2.
    #[serde(default = "AngleLaw::first_family")]
    #[schemars(extend("minimum" = 1, "maximum" = 2))]
    pub family: u8,
    /// Factors on the coefficient by angle, growing from 0 to 90 deg: linear between the rows, constant beyond them.
    pub factors: Vec<AngleRow>,
}

impl AngleLaw {
    fn first_family() -> u8 {
        1
    }
}

/// A place in the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// The one nearer to the tool.
    Lower,
    /// The other one.
    Upper,
}

/// A row of a table by angle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AngleRow {
    /// Angle between sliding and fibres.
    #[schemars(extend("x-minimum" = "0 deg", "x-maximum" = "90 deg"))]
    pub angle: Angle,
    /// Factor there.
    #[schemars(extend("minimum" = 0))]
    pub factor: Number,
}
