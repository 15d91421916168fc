//! Its manifest promises a collection, it declares none.

use plyflow_sdk::{Host, Step, StepError, export_step};

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "no-collection", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {},
        "output": {"kind": "test-items", "collection": true},
        "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        host.write_attributes(&serde_json::json!({}))
    }
}

export_step!(Plugin);
