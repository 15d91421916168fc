//! The tables of attributes in `schemas/data-model.md` are those of the types, and every kind that a step writes has one.

use plyflow_model::schema;
use serde_json::Value;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Writes the attributes of one kind after the other.
struct Tables<'s> {
    definitions: &'s Value,
    /// Where a type has been written out: its kind and place there.
    written: BTreeMap<String, String>,
    kind: String,
    rows: String,
}

impl<'s> Tables<'s> {
    /// A schema with its reference followed, and the name of that.
    fn resolve(&self, schema: &'s Value) -> (&'s Value, Option<&'s str>) {
        let reference = schema["$ref"].as_str();
        let name = reference.and_then(|r| r.strip_prefix("#/$defs/"));
        name.map_or((schema, None), |name| (&self.definitions[name], Some(name)))
    }

    /// The forms of which a value has one, and whether it may be null.
    fn forms(&self, schema: &'s Value) -> (Vec<&'s Value>, bool) {
        let list = schema["anyOf"].as_array().or(schema["oneOf"].as_array());
        let Some(list) = list else {
            return (vec![schema], false);
        };
        let is_null = |s: &&Value| s["type"] == "null";
        (
            list.iter().filter(|s| !is_null(s)).collect(),
            list.iter().any(|s| is_null(&s)),
        )
    }

    /// What a value is, in words.
    fn words(&self, schema: &'s Value) -> String {
        let (schema, _) = self.resolve(schema);
        if let Some(word) = schema["const"].as_str() {
            return format!("`{word}`");
        }
        if let Some(words) = schema["enum"].as_array() {
            let words = words.iter().filter_map(Value::as_str);
            return words
                .map(|w| format!("`{w}`"))
                .collect::<Vec<_>>()
                .join(", ");
        }
        let (forms, null) = self.forms(schema);
        if forms.len() != 1 || !std::ptr::eq(forms[0], schema) {
            let mut all: Vec<String> = forms.iter().map(|f| self.words(f)).collect();
            all.dedup();
            if null {
                all.push("null".into());
            }
            return all.join(" or ");
        }
        let one = |kind: &str| match kind {
            "object"
                if schema["properties"].is_null() && schema["additionalProperties"].is_object() =>
            {
                format!("by name: {}", self.words(&schema["additionalProperties"]))
            }
            "object" => "mapping".into(),
            "array" => self.list(schema),
            "integer" => "whole number".into(),
            "string" => "text".into(),
            other => other.to_owned(),
        };
        match &schema["type"] {
            Value::String(kind) => one(kind),
            Value::Array(kinds) => {
                let kinds = kinds.iter().filter_map(Value::as_str);
                kinds.map(one).collect::<Vec<_>>().join(" or ")
            }
            _ => "anything".into(),
        }
    }

    fn list(&self, schema: &'s Value) -> String {
        let count = &schema["minItems"];
        let many = if count.is_u64() && *count == schema["maxItems"] {
            format!("{count} of")
        } else {
            "list of".into()
        };
        format!("{many} {}", self.words(&schema["items"]))
    }

    /// The mapping inside of a value, if there is one in it that has keys: its schema, the name of its type, and the way to it.
    fn inner(&self, schema: &'s Value) -> Option<(&'s Value, Option<&'s str>, String)> {
        let (schema, name) = self.resolve(schema);
        if !schema["properties"].is_null() {
            return Some((schema, name, String::new()));
        }
        if let (forms, _) = self.forms(schema)
            && !std::ptr::eq(forms[0], schema)
        {
            return forms.iter().find_map(|f| self.inner(f));
        }
        for (key, way) in [("items", "[]"), ("additionalProperties", ".NAME")] {
            if schema[key].is_object()
                && let Some((found, name, rest)) = self.inner(&schema[key])
            {
                return Some((found, name, format!("{way}{rest}")));
            }
        }
        None
    }

    fn keys(&mut self, schema: &'s Value, path: &str) {
        let required: Vec<&str> = (schema["required"].as_array().into_iter().flatten())
            .filter_map(Value::as_str)
            .collect();
        for (key, value) in schema["properties"].as_object().into_iter().flatten() {
            let own = value["description"].as_str();
            let told = own.or(self.resolve(value).0["description"].as_str());
            let told = told
                .unwrap_or_default()
                .replace('\n', " ")
                .replace('|', "\\|");
            let place = if path.is_empty() {
                key.clone()
            } else {
                format!("{path}.{key}")
            };
            let optional = if required.contains(&key.as_str()) {
                ""
            } else {
                "; may be left out"
            };
            let inner = self.inner(value);
            let name = inner.as_ref().and_then(|(_, name, _)| *name);
            let before = name.and_then(|n| self.written.get(n)).cloned();
            let see = before
                .as_ref()
                .map_or(String::new(), |b| format!(" Its keys are those of {b}."));
            let words = self.words(value);
            writeln!(self.rows, "| `{place}` | {words}{optional} | {told}{see} |").unwrap();
            if let (Some((found, name, way)), None) = (inner, before) {
                let place = format!("{place}{way}");
                if let Some(name) = name {
                    let there = format!("`{place}` of `{}`", self.kind);
                    self.written.insert(name.into(), there);
                }
                self.keys(found, &place);
            }
        }
    }

