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
mod unit;

use crate::{Problem, Value};
use evaluate::{value, yes};
use read::Reader;
use std::ops::Range;

/// Why an expression cannot be read or computed, and where in its text.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{problem}")]
pub struct ExpressionError {
    /// Bytes of the expression.
    pub at: Range<usize>,
    /// What is wrong.
    pub problem: Problem,
}

/// The variables that an expression may name.
#[derive(Debug, Clone, Copy)]
pub struct Names<'a> {
    /// Their names; an expression holds their positions.
    pub all: &'a [String],
    /// Whether a name alone means a variable (`angle`), or only `${angle}` does.
    pub bare: bool,
}

/// An expression that has been read.
#[derive(Debug, Clone, PartialEq)]
pub struct Expression {
    root: Node,
}

#[derive(Debug, Clone, PartialEq)]
struct Node {
    at: Range<usize>,
    kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Literal(Value),
    Variable(usize),
    Negative(Box<Node>),
    Sum(char, Box<Node>, Box<Node>),
    Compared(Vec<(Compare, Node)>, Box<Node>),
    Not(Box<Node>),
    And(Vec<Node>),
    Or(Vec<Node>),
    Call(Function, Vec<Node>),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Compare {
    Less,
    AtMost,
    More,
    AtLeast,
    Equal,
    Other,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Function {
    Abs,
    Min,
    Max,
    Round,
}

const FUNCTIONS: [(&str, Function); 4] = [
    ("abs", Function::Abs),
    ("min", Function::Min),
    ("max", Function::Max),
    ("round", Function::Round),
];

const WORDS: [&str; 5] = ["and", "or", "not", "true", "false"];

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

fn variables(node: &Node, found: &mut Vec<usize>) {
    match &node.kind {
        Kind::Literal(_) => {}
        Kind::Variable(i) => found.push(*i),
        Kind::Negative(a) | Kind::Not(a) => variables(a, found),
        Kind::Sum(_, a, b) => {
            variables(a, found);
            variables(b, found);
        }
        Kind::Compared(all, last) => {
            all.iter().for_each(|(_, n)| variables(n, found));
            variables(last, found);
        }
        Kind::And(all) | Kind::Or(all) | Kind::Call(_, all) => {
            all.iter().for_each(|n| variables(n, found));
        }
    }
}

#[cfg(test)]
#[path = "expression/tests.rs"]
mod tests;
