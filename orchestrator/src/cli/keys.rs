//! A file format in words: the keys of its JSON Schema as an outline for people.

use serde_json::{Map, Value};
use std::collections::HashMap;
use std::fmt::Write;

/// Columns of text.
const WIDTH: usize = 110;

/// The keys of a format with their types, bounds, defaults and meanings, one below the other.
pub fn outline(schema: &Value) -> String {
    let mut writer = Writer {
        definitions: &schema["$defs"],
        written: HashMap::new(),
        of_file: HashMap::new(),
        open: Vec::new(),
        out: String::new(),
    };
    writer.note_keys_of_file(schema);
    if let Some(text) = schema["description"].as_str() {
        writer.prose(text, 0);
    }
    writer.out.push('\n');
    writer.keys(schema, 0);
    writer.out
}

struct Writer<'s> {
    definitions: &'s Value,
    /// Definitions whose keys have been written, and under which key.
    written: HashMap<String, String>,
    /// Definitions of the file's own keys, and which key: they are told there, not where they stand deeper down.
    of_file: HashMap<String, String>,
    /// Definitions that are being written: one of them within itself (a product of sets of points) would never end.
    open: Vec<String>,
    out: String,
}

/// A schema with its reference followed, and the name of that.
struct Resolved {
    schema: Map<String, Value>,
    name: Option<String>,
}

impl Resolved {
    fn get(&self, key: &str) -> &Value {
        self.schema.get(key).unwrap_or(&Value::Null)
    }

    fn list(&self, key: &str) -> &[Value] {
        self.get(key).as_array().map_or(&[], Vec::as_slice)
    }
}

