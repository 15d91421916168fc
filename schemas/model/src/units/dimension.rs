//! Dimensions, and what can be wrong with the text of a quantity.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Exponents of metre, kilogram, second, kelvin, radian. Angle is a dimension of its own, so that a
/// length is never taken for an arc or a frequency for a spin.
pub type Exponents = [i8; 5];

/// A physical dimension that parameters may have.
#[derive(
    Debug,
    Clone,
    Copy,
    PartialEq,
    Eq,
    Hash,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)] // the names say all
pub enum Dimension {
    Length,
    Area,
    Volume,
    Time,
    Frequency,
    Mass,
    Angle,
    Velocity,
    Acceleration,
    Force,
    /// Also moduli.
    Pressure,
    Energy,
    ArealMass,
    Density,
    ForcePerLength,
    /// N m; also bending stiffness per width, N m2/m.
    Moment,
    Curvature,
    Temperature,
    Dimensionless,
}

impl Dimension {
    /// All dimensions, in the order of the manual.
    pub const ALL: [Dimension; 19] = [
        Dimension::Length,
        Dimension::Area,
        Dimension::Volume,
        Dimension::Time,
        Dimension::Frequency,
        Dimension::Mass,
        Dimension::Angle,
        Dimension::Velocity,
        Dimension::Acceleration,
        Dimension::Force,
        Dimension::Pressure,
        Dimension::Energy,
        Dimension::ArealMass,
        Dimension::Density,
        Dimension::ForcePerLength,
        Dimension::Moment,
        Dimension::Curvature,
        Dimension::Temperature,
        Dimension::Dimensionless,
    ];

    /// (name in manifests, with article, example, SI base unit, exponents). Long, as it is a table, one row for each dimension.
    const fn row(
        self,
    ) -> (
        &'static str,
        &'static str,
        &'static str,
        &'static str,
        Exponents,
    ) {
        match self {
            Dimension::Length => ("length", "a length", "5 mm", "m", [1, 0, 0, 0, 0]),
            Dimension::Area => ("area", "an area", "20 cm2", "m2", [2, 0, 0, 0, 0]),
            Dimension::Volume => ("volume", "a volume", "3 cm3", "m3", [3, 0, 0, 0, 0]),
            Dimension::Time => ("time", "a time", "20 ms", "s", [0, 0, 1, 0, 0]),
            Dimension::Frequency => ("frequency", "a frequency", "50 Hz", "Hz", [0, 0, -1, 0, 0]),
            Dimension::Mass => ("mass", "a mass", "2 kg", "kg", [0, 1, 0, 0, 0]),
            Dimension::Angle => ("angle", "an angle", "8 deg", "rad", [0, 0, 0, 0, 1]),
            Dimension::Velocity => ("velocity", "a velocity", "2 m/s", "m/s", [1, 0, -1, 0, 0]),
            Dimension::Acceleration => (
                "acceleration",
                "an acceleration",
                "9.81 m/s2",
                "m/s2",
                [1, 0, -2, 0, 0],
            ),
            Dimension::Force => ("force", "a force", "10 N", "N", [1, 1, -2, 0, 0]),
            Dimension::Pressure => (
                "pressure",
                "a pressure or modulus",
                "3 GPa",
                "Pa",
                [-1, 1, -2, 0, 0],
            ),
            Dimension::Energy => ("energy", "an energy", "2 mJ", "J", [2, 1, -2, 0, 0]),
            Dimension::ArealMass => (
                "areal_mass",
                "an areal mass",
                "440 g/m2",
                "kg/m2",
                [-2, 1, 0, 0, 0],
            ),
            Dimension::Density => (
                "density",
                "a density",
                "1.2 g/cm3",
                "kg/m3",
                [-3, 1, 0, 0, 0],
            ),
            Dimension::ForcePerLength => (
                "force_per_length",
                "a force per length",
                "112 N/m",
                "N/m",
                [0, 1, -2, 0, 0],
            ),
            Dimension::Moment => (
                "moment",
                "a moment or bending stiffness",
                "0.19 N mm",
                "N m",
                [2, 1, -2, 0, 0],
            ),
            Dimension::Curvature => (
                "curvature",
                "a curvature",
                "0.004 1/mm",
                "1/m",
                [-1, 0, 0, 0, 0],
            ),
            Dimension::Temperature => (
                "temperature",
                "a temperature",
                "20 degC",
                "K",
                [0, 0, 0, 1, 0],
            ),
            Dimension::Dimensionless => (
                "dimensionless",
                "a plain number",
                "0.3",
                "",
                [0, 0, 0, 0, 0],
            ),
        }
    }

