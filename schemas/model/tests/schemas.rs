//! The checked-in JSON Schemas are those of the types.

use std::path::Path;

#[test]
fn checked_in_schemas_are_those_of_the_types() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../json");
    for (name, schema) in plyflow_model::schema::all() {
        let wanted = format!("{}\n", serde_json::to_string_pretty(&schema).unwrap());
        let path = folder.join(name);
        if std::env::var_os("UPDATE_SCHEMAS").is_some() {
            std::fs::write(&path, &wanted).unwrap();
        }
        let found = std::fs::read_to_string(&path).unwrap_or_default();
        assert!(
            found == wanted,
            "schemas/json/{name} is out of date: UPDATE_SCHEMAS=1 cargo test -p plyflow-model"
        );
    }
}

#[test]
fn a_schema_with_plugins_ties_parameters_and_ports_to_the_plugin_s_name() {
    let manifest = plyflow_model::Manifest::parse(
        r#"{"name": "detect", "version": "1", "kind": "step", "role": "r", "summary": "s",
            "parameters": {"limit": {"type": "quantity", "dimension": "angle", "required": true}},
            "inputs": {"formed": {"kind": "forming"}}, "output": {"kind": "defects"}}"#,
    )
    .unwrap();
    let schema = plyflow_model::schema::workflow_with(&[manifest]);
    let step = &schema["$defs"]["Step"];
    assert_eq!(
        step["properties"]["plugin"]["anyOf"][0]["enum"],
        serde_json::json!(["detect"])
    );
    let tie = &step["allOf"][0];
    assert_eq!(tie["if"]["properties"]["plugin"]["const"], "detect");
    let then = &tie["then"]["properties"];
    assert_eq!(then["with"]["required"], serde_json::json!(["limit"]));
    let limit = &then["with"]["properties"]["limit"]["anyOf"];
    assert_eq!(limit[0]["x-dimension"], "angle");
    assert_eq!(limit[1]["pattern"], r"\$\{.+\}");
    assert_eq!(then["from"]["anyOf"][1]["additionalProperties"], false);
}

/// Calls `see` with every mapping of a JSON value.
fn walk(
    value: &serde_json::Value,
    see: &mut impl FnMut(&serde_json::Map<String, serde_json::Value>),
) {
    match value {
        serde_json::Value::Object(map) => {
            see(map);
            map.values().for_each(|v| walk(v, see));
        }
        serde_json::Value::Array(items) => items.iter().for_each(|v| walk(v, see)),
        _ => {}
    }
}

#[test]
fn bounds_of_quantities_have_units_and_bounds_of_numbers_have_none() {
    let mut seen = 0;
    for (name, schema) in plyflow_model::schema::all() {
        walk(&schema, &mut |map| {
            for key in ["x-minimum", "x-maximum", "x-exclusive-minimum"] {
                // A number here would bound nothing: plain numbers have `minimum` and `maximum`.
                if let Some(bound) = map.get(key) {
                    assert!(bound.is_string(), "{name}: {key} {bound} of {map:?}");
                    seen += 1;
                }
            }
        });
    }
    assert!(seen > 10);
}

#[test]
fn an_editor_takes_an_expression_where_a_number_or_a_quantity_stands_and_nowhere_else() {
    let manifest = plyflow_model::Manifest::parse(
        r#"{"name": "p", "version": "1", "kind": "step", "role": "r", "summary": "s", "inputs": {}, "output": {"kind": "k"},
            "parameters": {
                "size": {"type": "quantity", "dimension": "length", "required": true, "doc": "d"}, "n": {"type": "integer", "default": 1},
                "x": {"type": "number"}, "on": {"type": "boolean"}, "way": {"type": "choice", "values": ["a", "b"]},
                "label": {"type": "string"}, "all": {"type": "list", "of": {"type": "number"}},
                "in": {"type": "object", "fields": {"y": {"type": "number"}}}
            }}"#,
    )
    .unwrap();
    let schema = plyflow_model::schema::workflow_with(&[manifest]);
    let accepts = |s: &serde_json::Value| {
        let any = s["anyOf"].as_array();
        any.is_some_and(|l| l.iter().any(|s| s["pattern"] == r"\$\{.+\}"))
    };
    let with = &schema["$defs"]["Step"]["allOf"][0]["then"]["properties"]["with"]["properties"];
    for name in ["size", "n", "x", "on", "way"] {
        assert!(accepts(&with[name]), "{name}: {}", with[name]);
    }
    assert!(with["size"]["description"].is_string() && with["n"]["default"] == 1);
    assert!(!accepts(&with["label"]) && with["label"]["type"] == "string");
    assert!(accepts(&with["all"]["items"]) && !accepts(&with["all"]));
    assert!(accepts(&with["in"]["properties"]["y"]));
    for name in ["cores", "memory", "time_limit"] {
        assert!(
            accepts(&schema["$defs"]["Resources"]["properties"][name]),
            "{name}"
        );
    }
    assert!(accepts(&schema["$defs"]["Step"]["properties"]["retries"]));
    // What the program checks by is as strict as before.
    let strict = plyflow_model::schema::workflow();
    assert!(!accepts(
        &strict["$defs"]["Resources"]["properties"]["cores"]
    ));
}
