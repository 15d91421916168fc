//! Checks a YAML tree against a JSON Schema generated from the types, and reports everything that is
//! wrong, where it stands. The types stay the single source: what serde would refuse, this refuses, but
//! all at once.
//!
//! Understood: `$ref`, `type`, `properties`, `required`, `additionalProperties`, `items`, `minItems`,
//! `maxItems`, `const`, `minimum`, `maximum`, `anyOf` (by type and keys of the value), `oneOf` (of constants, or
//! of one-key mappings), and of ours `x-dimension`, `x-minimum`, `x-maximum`, `x-exclusive-minimum`
//! (quantities), `x-words` (that may stand for one), `x-format: memory` and `x-expected` (what to say when no branch of an `anyOf` fits).

use crate::diagnostics::{Diagnostic, Problems, Source};
use crate::hints::{has_words, list_help, mapping_help, number_help, or_words};
use crate::yaml::{Kind, Node, Span};
use plyflow_model::manifest::one_of;
use plyflow_model::units::{Dimension, parse_quantity};
use serde_json::{Map, Value};
use std::collections::HashMap;

/// Checks a tree.
pub struct Checker<'a> {
    root: &'a Value,
    source: &'a Source,
    problems: &'a mut Problems,
}

/// A schema with its `$ref` followed; keys beside the `$ref` come first.
#[derive(Clone)]
struct View<'a>(Vec<&'a Map<String, Value>>);

impl<'a> View<'a> {
    fn get(&self, key: &str) -> Option<&'a Value> {
        self.0.iter().find_map(|m| m.get(key))
    }

    fn text(&self, key: &str) -> Option<&'a str> {
        self.get(key).and_then(Value::as_str)
    }

    fn number(&self, key: &str) -> Option<f64> {
        self.get(key).and_then(Value::as_f64)
    }

    fn takes(&self, name: &str) -> bool {
        match self.get("type") {
            Some(Value::String(t)) => t == name,
            Some(Value::Array(all)) => all.iter().any(|t| t == name),
            _ => false,
        }
    }
}

impl<'a> Checker<'a> {
    /// For a schema document and the file that is checked.
    pub fn new(root: &'a Value, source: &'a Source, problems: &'a mut Problems) -> Self {
        Checker {
            root,
            source,
            problems,
        }
    }

    /// Checks the whole document. `at` is where to point when a key is missing.
    pub fn check(&mut self, node: &Node, what: &str) {
        self.value(node, &View(self.follow(self.root)), what, &node.span);
    }

    /// Checks a value against a definition of the document, such as `Step`.
    pub fn check_as(&mut self, definition: &str, node: &Node, what: &str) {
        let schema = &self.root["$defs"][definition];
        self.value(node, &View(self.follow(schema)), what, &node.span);
    }

