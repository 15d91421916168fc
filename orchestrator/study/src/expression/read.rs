//! The grammar: text -> nodes.

use super::tree::{Compare, ExpressionError, FUNCTIONS, Function, Kind, Names, Node, Sign, WORDS};
use super::unit::{unit, variable_in};
use crate::number::{Quantity, leading};
use crate::problem::Problem;
use crate::value::Value;

/// Deepest nesting that is read: nobody writes more, and it keeps a hostile file from using up the stack.
const DEEPEST: usize = 64;

/// Most signs of one expression, for the same reason: `1 + 1 + ..` is a tree as deep as it is long.
const MOST_SIGNS: usize = 500;

pub(super) struct Reader<'t> {
    text: &'t str,
    at: usize,
    names: Names<'t>,
    depth: usize,
    signs: usize,
}

type Read = Result<Node, ExpressionError>;

impl<'t> Reader<'t> {
    /// The whole of a text.
    pub(super) fn whole(text: &'t str, names: Names<'t>) -> Read {
        let mut reader = Self {
            text,
            at: 0,
            names,
            depth: 0,
            signs: 0,
        };
        let root = reader.or()?;
        reader.blanks();
        if reader.at < text.len() {
            let rest = reader.rest().chars().take(20).collect::<String>();
            return Err(reader.wrong(
                Problem::new(format!("`{rest}` does not go on the expression"))
                    .expected("`+`, `-`, `*`, `/`, a comparison, `and`, `or`, or the end"),
            ));
        }
        Ok(root)
    }

    /// Counts a sign that joins two parts.
    fn count(&mut self) -> Result<(), ExpressionError> {
        self.signs += 1;
        if self.signs > MOST_SIGNS {
            let problem = Problem::new("the expression is too long");
            return Err(self.wrong(problem.expected(format!("at most {MOST_SIGNS} signs"))));
        }
        Ok(())
    }

