//! Studies, without files and without processes: points from ranges, tables and samples; expressions with units; the names of points; and
//! what is said of a family of results.
//!
//! Numbers are kept as they are written, exactly, in their units: `0.1 + 0.2` is `0.3`, `45 deg` of a range is the text `45 deg`, and what
//! a study puts into a step is what a user would have written there. Nothing here depends on the machine, the time, or the order of a
//! hash table.

// What reaches an artifact has the same bits on every machine (`plyflow_fixed`).
#![cfg_attr(not(test), warn(clippy::disallowed_methods))]

mod expression;
mod judge;
mod number;
pub mod optimise;
mod points;
mod range;
mod sample;
mod template;
mod value;

pub use expression::{Expression, ExpressionError, Names};
pub use judge::{Claim, Found, Mark, judge, marks};
pub use number::{Exact, Quantity};
pub use points::{MOST_POINTS, Point, Points, Table, Variable};
pub use range::{Range, Step, range};
pub use sample::{Axis, Method, Sample, sample};
pub use template::Template;
pub use value::{Kind, Value, Written};

/// Why a part of a study is not what it must be: a sentence, and what to do.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Problem {
    /// What is wrong.
    pub message: String,
    /// What was expected.
    pub expected: Option<String>,
    /// What to do.
    pub help: Option<String>,
}

impl Problem {
    /// A sentence alone.
    pub fn new(message: impl Into<String>) -> Self {
        Self {
            message: message.into(),
            expected: None,
            help: None,
        }
    }

    /// Names what it is about.
    #[must_use]
    pub fn of(mut self, text: &str) -> Self {
        let shown = plyflow_model::text::shortened(text, 80);
        self.message = format!("`{shown}`: {}", self.message);
        self
    }

    /// States what was expected.
    #[must_use]
    pub fn expected(mut self, text: impl Into<String>) -> Self {
        self.expected = Some(text.into());
        self
    }

    /// States what to do.
    #[must_use]
    pub fn help(mut self, text: impl Into<String>) -> Self {
        self.help = Some(text.into());
        self
    }
}
