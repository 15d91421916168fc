//! The only place that knows the YAML library: text -> tree in which every key and every value knows
//! where it stands.
//!
//! The tree is our own because the library loses places inside `flatten`, `untagged` and tagged types.
//! Typing happens later, from the tree.

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};
use serde_saphyr::{DuplicateKeyPolicy, Location, Options, Spanned};
use std::fmt;
use std::ops::Range;

/// Byte range in a file.
pub type Span = Range<usize>;

/// A value and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct Node {
    /// The value.
    pub kind: Kind,
    /// The scalar, or the start of the sequence or mapping.
    pub span: Span,
}

/// A YAML value; plain scalars are typed by the core schema with `true` and `false` as only booleans.
#[derive(Debug, Clone, PartialEq)]
pub enum Kind {
    /// Nothing, `null` or `~`.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// Integer or decimal.
    Number(serde_json::Number),
    /// Text.
    Text(String),
    /// Sequence.
    List(Vec<Node>),
    /// Mapping, in the order of the file.
    Map(Vec<Entry>),
}

/// One entry of a mapping.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Key.
    pub key: String,
    /// Where the key stands.
    pub key_span: Span,
    /// Value.
    pub value: Node,
}

/// Why a text is no YAML.
#[derive(Debug, Clone, PartialEq)]
pub struct SyntaxError {
    /// The library's message.
    pub message: String,
    /// Where.
    pub span: Span,
}

impl Node {
    /// The entry of a mapping; the last one when a key is repeated.
    pub fn entry(&self, key: &str) -> Option<&Entry> {
        self.entries().iter().rev().find(|e| e.key == key)
    }

    /// The value of a key; `null` counts as absent.
    pub fn get(&self, key: &str) -> Option<&Node> {
        self.entry(key)
            .map(|e| &e.value)
            .filter(|n| n.kind != Kind::Null)
    }

    /// The entries of a mapping; none for anything else.
    pub fn entries(&self) -> &[Entry] {
        match &self.kind {
            Kind::Map(entries) => entries,
            _ => &[],
        }
    }

    /// The items of a sequence; none for anything else.
    pub fn items(&self) -> &[Node] {
        match &self.kind {
            Kind::List(items) => items,
            _ => &[],
        }
    }

    /// The text, if it is one.
    pub fn text(&self) -> Option<&str> {
        match &self.kind {
            Kind::Text(text) => Some(text),
            _ => None,
        }
    }

    /// Without places; keys without a value are left out, as if they were not there.
    pub fn to_json(&self) -> Value {
        match &self.kind {
            Kind::Null => Value::Null,
            Kind::Bool(b) => Value::Bool(*b),
            Kind::Number(n) => Value::Number(n.clone()),
            Kind::Text(text) => Value::String(text.clone()),
            Kind::List(items) => Value::Array(items.iter().map(Node::to_json).collect()),
            Kind::Map(entries) => Value::Object(
                entries
                    .iter()
                    .filter(|e| e.value.kind != Kind::Null)
                    .map(|e| (e.key.clone(), e.value.to_json()))
                    .collect::<Map<String, Value>>(),
            ),
        }
    }

    /// A tree that stands at one place as a whole, such as a default of a manifest.
    pub fn from_json(value: &Value, span: &Span) -> Node {
        let kind = match value {
            Value::Null => Kind::Null,
            Value::Bool(b) => Kind::Bool(*b),
            Value::Number(n) => Kind::Number(n.clone()),
            Value::String(text) => Kind::Text(text.clone()),
            Value::Array(items) => {
                Kind::List(items.iter().map(|v| Node::from_json(v, span)).collect())
            }
            Value::Object(map) => Kind::Map(
                map.iter()
                    .map(|(key, v)| Entry {
                        key: key.clone(),
                        key_span: span.clone(),
                        value: Node::from_json(v, span),
                    })
                    .collect(),
            ),
        };
        Node {
            kind,
            span: span.clone(),
        }
    }