    fn rest(&self) -> &'t str {
        &self.text[self.at..]
    }

    fn blanks(&mut self) {
        let rest = self.rest();
        self.at += rest.len() - rest.trim_start().len();
    }

    /// What is wrong here.
    fn wrong(&self, problem: Problem) -> ExpressionError {
        let end = self.rest().chars().next().map_or(0, char::len_utf8);
        ExpressionError {
            at: self.at..self.at + end,
            problem,
        }
    }

    /// Takes a sign, if it stands next.
    fn takes(&mut self, sign: &str) -> bool {
        self.blanks();
        let there = self.rest().starts_with(sign);
        self.at += if there { sign.len() } else { 0 };
        there
    }

    /// The name that stands next.
    fn word(&mut self) -> &'t str {
        self.blanks();
        let rest = self.rest();
        let is = |c: char| c.is_alphanumeric() || c == '_';
        let end = rest.find(|c| !is(c)).unwrap_or(rest.len());
        match rest.starts_with(|c: char| c.is_alphabetic() || c == '_') {
            true => &rest[..end],
            false => "",
        }
    }

    fn takes_word(&mut self, word: &str) -> bool {
        let there = self.word() == word;
        self.at += if there { word.len() } else { 0 };
        there
    }

    fn or(&mut self) -> Read {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.wrong(Problem::new("too many brackets in each other")));
        }
        let first = self.and()?;
        let mut all = vec![first];
        while self.takes_word("or") || self.takes("||") {
            all.push(self.and()?);
        }
        self.depth -= 1;
        Ok(joined(all, Kind::Or))
    }

    fn and(&mut self) -> Read {
        let mut all = vec![self.not()?];
        while self.takes_word("and") || self.takes("&&") {
            all.push(self.not()?);
        }
        Ok(joined(all, Kind::And))
    }

    fn not(&mut self) -> Read {
        self.blanks();
        let (start, mut times) = (self.at, 0);
        loop {
            self.blanks();
            let bang = self.rest().starts_with('!') && !self.rest().starts_with("!=");
            if bang {
                self.at += 1;
            } else if !self.takes_word("not") {
                break;
            }
            times += 1;
        }
        let inner = self.comparison()?;
        let at = start..inner.at.end;
        Ok(match times {
            0 => inner,
            n if n % 2 == 1 => Node {
                at,
                kind: Kind::Not(Box::new(inner)),
            },
            _ => Node {
                at: at.clone(),
                kind: Kind::Not(Box::new(Node {
                    at,
                    kind: Kind::Not(Box::new(inner)),
                })),
            },
        })
    }

    fn comparison(&mut self) -> Read {
        const SIGNS: [(&str, Compare); 6] = [
            ("<=", Compare::AtMost),
            (">=", Compare::AtLeast),
            ("==", Compare::Equal),
            ("!=", Compare::Other),
            ("<", Compare::Less),
            (">", Compare::More),
        ];
        let mut last = self.sum()?;
        let mut all = Vec::new();
        while let Some(sign) = SIGNS.iter().find(|(text, _)| self.takes(text)) {
            all.push((sign.1, last));
            last = self.sum()?;
        }
        self.blanks();
        if self.rest().starts_with('=') {
            return Err(self.wrong(Problem::new("one `=`").help("write `==` to compare")));
        }
        if all.is_empty() {
            return Ok(last);
        }
        let at = all[0].1.at.start..last.at.end;
        Ok(Node {
            at,
            kind: Kind::Compared(all, Box::new(last)),
        })
    }

    fn sum(&mut self) -> Read {
        let mut left = self.product()?;
        loop {
            let sign = match (self.takes("+"), self.takes("-")) {
                (true, _) => Sign::Plus,
                (false, true) => Sign::Minus,
                _ => return Ok(left),
            };
            self.count()?;
            let right = self.product()?;
            left = pair(sign, left, right);
        }
    }

    fn product(&mut self) -> Read {
        let mut left = self.factor()?;
        loop {
            let sign = match (self.takes("*"), self.takes("/")) {
                (true, _) => Sign::Times,
                (false, true) => Sign::Over,
                _ => return Ok(left),
            };
            self.count()?;
            let right = self.factor()?;
            left = pair(sign, left, right);
        }
    }

    fn factor(&mut self) -> Read {
        self.blanks();
        let start = self.at;
        let mut negative = false;
        while self.rest().starts_with(['-', '+', '−']) {
            let sign = self.rest().chars().next().unwrap_or('+');
            negative ^= sign != '+';
            self.at += sign.len_utf8();
            self.blanks();
        }
        let inner = self.atom()?;
        if !negative {
            return Ok(inner);
        }
        let at = start..inner.at.end;
        // `-5 degC` is a temperature as it is written, and not the opposite of one.
        if let Kind::Literal(Value::Quantity(q)) = &inner.kind
            && !self.text[..inner.at.end].ends_with(')')
        {
            return Ok(Node {
                at,
                kind: Kind::Literal(Value::Quantity(q.negated())),
            });
        }
        Ok(Node {
            at,
            kind: Kind::Negative(Box::new(inner)),
        })
    }

    fn atom(&mut self) -> Read {
        let start = self.at;
        let rest = self.rest();
        let node = |reader: &Self, kind| Node {
            at: start..reader.at,
            kind,
        };
        if self.takes("(") {
            let inner = self.or()?;
            if !self.takes(")") {
                return Err(self.wrong(Problem::new("a bracket is not closed").expected("`)`")));
            }
            return Ok(node(self, inner.kind));
        }
        if let Some((number, after)) = leading(rest) {
            self.at = self.text.len() - after.len();
            let (taken, unit) = unit(after, self.names);
            self.at += taken;
            if let Some(name) = variable_in(&unit, self.names) {
                let message = format!("`{name}` is a variable and stands where a unit would");
                let help = format!(
                    "blanks around `/` or `*` part a number from a variable: `1 / {name}`; a unit of that name needs another name for the variable"
                );
                return Err(ExpressionError {
                    at: start..self.at,
                    problem: Problem::new(message).help(help),
                });
            }
            let number = number.map_err(|problem| ExpressionError {
                at: start..self.at,
                problem,
            })?;
            let quantity = Quantity::new(number, &unit).map_err(|problem| ExpressionError {
                at: start..self.at,
                problem,
            })?;
            return Ok(node(self, Kind::Literal(Value::Quantity(quantity))));
        }
        if let Some(body) = rest.strip_prefix("${") {
            let end = body.find('}').ok_or_else(|| {
                self.wrong(Problem::new("`${` is not closed").expected("`${name}`"))
            })?;
            let name = body[..end].trim();
            self.at += 2 + end + 1;
            let found = self.variable(name, start)?;
            return Ok(node(self, Kind::Variable(found)));
        }
        if let Some(quote) = rest.chars().next().filter(|c| ['\'', '"'].contains(c)) {
            let body = &rest[1..];
            let end = body.find(quote).ok_or_else(|| {
                self.wrong(Problem::new("a quotation is not closed").expected(format!("{quote}")))
            })?;
            self.at += end + 2;
            return Ok(node(
                self,
                Kind::Literal(Value::Text(body[..end].to_owned())),
            ));
        }
        self.named(start)
    }

    /// A name that stands for a value: a variable, a function, `true`, `false`.
    fn named(&mut self, start: usize) -> Read {
        let word = self.word();
        if word.is_empty() || WORDS[..3].contains(&word) {
            let what = self.rest().chars().next();
            let message = match what {
                Some(c) => format!("`{c}` stands where a value is expected"),
                None => "the expression ends where a value is expected".to_owned(),
            };
            return Err(self.wrong(
                Problem::new(message).expected("a number with its unit, or a variable: `${name}`"),
            ));
        }
        self.at += word.len();
        if let ("true" | "false", value) = (word, word == "true") {
            return Ok(Node {
                at: start..self.at,
                kind: Kind::Literal(Value::Bool(value)),
            });
        }
        if self.takes("(") {
            return self.call(word, start);
        }
        if !self.names.bare {
            let known = self.names.all.iter().any(|n| n == word);
            let problem = Problem::new(format!("`{word}` is neither a number nor a variable"));
            return Err(ExpressionError {
                at: start..start + word.len(),
                problem: match known {
                    true => problem.help(format!("write `${{{word}}}`")),
                    false => problem.help(
                        "a value with a numeric variable is an expression; texts are put together only of variables that are text",
                    ),
                },
            });
        }
        let found = self.variable(word, start)?;
        Ok(Node {
            at: start..start + word.len(),
            kind: Kind::Variable(found),
        })
    }

    fn call(&mut self, word: &str, start: usize) -> Read {
        let Some((_, function)) = FUNCTIONS.iter().find(|f| f.0 == word) else {
            return Err(ExpressionError {
                at: start..start + word.len(),
                problem: Problem::new(format!("there is no function `{word}`"))
                    .expected("`abs`, `min`, `max` or `round`"),
            });
        };
        let mut given = vec![self.or()?];
        while self.takes(",") {
            given.push(self.or()?);
        }
        if !self.takes(")") {
            return Err(self.wrong(Problem::new("a bracket is not closed").expected("`)`")));
        }
        let at = start..self.at;
        let wanted = match function {
            Function::Abs | Function::Round => given.len() == 1,
            Function::Min | Function::Max => given.len() > 1,
        };
        if !wanted {
            let problem = Problem::new(format!("`{word}` of {} values", given.len())).expected(
                match function {
                    Function::Abs | Function::Round => "one value",
                    Function::Min | Function::Max => "at least two values",
                },
            );
            return Err(ExpressionError { at, problem });
        }
        Ok(Node {
            at,
            kind: Kind::Call(*function, given),
        })
    }

    fn variable(&self, name: &str, start: usize) -> Result<usize, ExpressionError> {
        let all = self.names.all;
        all.iter().position(|n| n == name).ok_or_else(|| {
            let mut problem = Problem::new(format!("there is no variable `{name}` in the study"));
            if !all.is_empty() {
                problem.expected = Some(plyflow_model::manifest::one_of(
                    all.iter().take(12).map(String::as_str),
                ));
            }
            let names = all.iter().map(String::as_str);
            let nearest = plyflow_model::nearest::nearest(name, names);
            problem.help = nearest.map(|n| format!("did you mean `{n}`?"));
            ExpressionError {
                at: start..self.at.max(start + name.len()),
                problem,
            }
        })
    }
}

fn pair(sign: Sign, left: Node, right: Node) -> Node {
    Node {
        at: left.at.start..right.at.end,
        kind: Kind::Sum(sign, Box::new(left), Box::new(right)),
    }
}

fn joined(mut all: Vec<Node>, kind: fn(Vec<Node>) -> Kind) -> Node {
    if all.len() == 1 {
        return all.remove(0);
    }
    let at = all[0].at.start..all[all.len() - 1].at.end;
    Node {
        at,
        kind: kind(all),
    }
}