    fn follow(&self, schema: &'a Value) -> Vec<&'a Map<String, Value>> {
        let mut maps = Vec::new();
        let mut next = Some(schema);
        while let Some(Value::Object(map)) = next {
            maps.push(map);
            next = map
                .get("$ref")
                .and_then(Value::as_str)
                .and_then(|r| r.strip_prefix('#'))
                .and_then(|pointer| self.root.pointer(pointer));
        }
        maps
    }

    /// Replaces an `anyOf` by the branch that fits the type and keys of the value; the first that is not null when
    /// none fits, so that its expectation is named.
    fn choose(&self, schema: View<'a>, node: &Node) -> View<'a> {
        let Some(Value::Array(branches)) = schema.get("anyOf") else {
            return schema;
        };
        let views: Vec<View<'a>> = branches
            .iter()
            .map(|b| View(self.follow(b)))
            .map(|v| {
                if v.get("anyOf").is_some() {
                    self.choose(v, node)
                } else {
                    v
                }
            })
            .filter(|v| !matches!(v.text("type"), Some("null")))
            .collect();
        // Of several mappings the one most of whose required keys are there.
        let keys = |v: &View<'a>| {
            let required = v.get("required").and_then(Value::as_array);
            let required = required.into_iter().flatten().filter_map(Value::as_str);
            required.filter(|k| node.get(k).is_some()).count()
        };
        let fitting = views.iter().filter(|v| type_fits(v, node));
        let fitting = fitting.rev().max_by_key(|v| keys(v)).or(views.first());
        let mut maps = schema.0.clone();
        if let Some(view) = fitting {
            maps.extend(view.0.iter().copied());
        }
        // Bounds stand beside the `anyOf`; the `anyOf` itself is done with.
        View(maps)
    }

    /// Whether the type of the value is that of a branch of the `anyOf`.
    fn fits_a_branch(&self, schema: &View<'a>, node: &Node) -> bool {
        let branches = schema.get("anyOf").and_then(Value::as_array);
        branches.into_iter().flatten().any(|b| {
            let branch = View(self.follow(b));
            type_fits(&branch, node) || self.fits_a_branch(&branch, node)
        })
    }

    fn value(&mut self, node: &Node, schema: &View<'a>, what: &str, key: &Span) {
        // Of what may be left out it stands on the branch.
        let branches = schema.get("anyOf").and_then(Value::as_array);
        let of_branch = |b: &'a Value| View(self.follow(b)).text("x-expected");
        let inner = branches.filter(|b| b.iter().any(|b| b["type"] == "null"));
        let inner = inner.and_then(|b| b.iter().find_map(of_branch));
        if let Some(expected) = schema.text("x-expected").or(inner)
            && !self.fits_a_branch(schema, node)
        {
            return self.wrong_type(node, what, expected, key, None);
        }
        let schema = &self.choose(schema.clone(), node);
        if let Some(dimension) = schema.text("x-dimension") {
            let words = schema.get("x-words").and_then(Value::as_array);
            if let (Some(words), Some(text)) = (words, node.text()) {
                if words.iter().any(|w| w == text) {
                    return;
                }
                if text.starts_with(|c: char| c.is_ascii_alphabetic()) {
                    let expected = format!("{} or a {dimension} with its unit", or_words(words));
                    return self.wrong_type(node, what, &expected, key, None);
                }
            }
            self.quantity(node, schema, dimension, what, key);
        } else if schema.text("x-format") == Some("memory") {
            self.memory(node, what, key);
        } else if let Some(Value::Array(variants)) = schema.get("oneOf") {
            self.one_of(node, variants, what, key);
        } else if let Some(wanted) = schema.get("const") {
            self.version(node, wanted, what, key);
        } else if schema.takes("object") {
            self.mapping(node, schema, what, key);
        } else if schema.takes("array") {
            self.list(node, schema, what, key);
        } else if schema.takes("integer") || schema.takes("number") {
            self.number(node, schema, what, key);
        } else if schema.takes("string") {
            if node.text().is_none() {
                let help = match node.kind {
                    Kind::Number(_) | Kind::Bool(_) => Some("put it in quotes".to_owned()),
                    _ => None,
                };
                self.wrong_type(node, what, "text", key, help);
            }
        } else if schema.takes("boolean") && !matches!(node.kind, Kind::Bool(_)) {
            self.wrong_type(node, what, "`true` or `false`", key, None);
        }
    }

    fn wrong_type(
        &mut self,
        node: &Node,
        what: &str,
        expected: &str,
        key: &Span,
        help: Option<String>,
    ) {
        // An empty value has no extent; its key has.
        let span = if node.kind == Kind::Null {
            key
        } else {
            &node.span
        };
        let message = format!("`{what}` is {}", node.describe());
        let d = self.problems.add(self.source, span, message);
        d.given(node.describe()).expected(expected);
        d.help = help;
    }

    fn quantity(
        &mut self,
        node: &Node,
        schema: &View<'a>,
        dimension: &str,
        what: &str,
        key: &Span,
    ) {
        let Some(dimension) = Dimension::ALL.into_iter().find(|d| d.name() == dimension) else {
            return;
        };
        let given = Given {
            node,
            what,
            key,
            source: self.source,
        };
        let Some(value) = quantity(&given, dimension, self.problems) else {
            return;
        };
        let bound = |name| {
            let text = schema.text(name)?;
            parse_quantity(text, dimension).ok().map(|v| (v, text))
        };
        let broken = [
            bound("x-exclusive-minimum")
                .filter(|b| value <= b.0)
                .map(|b| format!("more than {}", b.1)),
            bound("x-minimum")
                .filter(|b| value < b.0)
                .map(|b| format!("at least {}", b.1)),
            bound("x-maximum")
                .filter(|b| value > b.0)
                .map(|b| format!("at most {}", b.1)),
        ];
        if let Some(expected) = broken.into_iter().flatten().next() {
            out_of_bounds(node, what, expected, self.source, self.problems);
        }
    }

    fn memory(&mut self, node: &Node, what: &str, key: &Span) {
        let Some(text) = node.text() else {
            return self.wrong_type(node, what, "an amount of memory such as `4 GiB`", key, None);
        };
        if let Err(e) = text.parse::<plyflow_model::workflow::Memory>() {
            let d = self
                .problems
                .add(self.source, &node.span, format!("`{what}`: {e}"));
            d.given(text)
                .help("write a number and one of B, kB, MB, GB, KiB, MiB, GiB");
        }
    }

    fn number(&mut self, node: &Node, schema: &View<'a>, what: &str, key: &Span) {
        let whole = schema.takes("integer");
        let value = match &node.kind {
            Kind::Number(n) if !whole || n.is_i64() || n.is_u64() => n.as_f64(),
            _ => None,
        };
        let Some(value) = value else {
            let expected = if whole {
                "a whole number"
            } else {
                "a plain number such as `0.3`"
            };
            return self.wrong_type(node, what, expected, key, number_help(node, whole));
        };
        // The widths of the integers that the types hold.
        let widest = if whole {
            Some(f64::from(u32::MAX))
        } else {
            None
        };
        if let Some(low) = schema.number("minimum").filter(|&b| value < b) {
            out_of_bounds(
                node,
                what,
                format!("at least {low}"),
                self.source,
                self.problems,
            );
        } else if let Some(high) = schema.number("maximum").or(widest).filter(|&b| value > b) {
            out_of_bounds(
                node,
                what,
                format!("at most {high}"),
                self.source,
                self.problems,
            );
        }
    }

    fn version(&mut self, node: &Node, wanted: &Value, what: &str, key: &Span) {
        if node.to_json() == *wanted {
            return;
        }
        let span = if node.kind == Kind::Null {
            key
        } else {
            &node.span
        };
        let message = format!("version {} of the format is not supported", node.describe());
        let d = self
            .problems
            .add(self.source, span, message.replace("the number ", ""));
        d.given(node.describe())
            .expected(format!("`{what}: {wanted}`"));
        d.help(format!(
            "this program reads version {wanted}; a newer file needs a newer program"
        ));
    }

    fn one_of(&mut self, node: &Node, variants: &'a [Value], what: &str, key: &Span) {
        let constants: Vec<&str> = variants
            .iter()
            .filter_map(|v| v["const"].as_str())
            .collect();
        if constants.len() == variants.len() {
            let given = Given {
                node,
                what,
                key,
                source: self.source,
            };
            choice(&given, &constants, self.problems);
            return;
        }
        let names: Vec<(&str, &'a Value)> = variants
            .iter()
            .filter_map(|v| v["properties"].as_object()?.iter().next())
            .map(|(name, schema)| (name.as_str(), schema))
            .collect();
        let expected = format!("a mapping with {}", one_of(names.iter().map(|n| n.0)));
        if !matches!(node.kind, Kind::Map(_)) || node.entries().is_empty() {
            return self.wrong_type(node, what, &expected, key, mapping_help(node, what));
        }
        if let Some(second) = node.entries().get(1) {
            let d = self.problems.add(
                self.source,
                &second.key_span,
                format!("`{what}` has several kinds"),
            );
            d.given(
                node.entries()
                    .iter()
                    .map(|e| e.key.as_str())
                    .collect::<Vec<_>>()
                    .join(", "),
            );
            d.expected(expected).help("keep one of them");
        }
        for entry in node.entries() {
            match names.iter().find(|n| n.0 == entry.key) {
                Some((_, schema)) => {
                    self.value(
                        &entry.value,
                        &View(self.follow(schema)),
                        &entry.key,
                        &entry.key_span,
                    );
                }
                None => unknown_key(
                    entry,
                    what,
                    names.iter().map(|n| n.0),
                    self.source,
                    self.problems,
                ),
            }
        }
    }

    fn list(&mut self, node: &Node, schema: &View<'a>, what: &str, key: &Span) {
        let Kind::List(items) = &node.kind else {
            return self.wrong_type(node, what, "a list", key, list_help(node, what));
        };
        let (low, high) = (schema.number("minItems"), schema.number("maxItems"));
        let n = items.len() as f64;
        if low.is_some_and(|l| n < l) || high.is_some_and(|h| n > h) {
            let expected = match (low, high) {
                (Some(l), Some(h)) if l == h => format!("{l} items"),
                (Some(l), _) => format!("at least {l} items"),
                (_, h) => format!("at most {} items", h.unwrap_or(0.0)),
            };
            let d = self
                .problems
                .add(self.source, &node.span, format!("`{what}` has {n} items"));
            d.given(format!("{n} items")).expected(expected);
        }
        if let Some(of) = schema.get("items") {
            let of = View(self.follow(of));
            for (i, item) in items.iter().enumerate() {
                self.value(item, &of, &format!("{what}[{i}]"), &item.span);
            }
        }
    }

    fn mapping(&mut self, node: &Node, schema: &View<'a>, what: &str, key: &Span) {
        if !matches!(node.kind, Kind::Map(_)) {
            return self.wrong_type(node, what, "a mapping", key, mapping_help(node, what));
        }
        let properties: Vec<(&str, &'a Value)> = match schema.get("properties") {
            Some(Value::Object(p)) => p.iter().map(|(k, v)| (k.as_str(), v)).collect(),
            _ => Vec::new(),
        };
        let other = schema.get("additionalProperties");
        let required: Vec<&str> = match schema.get("required") {
            Some(Value::Array(names)) => names.iter().filter_map(Value::as_str).collect(),
            _ => Vec::new(),
        };
        for entry in node.entries() {
            let named = properties.iter().any(|p| p.0 == entry.key);
            // `with:` with nothing behind it is as good as no `with`.
            if named && entry.value.kind == Kind::Null && !required.contains(&entry.key.as_str()) {
                continue;
            }
            let known = properties.iter().find(|p| p.0 == entry.key).map(|p| p.1);
            match (known, other) {
                (Some(schema), _) | (None, Some(schema @ Value::Object(_))) => {
                    self.value(
                        &entry.value,
                        &View(self.follow(schema)),
                        &entry.key,
                        &entry.key_span,
                    );
                }
                (None, Some(Value::Bool(false))) => {
                    let names = properties.iter().map(|p| p.0);
                    unknown_key(entry, what, names, self.source, self.problems);
                }
                _ => {}
            }
        }
        for name in required {
            if node.entry(name).is_none() {
                let d =
                    self.problems
                        .add(self.source, key, format!("`{name}` is missing in `{what}`"));
                d.expected(format!("`{name}: ..`"));
                let about = properties.iter().find(|p| p.0 == name);
                d.help = about
                    .and_then(|p| p.1["description"].as_str())
                    .map(|t| format!("{name}: {t}"));
            }
        }
    }
}

/// Reports every repeated key of a tree.
pub fn repeated_keys(node: &Node, source: &Source, problems: &mut Problems) {
    let entries = node.entries();
    let mut places: HashMap<&str, &Span> = HashMap::new();
    for (i, entry) in entries.iter().enumerate() {
        // Most mappings are small; only a long one is worth a table.
        let first = if entries.len() <= 16 {
            entries[..i]
                .iter()
                .find(|e| e.key == entry.key)
                .map(|e| &e.key_span)
        } else {
            places.insert(&entry.key, &entry.key_span)
        };
        if let Some(first) = first {
            let line = source.line(first);
            let d = problems.add(
                source,
                &entry.key_span,
                format!("the key `{}` is repeated", entry.key),
            );
            d.given(entry.key.clone())
                .help(format!("it stands in line {line} already; remove one"));
        }
        repeated_keys(&entry.value, source, problems);
    }
    for item in node.items() {
        repeated_keys(item, source, problems);
    }
}

/// Reports a key that is not among `names`.
pub fn unknown_key<'n>(
    entry: &crate::yaml::Entry,
    what: &str,
    names: impl IntoIterator<Item = &'n str>,
    source: &Source,
    problems: &mut Problems,
) {
    let message = format!("unknown key `{}` in `{what}`", entry.key);
    problems
        .add(source, &entry.key_span, message)
        .given(entry.key.clone())
        .suggest(&entry.key, names);
}

/// Reports a value out of its bounds and returns the finding, to say more about it.
pub fn out_of_bounds<'p>(
    node: &Node,
    what: &str,
    expected: String,
    source: &Source,
    problems: &'p mut Problems,
) -> &'p mut Diagnostic {
    let d = problems.add(
        source,
        &node.span,
        format!("`{what}` is {}", node.describe()),
    );
    d.given(node.describe()).expected(expected)
}

