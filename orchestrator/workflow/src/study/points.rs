//! The block `study` -> a table of values. The schema check has passed: what is read here has its form.

use crate::diagnostics::{Mention, Problems, Source};
use crate::named::{named, unreadable};
use crate::study::cells::Cells;
use crate::study::told::{in_one_unit, is_column, report, within};
use crate::yaml::{Entry, Kind, Node, Span};
use plyflow_files::open::{self, MOST_WRITTEN};
use plyflow_files::rows::RowError;
use plyflow_files::text::decode;
use plyflow_study::optimise::Along;
use plyflow_study::{
    Axis, Method, Problem, Quantity, Range, Sample, Step, Table, Value, range, sample,
};
use std::sync::Arc;

/// The ways in which points are given, of which a set has one.
const WAYS: [&str; 6] = ["vary", "zip", "points", "sample", "product", "union"];

/// Words of expressions, which cannot name a variable.
const TAKEN: [&str; 9] = [
    "and", "or", "not", "true", "false", "abs", "min", "max", "round",
];

/// Deepest nesting of products and unions.
const DEEPEST: usize = 16;

/// What the block says.
pub(super) struct Read {
    /// The values.
    pub table: Table,
    /// Samples: method, number of points, seed.
    pub samples: Vec<(String, u32, u32)>,
    /// Variables of which at least one must be used, and where they stand.
    pub groups: Vec<(Span, Vec<String>)>,
}

struct Reader<'a> {
    source: &'a Source,
    problems: &'a mut Problems,
    samples: Vec<(String, u32, u32)>,
    groups: Vec<(Span, Vec<String>)>,
}

/// Reads the block; `None` when something is wrong (and reported).
pub(super) fn read(study: &Node, source: &Source, problems: &mut Problems) -> Option<Read> {
    let mut reader = Reader {
        source,
        problems,
        samples: Vec::new(),
        groups: Vec::new(),
    };
    let table = reader.set(study, "study", 0)?;
    Some(Read {
        table,
        samples: reader.samples,
        groups: reader.groups,
    })
}

/// Reads the variables of an optimisation, and where they stand; `None` when something is wrong (and reported).
pub(super) fn over(
    node: &Node,
    source: &Source,
    problems: &mut Problems,
) -> Option<Vec<(String, Along)>> {
    let mut reader = Reader {
        source,
        problems,
        samples: Vec::new(),
        groups: Vec::new(),
    };
    let one = |entry: &Entry| {
        let name = reader.name(entry);
        let along = reader.along(&entry.value, &entry.key_span);
        Some((name?, along?))
    };
    let all: Vec<Option<(String, Along)>> = node.entries().iter().map(one).collect();
    all.into_iter().collect()
}

/// Reads one value; `None` when something is wrong (and reported).
pub(super) fn value(node: &Node, source: &Source, problems: &mut Problems) -> Option<Value> {
    let mut reader = Reader {
        source,
        problems,
        samples: Vec::new(),
        groups: Vec::new(),
    };
    reader.value(node, &node.span)
}

