//! Writes one number as attribute and result.

use plyflow_sdk::{Host, Step, StepError, export_step};

#[derive(serde::Deserialize)]
struct Parameters {
    value: f64,
}

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "trivial", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {"value": {"type": "number", "default": 0, "doc": "The number."}},
        "inputs": {"in": {"kind": "any", "required": false, "many": true, "doc": "Anything."}},
        "output": {"kind": "test"},
        "results": {"value": {"unit": "1", "doc": "The number."}}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        host.write_attributes(&serde_json::json!({"value": p.value, "item": host.item()?}))?;
        host.result("value", p.value, "1")
    }
}

export_step!(Plugin);
