//! Parameters of a manifest as JSON Schema (draft 2020-12), for editors and help texts.

use super::{Bounds, Declaration, Manifest, PluginKind, Shape};
use crate::units::quantity_schema;
use indexmap::IndexMap;
use serde_json::{Map, Value, json};

/// JSON Schema of a `with` block that fits this plugin.
pub fn parameters(manifest: &Manifest) -> Value {
    object(&manifest.parameters)
}

fn object(fields: &IndexMap<String, Declaration>) -> Value {
    let properties: Map<String, Value> = fields
        .iter()
        .map(|(name, d)| (name.clone(), declaration(d)))
        .collect();
    let required: Vec<&String> = fields
        .iter()
        .filter(|(_, d)| d.required)
        .map(|(name, _)| name)
        .collect();
    let mut schema = json!({
        "type": "object", "properties": properties, "additionalProperties": false
    });
    if !required.is_empty() {
        schema["required"] = json!(required);
    }
    schema
}

/// JSON Schema of one declaration.
pub fn declaration(d: &Declaration) -> Value {
    let mut schema = match &d.shape {
        Shape::Boolean => json!({"type": "boolean"}),
        Shape::Integer(b) => bounded(json!({"type": "integer"}), b),
        Shape::Number(b) => bounded(json!({"type": "number"}), b),
        Shape::String => json!({"type": "string"}),
        Shape::Choice(values) => json!({"enum": values}),
        Shape::Quantity(dimension, _) => quantity_schema(*dimension).to_value(),
        Shape::List(of, items) => {
            let mut list = json!({"type": "array", "items": declaration(of)});
            for (key, count) in [("minItems", items.minimum), ("maxItems", items.maximum)] {
                if let Some(count) = count {
                    list[key] = json!(count);
                }
            }
            list
        }
        Shape::Map(of) => json!({"type": "object", "additionalProperties": declaration(of)}),
        Shape::Object(fields) => object(fields),
        Shape::Scene { .. } => json!({"type": ["string", "object"]}),
        Shape::SheetMaterial => json!({"type": ["string", "object"]}),
        Shape::File => json!({"type": "string"}),
        Shape::Component(kind) => component(*kind),
    };
    let mut doc = d.doc.clone();
    if let Shape::Quantity(_, bounds) = &d.shape {
        doc = [
            doc,
            in_words(bounds),
            schema["description"]
                .as_str()
                .unwrap_or_default()
                .to_owned(),
        ]
        .into_iter()
        .filter(|s| !s.is_empty())
        .collect::<Vec<_>>()
        .join(" ");
    }
    if !doc.is_empty() {
        schema["description"] = json!(doc);
    }
    if let Some(default) = &d.default {
        schema["default"] = default.clone();
    }
    schema
}

fn component(kind: PluginKind) -> Value {
    json!({
        "x-component": kind.name(),
        "anyOf": [
            {"type": "string"},
            {
                "type": "object",
                "properties": {"plugin": {"type": "string"}, "with": {"type": "object"}},
                "required": ["plugin"],
                "additionalProperties": false
            }
        ]
    })
}

fn bounded(mut schema: Value, bounds: &Bounds) -> Value {
    let keys = [
        ("minimum", &bounds.minimum),
        ("maximum", &bounds.maximum),
        ("exclusiveMinimum", &bounds.exclusive_minimum),
    ];
    for (key, bound) in keys {
        if let Some(bound) = bound {
            schema[key] = json!(bound.value);
        }
    }
    schema
}

fn in_words(bounds: &Bounds) -> String {
    let parts: Vec<String> = [
        ("more than", &bounds.exclusive_minimum),
        ("at least", &bounds.minimum),
        ("at most", &bounds.maximum),
    ]
    .into_iter()
    .filter_map(|(words, b)| b.as_ref().map(|b| format!("{words} {}", b.text)))
    .collect();
    if parts.is_empty() {
        String::new()
    } else {
        format!("({})", parts.join(", "))
    }
}
