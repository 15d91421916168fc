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