impl Reader<'_> {
    /// What a variable of an optimisation may be: a range, its steps, or one of a list.
    fn along(&mut self, node: &Node, key: &Span) -> Option<Along> {
        let is_range = matches!(&node.kind, Kind::Map(_));
        if is_range && node.get("by").is_none() && node.get("count").is_none() {
            return self.range(node).map(Along::Range);
        }
        let values = self.values(node, key)?;
        let values = in_one_unit(values)
            .map_err(|problem| self.tell(problem, &node.span))
            .ok()?;
        let si: Vec<Option<f64>> = values.iter().map(Value::si).collect();
        let grows = |w: &[Option<f64>]| matches!(w, [Some(a), Some(b)] if a < b);
        let falls = |w: &[Option<f64>]| matches!(w, [Some(a), Some(b)] if a > b);
        let ordered = si.windows(2).all(grows) || si.windows(2).all(falls);
        if let Some(odd) = values.iter().find(|v| v.kind() != values[0].kind()) {
            let message = format!(
                "`{}` and `{}` are of two kinds",
                values[0].text(),
                odd.text()
            );
            self.tell(
                Problem::new(message).expected("values of one kind"),
                &node.span,
            );
            return None;
        }
        Some(match is_range || (ordered && values.len() > 1) {
            true => Along::Steps(values),
            false => Along::Choice(values),
        })
    }

    fn tell(&mut self, problem: Problem, span: &Span) {
        report(problem, span, self.source, self.problems);
    }

    fn told<T>(&mut self, found: Result<T, Problem>, span: &Span) -> Option<T> {
        match found {
            Ok(found) => Some(found),
            Err(problem) => {
                self.tell(problem, span);
                None
            }
        }
    }

    /// A set of points: one way to give them, then `where`.
    fn set(&mut self, node: &Node, what: &str, depth: usize) -> Option<Table> {
        if depth > DEEPEST {
            self.tell(
                Problem::new("too many products and unions in each other"),
                &node.span,
            );
            return None;
        }
        let is_way = |e: &&Entry| WAYS.contains(&e.key.as_str()) && e.value.kind != Kind::Null;
        let ways: Vec<&Entry> = node.entries().iter().filter(is_way).collect();
        let way = match ways[..] {
            [one] => one,
            [] => {
                let problem = Problem::new(format!("`{what}` gives no points"));
                let one_of = plyflow_model::manifest::one_of(WAYS.into_iter());
                self.tell(problem.expected(one_of), &node.span);
                return None;
            }
            [first, second, ..] => {
                let message = format!(
                    "`{what}` gives points by `{}` and by `{}`",
                    first.key, second.key
                );
                let problem = Problem::new(message).expected("one of them");
                let parts = format!("{{{}: ..}}, {{{}: ..}}", first.key, second.key);
                let help = format!(
                    "write `product: [{parts}]` for every combination, or `union: [{parts}]` for both"
                );
                self.tell(problem.help(help), &second.key_span);
                return None;
            }
        };
        let mut table = match way.key.as_str() {
            "vary" => self.columns(&way.value, true).map(Table::vary),
            "zip" => self.columns(&way.value, false).map(Table::zip),
            "points" => self.points(way).map(Ok),
            "sample" => self.sample(way),
            "product" => self.parts(way, depth).map(Table::product),
            _ => self.parts(way, depth).map(Table::union),
        };
        let found = table.take()?;
        let mut table = self.told(found, &way.key_span)?;
        if let Some(condition) = node.get("where")
            && let Some(text) = condition.text()
            && let Err(e) = table.keep(text)
        {
            let span = within(self.source, condition, text, &e.at);
            self.tell(e.problem, &span);
            return None;
        }
        Some(table)
    }

    fn parts(&mut self, way: &Entry, depth: usize) -> Option<Vec<Table>> {
        let parts = way.value.items().iter().enumerate();
        let read: Vec<Option<Table>> = parts
            .map(|(i, part)| self.set(part, &format!("{}[{i}]", way.key), depth + 1))
            .collect();
        if read.is_empty() {
            let problem = Problem::new(format!("`{}` has no parts", way.key));
            self.tell(problem.expected("a list of sets of points"), &way.key_span);
            return None;
        }
        read.into_iter().collect()
    }

    fn name(&mut self, entry: &Entry) -> Option<String> {
        self.name_at(&entry.key, &entry.key_span)
    }

    fn name_at(&mut self, name: &str, span: &Span) -> Option<String> {
        let letter = |c: char| c.is_ascii_alphabetic() || c == '_';
        let all = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let is_name = name.starts_with(letter) && name.chars().all(all) && name.len() <= 64;
        if is_name && is_column(name) {
            let message = format!("`{name}` is a column that every table of a study has");
            self.tell(Problem::new(message).expected("another name"), span);
            return None;
        }
        if is_name && !TAKEN.contains(&name) {
            return Some(name.to_owned());
        }
        let problem = Problem::new(format!("`{name}` cannot name a variable"));
        let expected = "letters, digits and `_`, at most 64 of them, beginning with a letter, and no word of expressions";
        self.tell(problem.expected(expected), span);
        None
    }

    /// The columns of `vary` and `zip`. `apart`: each variable must be used.
    fn columns(&mut self, node: &Node, apart: bool) -> Option<Vec<(String, Vec<Value>)>> {
        let mut columns = Vec::new();
        for entry in node.entries() {
            let name = self.name(entry);
            let values = self.values(&entry.value, &entry.key_span);
            if let (Some(name), Some(values)) = (name, values) {
                // A value that is the same at all points may be there for a union.
                if apart && values.len() > 1 {
                    self.groups
                        .push((entry.key_span.clone(), vec![name.clone()]));
                }
                columns.push((name, values));
            }
        }
        if node.entries().is_empty() {
            self.tell(
                Problem::new("there is no variable").expected("`name: values`"),
                &node.span,
            );
        }
        let names: Vec<String> = columns.iter().map(|c| c.0.clone()).collect();
        if !apart && !names.is_empty() {
            self.groups
                .push((node.entries()[0].key_span.clone(), names));
        }
        (columns.len() == node.entries().len() && !columns.is_empty()).then_some(columns)
    }

    /// One value, a list, or a range.
    fn values(&mut self, node: &Node, key: &Span) -> Option<Vec<Value>> {
        match &node.kind {
            Kind::List(items) if items.is_empty() => {
                self.tell(
                    Problem::new("there is no value").expected("at least one"),
                    &node.span,
                );
                None
            }
            Kind::List(items) => {
                let all: Vec<Option<Value>> =
                    items.iter().map(|n| self.value(n, &n.span)).collect();
                all.into_iter().collect()
            }
            Kind::Map(_) => {
                let (parted, by, count) = (self.range(node)?, node.get("by"), node.get("count"));
                let step = match (by, count.and_then(whole)) {
                    (Some(by), None) => Step::By(self.quantity(by)?),
                    (None, Some(count)) => Step::Count(count),
                    (by, _) => {
                        let message = match by {
                            Some(_) => "a range with `by` and `count`",
                            None => "a range without `by` or `count`",
                        };
                        let problem = Problem::new(message).expected("one of `by` and `count`");
                        self.tell(problem, key);
                        return None;
                    }
                };
                self.told(range(&parted, &step), &node.span)
            }
            _ => self.value(node, key).map(|v| vec![v]),
        }
    }

    fn range(&mut self, node: &Node) -> Option<Range> {
        let (from, to) = (node.get("from")?, node.get("to")?);
        let (from, to) = (self.quantity(from), self.quantity(to));
        let log = node.get("scale").and_then(Node::text) == Some("log");
        self.told(Range::new(from?, &to?, log), &node.span)
    }

    fn quantity(&mut self, node: &Node) -> Option<Quantity> {
        match self.value(node, &node.span)? {
            Value::Quantity(q) => Some(q),
            other => {
                let problem = Problem::new(format!("`{}` is no number", other.text()))
                    .expected("a number, with its unit where it has one");
                self.tell(problem, &node.span);
                None
            }
        }
    }

    fn value(&mut self, node: &Node, at: &Span) -> Option<Value> {
        match &node.kind {
            Kind::Bool(b) => Some(Value::Bool(*b)),
            Kind::Text(t) => self.told(Value::of_text(t), &node.span),
            Kind::Number(n) => {
                let value = Value::of_number(&n.to_string());
                self.told(value, &node.span)
            }
            _ => {
                let problem = Problem::new(format!(
                    "{} stands where a value is expected",
                    node.describe()
                ));
                self.tell(
                    problem.expected("a number, a quantity, a text, `true` or `false`"),
                    at,
                );
                None
            }
        }
    }

    fn sample(&mut self, way: &Entry) -> Option<Result<Table, Problem>> {
        let node = &way.value;
        let word = node.get("method")?.text()?;
        let method = match word {
            "grid" => Method::Grid,
            "latin-hypercube" => Method::LatinHypercube,
            "sobol" => Method::Sobol,
            _ => Method::Random,
        };
        let count = node.get("count").and_then(whole)?;
        let seed = node.get("seed").map_or(Some(0), whole)?;
        let mut of = Vec::new();
        let variables = node.get("of").map_or(&[][..], Node::entries);
        for entry in variables {
            let name = self.name(entry);
            let axis = match &entry.value.kind {
                Kind::Map(_) => match ["by", "count"]
                    .into_iter()
                    .find_map(|k| entry.value.entry(k))
                {
                    Some(parted) => {
                        let problem =
                            Problem::new(format!("`{}` in a range of a sample", parted.key));
                        let help = "leave it out: the sample's method chooses the values";
                        self.tell(problem.help(help), &parted.key_span);
                        None
                    }
                    None => self.range(&entry.value).map(Axis::Range),
                },
                _ => self.values(&entry.value, &entry.key_span).map(Axis::List),
            };
            if let (Some(name), Some(axis)) = (name, axis) {
                self.groups
                    .push((entry.key_span.clone(), vec![name.clone()]));
                of.push((name, axis));
            }
        }
        if of.len() < variables.len() {
            return None;
        }
        self.samples.push((word.to_owned(), count, seed));
        let seed = seed.into();
        Some(sample(&Sample {
            method,
            count,
            seed,
            of,
        }))
    }

    /// Points one by one: a list here, or a table in a file.
    fn points(&mut self, way: &Entry) -> Option<Table> {
        let Some(file) = way.value.text() else {
            return self.listed(way);
        };
        let path = named(self.problems, &self.source.folder, file);
        let bytes = match open::read(path.as_std_path(), MOST_WRITTEN) {
            Ok(bytes) => bytes,
            Err(e) => {
                let given = Mention::new(self.source, &way.value.span, file);
                unreadable(self.problems, &given, &path, &e);
                return None;
            }
        };
        self.problems
            .note_file(&path, &crate::evidence::hash(&bytes));
        // Lines as the reader of tables counts them, whatever ends them.
        let text = decode(&bytes)
            .map(|t| t.replace("\r\n", "\n").replace('\r', "\n"))
            .unwrap_or_default();
        let folder = self.source.folder.clone();
        let table = Source {
            name: path,
            folder,
            text: Arc::new(text),
            set: Vec::new(),
        };
        match self.table(&bytes, &way.value.span, &table) {
            Ok(table) => Some(table),
            Err(Some(e)) => {
                let span = crate::yaml::span_at(&table.text, e.line.max(1), 1);
                self.problems.add(&table, &span, e.problem);
                None
            }
            // Reported already.
            Err(None) => None,
        }
    }

    fn table(
        &mut self,
        bytes: &[u8],
        span: &Span,
        file: &Source,
    ) -> Result<Table, Option<RowError>> {
        let cells = Cells::read(bytes)?;
        let (line, heads) = &cells.heads;
        let (mut names, mut units) = (Vec::new(), Vec::new());
        for head in heads {
            let unit = head.unit.clone().unwrap_or_default();
            if let Err(e) = plyflow_model::units::parse_unit(&unit) {
                let text = format!("the head of `{}`: {}; {}", head.name, e.reason(), e.help());
                return Err(RowError::at(*line, text).into());
            }
            if names.contains(&head.name) {
                let text = format!("two columns are named `{}`", head.name);
                return Err(RowError::at(*line, text).into());
            }
            let at = crate::yaml::span_at(&file.text, *line, 1);
            let mut of_file = Reader {
                source: file,
                problems: &mut *self.problems,
                samples: Vec::new(),
                groups: Vec::new(),
            };
            names.push(of_file.name_at(&head.name, &at).ok_or(None)?);
            units.push(unit);
        }
        let row = |(line, row): &(usize, Vec<String>)| -> Result<Vec<Value>, RowError> {
            let columns = row.iter().zip(&units).zip(&names);
            let value = |((cell, unit), name): ((&String, &String), &String)| {
                let plain = plyflow_files::number::plain(cell, cells.decimal);
                let value = Value::of_cell(plain.as_deref().unwrap_or(cell), unit)
                    .map_err(|p| RowError::at(*line, format!("`{name}`: {p}")))?;
                if cell.is_empty() || (!unit.is_empty() && !matches!(value, Value::Quantity(_))) {
                    let text = match cell.as_str() {
                        "" => format!("there is no value for `{name}`"),
                        cell => format!("`{cell}` is no number, and `{name}` is in {unit}"),
                    };
                    return Err(RowError::at(*line, text));
                }
                Ok(value)
            };
            columns.map(value).collect()
        };
        let rows = cells.rows.iter().map(row).collect::<Result<_, _>>()?;
        self.groups.push((span.clone(), names.clone()));
        Ok(Table { names, rows })
    }

    fn listed(&mut self, way: &Entry) -> Option<Table> {
        let items = way.value.items();
        let Some(first) = items.first() else {
            self.tell(
                Problem::new("there is no point").expected("at least one"),
                &way.key_span,
            );
            return None;
        };
        let names: Vec<Option<String>> = first.entries().iter().map(|e| self.name(e)).collect();
        let names: Vec<String> = names.into_iter().collect::<Option<_>>()?;
        if names.is_empty() {
            self.tell(
                Problem::new("the point has no variable").expected("`{name: value, ..}`"),
                &first.span,
            );
            return None;
        }
        let mut rows = Vec::new();
        for item in items {
            let unknown = item.entries().iter().find(|e| !names.contains(&e.key));
            let missing = names.iter().find(|n| item.get(n).is_none());
            if let Some(odd) = unknown {
                let problem = Problem::new(format!("the first point has no `{}`", odd.key));
                self.tell(
                    problem.expected("the same variables at every point"),
                    &odd.key_span,
                );
                return None;
            }
            if let Some(name) = missing {
                let problem = Problem::new(format!("this point has no `{name}`"));
                self.tell(
                    problem.expected("the same variables at every point"),
                    &item.span,
                );
                return None;
            }
            let value = |n: &String| self.value(item.get(n)?, &item.span);
            rows.push(names.iter().map(value).collect::<Option<Vec<Value>>>()?);
        }
        self.groups.push((way.key_span.clone(), names.clone()));
        Some(Table { names, rows })
    }
}

fn whole(node: &Node) -> Option<u32> {
    node.to_json().as_u64().and_then(|n| u32::try_from(n).ok())
}