    /// What it is, for messages: "the number 5".
    pub fn describe(&self) -> String {
        match &self.kind {
            Kind::Null => "nothing".into(),
            Kind::Bool(b) => format!("`{b}`"),
            Kind::Number(n) => format!("the number {n}"),
            Kind::Text(text) if text.chars().count() > 60 => {
                format!("`{}…`", text.chars().take(57).collect::<String>())
            }
            Kind::Text(text) => format!("`{text}`"),
            Kind::List(_) => "a list".into(),
            Kind::Map(_) => "a mapping".into(),
        }
    }
}

/// Reads a YAML text.
///
/// Repeated keys are kept (see [`Entry`]) so that they can all be reported. Aliases stand where they are
/// used; expansion is bounded by the library.
///
/// # Errors
/// When the text is no YAML, has several documents or keys that are no text.
pub fn parse(text: &str) -> Result<Node, SyntaxError> {
    let mut options = Options::default();
    options.strict_booleans = true;
    // The visitor below sees repeated keys of plain mappings only under this policy.
    options.duplicate_keys = DuplicateKeyPolicy::LastWins;
    let raw: Raw = serde_saphyr::from_str_with_options(text, options).map_err(|e| {
        let mut message = e.without_snippet().to_string();
        if let Some(i) = message.rfind(" at line ") {
            message.truncate(i);
        }
        let mut span = e.location().map_or(0..0, |l| span(text, &l));
        // The library points at the scalar before a forbidden tab, which may be lines above it.
        if message.contains("found a tab")
            && let Some(i) = text[span.start..].find('\t')
        {
            span = span.start + i..span.start + i + 1;
        }
        SyntaxError { message, span }
    })?;
    Ok(raw.locate(text))
}

/// Byte range of a location; from line and column when the library gives no offset.
fn span(text: &str, location: &Location) -> Span {
    let given = location.span();
    let start = match given.byte_offset() {
        Some(start) => start as usize,
        None => byte_of(text, location.line() as usize, location.column() as usize),
    };
    let start = start.min(text.len());
    let end = (start + given.byte_len().unwrap_or(0) as usize).min(text.len());
    // A place inside a character would make slicing panic.
    if text.is_char_boundary(start) && text.is_char_boundary(end) {
        start..end
    } else {
        0..0
    }
}

/// The empty range at a line and a column (bytes, as `serde_json` counts), both from 1.
pub fn span_at(text: &str, line: usize, column: usize) -> Span {
    let lines = text.split_inclusive('\n');
    let before: usize = lines.take(line.saturating_sub(1)).map(str::len).sum();
    let mut at = (before + column.saturating_sub(1)).min(text.len());
    while !text.is_char_boundary(at) {
        at -= 1;
    }
    at..at
}

fn byte_of(text: &str, line: usize, column: usize) -> usize {
    let before: usize = text
        .split_inclusive('\n')
        .take(line.saturating_sub(1))
        .map(str::len)
        .sum();
    let rest = text.get(before..).unwrap_or("");
    before
        + rest
            .char_indices()
            .nth(column.saturating_sub(1))
            .map_or(rest.len(), |(i, _)| i)
}

/// The tree as the library gives it.
struct Raw(Spanned<RawKind>);

enum RawKind {
    Scalar(Kind),
    List(Vec<Raw>),
    Map(Vec<(Spanned<String>, Raw)>),
}

impl Raw {
    fn locate(self, text: &str) -> Node {
        let span_here = span(text, &self.0.referenced);
        let kind = match self.0.value {
            RawKind::Scalar(kind) => kind,
            RawKind::List(items) => Kind::List(items.into_iter().map(|n| n.locate(text)).collect()),
            RawKind::Map(entries) => Kind::Map(
                entries
                    .into_iter()
                    .map(|(key, value)| Entry {
                        key_span: span(text, &key.referenced),
                        key: key.value,
                        value: value.locate(text),
                    })
                    .collect(),
            ),
        };
        Node {
            kind,
            span: span_here,
        }
    }
}

impl<'de> Deserialize<'de> for Raw {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        Spanned::<RawKind>::deserialize(d).map(Raw)
    }
}

impl<'de> Deserialize<'de> for RawKind {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        d.deserialize_any(RawVisitor)
    }
}

struct RawVisitor;

