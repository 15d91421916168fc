//! The newtypes.

use crate::units::dimension::{Dimension, UnitError, si_number, si_text};
use crate::units::parse::parse_quantity;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{self, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::borrow::Cow;
use std::fmt;

/// The shape of a quantity's text in JSON Schemas: a decimal number, then a unit. Which units fit is in
/// the description.
pub const QUANTITY_PATTERN: &str =
    r"^\s*[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\s*(1?\s*/\s*)?[A-Za-z°µμ%].*$";

/// Reads the text of one quantity; refuses bare numbers with the unit that is missing.
struct QuantityVisitor(Dimension);

impl Visitor<'_> for QuantityVisitor {
    type Value = f64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} with its unit, such as `{}`",
            self.0.with_article(),
            self.0.example()
        )
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<f64, E> {
        parse_quantity(text, self.0).map_err(E::custom)
    }

    fn visit_f64<E: de::Error>(self, v: f64) -> Result<f64, E> {
        let text = si_number(v);
        Err(E::custom(UnitError::MissingUnit {
            text,
            dimension: Some(self.0),
        }))
    }

    fn visit_i64<E: de::Error>(self, v: i64) -> Result<f64, E> {
        self.visit_f64(v as f64)
    }

    fn visit_u64<E: de::Error>(self, v: u64) -> Result<f64, E> {
        self.visit_f64(v as f64)
    }
}

macro_rules! quantities {
    ($($name:ident: $doc:literal,)*) => {$(
        #[doc = $doc]
        #[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default)]
        pub struct $name(
            /// SI value.
            pub f64,
        );

        impl $name {
            /// Its dimension.
            pub const DIMENSION: Dimension = Dimension::$name;

            /// The SI value.
            pub const fn si(self) -> f64 {
                self.0
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(&si_text(self.0, Self::DIMENSION))
            }
        }

        impl std::str::FromStr for $name {
            type Err = UnitError;
            fn from_str(text: &str) -> Result<Self, Self::Err> {
                parse_quantity(text, Self::DIMENSION).map(Self)
            }
        }

        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
                if !self.0.is_finite() {
                    return Err(serde::ser::Error::custom(format!("{} is not finite", self.0)));
                }
                s.collect_str(self)
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                d.deserialize_any(QuantityVisitor(Self::DIMENSION)).map(Self)
            }
        }

        impl JsonSchema for $name {
            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                quantity_schema(Self::DIMENSION)
            }
        }
    )*};
}

/// JSON Schema of the text of a quantity; `x-dimension` names the dimension for checkers that know units.
pub fn quantity_schema(dimension: Dimension) -> Schema {
    json_schema!({
        "type": "string",
        "pattern": QUANTITY_PATTERN,
        "description": format!(
            "{} with its unit, such as `{}`.", capital(dimension.with_article()), dimension.example()
        ),
        "examples": [dimension.example()],
        "x-dimension": dimension.name(),
    })
}

fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars
        .next()
        .map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}

quantities! {
    Length: "A length (m).",
    Area: "An area (m2).",
    Volume: "A volume (m3).",
    Time: "A time (s).",
    Frequency: "A frequency (Hz).",
    Mass: "A mass (kg).",
    Angle: "An angle (rad).",
    Velocity: "A velocity (m/s).",
    Acceleration: "An acceleration (m/s2).",
    Force: "A force (N).",
    Pressure: "A pressure or modulus (Pa).",
    Energy: "An energy (J).",
    ArealMass: "A mass per area (kg/m2).",
    Density: "A density (kg/m3).",
    ForcePerLength: "A force per length (N/m).",
    Moment: "A moment (N m), or a bending stiffness per width (N m2/m).",
    Curvature: "A curvature (1/m).",
    Temperature: "A temperature (K).",
}

/// A number without dimension, written bare: `0.3`.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Default, Serialize)]
#[serde(transparent)]
pub struct Number(
    /// The value.
    pub f64,
);

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct NumberVisitor;
        impl Visitor<'_> for NumberVisitor {
            type Value = f64;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a plain number such as `0.3`")
            }
            fn visit_f64<E: de::Error>(self, v: f64) -> Result<f64, E> {
                if v.is_finite() {
                    Ok(v)
                } else {
                    Err(E::custom("the number must be finite"))
                }
            }
            fn visit_i64<E: de::Error>(self, v: i64) -> Result<f64, E> {
                Ok(v as f64)
            }
            fn visit_u64<E: de::Error>(self, v: u64) -> Result<f64, E> {
                Ok(v as f64)
            }
        }
        d.deserialize_any(NumberVisitor).map(Number)
    }
}

impl JsonSchema for Number {
    fn schema_name() -> Cow<'static, str> {
        "Number".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "number",
            "description": "A plain number without unit, such as `0.3`.",
        })
    }
}