/// A value of a file.
pub struct Given<'a> {
    /// The value.
    pub node: &'a Node,
    /// What it is called.
    pub what: &'a str,
    /// Where its key stands, to point at when the value is empty.
    pub key: &'a Span,
    /// The file.
    pub source: &'a Source,
}

impl Given<'_> {
    /// Where to point.
    fn span(&self) -> &Span {
        // An empty value has no extent; its key has.
        match self.node.kind {
            Kind::Null => self.key,
            _ => &self.node.span,
        }
    }
}

/// Reads a quantity or reports why it is none.
pub fn quantity(given: &Given<'_>, dimension: Dimension, problems: &mut Problems) -> Option<f64> {
    let Given {
        node, what, source, ..
    } = given;
    let text = match &node.kind {
        Kind::Text(text) => text.clone(),
        Kind::Number(n) => n.to_string(),
        _ => {
            let message = format!("`{what}` is {}", node.describe());
            let d = problems.add(source, given.span(), message);
            let (article, example) = (dimension.with_article(), dimension.example());
            d.given(node.describe())
                .expected(format!("{article} such as `{example}`"));
            return None;
        }
    };
    match parse_quantity(&text, dimension) {
        Ok(value) => Some(value),
        Err(e) => {
            let d = problems.add(source, &node.span, format!("`{what}`: {}", e.reason()));
            d.given(text).expected(format!(
                "{} such as `{}`",
                dimension.with_article(),
                dimension.example()
            ));
            d.help(e.help());
            None
        }
    }
}

/// Reads one of some names or reports the nearest.
pub fn choice<'n>(
    given: &Given<'_>,
    names: &[&'n str],
    problems: &mut Problems,
) -> Option<&'n str> {
    let Given {
        node, what, source, ..
    } = given;
    if let Some(found) = node.text().and_then(|t| names.iter().find(|n| **n == t)) {
        return Some(found);
    }
    let message = format!("`{what}` is {}", node.describe());
    let d = problems.add(source, given.span(), message);
    d.given(node.describe())
        .expected(one_of(names.iter().copied()));
    if let Some(text) = node.text() {
        d.suggest(text, names.iter().copied());
    }
    None
}

fn type_fits(schema: &View<'_>, node: &Node) -> bool {
    match &node.kind {
        Kind::Null => schema.takes("null"),
        Kind::Bool(_) => schema.takes("boolean"),
        Kind::Number(_) => schema.takes("number") || schema.takes("integer"),
        // Of a list of words none has a type beside it.
        Kind::Text(_) => schema.takes("string") || schema.get("oneOf").is_some_and(has_words),
        Kind::List(_) => schema.takes("array"),
        Kind::Map(_) => schema.takes("object") || schema.get("oneOf").is_some(),
    }
}