    fn of_kind(&mut self, kind: &str, schema: &'s Value) -> String {
        self.kind = kind.into();
        self.rows = "| attribute | what it is | what it tells |\n|---|---|---|\n".into();
        let (schema, _) = self.resolve(schema);
        let (forms, _) = self.forms(schema);
        for (k, form) in forms.iter().enumerate() {
            let (form, _) = self.resolve(form);
            if k > 0 {
                let told = form["description"].as_str().unwrap_or_default();
                let head = "| attribute | what it is | what it tells |\n|---|---|---|\n";
                write!(self.rows, "\n{told}\n\n{head}").unwrap();
            }
            self.keys(form, "");
        }
        std::mem::take(&mut self.rows)
    }
}

/// The text with what stands between the marks of each kind set anew.
fn with_tables(text: &str, tables: &BTreeMap<String, String>) -> String {
    let mut out = text.to_owned();
    for (kind, table) in tables {
        let (begin, end) = (format!("<!-- attributes: {kind} -->\n"), "<!-- end -->");
        let from = out.find(&begin).map(|i| i + begin.len());
        let from = from.unwrap_or_else(|| panic!("data-model.md has no mark {begin}"));
        let to = from + out[from..].find(end).expect("an end");
        out.replace_range(from..to, table);
    }
    out
}

#[test]
fn the_data_model_tells_every_attribute_that_the_types_have_and_no_other() {
    let schema = schema::artifacts();
    // What every kind may show is told before the kinds.
    let shown = [
        ("Plot", "plots"),
        ("Map", "maps"),
        ("Table", "tables"),
        ("CarriedFile", "files"),
    ];
    let shown = shown.map(|(name, word)| (name.to_owned(), format!("[`{word}`](#{word})")));
    let mut tables = Tables {
        definitions: &schema["$defs"],
        written: shown.into(),
        kind: String::new(),
        rows: String::new(),
    };
    // In the order of the page, so that what is told once is told where it comes first.
    let path = root().join("schemas/data-model.md");
    let text = std::fs::read_to_string(&path).unwrap();
    let kinds = text.split("<!-- attributes: ").skip(1);
    let kinds: Vec<String> = kinds
        .map(|t| t[..t.find(' ').unwrap()].to_owned())
        .collect();
    let written: BTreeMap<String, String> = (kinds.iter())
        .map(|kind| {
            (
                kind.clone(),
                tables.of_kind(kind, &schema["properties"][kind]),
            )
        })
        .collect();
    let all: Vec<&String> = schema["properties"].as_object().unwrap().keys().collect();
    assert!(
        all.iter().all(|k| written.contains_key(*k)),
        "{all:?} of {kinds:?}"
    );
    let wanted = with_tables(&text, &written);
    if std::env::var_os("UPDATE_SCHEMAS").is_some() {
        std::fs::write(&path, &wanted).unwrap();
        return;
    }
    assert!(
        text == wanted,
        "schemas/data-model.md is out of date: UPDATE_SCHEMAS=1 cargo test -p plyflow-model"
    );
}

#[test]
fn every_kind_that_a_shipped_step_writes_has_a_type() {
    let schema = schema::artifacts();
    let mut seen = 0;
    let mut folders = vec![root().join("solver-plugins")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            // A template is an example, of a kind that its user will name.
            if path.is_dir() && !path.ends_with("templates") {
                folders.push(path);
            } else if path.file_name().is_some_and(|n| n == "manifest.json") {
                let text = std::fs::read_to_string(&path).unwrap();
                let manifest: Value = serde_json::from_str(&text).unwrap();
                let Some(kind) = manifest["output"]["kind"].as_str() else {
                    continue;
                };
                seen += 1;
                let known = !schema["properties"][kind].is_null();
                assert!(known, "{}: kind '{kind}'", path.display());
            }
        }
    }
    assert!(seen >= 20, "{seen}");
}
