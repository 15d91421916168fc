//! Units of drawings.

use plyflow_model::units::{Dimension, parse_quantity, si_text};

/// Symbols of units by `$INSUNITS`.
pub(super) const UNITS: [(i64, &str); 10] = [
    (1, "in"),
    (2, "ft"),
    (4, "mm"),
    (5, "cm"),
    (6, "m"),
    (7, "km"),
    (13, "um"),
    (14, "dm"),
    (15, "dam"),
    (16, "hm"),
];

/// How long one unit of a file is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unit {
    /// A unit that has a symbol: then a number is read as a scene would read it, to the last bit.
    Symbol(&'static str),
    /// So many metres.
    Metres(f64),
}

impl std::fmt::Display for Unit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Symbol(symbol) => write!(f, "1 {symbol}"),
            Self::Metres(metres) => f.write_str(&si_text(*metres, Dimension::Length)),
        }
    }
}

impl Unit {
    /// One unit of so many metres.
    pub fn of(metres: f64) -> Self {
        let named = UNITS.iter().map(|u| u.1);
        let mut same =
            named.filter(|s| parse_quantity(&format!("1 {s}"), Dimension::Length) == Ok(metres));
        same.next().map_or(Self::Metres(metres), Self::Symbol)
    }

    /// A number of the file (m); `None` where it is no finite one.
    pub fn metres(self, text: &str) -> Option<f64> {
        let plain = crate::number::plain(text, crate::number::Decimal::Point)?;
        let metres = match self {
            Self::Symbol(symbol) => {
                parse_quantity(&format!("{plain} {symbol}"), Dimension::Length).ok()?
            }
            Self::Metres(m) => m * plain.parse::<f64>().ok()?,
        };
        // No part is as large as the earth.
        (metres.abs() < 1e7).then_some(metres + 0.0)
    }

    /// One unit (m).
    pub fn one(self) -> f64 {
        self.metres("1").unwrap_or(f64::NAN)
    }
}
