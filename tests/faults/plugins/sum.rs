//! Adds up the attribute `value` of all its inputs.

use plyflow_sdk::{Host, Step, StepError, export_step};

#[derive(serde::Deserialize)]
struct Attributes {
    #[serde(default)]
    value: f64,
}

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "sum", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {},
        "inputs": {"in": {"kind": "any", "required": false, "many": true, "doc": "Anything."}},
        "output": {"kind": "test"},
        "results": {"sum": {"unit": "1", "doc": "The sum."}}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let mut sum = 0.0;
        for input in host.inputs_of("in")? {
            let a: Attributes = host.attributes(&input)?;
            sum += a.value;
        }
        host.write_attributes(&serde_json::json!({"value": sum}))?;
        host.result("sum", sum, "1")
    }
}

export_step!(Plugin);
