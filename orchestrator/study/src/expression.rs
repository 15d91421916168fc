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

use crate::number::{Quantity, leading};
use crate::{Problem, Value};
use num_traits::Signed;
use plyflow_model::units::parse_unit;
use std::cmp::Ordering;
use std::ops::Range;

/// Deepest nesting that is read: nobody writes more, and it keeps a hostile file from using up the stack.
const DEEPEST: usize = 64;

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
        let mut reader = Reader {
            text,
            at: 0,
            names,
            depth: 0,
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

fn failed(node: &Node, problem: Problem) -> ExpressionError {
    ExpressionError {
        at: node.at.clone(),
        problem,
    }
}

fn value(node: &Node, of: &[Value]) -> Result<Value, ExpressionError> {
    let at = |problem| failed(node, problem);
    Ok(match &node.kind {
        Kind::Literal(v) => v.clone(),
        Kind::Variable(i) => of[*i].clone(),
        Kind::Negative(a) => Value::Quantity(number(a, of)?.negated()),
        Kind::Sum(sign, a, b) => {
            let (a, b) = (number(a, of)?, number(b, of)?);
            let found = match sign {
                '+' => a.plus(&b),
                '-' => a.minus(&b),
                '*' => a.times(&b),
                _ => a.over(&b),
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

fn yes(node: &Node, of: &[Value]) -> Result<bool, ExpressionError> {
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
        Function::Abs => Ok(if first.number.is_negative() {
            first.negated()
        } else {
            first.clone()
        }),
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

struct Reader<'t> {
    text: &'t str,
    at: usize,
    names: Names<'t>,
    depth: usize,
}

type Read = Result<Node, ExpressionError>;

impl<'t> Reader<'t> {
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
                (true, _) => '+',
                (false, true) => '-',
                _ => return Ok(left),
            };
            let right = self.product()?;
            left = pair(sign, left, right);
        }
    }

    fn product(&mut self) -> Read {
        let mut left = self.factor()?;
        loop {
            let sign = match (self.takes("*"), self.takes("/")) {
                (true, _) => '*',
                (false, true) => '/',
                _ => return Ok(left),
            };
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
            let unit = self.unit();
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

    /// The unit that follows a number; empty when there is none.
    fn unit(&mut self) -> String {
        let is = |c: char| c.is_alphabetic() || ['°', '%', 'µ', '"'].contains(&c);
        let power = |c: char| c.is_ascii_digit() || "^⁰¹²³⁴⁵⁶⁷⁸⁹⁻".contains(c);
        let factor = |text: &str| {
            let letters = text.find(|c| !is(c)).unwrap_or(text.len());
            if letters == 0 || text.starts_with('"') {
                return 0;
            }
            let rest = &text[letters..];
            // `m-2 m` is a difference here, so that a negative power needs its sign: `m^-2`.
            let minus = usize::from(rest.starts_with("^-")) * 2;
            let body = &rest[minus..];
            let raised = body.find(|c| !power(c)).unwrap_or(body.len());
            letters + if raised == 0 { 0 } else { minus + raised }
        };
        let rest = self.rest();
        let blanks = rest.len() - rest.trim_start_matches([' ', '\t']).len();
        let body = &rest[blanks..];
        let over = ["1/", "/"].into_iter().find(|s| body.starts_with(s));
        let over = over.filter(|s| body[s.len()..].starts_with(is) && (*s == "1/" || blanks == 0));
        let mut end = match over {
            Some(sign) => sign.len() + factor(&body[sign.len()..]),
            None => factor(body),
        };
        if end == 0 {
            return String::new();
        }
        let first = body[..end].trim_start_matches(|c: char| !is(c));
        if over.is_none()
            && (WORDS.contains(&first)
                || body[end..].trim_start().starts_with('(')
                    && FUNCTIONS.iter().any(|f| f.0 == first))
        {
            return String::new();
        }
        loop {
            let next = &body[end..];
            if let Some(after) = next.strip_prefix(['/', '*', '·', '.']) {
                let n = factor(after);
                let called = after[n..].starts_with('(');
                if n > 0 && !called {
                    end += next.len() - after.len() + n;
                    continue;
                }
            }
            let after = next.trim_start_matches(' ');
            let n = factor(after);
            let word = &after[..n];
            if n > 0
                && after.len() < next.len()
                && !WORDS.contains(&word)
                && parse_unit(word).is_ok()
                && !self.names.all.iter().any(|v| v == word)
            {
                end += next.len() - after.len() + n;
                continue;
            }
            break;
        }
        self.at += blanks + end;
        let unit = body[..end].to_owned();
        match unit.strip_prefix('/') {
            Some(below) => format!("1/{below}"),
            None => unit,
        }
    }
}

fn pair(sign: char, left: Node, right: Node) -> Node {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, bare: bool) -> Result<Value, ExpressionError> {
        let all = ["angle", "mu", "layup"].map(str::to_owned);
        let of = [
            Value::of_text("45 deg"),
            Value::of_number("0.1").unwrap(),
            Value::Text("L3".into()),
        ];
        Expression::read(text, Names { all: &all, bare })?.value(&of)
    }

    fn text(given: &str) -> String {
        read(given, false).unwrap().text()
    }

    #[test]
    fn quantities_are_computed_with_their_units() {
        for (given, wanted) in [
            ("-135 deg + ${angle}", "-90 deg"),
            ("${angle}*2", "90 deg"),
            ("2 * ( ${angle} - 5 deg )", "80 deg"),
            ("${angle} / 90 deg", "0.5"),
            ("112.5 N/m * 2", "225 N/m"),
            ("3 N mm - 1 N mm", "2 N mm"),
            ("4 1/mm", "4 1/mm"),
            ("- -3", "3"),
            ("max(1 cm, 12 mm)", "1.2 cm"),
            ("abs(-5 mm)", "5 mm"),
            ("round(10 mm / 3 mm)", "3"),
            ("1e-3 m + 1 mm", "0.002 m"),
            ("0.1 + 0.2", "0.3"),
            ("5 min + 30 s", "5.5 min"),
            ("5 mm-2 mm", "3 mm"),
        ] {
            assert_eq!(text(given), wanted, "{given}");
        }
    }

    #[test]
    fn conditions_compare_what_is_of_one_kind() {
        let holds = |t: &str| read(t, true).unwrap() == Value::Bool(true);
        assert!(holds("mu <= 0.1 and angle > 0 deg"));
        assert!(holds("0 deg <= angle < 90 deg"));
        assert!(!holds("not (layup == 'L3')"));
        assert!(holds("layup != \"L4\" or mu > 1"));
        assert!(holds("${mu} == 10 %"));
        for (wrong, word) in [
            ("mu < 1 mm", "do not go together"),
            ("layup < 'a'", "no order"),
            ("layup == 3", "cannot be compared"),
            ("mu and true", "neither true nor false"),
        ] {
            let e = read(wrong, true).unwrap_err();
            assert!(e.problem.message.contains(word), "{wrong}: {e}");
        }
    }

    #[test]
    fn what_cannot_be_read_is_told_with_its_place() {
        for (given, at, word) in [
            ("1 mm + ${angel}", 7..15, "no variable `angel`"),
            ("1 mm + angle", 7..12, "neither a number nor a variable"),
            ("(1 mm", 5..5, "not closed"),
            ("3 furlong", 0..9, "furlong"),
            ("2 * ", 4..4, "ends where a value"),
            ("1 2", 2..3, "does not go on"),
            (
                "cases/${angle}.yaml",
                0..5,
                "neither a number nor a variable",
            ),
            ("nothing(1)", 0..7, "no function"),
        ] {
            let e = read(given, false).unwrap_err();
            assert!(e.problem.message.contains(word), "{given}: {e}");
            assert_eq!(e.at, at, "{given}: {e}");
        }
        let e = read("1 mm + ${angel}", false).unwrap_err();
        assert_eq!(e.problem.help.as_deref(), Some("did you mean `angle`?"));
        assert!(read(&"(".repeat(5000), false).is_err());
    }
}