impl<'de> Visitor<'de> for RawVisitor {
    type Value = RawKind;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a YAML value")
    }

    fn visit_unit<E>(self) -> Result<RawKind, E> {
        Ok(RawKind::Scalar(Kind::Null))
    }

    fn visit_none<E>(self) -> Result<RawKind, E> {
        Ok(RawKind::Scalar(Kind::Null))
    }

    fn visit_bool<E>(self, v: bool) -> Result<RawKind, E> {
        Ok(RawKind::Scalar(Kind::Bool(v)))
    }

    fn visit_i64<E>(self, v: i64) -> Result<RawKind, E> {
        Ok(RawKind::Scalar(Kind::Number(v.into())))
    }

    fn visit_u64<E>(self, v: u64) -> Result<RawKind, E> {
        Ok(RawKind::Scalar(Kind::Number(v.into())))
    }

    fn visit_f64<E: serde::de::Error>(self, v: f64) -> Result<RawKind, E> {
        let number = serde_json::Number::from_f64(v);
        number
            .map(|n| RawKind::Scalar(Kind::Number(n)))
            .ok_or_else(|| E::custom("a number must be finite"))
    }

    fn visit_str<E>(self, v: &str) -> Result<RawKind, E> {
        Ok(RawKind::Scalar(Kind::Text(v.into())))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut a: A) -> Result<RawKind, A::Error> {
        let mut items = Vec::new();
        while let Some(item) = a.next_element()? {
            items.push(item);
        }
        Ok(RawKind::List(items))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut a: A) -> Result<RawKind, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = a.next_entry()? {
            entries.push(entry);
        }
        Ok(RawKind::Map(entries))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at<'a>(text: &'a str, span: &Span) -> &'a str {
        &text[span.clone()]
    }

    #[test]
    fn keys_and_values_know_their_place_also_behind_wide_characters() {
        let text = "µ: {c: 5 mm, d: [1, 'x']}\ne: 2.5\n";
        let node = parse(text).unwrap();
        let c = node.get("µ").unwrap().entry("c").unwrap();
        assert_eq!(at(text, &c.value.span), "5 mm");
        assert!(text[c.key_span.start..].starts_with("c:"));
        assert_eq!(
            at(
                text,
                &node.get("µ").unwrap().get("d").unwrap().items()[1].span
            ),
            "'x'"
        );
        assert_eq!(at(text, &node.get("e").unwrap().span), "2.5");
    }

    #[test]
    fn only_true_and_false_are_booleans() {
        let node = parse("[true, yes, on, 'true']").unwrap();
        let kinds: Vec<bool> = node
            .items()
            .iter()
            .map(|n| matches!(n.kind, Kind::Bool(_)))
            .collect();
        assert_eq!(kinds, [true, false, false, false]);
    }

    #[test]
    fn repeated_keys_are_kept_and_the_last_one_is_read() {
        let node = parse("a: 1\na: 2\n").unwrap();
        assert_eq!(node.entries().len(), 2);
        assert_eq!(node.get("a").unwrap().kind, Kind::Number(2.into()));
    }

    #[test]
    fn a_merged_mapping_is_overridden_and_not_repeated() {
        let node = parse("x: &x {a: 1, b: 2}\ny:\n  <<: *x\n  a: 3\n").unwrap();
        let y = node.get("y").unwrap();
        assert_eq!(y.to_json(), serde_json::json!({"a": 3, "b": 2}));
        assert_eq!(y.entries().len(), 2);
    }

    #[test]
    fn a_syntax_error_has_its_place() {
        let text = "a: 1\nb: [1\nc: 2\n";
        let error = parse(text).unwrap_err();
        assert!(error.span.start >= 9, "{error:?}");
        assert!(!error.message.contains("line"), "{error:?}");
    }

    #[test]
    fn a_billion_laughs_are_refused() {
        let mut text = String::from("a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n");
        for i in 1..9 {
            let list = vec![format!("*a{}", i - 1); 10].join(", ");
            text += &format!("a{i}: &a{i} [{list}]\n");
        }
        assert!(parse(&text).is_err());
    }
}
