//! Values of a file with `${name}` in them.

use crate::expression::{Expression, ExpressionError, Names};
use crate::problem::Problem;
use crate::value::{Kind, Value, Written};

/// A value with variables in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Template(Form);

#[derive(Debug, Clone, PartialEq)]
enum Form {
    /// `${name}`: the variable as it is.
    Whole(usize),
    /// `-135 deg + ${name}`.
    Computed(Expression),
    /// `${material}.yaml`: texts, one behind the other.
    Joined(Vec<Part>),
}

#[derive(Debug, Clone, PartialEq)]
enum Part {
    Text(String),
    Variable(usize),
}

impl Template {
    /// Reads a text of a file; `None` when there is nothing to be put into it. `$${` means the signs `${`.
    ///
    /// # Errors
    /// When it names no variable, or is no expression.
    pub fn read(
        text: &str,
        names: &[String],
        kinds: &[Kind],
    ) -> Result<Option<Self>, ExpressionError> {
        if !text.contains("${") {
            return Ok(None);
        }
        let parts = parts(text, names)?;
        if let [Part::Variable(one)] = parts[..] {
            return Ok(Some(Self(Form::Whole(one))));
        }
        let variables = |p: &Part| match p {
            Part::Variable(i) => Some(*i),
            Part::Text(_) => None,
        };
        let named: Vec<usize> = parts.iter().filter_map(variables).collect();
        let numbers = |i: &usize| matches!(kinds[*i], Kind::Quantity(_));
        let all = Names {
            all: names,
            bare: false,
        };
        Ok(Some(Self(
            if named.is_empty() || !named.iter().all(numbers) {
                // Texts, or only `$${`.
                Form::Joined(parts)
            } else {
                Form::Computed(Expression::read(text, all)?)
            },
        )))
    }

    /// Positions of the variables in it.
    #[must_use]
    pub fn variables(&self) -> Vec<usize> {
        match &self.0 {
            Form::Whole(i) => vec![*i],
            Form::Computed(e) => e.variables(),
            Form::Joined(parts) => {
                let one = |p: &Part| match p {
                    Part::Variable(i) => Some(*i),
                    Part::Text(_) => None,
                };
                parts.iter().filter_map(one).collect()
            }
        }
    }

    /// What stands there, where the variables have these values.
    ///
    /// # Errors
    /// When quantities do not go together.
    pub fn written(&self, of: &[Value]) -> Result<Written, ExpressionError> {
        Ok(match &self.0 {
            Form::Whole(i) => of[*i].written(),
            Form::Computed(e) => e.value(of)?.written(),
            Form::Joined(parts) => Written::Text(
                parts
                    .iter()
                    .map(|p| match p {
                        Part::Text(t) => t.clone(),
                        // Blanks of a text are its own; `45 deg` is put together as `45deg`.
                        Part::Variable(i) => match &of[*i] {
                            Value::Text(t) => t.clone(),
                            other => other.text().replace(' ', ""),
                        },
                    })
                    .collect(),
            ),
        })
    }
}

fn parts(text: &str, names: &[String]) -> Result<Vec<Part>, ExpressionError> {
    let mut parts = Vec::new();
    let mut plain = String::new();
    let mut at = 0;
    while let Some(i) = text[at..].find("${").map(|i| at + i) {
        if text[..i].ends_with('$') && i > at {
            plain += &text[at..i - 1];
            plain += "${";
            at = i + 2;
            continue;
        }
        plain += &text[at..i];
        let Some(end) = text[i..].find('}').map(|e| i + e) else {
            return Err(ExpressionError {
                at: i..i + 2,
                problem: Problem::new("`${` is not closed").expected("`${name}`"),
            });
        };
        let name = text[i + 2..end].trim();
        let Some(found) = names.iter().position(|n| n == name) else {
            let all = Names {
                all: names,
                bare: false,
            };
            let mut error = match Expression::read(&text[i..=end], all) {
                Err(e) => e,
                Ok(_) => ExpressionError {
                    at: 0..0,
                    problem: Problem::new(format!("`{name}` is no variable")),
                },
            };
            error.at = i..end + 1;
            return Err(error);
        };
        if !plain.is_empty() {
            parts.push(Part::Text(std::mem::take(&mut plain)));
        }
        parts.push(Part::Variable(found));
        at = end + 1;
    }
    plain += &text[at..];
    if !plain.is_empty() {
        parts.push(Part::Text(plain));
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put(text: &str) -> Result<Option<Written>, ExpressionError> {
        let names = ["angle", "count", "cloth", "spaced"].map(str::to_owned);
        let of = [
            Value::of_text("45 deg").unwrap(),
            Value::of_number("3").unwrap(),
            Value::Text("ncf".into()),
            Value::Text("woven b".into()),
        ];
        let kinds: Vec<Kind> = of.iter().map(Value::kind).collect();
        let template = Template::read(text, &names, &kinds)?;
        template.map(|t| t.written(&of)).transpose()
    }

    #[test]
    fn a_value_keeps_its_type_and_texts_are_put_together() {
        let text = |t: &str| Some(Written::Text(t.into()));
        assert_eq!(put("plain").unwrap(), None);
        assert_eq!(put("${angle}").unwrap(), text("45 deg"));
        assert_eq!(put("${count}").unwrap(), Some(Written::Integer(3)));
        assert_eq!(put("${count} / 2").unwrap(), Some(Written::Decimal(1.5)));
        assert_eq!(put("../${cloth}.yaml").unwrap(), text("../ncf.yaml"));
        assert_eq!(put("${cloth}-${angle}").unwrap(), text("ncf-45deg"));
        assert_eq!(put("${spaced}.yaml").unwrap(), text("woven b.yaml"));
        assert_eq!(put("a $${b}").unwrap(), text("a ${b}"));
    }

    #[test]
    fn an_unknown_name_is_told_where_it_stands() {
        let e = put("../${clot}.yaml").unwrap_err();
        assert_eq!(
            (e.at, e.problem.help.as_deref()),
            (3..10, Some("did you mean `cloth`?"))
        );
        assert!(put("${cloth").is_err());
        assert!(put("${}").is_err());
    }
}
