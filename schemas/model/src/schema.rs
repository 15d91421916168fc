//! JSON Schemas (draft 2020-12) of the files that users write and of what artifacts tell, generated from the types.

use crate::artifact;
use crate::manifest::{Manifest, PluginKind};
use crate::material::Material;
use crate::profile::Profile;
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

/// As [`workflow`], for editors: `${name}` of a study may stand where a step takes a number or a quantity. Whether the file is a study,
/// and what such a text comes to at each of its points, is checked by the program.
pub fn workflow_for_editors() -> Value {
    let mut schema = workflow();
    let definitions = &mut schema["$defs"];
    open_fields(&mut definitions["Resources"]);
    accept_expressions(&mut definitions["Step"]["properties"]["retries"]);
    schema
}

/// Lets expressions stand for the values of a mapping's keys.
fn open_fields(schema: &mut Value) {
    if let Some(fields) = schema.get_mut("properties").and_then(Value::as_object_mut) {
        fields.values_mut().for_each(accept_expressions);
    }
}

/// Lets a text with `${..}` stand for a value, where no text can stand there anyway, and for the values in it.
fn accept_expressions(schema: &mut Value) {
    open_fields(schema);
    for key in ["items", "additionalProperties"] {
        if let Some(below) = schema.get_mut(key).filter(|v| v.is_object()) {
            accept_expressions(below);
        }
    }
    let is = |t: &Value, word: &str| {
        t == word || t.as_array().is_some_and(|l| l.iter().any(|t| t == word))
    };
    let free = |s: &Value| is(&s["type"], "string") && s["pattern"].is_null();
    let any = |s: &Value| s["anyOf"].as_array().is_some_and(|l| l.iter().any(free));
    if free(schema) || any(schema) || ["object", "array"].iter().any(|t| is(&schema["type"], t)) {
        return;
    }
    let Some(own) = schema.as_object_mut() else {
        return;
    };
    let mut outside = serde_json::Map::new();
    for key in ["description", "default"] {
        if let Some(value) = own.remove(key) {
            outside.insert(key.into(), value);
        }
    }
    let expression = json!({
        "type": "string",
        "pattern": r"\$\{.+\}",
        "description": "An expression with variables of the study, such as `2 * ${size}`.",
    });
    outside.insert("anyOf".into(), json!([std::mem::take(own), expression]));
    *own = outside;
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

/// Schema of a profile file.
pub fn profile() -> Value {
    schema_of::<Profile>("profile", "Plyflow profile of a cluster")
}

/// The attributes of the artifacts, by kind.
#[derive(JsonSchema)]
#[serde(rename_all = "kebab-case")]
#[allow(
    dead_code,
    reason = "says which kinds there are; nothing has all of them"
)]
struct Artifacts {
    /// A formed stack of sheets.
    forming: artifact::Forming,
    /// Tools and outlines that a scene may name.
    geometry: artifact::Geometry,
    /// What a detection flags on the plies of a formed run.
    defects: artifact::Defects,
    /// Where finer runs look closer; a collection.
    zones: artifact::Zones,
    /// What drives the fine run of a zone, or a coarse run of the whole again.
    boundary: Boundary,
    /// Wrinkles, bridging and shear of coarse, fine and reference runs at the same places.
    comparison: artifact::Comparison,
    /// Which defects stay when the zones are run in other ways, and between which bounds their sizes lie.
    confirmation: artifact::Confirmation,
    /// Wrinkles and bridging of a run or a scan by themselves, sections and slip.
    measurement: artifact::Measurement,
    /// How results settle as a mesh is refined.
    mesh_study: artifact::MeshStudy,
    /// A run of a test on a coupon.
    coupon: artifact::Coupon,
    /// A law fitted to test data.
    characterisation: artifact::Characterisation,
    /// Wrinkles of a formed ply on circles about a vertical axis.
    census: artifact::Census,
    /// Censuses of several runs.
    census_comparison: artifact::CensusComparison,
    /// How far a component keeps the contract of its kind.
    conformance: artifact::Conformance,
    /// Files for other programs.
    export: artifact::Export,
    /// The table of a study; not a step's artifact.
    study_table: artifact::StudyTable,
}

#[derive(JsonSchema)]
#[serde(untagged)]
#[allow(dead_code, reason = "says of what forms a boundary is")]
enum Boundary {
    Zone(artifact::Boundary),
    Feedback(artifact::Feedback),
}

/// Schema of the attributes of artifacts: a property for each kind.
pub fn artifacts() -> Value {
    schema_of::<Artifacts>("artifacts", "Attributes of Plyflow's artifacts")
}

/// All schemas with their file names, as checked in under `schemas/json/`.
pub fn all() -> [(&'static str, Value); 6] {
    [
        ("workflow.schema.json", workflow_for_editors()),
        ("scene.schema.json", scene()),
        ("material.schema.json", material()),
        ("expected.schema.json", expected()),
        ("profile.schema.json", profile()),
        ("artifacts.schema.json", artifacts()),
    ]
}

/// Schema of a workflow file that also knows these plugins: `plugin` completes their names, `with` their
/// parameters and `from` their ports. Plugins that are not among them (a path, say) stay free.
pub fn workflow_with(manifests: &[Manifest]) -> Value {
    let mut schema = workflow_for_editors();
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
                    "with": parameters_for_editors(m),
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

fn parameters_for_editors(manifest: &Manifest) -> Value {
    let mut schema = crate::manifest::schema::parameters(manifest);
    accept_expressions(&mut schema);
    schema
}
