//! Values of variables.

use crate::number::{Quantity, double, si_unit, text, words};
use crate::problem::Problem;
use plyflow_model::units::Exponents;

/// A value of a variable or of an expression.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A number, plain or with a unit.
    Quantity(Quantity),
    /// A text.
    Text(String),
    /// Yes or no.
    Bool(bool),
}

/// What a value is, for checks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A number of this dimension.
    Quantity(Exponents),
    /// A text.
    Text,
    /// Yes or no.
    Bool,
}

impl Kind {
    /// The SI unit of a number; empty for a plain one and for what is no number.
    #[must_use]
    pub fn si_unit(self) -> String {
        match self {
            Self::Quantity(exponents) => si_unit(exponents),
            _ => String::new(),
        }
    }

    /// In words.
    #[must_use]
    pub fn in_words(self) -> String {
        match self {
            Self::Quantity(exponents) => words(exponents),
            Self::Text => "text".into(),
            Self::Bool => "`true` or `false`".into(),
        }
    }
}

/// A value as it is written in a file.
#[derive(Debug, Clone, PartialEq)]
pub enum Written {
    /// `3`
    Integer(i64),
    /// `0.3`
    Decimal(f64),
    /// `45 deg`, or any text.
    Text(String),
    /// `true`
    Bool(bool),
}

impl Value {
    /// The value that a text of a file is: a quantity where it is one, else the text.
    ///
    /// # Errors
    /// When it is a quantity with more digits than are kept.
    pub fn of_text(given: &str) -> Result<Self, Problem> {
        match Quantity::read(given).transpose().map_err(|p| p.of(given))? {
            // A plain number in quotes is text: the file says so.
            Some(q) if !q.unit.is_empty() => Ok(Self::Quantity(q)),
            _ => Ok(Self::Text(given.to_owned())),
        }
    }

    /// The value that a cell of a table is.
    ///
    /// # Errors
    /// When it is a number with more digits than are kept, or the unit is not known.
    pub fn of_cell(cell: &str, unit: &str) -> Result<Self, Problem> {
        let unit = unit.trim();
        match (crate::number::exact(cell.trim()), cell) {
            (Some(number), _) => {
                let number = number.map_err(|p| p.of(cell))?;
                Ok(Self::Quantity(Quantity::new(number, unit)?))
            }
            (None, "true") if unit.is_empty() => Ok(Self::Bool(true)),
            (None, "false") if unit.is_empty() => Ok(Self::Bool(false)),
            (None, cell) => Self::of_text(cell),
        }
    }

    /// A plain number.
    ///
    /// # Errors
    /// When it is no number of a study.
    pub fn of_number(given: &str) -> Result<Self, Problem> {
        let number = crate::number::exact(given)
            .unwrap_or_else(|| Err(Problem::new("it is no number")))
            .map_err(|p| p.of(given))?;
        Ok(Self::Quantity(Quantity::plain(number)))
    }

    /// What it is.
    #[must_use]
    pub fn kind(&self) -> Kind {
        match self {
            Self::Quantity(q) => Kind::Quantity(q.exponents()),
            Self::Text(_) => Kind::Text,
            Self::Bool(_) => Kind::Bool,
        }
    }

    /// As people read it.
    #[must_use]
    pub fn text(&self) -> String {
        match self {
            Self::Quantity(q) => q.text(),
            Self::Text(t) => t.clone(),
            Self::Bool(b) => b.to_string(),
        }
    }

    /// As it stands in the name of a point: without blanks, and without the signs that part names.
    #[must_use]
    pub fn label(&self) -> String {
        let given = match self {
            // `5 1/s` is not to be read as 51.
            Self::Quantity(q) => {
                let unit = match q.unit.strip_prefix('1') {
                    Some(below) if below.starts_with('/') => below,
                    _ => &q.unit,
                };
                format!("{}{unit}", text(&q.number))
            }
            other => other.text(),
        };
        let mut out = String::with_capacity(given.len());
        for c in given.chars() {
            match c {
                ' ' if matches!(self, Self::Quantity(_)) => out.push('.'),
                ',' | '=' | '@' | '%' | '[' | ']' => out += &format!("%{:02x}", u32::from(c)),
                c if c.is_whitespace() || c.is_control() => {
                    out += &format!("%{:02x}", u32::from(c))
                }
                c => out.push(c),
            }
        }
        if out.is_empty() { "%".into() } else { out }
    }

    /// As it is written in a file.
    #[must_use]
    pub fn written(&self) -> Written {
        match self {
            Self::Bool(b) => Written::Bool(*b),
            Self::Text(t) => Written::Text(t.clone()),
            Self::Quantity(q) if !q.unit.is_empty() => Written::Text(q.text()),
            Self::Quantity(q) => match i64::try_from(q.number.to_integer()) {
                Ok(whole) if q.number.is_integer() => Written::Integer(whole),
                _ => Written::Decimal(double(&q.number)),
            },
        }
    }

    /// In SI; `None` for what is no number.
    #[must_use]
    pub fn si(&self) -> Option<f64> {
        match self {
            Self::Quantity(q) => Some(q.si()),
            _ => None,
        }
    }
}
