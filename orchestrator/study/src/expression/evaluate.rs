//! The value of an expression that has been read.

use super::tree::{Compare, ExpressionError, Function, Kind, Node, Sign};
use crate::number::Quantity;
use crate::problem::Problem;
use crate::value::Value;
use num_traits::Signed;
use std::cmp::Ordering;

fn failed(node: &Node, problem: Problem) -> ExpressionError {
    ExpressionError {
        at: node.at.clone(),
        problem,
    }
}

pub(super) fn value(node: &Node, of: &[Value]) -> Result<Value, ExpressionError> {
    let at = |problem| failed(node, problem);
    Ok(match &node.kind {
        Kind::Literal(v) => v.clone(),
        Kind::Variable(i) => of[*i].clone(),
        Kind::Negative(a) => Value::Quantity(number(a, of)?.opposite().map_err(at)?),
        Kind::Sum(sign, a, b) => {
            let (a, b) = (number(a, of)?, number(b, of)?);
            let found = match sign {
                Sign::Plus => a.plus(&b),
                Sign::Minus => a.minus(&b),
                Sign::Times => a.times(&b),
                Sign::Over => a.over(&b),
            };
            Value::Quantity(found.map_err(at)?)
        }
        Kind::Call(function, given) => {
            let mut all = Vec::new();
            for one in given {
                all.push(number(one, of)?);
            }
            Value::Quantity(call(*function, &all).map_err(at)?)
        }
        _ => Value::Bool(yes(node, of)?),
    })
}

fn number(node: &Node, of: &[Value]) -> Result<Quantity, ExpressionError> {
    match value(node, of)? {
        Value::Quantity(q) => Ok(q),
        other => Err(failed(
            node,
            Problem::new(format!(
                "`{}` is {}, not a number",
                other.text(),
                other.kind().in_words()
            )),
        )),
    }
}

pub(super) fn yes(node: &Node, of: &[Value]) -> Result<bool, ExpressionError> {
    match &node.kind {
        Kind::Not(a) => Ok(!yes(a, of)?),
        Kind::And(all) => all.iter().try_fold(true, |y, n| Ok(yes(n, of)? && y)),
        Kind::Or(all) => all.iter().try_fold(false, |y, n| Ok(yes(n, of)? || y)),
        Kind::Compared(all, last) => {
            let mut nodes: Vec<&Node> = all.iter().map(|(_, n)| n).collect();
            nodes.push(last);
            let mut holds = true;
            for (i, (sign, _)) in all.iter().enumerate() {
                let (a, b) = (value(nodes[i], of)?, value(nodes[i + 1], of)?);
                holds &= compared(*sign, &a, &b).map_err(|p| failed(node, p))?;
            }
            Ok(holds)
        }
        _ => match value(node, of)? {
            Value::Bool(b) => Ok(b),
            other => Err(failed(
                node,
                Problem::new(format!("`{}` is neither true nor false", other.text()))
                    .expected("a comparison, such as `a <= 0.1`"),
            )),
        },
    }
}

fn compared(sign: Compare, a: &Value, b: &Value) -> Result<bool, Problem> {
    let order = match (a, b) {
        (Value::Quantity(a), Value::Quantity(b)) => a.compare(b)?,
        (Value::Text(_), Value::Text(_)) | (Value::Bool(_), Value::Bool(_)) => {
            let equal = a == b;
            return match sign {
                Compare::Equal => Ok(equal),
                Compare::Other => Ok(!equal),
                _ => Err(Problem::new("texts have no order").expected("`==` or `!=`")),
            };
        }
        _ => {
            let (x, y) = (a.kind().in_words(), b.kind().in_words());
            return Err(Problem::new(format!(
                "`{}` is {x} and `{}` is {y}: they cannot be compared",
                a.text(),
                b.text()
            )));
        }
    };
    Ok(match sign {
        Compare::Less => order == Ordering::Less,
        Compare::AtMost => order != Ordering::Greater,
        Compare::More => order == Ordering::Greater,
        Compare::AtLeast => order != Ordering::Less,
        Compare::Equal => order == Ordering::Equal,
        Compare::Other => order != Ordering::Equal,
    })
}

fn call(function: Function, given: &[Quantity]) -> Result<Quantity, Problem> {
    let first = &given[0];
    match function {
        Function::Abs => match first.number.is_negative() {
            true => first.opposite(),
            false => first.opposite().map(|_| first.clone()),
        },
        Function::Round => {
            if !first.is_plain() {
                return Err(Problem::new(format!("`round` of `{}`", first.text()))
                    .expected("a plain number")
                    .help(
                        "divide by the unit to be rounded to, such as `round(${length} / 1 mm)`",
                    ));
            }
            Ok(Quantity {
                number: first.number.round(),
                ..first.clone()
            })
        }
        Function::Min | Function::Max => {
            let wanted = if function == Function::Min {
                Ordering::Less
            } else {
                Ordering::Greater
            };
            let mut best = first.clone();
            for q in &given[1..] {
                if q.compare(&best)? == wanted {
                    best = q.clone();
                }
            }
            best.in_unit_of(first)
        }
    }
}

/// See [`super::Expression::excess`].
pub(super) fn excess(
    node: &Node,
    of: &[Value],
    found: &mut Vec<(f64, String)>,
) -> Result<(), ExpressionError> {
    let Kind::Compared(all, last) = &node.kind else {
        if let Kind::And(all) = &node.kind {
            return all.iter().try_for_each(|n| excess(n, of, found));
        }
        found.push((f64::from(u8::from(!yes(node, of)?)), String::new()));
        return Ok(());
    };
    let nodes: Vec<&Node> = all.iter().map(|(_, n)| n).chain([&**last]).collect();
    for (i, (sign, _)) in all.iter().enumerate() {
        let (a, b) = (value(nodes[i], of)?, value(nodes[i + 1], of)?);
        let holds = compared(*sign, &a, &b).map_err(|p| failed(node, p))?;
        let size = match (&a, &b) {
            _ if holds => 0.0,
            // Of what is too small to be told, or must not be equal, something is left.
            (Value::Quantity(a), Value::Quantity(b)) if *sign != Compare::Other => {
                (a.si() - b.si()).abs().max(f64::MIN_POSITIVE)
            }
            _ => 1.0,
        };
        let unit = match *sign {
            Compare::Other => String::new(),
            _ => a.kind().si_unit(),
        };
        found.push((size, unit));
    }
    Ok(())
}
