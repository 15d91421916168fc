//! Returns an error with a text; told to, only for numbers beyond a bound.

use plyflow_sdk::{Host, Log, Step, StepError, export_step};

#[derive(serde::Deserialize)]
struct Parameters {
    #[serde(default)]
    value: f64,
    #[serde(default = "all")]
    beyond: f64,
}

fn all() -> f64 {
    -1.0
}

struct Plugin;

impl Step for Plugin {
    const MANIFEST: &'static str = r#"{
        "name": "error", "version": "0.1.0", "vendor": "Plyflow tests", "kind": "step", "role": "test",
        "summary": "A test plugin.",
        "parameters": {
            "value": {"type": "number", "default": 0, "doc": "The number."},
            "beyond": {"type": "number", "default": -1, "doc": "Numbers above this fail."}
        },
        "inputs": {},
        "output": {"kind": "test"},
        "results": {}
    }"#;

    fn run(host: &Host) -> Result<(), StepError> {
        let p: Parameters = host.parameters()?;
        if p.value <= p.beyond {
            return host.write_attributes(&serde_json::json!({"value": p.value}));
        }
        host.log(Log::Warn, "something is odd");
        Err("the tool has no surface: give it at least one triangle".into())
    }
}

export_step!(Plugin);
