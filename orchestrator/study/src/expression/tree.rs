//! An expression that has been read, as a tree.

use crate::problem::Problem;
use crate::value::Value;
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

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Node {
    pub(super) at: Range<usize>,
    pub(super) kind: Kind,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Kind {
    Literal(Value),
    Variable(usize),
    Negative(Box<Node>),
    Sum(Sign, Box<Node>, Box<Node>),
    Compared(Vec<(Compare, Node)>, Box<Node>),
    Not(Box<Node>),
    And(Vec<Node>),
    Or(Vec<Node>),
    Call(Function, Vec<Node>),
}

/// What joins two quantities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sign {
    Plus,
    Minus,
    Times,
    Over,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Compare {
    Less,
    AtMost,
    More,
    AtLeast,
    Equal,
    Other,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Function {
    Abs,
    Min,
    Max,
    Round,
}

pub(super) const FUNCTIONS: [(&str, Function); 4] = [
    ("abs", Function::Abs),
    ("min", Function::Min),
    ("max", Function::Max),
    ("round", Function::Round),
];

pub(super) const WORDS: [&str; 5] = ["and", "or", "not", "true", "false"];

pub(super) fn variables(node: &Node, found: &mut Vec<usize>) {
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
