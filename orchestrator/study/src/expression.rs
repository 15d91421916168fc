//! Expressions: `-135 deg + ${angle}` in a value, `fabric_fabric <= 0.1 and layup != 'L4'` in a condition.
//!
//! ```text
//! or        = and ("or" and)*
//! and       = not ("and" not)*
//! not       = "not" not | comparison
//! compared  = sum (("<" | "<=" | ">" | ">=" | "==" | "!=") sum)*      each neighbour, as in mathematics: 0 <= a < 1
//! sum       = product (("+" | "-") product)*
//! product   = factor (("*" | "/") factor)*
//! factor    = ("-" | "+") factor | number unit? | "${" name "}" | name | text | name "(" or ("," or)* ")" | "(" or ")"
//! ```
//! A unit goes on over `/` and `*` only without blanks (`112 N/m`, but `112 N / ${width}`), and over a blank only to another unit; a
//! negative power needs its sign (`m^-2`), as `5 m-2 m` is a difference.

mod evaluate;
mod read;
mod tree;
mod unit;

use crate::value::Value;
use evaluate::{value, yes};
use read::Reader;
use tree::{Node, variables};

pub use tree::{ExpressionError, Names};

/// An expression that has been read.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    root: Node,
}

impl Expression {
    /// Reads an expression.
    ///
    /// # Errors
    /// With the place of what cannot be read, or of a name that is no variable.
    pub fn read(text: &str, names: Names<'_>) -> Result<Self, ExpressionError> {
        let root = Reader::whole(text, names)?;
        Ok(Self { root })
    }

    /// Its value, where the variables have these.
    ///
    /// # Errors
    /// When quantities do not go together.
    pub fn value(&self, of: &[Value]) -> Result<Value, ExpressionError> {
        value(&self.root, of)
    }

    /// Whether it holds, where the variables have these values.
    ///
    /// # Errors
    /// When it is neither true nor false.
    pub fn holds(&self, of: &[Value]) -> Result<bool, ExpressionError> {
        yes(&self.root, of)
    }

    /// How far each of its comparisons is from holding, in SI, where the variables have these values: 0 where it holds. Parts joined by `and`
    /// are one comparison each; of what has no such number (`or`, `not`, texts) it is 1 where it does not hold.
    ///
    /// # Errors
    /// As [`Expression::holds`].
    pub fn excess(&self, of: &[Value]) -> Result<Vec<f64>, ExpressionError> {
        let found = self.excess_and_unit(of)?;
        Ok(found.into_iter().map(|e| e.0).collect())
    }

    /// The SI unit of each of these; empty for a plain number.
    ///
    /// # Errors
    /// As [`Expression::holds`].
    pub fn excess_units(&self, of: &[Value]) -> Result<Vec<String>, ExpressionError> {
        let found = self.excess_and_unit(of)?;
        Ok(found.into_iter().map(|e| e.1).collect())
    }

    fn excess_and_unit(&self, of: &[Value]) -> Result<Vec<(f64, String)>, ExpressionError> {
        let mut found = Vec::new();
        evaluate::excess(&self.root, of, &mut found)?;
        Ok(found)
    }

    /// Positions of the variables that it names, each once, in order.
    #[must_use]
    pub fn variables(&self) -> Vec<usize> {
        let mut found = Vec::new();
        variables(&self.root, &mut found);
        found.sort_unstable();
        found.dedup();
        found
    }
}

#[cfg(test)]
#[path = "expression/tests.rs"]
mod tests;