impl Writer<'_> {
    /// Follows references and leaves out that a value may be absent; what stands beside a reference has the last word.
    fn resolve(&self, schema: &Value) -> Resolved {
        let mut own = schema.as_object().cloned().unwrap_or_default();
        let is_null = |v: &&Value| v["type"] == "null";
        let inner = match own.get("anyOf").and_then(Value::as_array) {
            Some(any) if any.len() == 2 && any.iter().any(|v| is_null(&v)) => {
                any.iter().find(|v| !is_null(v)).cloned()
            }
            _ => None,
        };
        let mut found = match (&inner, own.get("$ref").and_then(Value::as_str)) {
            (Some(inner), _) => self.resolve(inner),
            (None, Some(reference)) => {
                let name = reference.rsplit('/').next().unwrap_or_default().to_owned();
                let mut found = self.resolve(&self.definitions[&name]);
                found.name.get_or_insert(name);
                found
            }
            (None, None) => {
                return Resolved {
                    schema: own,
                    name: None,
                };
            }
        };
        own.remove("$ref");
        if inner.is_some() {
            own.remove("anyOf");
        }
        found.schema.extend(own);
        found
    }

    /// What a value is, in a few words.
    fn words(&self, value: &Resolved) -> String {
        if let Some(one) = value.schema.get("const") {
            return plain(one);
        }
        if let Some(dimension) = value.get("x-dimension").as_str() {
            let words = value.list("x-words").iter().map(plain);
            let all = words.chain([dimension.replace('_', " ")]);
            return all.collect::<Vec<_>>().join(" or ");
        }
        let one_of = value.list("oneOf");
        if !one_of.is_empty() {
            let names = one_of.iter().filter_map(|v| v.get("const")).map(plain);
            let names: Vec<String> = names.collect();
            return if names.len() == one_of.len() {
                names.join(" or ")
            } else {
                "one of".into()
            };
        }
        let any_of = value.list("anyOf");
        if !any_of.is_empty() {
            let mut words: Vec<String> = Vec::new();
            for one in any_of {
                let word = self.words(&self.resolve(one));
                if !words.contains(&word) {
                    words.push(word);
                }
            }
            return words.join(" or ");
        }
        let kind = match value.get("type") {
            Value::Array(kinds) => kinds.iter().find(|k| *k != "null").and_then(Value::as_str),
            kind => kind.as_str(),
        };
        match kind {
            Some("array") => {
                let item = self.words(&self.resolve(value.get("items")));
                match (value.get("minItems"), value.get("maxItems")) {
                    (Value::Number(low), Value::Number(high)) if low == high => {
                        format!(
                            "[{}]",
                            vec![item; low.as_u64().unwrap_or(1) as usize].join(", ")
                        )
                    }
                    _ => format!("list of {item}"),
                }
            }
            Some("string") => "text".into(),
            Some("integer") => "whole number".into(),
            Some("boolean") => "true or false".into(),
            Some("object") => "mapping".into(),
            Some(other) => other.into(),
            None => "any value".into(),
        }
    }

    fn note_keys_of_file(&mut self, schema: &Value) {
        let file = self.resolve(schema);
        for (key, one) in file.get("properties").as_object().into_iter().flatten() {
            if let Some(name) = self.resolve(one).name {
                self.of_file.insert(name, key.clone());
            }
        }
    }

    fn keys(&mut self, schema: &Value, depth: usize) {
        let value = self.resolve(schema);
        self.keys_of(&value, depth);
    }

    fn keys_of(&mut self, value: &Resolved, depth: usize) {
        let required: Vec<&str> = (value.list("required").iter())
            .filter_map(Value::as_str)
            .collect();
        if let Some(properties) = value.get("properties").as_object() {
            // Those that must be given come first.
            let (first, rest): (Vec<_>, Vec<_>) = properties
                .iter()
                .partition(|(key, _)| required.contains(&key.as_str()));
            for (key, one) in first.into_iter().chain(rest) {
                self.key(key, one, required.contains(&key.as_str()), depth);
            }
        }
        // Keys that one chooses oneself.
        if value.get("additionalProperties").is_object() {
            self.key("<name>", value.get("additionalProperties"), false, depth);
        }
        for one in value.list("oneOf") {
            let one = self.resolve(one);
            for (key, inner) in one.get("properties").as_object().into_iter().flatten() {
                let mut inner = inner.clone();
                if let (None, Some(text)) =
                    (inner.get("description"), one.schema.get("description"))
                {
                    inner["description"] = text.clone();
                }
                self.key(key, &inner, false, depth);
            }
        }
        for one in value.list("anyOf") {
            self.named(one, depth, None);
        }
        if value.get("items").is_object() {
            self.named(value.get("items"), depth, None);
        }
    }

    fn key(&mut self, key: &str, schema: &Value, required: bool, depth: usize) {
        let value = self.resolve(schema);
        let mut told = vec![self.words(&value)];
        for (bound, words) in [
            ("x-minimum", "at least"),
            ("minimum", "at least"),
            ("x-exclusive-minimum", "more than"),
            ("exclusiveMinimum", "more than"),
            ("x-maximum", "at most"),
            ("maximum", "at most"),
        ] {
            if let (Some(limit), true) = (value.schema.get(bound), value.get("const").is_null()) {
                told.push(format!("{words} {}", plain(limit)));
            }
        }
        match value.schema.get("default") {
            _ if required => told.push("required".into()),
            Some(default) if !default.is_null() => told.push(format!("default {}", plain(default))),
            _ => {}
        }
        let _ = writeln!(self.out, "{}{key}: {}", "  ".repeat(depth), told.join(", "));
        if let Some(text) = value.get("description").as_str() {
            self.prose(text, depth + 2);
        }
        self.named(schema, depth + 1, Some(key));
    }

    /// Whether anything below a value has keys to be told; lists and alternatives are looked through.
    fn has_keys(&self, value: &Resolved, depth: usize) -> bool {
        let own = |v: &Resolved| {
            v.get("properties").is_object() || v.get("additionalProperties").is_object()
        };
        if own(value) || depth > 4 {
            return true;
        }
        let items = value.get("items");
        let items = items.is_object().then_some(items);
        let below = value
            .list("oneOf")
            .iter()
            .chain(value.list("anyOf"))
            .chain(items);
        below
            .map(|one| self.resolve(one))
            .any(|one| self.has_keys(&one, depth + 1))
    }

    /// The keys of a definition, the first time; later where they stand.
    fn named(&mut self, schema: &Value, depth: usize, key: Option<&str>) {
        let value = self.resolve(schema);
        if let Some(name) = &value.name {
            let has_keys = self.has_keys(&value, 0);
            if !has_keys {
                return;
            }
            if let (Some(key), true) = (self.of_file.get(name), depth > 1) {
                let text = format!("(keys as under `{key}` of the file)");
                self.prose(&text, depth + 1);
                return;
            }
            if let Some(before) = self.written.get(name) {
                let text = format!("(keys as under `{before}` above)");
                self.prose(&text, depth + 1);
                return;
            }
            if self.open.contains(name) {
                self.prose("(the same keys again)", depth + 1);
                return;
            }
            if let Some(key) = key {
                self.written.insert(name.clone(), key.to_owned());
            }
        }
        self.open.extend(value.name.clone());
        self.keys_of(&value, depth);
        if value.name.is_some() {
            self.open.pop();
        }
    }

    fn prose(&mut self, text: &str, depth: usize) {
        let indent = "  ".repeat(depth);
        let mut line = String::new();
        for word in text.split_whitespace() {
            if !line.is_empty() && indent.len() + line.len() + 1 + word.chars().count() > WIDTH {
                let _ = writeln!(self.out, "{indent}{line}");
                line.clear();
            }
            if !line.is_empty() {
                line.push(' ');
            }
            line += word;
        }
        if !line.is_empty() {
            let _ = writeln!(self.out, "{indent}{line}");
        }
    }
}

