//! Writes a collection of `items` items.

use plyflow_sdk::{Host, Step, StepError, export_step};

#[derive(serde::Deserialize)]
struct Parameters {
    items: u64,
}

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "split", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {"items": {"type": "integer", "default": 2, "doc": "How many."}},
        "inputs": {"in": {"kind": "any", "required": false, "many": true, "doc": "Anything."}},
        "output": {"kind": "test-items", "collection": true},
        "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        let labels: Vec<String> = (0..p.items).map(|i| format!("item-{i}")).collect();
        host.write_attributes(&serde_json::json!({"items": p.items}))?;
        host.collection(&labels)
    }
}

export_step!(Plugin);
