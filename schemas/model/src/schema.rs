//! JSON Schemas (draft 2020-12) of the files that users write, generated from the types.

use crate::manifest::{Manifest, PluginKind};
use crate::material::Material;
use crate::scene::Scene;
use crate::workflow::{Expected, Workflow};
use schemars::{JsonSchema, generate::SchemaSettings};
use serde_json::{Value, json};

fn schema_of<T: JsonSchema>(id: &str, title: &str) -> Value {
    let mut schema = SchemaSettings::draft2020_12()
        .into_generator()
        .into_root_schema_for::<T>()
        .to_value();
    schema["$id"] = json!(format!(
        "https://example.org/plyflow/schemas/{id}.schema.json"
    ));
    schema["title"] = json!(title);
    crate::canonical(schema)
}

/// Schema of a workflow file.
pub fn workflow() -> Value {
    schema_of::<Workflow>("workflow", "Plyflow workflow")
}

/// Schema of a scene file.
pub fn scene() -> Value {
    schema_of::<Scene>("scene", "Plyflow scene")
}

/// Schema of a material file.
pub fn material() -> Value {
    schema_of::<Material>("material", "Plyflow material")
}

/// Schema of a file of expectations.
pub fn expected() -> Value {
    schema_of::<Expected>("expected", "Plyflow expectations")
}

/// All schemas with their file names, as checked in under `schemas/json/`.
pub fn all() -> [(&'static str, Value); 4] {
    [
        ("workflow.schema.json", workflow()),
        ("scene.schema.json", scene()),
        ("material.schema.json", material()),
        ("expected.schema.json", expected()),
    ]
}

/// Schema of a workflow file that also knows these plugins: `plugin` completes their names, `with` their
/// parameters and `from` their ports. Plugins that are not among them (a path, say) stay free.
pub fn workflow_with(manifests: &[Manifest]) -> Value {
    let mut schema = workflow();
    let steps: Vec<&Manifest> = manifests
        .iter()
        .filter(|m| m.kind == PluginKind::Step)
        .collect();
    let step = &mut schema["$defs"]["Step"];
    let names: Vec<&str> = steps.iter().map(|m| m.name.as_str()).collect();
    step["properties"]["plugin"]["anyOf"] = json!([{"enum": names}, {"type": "string"}]);
    step["properties"]["plugin"]
        .as_object_mut()
        .map(|p| p.remove("type"));
    step["allOf"] = steps
        .iter()
        .map(|m| {
            let ports: serde_json::Map<String, Value> = m
                .inputs
                .iter()
                .map(|(name, port)| (name.clone(), json!({"description": port.doc})))
                .collect();
            json!({
                "if": {"properties": {"plugin": {"const": m.name}}, "required": ["plugin"]},
                "then": {"properties": {
                    "with": crate::manifest::schema::parameters(m),
                    "from": {
                        "anyOf": [
                            {"type": "string"},
                            {"type": "object", "properties": ports, "additionalProperties": false},
                            {"type": "null"}
                        ]
                    }
                }}
            })
        })
        .collect();
    schema
}