/// A value as one would write it.
fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Array(all) => format!("[{}]", all.iter().map(plain).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use plyflow_model::schema;

    #[test]
    fn every_key_of_a_scene_stands_there_with_what_it_takes() {
        let text = outline(&schema::scene());
        for line in [
            "plyflow_scene: 1, required",
            "tool: one of, required",
            "  stl: mapping",
            // Told as a key of the file, and not where a part of a stamping has it first.
            "          (keys as under `tool` of the file)",
            "    unit: length, more than 0 mm, required",
            "    translate: [length, length, length], default [0 m, 0 m, 0 m]",
            "    up: +x or -x or +y or -y or +z or -z or [number, number, number]",
            "    rotate: angle or list of mapping",
            "    centre: auto or [length, length]",
            "    foot: auto or length",
            "sheets: list of mapping, required",
            "  kind: ply or diaphragm, required",
            "  fibre_2: angle",
            "  double_diaphragm: mapping",
            "    film_pre_stretch: number, at least 0, at most 0.2, default 0.0",
            "    weight: tool or away",
            "        force: force, at least 0 N",
            "symmetry: list of x or y",
        ] {
            assert!(text.lines().any(|l| l == line), "'{line}' in:\n{text}");
        }
        // What has no keys points to none.
        assert!(!text.contains("(keys as under `axis` above)"), "{text}");
        // The law of friction is told once.
        assert_eq!(text.matches("exponent:").count(), 1, "{text}");
        assert!(text.contains("(keys as under `"), "{text}");
        assert!(text.lines().all(|l| l.chars().count() <= WIDTH), "{text}");
        assert!(!text.contains("any value"), "{text}");
    }

    #[test]
    fn other_formats_are_told_too() {
        let material = outline(&schema::material());
        let lines = [
            "thickness: length, more than 0 mm, required",
            "plugin: text, required",
        ];
        for line in lines {
            assert!(
                material.lines().any(|l| l == line),
                "'{line}' in:\n{material}"
            );
        }
        let workflow = outline(&schema::workflow());
        assert!(workflow.contains("for_each: "));
        // A set of points may have sets of points in it.
        assert!(workflow.contains("(the same keys again)"), "{workflow}");
    }
}