    /// Name in manifests, e.g. `areal_mass`.
    pub const fn name(self) -> &'static str {
        self.row().0
    }

    /// Name with its article, e.g. `an areal mass`.
    pub const fn with_article(self) -> &'static str {
        self.row().1
    }

    /// A value as one writes it, e.g. `440 g/m2`.
    pub const fn example(self) -> &'static str {
        self.row().2
    }

    /// SI base unit, e.g. `kg/m2`; empty when dimensionless.
    pub const fn base_unit(self) -> &'static str {
        self.row().3
    }

    /// Exponents of the base units.
    pub const fn exponents(self) -> Exponents {
        self.row().4
    }

    /// The first dimension with these exponents.
    pub fn of(exponents: Exponents) -> Option<Dimension> {
        Dimension::ALL
            .into_iter()
            .find(|d| d.exponents() == exponents)
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The shortest text that reads back as the same double: `0.005`, `100000`, `1e-20`.
pub fn si_number(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// A quantity as text in the SI base unit: `0.005 m`.
pub fn si_text(value: f64, dimension: Dimension) -> String {
    match dimension.base_unit() {
        "" => si_number(value),
        unit => format!("{} {unit}", si_number(value)),
    }
}

/// Why a text is no quantity of the expected dimension.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum UnitError {
    /// The text does not begin with a decimal number.
    #[error("`{text}` does not begin with a number; expected {}", expected(*.dimension))]
    BadNumber {
        /// As given.
        text: String,
        /// Expected.
        dimension: Option<Dimension>,
    },
    /// A comma inside the number.
    #[error("`{text}` has a comma in its number; expected {}", expected(*.dimension))]
    Comma {
        /// As given.
        text: String,
        /// What to write: with a decimal point, and without a sign where the comma may separate thousands.
        written: Vec<String>,
        /// Expected.
        dimension: Option<Dimension>,
    },
    /// A number without unit.
    #[error("`{text}` has no unit; expected {}", expected(*.dimension))]
    MissingUnit {
        /// As given.
        text: String,
        /// Expected.
        dimension: Option<Dimension>,
    },
    /// A unit that is not known.
    #[error("unknown unit `{unit}` in `{text}`{}; expected {}", meant(.nearest.as_deref()), expected(*.dimension))]
    UnknownUnit {
        /// As given.
        text: String,
        /// The part that is not known.
        unit: String,
        /// What was probably meant.
        nearest: Option<String>,
        /// Expected.
        dimension: Option<Dimension>,
    },
    /// A unit of another system, which is not taken.
    #[error("unknown unit `{unit}` in `{text}` (write {write}); expected {}", expected(*.dimension))]
    Foreign {
        /// As given.
        text: String,
        /// The part that is not known.
        unit: String,
        /// What to write instead, and the factor.
        write: &'static str,
        /// Expected.
        dimension: Option<Dimension>,
    },
    /// A unit of another dimension.
    #[error("`{text}` is {got}; expected {}", expected(Some(*.dimension)))]
    WrongDimension {
        /// As given.
        text: String,
        /// Its dimension in words, e.g. `a time`.
        got: String,
        /// Expected.
        dimension: Dimension,
    },
    /// The value is too large for a double.
    #[error("`{text}` is too large for a number of this program")]
    TooLarge {
        /// As given.
        text: String,
    },
}

impl UnitError {
    /// What is wrong, without what was expected: "`5` has no unit".
    pub fn reason(&self) -> String {
        match self {
            UnitError::BadNumber { text, .. } => format!("`{text}` does not begin with a number"),
            UnitError::Comma { text, .. } => format!("`{text}` has a comma in its number"),
            UnitError::MissingUnit { text, .. } => format!("`{text}` has no unit"),
            UnitError::UnknownUnit { text, unit, .. } | UnitError::Foreign { text, unit, .. }
                if text == unit =>
            {
                format!("unknown unit `{unit}`")
            }
            UnitError::UnknownUnit { text, unit, .. } | UnitError::Foreign { text, unit, .. } => {
                format!("unknown unit `{unit}` in `{text}`")
            }
            UnitError::WrongDimension { text, got, .. } => format!("`{text}` is {got}"),
            UnitError::TooLarge { .. } => self.to_string(),
        }
    }

    /// What to write instead, in one line.
    pub fn help(&self) -> String {
        let write = |d: Option<Dimension>| {
            format!(
                "write a number and a unit, such as `{}`",
                d.map_or("5 mm", Dimension::example)
            )
        };
        match self {
            UnitError::BadNumber { dimension, .. } => write(*dimension),
            UnitError::Comma { written, .. } => {
                let written: Vec<String> = written.iter().map(|w| format!("`{w}`")).collect();
                format!(
                    "decimals have a point, thousands no sign: write {}",
                    written.join(" or ")
                )
            }
            UnitError::MissingUnit { text, dimension } => match dimension {
                Some(Dimension::Dimensionless) => "write a plain number".into(),
                Some(d) => {
                    let unit = d.example().split_once(' ').map_or(d.base_unit(), |x| x.1);
                    format!("write the unit after the number, such as `{text} {unit}`")
                }
                None => write(None),
            },
            UnitError::UnknownUnit {
                nearest: Some(n), ..
            } => format!("did you mean `{n}`?"),
            UnitError::UnknownUnit { dimension, .. } => write(*dimension),
            UnitError::Foreign { write, .. } => format!("write {write}"),
            // Test machines tell forces as masses.
            UnitError::WrongDimension {
                dimension: Dimension::Force,
                got,
                ..
            } if got == Dimension::Mass.with_article() => {
                "as a force write `N`, `kgf` (9.80665 N), `gf` (0.00980665 N) or `lbf` (4.4482216152605 N)".into()
            }
            UnitError::WrongDimension { dimension, .. } => write(Some(*dimension)),
            UnitError::TooLarge { .. } => "check the exponent".into(),
        }
    }
}

/// "a length such as `5 mm`".
fn expected(dimension: Option<Dimension>) -> String {
    dimension.map_or_else(
        || "a quantity such as `5 mm`".into(),
        |d| format!("{} such as `{}`", d.with_article(), d.example()),
    )
}

fn meant(nearest: Option<&str>) -> String {
    nearest.map_or_else(String::new, |n| format!(" (did you mean `{n}`?)"))
}
